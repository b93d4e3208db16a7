//! Builds the tree of a scene blob.
//!
//! `obvhs` builds a binary tree (PLOC with reinsertion, Meister & Bittner 2018); `collapse` turns it into 8-wide nodes
//! over leaves of up to eight triangles at the lowest expected cost; what would be too deep is rebuilt by median
//! splits. Nodes and leaves are numbered depth first, slots ascending: a parent comes before its children, and a walk
//! mostly goes forward in memory.

mod binary;
mod collapse;

use croupier::scene::blob::{Leaf, Node};

/// How hard to try.
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

/// An 8-wide tree over triangles.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// Nodes, the root first; empty if there are no triangles.
    pub nodes: Vec<Node>,
    /// Leaves; every triangle is in exactly one.
    pub leaves: Vec<Leaf>,
    /// Levels of nodes: 1 if the root has only leaves, 0 without triangles. At most
    /// [`MAX_TREE_DEPTH`](croupier::scene::blob::MAX_TREE_DEPTH).
    pub depth: u32,
}

/// Builds the tree over `triangles` (vertices a, b, c, world space; finite). Never panics: triangles with a NaN or an
/// infinite coordinate are left out, no ray finds them.
pub fn build(triangles: &[[[f32; 3]; 3]], effort: Effort) -> Tree {
    let binary = binary::build(triangles, effort);
    collapse::widen(&binary, triangles)
}
