//! The binary tree: boxes over single triangles or few of them.

use super::Effort;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

/// A box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The box of a triangle; exact.
    pub fn of(triangle: &[[f32; 3]; 3]) -> Self {
        let mut b = Self::EMPTY;
        for p in triangle {
            b = b.with(&Self { min: *p, max: *p });
        }
        b
    }

    /// The box of both; exact.
    pub fn with(&self, o: &Self) -> Self {
        let mut b = *self;
        for k in 0..3 {
            b.min[k] = b.min[k].min(o.min[k]);
            b.max[k] = b.max[k].max(o.max[k]);
        }
        b
    }

    /// Half the surface area, finite for finite boxes.
    pub fn half_area(&self) -> f64 {
        let e = [0, 1, 2].map(|k| (f64::from(self.max[k]) - f64::from(self.min[k])).max(0.0));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    }
}

/// A node: two children that follow each other, or one triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binary {
    pub bounds: Bounds,
    /// First child, or the triangle.
    pub index: u32,
    /// Is it a triangle?
    pub leaf: bool,
}

/// Binary tree over the finite triangles, root first, children after their parents; empty without triangles.
pub(super) fn build(triangles: &[[[f32; 3]; 3]], effort: Effort) -> Vec<Binary> {
    let finite = |t: &&u32| triangles[**t as usize].as_flattened().iter().all(|x| x.is_finite());
    let all: Vec<u32> = (0..triangles.len() as u32).collect();
    let ids: Vec<u32> = all.iter().filter(finite).copied().collect();
    if ids.is_empty() {
        return Vec::new();
    }
    if let [id] = ids[..] {
        return vec![Binary { bounds: Bounds::of(&triangles[id as usize]), index: id, leaf: true }];
    }
    let boxes: Vec<Aabb> = ids
        .iter()
        .map(|&id| {
            let b = Bounds::of(&triangles[id as usize]);
            Aabb { min: b.min.into(), max: b.max.into() }
        })
        .collect();
    let p = match effort {
        Effort::Fast => BvhBuildParams::very_fast_build(),
        Effort::Medium => BvhBuildParams::medium_build(),
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
    ReinsertionOptimizer::default().run(&mut bvh, p.reinsertion_batch_ratio, None);
    copy(&bvh, &ids, triangles)
}

/// Own copy in an order with children after parents, boxes computed anew from the triangles.
fn copy(bvh: &Bvh2, ids: &[u32], triangles: &[[[f32; 3]; 3]]) -> Vec<Binary> {
    let mut out = vec![Binary { bounds: Bounds::EMPTY, index: 0, leaf: false }];
    let mut todo = vec![(0usize, 0usize)];
    while let Some((from, to)) = todo.pop() {
        let n = &bvh.nodes[from];
        if n.is_leaf() {
            let id = ids[bvh.primitive_indices[n.first_index as usize] as usize];
            out[to] = Binary { bounds: Bounds::of(&triangles[id as usize]), index: id, leaf: true };
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
