//! Builder of the tree of a scene blob.
//!
//! `obvhs` builds a binary tree (PLOC with reinsertion, Meister & Bittner 2018); `collapse` turns it into 8-wide nodes
//! over leaves of up to eight triangles at the lowest expected cost; subtrees that would be too deep are rebuilt by
//! median splits. Before, `groups` makes one of triangles with the same box, and in large meshes of pairs that share an
//! edge. `parts` divides the work among threads: the tree is the same for any number of them. Nodes and leaves are
//! numbered depth first, slots ascending: a parent comes before its children, and a walk mostly goes forward in memory.

mod binary;
mod collapse;
mod groups;
mod node;
mod parts;

pub use binary::Effort;
pub use collapse::Tree;

/// Builds the tree over `triangles` (vertices a, b, c, world space; finite). Never panics: triangles with a NaN or an
/// infinite coordinate are left out, no ray finds them.
pub fn build(triangles: &[[[f32; 3]; 3]], effort: Effort) -> Tree {
    let binary = binary::build(triangles, effort);
    collapse::widen(&binary, triangles)
}
