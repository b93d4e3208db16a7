//! Stage `settle`: radiance goes to its root and its ledger record, finished samples to the statistics, finished roots
//! to the film.

use super::ledger::{NO_BIN, NO_RECORD};
use super::shard::Shard;
use crate::film::REL_MSE_EPSILON;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Radiance found by eight samples.
pub(super) struct Found8 {
    /// What it counts in the pixel: prefix weight included.
    pub pixel: Vec3x8,
    /// What it counts in the sample's own estimate: no prefix weight.
    pub local: Vec3x8,
}

impl Shard<'_> {
    /// Adds radiance to the roots and ledger records of the lanes in `mask`. What is not finite is counted, not added.
    #[inline]
    pub(super) fn gather(&mut self, mask: Mask8, root: U32x8, ledger: U32x8, found: &Found8) {
        let radiance = found.pixel;
        let mask = mask & radiance.abs().max_component().gt(F32x8::ZERO) | mask.and_not(radiance.is_finite());
        if mask.none() {
            return;
        }
        let good = mask & radiance.is_finite();
        let root = root.to_array();
        let (r, g, b) = (radiance.x.to_array(), radiance.y.to_array(), radiance.z.to_array());
        for i in good.lanes() {
            let sum = &mut self.roots.get(root[i]).radiance;
            sum[0] += f64::from(r[i]);
            sum[1] += f64::from(g[i]);
            sum[2] += f64::from(b[i]);
        }
        for i in mask.and_not(good).lanes() {
            self.count_non_finite(root[i]);
        }
        let logged = mask.and_not(ledger.eq(U32x8::splat(NO_RECORD)));
        if logged.any() {
            let x = found.local * self.firefly_scale(good, radiance, U32x8::new(root));
            let (r, g, b) = (x.x.to_array(), x.y.to_array(), x.z.to_array());
            let ledger = ledger.to_array();
            for i in (good & logged).lanes() {
                self.ledger.gather(ledger[i], [r[i], g[i], b[i]]);
            }
            for i in mask.and_not(good).lanes() {
                self.ledger.mark_incomplete(ledger[i]);
            }
        }
    }

    /// What part of eight contributions the statistics take. The variance of the picture leaves outliers out; so must
    /// the moments that are weighed against it, or cells that met one sample of them would split for ever.
    pub(super) fn firefly_scale(&mut self, mask: Mask8, radiance: Vec3x8, root: U32x8) -> F32x8 {
        let limit = F32x8::splat(self.outlier);
        let square = radiance * radiance;
        // the error weight of a channel is at most that of a black pixel
        let most = square.max_component() * F32x8::splat(1.0 / REL_MSE_EPSILON as f32);
        if (mask & most.gt(limit)).none() {
            return F32x8::ONE;
        }
        let error = self.job.settings.learning.norm.of(square * self.roots.targets(root, mask).error_weight);
        error.gt(limit).select((limit / error).sqrt(), F32x8::ONE)
    }

    /// Counts a value that was not finite and remembers the first pixel.
    pub(super) fn count_non_finite(&mut self, root: u32) {
        self.counters.non_finite += 1;
        if self.counters.first_non_finite == 0 {
            self.counters.first_non_finite = u64::from(self.roots.get(root).target.film) + 1;
        }
    }

    /// Charges one ray of relative `cost` to the root and the ledger record of each lane in `mask`.
    #[inline]
    pub(super) fn charge(&mut self, mask: Mask8, root: U32x8, ledger: U32x8, cost: f32) {
        let root = root.to_array();
        for i in mask.lanes() {
            self.roots.get(root[i]).rays += 1;
        }
        let logged = mask.and_not(ledger.eq(U32x8::splat(NO_RECORD)));
        if logged.any() {
            let ledger = ledger.to_array();
            for i in logged.lanes() {
                self.ledger.charge(ledger[i], cost);
            }
        }
    }

    /// Ends the paths of the lanes in `mask`.
    pub(super) fn close_lanes(&mut self, mask: Mask8, root: U32x8, ledger: U32x8, depth: U32x8) {
        let (root, ledger, depth) = (root.to_array(), ledger.to_array(), depth.to_array());
        for i in mask.lanes() {
            self.close(root[i], ledger[i], depth[i]);
        }
    }

    /// Closes a lane or a drained vertex of a ledger record and logs what that finishes.
    #[inline]
    pub(super) fn settle_record(&mut self, record: u32) {
        let (training, counters) = (&mut self.training, &mut self.counters);
        self.ledger.close(record, |f| {
            let Some(t) = training.as_mut().filter(|_| f.bin != NO_BIN) else { return };
            counters.samples_logged += 1;
            if !t.log(f.bin, f.value, f.cost) {
                counters.samples_refused += 1;
            } else if let Some(d) = f.pair {
                t.log_pair(f.bin, d);
            }
        });
    }

    /// Ends a path of `depth` segments: closes a lane or a drained vertex of `root` and `ledger`. A finished camera
    /// sample goes to its pixel.
    #[inline]
    pub(super) fn close(&mut self, root: u32, ledger: u32, depth: u32) {
        self.counters.path_segments += u64::from(depth);
        self.settle_record(ledger);
        if let Some(done) = self.roots.close(root) {
            self.counters.camera_samples += 1;
            if let Some(p) = self.pixels.get_mut(done.target.pixel as usize) {
                p.add(done.radiance, done.rays);
            }
            if let Some(a) = self.aovs.get_mut(done.target.pixel as usize) {
                a.paths += 1.0 + f64::from(done.splits);
            }
        }
    }
}
