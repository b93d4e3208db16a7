//! Copy of obvhs's tree, by parts that threads write side by side.

use super::coincident::Groups;
use super::node::{Binary, BinaryTree, Bounds};
use bytemuck::Zeroable;
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;
use std::collections::BinaryHeap;
use std::ops::Range;

/// Subtrees that threads work at, at most.
const PARTS: usize = 256;

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

    /// The two below it; `None` for a single triangle.
    fn children(&self, bvh: Option<&Bvh2>, groups: &'a Groups) -> Option<[Self; 2]> {
        match *self {
            Self::Equal(_, [_]) => None,
            Self::Equal(bounds, ids) => {
                let (left, right) = ids.split_at(ids.len() / 2);
                Some([left, right].map(|ids| Self::Equal(bounds, ids)))
            }
            Self::Node(n) => bvh.map(|bvh| {
                let first = bvh.nodes[n].first_index as usize;
                [first, first + 1].map(|n| Self::of(bvh, groups, n))
            }),
        }
    }

    fn triangles(&self, bvh: Option<&Bvh2>, groups: &'a Groups) -> usize {
        let (mut count, mut todo) = (0, vec![*self]);
        while let Some(subtree) = todo.pop() {
            match subtree {
                Subtree::Equal(_, ids) => count += ids.len(),
                Subtree::Node(_) => todo.extend(subtree.children(bvh, groups).into_iter().flatten()),
            }
        }
        count
    }

    /// Writes all nodes but the root, which it returns, to `out`, whose first node has the number `start`.
    fn write(&self, bvh: Option<&Bvh2>, groups: &'a Groups, start: usize, out: &mut [Binary]) -> Binary {
        let (mut root, mut used, mut todo) = (Binary::zeroed(), 0, vec![(*self, None)]);
        while let Some((subtree, to)) = todo.pop() {
            let node = match subtree {
                Subtree::Equal(bounds, [id]) => Binary { bounds, index: *id, leaf: true },
                _ => Binary { index: (start + used) as u32, ..Binary::zeroed() },
            };
            if let Some([left, right]) = subtree.children(bvh, groups) {
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

/// The nodes of obvhs's tree in an order with children after parents, and in parts. Without a tree there is at most one
/// group.
pub(super) fn copy(bvh: Option<&Bvh2>, groups: &Groups) -> BinaryTree {
    let Some(bounds) = groups.boxes.first() else { return BinaryTree { nodes: Vec::new(), parts: Vec::new() } };
    let (top, below) = match bvh {
        Some(bvh) => largest(bvh, groups),
        None => (vec![Binary::zeroed()], vec![(0, Subtree::Equal(*bounds, groups.ids(0)))]),
    };
    let sizes: Vec<usize> = below.par_iter().map(|(_, subtree)| 2 * subtree.triangles(bvh, groups) - 2).collect();
    let mut parts = Vec::with_capacity(1 + sizes.len());
    parts.push(0..top.len());
    for size in &sizes {
        let from = parts[parts.len() - 1].end;
        parts.push(from..from + size);
    }
    let mut nodes: Vec<Binary> = bytemuck::zeroed_vec(top.len() + sizes.iter().sum::<usize>());
    let (first, rest) = nodes.split_at_mut(top.len());
    first.copy_from_slice(&top);
    let of_parts = parts[1..].par_iter().zip(split(rest, &parts[1..])).zip(&below);
    let write = of_parts.map(|((part, out), (_, subtree))| subtree.write(bvh, groups, part.start, out));
    let roots: Vec<Binary> = write.collect();
    for ((to, _), root) in below.iter().zip(roots) {
        nodes[*to] = root;
    }
    for i in (0..top.len()).rev() {
        nodes[i] = with_bounds(nodes[i], 0, &nodes);
    }
    BinaryTree { nodes, parts }
}

/// The top of the tree, the nodes of its largest boxes, and what is below which of them.
fn largest<'a>(bvh: &Bvh2, groups: &'a Groups) -> (Vec<Binary>, Vec<(usize, Subtree<'a>)>) {
    // by area, which is not negative: its bits compare like the numbers
    let area = |node: usize| bvh.nodes[node].aabb().half_area().to_bits();
    let mut nodes = vec![Binary::zeroed()];
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
    (nodes, below)
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
