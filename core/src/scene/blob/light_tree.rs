//! The tree over a scene's lights.

use bytemuck::{Pod, Zeroable};

/// Deepest light tree: three bits of a trail for each level fit 32 bits.
pub const MAX_LIGHT_DEPTH: u32 = 10;

/// Lights from which on bakers add a light tree.
pub const LIGHT_TREE_MIN: usize = 32;

/// Eight children of a light tree, each a light or a node, and what bounds their emission: a ball around all places, a
/// cone around all normals, the sum of the weights. A light's weight is proportional to the irradiance that it brings
/// at most, times the square of the distance for those that have a place.
///
/// Nodes are numbered in preorder, so that children come behind their parents; the root is node 0. A light is in the
/// tree at most once. Its trail, a `u32` in the section of trails, says where: three bits per level from the root on,
/// the lowest first, each the slot of a child; [`NONE`](super::NONE) if it is not in the tree. Lights that are not in
/// the tree are never sampled.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct LightNode {
    /// Rows x, y, z: middles of the balls, world space.
    pub middle: [[f32; 8]; 3],
    /// Radii of the balls; infinite for lights at infinity, of which each weighs the same at all points.
    pub radius: [f32; 8],
    /// Rows x, y, z: unit axes of the cones around the normals.
    pub axis: [[f32; 8]; 3],
    /// Cosines of the half angles of the cones; -1 for lights that emit in all directions.
    pub cos: [f32; 8],
    /// Sines of the half angles.
    pub sin: [f32; 8],
    /// Points whose offset from the middle along the axis is not above this see no light from its front.
    pub front: [f32; 8],
    /// Sums of weights, 0 in unused slots.
    pub weight: [f32; 8],
    /// A node, or [`LEAF_BIT`](super::LEAF_BIT) and a light, or [`NONE`](super::NONE).
    pub child: [u32; 8],
}

const _: () = assert!(size_of::<LightNode>() == 384);
