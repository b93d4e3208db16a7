//! What path guiding learns from: of each sample in the ledger, the direction that its bounce took. When the sample is
//! finished, what the bounce has contributed goes to the shard's log.

use super::job::Job;
use crate::learn::Guiding;
use crate::learn::guiding::{COMPILED, GuideLog, NO_LEAF, Trial};
use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8};

/// Directions of eight samples' bounces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GuideNote8 {
    /// Lanes that have one.
    pub lanes: Mask8,
    /// Leaves of the guide.
    pub leaf: U32x8,
    /// Share of the guide's density, see [`GuideLog::add`].
    pub share: U32x8,
    /// Points of the square, [`quantised`](crate::learn::guiding::sphere::quantised).
    pub point: U32x8,
    /// Density of the direction, 1/sr.
    pub pdf: F32x8,
}

impl GuideNote8 {
    /// Nothing.
    pub(crate) const NONE: Self = Self {
        lanes: Mask8::NONE,
        leaf: U32x8::splat(NO_LEAF),
        share: U32x8::splat(0),
        point: U32x8::splat(0),
        pdf: F32x8::ZERO,
    };
}

/// The direction of a sample's bounce, 16 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct GuideNote {
    /// Leaf, and below it in 8 bits the share; [`NO_LEAF`] if there is nothing to learn from.
    leaf: u32,
    point: u32,
    pdf: f32,
    /// What next event estimation gave the sample, mean of rgb.
    nee: f32,
}

/// Notes on the samples in the ledger, by slot, and the log that they go to; nothing if guiding is off.
#[derive(Debug)]
pub(crate) struct GuideNotes<'m> {
    notes: &'m mut [GuideNote],
    log: Option<GuideLog<'m>>,
    /// Errors of samples that are not guided and of samples that are; one if they are compared, else none.
    pub(super) trial: &'m mut [Trial],
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

    /// Number of trials.
    fn trials(job: &Job) -> usize {
        usize::from(COMPILED && job.settings.learning.guiding == Guiding::Auto)
    }

    /// Bytes; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(m: Measure, job: &Job, ledger: usize) -> Measure {
        let m = m.add::<GuideNote>(Self::capacity(job, ledger));
        job.guide.map_or(m, |size| GuideLog::measure(m, size)).add::<Trial>(Self::trials(job))
    }

    pub(crate) fn carve(c: &mut Carver<'m>, job: &Job, ledger: usize) -> Result<Self, MemoryError> {
        let notes = c.take_unset(Self::capacity(job, ledger))?;
        let log = job.guide.filter(|_| COMPILED).map(|size| GuideLog::carve(c, size)).transpose()?;
        Ok(Self { notes, log, trial: c.take_unset(Self::trials(job))? })
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
        self.trial.fill(Trial::default());
    }

    /// A sample begins, without a direction.
    #[inline(always)]
    pub(crate) fn open(&mut self, slot: u32) {
        if let Some(note) = self.notes.get_mut(slot as usize) {
            note.leaf = NO_LEAF;
        }
    }

    /// Notes the direction in lane `i` of a sample whose next event estimation has given `nee`.
    pub(crate) fn note(&mut self, slot: u32, n: &GuideNote8, i: usize, nee: [f32; 3]) {
        if let Some(note) = self.notes.get_mut(slot as usize) {
            let leaf = n.leaf.lane(i) << 8 | n.share.lane(i) & 0xff;
            *note = GuideNote { leaf, point: n.point.lane(i), pdf: n.pdf.lane(i), nee: mean(nee) };
        }
    }

    /// The sample has ended with this estimate.
    #[inline]
    pub(crate) fn close(&mut self, slot: u32, radiance: [f32; 3]) {
        let Some((n, log)) = self.notes.get(slot as usize).zip(self.log.as_mut()) else { return };
        if n.leaf == NO_LEAF {
            return;
        }
        let bounce = (mean(radiance) - n.nee).max(0.0);
        log.add(n.leaf >> 8, n.leaf & 0xff, n.point, bounce * bounce, n.pdf);
    }
}
