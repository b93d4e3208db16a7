//! The binary tree: boxes over single triangles or few of them.

use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

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
#[derive(Clone, Copy, Debug, PartialEq)]
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
#[derive(Clone, Copy, Debug)]
pub(super) struct Binary {
    pub(super) bounds: Bounds,
    /// First child, or the triangle.
    pub(super) index: u32,
    /// Is it a triangle?
    pub(super) leaf: bool,
}

/// Binary tree over the finite triangles, root first, children after their parents; empty without triangles.
pub(super) fn build(triangles: &[[[f32; 3]; 3]], effort: Effort) -> Vec<Binary> {
    let groups = coincident(triangles);
    let Some((first, _)) = groups.first() else { return Vec::new() };
    if groups.len() == 1 {
        let mut out = vec![Binary { bounds: *first, index: 0, leaf: true }];
        expand(&mut out, 0, &groups[0].1);
        return out;
    }
    let boxes: Vec<Aabb> = groups.iter().map(|(b, _)| Aabb { min: b.min.into(), max: b.max.into() }).collect();
    let p = match effort {
        Effort::Fast => BvhBuildParams::very_fast_build(),
        // better than obvhs's own medium preset by 5 % of the rays per second, for twice its time
        Effort::Medium => BvhBuildParams {
            ploc_search_distance: PlocSearchDistance::High,
            search_depth_threshold: 2,
            sort_precision: SortPrecision::U128,
            reinsertion_batch_ratio: 0.3,
            ..BvhBuildParams::medium_build()
        },
        Effort::Slow => BvhBuildParams::very_slow_build(),
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
    copy(&bvh, &groups)
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

/// The finite triangles grouped by equal boxes. PLOC merges nearest neighbours: among equal boxes hardly any two choose
/// each other, and it would need as many passes as there are boxes.
fn coincident(triangles: &[[[f32; 3]; 3]]) -> Vec<(Bounds, Vec<u32>)> {
    let mut sorted: Vec<([u32; 6], u32)> = Vec::with_capacity(triangles.len());
    for (id, t) in triangles.iter().enumerate() {
        if t.as_flattened().iter().all(|x| x.is_finite()) {
            let b = Bounds::of(t);
            let bits = std::array::from_fn(|k| if k < 3 { b.min[k] } else { b.max[k - 3] }.to_bits());
            sorted.push((bits, id as u32));
        }
    }
    sorted.sort_unstable();
    let group = |g: &[([u32; 6], u32)]| (Bounds::of(&triangles[g[0].1 as usize]), g.iter().map(|x| x.1).collect());
    let mut groups: Vec<(Bounds, Vec<u32>)> = sorted.chunk_by(|x, y| x.0 == y.0).map(group).collect();
    groups.sort_unstable_by_key(|g| g.1[0]);
    groups
}

/// Own copy in an order with children after parents.
fn copy(bvh: &Bvh2, groups: &[(Bounds, Vec<u32>)]) -> Vec<Binary> {
    let mut out = vec![Binary { bounds: Bounds::EMPTY, index: 0, leaf: false }];
    let mut todo = vec![(0usize, 0usize)];
    while let Some((from, to)) = todo.pop() {
        let n = &bvh.nodes[from];
        if n.is_leaf() {
            let (bounds, ids) = &groups[bvh.primitive_indices[n.first_index as usize] as usize];
            out[to].bounds = *bounds;
            expand(&mut out, to, ids);
            continue;
        }
        let first = out.len();
        out[to].index = first as u32;
        out.extend([Binary { bounds: Bounds::EMPTY, index: 0, leaf: false }; 2]);
        todo.push((n.first_index as usize, first));
        todo.push((n.first_index as usize + 1, first + 1));
    }
    for i in (0..out.len()).rev() {
        if !out[i].leaf {
            let c = out[i].index as usize;
            out[i].bounds = out[c].bounds.with(&out[c + 1].bounds);
        }
    }
    out
}

/// Makes node `at` a balanced tree over `ids`, all with its box.
fn expand(out: &mut Vec<Binary>, at: usize, ids: &[u32]) {
    let mut todo = vec![(at, ids)];
    while let Some((at, ids)) = todo.pop() {
        if let [id] = ids {
            (out[at].index, out[at].leaf) = (*id, true);
            continue;
        }
        let first = out.len();
        (out[at].index, out[at].leaf) = (first as u32, false);
        out.extend([Binary { bounds: out[at].bounds, index: 0, leaf: true }; 2]);
        let (left, right) = ids.split_at(ids.len() / 2);
        todo.push((first, left));
        todo.push((first + 1, right));
    }
}
