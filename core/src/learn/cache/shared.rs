//! The side of the cache that all shards look up in.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::bins::{BINS, BinSums, FrozenBin, NO_BIN, freeze_leaf};
use super::kind::VertexKind8;
use super::size::CacheSize;
use super::training::Training;
use super::tree::{MAX_DEPTH, OctreeNode, ROOTS, Tree, TreeScalars, direction_bin};
use crate::learn::settings::Objective;
use crate::memory::{Carver, Layout, Measure, MemoryError};
use crate::rrs::Local8;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Samples that the surroundings of a cell count for in it.
const PRIOR_SAMPLES: f64 = 4.0;

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
    subdivisions_refused: u64,
    tree: TreeScalars,
}

/// Shared side of the statistics: frozen while shards work, changed between iterations.
#[derive(Debug)]
pub struct Cache<'m> {
    pub(super) tree: Tree<'m>,
    pub(super) sums: &'m mut [BinSums],
    frozen: &'m mut [FrozenBin],
    /// Square roots of visibilities in 255ths, apart from `frozen` because they are read for other bins.
    visibility: &'m mut [u8],
    pub(super) size: CacheSize,
    /// Objective, on which the units of first vertices depend.
    pub(super) objective: Objective,
    subdivisions_refused: u64,
    /// Number of leaves of a cache without a tree.
    flat: Option<u32>,
}

impl CacheScalars {
    /// Those of an empty cache over the bounds `lo` to `hi`.
    pub(crate) fn new([lo, hi]: [[f32; 3]; 2]) -> Self {
        Self { subdivisions_refused: 0, tree: TreeScalars::roots(lo, hi) }
    }

    /// Are these the scalars of a cache of this size?
    pub(crate) fn fit(&self, size: CacheSize) -> bool {
        Tree::fits(&self.tree, size.subdivisions, size.leaves())
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
        Tree::measure(m, Tree::nodes_for(size.subdivisions), size.leaves())
            .add::<BinSums>(size.bins())
            .add::<FrozenBin>(size.bins())
            .add::<u8>(size.bins())
    }

    pub(crate) fn carve(
        c: &mut Carver<'m>,
        size: CacheSize,
        objective: Objective,
        scalars: &CacheScalars,
    ) -> Result<Self, MemoryError> {
        let tree = Tree::carve(c, Tree::nodes_for(size.subdivisions), size.leaves(), &scalars.tree)?;
        let (sums, frozen) = (c.take_unset(size.bins())?, c.take_unset(size.bins())?);
        let visibility = c.take_unset(size.bins())?;
        let subdivisions_refused = scalars.subdivisions_refused;
        Ok(Self { tree, sums, frozen, visibility, size, objective, subdivisions_refused, flat: None })
    }

    pub(crate) fn scalars(&self) -> CacheScalars {
        CacheScalars { subdivisions_refused: self.subdivisions_refused, tree: self.tree.scalars() }
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
        let used = self.visibility.get(..self.bins() as usize).unwrap_or(&[]);
        let one = |b: u32| f32::from(used.get(b as usize).copied().unwrap_or(u8::MAX));
        F32x8::new(bin.to_array().map(one)) / F32x8::splat(255.0)
    }

    /// Statistics of eight bins; all 0 in inactive lanes, for bins that are not in use and in leaves without samples.
    /// Values are those that were logged. Means and variances are up to 2^-7 (0.8 %) too small, moments too large.
    /// `count` has the samples of the bin itself, without those of its surroundings that the others are shrunk towards.
    #[inline]
    pub fn local(&self, bin: U32x8, active: Mask8) -> Local8 {
        // beyond the bins in use lies whatever the caller's memory held
        let used = self.frozen.get(..self.bins() as usize).unwrap_or(&[]);
        let row = |b: u32| used.get(b as usize).unwrap_or(&FrozenBin::ZERO);
        let [a, b, c, d, e, f, g, h] = U32x8::select(active, bin, U32x8::splat(NO_BIN)).to_array();
        FrozenBin::transpose([row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h)])
    }

    /// Begins the end of an iteration: all sums so far are multiplied by `keep`, 0 to 1.
    pub fn begin_merge(&mut self, keep: f64) {
        let keep = if keep >= 0.0 { keep.min(1.0) } else { 0.0 };
        self.used_mut().iter_mut().for_each(|b| b.scale(keep));
    }

    /// Adds the sums of one shard. The order of shards must be fixed: the bits of the sums depend on it.
    pub fn absorb(&mut self, t: &Training<'_>) {
        self.used_mut().iter_mut().zip(t.records()).for_each(|(b, r)| b.absorb(r));
        self.used_mut().iter_mut().zip(t.shadows()).for_each(|(b, s)| b.absorb_shadows(s));
    }

    /// Completes the end of an iteration: subdivides leaves of more than `subdivide_count` samples (taken as at least
    /// 1), then computes what look-ups read. Bins may have new numbers afterwards.
    ///
    /// Children inherit an eighth of their parent's sums each, and are subdivided again while that is still too many.
    /// If leaves run out, those with most samples have been subdivided first; [`Self::subdivisions_refused`] counts the
    /// rest.
    pub fn freeze(&mut self, subdivide_count: f64) {
        if self.flat.is_some() {
            return self.refresh();
        }
        let limit = if subdivide_count.is_nan() { f64::INFINITY } else { subdivide_count.max(1.0) };
        let mut threshold = f64::INFINITY;
        // A pass subdivides what is above its threshold and finds the largest leaf that is left, for the next
        // threshold.
        loop {
            let (largest, full) = self.subdivide_above(threshold);
            if full {
                let refused = self.tree.indices().filter(|i| self.may_subdivide(*i).is_some_and(|n| n > limit)).count();
                self.subdivisions_refused += refused as u64;
                break;
            }
            if largest <= limit {
                break;
            }
            threshold = (0.5 * largest).max(limit);
        }
        self.refresh();
    }

    /// Subdivides leaves of more than `threshold` samples. Samples of the largest leaf left that may be subdivided, and
    /// whether one was refused.
    fn subdivide_above(&mut self, threshold: f64) -> (f64, bool) {
        let (mut largest, mut full) = (0.0f64, false);
        for index in self.tree.indices() {
            let Some(count) = self.may_subdivide(index) else { continue };
            let rest = if count <= threshold {
                count
            } else if self.subdivide(index) {
                count / 8.0
            } else {
                full = true;
                count
            };
            largest = largest.max(rest);
        }
        (largest, full)
    }

    /// Number of samples of a leaf that is above the depth limit.
    fn may_subdivide(&self, index: u32) -> Option<f64> {
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
        let from = number as usize * BINS;
        for child in first..first + 7 {
            self.sums.copy_within(from..from + BINS, child as usize * BINS);
        }
        true
    }

    /// Computes what look-ups read. Every node is shrunk towards its parent, so that rare bright samples of the
    /// surroundings count in a cell that has not met one yet.
    pub(super) fn refresh(&mut self) {
        self.tree.refresh();
        if let Some(leaves) = self.flat {
            let prior = BinSums::ZERO;
            (0..leaves).for_each(|number| self.freeze_one(number, &prior, 0.0));
        } else {
            (0..ROOTS).for_each(|root| self.freeze_below(root, &BinSums::ZERO));
        }
    }

    fn freeze_below(&mut self, index: u32, prior: &BinSums) {
        match self.tree.node(index) {
            OctreeNode::Leaf { number, .. } => self.freeze_one(number, prior, PRIOR_SAMPLES),
            OctreeNode::Inner { child } => {
                let mut all = BinSums::ZERO;
                self.tree.visit(index, &mut |n| {
                    if let OctreeNode::Leaf { number, .. } = n {
                        self.leaf(number).iter().for_each(|b| all.add(b, 1.0));
                    }
                });
                all.shrink(prior, PRIOR_SAMPLES);
                (child..child + 8).for_each(|c| self.freeze_below(c, &all));
            }
        }
    }

    fn freeze_one(&mut self, number: u32, prior: &BinSums, samples: f64) {
        let bins = number as usize * BINS..(number as usize + 1) * BINS;
        let (sums, frozen) = (self.sums.get(bins.clone()), self.frozen.get_mut(bins.clone()));
        if let (Some(s), Some(f), Some(v)) = (sums, frozen, self.visibility.get_mut(bins)) {
            freeze_leaf(s, f, v, prior, samples);
        }
    }

    /// As [`Self::reset`], refused subdivisions included.
    pub(crate) fn forget(&mut self) {
        self.subdivisions_refused = 0;
        self.reset();
    }

    /// Forgets all statistics and the tree.
    pub fn reset(&mut self) {
        self.tree.reset();
        self.used_mut().fill(BinSums::ZERO);
        self.refresh();
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
        self.sums.get_mut(..self.leaves() as usize * BINS).unwrap_or(&mut [])
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
        self.subdivisions_refused
    }

    pub(super) fn refuse_subdivision(&mut self) {
        self.subdivisions_refused += 1;
    }
}
