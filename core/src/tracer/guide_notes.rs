//! What path guiding learns from: of each sample in the ledger, the direction that its bounce took. When the sample is
//! finished, what the bounce has contributed goes to the shard's log.
//!
//! And what it promises: how much larger the second moments of samples would be without it. What that is of a sample goes to
//! the sample that it is part of, up to the camera sample (`learn/guiding/watch.rs` has the equations).

use super::job::Job;
use super::ledger::{Finished, FinishedCameraSample};
use crate::learn::Guiding;
use crate::learn::guiding::{COMPILED, GuideLog, NO_LEAF, Promise};
use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8};

/// Directions of eight samples' bounces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GuideNote8 {
    /// Lanes that could have one.
    pub lanes: Mask8,
    /// Leaves of the guide; [`NO_LEAF`] where there is none to learn from.
    pub leaf: U32x8,
    /// Density of the bounce over what it would be without the guide, the second moment without it over that with it. 1
    /// where it does not decide.
    pub unguided: F32x8,
    /// Density of the BSDF, without the guide, in the direction of the light sample, 1/sr.
    pub nee_pdf: F32x8,
    /// Share of the guide's density, see [`GuideLog::add`].
    pub share: U32x8,
    /// Points of the square, [`quantised`](crate::learn::guiding::sphere::quantised).
    pub point: U32x8,
    /// Density of the direction, 1/sr, as if all samples that are learned from had been drawn from one mixture.
    pub pdf: F32x8,
    /// The density that it was drawn with, over that.
    pub ratio: F32x8,
    /// Lanes whose emission is weighted against light samples as if there were no guide.
    pub weighted_as_bsdf: Mask8,
}

impl GuideNote8 {
    /// Nothing.
    pub(crate) const NONE: Self = Self {
        lanes: Mask8::NONE,
        leaf: U32x8::splat(NO_LEAF),
        unguided: F32x8::ONE,
        nee_pdf: F32x8::ZERO,
        share: U32x8::splat(0),
        point: U32x8::splat(0),
        pdf: F32x8::ZERO,
        ratio: F32x8::ONE,
        weighted_as_bsdf: Mask8::NONE,
    };
}

/// The direction of a sample's bounce, 36 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct GuideNote {
    /// Leaf, and below it in 8 bits the share; [`NO_LEAF`] if there is nothing to learn from.
    leaf: u32,
    point: u32,
    /// Upper halves of two floats: [`GuideNote8::ratio`], and below it [`GuideNote8::pdf`], of which a log keeps no more.
    densities: u32,
    /// What next event estimation gave the sample, mean of rgb. Of a camera sample: what is expected of it.
    nee: f32,
    /// What it would have given without the guide.
    unguided_nee: f32,
    /// What emission that the bounce met would have given more without the guide, by its MIS weight.
    more_emission: f32,
    /// Density of the bounce over that of the BSDF, as MIS weights of emission that it meets have it.
    mis_ratio: f32,
    /// See [`GuideNote8::unguided`]. Of a camera sample: what a squared error of it counts in the error of the picture; 0 if
    /// it promises nothing.
    unguided: f32,
    /// What the second moments of the samples of the vertex that the bounce led to would be larger by without the guide,
    /// from there on, times what they count, squared; of those that have ended.
    excess: f32,
}

impl GuideNote {
    /// Nothing to learn from.
    const NONE: Self = Self {
        leaf: NO_LEAF,
        point: 0,
        densities: 0,
        nee: 0.0,
        unguided_nee: 0.0,
        more_emission: 0.0,
        mis_ratio: 1.0,
        unguided: 1.0,
        excess: 0.0,
    };
}

/// Notes on the samples in the ledger, by slot, and the log that they go to; nothing if guiding is off.
#[derive(Debug)]
pub(crate) struct GuideNotes<'m> {
    notes: &'m mut [GuideNote],
    log: Option<GuideLog<'m>>,
    /// What guiding promises; one if the settings leave open whether it pays, else none.
    pub(super) promise: &'m mut [Promise],
}

/// Mean of the channels.
fn mean(rgb: [f32; 3]) -> f32 {
    rgb.iter().sum::<f32>() * (1.0 / 3.0)
}

impl<'m> GuideNotes<'m> {
    /// Number of notes for a ledger of so many records.
    fn capacity(job: &Job, ledger: usize) -> usize {
        if job.guide.is_some() { ledger } else { 0 }
    }

    /// Number of promises.
    fn promises(job: &Job) -> usize {
        usize::from(COMPILED && job.settings.learning.guiding == Guiding::Auto)
    }

    /// Bytes; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(m: Measure, job: &Job, ledger: usize) -> Measure {
        let m = m.add::<GuideNote>(Self::capacity(job, ledger));
        job.guide.map_or(m, |size| GuideLog::measure(m, size)).add::<Promise>(Self::promises(job))
    }

    pub(crate) fn carve(c: &mut Carver<'m>, job: &Job, ledger: usize) -> Result<Self, MemoryError> {
        let notes = c.take_unset(Self::capacity(job, ledger))?;
        let log = job.guide.filter(|_| COMPILED).map(|size| GuideLog::carve(c, size)).transpose()?;
        Ok(Self { notes, log, promise: c.take_unset(Self::promises(job))? })
    }

    /// The log.
    #[inline(always)]
    pub(crate) fn log(&self) -> Option<&GuideLog<'m>> {
        self.log.as_ref().filter(|_| COMPILED)
    }

    /// The same, to be changed.
    #[inline(always)]
    pub(crate) fn log_mut(&mut self) -> Option<&mut GuideLog<'m>> {
        self.log.as_mut().filter(|_| COMPILED)
    }

    /// Forgets what was learned.
    pub(crate) fn clear(&mut self) {
        if let Some(log) = self.log_mut() {
            log.clear();
        }
        self.promise.fill(Promise::default());
    }

    /// Is it to be found out whether guiding pays?
    #[inline(always)]
    pub(crate) fn promises_anything(&self) -> bool {
        COMPILED && !self.promise.is_empty()
    }

    /// A sample begins, of which nothing is known.
    #[inline(always)]
    pub(crate) fn open(&mut self, slot: u32) {
        if let Some(note) = self.notes.get_mut(slot as usize) {
            *note = GuideNote::NONE;
        }
    }

    /// A camera sample begins. If its pixel is guided, it tells what guiding promises: of this value it is expected to be,
    /// and its squared error counts so much in the error of the picture. With adaptive sampling pixels with more samples
    /// count too much.
    pub(crate) fn open_camera_sample(&mut self, slot: u32, expected: [f32; 3], error_weight: [f32; 3]) {
        if let Some(note) = self.notes.get_mut(slot as usize) {
            *note = GuideNote { nee: mean(expected), unguided: mean(error_weight), ..GuideNote::NONE };
        }
    }

    /// Notes the direction in lane `i` of a sample whose next event estimation has given `nee`.
    pub(crate) fn note(&mut self, slot: u32, n: &GuideNote8, i: usize, nee: [f32; 3], nee_ratio: f32) {
        if let Some(note) = self.notes.get_mut(slot as usize) {
            let leaf = n.leaf.lane(i);
            *note = GuideNote {
                leaf: if leaf == NO_LEAF { NO_LEAF } else { leaf << 8 | n.share.lane(i) & 0xff },
                point: n.point.lane(i),
                // the ratio rounded, because its square counts
                densities: n.ratio.lane(i).to_bits().wrapping_add(0x8000) & 0xffff_0000 | n.pdf.lane(i).to_bits() >> 16,
                nee: mean(nee),
                unguided_nee: mean(nee) * nee_ratio,
                more_emission: 0.0,
                mis_ratio: if n.weighted_as_bsdf.lane(i) { 1.0 } else { n.unguided.lane(i) },
                unguided: n.unguided.lane(i),
                excess: 0.0,
            };
        }
    }

    /// The bounce of a sample met emission that counted so much with this MIS weight.
    pub(crate) fn met(&mut self, slot: u32, emission: f32, weight: f32) {
        if let Some(n) = self.notes.get_mut(slot as usize) {
            // by w = 1 / (1 + (l / m)^2) with the densities l of the light sample and m of the bounce
            let without = 1.0 / (weight + n.mis_ratio * n.mis_ratio * (1.0 - weight));
            n.more_emission += emission * (without - 1.0);
        }
    }

    /// A sample has ended.
    #[inline]
    pub(crate) fn close(&mut self, f: &Finished) {
        let Some((n, log)) = self.notes.get(f.slot as usize).copied().zip(self.log.as_mut()) else { return };
        let all = mean(f.radiance);
        let bounce = (all - n.nee).max(0.0);
        if all > 0.0
            && !self.promise.is_empty()
            && let Some(parent) = self.notes.get_mut(f.parent as usize)
        {
            let other = bounce + n.more_emission;
            let without = n.unguided_nee * (n.unguided_nee + 2.0 * other) + n.unguided * (other * other + n.excess);
            let excess = without - all * all;
            let counts = mean(f.added) / all;
            parent.excess += counts * counts * excess;
        }
        if f.noted && n.leaf != NO_LEAF {
            let [ratio, pdf] = [n.densities & 0xffff_0000, n.densities << 16].map(f32::from_bits);
            let contribution = bounce * ratio;
            log.add(n.leaf >> 8, n.leaf & 0xff, n.point, contribution * contribution, pdf);
        }
    }

    /// A camera sample has ended with this estimate.
    #[inline]
    pub(crate) fn close_camera_sample(&mut self, f: &FinishedCameraSample) {
        if let Some((n, promise)) = self.notes.get(f.slot as usize).zip(self.promise.first_mut())
            && f.complete
            && n.unguided > 0.0
        {
            let error = mean(f.radiance) - n.nee;
            let square = error * error;
            promise.add(n.unguided * (square + n.excess), n.unguided * square);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ledger::NO_RECORD;
    use super::*;
    use crate::learn::guiding::GuideSize;
    use crate::testing::block;

    /// What the bounce gave, by the ratio of densities and squared, and the density, within the 2^-7 of the log. Killed by:
    /// halves exchanged, a ratio that is left out, the light sample counted.
    #[test]
    fn contributions_count_by_the_ratio_of_densities() {
        let size = GuideSize::within(1 << 16, 1).expect("a size");
        let (mut memory, at) = block(GuideLog::layout(size).expect("a layout").size);
        let mut log = GuideLog::new(size, &mut memory[at..]).expect("a log");
        log.clear();
        let mut notes = [GuideNote::zeroed(); 2];
        let mut all = GuideNotes { notes: &mut notes, log: Some(log), promise: &mut [] };
        let note = GuideNote8 {
            lanes: Mask8::first(2),
            leaf: U32x8::splat(3),
            unguided: F32x8::splat(2.0),
            share: U32x8::splat(77),
            point: U32x8::splat(5),
            pdf: F32x8::from_fn(|i| [0.3, 7.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0][i]),
            ratio: F32x8::from_fn(|i| [0.2, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0][i]),
            ..GuideNote8::NONE
        };
        let nee = [1.0; 3];
        (0..2).for_each(|i| all.note(i as u32, &note, i, nee, 1.0));
        (0..2).for_each(|slot| all.close(&finished(slot, NO_RECORD, 4.0, 0.0)));
        let bytes = all.log.as_ref().map(GuideLog::bytes).expect("a log");
        for (entry, [ratio, pdf]) in bytes.chunks_exact(12).zip([[0.2_f32, 0.3_f32], [1.0, 7.0]]) {
            let word = |i: usize| u32::from_le_bytes([entry[i], entry[i + 1], entry[i + 2], entry[i + 3]]);
            assert_eq!([word(0), word(4)], [3 << 8 | 77, 5]);
            let [square, density] = [word(8) & 0xffff_0000, word(8) << 16].map(f32::from_bits);
            let want = (3.0 * ratio).powi(2);
            assert!((square / want - 1.0).abs() < 0.02, "{square} for {want}");
            assert!((density / pdf - 1.0).abs() < 0.008, "{density} for {pdf}");
        }
        assert_eq!(bytes.len(), 24);
    }

    /// A noted sample that has ended.
    fn finished(slot: u32, parent: u32, radiance: f32, added: f32) -> Finished {
        let (radiance, added) = ([radiance; 3], [added; 3]);
        Finished { slot, noted: true, parent, added, bin: 0, radiance, value: radiance, cost: 1.0, pair: None }
    }

    /// One of two directions: what the BSDF brings there, its density, that of the mixture, the light's emission, the density
    /// of light samples.
    #[derive(Clone, Copy)]
    struct Direction {
        f: f32,
        p: f32,
        m: f32,
        emission: f32,
        l: f32,
    }

    /// Two bounces in a world of two directions, at whose first vertex emission is weighted as without the guide if `first`.
    struct World {
        first: bool,
        bounces: [[Direction; 2]; 2],
    }

    /// Directions of the light samples and of the bounces.
    type Way = ([usize; 2], [usize; 2]);

    fn ways() -> impl Iterator<Item = Way> {
        (0..16).map(|i| ([i & 1, i >> 1 & 1], [i >> 2 & 1, i >> 3]))
    }

    impl World {
        /// Density that MIS takes for a bounce.
        fn weighed(&self, depth: usize, d: Direction, guided: bool) -> f32 {
            if guided && !(self.first && depth == 0) { d.m } else { d.p }
        }

        /// Probability of a way, and what its light samples and the emission that its bounces meet give, each by its MIS
        /// weight.
        fn of(&self, (lights, bounces): Way, guided: bool) -> (f64, [[f32; 2]; 2]) {
            let mut probability = 1.0;
            let found = [0, 1].map(|depth| {
                let directions = &self.bounces[depth];
                let (light, bounce) = (directions[lights[depth]], directions[bounces[depth]]);
                let drawn = if guided { bounce.m } else { bounce.p };
                probability *= f64::from(light.l) * f64::from(drawn);
                let nee = {
                    let [l, other] = [light.l, self.weighed(depth, light, guided)].map(|x| x * x);
                    light.f * light.emission / light.l * l / (l + other)
                };
                let emission = {
                    let [own, l] = [self.weighed(depth, bounce, guided), bounce.l].map(|x| x * x);
                    bounce.f * bounce.emission / drawn * own / (own + l)
                };
                [nee, emission]
            });
            (probability, found)
        }

        /// Estimates of both vertices, the last one first.
        fn estimates(&self, way: Way, guided: bool) -> (f64, [f32; 2], [[f32; 2]; 2]) {
            let (probability, found) = self.of(way, guided);
            let d = self.bounces[0][way.1[0]];
            let last = found[1][0] + found[1][1];
            let first = found[0][0] + found[0][1] + d.f / if guided { d.m } else { d.p } * last;
            (probability, [last, first], found)
        }
    }

    /// The promise is the mean squared error without the guide, all of a path's vertices together, over all that can happen to
    /// two bounces and two light samples, and the error with it is that of the samples. Killed by: gains of vertices apart, a
    /// gain that is not of what a vertex counts squared, MIS weights of the guide's densities.
    #[test]
    fn the_promise_is_the_error_of_paths_without_the_guide() {
        let direction = |[f, p, m, emission, l]: [f32; 5]| Direction { f, p, m, emission, l };
        let size = GuideSize::within(1 << 16, 1).expect("a size");
        let (mut memory, at) = block(GuideLog::layout(size).expect("a layout").size);
        for first in [false, true] {
            let world = World {
                first,
                bounces: [
                    [direction([0.7, 0.75, 0.3, 0.2, 0.4]), direction([0.9, 0.25, 0.7, 1.5, 0.6])],
                    [direction([0.2, 0.5, 0.9, 3.0, 0.1]), direction([0.4, 0.5, 0.1, 0.0, 0.9])],
                ],
            };
            let (expected, weight) = (1.3, 2.0);
            let (mut promised, mut want) = ([0.0; 2], [0.0; 2]);
            for way in ways() {
                let mut log = GuideLog::new(size, &mut memory[at..]).expect("a log");
                log.clear();
                let (mut notes, mut promise) = ([GuideNote::zeroed(); 3], [Promise::default()]);
                let mut all = GuideNotes { notes: &mut notes, log: Some(log), promise: &mut promise };
                let (probability, [last, whole], found) = world.estimates(way, true);
                all.open_camera_sample(0, [expected; 3], [weight; 3]);
                for depth in [0, 1] {
                    let (slot, d) = (depth as u32 + 1, world.bounces[depth][way.1[depth]]);
                    let note = GuideNote8 {
                        leaf: U32x8::splat(1),
                        unguided: F32x8::splat(d.m / d.p),
                        weighted_as_bsdf: if first && depth == 0 { Mask8::all_lanes() } else { Mask8::NONE },
                        ..GuideNote8::NONE
                    };
                    let light = world.bounces[depth][way.0[depth]];
                    let [with, without] = [true, false].map(|guided| {
                        let [l, other] = [light.l, world.weighed(depth, light, guided)].map(|x| x * x);
                        l / (l + other)
                    });
                    all.open(slot);
                    all.note(slot, &note, 0, [found[depth][0]; 3], without / with);
                    let [own, l] = [world.weighed(depth, d, true), d.l].map(|x| x * x);
                    all.met(slot, found[depth][1], own / (own + l));
                }
                let d = world.bounces[0][way.1[0]];
                all.close(&finished(2, 1, last, d.f / d.m * last));
                all.close(&finished(1, 0, whole, whole));
                all.close_camera_sample(&FinishedCameraSample { slot: 0, radiance: [whole; 3], complete: true });
                let [without, with] = promise[0].sums();
                promised[0] += probability * without;
                promised[1] += probability * with;
                for (sum, guided) in want.iter_mut().zip([false, true]) {
                    let (probability, [_, whole], _) = world.estimates(way, guided);
                    *sum += probability * f64::from(weight * (whole - expected).powi(2));
                }
            }
            for (promised, want) in promised.into_iter().zip(want) {
                assert!((promised / want - 1.0).abs() < 1e-5, "{promised} for {want}, first {first}");
            }
            assert!((want[0] / want[1] - 1.0).abs() > 0.05, "both are alike: {want:?}");
        }
    }

    /// Killed by: promises of pixels that are not guided, or of camera samples of which something is missing.
    #[test]
    fn incomplete_camera_samples_promise_nothing() {
        let (mut notes, mut promise) = ([GuideNote::zeroed(); 1], [Promise::default()]);
        let mut all = GuideNotes { notes: &mut notes, log: None, promise: &mut promise };
        for (weight, complete, count) in [(0.0, true, 0.0), (1.0, false, 0.0), (1.0, true, 1.0)] {
            all.open_camera_sample(0, [0.5; 3], [weight; 3]);
            all.close_camera_sample(&FinishedCameraSample { slot: 0, radiance: [1.5; 3], complete });
            let [without, with] = all.promise[0].sums();
            assert_eq!([without, with], [count; 2]);
        }
    }
}
