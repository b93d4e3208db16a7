//! Builder of the binary tree: what obvhs is asked for.

use super::groups::Groups;
use super::node::BinaryTree;
use super::parts::copy;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

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

/// Nodes that look for a better place in trees where that is quick, and in those of [`MANY`] triangles.
const REINSERTED: [f32; 2] = [50_000.0, 12_000.0];

/// Triangles from which on time is worth more than the last per cent of the tree: pairs are merged before, and fewer nodes
/// look for a better place.
const MANY: usize = 1 << 16;

/// Builds the tree. It does not depend on the number of threads.
pub(super) fn build(triangles: &[[[f32; 3]; 3]], effort: Effort) -> BinaryTree {
    let many = effort == Effort::Medium && triangles.len() >= MANY;
    let groups = Groups::of(triangles, many);
    if groups.boxes.len() < 2 {
        return copy(None, groups);
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
        Effort::Medium => thorough((REINSERTED[usize::from(many)] / boxes.len() as f32).clamp(0.02, 1.0)),
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
    copy(Some(&bvh), groups)
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
