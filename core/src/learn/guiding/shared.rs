//! What all shards sample: frozen while they work, changed between iterations.
#![deny(clippy::unwrap_used, clippy::expect_used)]

use super::fraction::LeafSums;
use super::log::{GuideLog, NO_LEAF};
use super::node::{self, Cell, GuideNode, LEVELS, NodeSums, UNIFORM};
use super::size::GuideSize;
use super::sphere;
use crate::learn::cache::tree::{Tree, TreeScalars, nodes_for};
use crate::memory::{Carver, Layout, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};
use core::f32::consts::PI;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Directions in which a shading normal may mainly point: an octree for each.
const FACES: u32 = 6;
/// Number of octrees: the last is that of vertices without a normal, in media.
pub(super) const ROOTS: u32 = FACES + 1;

/// Density of all directions alike, 1/sr.
pub(super) const UNIFORM_PDF: f32 = 1.0 / (4.0 * PI);

/// Places along each axis that logs tell apart.
const PLACES: f32 = 256.0;

/// Most nodes: their numbers have 16 bits.
const MOST_NODES: u32 = 1 << 16;
/// Nodes for each subdivision, of seven more leaves.
const NODES_PER_SUBDIVISION: u32 = 14;
/// Range of the entries of a log.
const HITS: [usize; 2] = [64, 1 << 20];

impl GuideSize {
    /// Capacity of the largest guide with logs for `shards` shards that fit in `bytes` together; `None` if none fits.
    /// The logs have a quarter of the bytes, at least 64 entries of 12 bytes each, and at most 1,048,576 for a shard. There
    /// are at most 65,536 nodes, some 12 MiB: more bytes stay unused.
    pub fn within(bytes: usize, shards: u32) -> Option<Self> {
        let [least, most] = HITS;
        let hits = (bytes / 4 / (shards.max(1) as usize) / GuideLog::HIT_BYTES).clamp(least, most) as u32;
        let of = |nodes: u32| Self { subdivisions: nodes / NODES_PER_SUBDIVISION, nodes, hits };
        let fits = |nodes: u32| of(nodes).bytes(shards).is_some_and(|b| b <= bytes);
        let least = NODES_PER_SUBDIVISION;
        if !fits(least) {
            return None;
        }
        // the largest that fits, by bisection; `fits(low)` always holds
        let (mut low, mut high) = (least, MOST_NODES + 1);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if fits(middle) { low = middle } else { high = middle }
        }
        Some(of(low))
    }

    /// Bytes of the smallest guide with logs for `shards` shards; `None` if they cannot be addressed.
    pub(crate) fn least(shards: u32) -> Option<usize> {
        let nodes = NODES_PER_SUBDIVISION;
        Self { subdivisions: 1, nodes, hits: HITS[0] as u32 }.bytes(shards)
    }

    /// Memory of the guide and of `shards` logs, bytes.
    pub fn bytes(self, shards: u32) -> Option<usize> {
        let logs = GuideLog::layout(self)?.size.checked_mul(shards as usize)?;
        Guide::layout(self)?.size.checked_add(logs)
    }
}

/// A leaf as it is sampled.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FrozenLeaf {
    /// Node of all directions, [`UNIFORM`] where nothing is known.
    pub(super) root: u16,
    /// Share of samples that are to be guided, in 65536ths; see [`Self::share`].
    pub(super) fraction: u16,
}

impl FrozenLeaf {
    /// Share of samples that are guided, in 65536ths: none where no directions are known, because nodes have run out.
    pub(super) fn share(self) -> u16 {
        if self.root == UNIFORM { 0 } else { self.fraction }
    }
}

/// How far the learning at the end of an iteration has come.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Rebuild {
    pub(super) pass: u32,
    /// Below [`LEVELS`].
    pub(super) round: u32,
    /// Next node, leaf or cell.
    pub(super) index: u32,
    /// Part of the old sums that is kept.
    pub(super) keep: f32,
    /// What is learned from: see `light.rs`.
    pub(super) source: u32,
    /// Subdivisions by light paths that have been made.
    pub(super) level: u32,
    pub(super) seen: SeenSums,
}

/// Sums over the logs of an iteration with light paths.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SeenSums {
    /// Arrivals of light paths.
    pub(super) arrivals: f32,
    /// Contributions of camera paths.
    pub(super) contributions: f32,
    /// Their squares.
    pub(super) square: f32,
    /// The contributions themselves.
    pub(super) sum: f32,
}

/// All of a guide but its tables.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct GuideScalars {
    pub(super) tree: TreeScalars,
    /// Nodes that were ever used.
    pub(super) used: u32,
    /// The first free node among them, linked by their first children; [`UNIFORM`] if there is none.
    pub(super) free: u32,
    /// Number of those.
    pub(super) free_nodes: u32,
    /// Subdivisions, of leaves or cells, that found no room.
    pub(super) refused: u32,
    /// Directions that logs had no room for.
    pub(super) thinned: u64,
    pub(super) rebuild: Rebuild,
}

impl GuideScalars {
    /// Those of a guide that has learned nothing, over the bounds `lo` to `hi`.
    pub(crate) fn new([lo, hi]: [[f32; 3]; 2]) -> Self {
        let rebuild = Rebuild::default();
        Self {
            tree: TreeScalars::roots(ROOTS, lo, hi),
            used: 1,
            free: 0,
            free_nodes: 0,
            refused: 0,
            thinned: 0,
            rebuild,
        }
    }

    /// Are these the scalars of a guide of this size?
    pub(crate) fn fit(&self, size: GuideSize) -> bool {
        let nodes = self.used >= 1 && self.used <= size.nodes && self.free < self.used && self.free_nodes < self.used;
        let r = &self.rebuild;
        let rebuild = r.round < LEVELS as u32 && (0.0..=1.0).contains(&r.keep) && r.has_source();
        nodes && rebuild && Tree::<ROOTS>::fits(&self.tree, size.subdivisions, leaves(size))
    }
}

/// The face of a cube that each of eight vectors mainly points to, below [`FACES`].
#[inline(always)]
fn face(n: Vec3x8) -> U32x8 {
    let a = n.abs();
    let z = a.z.ge(a.x.max(a.y));
    let y = a.y.ge(a.x);
    let along = z.select(n.z, y.select(n.y, n.x));
    let axis = U32x8::select(z, U32x8::splat(4), U32x8::select(y, U32x8::splat(2), U32x8::splat(0)));
    U32x8::select(along.lt(F32x8::ZERO), axis + U32x8::splat(1), axis)
}

/// The octrees of vertices with shading normals `n`, or without, in media.
#[inline(always)]
fn octree(n: Option<Vec3x8>) -> U32x8 {
    n.map_or(U32x8::splat(FACES), face)
}

/// Most leaves of a guide.
fn leaves(size: GuideSize) -> u32 {
    ROOTS + 7 * size.subdivisions
}

/// What eight vertices sample: the leaf that each has drawn.
#[derive(Clone, Copy, Debug)]
pub struct Guide8 {
    /// Leaves, [`NO_LEAF`] in other lanes.
    pub leaf: U32x8,
    /// Share of samples that are guided.
    pub fraction: F32x8,
    /// Lanes whose leaf has learned anything.
    pub known: Mask8,
    root: [u16; 8],
}

/// Distributions of directions by position, as all shards sample them.
#[derive(Debug)]
pub struct Guide<'m> {
    pub(super) tree: Tree<'m, ROOTS>,
    pub(super) frozen: &'m mut [FrozenLeaf],
    pub(super) leaves: &'m mut [LeafSums],
    pub(super) nodes: &'m mut [GuideNode],
    pub(super) sums: &'m mut [NodeSums],
    pub(super) size: GuideSize,
    pub(super) scalars: GuideScalars,
}

impl<'m> Guide<'m> {
    /// Size and alignment of the block that [`Self::new`] needs; `None` if it cannot be addressed.
    pub fn layout(size: GuideSize) -> Option<Layout> {
        Self::measure(Measure::new(), size).layout()
    }

    /// A guide in a block of its own, over the bounds `lo` to `hi`, world space, that has learned nothing.
    ///
    /// # Errors
    /// A block that does not fit.
    pub fn new(size: GuideSize, bounds: [[f32; 3]; 2], block: &'m mut [u8]) -> Result<Self, MemoryError> {
        let given = block.len();
        let layout = Self::layout(size).ok_or(MemoryError::TooSmall { needed: usize::MAX, given })?;
        let mut guide = Self::carve(&mut Carver::new(block, layout)?, size, &GuideScalars::new(bounds))?;
        guide.reset();
        Ok(guide)
    }

    /// Bytes; [`Self::carve`] leaves the tables as they are until [`Self::reset`].
    pub(crate) fn measure(m: Measure, size: GuideSize) -> Measure {
        Tree::<ROOTS>::measure(m, nodes_for(size.subdivisions), leaves(size))
            .add::<FrozenLeaf>(leaves(size) as usize)
            .add::<LeafSums>(leaves(size) as usize)
            .add::<GuideNode>(size.nodes as usize)
            .add::<NodeSums>(size.nodes as usize)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, size: GuideSize, scalars: &GuideScalars) -> Result<Self, MemoryError> {
        let tree = Tree::carve(c, nodes_for(size.subdivisions), leaves(size), &scalars.tree)?;
        let (frozen, sums) = (c.take_unset(leaves(size) as usize)?, c.take_unset(leaves(size) as usize)?);
        let (nodes, node_sums) = (c.take_unset(size.nodes as usize)?, c.take_unset(size.nodes as usize)?);
        Ok(Self { tree, frozen, leaves: sums, nodes, sums: node_sums, size, scalars: *scalars })
    }

    pub(crate) fn scalars(&self) -> GuideScalars {
        GuideScalars { tree: self.tree.scalars(), ..self.scalars }
    }

    /// Forgets everything learned.
    pub fn reset(&mut self) {
        self.tree.reset();
        let roots = ROOTS as usize;
        self.frozen.iter_mut().take(roots).for_each(|l| *l = FrozenLeaf { root: UNIFORM, fraction: 0 });
        self.leaves.iter_mut().take(roots).for_each(|l| *l = LeafSums::EMPTY);
        self.nodes.iter_mut().take(1).for_each(|n| *n = GuideNode::UNIFORM);
        self.sums.iter_mut().take(1).for_each(|n| *n = NodeSums::EMPTY);
        let s = &mut self.scalars;
        (s.used, s.free, s.free_nodes, s.refused) = (1, 0, 0, 0);
        (s.thinned, s.rebuild) = (0, Rebuild::default());
    }

    /// The leaves of eight vertices at `p`, world space, with shading normals `n`, none in media: of positions moved by
    /// `jitter - 0.5` of the edge of their leaf, `jitter` in [0, 1), so that borders of leaves are not visible.
    #[inline(always)]
    pub fn at(&self, p: Vec3x8, n: Option<Vec3x8>, jitter: [F32x8; 3], active: Mask8) -> Guide8 {
        let root = octree(n);
        let leaf = U32x8::select(active, self.tree.leaf(root, p, Some(jitter)), U32x8::splat(NO_LEAF));
        let (of, used) = (leaf.to_array(), self.frozen.get(..self.tree.leaves() as usize).unwrap_or(&[]));
        let none = FrozenLeaf { root: UNIFORM, fraction: 0 };
        let found: [FrozenLeaf; 8] = core::array::from_fn(|i| used.get(of[i] as usize).copied().unwrap_or(none));
        Guide8 {
            leaf,
            fraction: F32x8::from_fn(|i| f32::from(found[i].share())) * (1.0 / 65_536.0),
            known: !U32x8::from_fn(|i| found[i].root.into()).eq(U32x8::splat(UNIFORM.into())),
            root: found.map(|f| f.root),
        }
    }

    /// Words of the places of eight vertices, as [`GuideLog`] keeps those of light paths: 8 bits for each coordinate in the
    /// octrees' cube, and for the octree.
    #[inline(always)]
    pub(crate) fn place(&self, p: Vec3x8, n: Option<Vec3x8>) -> U32x8 {
        let root = octree(n);
        let [x, y, z, edge] = self.tree.cube;
        let q = [p.x - x, p.y - y, p.z - z].map(|d| (d * (PLACES / edge)).clamp(0.0, PLACES - 0.01).to_i32().to_u32());
        root | q[0] << 8 | q[1] << 16 | q[2] << 24
    }

    /// The leaf of a place.
    pub(super) fn leaf_of_place(&self, place: u32) -> u32 {
        let [x, y, z, edge] = self.tree.cube;
        let [i, j, k] = [8, 16, 24].map(|shift| ((place >> shift & 0xff) as f32 + 0.5) * (edge / PLACES));
        let root = U32x8::splat((place & 0xff).min(ROOTS - 1));
        self.tree.leaf(root, Vec3x8::splat(x + i, y + j, z + k), None).lane(0)
    }

    /// Unit vectors, world space, and their densities, 1/sr, from four random words each, of which the upper half of
    /// the second one is not read ([`Guide8::chosen`]). Lanes outside of `lanes` hold any unit vector.
    #[inline(always)]
    pub fn sample(&self, at: &Guide8, words: [U32x8; 4], lanes: Mask8) -> (Vec3x8, F32x8) {
        let [a, b, ..] = words.map(U32x8::to_array);
        let mut cells = [Cell { at: [0; 2], per_row: 1, density: 1.0 }; 8];
        for i in lanes.lanes() {
            let bits: [u16; LEVELS] = [(a[i] >> 16) as u16, a[i] as u16, b[i] as u16];
            cells[i] = node::sample(self.nodes, at.root[i], bits);
        }
        let edge = F32x8::ONE / F32x8::from_fn(|i| cells[i].per_row as f32);
        let [_, _, u, v] = words.map(U32x8::to_unit);
        let x = (F32x8::from_fn(|i| cells[i].at[0] as f32) + u) * edge;
        let y = (F32x8::from_fn(|i| cells[i].at[1] as f32) + v) * edge;
        (sphere::from_square([x, y]), F32x8::from_fn(|i| cells[i].density) * UNIFORM_PDF)
    }

    /// Density of sampling the unit vectors `d`, 1/sr; 0 outside of `lanes`.
    #[inline(always)]
    pub fn pdf(&self, at: &Guide8, d: Vec3x8, lanes: Mask8) -> F32x8 {
        if lanes.none() {
            return F32x8::ZERO;
        }
        let point = sphere::quantised(d).to_array();
        let mut pdf = [0.0; 8];
        for i in lanes.lanes() {
            pdf[i] = node::find(self.nodes, at.root[i], point[i]).density;
        }
        F32x8::new(pdf) * UNIFORM_PDF
    }

    /// Number of leaves in use, of all octrees.
    pub fn leaves(&self) -> u32 {
        self.tree.leaves()
    }

    /// Number of nodes in use, of all leaves.
    pub fn nodes(&self) -> u32 {
        self.scalars.used.saturating_sub(self.scalars.free_nodes)
    }

    /// Does it know any directions?
    #[inline(always)]
    pub(crate) fn knows_directions(&self) -> bool {
        self.nodes() > 1
    }

    /// Number of subdivisions, of leaves or cells, that found no room.
    pub fn refused(&self) -> u32 {
        self.scalars.refused
    }

    /// Number of directions that the shards' logs had no room for, of all iterations: logs kept a random part of all.
    pub fn thinned(&self) -> u64 {
        self.scalars.thinned
    }

    /// Has it learned from so many contributions, older ones discounted?
    pub(crate) fn has_learned_from(&self, contributions: f32) -> bool {
        let mut hits = 0.0;
        let used = self.leaves.iter().take(self.tree.leaves() as usize);
        used.map(|l| l.hits).any(|n| {
            hits += n;
            hits >= contributions
        })
    }

    /// Mean share of guided samples, over the contributions that were learned from.
    pub fn mean_fraction(&self) -> f64 {
        let used = self.tree.leaves() as usize;
        let (mut sum, mut all) = (0.0, 0.0);
        for (f, l) in self.frozen.iter().zip(self.leaves.iter()).take(used) {
            sum += f64::from(l.hits) * f64::from(f.share()) / 65_536.0;
            all += f64::from(l.hits);
        }
        if all > 0.0 { sum / all } else { 0.0 }
    }
}

impl Guide8 {
    /// Nothing to sample.
    pub const NONE: Self =
        Self { leaf: U32x8::splat(NO_LEAF), fraction: F32x8::ZERO, known: Mask8::NONE, root: [UNIFORM; 8] };

    /// The same, but samples outside of `lanes` are not guided.
    #[inline(always)]
    pub(crate) fn only(self, lanes: Mask8) -> Self {
        Self { fraction: lanes.zero_unless(self.fraction), ..self }
    }

    /// Lanes whose sample is guided, by the random words of [`Guide::sample`].
    #[inline(always)]
    pub fn chosen(&self, words: &[U32x8; 4]) -> Mask8 {
        let [_, choice, ..] = words;
        (*choice >> 16).to_i32().to_f32().lt(self.fraction * 65_536.0)
    }
}
