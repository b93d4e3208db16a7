//! Stage `settle`: radiance goes to its root, finished roots go to the film.

use super::shard::Shard;
use croupier_simd::{Mask8, U32x8, Vec3x8};

impl Shard<'_> {
    /// Adds radiance to the roots of the lanes in `mask`. What is not finite is counted, not added.
    #[inline]
    pub(super) fn gather(&mut self, mask: Mask8, root: U32x8, radiance: Vec3x8) {
        let mask =
            mask & radiance.abs().max_component().gt(croupier_simd::F32x8::ZERO) | mask.and_not(radiance.is_finite());
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
    }

    /// Counts a value that was not finite and remembers the first pixel.
    pub(super) fn count_non_finite(&mut self, root: u32) {
        self.counters.non_finite += 1;
        if self.counters.first_non_finite == 0 {
            let slot = self.roots.get(root).pixel;
            self.counters.first_non_finite = self.film_index(slot).map_or(0, |i| i as u64 + 1);
        }
    }

    /// Charges one ray to the root of each lane in `mask`.
    #[inline]
    pub(super) fn charge(&mut self, mask: Mask8, root: U32x8) {
        let root = root.to_array();
        for i in mask.lanes() {
            self.roots.get(root[i]).rays += 1;
        }
    }

    /// Closes a lane or a drained vertex of `root`; a finished camera sample goes to its pixel.
    #[inline]
    pub(super) fn close(&mut self, root: u32) {
        if let Some(done) = self.roots.close(root) {
            self.counters.camera_samples += 1;
            if let Some(p) = self.pixels.get_mut(done.pixel as usize) {
                p.add(done.radiance, done.rays);
            }
        }
    }
}
