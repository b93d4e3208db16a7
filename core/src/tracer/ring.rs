//! The refill ring: a fixed number of slots for the path vertices that wait for their samples.
//!
//! ```text
//! slots     [ v0 | v1 | v2 | v3 | v4 | v5 | v6 | v7 ]      one vertex each, 128 bytes
//! next      [  3 |  1 |  7 |  5 |  2 |  0 |  6 |  . ]      one link each
//! queues    diffuse, with NEE:    0 -> 3 -> 5 -> 0          a circle of slots per queue
//!           dielectric, without:  1 -> 1                    (class and next event estimation)
//! free      4 -> 2 -> 7
//! ```
//!
//! A split by 17 is one vertex with 17 samples left, in one slot. [`Ring::take`] refills a packet: samples of one queue,
//! vertex after vertex, so that siblings share material and texture and one kernel runs full lanes. Every slot is in
//! one queue or free, so a queue costs no memory of its own: another class leaves the bytes per path as they are.
//!
//! **Order.** The newest vertex of a queue leaves first ([`NEWEST_FIRST`]): paths are followed to their ends before
//! others begin. Oldest first fills packets alike, but with splitting up to six times as many vertices wait, and a ring of
//! two packets gets stuck behind a vertex with several samples left (figures: docs/ARCHITECTURE.md, "The order of the
//! refill ring").
//!
//! **Bounded.** What a packet may take depends on the free slots ([`Ring::take`]), and vertices that may start while
//! [`RESERVE`] slots stay free can always run their packet to its end: the ring can neither overflow nor get stuck.

use super::class::{PacketClass, Queue};
use super::vertex::PathVertex;
use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};
use croupier_simd::U32x8;

/// The vertex of a queue that was stored last is the first to leave.
const NEWEST_FIRST: bool = true;

/// Free slots that let every packet under way go on.
pub(crate) const RESERVE: usize = 8;

/// No slot.
const NONE: u32 = u32::MAX;

/// Bytes of a waiting vertex in the ring.
pub(crate) const BYTES_PER_VERTEX: usize = size_of::<PathVertex>() + size_of::<u32>();

/// Samples of one queue for one packet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken8 {
    /// Slots of their vertices ([`Ring::vertices`]), one per lane; lanes from `lanes` on repeat lane 0.
    slots: [u32; 8],
    /// Number of the sample within its vertex.
    pub sample: U32x8,
    /// How many lanes are filled.
    pub lanes: usize,
    /// Where they waited.
    pub queue: Queue,
}

/// All waiting vertices of a shard.
#[derive(Debug)]
pub(crate) struct Ring<'m> {
    slots: &'m mut [PathVertex],
    /// The next slot of the same circle, or of the free ones.
    next: &'m mut [u32],
    /// First free slot; the one given back last, which is still in the processor's caches.
    free: u32,
    free_len: usize,
    /// Per queue, the slot whose link is the first vertex to leave; [`NONE`] if none waits.
    last: [u32; Queue::COUNT],
    /// Per queue, the samples that can be taken.
    pending: [u32; Queue::COUNT],
    /// Bits of the queues in which vertices wait.
    occupied: u32,
    /// What a number without a slot stands for: there is none, unless others have written into the block.
    nobody: PathVertex,
}

const _: () = assert!(Queue::COUNT <= u32::BITS as usize);

/// What a ring holds besides its slots and links.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct RingRecord {
    free_len: u64,
    free: u32,
    occupied: u32,
    last: [u32; Queue::COUNT],
    pending: [u32; Queue::COUNT],
}

impl<'m> Ring<'m> {
    pub(crate) fn measure(m: Measure, capacity: usize) -> Measure {
        m.add::<PathVertex>(capacity).add::<u32>(capacity)
    }

    /// A ring without free slots, until [`Self::reset`] or [`Self::resume`].
    pub(crate) fn carve(c: &mut Carver<'m>, capacity: usize) -> Result<Self, MemoryError> {
        let (slots, next) = (c.take_unset(capacity)?, c.take_unset(capacity)?);
        let (last, pending) = ([NONE; Queue::COUNT], [0; Queue::COUNT]);
        let nobody = Zeroable::zeroed();
        Ok(Self { slots, next, free: NONE, free_len: 0, last, pending, occupied: 0, nobody })
    }

    /// All but slots and links, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> RingRecord {
        let Self { free, free_len, last, pending, occupied, .. } = *self;
        RingRecord { free_len: free_len as u64, free, occupied, last, pending }
    }

    /// Goes on with the slots and links that the memory holds; `None` if the record is not that of such a ring.
    pub(crate) fn resume(&mut self, r: &RingRecord) -> Option<()> {
        let slots = self.next.len();
        self.free_len = usize::try_from(r.free_len).ok().filter(|&n| n <= slots)?;
        let in_use = |q: usize| r.occupied >> q & 1 == 1;
        let sound = |(q, &slot): (usize, &u32)| if in_use(q) { (slot as usize) < slots } else { slot == NONE };
        let queues =
            r.occupied.checked_shr(Queue::COUNT as u32).unwrap_or(0) == 0 && r.last.iter().enumerate().all(sound);
        if !queues || (self.free_len > 0 && r.free as usize >= slots) {
            return None;
        }
        (self.free, self.last, self.pending, self.occupied) = (r.free, r.last, r.pending, r.occupied);
        Some(())
    }

    /// Forgets all that waits.
    pub(crate) fn reset(&mut self) {
        (self.last, self.pending, self.occupied) = ([NONE; Queue::COUNT], [0; Queue::COUNT], 0);
        (self.free, self.free_len) = (0, self.next.len());
        // the last link leads out of the ring, where nothing is free
        self.next.iter_mut().zip(1..).for_each(|(next, i)| *next = i);
    }

    /// Empty slots.
    pub(crate) fn free(&self) -> usize {
        self.free_len
    }

    /// Vertices that wait.
    pub(crate) fn waiting(&self) -> usize {
        self.next.len() - self.free_len
    }

    /// The queue with most samples waiting, and how many; the first of equal ones. `None` if nothing waits.
    pub(crate) fn fullest(&self) -> Option<(Queue, u32)> {
        let mut best = None;
        for queue in Queue::of_bits(self.occupied) {
            let n = self.pending.get(queue.index()).copied().unwrap_or(0);
            if best.is_none_or(|(_, most)| n > most) {
                best = Some((queue, n));
            }
        }
        best
    }

    /// Stores a vertex with its samples; the caller has made sure that a slot is free.
    #[inline]
    pub(crate) fn push(&mut self, class: PacketClass, v: PathVertex) {
        if self.free_len == 0 {
            debug_assert!(false, "a vertex without a slot");
            return;
        }
        let slot = self.free;
        let at = slot as usize;
        let (Some(next), Some(place)) = (self.next.get(at).copied(), self.slots.get_mut(at)) else { return };
        *place = v;
        self.free = next;
        self.free_len -= 1;
        self.wait(class, slot);
    }

    /// Puts a vertex into the queue of its next samples.
    fn wait(&mut self, class: PacketClass, slot: u32) {
        let Some(v) = self.slots.get(slot as usize) else { return };
        let with_nee = v.with_nee() > 0;
        let n = if with_nee { v.with_nee() } else { v.count() };
        let q = class.queue(with_nee).index();
        let (Some(last), Some(pending)) = (self.last.get_mut(q), self.pending.get_mut(q)) else { return };
        let mut first = slot;
        if *last == NONE {
            *last = slot;
        } else if let Some(link) = self.next.get_mut(*last as usize) {
            first = core::mem::replace(link, slot);
            if !NEWEST_FIRST {
                *last = slot;
            }
        }
        if let Some(link) = self.next.get_mut(slot as usize) {
            *link = first;
        }
        *pending += n;
        self.occupied |= 1 << q;
    }

    /// Takes the first vertex out of a queue that has one.
    fn leave(&mut self, q: usize) {
        let Some(last) = self.last.get_mut(q) else { return };
        let link = |slot: u32| self.next.get(slot as usize).copied();
        let Some(first) = link(*last) else { return };
        if first == *last {
            *last = NONE;
            self.occupied &= !(1 << q);
        } else if let (Some(second), Some(link)) = (link(first), self.next.get_mut(*last as usize)) {
            *link = second;
        }
    }

    /// Takes up to eight samples from a queue, but only so many that there is a slot for each vertex they may lead to.
    /// A vertex that has no light samples left goes over to the other queue of its class. Calls
    /// `taken(vertex, lanes, drained)` per vertex. `None` if no sample fits.
    pub(crate) fn take(&mut self, queue: Queue, mut taken: impl FnMut(&PathVertex, u32, bool)) -> Option<Taken8> {
        let q = queue.index();
        let (mut slot, mut sample) = ([0u32; 8], [0u32; 8]);
        let (mut lanes, mut room) = (0usize, self.free_len);
        while lanes < 8 {
            let Some(&last) = self.last.get(q).filter(|last| **last != NONE) else { break };
            let Some(&s) = self.next.get(last as usize) else { break };
            let Some(v) = self.slots.get_mut(s as usize) else { break };
            let count = v.count();
            let left = if queue.with_nee() { v.with_nee() } else { count };
            let want = left.min((8 - lanes) as u32);
            // a drained vertex gives its own slot back
            let m = if want == count && want as usize <= room + 1 {
                want
            } else {
                want.min(room as u32).min(count.max(1) - 1)
            };
            if m == 0 {
                break;
            }
            let first = v.take(m);
            let drained = m == count;
            for k in 0..m {
                let (Some(slot), Some(sample)) = (slot.get_mut(lanes), sample.get_mut(lanes)) else { break };
                (*slot, *sample) = (s, first.wrapping_add(k));
                lanes += 1;
            }
            room = room + usize::from(drained) - m as usize;
            let Some(pending) = self.pending.get_mut(q) else { break };
            *pending -= m;
            taken(v, m, drained);
            if m == left {
                self.leave(q);
            }
            if drained {
                let Some(link) = self.next.get_mut(s as usize) else { break };
                *link = self.free;
                self.free = s;
                self.free_len += 1;
            } else if m == left {
                self.wait(queue.class(), s);
            }
        }
        if lanes == 0 {
            return None;
        }
        let first = slot[0];
        slot.iter_mut().skip(lanes).for_each(|s| *s = first);
        Some(Taken8 { slots: slot, sample: U32x8::new(sample), lanes, queue })
    }

    /// The records of samples that were just taken: before anything else is stored.
    #[inline(always)]
    pub(crate) fn records(&self, taken: &Taken8) -> [&PathVertex; 8] {
        taken.slots.map(|s| self.slots.get(s as usize).unwrap_or(&self.nobody))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::super::vertex::PathVertex8;
    use super::*;
    use crate::memory::BLOCK_ALIGN;
    use std::vec::Vec;

    fn with_ring(capacity: usize, f: impl FnOnce(&mut Ring<'_>)) {
        let layout = Ring::measure(Measure::new(), capacity).layout().unwrap();
        let mut block: Vec<u8> = std::vec![0xAB; layout.size + BLOCK_ALIGN];
        let offset = block.as_ptr().align_offset(BLOCK_ALIGN);
        let mut carver = Carver::new(&mut block[offset..], layout).unwrap();
        let mut ring = Ring::carve(&mut carver, capacity).unwrap();
        ring.reset();
        f(&mut ring);
    }

    fn class(n: u32) -> PacketClass {
        PacketClass::of_kind(n).unwrap()
    }

    /// Random (subcritical) trees through rings of every small size: each turn takes what fits and pushes as `roulette`
    /// may. Every sample is taken exactly once, those with a light sample from a queue of theirs, no turn is stuck, no
    /// slot is lost. Killed by: `room` off by one, a drained slot not given back, `RESERVE` of 0, a vertex that stays
    /// in the queue of its light samples or leaves it early.
    #[test]
    fn no_ring_gets_stuck() {
        let mut word = 7u32;
        let mut next = |n: u32| {
            word = word.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (word >> 8) % n
        };
        for capacity in [16usize, 17, 23, 64] {
            with_ring(capacity, |ring| {
                let (mut started, mut pushed, mut taken, mut waiting_nee) = (0, 0u64, 0u64, 0u64);
                while started < 4000 || ring.fullest().is_some() {
                    let pending = ring.fullest().map_or(0, |(_, n)| n);
                    let lanes = if pending < 8 && started < 4000 && ring.free() >= 2 * RESERVE {
                        started += 8;
                        8
                    } else {
                        let mut queues = ring.fullest().map(|(q, _)| q).into_iter().chain(Queue::all());
                        let batch = queues.find_map(|q| ring.take(q, |_, _, _| ()));
                        let batch = batch.expect("some queue must always have a sample that fits");
                        waiting_nee -= if batch.queue.with_nee() { batch.lanes as u64 } else { 0 };
                        assert!(ring.free() >= batch.lanes, "a lane has no slot to go on to");
                        taken += batch.lanes as u64;
                        batch.lanes
                    };
                    let may_split = ring.free() >= lanes + RESERVE;
                    for _ in 0..lanes {
                        let n = if next(100) < 91 {
                            0
                        } else if may_split {
                            1 + next(20)
                        } else {
                            1
                        };
                        if n > 0 {
                            let with_nee = next(n + 1);
                            waiting_nee += u64::from(with_nee);
                            let class = class(next(PacketClass::COUNT as u32 - 1));
                            ring.push(class, PathVertex::of_samples(n, with_nee));
                            pushed += u64::from(n);
                        }
                    }
                }
                assert_eq!((pushed, waiting_nee), (taken, 0));
                assert_eq!((ring.free(), ring.waiting()), (capacity, 0));
            });
        }
    }

    /// Samples leave in the stated order, siblings side by side, and a vertex without light samples left goes over to
    /// the other queue. Killed by: a link that skips a vertex, a circle cut open, classes mixed.
    #[test]
    fn the_newest_vertex_leaves_first() {
        with_ring(16, |ring| {
            let (a, b) = (class(0), class(1));
            for n in [3, 1, 2] {
                ring.push(a, PathVertex::of_samples(n, 1));
            }
            ring.push(b, PathVertex::of_samples(5, 0));
            assert_eq!(ring.fullest(), Some((b.queue(false), 5)));
            assert_eq!((ring.waiting(), ring.free()), (4, 12));
            let mut order = Vec::new();
            let batch = ring.take(a.queue(true), |v, lanes, drained| order.push((v.count(), lanes, drained))).unwrap();
            assert_eq!((batch.lanes, batch.queue), (3, a.queue(true)));
            assert_eq!(order, [(1, 1, false), (0, 1, true), (2, 1, false)]);
            order.clear();
            let batch = ring.take(a.queue(false), |v, lanes, drained| order.push((v.count(), lanes, drained))).unwrap();
            assert_eq!((batch.lanes, batch.queue), (3, a.queue(false)));
            assert_eq!(order, [(0, 2, true), (0, 1, true)]);
            assert_eq!(batch.sample.to_array()[..3], [1, 2, 1], "numbers of samples go on where they were");
            assert!(ring.take(a.queue(true), |_, _, _| ()).is_none());
            let batch = ring.take(b.queue(false), |_, _, _| ()).unwrap();
            assert_eq!((batch.lanes, PathVertex8::from_records(ring.records(&batch)).samples.lane(0) & 0xff), (5, 0));
            assert_eq!((ring.waiting(), ring.fullest()), (0, None));
        });
    }
}
