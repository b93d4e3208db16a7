//! The binary tree: boxes over single triangles.

use bytemuck::Zeroable;
use std::ops::Range;

/// Axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
#[repr(C)]
pub(super) struct Bounds {
    pub(super) min: [f32; 3],
    pub(super) max: [f32; 3],
}

impl Bounds {
    /// Empty box.
    pub(super) const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The box of a triangle; exact.
    pub(super) fn of(triangle: &[[f32; 3]; 3]) -> Self {
        let mut b = Self::EMPTY;
        for p in triangle {
            b = b.with(&Self { min: *p, max: *p });
        }
        b
    }

    /// The box of both; exact.
    pub(super) fn with(&self, o: &Self) -> Self {
        let mut b = *self;
        for k in 0..3 {
            b.min[k] = b.min[k].min(o.min[k]);
            b.max[k] = b.max[k].max(o.max[k]);
        }
        b
    }

    /// Half the surface area, finite for finite boxes.
    pub(super) fn half_area(&self) -> f64 {
        let e = [0, 1, 2].map(|k| (f64::from(self.max[k]) - f64::from(self.min[k])).max(0.0));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    }
}

/// A node: two children that follow each other, or triangles.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C)]
pub(super) struct Binary {
    pub(super) bounds: Bounds,
    /// First child, or the place of the first triangle in [`BinaryTree::triangles`].
    pub(super) index: u32,
    /// Number of triangles: one, or two that stay together; 0 of nodes with children.
    pub(super) triangles: u32,
}

impl Binary {
    /// Is it a leaf?
    pub(super) fn is_leaf(&self) -> bool {
        self.triangles > 0
    }
}

/// A binary tree over the finite triangles.
pub(super) struct BinaryTree {
    /// Root first, children after their parents; empty without triangles.
    pub(super) nodes: Vec<Binary>,
    /// Parts of `nodes`, one after another: the top of the tree, and subtrees without their roots. So children of a
    /// part's nodes are in the same part, but for the first; threads work at parts.
    pub(super) parts: Vec<Range<usize>>,
    /// The triangles in the order in which leaves refer to them.
    pub(super) triangles: Vec<u32>,
}
