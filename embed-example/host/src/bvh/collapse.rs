//! Binary tree to 8-wide tree at the lowest expected cost (surface area heuristic), by dynamic programming as for
//! compressed wide trees (Ylitie, Karras, Laine, HPG 2017, section 4), with leaves of up to eight triangles.
//!
//! `cost[i][j]` is the least cost of the subtree i as at most j siblings: one wide node or leaf (j = 1), or its
//! children with k and j - k of them.

use super::node::{Binary, BinaryTree, Bounds};
use super::parts::split;
use bytemuck::Zeroable;
use croupier::unstable::scene::blob::{LEAF_BIT, Leaf, MAX_TREE_DEPTH, NONE, Node};
use rayon::prelude::*;
use std::ops::Range;

/// Cost of a visited node per half area; measured, in units of a leaf's eight-triangle test.
const NODE_COST: f32 = 1.0;
/// Cost of a visited leaf per half area.
const LEAF_COST: f32 = 1.0;
/// Triangles in a leaf, children of a node.
const WIDTH: usize = 8;

/// An 8-wide tree over triangles.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// Nodes, the root first; empty if there are no triangles.
    pub nodes: Vec<Node>,
    /// Leaves; every triangle is in exactly one.
    pub leaves: Vec<Leaf>,
    /// Levels of nodes: 1 if the root has only leaves, 0 without triangles. At most
    /// [`MAX_TREE_DEPTH`].
    pub depth: u32,
}

/// Decision of the dynamic programme for one binary node.
#[derive(Clone, Copy, Zeroable)]
#[repr(C)]
struct Plan {
    /// Least cost as at most j + 1 siblings.
    cost: [f32; WIDTH - 1],
    triangles: u32,
    /// As at most j siblings: this many for the first child; 0: no better than j - 1 siblings. `split[8]`: the children
    /// of a wide node.
    split: [u8; WIDTH + 1],
    /// Levels of wide nodes as at most j + 1 siblings; 0 for a leaf.
    height: [u8; WIDTH - 1],
    /// As one sibling: a leaf, not a node.
    leaf: bool,
}

impl Plan {
    /// The plan for `node`, whose half area is `area` of the root's; `children` are those of its children.
    fn new(node: &Binary, area: f32, children: [&Self; 2]) -> Self {
        let mut p = Self { leaf: true, triangles: node.triangles, ..Self::zeroed() };
        if node.is_leaf() {
            p.cost = [area * LEAF_COST; WIDTH - 1];
            return p;
        }
        let [l, r] = children;
        let best = |j: usize| {
            let mut best = (f32::INFINITY, 1);
            for k in j.saturating_sub(7).max(1)..j.min(8) {
                let c = l.cost[k - 1] + r.cost[j - k - 1];
                if c < best.0 {
                    best = (c, k);
                }
            }
            best
        };
        let height = |j: usize, k: usize| l.height[k - 1].max(r.height[j - k - 1]);
        p.triangles = l.triangles + r.triangles;
        let (inner, k) = best(WIDTH);
        let as_node = area * NODE_COST + inner;
        let as_leaf = if p.triangles as usize <= WIDTH { area * LEAF_COST } else { f32::INFINITY };
        p.split[WIDTH] = k as u8;
        p.leaf = as_leaf <= as_node;
        p.cost[0] = as_leaf.min(as_node);
        p.height[0] = if p.leaf { 0 } else { height(WIDTH, k).saturating_add(1) };
        for j in 2..WIDTH {
            let (c, k) = best(j);
            let divided = c < p.cost[j - 2];
            p.cost[j - 1] = if divided { c } else { p.cost[j - 2] };
            p.split[j] = if divided { k as u8 } else { 0 };
            p.height[j - 1] = if divided { height(j, k) } else { p.height[j - 2] };
        }
        p
    }
}

/// The wide tree of `tree`.
pub(super) fn widen(tree: &BinaryTree, triangles: &[[[f32; 3]; 3]]) -> Tree {
    if tree.nodes.is_empty() {
        return Tree::default();
    }
    let plans = plan(tree);
    let mut w = Writer {
        tree: &tree.nodes,
        order: &tree.triangles,
        plans: &plans,
        triangles,
        out: Tree::default(),
        leaves: Vec::new(),
    };
    w.node(Source::Binary(0), 1);
    w.out.leaves = w.leaves.par_iter().map(|source| w.leaf(source)).collect();
    w.out
}

fn plan(BinaryTree { nodes, parts, .. }: &BinaryTree) -> Vec<Plan> {
    let root = nodes[0].bounds.half_area().max(f64::MIN_POSITIVE);
    let of = |i: usize, start: usize, plans: &[Plan]| {
        let n = &nodes[i];
        let first = if n.is_leaf() { 0 } else { n.index as usize - start };
        // not read of leaves
        let children = [first, first + 1].map(|c| plans.get(c).unwrap_or(&plans[0]));
        Plan::new(n, (n.bounds.half_area() / root) as f32, children)
    };
    let mut plans: Vec<Plan> = bytemuck::zeroed_vec(nodes.len());
    let top = parts[0].end;
    let of_parts = split(&mut plans[top..], &parts[1..]);
    let of_part = |(part, plans): (&Range<usize>, &mut [Plan])| {
        for i in (0..plans.len()).rev() {
            plans[i] = of(part.start + i, part.start, plans);
        }
    };
    parts[1..].par_iter().zip(of_parts).for_each(of_part);
    for i in (0..top).rev() {
        plans[i] = of(i, 0, &plans);
    }
    plans
}

/// The siblings that make up the wide node of binary node `i`.
fn wide_children(tree: &[Binary], plans: &[Plan], i: usize, out: &mut Vec<usize>) {
    let mut todo = vec![(i, WIDTH)];
    while let Some((i, mut j)) = todo.pop() {
        let p = &plans[i];
        while j > 1 && (tree[i].is_leaf() || p.split[j] == 0) {
            j -= 1;
        }
        if j == 1 {
            out.push(i);
            continue;
        }
        let (k, first) = (p.split[j] as usize, tree[i].index as usize);
        todo.push((first + 1, j - k));
        todo.push((first, k));
    }
}

/// Source of a wide node's children.
enum Source {
    /// As planned.
    Binary(usize),
    /// Balanced over these triangles: the plan was too deep.
    Median(Vec<u32>),
}

struct Writer<'a> {
    tree: &'a [Binary],
    /// See [`BinaryTree::triangles`].
    order: &'a [u32],
    plans: &'a [Plan],
    triangles: &'a [[[f32; 3]; 3]],
    /// Nodes, and no leaves.
    out: Tree,
    /// What the leaves hold.
    leaves: Vec<Source>,
}

impl Writer<'_> {
    /// Writes a wide node at `level` (the root's is 1) and everything below; returns its index.
    fn node(&mut self, source: Source, level: u32) -> u32 {
        self.out.depth = self.out.depth.max(level);
        let me = self.out.nodes.len();
        let mut node = Node::zeroed();
        for k in 0..3 {
            (node.bounds[k], node.bounds[k + 3]) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        }
        node.child = [NONE; 8];
        self.out.nodes.push(node);
        let about = |source| match source {
            Source::Binary(i) => (self.tree[i].bounds, self.plans[i].leaf, source),
            Source::Median(ids) => (self.bounds(&ids), ids.len() <= WIDTH, Source::Median(ids)),
        };
        let mut children: Vec<_> = self.children(source, level).into_iter().map(about).collect();
        // rays that look for any hit go through the slots in this order: most hits for the least work
        children
            .sort_by(|(a, a_leaf, _), (b, b_leaf, _)| b_leaf.cmp(a_leaf).then(b.half_area().total_cmp(&a.half_area())));
        for (slot, (bounds, leaf, source)) in children.into_iter().enumerate() {
            let child = if leaf { self.add_leaf(source) } else { self.node(source, level + 1) };
            let node = &mut self.out.nodes[me];
            node.child[slot] = child;
            for k in 0..3 {
                node.bounds[k][slot] = bounds.min[k];
                node.bounds[k + 3][slot] = bounds.max[k];
            }
        }
        me as u32
    }

    /// At most eight children of a node at `level`.
    fn children(&self, source: Source, level: u32) -> Vec<Source> {
        let ids = match source {
            Source::Binary(i) if self.plans[i].leaf => return vec![Source::Binary(i)],
            Source::Binary(i) if self.fits(i, level) => {
                let mut children = Vec::with_capacity(WIDTH);
                wide_children(self.tree, self.plans, i, &mut children);
                return children.into_iter().map(Source::Binary).collect();
            }
            Source::Binary(i) => self.gather(i),
            Source::Median(ids) => ids,
        };
        self.median(ids)
    }

    /// May binary node `i` become a wide node at `level` as planned: is its subtree shallow enough, or is there room to
    /// rebuild its children by median splits?
    fn fits(&self, i: usize, level: u32) -> bool {
        let p = &self.plans[i];
        let as_planned = level + u32::from(p.height[0]) - 1 <= MAX_TREE_DEPTH;
        as_planned || level + median_levels(p.triangles as usize) <= MAX_TREE_DEPTH
    }

    fn gather(&self, i: usize) -> Vec<u32> {
        let (mut ids, mut todo) = (Vec::new(), vec![i]);
        while let Some(i) = todo.pop() {
            let n = &self.tree[i];
            if n.is_leaf() {
                ids.extend(self.of_leaf(n));
            } else {
                todo.push(n.index as usize + 1);
                todo.push(n.index as usize);
            }
        }
        ids
    }

    /// Writes the triangles below binary node `i`, which are few, from slot `n` on; the next free slot.
    fn fill(&self, i: usize, slots: &mut [u32; WIDTH], n: usize) -> usize {
        let node = &self.tree[i];
        if !node.is_leaf() {
            let n = self.fill(node.index as usize, slots, n);
            return self.fill(node.index as usize + 1, slots, n);
        }
        let ids = self.of_leaf(node);
        for (slot, id) in slots.iter_mut().skip(n).zip(ids) {
            *slot = *id;
        }
        n + ids.len()
    }

    /// Triangles of a leaf of the binary tree.
    fn of_leaf(&self, leaf: &Binary) -> &[u32] {
        &self.order[leaf.index as usize..][..leaf.triangles as usize]
    }

    fn bounds(&self, ids: &[u32]) -> Bounds {
        ids.iter().fold(Bounds::EMPTY, |b, &id| b.with(&Bounds::of(&self.triangles[id as usize])))
    }

    /// Up to eight parts of equal size, by three median splits of box centres along the longest axis.
    fn median(&self, ids: Vec<u32>) -> Vec<Source> {
        let mut parts = vec![ids];
        while parts.len() < WIDTH && parts.iter().any(|p| p.len() > WIDTH) {
            let mut next = Vec::with_capacity(parts.len() * 2);
            for mut p in parts {
                if p.len() <= WIDTH {
                    next.push(p);
                    continue;
                }
                let b = self.bounds(&p);
                let extent = |k: usize| f64::from(b.max[k]) - f64::from(b.min[k]);
                let axis = (1..3).fold(0, |a, k| if extent(k) > extent(a) { k } else { a });
                let centre = |id: &u32| {
                    let b = Bounds::of(&self.triangles[*id as usize]);
                    f64::from(b.min[axis]) + f64::from(b.max[axis])
                };
                let half = p.len() / 2;
                p.select_nth_unstable_by(half, |x, y| centre(x).total_cmp(&centre(y)).then(x.cmp(y)));
                let second = p.split_off(half);
                next.extend([p, second]);
            }
            parts = next;
        }
        parts.into_iter().map(Source::Median).collect()
    }

    /// A leaf with what `source` holds; the child's value.
    fn add_leaf(&mut self, source: Source) -> u32 {
        let count = match &source {
            Source::Binary(i) => self.plans[*i].triangles as usize,
            Source::Median(ids) => ids.len(),
        };
        let index = self.leaves.len() as u32;
        self.leaves.push(source);
        LEAF_BIT | (count.min(WIDTH) as u32) << 27 | index
    }

    fn leaf(&self, source: &Source) -> Leaf {
        let mut leaf = Leaf { p: [[0.0; 8]; 9], triangle: [NONE; 8] };
        match source {
            Source::Binary(i) => self.fill(*i, &mut leaf.triangle, 0),
            Source::Median(ids) => {
                let n = ids.len().min(WIDTH);
                leaf.triangle[..n].copy_from_slice(&ids[..n]);
                n
            }
        };
        leaf.triangle.sort_unstable();
        for (slot, id) in leaf.triangle.into_iter().enumerate().take_while(|(_, id)| *id != NONE) {
            for (row, x) in self.triangles[id as usize].as_flattened().iter().enumerate() {
                leaf.p[row][slot] = *x;
            }
        }
        leaf
    }
}

/// Levels of nodes of a median-split subtree over `n` triangles: each divides by eight until leaves hold eight.
fn median_levels(n: usize) -> u32 {
    let (mut n, mut levels) = (n, 1);
    while n > WIDTH * WIDTH {
        n = n.div_ceil(WIDTH) + 1;
        levels += 1;
    }
    levels
}
