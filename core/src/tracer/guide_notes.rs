//! What path guiding learns from: of each sample in the ledger, the direction that its bounce took. When the sample is
//! finished, what the bounce has contributed goes to the shard's log.

use super::job::Job;
use crate::learn::Guiding;
use crate::learn::guiding::{COMPILED, GuideLog, NO_LEAF, Promise};
use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Directions of eight samples' bounces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GuideNote8 {
    /// Lanes that could have one.
    pub lanes: Mask8,
    /// Leaves of the guide; [`NO_LEAF`] where there is none to learn from.
    pub leaf: U32x8,
    /// Lanes whose samples were guided, in leaves that have learned anything: they tell what guiding promises.
    pub promised: Mask8,
    /// Second moment of the bounce without the guide over what it has.
    pub unguided: F32x8,
    /// Share of the guide's density, see [`GuideLog::add`].
    pub share: U32x8,
    /// Points of the square, [`quantised`](crate::learn::guiding::sphere::quantised).
    pub point: U32x8,
    /// Density of the direction, 1/sr, as if all samples that are learned from had been drawn from one mixture.
    pub pdf: F32x8,
    /// The density that it was drawn with, over that.
    pub ratio: F32x8,
}

impl GuideNote8 {
    /// Nothing.
    pub(crate) const NONE: Self = Self {
        lanes: Mask8::NONE,
        leaf: U32x8::splat(NO_LEAF),
        promised: Mask8::NONE,
        unguided: F32x8::ONE,
        share: U32x8::splat(0),
        point: U32x8::splat(0),
        pdf: F32x8::ZERO,
        ratio: F32x8::ONE,
    };
}

/// The direction of a sample's bounce, 24 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct GuideNote {
    /// Leaf, and below it in 8 bits the share; [`NO_LEAF`] if there is nothing to learn from.
    leaf: u32,
    point: u32,
    /// Upper halves of two floats: [`GuideNote8::ratio`], and below it [`GuideNote8::pdf`], of which a log keeps no more.
    densities: u32,
    /// What next event estimation gave the sample, mean of rgb.
    nee: f32,
    /// What the square of the sample's estimate counts in the error of the picture; 0 if the guide promises nothing.
    importance: f32,
    /// See [`GuideNote8::unguided`].
    unguided: f32,
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

    /// What the squares of the estimates of vertices with these weights of the paths so far, and error weights of their
    /// pixels, count in the error of the picture. With adaptive sampling pixels with more samples count too much.
    pub(crate) fn importance(&self, beta: Vec3x8, error_weight: Vec3x8) -> F32x8 {
        if self.promise.is_empty() { F32x8::ZERO } else { (beta * beta * error_weight).mean() }
    }

    /// Notes the direction in lane `i` of a sample whose next event estimation has given `nee`.
    pub(crate) fn note(&mut self, slot: u32, n: &GuideNote8, i: usize, nee: [f32; 3], importance: f32) {
        if let Some(note) = self.notes.get_mut(slot as usize) {
            let leaf = n.leaf.lane(i);
            *note = GuideNote {
                leaf: if leaf == NO_LEAF { NO_LEAF } else { leaf << 8 | n.share.lane(i) & 0xff },
                point: n.point.lane(i),
                // the ratio rounded, because its square counts
                densities: n.ratio.lane(i).to_bits().wrapping_add(0x8000) & 0xffff_0000 | n.pdf.lane(i).to_bits() >> 16,
                nee: mean(nee),
                importance: if n.promised.lane(i) { importance } else { 0.0 },
                unguided: n.unguided.lane(i),
            };
        }
    }

    /// The sample of a note has ended with this estimate.
    #[inline]
    pub(crate) fn close(&mut self, slot: u32, radiance: [f32; 3]) {
        let Some((n, log)) = self.notes.get(slot as usize).zip(self.log.as_mut()) else { return };
        let all = mean(radiance);
        let bounce = (all - n.nee).max(0.0);
        if n.importance > 0.0
            && let Some(promise) = self.promise.first_mut()
        {
            let square = all * all;
            let without = (square + bounce * bounce * (n.unguided - 1.0)).max(0.0);
            promise.add(n.importance * without, n.importance * square);
        }
        if n.leaf == NO_LEAF {
            return;
        }
        let [ratio, pdf] = [n.densities & 0xffff_0000, n.densities << 16].map(f32::from_bits);
        let contribution = bounce * ratio;
        log.add(n.leaf >> 8, n.leaf & 0xff, n.point, contribution * contribution, pdf);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::learn::guiding::GuideSize;

    /// What the bounce gave, by the ratio of densities and squared, and the density, within the 2^-7 of the log; the promise
    /// is that of samples that were guided, as they were drawn. Killed by: halves exchanged, a ratio that is left out, the
    /// light sample counted, a promise by the ratio.
    #[test]
    fn contributions_count_by_the_ratio_of_densities() {
        let size = GuideSize::within(1 << 16, 1).expect("a size");
        let layout = GuideLog::layout(size).expect("a layout");
        let mut block = std::vec![0u8; layout.size + layout.align];
        let at = block.as_ptr().align_offset(layout.align);
        let mut log = GuideLog::new(size, &mut block[at..at + layout.size]).expect("a log");
        log.clear();
        let (mut notes, mut promise) = ([GuideNote::zeroed(); 2], [Promise::default()]);
        let mut all = GuideNotes { notes: &mut notes, log: Some(log), promise: &mut promise };
        let note = GuideNote8 {
            lanes: Mask8::first(2),
            leaf: U32x8::splat(3),
            promised: Mask8::first(1),
            unguided: F32x8::splat(2.0),
            share: U32x8::splat(77),
            point: U32x8::splat(5),
            pdf: F32x8::from_fn(|i| [0.3, 7.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0][i]),
            ratio: F32x8::from_fn(|i| [0.2, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0][i]),
        };
        let nee = [1.0; 3];
        (0..2).for_each(|i| all.note(i as u32, &note, i, nee, 10.0));
        (0..2).for_each(|slot| all.close(slot, [4.0; 3]));
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
        let mut want = Promise::default();
        want.add(10.0 * (16.0 + 9.0), 10.0 * 16.0);
        assert_eq!(promise[0], want, "of the guided sample alone");
    }
}
