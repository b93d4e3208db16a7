//! Copy of obvhs's tree, by parts that threads write side by side.

use super::groups::Groups;
use super::node::{Binary, BinaryTree, Bounds};
use bytemuck::Zeroable;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;
use std::collections::BinaryHeap;
use std::ops::Range;

/// Subtrees that threads work at, at most.
const PARTS: usize = 256;

/// What is below a node of the copy.
#[derive(Clone)]
enum Subtree {
    /// The subtree of a node of obvhs's tree, which has this box.
    Node(Bounds, usize),
    /// Triangles that stay together, by their places, and their box.
    Leaf(Bounds, Range<u32>),
    /// A balanced tree over triangles that all have this box, by their places.
    Equal(Bounds, Range<u32>),
}

impl Subtree {
    fn of(bvh: &Bvh2, groups: &Groups, node: usize) -> Self {
        let n = &bvh.nodes[node];
        if !n.is_leaf() {
            return Self::Node(bounds(n), node);
        }
        Self::of_group(bounds(n), groups.places(bvh.primitive_indices[n.first_index as usize] as usize))
    }

    /// All triangles of a group.
    fn of_group(bounds: Bounds, (places, together): (Range<u32>, bool)) -> Self {
        if together { Self::Leaf(bounds, places) } else { Self::Equal(bounds, places) }
    }

    /// The two below it; `None` for a leaf.
    fn children(&self, bvh: Option<&Bvh2>, groups: &Groups) -> Option<[Self; 2]> {
        match self {
            Self::Leaf(..) => None,
            Self::Equal(_, places) if places.len() == 1 => None,
            Self::Equal(bounds, places) => {
                let middle = places.start + places.len() as u32 / 2;
                Some([places.start..middle, middle..places.end].map(|places| Self::Equal(*bounds, places)))
            }
            Self::Node(_, n) => bvh.map(|bvh| {
                let first = bvh.nodes[*n].first_index as usize;
                [first, first + 1].map(|n| Self::of(bvh, groups, n))
            }),
        }
    }

    /// Number of leaves.
    fn leaves(&self, bvh: Option<&Bvh2>, groups: &Groups) -> usize {
        let (mut count, mut todo) = (0, vec![self.clone()]);
        while let Some(subtree) = todo.pop() {
            match subtree {
                Self::Leaf(..) => count += 1,
                Self::Equal(_, places) => count += places.len(),
                Self::Node(..) => todo.extend(subtree.children(bvh, groups).into_iter().flatten()),
            }
        }
        count
    }

    /// Writes all nodes but the root, which it returns, to `out`, whose first node has the number `start`.
    fn write(&self, bvh: Option<&Bvh2>, groups: &Groups, start: usize, out: &mut [Binary]) -> Binary {
        let (mut root, mut used, mut todo) = (Binary::zeroed(), 0, vec![(self.clone(), None)]);
        while let Some((subtree, to)) = todo.pop() {
            let children = subtree.children(bvh, groups);
            let (bounds, places) = match subtree {
                Self::Node(bounds, _) => (bounds, 0..0),
                Self::Leaf(bounds, places) | Self::Equal(bounds, places) => (bounds, places),
            };
            let node = match children {
                None => Binary { bounds, index: places.start, triangles: places.len() as u32 },
                Some(_) => Binary { bounds, index: (start + used) as u32, triangles: 0 },
            };
            if let Some([left, right]) = children {
                todo.extend([(left, Some(used)), (right, Some(used + 1))]);
                used += 2;
            }
            *to.map_or(&mut root, |i| &mut out[i]) = node;
        }
        root
    }
}

/// The box of a node of obvhs's tree.
fn bounds(node: &Bvh2Node) -> Bounds {
    Bounds { min: node.aabb().min.to_array(), max: node.aabb().max.to_array() }
}

/// The nodes of obvhs's tree in an order with children after parents, and in parts. Without a tree there is at most one
/// group.
pub(super) fn copy(bvh: Option<&Bvh2>, groups: Groups) -> BinaryTree {
    let Some(first) = groups.boxes.first() else {
        return BinaryTree { nodes: Vec::new(), parts: Vec::new(), triangles: Vec::new() };
    };
    let (top, below) = match bvh {
        Some(bvh) => largest(bvh, &groups),
        None => (vec![Binary::zeroed()], vec![(0, Subtree::of_group(*first, groups.places(0)))]),
    };
    let sizes: Vec<usize> = below.par_iter().map(|(_, subtree)| 2 * subtree.leaves(bvh, &groups) - 2).collect();
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
    let write = of_parts.map(|((part, out), (_, subtree))| subtree.write(bvh, &groups, part.start, out));
    let roots: Vec<Binary> = write.collect();
    for ((to, _), root) in below.iter().zip(roots) {
        nodes[*to] = root;
    }
    BinaryTree { nodes, parts, triangles: groups.triangles }
}

/// The top of the tree, the nodes of its largest boxes, and what is below which of them.
fn largest(bvh: &Bvh2, groups: &Groups) -> (Vec<Binary>, Vec<(usize, Subtree)>) {
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
        nodes[to] = Binary { bounds: bounds(&bvh.nodes[node]), index: at as u32, triangles: 0 };
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
