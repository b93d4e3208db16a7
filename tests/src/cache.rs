//! The statistics cache seen from outside: memory for it, data for it, and an independent reader of its saved bytes.

use crate::stats::SplitMix;
use bytemuck::{Pod, Zeroable};
use croupier::unstable::learn::Objective;
use croupier::unstable::learn::cache::{Cache, CacheSize, Training, VertexKind, VertexKind8};
use croupier::unstable::rrs::Local8;
use croupier::unstable::scene::blob::content_hash;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([u8; 64]);

/// Memory for the shared side and the training sides of a cache.
pub struct Blocks {
    size: CacheSize,
    shared: Vec<Line>,
    shards: Vec<Vec<Line>>,
}

impl Blocks {
    /// Memory for a number of leaves or a little more.
    pub fn leaves(leaves: usize, shards: usize) -> Self {
        let size =
            CacheSize::within((leaves + 4) * (2326 + 832 * shards) + 4096, shards as u32).expect("room for a cache");
        Self::new(size, shards)
    }

    /// Memory that is not zeroed: the cache must not rely on it.
    pub fn new(size: CacheSize, shards: usize) -> Self {
        let lines = |bytes: usize| vec![Line([0xa5; 64]); bytes / 64];
        let shard = Training::layout(size).unwrap().size;
        Self {
            size,
            shared: lines(Cache::layout(size).unwrap().size),
            shards: (0..shards).map(|_| lines(shard)).collect(),
        }
    }

    /// Carves all of it; the bounds are `lo` to `hi`.
    pub fn carve(&mut self, lo: [f32; 3], hi: [f32; 3]) -> (Cache<'_>, Vec<Training<'_>>) {
        let block = bytemuck::cast_slice_mut(&mut self.shared);
        let cache = Cache::new(self.size, [lo, hi], Objective::Relative, block).unwrap();
        let training = |b| Training::new(self.size, bytemuck::cast_slice_mut(b)).unwrap();
        (cache, self.shards.iter_mut().map(|b: &mut Vec<Line>| training(b)).collect())
    }
}

/// Bounds of most tests: not a cube, not at the origin.
pub const BOUNDS: [[f32; 3]; 2] = [[-1.0, 2.0, -3.0], [3.0, 4.5, 0.25]];

/// Position near the surface of a ball in [`BOUNDS`], and a direction, as vertices have them.
pub fn vertex(rng: &mut SplitMix) -> ([f32; 3], [f32; 3]) {
    let n = rng.direction();
    let c = [1.0, 3.25, -1.5];
    (core::array::from_fn(|a| (c[a] + 1.1 * n[a] + rng.range(-0.01, 0.01)) as f32), n.map(|x| x as f32))
}

/// Kind with this number, in all lanes.
pub fn kind(number: u32) -> VertexKind8 {
    VertexKind8::splat(VertexKind::ALL[number as usize])
}

/// Number of a random kind.
pub fn any_kind(rng: &mut SplitMix) -> u32 {
    (rng.bits() % VertexKind::ALL.len() as u64) as u32
}

/// Bin of a vertex of the kind with number `number`.
pub fn find(cache: &Cache<'_>, number: u32, p: [f32; 3], d: [f32; 3]) -> u32 {
    let [p, d] = [p, d].map(|v| Vec3x8::splat(v[0], v[1], v[2]));
    cache.find(kind(number), p, d, Mask8::all_lanes()).lane(5)
}

/// Statistics of all bins, eight at a time.
pub fn locals(cache: &Cache<'_>) -> impl Iterator<Item = Local8> {
    let local = |k: u32| cache.local(U32x8::from_fn(|i| 8 * k + i as u32), Mask8::all_lanes());
    (0..cache.bins() / 8).map(local)
}

/// Panics unless all of `l` is as documented.
pub fn assert_sane(l: &Local8) {
    let share = l.nee_share.ge(F32x8::ZERO) & l.nee_share.le(F32x8::ONE);
    let mut ok = share & l.cost.is_finite() & l.cost.ge(F32x8::ZERO) & l.count.is_finite() & l.count.ge(F32x8::ZERO);
    for (m, q, v) in [
        (l.mean.x, l.moment.x, l.variance.x),
        (l.mean.y, l.moment.y, l.variance.y),
        (l.mean.z, l.moment.z, l.variance.z),
    ] {
        ok = ok & m.ge(F32x8::ZERO) & q.is_finite() & q.ge(m * m) & v.ge(F32x8::ZERO) & v.le(q);
    }
    assert!(ok.all(), "{l:?}");
}

/// Runs an iteration of `n` vertices per shard: values in multiples of 2^-10, so that small sums are exact.
pub fn iterate(cache: &mut Cache<'_>, shards: &mut [Training<'_>], n: usize, split: f64, rng: &mut SplitMix) {
    for t in &mut *shards {
        t.clear(cache.bins());
        for _ in 0..n {
            let (p, d) = vertex(rng);
            let bin = find(cache, any_kind(rng), p, d);
            let x = [(); 3].map(|()| (rng.bits() >> 58) as f32 / 1024.0);
            assert!(t.log(bin, x, (rng.bits() >> 61) as f32));
            assert!(t.log_pair(bin, x));
            assert!(t.log_shadow(bin, x[0] < 0.02));
            t.log_nee(bin, x, 0.5);
        }
    }
    cache.begin_merge(1.0);
    shards.iter().for_each(|t| cache.absorb(t));
    cache.freeze(split);
}

/// Saved bytes of the cache.
pub fn saved(cache: &Cache<'_>) -> Vec<u8> {
    let mut bytes = vec![0x5a; cache.saved_len()];
    assert_eq!(cache.save(&mut bytes), Ok(bytes.len()));
    bytes
}

/// Makes the stored hash that of the bytes.
pub fn rehash(bytes: &mut [u8]) {
    let h = content_hash(&bytes[16..]);
    bytes[8..16].copy_from_slice(&h.to_le_bytes());
}

/// Offset of the sums in saved bytes.
pub fn sums_at(bytes: &[u8]) -> usize {
    let nodes = u32::from_le_bytes(bytes[20..24].try_into().unwrap()) as usize;
    64 + nodes.div_ceil(8) * 8
}

/// Node of the oracle's trees.
enum OracleNode {
    Inner(Vec<usize>),
    Leaf(usize),
}

/// Number of sums of a bin.
pub const FIELDS: usize = 15;

/// Sums of a bin: count, pairs, cost, sum (3), squared sum (3), pair sum (3), shadow rays, unoccluded ones, squares of
/// next event estimation.
pub type Sums = [f64; FIELDS];

/// Reader of saved bytes, in f64.
pub struct Oracle {
    nodes: Vec<OracleNode>,
    roots: [usize; 6],
    lo: [f64; 3],
    edge: f64,
    /// Sums per leaf and bin.
    pub leaves: Vec<[Sums; 16]>,
}

/// Leaf of the oracle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Number in the order of the bytes.
    pub leaf: usize,
    /// Edge, world units.
    pub edge: f64,
}

impl Oracle {
    /// Reads saved bytes.
    pub fn new(bytes: &[u8]) -> Self {
        let f = |i: usize| f64::from(f32::from_le_bytes(bytes[28 + 4 * i..32 + 4 * i].try_into().unwrap()));
        let mut o = Self { nodes: vec![], roots: [0; 6], lo: [f(0), f(1), f(2)], edge: f(3), leaves: vec![] };
        let (mut shape, mut sums) = (bytes[64..].iter(), bytes[sums_at(bytes)..].chunks_exact(8));
        o.roots = [0; 6].map(|_| o.read(&mut shape, &mut sums));
        assert!(sums.next().is_none());
        o
    }

    fn read<'b>(
        &mut self,
        shape: &mut impl Iterator<Item = &'b u8>,
        sums: &mut impl Iterator<Item = &'b [u8]>,
    ) -> usize {
        let node = if *shape.next().unwrap() == 1 {
            OracleNode::Inner((0..8).map(|_| self.read(shape, sums)).collect())
        } else {
            let mut number = || f64::from_le_bytes(sums.next().unwrap().try_into().unwrap());
            self.leaves.push([(); 16].map(|()| [(); FIELDS].map(|()| number())));
            OracleNode::Leaf(self.leaves.len() - 1)
        };
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Is the position so near to a border of the finest grid that f32 may take the other side?
    pub fn ambiguous(&self, p: [f64; 3]) -> bool {
        (0..3).any(|a| {
            let cell = (p[a] - self.lo[a]) / self.edge * 65_536.0;
            (cell - cell.round()).abs() < 0.06
        })
    }

    /// Leaf around a position, the nearest one for positions outside.
    pub fn cell(&self, kind: u32, p: [f64; 3]) -> Cell {
        let (mut lo, mut edge) = (self.lo, self.edge);
        let mut node = self.roots[kind as usize];
        while let OracleNode::Inner(children) = &self.nodes[node] {
            edge *= 0.5;
            let mut child = 0;
            for a in 0..3 {
                if p[a] >= lo[a] + edge {
                    child |= 1 << a;
                    lo[a] += edge;
                }
            }
            node = children[child];
        }
        let OracleNode::Leaf(leaf) = self.nodes[node] else { unreachable!() };
        Cell { leaf, edge }
    }

    /// Moves a position into the cube.
    pub fn clamp(&self, p: [f64; 3]) -> [f64; 3] {
        core::array::from_fn(|a| p[a].clamp(self.lo[a], self.lo[a] + self.edge * (1.0 - 1e-7)))
    }

    /// One sum, over all bins of all leaves.
    pub fn total(&self, field: usize) -> f64 {
        self.leaves.iter().flatten().map(|b| b[field]).sum()
    }
}

/// Height (-1 to 1) and azimuth (0 to 2 pi) of a direction on the rotated sphere that the bins are cut from.
pub fn height_and_azimuth(d: [f64; 3]) -> [f64; 2] {
    let dot = |r: [f64; 3]| (r[0] * d[0] + r[1] * d[1] + r[2] * d[2]) / 3.0;
    let (height, x, y) = (dot([2.0, -1.0, 2.0]), dot([2.0, 2.0, -1.0]), dot([-1.0, 2.0, 2.0]));
    [height, y.atan2(x).rem_euclid(std::f64::consts::TAU)]
}

/// Puts other sums into saved bytes: `sums` gives those of a bin.
pub fn overwrite(bytes: &mut [u8], mut sums: impl FnMut() -> Sums) {
    let at = sums_at(bytes);
    for bin in bytes[at..].chunks_exact_mut(8 * FIELDS) {
        for (b, x) in bin.chunks_exact_mut(8).zip(sums()) {
            b.copy_from_slice(&x.to_le_bytes());
        }
    }
    rehash(bytes);
}

/// Sums of a bin that have nothing to do with any scene, each number over many orders of magnitude; some bins are
/// empty.
pub fn random_sums(rng: &mut SplitMix) -> Sums {
    let mut log = |lo: f64, hi: f64| (rng.range(lo.ln(), hi.ln())).exp();
    let (count, pairs) = (log(1.0, 1e5), log(1.0, 1e5));
    let mean = [(); 3].map(|()| log(1e-2, 10.0));
    let spread = [(); 3].map(|()| log(1e-3, 30.0));
    let cost = log(1.0, 30.0) * count;
    let pair = [(); 3].map(|()| log(1e-4, 100.0) * pairs);
    let rays = log(1.0, 1e4);
    let visible = rays * log(1e-6, 2.0);
    if log(1.0, 10.0) < 1.3 {
        return [0.0; FIELDS];
    }
    let light = count * log(1e-8, 1e2);
    let of = |c: usize| mean[c] * count;
    let sqr = |c: usize| mean[c] * mean[c] * (1.0 + spread[c]) * count;
    let (s, p) = ([sqr(0), sqr(1), sqr(2)], pair);
    [count, pairs, cost, of(0), of(1), of(2), s[0], s[1], s[2], p[0], p[1], p[2], rays, visible, light]
}
