//! Boxes and leaf corners made right again after triangles or instances moved, in pieces.

use crate::scene::blob::{CHILD_INDEX, LEAF_BIT, Leaf, NONE, Node, Triangle, Vertex};

/// A tree of triangles, to be refitted after vertices moved.
#[derive(Debug)]
pub struct TriangleTree<'a> {
    /// Nodes of the tree.
    pub nodes: &'a mut [Node],
    /// Number by which references name the first of `nodes`.
    pub first_node: u32,
    /// Leaves of the tree.
    pub leaves: &'a mut [Leaf],
    /// Number by which references name the first of `leaves`.
    pub first_leaf: u32,
    /// All triangles of the blob.
    pub triangles: &'a [Triangle],
    /// All vertices of the blob.
    pub vertices: &'a [Vertex],
}

impl TriangleTree<'_> {
    /// Refits up to `count` nodes before node `end`, and their leaves; returns where to go on, 0 when done. The first call
    /// passes the number of nodes. Children have higher numbers than their parents, so that going backwards is enough.
    ///
    /// Until all is done the tree must not be walked. It is as good for rays as the shape that it was built for is like
    /// the new one; hits are those of a new tree, whatever the boxes.
    pub fn refit(&mut self, end: usize, count: usize) -> usize {
        let end = end.min(self.nodes.len());
        let start = end.saturating_sub(count.max(1));
        for i in (start..end).rev() {
            let Some(mut node) = self.nodes.get(i).copied() else { continue };
            for slot in 0..8 {
                let child = node.child[slot];
                let b = if child == NONE {
                    continue;
                } else if child & LEAF_BIT != 0 {
                    self.leaf(child & CHILD_INDEX)
                } else {
                    let below = child.checked_sub(self.first_node).and_then(|c| self.nodes.get(c as usize));
                    below.map_or([[0.0; 3]; 2], node_bounds)
                };
                set_bounds(&mut node, slot, b);
            }
            if let Some(place) = self.nodes.get_mut(i) {
                *place = node;
            }
        }
        start
    }

    /// Reads the corners of a leaf anew; its box.
    fn leaf(&mut self, index: u32) -> [[f32; 3]; 2] {
        let mut b = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        let leaf = index.checked_sub(self.first_leaf).and_then(|i| self.leaves.get_mut(i as usize));
        let Some(leaf) = leaf else { return [[0.0; 3]; 2] };
        for slot in 0..8 {
            let Some(t) = self.triangles.get(leaf.triangle[slot] as usize) else { continue };
            for (v, vertex) in t.vertex.iter().enumerate() {
                let p = self.vertices.get(*vertex as usize).map_or([0.0; 3], |v| v.p);
                for k in 0..3 {
                    leaf.p[3 * v + k][slot] = p[k];
                    b[0][k] = b[0][k].min(p[k]);
                    b[1][k] = b[1][k].max(p[k]);
                }
            }
        }
        b
    }
}

/// Box of all children of a node.
pub(super) fn node_bounds(node: &Node) -> [[f32; 3]; 2] {
    let fold = |row: usize, f: fn(f32, f32) -> f32, from: f32| node.bounds[row].into_iter().fold(from, f);
    [[0, 1, 2].map(|k| fold(k, f32::min, f32::INFINITY)), [3, 4, 5].map(|k| fold(k, f32::max, f32::NEG_INFINITY))]
}

/// Sets the box of a child.
pub(super) fn set_bounds(node: &mut Node, slot: usize, [min, max]: [[f32; 3]; 2]) {
    for k in 0..3 {
        node.bounds[k][slot & 7] = min[k];
        node.bounds[k + 3][slot & 7] = max[k];
    }
}
