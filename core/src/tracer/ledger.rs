//! What each sample gave: a fixed slab with one record per unfinished sample, nested like the samples themselves.
//!
//! A record belongs to one sample of a vertex (one bounce and at most one light sample) or to a camera sample. It
//! accumulates the sample's own estimate of reflected radiance, without any weight of the path before it, and its cost. The
//! bounce ends at one vertex at most; what the samples of that vertex give comes back times `inner` (bounce weight over
//! the vertex's factor). When the last of them is closed the sample is finished: it is logged to the bin of *its*
//! vertex, which its parent record holds, and folded into the parent (EARS, SIGGRAPH 2022, algorithm 2, without the
//! recursion).
//!
//! When the slab is full a sample gets no record: it and what follows are not learned from, and the samples that
//! contain it are incomplete, so they are not logged either. Nothing else changes; the image never passes through here.

use super::free_list::FreeList;
use crate::memory::{Carver, Layout, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};

/// No record.
pub const NO_RECORD: u32 = u32::MAX;

/// Part of a sample's estimate is missing.
const INCOMPLETE: u32 = 1 << 31;
/// `last` holds a finished sample of the vertex.
const HAS_LAST: u32 = 1 << 30;
/// The sample has next event estimation.
const WITH_NEE: u32 = 1 << 29;
/// The sample in `last` had next event estimation.
const LAST_WITH_NEE: u32 = 1 << 28;
/// Path guiding has a note on the sample.
const NOTED: u32 = 1 << 27;
/// Bits of `open` that count.
const OPEN: u32 = NOTED - 1;

/// One unfinished sample, 64 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct LedgerRecord {
    /// Estimate so far, rgb.
    radiance: [f32; 3],
    /// Counted cost so far.
    cost: f32,
    /// What the vertex at the end of the bounce gives counts this much: bounce weight over factor.
    inner: [f32; 3],
    /// The sample that led to the vertex this one was drawn at.
    parent: u32,
    /// Samples of the vertex at the end of the bounce are logged times this.
    scale: [f32; 3],
    /// Bin of the samples of that vertex.
    bin: u32,
    /// The one finished last, scaled.
    last: [f32; 3],
    /// Lanes in flight and waiting vertices that belong to it, and flags.
    open: u32,
}

/// A finished sample on its way to the statistics.
#[derive(Clone, Copy, Debug)]
pub struct Finished {
    /// Slot that it had.
    pub slot: u32,
    /// Whether path guiding has a note on it.
    pub noted: bool,
    /// Slot of the sample that it is part of.
    pub parent: u32,
    /// What its estimate adds to that of this sample, rgb.
    pub added: [f32; 3],
    /// Where it is logged.
    pub bin: u32,
    /// Estimate, rgb.
    pub radiance: [f32; 3],
    /// Scaled estimate, rgb.
    pub value: [f32; 3],
    /// Counted cost.
    pub cost: f32,
    /// Half the squared difference from the sample of the same vertex that finished before it, if light samples were
    /// drawn for both or for neither. How many are drawn hardly varies, so the difference between those with and those
    /// without is no noise.
    pub pair: Option<[f32; 3]>,
}

/// A camera sample that is finished.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FinishedCameraSample {
    /// Slot that it had.
    pub(crate) slot: u32,
    /// Estimate, rgb.
    pub(crate) radiance: [f32; 3],
    /// Whether nothing of it is missing.
    pub(crate) complete: bool,
}

/// A fixed slab of records of unfinished samples; no slot at all if nothing learns. Slots are numbers that [`Self::open`]
/// gave and that were not closed; others name records that may be anyone's.
#[derive(Debug)]
pub struct Ledger<'m> {
    records: &'m mut [LedgerRecord],
    free: FreeList<'m>,
}

impl<'m> Ledger<'m> {
    /// Layout of a block for `capacity` records; `None` if that is not addressable.
    pub fn layout(capacity: usize) -> Option<Layout> {
        Self::measure(Measure::new(), capacity).layout()
    }

    /// A ledger of `capacity` records, all free, in the caller's memory.
    pub fn new(capacity: usize, block: &'m mut [u8]) -> Result<Self, MemoryError> {
        let unaddressable = MemoryError::TooSmall { needed: usize::MAX, given: block.len() };
        let layout = Self::layout(capacity).ok_or(unaddressable)?;
        let mut ledger = Self::carve(&mut Carver::new(block, layout)?, capacity)?;
        ledger.reset();
        Ok(ledger)
    }

    pub(crate) fn measure(m: Measure, capacity: usize) -> Measure {
        FreeList::measure(m.add::<LedgerRecord>(capacity), capacity)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, capacity: usize) -> Result<Self, MemoryError> {
        let records = c.take_unset(capacity)?;
        Ok(Self { records, free: FreeList::carve(c, capacity)? })
    }

    /// How many records are free, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> u64 {
        self.free.suspend()
    }

    /// See [`FreeList::resume`].
    pub(crate) fn resume(&mut self, free: u64) -> Option<()> {
        self.free.resume(free)
    }

    /// Forgets all that is open.
    pub(crate) fn reset(&mut self) {
        self.free.reset();
    }

    pub(crate) fn is_on(&self) -> bool {
        !self.records.is_empty()
    }

    /// A record for a sample with one open lane, `with_nee` if it draws a light sample; [`NO_RECORD`] if the slab is full.
    #[inline]
    pub fn open(&mut self, parent: u32, with_nee: bool) -> u32 {
        let Some(slot) = self.free.take() else { return NO_RECORD };
        let open = if with_nee { 1 | WITH_NEE } else { 1 };
        let Some(record) = self.records.get_mut(slot as usize) else { return NO_RECORD };
        *record = LedgerRecord { parent, open, ..Zeroable::zeroed() };
        slot
    }

    fn get(&mut self, slot: u32) -> Option<&mut LedgerRecord> {
        self.records.get_mut(slot as usize)
    }

    /// `lanes` samples of the vertex that the sample led to are drawn; `drained` if they are its last.
    pub fn draw(&mut self, slot: u32, lanes: u32, drained: bool) {
        if let Some(r) = self.get(slot) {
            r.open = r.open.wrapping_add(lanes).wrapping_sub(u32::from(drained));
        }
    }

    /// Adds to a sample's estimate.
    #[inline(always)]
    pub fn accumulate(&mut self, slot: u32, radiance: [f32; 3]) {
        if let Some(r) = self.get(slot) {
            for (sum, x) in r.radiance.iter_mut().zip(radiance) {
                *sum += x;
            }
        }
    }

    /// Charges a ray to a sample.
    #[inline(always)]
    pub fn charge(&mut self, slot: u32, cost: f32) {
        if let Some(r) = self.get(slot) {
            r.cost += cost;
        }
    }

    /// The bounce has ended at a vertex: where its samples are logged, times what, and what they count.
    #[inline(always)]
    pub fn arrive(&mut self, slot: u32, bin: u32, scale: [f32; 3], inner: [f32; 3]) {
        if let Some(r) = self.get(slot) {
            (r.bin, r.scale, r.inner) = (bin, scale, inner);
        }
    }

    /// What the samples of the vertex that a sample led to are logged times.
    pub(crate) fn scale(&self, slot: u32) -> [f32; 3] {
        self.records.get(slot as usize).map_or([0.0; 3], |r| r.scale)
    }

    /// A sample's estimate so far.
    pub(crate) fn radiance(&self, slot: u32) -> [f32; 3] {
        self.records.get(slot as usize).map_or([0.0; 3], |r| r.radiance)
    }

    /// Path guiding notes where the bounce went.
    pub(crate) fn mark_noted(&mut self, slot: u32) {
        if let Some(r) = self.get(slot) {
            r.open |= NOTED;
        }
    }

    /// Part of a sample's estimate is lost to the ledger.
    pub(crate) fn mark_incomplete(&mut self, slot: u32) {
        if let Some(r) = self.get(slot) {
            r.open |= INCOMPLETE;
        }
    }

    /// Closes a lane or a drained vertex of a sample. If that finishes it, and perhaps the samples it is part of, `log`
    /// is called for each, but not for a camera sample: its slot comes back if it is among them, else [`NO_RECORD`].
    #[inline]
    pub fn close(&mut self, mut slot: u32, mut log: impl FnMut(Finished)) -> u32 {
        while let Some(r) = self.records.get_mut(slot as usize) {
            r.open = r.open.wrapping_sub(1);
            if r.open & OPEN > 0 {
                return NO_RECORD;
            }
            let done = *r;
            self.free.give(slot);
            let Some(p) = self.records.get_mut(done.parent as usize) else { return slot };
            p.cost += done.cost;
            if done.open & INCOMPLETE != 0 {
                p.open |= INCOMPLETE;
            } else {
                let value: [f32; 3] = core::array::from_fn(|c| done.radiance[c] * p.scale[c]);
                let with_nee = done.open & WITH_NEE != 0;
                let alike = p.open & HAS_LAST != 0 && with_nee == (p.open & LAST_WITH_NEE != 0);
                let pair = alike.then(|| {
                    core::array::from_fn(|c| {
                        let d = value[c] - p.last[c];
                        0.5 * d * d
                    })
                });
                p.last = value;
                p.open = p.open & !LAST_WITH_NEE | HAS_LAST | if with_nee { LAST_WITH_NEE } else { 0 };
                let added: [f32; 3] = core::array::from_fn(|c| p.inner[c] * done.radiance[c]);
                p.radiance.iter_mut().zip(added).for_each(|(sum, x)| *sum += x);
                let (noted, parent, bin) = (done.open & NOTED != 0, done.parent, p.bin);
                log(Finished {
                    slot,
                    noted,
                    parent,
                    added,
                    bin,
                    radiance: done.radiance,
                    value,
                    cost: done.cost,
                    pair,
                });
            }
            slot = done.parent;
        }
        NO_RECORD
    }

    /// The camera sample whose slot [`Self::close`] has just given back.
    pub(crate) fn camera_sample(&self, slot: u32) -> Option<FinishedCameraSample> {
        let r = self.records.get(slot as usize)?;
        Some(FinishedCameraSample { slot, radiance: r.radiance, complete: r.open & INCOMPLETE == 0 })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    fn with_ledger(capacity: usize, f: impl FnOnce(&mut Ledger<'_>)) {
        let layout = Ledger::measure(Measure::new(), capacity).layout().unwrap();
        let mut block: Vec<u8> = std::vec![0; layout.size + crate::memory::BLOCK_ALIGN];
        let offset = block.as_ptr().align_offset(crate::memory::BLOCK_ALIGN);
        let mut carver = Carver::new(&mut block[offset..], layout).unwrap();
        let mut ledger = Ledger::carve(&mut carver, capacity).unwrap();
        ledger.reset();
        f(&mut ledger);
    }

    struct Random(u32);

    impl Random {
        fn below(&mut self, n: u32) -> u32 {
            self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (self.0 >> 8) % n
        }

        /// 1/4, 1/2 or 1: products and sums of a few of them are exact in f32.
        fn power(&mut self) -> [f32; 3] {
            [(); 3].map(|()| [0.25, 0.5, 1.0][self.below(3) as usize])
        }
    }

    /// A sample of a tree, and what is known of it.
    struct Sample {
        parent: Option<usize>,
        children: Vec<usize>,
        /// What its light sample and what its hit gave.
        found: [[f32; 3]; 2],
        rays: u32,
        inner: [f32; 3],
        scale: [f32; 3],
        /// Children that have not ended.
        left: usize,
        recorded: bool,
        with_nee: bool,
    }

    /// A logged sample of a vertex: value, rays, half squared difference.
    type Logged = ([f32; 3], f32, Option<[f32; 3]>);

    #[derive(Default)]
    struct Forest {
        samples: Vec<Sample>,
        /// Per sample: those of its vertex in the order in which they ended.
        ended: Vec<Vec<usize>>,
    }

    impl Forest {
        fn grow(&mut self, parent: Option<usize>, depth: u32, r: &mut Random) -> usize {
            let me = self.samples.len();
            let found = [(); 2].map(|()| [(); 3].map(|()| r.below(16) as f32 / 8.0));
            let (rays, inner, scale) = (1 + r.below(2), r.power(), r.power());
            let (children, left, recorded, with_nee) = (Vec::new(), 0, false, r.below(2) == 0);
            self.samples.push(Sample { parent, children, found, rays, inner, scale, left, recorded, with_nee });
            self.ended.push(Vec::new());
            let n = if depth < 5 { r.below(5) } else { 0 };
            let children: Vec<usize> = (0..n).map(|_| self.grow(Some(me), depth + 1, r)).collect();
            self.samples[me].left = children.len();
            self.samples[me].children = children;
            me
        }

        /// Estimate and rays of a sample, by recursion in f64.
        fn worth(&self, s: usize) -> ([f64; 3], f64) {
            let s = &self.samples[s];
            let mut value = [0, 1, 2].map(|c| f64::from(s.found[0][c]) + f64::from(s.found[1][c]));
            let mut rays = f64::from(s.rays);
            for &child in &s.children {
                let (x, cost) = self.worth(child);
                rays += cost;
                (0..3).for_each(|c| value[c] += f64::from(s.inner[c]) * x[c]);
            }
            (value, rays)
        }

        /// Have it and everything below it records?
        fn complete(&self, s: usize) -> bool {
            let s = &self.samples[s];
            s.recorded && s.children.iter().all(|&c| self.complete(c))
        }

        fn end(&mut self, s: usize) {
            let Some(p) = self.samples[s].parent else { return };
            self.ended[p].push(s);
            self.samples[p].left -= 1;
            if self.samples[p].left == 0 {
                self.end(p);
            }
        }

        /// What must be logged of the vertex that `s` led to.
        fn expected(&self, s: usize) -> Vec<Logged> {
            let mut last: Option<(bool, [f64; 3])> = None;
            let complete = self.ended[s].iter().copied().filter(|&c| self.complete(c));
            let log = complete.map(|child| {
                let (x, rays) = self.worth(child);
                let x = [0, 1, 2].map(|c| x[c] * f64::from(self.samples[s].scale[c]));
                let with_nee = self.samples[child].with_nee;
                let alike = last.filter(|l| l.0 == with_nee);
                let pair = alike.map(|(_, l)| [0, 1, 2].map(|c| (0.5 * (x[c] - l[c]) * (x[c] - l[c])) as f32));
                last = Some((with_nee, x));
                (x.map(|x| x as f32), rays as f32, pair)
            });
            log.collect()
        }
    }

    /// What is in flight: a sample, or a vertex with samples drawn so far.
    #[derive(Clone, Copy)]
    enum Work {
        Lane(usize, u32),
        Vertex(usize, u32, usize),
    }

    /// Plays a forest in random order through a slab, as the stages do. Returns what was logged by vertex, and how many
    /// samples got no record.
    fn play(forest: &mut Forest, roots: &[usize], ledger: &mut Ledger<'_>, r: &mut Random) -> (Vec<Vec<Logged>>, u32) {
        let mut logged: Vec<Vec<Logged>> = forest.samples.iter().map(|_| Vec::new()).collect();
        let mut log = |f: Finished| logged[f.bin as usize].push((f.value, f.cost, f.pair));
        let (mut work, mut refused) = (Vec::new(), 0);
        for &root in roots {
            let slot = ledger.open(NO_RECORD, false);
            forest.samples[root].recorded = slot != NO_RECORD;
            work.push(Work::Lane(root, slot));
        }
        while !work.is_empty() {
            let at = r.below(work.len() as u32) as usize;
            match work.swap_remove(at) {
                Work::Lane(s, slot) => {
                    let sample = &forest.samples[s];
                    sample.found.iter().for_each(|x| ledger.accumulate(slot, *x));
                    (0..sample.rays).for_each(|_| ledger.charge(slot, 1.0));
                    let dies = sample.children.is_empty();
                    if !dies || r.below(2) == 0 {
                        ledger.arrive(slot, s as u32, sample.scale, sample.inner);
                    }
                    if dies {
                        forest.end(s);
                        ledger.close(slot, &mut log);
                    } else {
                        work.push(Work::Vertex(s, slot, 0));
                    }
                }
                Work::Vertex(s, slot, first) => {
                    let all = forest.samples[s].children.len();
                    let m = 1 + r.below((all - first) as u32) as usize;
                    ledger.draw(slot, m as u32, first + m == all);
                    for k in first..first + m {
                        let child = forest.samples[s].children[k];
                        let with_nee = forest.samples[child].with_nee;
                        let record = if slot == NO_RECORD { NO_RECORD } else { ledger.open(slot, with_nee) };
                        if slot != NO_RECORD && record == NO_RECORD {
                            refused += 1;
                            ledger.mark_incomplete(slot);
                            ledger.close(slot, &mut log);
                        }
                        forest.samples[child].recorded = record != NO_RECORD;
                        work.push(Work::Lane(child, record));
                    }
                    if first + m < all {
                        work.push(Work::Vertex(s, slot, first + m));
                    }
                }
            }
        }
        (logged, refused)
    }

    /// Random trees, several at a time, in random order, through slabs that suffice and slabs that do not: what is
    /// logged is what recursion gives, for complete samples and for no others, and every slot comes back. Killed by:
    /// values times the child's own scale, pairs of a sample with light and one without, `inner` left out or applied
    /// twice, rays that stay with the child, a pair with a sample of another vertex, an incomplete sample whose parents are
    /// not, a drained vertex that counts on, a slot not given back.
    #[test]
    fn what_is_logged_is_what_recursion_gives() {
        let mut r = Random(5);
        let (mut pairs, mut refusals, mut part) = (0, 0, 0);
        for round in 0..400 {
            let mut forest = Forest::default();
            let roots: Vec<usize> = (0..1 + r.below(6)).map(|_| forest.grow(None, 0, &mut r)).collect();
            let capacity = if round % 2 == 0 { forest.samples.len() } else { 1 + r.below(24) as usize };
            with_ledger(capacity, |ledger| {
                let (logged, refused) = play(&mut forest, &roots, ledger, &mut r);
                assert!(refused == 0 || round % 2 == 1);
                refusals += refused;
                for (s, found) in logged.iter().enumerate() {
                    let expected = forest.expected(s);
                    assert_eq!(found, &expected, "round {round}, vertex {s}, a slab of {capacity}");
                    pairs += found.iter().filter(|x| x.2.is_some()).count();
                    let all = forest.samples[s].children.len();
                    part += usize::from(refused > 0 && !found.is_empty() && found.len() < all);
                }
                assert_eq!(ledger.free.len(), capacity, "round {round}: slots that were not given back");
            });
        }
        assert!(pairs > 10_000 && refusals > 1000 && part > 1000, "{pairs} pairs, {refusals} refusals, {part} parts");
    }
}
