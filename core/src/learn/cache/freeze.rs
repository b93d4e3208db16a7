//! From sums to what look-ups read: leaves are subdivided, then every node is shrunk towards its parent, so that rare
//! bright samples of the surroundings count in a cell that has not met one yet.
//!
//! All passes run over arrays in order, as children come behind their parents there, so that they can stop anywhere:
//!
//! | pass | over | does |
//! |---|---|---|
//! | subdivide | nodes, again and again | subdivides leaves above a threshold, which falls to the limit |
//! | count | nodes | counts leaves that found no room |
//! | grid | cells | tables of the first levels |
//! | up | groups of children, last first | sums over everything below |
//! | down | groups of children, first first | shrinks, and computes the leaves |
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::bins::{BINS, BinSums, freeze_leaf};
use super::kind::ROOTS;
use super::shared::{Cache, Freeze};
use super::tree::{OctreeNode, group_nodes, group_of};

/// Samples that the surroundings of a cell count for in it.
const PRIOR_SAMPLES: f64 = 4.0;

/// Passes over the nodes after which subdivision ends: as many as halve every count of samples there is.
const MOST_PASSES: u32 = 2200;

/// Cells of the grid that are filled at once.
const CELLS_AT_ONCE: usize = 64;

const SUBDIVIDE: u32 = 1;
const COUNT: u32 = 2;
const GRID: u32 = 3;
const UP: u32 = 4;
const DOWN: u32 = 5;
const FLAT: u32 = 6;

impl Cache<'_> {
    /// Begins to compute what look-ups read.
    pub(crate) fn begin_freeze(&mut self) {
        let pass = if self.flat.is_some() { FLAT } else { SUBDIVIDE };
        self.scalars.freeze = Freeze::at(pass, self.tree.end());
    }

    /// Computes what look-ups read, without subdivision.
    pub(super) fn refresh(&mut self) {
        self.scalars.freeze = Freeze::at(if self.flat.is_some() { FLAT } else { GRID }, 0);
        while !self.freeze_some(f64::INFINITY).1 {}
    }

    /// Goes on with it: the work of one node, group of children or piece of the grid, in units of about a ray, and `true`
    /// when there is no more.
    pub(crate) fn freeze_some(&mut self, subdivide_count: f64) -> (u64, bool) {
        let limit = if subdivide_count.is_nan() { f64::INFINITY } else { subdivide_count.max(1.0) };
        let mut f = self.scalars.freeze;
        let work = match f.pass {
            SUBDIVIDE => self.subdivide_next(&mut f, limit),
            COUNT => match f.next_node() {
                Some(index) => {
                    let refused = self.may_subdivide(index).is_some_and(|n| n > limit);
                    self.scalars.subdivisions_refused += u64::from(refused);
                    1
                }
                None => {
                    f = Freeze::at(GRID, 0);
                    0
                }
            },
            GRID => {
                match self.tree.refresh(f.index as usize, CELLS_AT_ONCE) {
                    Some(next) => f.index = next as u32,
                    None => f = Freeze::at(UP, 0),
                }
                10
            }
            UP => {
                if f.index < self.tree.groups() {
                    self.sum_group(self.tree.groups() - 1 - f.index);
                    f.index += 1;
                } else {
                    f = Freeze::at(DOWN, 0);
                }
                4
            }
            // the roots come first, then the groups
            DOWN => {
                match f.index.checked_sub(1) {
                    None => (0..ROOTS).for_each(|root| self.freeze_node(root, &BinSums::ZERO)),
                    Some(group) => {
                        let prior = self.groups.get(group as usize).copied().unwrap_or(BinSums::ZERO);
                        group_nodes(group).for_each(|node| self.freeze_node(node, &prior));
                    }
                }
                f.index += 1;
                if f.index > self.tree.groups() {
                    f = Freeze::default();
                }
                64
            }
            FLAT => {
                if f.index < self.leaves() {
                    self.freeze_one(f.index, &BinSums::ZERO, 0.0);
                    f.index += 1;
                } else {
                    f = Freeze::default();
                }
                8
            }
            _ => 0,
        };
        let done = f.pass == 0;
        if done {
            self.scalars.readable = self.bins();
        }
        self.scalars.freeze = f;
        (work, done)
    }

    /// Subdivides the next node if it is above the threshold. A pass finds the largest leaf that is left, for the next
    /// threshold.
    fn subdivide_next(&mut self, f: &mut Freeze, limit: f64) -> u64 {
        if let Some(index) = f.next_node() {
            let Some(count) = self.may_subdivide(index) else { return 1 };
            let rest = if count <= f.threshold {
                count
            } else if self.subdivide(index) {
                count / 8.0
            } else {
                f.full = 1;
                count
            };
            f.largest = f.largest.max(rest);
            return if count <= f.threshold { 1 } else { 8 };
        }
        let passes = f.passes + 1;
        *f = if f.full != 0 {
            Freeze::at(COUNT, self.tree.end())
        } else if f.largest <= limit || passes > MOST_PASSES {
            Freeze::at(GRID, 0)
        } else {
            let threshold = (0.5 * f.largest).max(limit);
            Freeze { threshold, passes, ..Freeze::at(SUBDIVIDE, self.tree.end()) }
        };
        1
    }

    /// Sums over everything below the nodes of a group, those of later groups being there.
    fn sum_group(&mut self, group: u32) {
        let mut all = BinSums::ZERO;
        for node in group_nodes(group) {
            match self.tree.node(node) {
                OctreeNode::Leaf { number, .. } => self.leaf(number).iter().for_each(|b| all.add(b, 1.0)),
                OctreeNode::Inner { child } => {
                    if let Some(below) = self.groups.get(group_of(child)) {
                        all.add(below, 1.0);
                    }
                }
            }
        }
        if let Some(sums) = self.groups.get_mut(group as usize) {
            *sums = all;
        }
    }

    /// Computes a leaf, or shrinks the sums of the children of an inner node; its parent has the sums `prior`.
    fn freeze_node(&mut self, index: u32, prior: &BinSums) {
        match self.tree.node(index) {
            OctreeNode::Leaf { number, .. } => self.freeze_one(number, prior, PRIOR_SAMPLES),
            OctreeNode::Inner { child } => {
                if let Some(sums) = self.groups.get_mut(group_of(child)) {
                    sums.shrink(prior, PRIOR_SAMPLES);
                }
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
}
