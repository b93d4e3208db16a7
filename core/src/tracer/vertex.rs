//! A path vertex that waits for its samples, and the fixed pool of them.

use super::free_list::FreeList;
use crate::memory::{Carver, Measure, MemoryError};
use crate::rng::Key8;
use crate::scene::blob::MaterialKind;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, U32x8, Vec3x8};

/// Scattering classes: one per material kind, so that a packet runs one kernel.
pub(crate) const CLASSES: usize = MaterialKind::ALL.len();

/// Rings of waiting vertices: of each class those whose next samples draw light samples, then of each class the others.
pub(crate) const RINGS: usize = 2 * CLASSES;

/// One waiting vertex, 128 bytes: four rows of eight words, so that eight of them transpose into [`Vertex8`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Vertex {
    rows: [[f32; 8]; 4],
}

/// Eight path vertices, one per lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex8 {
    /// Position, world space.
    pub p: Vec3x8,
    /// Bound of its rounding error along `ng`.
    pub error: F32x8,
    /// Geometric unit normal.
    pub ng: Vec3x8,
    /// Shading unit normal, already facing `wo` on two-sided materials.
    pub ns: Vec3x8,
    /// Unit direction back along the path.
    pub wo: Vec3x8,
    /// Prefix weight of every sample: throughput over all factors so far.
    pub beta: Vec3x8,
    /// Reflectance after texturing.
    pub reflectance: Vec3x8,
    /// Material index.
    pub material: U32x8,
    /// Root slot.
    pub root: U32x8,
    /// Random key.
    pub key: Key8,
    /// Path segments from the camera to here.
    pub depth: U32x8,
    /// Product of the albedos of the vertices before this one, mean over rgb.
    pub albedo_product: F32x8,
    /// Ledger record of the sample that led here.
    pub ledger: U32x8,
    /// Samples left, the number of the next one, and how many of those left draw a light sample: see [`pack_samples`].
    pub samples: U32x8,
    /// Chance of a sample to draw a light sample ([`crate::rrs::Learned8::nee_probability`]).
    pub drawn: F32x8,
    /// Its bin of the statistics, [`NO_BIN`](super::ledger::NO_BIN) if there is none.
    pub bin: U32x8,
    /// See [`Target::error_weight`](super::root::Target::error_weight).
    pub error_weight: Vec3x8,
}

/// Row and column of the words that are read or changed while a vertex waits.
const ROOT: (usize, usize) = (1, 6);
const LEDGER: (usize, usize) = (3, 1);
const SAMPLES: (usize, usize) = (3, 2);

/// The word of a vertex with `count` samples to draw, the first `lit` of them with a light sample. A byte each: no
/// factor is larger than [`crate::rrs::MAX_FACTOR`].
pub(crate) fn pack_samples(count: u32, lit: u32) -> u32 {
    debug_assert!(count < 256 && lit <= count);
    count | lit << 16
}

impl Vertex {
    fn samples(&self) -> u32 {
        self.rows[SAMPLES.0][SAMPLES.1].to_bits()
    }

    pub(crate) fn count(&self) -> u32 {
        self.samples() & 0xff
    }

    /// Samples left that draw a light sample. They come first.
    fn lit(&self) -> u32 {
        self.samples() >> 16
    }

    pub(crate) fn root(&self) -> u32 {
        self.rows[ROOT.0][ROOT.1].to_bits()
    }

    pub(crate) fn ledger(&self) -> u32 {
        self.rows[LEDGER.0][LEDGER.1].to_bits()
    }

    /// Takes `m` of its samples; returns the number of the first.
    fn take(&mut self, m: u32) -> u32 {
        let first = self.samples() >> 8 & 0xff;
        let (count, lit) = (self.count().saturating_sub(m), self.lit().saturating_sub(m));
        self.rows[SAMPLES.0][SAMPLES.1] = f32::from_bits(count | (first.wrapping_add(m) & 0xff) << 8 | lit << 16);
        first
    }
}

impl Vertex8 {
    fn columns(&self) -> [[F32x8; 8]; 4] {
        let f = F32x8::from_bits;
        [
            [self.p.x, self.p.y, self.p.z, self.error, self.ng.x, self.ng.y, self.ng.z, f(self.material)],
            [self.ns.x, self.ns.y, self.ns.z, self.wo.x, self.wo.y, self.wo.z, f(self.root), f(self.depth)],
            [
                self.beta.x,
                self.beta.y,
                self.beta.z,
                self.reflectance.x,
                self.reflectance.y,
                self.reflectance.z,
                f(self.key.lo),
                f(self.key.hi),
            ],
            [
                self.albedo_product,
                f(self.ledger),
                f(self.samples),
                self.drawn,
                f(self.bin),
                self.error_weight.x,
                self.error_weight.y,
                self.error_weight.z,
            ],
        ]
    }

    fn from_columns(c: [[F32x8; 8]; 4]) -> Self {
        let [a, b, d, e] = c;
        Self {
            p: Vec3x8::new(a[0], a[1], a[2]),
            error: a[3],
            ng: Vec3x8::new(a[4], a[5], a[6]),
            material: a[7].to_bits(),
            ns: Vec3x8::new(b[0], b[1], b[2]),
            wo: Vec3x8::new(b[3], b[4], b[5]),
            root: b[6].to_bits(),
            depth: b[7].to_bits(),
            beta: Vec3x8::new(d[0], d[1], d[2]),
            reflectance: Vec3x8::new(d[3], d[4], d[5]),
            key: Key8 { lo: d[6].to_bits(), hi: d[7].to_bits() },
            albedo_product: e[0],
            ledger: e[1].to_bits(),
            samples: e[2].to_bits(),
            drawn: e[3],
            bin: e[4].to_bits(),
            error_weight: Vec3x8::new(e[5], e[6], e[7]),
        }
    }

    /// The eight lanes as records.
    pub(crate) fn records(&self) -> [Vertex; 8] {
        let mut out: [Vertex; 8] = Zeroable::zeroed();
        for (r, columns) in self.columns().into_iter().enumerate() {
            for (v, row) in out.iter_mut().zip(F32x8::transpose(columns)) {
                v.rows[r] = row.to_array();
            }
        }
        out
    }

    /// Loads one record per lane.
    pub(crate) fn from_records(v: [&Vertex; 8]) -> Self {
        let mut columns = [[F32x8::ZERO; 8]; 4];
        for (r, c) in columns.iter_mut().enumerate() {
            let mut rows = [F32x8::ZERO; 8];
            for (row, v) in rows.iter_mut().zip(v) {
                *row = F32x8::new(v.rows[r]);
            }
            *c = F32x8::transpose(rows);
        }
        Self::from_columns(columns)
    }
}

/// A fixed ring of slot numbers. The newest leaves first: depth-first order keeps few vertices waiting.
#[derive(Debug)]
struct Ring<'m> {
    slots: &'m mut [u32],
    head: usize,
    len: usize,
}

impl Ring<'_> {
    /// The pool never holds more vertices than a ring has slots, so there is always room.
    fn push(&mut self, slot: u32) {
        let n = self.slots.len();
        if self.len < n {
            self.slots[(self.head + self.len) % n] = slot;
            self.len += 1;
        }
    }

    fn newest(&self) -> Option<u32> {
        let n = self.slots.len();
        (self.len > 0).then(|| self.slots[(self.head + self.len - 1) % n])
    }

    fn pop_newest(&mut self) {
        self.len = self.len.saturating_sub(1);
    }
}

/// Samples drawn from waiting vertices for one packet.
pub(crate) struct Batch {
    /// Vertices, one per lane; lanes from `lanes` on repeat lane 0.
    pub vertex: Vertex8,
    /// Sample number within its vertex.
    pub sample: U32x8,
    /// How many lanes are filled.
    pub lanes: usize,
}

/// All waiting vertices of a shard: a slab of records, a list of free slots and two rings per class.
#[derive(Debug)]
pub(crate) struct Pool<'m> {
    records: &'m mut [Vertex],
    free: FreeList<'m>,
    rings: [Ring<'m>; RINGS],
    /// Samples that can be taken from each ring.
    pending: [u64; RINGS],
}

/// Vertices that may start while this many slots stay free can always run their packet to its end.
pub(crate) const RESERVE: usize = 8;

impl<'m> Pool<'m> {
    pub(crate) fn measure(m: Measure, capacity: usize) -> Measure {
        (0..RINGS).fold(FreeList::measure(m.add::<Vertex>(capacity), capacity), |m, _| m.add::<u32>(capacity))
    }

    pub(crate) fn carve(c: &mut Carver<'m>, capacity: usize) -> Result<Self, MemoryError> {
        let records = c.take_unset(capacity)?;
        let free = FreeList::carve(c, capacity)?;
        let mut rings = core::array::from_fn(|_| Ring { slots: &mut [], head: 0, len: 0 });
        for r in &mut rings {
            r.slots = c.take_unset(capacity)?;
        }
        Ok(Self { records, free, rings, pending: [0; RINGS] })
    }

    /// Forgets all that waits.
    pub(crate) fn reset(&mut self) {
        self.free.reset();
        for r in &mut self.rings {
            (r.head, r.len) = (0, 0);
        }
        self.pending = [0; RINGS];
    }

    /// Empty slots.
    pub(crate) fn free(&self) -> usize {
        self.free.len()
    }

    /// The ring with most samples waiting, and how many.
    pub(crate) fn fullest(&self) -> (usize, u64) {
        let mut best = (0, 0);
        for (c, &n) in self.pending.iter().enumerate() {
            if n > best.1 {
                best = (c, n);
            }
        }
        best
    }

    /// Stores a vertex with its samples; the caller has made sure that a slot is free.
    pub(crate) fn push(&mut self, class: usize, v: Vertex) {
        let Some(slot) = self.free.take() else { return };
        self.records[slot as usize] = v;
        self.wait(class, slot);
    }

    /// Puts a vertex into the ring of its next samples.
    fn wait(&mut self, class: usize, slot: u32) {
        let v = &self.records[slot as usize];
        let (ring, n) = if v.lit() > 0 { (class, v.lit()) } else { (CLASSES + class, v.count()) };
        self.rings[ring].push(slot);
        self.pending[ring] += u64::from(n);
    }

    /// Takes up to eight samples from a ring, newest vertices first, so that even if every one of them goes on there is
    /// a slot for each. A vertex that has no light samples left goes over to the other ring of its class. Calls
    /// `taken(vertex, lanes, drained)` per vertex. `None` if no sample fits.
    pub(crate) fn take(&mut self, ring: usize, mut taken: impl FnMut(&Vertex, u32, bool)) -> Option<Batch> {
        let mut slot = [0u32; 8];
        let mut sample = [0u32; 8];
        let mut lanes = 0usize;
        let mut room = self.free.len();
        let lit = ring < CLASSES;
        while lanes < 8 {
            let Some(s) = self.rings[ring].newest() else { break };
            let v = &mut self.records[s as usize];
            let count = v.count();
            let left = if lit { v.lit() } else { count };
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
                slot[lanes] = s;
                sample[lanes] = first.wrapping_add(k);
                lanes += 1;
            }
            room = room + usize::from(drained) - m as usize;
            self.pending[ring] -= u64::from(m);
            taken(v, m, drained);
            if m == left {
                self.rings[ring].pop_newest();
            }
            if drained {
                self.free.give(s);
            } else if m == left {
                self.wait(ring % CLASSES, s);
            }
        }
        if lanes == 0 {
            return None;
        }
        let first = slot[0];
        slot[lanes..].fill(first);
        let vertex = Vertex8::from_records(slot.map(|s| &self.records[s as usize]));
        Some(Batch { vertex, sample: U32x8::new(sample), lanes })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    fn vertex(count: u32, lit: u32) -> Vertex {
        let mut v: Vertex = Zeroable::zeroed();
        v.rows[SAMPLES.0][SAMPLES.1] = f32::from_bits(pack_samples(count, lit));
        v
    }

    /// Random (subcritical) trees through pools of every small size: each turn takes what fits and pushes as `roulette`
    /// may. Every sample is taken exactly once, those with a light sample from a ring of theirs, no turn is stuck, no
    /// slot is lost. Killed by: `room` off by one, a drained slot not given back, `RESERVE` of 0, a vertex that stays
    /// in the ring of its light samples or leaves it early.
    #[test]
    fn no_pool_gets_stuck() {
        let mut word = 7u32;
        let mut next = |n: u32| {
            word = word.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (word >> 8) % n
        };
        for capacity in [16usize, 17, 23, 64] {
            let mut block: Vec<[u8; 64]> = std::vec![[0; 64]; 4096];
            let block: &mut [u8] = bytemuck::cast_slice_mut(&mut block);
            let offset = block.as_ptr().align_offset(crate::memory::BLOCK_ALIGN);
            let layout = Pool::measure(Measure::new(), capacity).layout().unwrap();
            let mut pool = Pool::carve(&mut Carver::new(&mut block[offset..], layout).unwrap(), capacity).unwrap();
            let (mut started, mut pushed, mut taken, mut waiting_lit) = (0, 0u64, 0u64, 0u64);
            while started < 4000 || pool.fullest().1 > 0 {
                let (_, pending) = pool.fullest();
                let lanes = if pending < 8 && started < 4000 && pool.free() >= 2 * RESERVE {
                    started += 8;
                    8
                } else {
                    let mut rings = [pool.fullest().0].into_iter().chain(0..RINGS);
                    let batch = rings.find_map(|r| Some((r, pool.take(r, |_, _, _| ())?)));
                    let (ring, batch) = batch.expect("some ring must always have a sample that fits");
                    waiting_lit -= if ring < CLASSES { batch.lanes as u64 } else { 0 };
                    assert!(pool.free() >= batch.lanes, "a lane has no slot to go on to");
                    taken += batch.lanes as u64;
                    batch.lanes
                };
                let may_split = pool.free() >= lanes + RESERVE;
                for _ in 0..lanes {
                    let n = if next(100) < 91 {
                        0
                    } else if may_split {
                        1 + next(20)
                    } else {
                        1
                    };
                    if n > 0 {
                        let lit = next(n + 1);
                        waiting_lit += u64::from(lit);
                        pool.push(next(CLASSES as u32) as usize, vertex(n, lit));
                        pushed += u64::from(n);
                    }
                }
            }
            assert_eq!((pushed, waiting_lit), (taken, 0));
            assert_eq!(pool.free(), capacity);
        }
    }

    /// Killed by: two fields sharing a column, transposing the wrong way.
    #[test]
    fn vertices_survive_the_pool() {
        let f = |k: usize| F32x8::from_fn(|i| (100 * k + i) as f32);
        let u = |k: usize| U32x8::from_fn(|i| (1000 * k + i) as u32);
        let v3 = |k: usize| Vec3x8::new(f(k), f(k + 1), f(k + 2));
        let v = Vertex8 {
            p: v3(1),
            error: f(4),
            ng: v3(5),
            ns: v3(8),
            wo: v3(11),
            beta: v3(14),
            reflectance: v3(17),
            material: u(20),
            root: u(21),
            key: Key8 { lo: u(22), hi: u(23) },
            depth: u(24),
            albedo_product: f(25),
            samples: u(26),
            drawn: f(27),
            bin: u(29),
            error_weight: v3(30),
            ledger: u(28),
        };
        let records = v.records();
        for (i, r) in records.iter().enumerate() {
            assert_eq!((r.samples(), r.root(), r.ledger()), (26_000 + i as u32, 21_000 + i as u32, 28_000 + i as u32));
        }
        let back = Vertex8::from_records(core::array::from_fn(|i| &records[7 - i]));
        for i in 0..8 {
            assert_eq!(back.p.lane(i), v.p.lane(7 - i));
            assert_eq!(back.reflectance.lane(i), v.reflectance.lane(7 - i));
            assert_eq!((back.key.lo.lane(i), back.key.hi.lane(i)), (v.key.lo.lane(7 - i), v.key.hi.lane(7 - i)));
            assert_eq!(back.albedo_product.lane(i), v.albedo_product.lane(7 - i));
            assert_eq!((back.samples.lane(i), back.drawn.lane(i)), (v.samples.lane(7 - i), v.drawn.lane(7 - i)));
            assert_eq!((back.ledger.lane(i), back.bin.lane(i)), (v.ledger.lane(7 - i), v.bin.lane(7 - i)));
            assert_eq!(back.error_weight.lane(i), v.error_weight.lane(7 - i));
        }
    }
}
