//! What each sample gave: a fixed slab with one record per unfinished sample, nested like the samples themselves.
//!
//! A record belongs to one sample of a vertex (one light sample and one bounce) or to a camera sample. It gathers the
//! sample's own estimate of reflected radiance, without any weight of the path before it, and its rays. The bounce ends at
//! one vertex at most; what the samples of that vertex give comes back times `inner` (bounce weight over the vertex's
//! factor). When the last of them is closed the sample is finished: it is logged to the bin of *its* vertex, which its
//! parent record holds, and folded into the parent (EARS, SIGGRAPH 2022, algorithm 2, without the recursion).
//!
//! When the slab is full a sample gets no record: it and what follows are not learned from, and the samples that contain
//! it are incomplete, so they are not logged either. Nothing else changes; the image never passes through here.

use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};

/// No record.
pub(crate) const NO_RECORD: u32 = u32::MAX;

/// Part of a sample's estimate is missing.
const INCOMPLETE: u32 = 1 << 31;
/// `last` holds a finished sample of the vertex.
const HAS_LAST: u32 = 1 << 30;
/// Bits of `open` that count.
const OPEN: u32 = HAS_LAST - 1;

/// One unfinished sample, 64 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Record {
    /// Estimate so far, rgb.
    radiance: [f32; 3],
    /// Rays so far.
    cost: f32,
    /// What the vertex at the end of the bounce gives counts this much: bounce weight over factor.
    inner: [f32; 3],
    /// The sample that led to the vertex this one was drawn at.
    parent: u32,
    /// Samples of the vertex at the end of the bounce are logged times this.
    scale: [f32; 3],
    /// Their bin.
    bin: u32,
    /// The one finished last, scaled.
    last: [f32; 3],
    /// Lanes in flight and waiting vertices that belong to it, and flags.
    open: u32,
}

/// A finished sample on its way to the statistics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finished {
    /// Where it is logged.
    pub bin: u32,
    /// Scaled estimate, rgb.
    pub value: [f32; 3],
    /// Rays.
    pub cost: f32,
    /// Half the squared difference from the sample of the same vertex that finished before it.
    pub pair: Option<[f32; 3]>,
}

/// A fixed slab of records; no slot at all if nothing learns.
#[derive(Debug)]
pub(crate) struct Ledger<'m> {
    records: &'m mut [Record],
    free: &'m mut [u32],
    free_len: usize,
}

impl<'m> Ledger<'m> {
    pub(crate) fn measure(m: Measure, capacity: usize) -> Measure {
        m.add::<Record>(capacity).add::<u32>(capacity)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, capacity: usize) -> Result<Self, MemoryError> {
        let records = c.take(capacity)?;
        let free: &mut [u32] = c.take(capacity)?;
        for (i, f) in free.iter_mut().enumerate() {
            *f = i as u32;
        }
        Ok(Self { records, free, free_len: capacity })
    }

    pub(crate) fn is_on(&self) -> bool {
        !self.records.is_empty()
    }

    /// A record for a sample with one open lane; [`NO_RECORD`] if the slab is full.
    pub(crate) fn open(&mut self, parent: u32) -> u32 {
        let Some(len) = self.free_len.checked_sub(1) else { return NO_RECORD };
        self.free_len = len;
        let slot = self.free[len];
        self.records[slot as usize] = Record { parent, open: 1, ..Zeroable::zeroed() };
        slot
    }

    fn get(&mut self, slot: u32) -> Option<&mut Record> {
        self.records.get_mut(slot as usize)
    }

    /// `lanes` samples of the vertex that the sample led to are drawn; `drained` if they are its last.
    pub(crate) fn draw(&mut self, slot: u32, lanes: u32, drained: bool) {
        if let Some(r) = self.get(slot) {
            r.open += lanes - u32::from(drained);
        }
    }

    /// Adds to a sample's estimate.
    #[inline(always)]
    pub(crate) fn gather(&mut self, slot: u32, radiance: [f32; 3]) {
        if let Some(r) = self.get(slot) {
            for (sum, x) in r.radiance.iter_mut().zip(radiance) {
                *sum += x;
            }
        }
    }

    /// Charges a ray to a sample.
    #[inline(always)]
    pub(crate) fn charge(&mut self, slot: u32, cost: f32) {
        if let Some(r) = self.get(slot) {
            r.cost += cost;
        }
    }

    /// The bounce has ended at a vertex: where its samples are logged, times what, and what they count.
    #[inline(always)]
    pub(crate) fn arrive(&mut self, slot: u32, bin: u32, scale: [f32; 3], inner: [f32; 3]) {
        if let Some(r) = self.get(slot) {
            (r.bin, r.scale, r.inner) = (bin, scale, inner);
        }
    }

    /// Part of a sample's estimate is lost to the ledger.
    pub(crate) fn spoil(&mut self, slot: u32) {
        if let Some(r) = self.get(slot) {
            r.open |= INCOMPLETE;
        }
    }

    /// Closes a lane or a drained vertex of a sample. If that finishes it, and perhaps the samples it is part of, `log` is
    /// called for each.
    #[inline]
    pub(crate) fn close(&mut self, mut slot: u32, mut log: impl FnMut(Finished)) {
        while let Some(r) = self.records.get_mut(slot as usize) {
            r.open -= 1;
            if r.open & OPEN > 0 {
                return;
            }
            let done = *r;
            self.free[self.free_len] = slot;
            self.free_len += 1;
            let Some(p) = self.records.get_mut(done.parent as usize) else { return };
            p.cost += done.cost;
            if done.open & INCOMPLETE != 0 {
                p.open |= INCOMPLETE;
            } else {
                let value: [f32; 3] = core::array::from_fn(|c| done.radiance[c] * p.scale[c]);
                let pair = (p.open & HAS_LAST != 0).then(|| {
                    core::array::from_fn(|c| {
                        let d = value[c] - p.last[c];
                        0.5 * d * d
                    })
                });
                p.last = value;
                p.open |= HAS_LAST;
                for c in 0..3 {
                    p.radiance[c] += p.inner[c] * done.radiance[c];
                }
                log(Finished { bin: p.bin, value, cost: done.cost, pair });
            }
            slot = done.parent;
        }
    }
}
