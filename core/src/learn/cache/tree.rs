//! Octrees over the scene: the leaf that a position lies in.
//!
//! A node is one word. A leaf's word has the high bit, its depth and its number; an inner node's word is the index of
//! the first of its eight children, which are adjacent. Positions are quantised to a grid of 2^16 cells per axis in a
//! cube around the bounds; bit `15 - d` of the three coordinates selects the child at depth `d`. So a descent compares
//! no floats, and eight lanes descend in lockstep with their loads overlapping.
//!
//! The first levels of a large tree are also stored as one table, a coarse grid, where a descent starts: a jittered
//! look-up needs two descents.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::bins::{BINS, NO_BIN};
use super::kind::VertexKind8;
use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Depth of the deepest leaf.
pub(in crate::learn) const MAX_DEPTH: u32 = 16;
/// Largest number of leaves: their numbers have 26 bits.
pub(in crate::learn) const MAX_LEAVES: u32 = 1 << 26;
/// The roots are the first nodes. Children lie at multiples of 8, so the roots have eight words as well, however many
/// there are.
const FIRST_CHILD: u32 = 8;

// no bin of any leaf has the number of none
const _: () = assert!(MAX_LEAVES as u64 * BINS as u64 <= NO_BIN as u64);

const LEAF: u32 = 1 << 31;
const NUMBER: u32 = MAX_LEAVES - 1;
const CELLS: f32 = 65_536.0;
/// Largest float below [`CELLS`].
const LAST: f32 = 65_535.996;

/// Decoded word of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::learn) enum OctreeNode {
    Inner { child: u32 },
    Leaf { number: u32, depth: u32 },
}

/// All of the octrees but their nodes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(in crate::learn) struct TreeScalars {
    used: u32,
    leaves: u32,
    /// Smallest corner and edge of the cube.
    cube: [f32; 4],
}

impl TreeScalars {
    /// `roots` octrees that are leaves, over the bounds `lo` to `hi`.
    pub(in crate::learn) fn roots(roots: u32, lo: [f32; 3], hi: [f32; 3]) -> Self {
        Self { used: FIRST_CHILD, leaves: roots, cube: cube(lo, hi) }
    }

    /// Are these scalars of `roots` octrees with room for `nodes` nodes and `max_leaves` leaves?
    fn fit(&self, roots: u32, nodes: u32, max_leaves: u32) -> bool {
        let [x, y, z, edge] = self.cube;
        let groups = self.used.checked_sub(FIRST_CHILD).filter(|n| n % 8 == 0).map(|n| n / 8);
        groups.and_then(|g| g.checked_mul(7)?.checked_add(roots)) == Some(self.leaves)
            && self.used <= nodes
            && self.leaves <= max_leaves
            && [x, y, z].iter().all(|x| x.is_finite())
            && edge.is_finite()
            && edge > 1e-30
    }
}

/// `ROOTS` octrees over the same cube, at most eight.
#[derive(Debug)]
pub(in crate::learn) struct Tree<'m, const ROOTS: u32> {
    nodes: &'m mut [u32],
    /// Words of the nodes at depth `grid_bits`, or of leaves above it, by cell; one grid per root.
    grid: &'m mut [u32],
    grid_bits: u32,
    used: u32,
    leaves: u32,
    max_leaves: u32,
    /// Smallest corner and edge of the cube.
    pub(in crate::learn) cube: [f32; 4],
    scale: f32,
}

/// Nodes of octrees with so many subdivisions.
pub(in crate::learn) const fn nodes_for(subdivisions: u32) -> u32 {
    FIRST_CHILD + 8 * subdivisions
}

/// Nodes of a group of children.
pub(in crate::learn) fn group_nodes(group: u32) -> core::ops::Range<u32> {
    let first = FIRST_CHILD + 8 * group;
    first..first + 8
}

/// Group that begins with node `child`.
pub(in crate::learn) fn group_of(child: u32) -> usize {
    (child.saturating_sub(FIRST_CHILD) / 8) as usize
}

impl<'m, const ROOTS: u32> Tree<'m, ROOTS> {
    /// Bytes; [`Self::carve`] leaves nodes and grid as they are until [`Self::reset`].
    pub(in crate::learn) fn measure(m: Measure, nodes: u32, max_leaves: u32) -> Measure {
        m.add::<u32>(nodes as usize).add::<u32>(grid_len(ROOTS, max_leaves))
    }

    pub(in crate::learn) fn carve(
        c: &mut Carver<'m>,
        nodes: u32,
        max_leaves: u32,
        scalars: &TreeScalars,
    ) -> Result<Self, MemoryError> {
        const { assert!(ROOTS <= FIRST_CHILD) };
        let TreeScalars { used, leaves, cube } = *scalars;
        let [.., edge] = cube;
        Ok(Self {
            nodes: c.take_unset(nodes as usize)?,
            grid: c.take_unset(grid_len(ROOTS, max_leaves))?,
            grid_bits: grid_bits(max_leaves),
            used,
            leaves,
            max_leaves,
            cube,
            scale: CELLS / edge,
        })
    }

    pub(in crate::learn) fn scalars(&self) -> TreeScalars {
        TreeScalars { used: self.used, leaves: self.leaves, cube: self.cube }
    }

    /// Are these the scalars of a tree with this room? Whatever nodes there are then, none leads out of memory.
    pub(in crate::learn) fn fits(scalars: &TreeScalars, subdivisions: u32, max_leaves: u32) -> bool {
        scalars.fit(ROOTS, nodes_for(subdivisions), max_leaves)
    }

    /// Makes all roots leaves.
    pub(in crate::learn) fn reset(&mut self) {
        self.nodes.iter_mut().zip(0..ROOTS).for_each(|(n, root)| *n = LEAF | root);
        (self.used, self.leaves) = (FIRST_CHILD, ROOTS);
        let _ = self.refresh(0, usize::MAX);
    }

    /// Fills the grid from cell `from` on, `limit` cells at most; the next cell, `None` after the last. Until then
    /// look-ups give the old numbers of leaves, which are still theirs or a child's.
    pub(in crate::learn) fn refresh(&mut self, from: usize, limit: usize) -> Option<usize> {
        let bits = self.grid_bits;
        let end = from.saturating_add(limit).min(self.grid.len());
        for (i, word) in (from as u32..).zip(self.grid.get_mut(from..end).unwrap_or(&mut [])) {
            let at = |n: u32| self.nodes.get(n as usize).copied().unwrap_or(LEAF);
            let cell = [i, i >> bits, i >> (2 * bits)];
            *word = at(i >> (3 * bits));
            for bit in (0..bits).rev() {
                if *word & LEAF == 0 {
                    *word = at((*word).wrapping_add(cell.iter().rev().fold(0, |o, c| o << 1 | (c >> bit & 1))));
                }
            }
        }
        (end < self.grid.len()).then_some(end)
    }

    pub(in crate::learn) fn leaves(&self) -> u32 {
        self.leaves
    }

    /// Number of nodes that can be reached from the roots.
    pub(in crate::learn) fn nodes(&self) -> u32 {
        self.used - FIRST_CHILD + ROOTS
    }

    /// Index of the first node behind the roots' and all groups of children.
    pub(in crate::learn) fn end(&self) -> u32 {
        self.used
    }

    /// Number of groups of eight children.
    pub(in crate::learn) fn groups(&self) -> u32 {
        (self.used - FIRST_CHILD) / 8
    }

    /// A node as memory has it. Memory that something else has written to has no inner nodes but those that lead to a
    /// later group, and no leaves but those with sums.
    pub(in crate::learn) fn node(&self, index: u32) -> OctreeNode {
        let word = self.nodes.get(index as usize).copied().unwrap_or(LEAF);
        if word & LEAF != 0 {
            let number = word & NUMBER;
            let number = if number < self.leaves { number } else { 0 };
            return OctreeNode::Leaf { number, depth: (word & !LEAF) >> 26 };
        }
        if word > index && word % 8 == 0 && word >= FIRST_CHILD && word < self.used {
            OctreeNode::Inner { child: word }
        } else {
            OctreeNode::Leaf { number: 0, depth: MAX_DEPTH }
        }
    }

    /// Makes a leaf an inner node. The first child keeps the leaf's number; returns the first of the seven new numbers,
    /// `None` if there is no room or the leaf is at [`MAX_DEPTH`].
    pub(in crate::learn) fn subdivide(&mut self, index: u32) -> Option<u32> {
        let OctreeNode::Leaf { number, depth } = self.node(index) else { return None };
        if depth >= MAX_DEPTH || self.max_leaves - self.leaves < 7 {
            return None;
        }
        let (child, first) = (self.used, self.leaves);
        let group = self.nodes.get_mut(child as usize..)?.get_mut(..8)?;
        let numbers = core::iter::once(number).chain(first..);
        group.iter_mut().zip(numbers).for_each(|(n, number)| *n = LEAF | (depth + 1) << 26 | number);
        *self.nodes.get_mut(index as usize)? = child;
        self.used += 8;
        self.leaves += 7;
        Some(first)
    }

    /// Calls `f` with every node below and including `index`: parents first, children in order. Ends after as many
    /// nodes as there are, and above [`MAX_DEPTH`], whatever memory holds.
    pub(in crate::learn) fn visit(&self, index: u32, f: &mut impl FnMut(OctreeNode)) {
        self.visit_some(index, 0, &mut self.nodes(), f);
    }

    fn visit_some(&self, index: u32, depth: u32, left: &mut u32, f: &mut impl FnMut(OctreeNode)) {
        if *left == 0 {
            return;
        }
        *left -= 1;
        let node = self.node(index);
        f(node);
        if let OctreeNode::Inner { child } = node
            && depth < MAX_DEPTH
        {
            (child..child + 8).for_each(|c| self.visit_some(c, depth + 1, left, f));
        }
    }

    /// Positions on the grid, in [0, 2^16). Those outside the cube move to its faces, NaN to the first cell.
    #[inline(always)]
    fn grid_position(&self, p: Vec3x8) -> [F32x8; 3] {
        let [x, y, z, _] = self.cube;
        [p.x - x, p.y - y, p.z - z].map(|d| (d * self.scale).clamp(0.0, LAST))
    }

    /// Words of the leaves around eight grid positions.
    #[inline(always)]
    fn descend(&self, root: U32x8, position: [F32x8; 3]) -> U32x8 {
        let [x, y, z] = position.map(|c| c.to_i32().to_u32());
        let load = |table: &[u32], index: U32x8| {
            U32x8::new(index.to_array().map(|i| table.get(i as usize).copied().unwrap_or(LEAF)))
        };
        let bits = self.grid_bits;
        let above = MAX_DEPTH - bits;
        let mut word =
            load(self.grid, x >> above | (y >> above) << bits | (z >> above) << (2 * bits) | root << (3 * bits));
        for bit in (0..above).rev() {
            let leaf = F32x8::from_bits(word).is_sign_negative();
            if leaf.all() {
                break;
            }
            let one = U32x8::splat(1);
            let octant = (x >> bit & one) | (y >> bit & one) << 1 | (z >> bit & one) << 2;
            // lanes at a leaf load the first node, so that no bounds check is mispredicted
            let next = load(self.nodes, U32x8::select(leaf, U32x8::splat(0), word + octant));
            word = U32x8::select(leaf, word, next);
        }
        word
    }

    /// First bin of the leaf around each position; see [`Self::leaf`].
    #[inline(always)]
    pub(in crate::learn) fn find(&self, kind: VertexKind8, p: Vec3x8, jitter: Option<[F32x8; 3]>) -> U32x8 {
        self.leaf(kind.octree(), p, jitter) * U32x8::splat(BINS as u32)
    }

    /// Number of the leaf around each position in octree `root`, below `ROOTS`. With `jitter` in [0, 1): of the leaf
    /// around the position moved by `jitter - 0.5` of the edge of its own leaf, but not out of the cube.
    #[inline(always)]
    pub(in crate::learn) fn leaf(&self, root: U32x8, p: Vec3x8, jitter: Option<[F32x8; 3]>) -> U32x8 {
        let position = self.grid_position(p);
        let mut word = self.descend(root, position);
        if let Some([a, b, c]) = jitter {
            // 2^(16 - depth), built from its exponent.
            let edge = F32x8::from_bits((U32x8::splat(127 + MAX_DEPTH) - (word >> 26 & U32x8::splat(31))) << 23);
            let [x, y, z] = position;
            let moved = [(x, a), (y, b), (z, c)].map(|(q, u)| (q + (u - 0.5) * edge).clamp(0.0, LAST));
            word = self.descend(root, moved);
        }
        word & U32x8::splat(NUMBER)
    }
}

/// Levels that the grid replaces: none in small trees, where it would take more memory than they do.
fn grid_bits(max_leaves: u32) -> u32 {
    match max_leaves {
        0..512 => 0,
        512..8192 => 3,
        _ => 4,
    }
}

fn grid_len(roots: u32, max_leaves: u32) -> usize {
    (roots as usize) << (3 * grid_bits(max_leaves))
}

/// Smallest corner and edge of a cube around the bounds, world units; the unit cube where bounds are not finite.
fn cube(lo: [f32; 3], hi: [f32; 3]) -> [f32; 4] {
    let [x, y, z] = lo.map(|x| if x.is_finite() { x } else { 0.0 });
    let extent = lo.iter().zip(&hi).map(|(l, h)| h - l).fold(0.0, f32::max);
    // the largest coordinate stays inside; a point or a plane has an edge as well, whose reciprocal is finite
    let edge = extent * (1.0 + 1.0 / 65_536.0);
    [x, y, z, if edge.is_finite() && edge > 1e-30 { edge } else { 1.0 }]
}

/// Direction bin of a unit vector, 0 to 15.
///
/// Bins have equal solid angles: four slabs of the height, each divided into quadrants by the signs of the two other
/// coordinates. The sphere is rotated first, by a matrix of thirds: axis-parallel directions, which normals often have,
/// lie at least 10 degrees inside their bins, and no two of them share one.
#[inline(always)]
pub(in crate::learn) fn direction_bin(d: Vec3x8) -> U32x8 {
    let (x, y, z) = (d.x + d.x, d.y + d.y, d.z + d.z);
    let (a, b, height) = (x + y - d.z, y + z - d.x, x + z - d.y);
    let bit = |m: Mask8, v: u32| U32x8::select(m, U32x8::splat(v), U32x8::splat(0));
    let above = |h: f32| bit(height.ge(F32x8::splat(h)), 1);
    above(-1.5) + above(0.0) + above(1.5) + bit(a.lt(F32x8::ZERO), 4) + bit(b.lt(F32x8::ZERO), 8)
}
