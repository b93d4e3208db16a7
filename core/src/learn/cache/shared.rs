//! The side of the cache that all shards look up in.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::bins::{BINS, BinSums, FrozenBin, NO_BIN};
use super::kind::{ROOTS, VertexKind8};
use super::size::CacheSize;
use super::training::Training;
use super::tree::{MAX_DEPTH, OctreeNode, Tree, TreeScalars, direction_bin, group_nodes, nodes_for};
use crate::learn::settings::Objective;
use crate::memory::{Carver, Layout, Measure, MemoryError};
use crate::rrs::Local8;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

impl CacheSize {
    /// Capacity of the largest cache whose shared side and `shards` training sides fit in `bytes` together; `None` if
    /// none fits. The smallest, four leaves that never grow, takes 9.7 KiB and 3.25 KiB more for each shard.
    pub fn within(bytes: usize, shards: u32) -> Option<Self> {
        let fits = |subdivisions: u32| Self { subdivisions }.bytes(shards).is_some_and(|b| b <= bytes);
        if !fits(0) {
            return None;
        }
        // the largest that fits, by bisection; `fits(low)` always holds
        let (mut low, mut high) = (0, Self::MAX_SUBDIVISIONS + 1);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if fits(middle) { low = middle } else { high = middle }
        }
        Some(Self { subdivisions: low })
    }

    /// Memory of the shared side and of `shards` training sides, bytes.
    pub fn bytes(self, shards: u32) -> Option<usize> {
        let training = Training::layout(self)?.size.checked_mul(shards as usize)?;
        Cache::layout(self)?.size.checked_add(training)
    }
}

/// All of a cache but its tables.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct CacheScalars {
    pub(super) subdivisions_refused: u64,
    pub(super) freeze: Freeze,
    /// Number of bins that look-ups may read.
    pub(super) readable: u32,
    /// Not 0: the sums in memory are not of this render.
    unset: u32,
    tree: TreeScalars,
}

/// How far [`Cache::freeze`] has come.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Freeze {
    /// Samples above which a leaf is subdivided in this pass.
    pub(super) threshold: f64,
    /// Samples of the largest leaf left that may be subdivided.
    pub(super) largest: f64,
    pub(super) pass: u32,
    /// Next node, cell, group or leaf.
    pub(super) index: u32,
    /// Nodes of this pass end before this index.
    pub(super) end: u32,
    /// Not 0 if a subdivision was refused.
    pub(super) full: u32,
    /// Passes of subdivision.
    pub(super) passes: u32,
    pub(super) reserved: u32,
}

impl Freeze {
    /// The beginning of a pass; one over nodes ends before `end`.
    pub(super) fn at(pass: u32, end: u32) -> Self {
        Self { threshold: f64::INFINITY, pass, end, ..Self::default() }
    }

    /// The next node of a pass over all nodes.
    pub(super) fn next_node(&mut self) -> Option<u32> {
        let [mut next, end] = [self.index, self.end];
        // behind the roots lie unused words
        if next == ROOTS {
            next = group_nodes(0).start;
        }
        self.index = next.saturating_add(1);
        (next < end).then_some(next)
    }
}

/// Shared side of the statistics: frozen while shards work, changed between iterations.
#[derive(Debug)]
pub struct Cache<'m> {
    pub(super) tree: Tree<'m, ROOTS>,
    pub(super) sums: &'m mut [BinSums],
    pub(super) frozen: &'m mut [FrozenBin],
    /// Square roots of visibilities in 255ths, apart from `frozen` because they are read for other bins.
    pub(super) visibility: &'m mut [u8],
    pub(super) size: CacheSize,
    /// Objective, on which the units of first vertices depend.
    pub(super) objective: Objective,
    pub(super) scalars: CacheScalars,
    /// Sums over groups of children, while look-ups are computed.
    pub(super) groups: &'m mut [BinSums],
    /// Number of leaves of a cache without a tree.
    pub(super) flat: Option<u32>,
}

impl CacheScalars {
    /// Those of an empty cache over the bounds `lo` to `hi`.
    pub(crate) fn new([lo, hi]: [[f32; 3]; 2]) -> Self {
        let tree = TreeScalars::roots(ROOTS, lo, hi);
        Self { subdivisions_refused: 0, freeze: Freeze::default(), readable: 0, unset: 1, tree }
    }

    /// Are these the scalars of a cache of this size?
    pub(crate) fn fit(&self, size: CacheSize) -> bool {
        Tree::<ROOTS>::fits(&self.tree, size.subdivisions, size.leaves())
    }
}

impl<'m> Cache<'m> {
    /// Size and alignment of the block that [`Self::new`] needs; `None` if it cannot be addressed.
    pub fn layout(size: CacheSize) -> Option<Layout> {
        Self::measure(Measure::new(), size).layout()
    }

    /// Empty cache in a block of its own, over the bounds `lo` to `hi`, world space, for the values of renders with
    /// this objective.
    pub fn new(
        size: CacheSize,
        [lo, hi]: [[f32; 3]; 2],
        objective: Objective,
        block: &'m mut [u8],
    ) -> Result<Self, MemoryError> {
        let given = block.len();
        let layout = Self::layout(size).ok_or(MemoryError::TooSmall { needed: usize::MAX, given })?;
        let mut cache = Self::carve(&mut Carver::new(block, layout)?, size, objective, &CacheScalars::new([lo, hi]))?;
        cache.reset();
        Ok(cache)
    }

    /// Bytes; [`Self::carve`] leaves the tables as they are until [`Self::reset`].
    pub(crate) fn measure(m: Measure, size: CacheSize) -> Measure {
        Tree::<ROOTS>::measure(m, nodes_for(size.subdivisions), size.leaves())
            .add::<BinSums>(size.bins())
            .add::<FrozenBin>(size.bins())
            .add::<u8>(size.bins())
            .add::<BinSums>(size.subdivisions as usize)
    }

    pub(crate) fn carve(
        c: &mut Carver<'m>,
        size: CacheSize,
        objective: Objective,
        scalars: &CacheScalars,
    ) -> Result<Self, MemoryError> {
        let tree = Tree::carve(c, nodes_for(size.subdivisions), size.leaves(), &scalars.tree)?;
        let (sums, frozen) = (c.take_unset(size.bins())?, c.take_unset(size.bins())?);
        let visibility = c.take_unset(size.bins())?;
        let groups = c.take_unset(size.subdivisions as usize)?;
        Ok(Self { tree, sums, frozen, visibility, size, objective, scalars: *scalars, groups, flat: None })
    }

    pub(crate) fn scalars(&self) -> CacheScalars {
        CacheScalars { tree: self.tree.scalars(), ..self.scalars }
    }

    /// Bins of eight vertices, [`NO_BIN`] in inactive lanes. `p`: positions, world space; those outside the bounds
    /// belong to the nearest leaf. `dir`: unit vectors, world space.
    #[inline]
    pub fn find(&self, kind: VertexKind8, p: Vec3x8, dir: Vec3x8, active: Mask8) -> U32x8 {
        self.bins_of(self.tree.find(kind, p, None), dir, active)
    }

    /// Bins as of [`Self::find`], of positions moved by `jitter - 0.5` of the edge of their leaf, `jitter` in [0, 1): a
    /// stochastic box filter, so that borders of leaves are not visible.
    #[inline]
    pub fn find_jittered(&self, kind: VertexKind8, p: Vec3x8, dir: Vec3x8, jitter: [F32x8; 3], active: Mask8) -> U32x8 {
        self.bins_of(self.tree.find(kind, p, Some(jitter)), dir, active)
    }

    #[inline(always)]
    fn bins_of(&self, first: U32x8, dir: Vec3x8, active: Mask8) -> U32x8 {
        U32x8::select(active, first + direction_bin(dir), U32x8::splat(NO_BIN))
    }

    /// Bins in the leaves of `bin` for other directions: unit vectors `dir`, world space. [`NO_BIN`] in
    /// inactive lanes and where `bin` is no bin.
    #[inline]
    pub fn bins_towards(&self, bin: U32x8, dir: Vec3x8, active: Mask8) -> U32x8 {
        let known = active & bin.lt(U32x8::splat(self.bins()));
        self.bins_of(bin & U32x8::splat(!(BINS as u32 - 1)), dir, known)
    }

    /// Square root of the probability that a shadow ray from the leaf of a bin towards the bin's directions is
    /// unoccluded, rounded up to 255ths; 1 where nothing is known and for bins that are not in use.
    #[inline]
    pub fn visibility_root(&self, bin: U32x8) -> F32x8 {
        let used = self.visibility.get(..self.scalars.readable as usize).unwrap_or(&[]);
        let one = |b: u32| f32::from(used.get(b as usize).copied().unwrap_or(u8::MAX));
        F32x8::new(bin.to_array().map(one)) / F32x8::splat(255.0)
    }

    /// Statistics of eight bins; all 0 in inactive lanes, for bins that are not in use and in leaves without samples.
    /// Values are those that were logged. Means and variances are up to 2^-7 (0.8 %) too small, moments too large.
    /// `count` has the samples of the bin itself, without those of its surroundings that the others are shrunk towards.
    #[inline]
    pub fn local(&self, bin: U32x8, active: Mask8) -> Local8 {
        // beyond the bins that were computed lies whatever the caller's memory held
        let used = self.frozen.get(..self.scalars.readable as usize).unwrap_or(&[]);
        let row = |b: u32| used.get(b as usize).unwrap_or(&FrozenBin::ZERO);
        let [a, b, c, d, e, f, g, h] = U32x8::select(active, bin, U32x8::splat(NO_BIN)).to_array();
        FrozenBin::transpose([row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h)])
    }

    /// Begins the end of an iteration: all sums so far are multiplied by `keep`, 0 to 1.
    pub fn begin_merge(&mut self, keep: f64) {
        while !self.discount(keep, 0, usize::MAX).1 {}
    }

    /// [`Self::begin_merge`] of bins from `at` on, `limit` at most; their number, and `true` after the last.
    pub(crate) fn discount(&mut self, keep: f64, at: usize, limit: usize) -> (usize, bool) {
        let keep = if keep >= 0.0 { keep.min(1.0) } else { 0.0 };
        let (unset, used) = (self.scalars.unset != 0, self.used_mut());
        let (end, len) = (at.saturating_add(limit).min(used.len()), used.len());
        for b in used.get_mut(at..end).unwrap_or(&mut []) {
            if unset {
                *b = BinSums::ZERO;
            } else {
                b.scale(keep);
            }
        }
        let done = end >= len;
        if done {
            self.scalars.unset = 0;
        }
        (end.saturating_sub(at), done)
    }

    /// Adds the sums of one shard. The order of shards must be fixed: the bits of the sums depend on it.
    pub fn absorb(&mut self, t: &Training<'_>) {
        let _ = self.absorb_some(t, 0, usize::MAX);
    }

    /// [`Self::absorb`] of bins from `at` on, `limit` at most; their number, and `true` after the last.
    pub(crate) fn absorb_some(&mut self, t: &Training<'_>, at: usize, limit: usize) -> (usize, bool) {
        let (records, shadows) = (t.records(), t.shadows());
        let end = at.saturating_add(limit).min(records.len());
        let of = |n: usize| at..end.min(n).max(at);
        let sums = self.used_mut();
        let range = of(sums.len());
        let sums = sums.get_mut(range).unwrap_or(&mut []);
        let (records, shadows_some) = (records.get(at..end).unwrap_or(&[]), shadows.get(at..end).unwrap_or(&[]));
        for ((b, r), s) in sums.iter_mut().zip(records).zip(shadows_some) {
            b.absorb(r);
            b.absorb_shadows(s);
        }
        (end.saturating_sub(at), end >= t.records().len())
    }

    /// Completes the end of an iteration: subdivides leaves of more than `subdivide_count` samples (taken as at least
    /// 1), then computes what look-ups read. Bins may have new numbers afterwards.
    ///
    /// Children inherit an eighth of their parent's sums each, and are subdivided again while that is still too many.
    /// If leaves run out, those with most samples have been subdivided first; [`Self::subdivisions_refused`] counts the
    /// rest.
    pub fn freeze(&mut self, subdivide_count: f64) {
        self.begin_freeze();
        while !self.freeze_some(subdivide_count).1 {}
    }

    /// Number of samples of a leaf that is above the depth limit.
    pub(super) fn may_subdivide(&self, index: u32) -> Option<f64> {
        match self.tree.node(index) {
            OctreeNode::Leaf { number, depth } if depth < MAX_DEPTH => {
                Some(self.leaf(number).iter().map(|b| b.count).sum())
            }
            _ => None,
        }
    }

    /// Subdivides a leaf; `false` if there is no room or it is too deep.
    pub(super) fn subdivide(&mut self, index: u32) -> bool {
        let OctreeNode::Leaf { number, .. } = self.tree.node(index) else { return false };
        let Some(first) = self.tree.subdivide(index) else { return false };
        self.leaf_mut(number).iter_mut().for_each(|b| b.scale(0.125));
        let mut leaf = [BinSums::ZERO; BINS];
        leaf.iter_mut().zip(self.leaf(number)).for_each(|(to, from)| *to = *from);
        for child in first..first + 7 {
            self.leaf_mut(child).iter_mut().zip(&leaf).for_each(|(to, from)| *to = *from);
        }
        true
    }

    /// As [`Self::reset`], refused subdivisions included.
    pub(crate) fn forget(&mut self) {
        self.scalars.subdivisions_refused = 0;
        self.reset();
    }

    /// Forgets all statistics and the tree.
    pub fn reset(&mut self) {
        self.tree.reset();
        (self.scalars.unset, self.scalars.readable) = (1, 0);
        if self.flat.is_none() {
            // a few leaves; those without a tree may be many, and are set when the first iteration ends
            self.used_mut().fill(BinSums::ZERO);
            self.scalars.unset = 0;
            self.refresh();
        }
    }

    pub(super) fn leaf(&self, number: u32) -> &[BinSums] {
        let from = number as usize * BINS;
        self.sums.get(from..from + BINS).unwrap_or(&[])
    }

    pub(super) fn leaf_mut(&mut self, number: u32) -> &mut [BinSums] {
        let from = number as usize * BINS;
        self.sums.get_mut(from..from + BINS).unwrap_or(&mut [])
    }

    fn used_mut(&mut self) -> &mut [BinSums] {
        let used = self.leaves() as usize * BINS;
        self.sums.get_mut(..used).unwrap_or(&mut [])
    }

    /// Number of bins in use, for [`Training::clear`]; look-ups give smaller numbers.
    pub fn bins(&self) -> u32 {
        self.leaves() * BINS as u32
    }

    /// Number of leaves in use, of all octrees.
    pub fn leaves(&self) -> u32 {
        self.flat.unwrap_or_else(|| self.tree.leaves())
    }

    /// Gives up the tree for the first `leaves` leaves, at most [`CacheSize::leaves`]: the caller numbers the bins.
    pub(crate) fn flatten(&mut self, leaves: u32) {
        self.flat = Some(leaves.min(self.size.leaves()));
    }

    /// Does the cache have no tree, so that the caller numbers the bins?
    pub(crate) fn is_flat(&self) -> bool {
        self.flat.is_some()
    }

    /// Number of nodes in use, leaves included.
    pub fn nodes(&self) -> u32 {
        self.tree.nodes()
    }

    /// Capacity.
    pub fn size(&self) -> CacheSize {
        self.size
    }

    /// Number of subdivisions that found no room: leaves too large at a [`Self::freeze`], inner nodes of merged caches.
    pub fn subdivisions_refused(&self) -> u64 {
        self.scalars.subdivisions_refused
    }

    pub(super) fn refuse_subdivision(&mut self) {
        self.scalars.subdivisions_refused += 1;
    }
}
