//! Nodes of the trees over the sphere: 4x4 cells, each of which may be a node itself. A node is there twice: as
//! directions are sampled ([`GuideNode`], 64 bytes, a cache line) and as it learns ([`NodeSums`]).
//!
//! Probabilities of cells are multiples of 2^-16 and a cell is chosen by 16 random bits, so that the density is
//! exactly the one that is sampled, whatever the numbers are.
#![deny(clippy::unwrap_used, clippy::expect_used)]

use bytemuck::{Pod, Zeroable};

/// Cells of a node.
pub(super) const CELLS: usize = 16;
/// Levels of nodes: 64 x 64 cells on the last.
pub(super) const LEVELS: usize = 3;
/// Number of the node that there always is: all directions alike.
pub(super) const UNIFORM: u16 = 0;
/// Probability 1.
const ONE: f32 = 65_536.0;

/// A node as it is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct GuideNode {
    /// Where the cells begin in [0, 2^16), in order.
    start: [u16; CELLS],
    /// Nodes in the cells, [`UNIFORM`] where there is none.
    pub(super) child: [u16; CELLS],
}

impl GuideNode {
    /// All cells alike.
    pub(super) const UNIFORM: Self = {
        let (mut start, mut i) = ([0; CELLS], 0);
        while i < CELLS {
            start[i] = (i as u16) << 12;
            i += 1;
        }
        Self { start, child: [UNIFORM; CELLS] }
    };

    /// Makes the cells' probabilities those of `masses`, finite and not negative; all alike if there is none.
    pub(super) fn set(&mut self, masses: &[f32; CELLS]) {
        let total: f64 = masses.iter().map(|m| f64::from(*m)).sum();
        if total > 0.0 && total.is_finite() {
            let mut before = 0.0;
            for (start, mass) in self.start.iter_mut().zip(masses) {
                *start = (before / total * f64::from(ONE)).min(65_535.0) as u16;
                before += f64::from(*mass);
            }
        } else {
            self.start = Self::UNIFORM.start;
        }
    }

    /// The cell that 16 random bits choose.
    #[inline(always)]
    fn choose(&self, bits: u16) -> usize {
        let begun: u16 = self.start.iter().map(|s| u16::from(*s <= bits)).sum();
        usize::from(begun.saturating_sub(1)) & (CELLS - 1)
    }

    /// Density of a cell over that of all cells alike.
    #[inline(always)]
    fn density(&self, cell: usize) -> f32 {
        let end = self.start.get(cell + 1).map_or(1 << 16, |s| u32::from(*s));
        let mass = end.saturating_sub(u32::from(self.start[cell & (CELLS - 1)]));
        mass as f32 * (CELLS as f32 / ONE)
    }
}

/// A cell of any level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Column and row.
    pub(super) at: [u32; 2],
    /// Cells of its level in a row: 4, 16 or 64.
    pub(super) per_row: u32,
    /// Density over the uniform one.
    pub(super) density: f32,
}

/// Column and row of a cell within its node.
const fn place(cell: usize) -> [u32; 2] {
    [cell as u32 & 3, cell as u32 >> 2]
}

/// Steps from level to level from the node `root` on; `choose` says which cell of a node is next.
#[inline(always)]
fn descend(nodes: &[GuideNode], root: u16, mut choose: impl FnMut(usize, &GuideNode) -> usize) -> Cell {
    let mut found = Cell { at: [0; 2], per_row: 1, density: 1.0 };
    let mut index = root;
    for level in 0..LEVELS {
        let node = nodes.get(index as usize).unwrap_or(&GuideNode::UNIFORM);
        let cell = choose(level, node) & (CELLS - 1);
        let [x, y] = place(cell);
        found.at = [found.at[0] << 2 | x, found.at[1] << 2 | y];
        found.per_row <<= 2;
        found.density *= node.density(cell);
        index = node.child[cell];
        if index == UNIFORM {
            break;
        }
    }
    found
}

/// The cell that random bits choose, 16 for each level.
#[inline(always)]
pub(super) fn sample(nodes: &[GuideNode], root: u16, bits: [u16; LEVELS]) -> Cell {
    descend(nodes, root, |level, node| node.choose(bits[level]))
}

/// Number of the cell of a level's node that a point is in, by its [`quantised`](super::sphere::quantised) coordinates.
#[inline(always)]
pub(super) fn cell_at(point: u32, level: usize) -> usize {
    let shift = 14 - 2 * level as u32;
    (point >> shift & 3 | (point >> (16 + shift) & 3) << 2) as usize
}

/// The cell that a point of the square is in.
#[inline(always)]
pub(super) fn find(nodes: &[GuideNode], root: u16, point: u32) -> Cell {
    descend(nodes, root, |level, _| cell_at(point, level))
}

/// What a node has learned.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct NodeSums {
    /// Sums of contributions: f cos L integrated over the cell, times the number of samples; mass of the cell. Of cells
    /// with a node, as it was when the node was made.
    pub(super) mass: [f32; CELLS],
    /// Contributions behind them, older ones discounted.
    pub(super) hits: [u16; CELLS],
    /// Not 0: made in this iteration, learns from its log only.
    pub(super) fresh: u32,
}

impl NodeSums {
    /// Nothing learned.
    pub(super) const EMPTY: Self = Self { mass: [0.0; CELLS], hits: [0; CELLS], fresh: 0 };

    /// Adds a contribution to a cell.
    pub(super) fn add(&mut self, cell: usize, mass: f32) {
        let (sum, hits) = (&mut self.mass[cell & (CELLS - 1)], &mut self.hits[cell & (CELLS - 1)]);
        // sums of numbers that were loaded may overflow
        *sum = (*sum + mass).min(f32::MAX);
        *hits = hits.saturating_add(1);
    }

    /// Adds to a cell what others have learned of it.
    pub(super) fn merge(&mut self, cell: usize, mass: f32, hits: f32) {
        let (sum, all) = (&mut self.mass[cell & (CELLS - 1)], &mut self.hits[cell & (CELLS - 1)]);
        *sum = (*sum + mass).min(f32::MAX);
        *all = (f32::from(*all) + hits) as u16;
    }

    /// Multiplies what was learned by `keep`, 0 to 1.
    pub(super) fn scale(&mut self, keep: f32) {
        for (m, h) in self.mass.iter_mut().zip(&mut self.hits) {
            *m *= keep;
            *h = (f32::from(*h) * keep) as u16;
        }
    }
}
