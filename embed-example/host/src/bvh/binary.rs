//! The binary tree: boxes over single triangles or few of them.

use super::coincident::Groups;
use super::parts::copy;
use bytemuck::Zeroable;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;
use std::ops::Range;

/// Effort of building a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// Previews: fewest passes.
    Fast,
    /// Close to the best tree in a fraction of its time.
    #[default]
    Medium,
    /// The best tree: for scenes that are baked once and rendered often.
    Slow,
}

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

/// A node: two children that follow each other, or one triangle.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(C)]
pub(super) struct Binary {
    pub(super) bounds: Bounds,
    /// First child, or the triangle.
    pub(super) index: u32,
    /// Is it a triangle?
    pub(super) leaf: bool,
}

/// A binary tree over the finite triangles.
pub(super) struct BinaryTree {
    /// Root first, children after their parents; empty without triangles.
    pub(super) nodes: Vec<Binary>,
    /// Parts of `nodes`, one after another: the top of the tree, and subtrees without their roots. So children of a
    /// part's nodes are in the same part, but for the first; threads work at parts.
    pub(super) parts: Vec<Range<usize>>,
}

/// Nodes that look for a better place in trees where that is quick.
const REINSERTED: f32 = 50_000.0;

/// Builds the tree. It does not depend on the number of threads.
pub(super) fn build(triangles: &[[[f32; 3]; 3]], effort: Effort) -> BinaryTree {
    let groups = Groups::of(triangles);
    if groups.boxes.len() < 2 {
        return copy(None, &groups);
    }
    let boxes: Vec<Aabb> = groups.boxes.par_iter().map(|b| Aabb { min: b.min.into(), max: b.max.into() }).collect();
    // merging by the full search distance on all levels, not the lowest two alone, leaves rays fewer nodes to visit than
    // the reinsertion of more nodes does, and takes less time
    let thorough = |ratio| BvhBuildParams {
        ploc_search_distance: PlocSearchDistance::High,
        search_depth_threshold: 0,
        sort_precision: SortPrecision::U64,
        reinsertion_batch_ratio: ratio,
        ..BvhBuildParams::medium_build()
    };
    let p = match effort {
        Effort::Fast => BvhBuildParams::very_fast_build(),
        Effort::Medium => thorough((REINSERTED / boxes.len() as f32).clamp(0.02, 1.0)),
        Effort::Slow => thorough(1.0),
    };
    // triangles are not split: a box always holds all of its triangles' vertices
    let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
        p.ploc_search_distance,
        &boxes,
        (0..boxes.len() as u32).collect(),
        p.sort_precision,
        p.search_depth_threshold,
    );
    let ratio = p.reinsertion_batch_ratio.min(affordable(&bvh));
    if ratio * boxes.len() as f32 >= 1.0 {
        ReinsertionOptimizer::default().run(&mut bvh, ratio, None);
    }
    copy(Some(&bvh), &groups)
}

/// Share of the nodes that may look for a better place. Each looks at about as many nodes as a random ray would visit,
/// which is some hundred in real scenes, but all of them where boxes coincide: unlimited, the search is quadratic
/// there.
fn affordable(bvh: &Bvh2) -> f32 {
    const STEPS: f64 = 3e8;
    let area = |n: &Bvh2Node| f64::from(n.aabb().half_area());
    let root = area(&bvh.nodes[0]);
    let visited = bvh.nodes.iter().map(|n| (area(n) / root).min(1.0)).sum::<f64>();
    (STEPS / (bvh.nodes.len() as f64 * visited.max(1.0))) as f32
}
