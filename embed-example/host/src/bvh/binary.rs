//! The binary tree: boxes over single triangles or few of them.

use bytemuck::Zeroable;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;
use std::array;
use std::collections::BinaryHeap;
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

/// Subtrees that threads work at, about.
const PARTS: usize = 256;

/// Builds the tree. It does not depend on the number of threads.
pub(super) fn build(triangles: &[[[f32; 3]; 3]], effort: Effort) -> BinaryTree {
    let groups = Groups::of(triangles);
    if groups.boxes.len() < 2 {
        let Some(bounds) = groups.boxes.first() else { return BinaryTree { nodes: Vec::new(), parts: Vec::new() } };
        let root = Top { nodes: vec![Binary::zeroed()], below: vec![(0, Subtree::Equal(*bounds, groups.ids(0)))] };
        return root.complete(&Bvh2::default(), &groups);
    }
    let boxes: Vec<Aabb> = groups.boxes.par_iter().map(|b| Aabb { min: b.min.into(), max: b.max.into() }).collect();
    // merging the nearest of 24 neighbours on all levels gives rays 1 to 5 % less to visit than on the lowest two alone
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
    Top::of(&bvh, &groups).complete(&bvh, &groups)
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

/// The finite triangles grouped by equal boxes, by ascending first triangle. PLOC merges nearest neighbours: among equal
/// boxes hardly any two choose each other, and it would need as many passes as there are boxes.
struct Groups {
    boxes: Vec<Bounds>,
    /// Triangles, group by group, each ascending.
    triangles: Vec<u32>,
    /// Where each group ends in `triangles`.
    ends: Vec<u32>,
}

impl Groups {
    fn of(triangles: &[[[f32; 3]; 3]]) -> Self {
        let bounds = |(id, t): (usize, &[[f32; 3]; 3])| {
            let b = Bounds::of(t);
            let finite = t.as_flattened().iter().all(|x| x.is_finite());
            finite.then(|| (array::from_fn(|k| if k < 3 { b.min[k] } else { b.max[k - 3] }.to_bits()), id as u32))
        };
        let mut sorted: Vec<([u32; 6], u32)> = triangles.par_iter().enumerate().filter_map(bounds).collect();
        sorted.par_sort_unstable();
        // places of the group that begins with a triangle
        let mut places = vec![0..0; triangles.len()];
        let mut from = 0;
        for group in sorted.chunk_by(|x, y| x.0 == y.0) {
            places[group[0].1 as usize] = from..from + group.len();
            from += group.len();
        }
        let mut out = Self {
            boxes: Vec::with_capacity(from),
            triangles: Vec::with_capacity(from),
            ends: Vec::with_capacity(from),
        };
        for (t, places) in triangles.iter().zip(places).filter(|(_, places)| !places.is_empty()) {
            out.boxes.push(Bounds::of(t));
            out.triangles.extend(sorted[places].iter().map(|x| x.1));
            out.ends.push(out.triangles.len() as u32);
        }
        out
    }

    fn ids(&self, group: usize) -> &[u32] {
        let from = if group == 0 { 0 } else { self.ends[group - 1] };
        &self.triangles[from as usize..self.ends[group] as usize]
    }
}

/// What is below a node of the copy.
#[derive(Clone, Copy)]
enum Subtree<'a> {
    /// The subtree of this node of obvhs's tree.
    Node(usize),
    /// A balanced tree over triangles that all have this box.
    Equal(Bounds, &'a [u32]),
}

impl<'a> Subtree<'a> {
    fn of(bvh: &Bvh2, groups: &'a Groups, node: usize) -> Self {
        let n = &bvh.nodes[node];
        if !n.is_leaf() {
            return Self::Node(node);
        }
        let group = bvh.primitive_indices[n.first_index as usize] as usize;
        let bounds = Bounds { min: n.aabb().min.to_array(), max: n.aabb().max.to_array() };
        Self::Equal(bounds, groups.ids(group))
    }

    fn triangles(&self, bvh: &Bvh2, groups: &Groups) -> usize {
        let (mut count, mut todo) = (0, vec![*self]);
        while let Some(subtree) = todo.pop() {
            match subtree {
                Subtree::Equal(_, ids) => count += ids.len(),
                Subtree::Node(n) => {
                    let first = bvh.nodes[n].first_index as usize;
                    todo.extend([first, first + 1].map(|n| Subtree::of(bvh, groups, n)));
                }
            }
        }
        count
    }

    /// Writes all nodes but the root, which it returns, to `out`, whose first node has the number `start`.
    fn write(&self, bvh: &Bvh2, groups: &Groups, start: usize, out: &mut [Binary]) -> Binary {
        let (mut root, mut used, mut todo) = (Binary::zeroed(), 0, vec![(*self, None)]);
        while let Some((subtree, to)) = todo.pop() {
            let index = (start + used) as u32;
            let (node, children) = match subtree {
                Subtree::Equal(bounds, [id]) => (Binary { bounds, index: *id, leaf: true }, None),
                Subtree::Equal(bounds, ids) => {
                    let (left, right) = ids.split_at(ids.len() / 2);
                    let halves = [left, right].map(|ids| Subtree::Equal(bounds, ids));
                    (Binary { bounds, index, leaf: false }, Some(halves))
                }
                Subtree::Node(n) => {
                    let first = bvh.nodes[n].first_index as usize;
                    let children = [first, first + 1].map(|n| Subtree::of(bvh, groups, n));
                    (Binary { bounds: Bounds::EMPTY, index, leaf: false }, Some(children))
                }
            };
            if let Some([left, right]) = children {
                todo.extend([(left, Some(used)), (right, Some(used + 1))]);
                used += 2;
            }
            *to.map_or(&mut root, |i| &mut out[i]) = node;
        }
        for i in (0..used).rev() {
            out[i] = with_bounds(out[i], start, out);
        }
        with_bounds(root, start, out)
    }
}

/// `node` with the box of its children, which are in `nodes`, whose first has the number `start`.
fn with_bounds(node: Binary, start: usize, nodes: &[Binary]) -> Binary {
    if node.leaf {
        return node;
    }
    let first = node.index as usize - start;
    Binary { bounds: nodes[first].bounds.with(&nodes[first + 1].bounds), ..node }
}

/// The top of the copy.
struct Top<'a> {
    nodes: Vec<Binary>,
    /// What is below which of them.
    below: Vec<(usize, Subtree<'a>)>,
}

impl<'a> Top<'a> {
    /// The largest boxes of a tree.
    fn of(bvh: &Bvh2, groups: &'a Groups) -> Self {
        let area = |node: usize| bvh.nodes[node].aabb().half_area().to_bits();
        let mut nodes = vec![Binary::zeroed()];
        // by area, which is not negative: its bits compare like the numbers
        let (mut open, mut below) = (BinaryHeap::from([(area(0), 0, 0)]), Vec::new());
        while open.len() + below.len() < PARTS
            && let Some((_, node, to)) = open.pop()
        {
            if bvh.nodes[node].is_leaf() {
                below.push((to, Subtree::of(bvh, groups, node)));
                continue;
            }
            let (first, at) = (bvh.nodes[node].first_index as usize, nodes.len());
            nodes[to].index = at as u32;
            nodes.extend([Binary::zeroed(); 2]);
            open.extend([0, 1].map(|k| (area(first + k), first + k, at + k)));
        }
        below.extend(open.into_iter().map(|(_, node, to)| (to, Subtree::of(bvh, groups, node))));
        below.sort_unstable_by_key(|x| x.0);
        Self { nodes, below }
    }

    /// The whole copy, in an order with children after parents.
    fn complete(self, bvh: &Bvh2, groups: &Groups) -> BinaryTree {
        let (top, below) = (self.nodes.len(), self.below);
        let sizes: Vec<usize> = below.par_iter().map(|(_, subtree)| 2 * subtree.triangles(bvh, groups) - 2).collect();
        let mut parts = Vec::with_capacity(1 + sizes.len());
        parts.push(0..top);
        for size in &sizes {
            let from = parts[parts.len() - 1].end;
            parts.push(from..from + size);
        }
        let mut nodes: Vec<Binary> = bytemuck::zeroed_vec(top + sizes.iter().sum::<usize>());
        let (first, rest) = nodes.split_at_mut(top);
        first.copy_from_slice(&self.nodes);
        let of_parts = parts[1..].par_iter().zip(split(rest, &parts[1..])).zip(&below);
        let write = of_parts.map(|((part, out), (_, subtree))| subtree.write(bvh, groups, part.start, out));
        let roots: Vec<Binary> = write.collect();
        let mut is_root = vec![false; top];
        for ((to, _), root) in below.iter().zip(roots) {
            (first[*to], is_root[*to]) = (root, true);
        }
        for i in (0..top).rev().filter(|i| !is_root[*i]) {
            first[i] = with_bounds(first[i], 0, first);
        }
        BinaryTree { nodes, parts }
    }
}

/// Divides what follows the first part into the others.
pub(super) fn split<'t, T>(mut rest: &'t mut [T], parts: &[Range<usize>]) -> Vec<&'t mut [T]> {
    let mut out = Vec::with_capacity(parts.len());
    for part in parts {
        let (of_part, after) = rest.split_at_mut(part.len());
        out.push(of_part);
        rest = after;
    }
    out
}
