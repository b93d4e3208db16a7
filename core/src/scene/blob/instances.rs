//! Objects and their instances: trees of triangles that the world holds as often as it likes.
//!
//! Without instances both sections are empty and the tree is that of all triangles, from node 0. With instances
//!
//! * object 0 is the world, the others are what instances place; instances of object 0 may refer to any other object, those
//!   of another object to objects without instances of their own ([`MAX_INSTANCE_DEPTH`] levels, no cycles),
//! * sections of triangles, leaves and instances are the runs of the objects one after the other; that of nodes has for
//!   each object its top-level tree, room for a larger one, and the tree of its own triangles,
//! * a top-level tree is there if the object has instances. Its leaves are child references with a count of 0, which index
//!   [`Instance`]s, and one reference to the first node of the object's own tree, if it has triangles,
//! * vertices, corners in leaves and bounds of objects are in the object's own space.

use bytemuck::{Pod, Zeroable};

/// Most instances that are nested: world -> instance -> instance -> triangles.
pub const MAX_INSTANCE_DEPTH: u32 = 2;

/// Largest [`Instance::condition`]. Boxes grow by some 2^-20 of it times the coordinates, so that trees of
/// worse transforms would separate nothing.
pub const MAX_CONDITION: f32 = 1e5;

/// Rays do not meet the instance, and its lights do not emit.
pub const INSTANCE_HIDDEN: u32 = 1;
/// The map mirrors: its determinant is negative.
pub const INSTANCE_MIRRORED: u32 = 2;
/// The two keys differ.
pub const INSTANCE_MOVING: u32 = 4;

/// Triangles with a tree of their own, and instances of other objects. Object 0 is the world.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Object {
    /// Smallest coordinates of everything in it, own space.
    pub bounds_min: [f32; 3],
    /// Largest coordinates.
    pub bounds_max: [f32; 3],
    /// First of its own triangles.
    pub first_triangle: u32,
    /// Number of them.
    pub triangles: u32,
    /// First node of the tree of its own triangles.
    pub first_node: u32,
    /// Nodes of that tree, 0 without triangles.
    pub nodes: u32,
    /// First leaf of that tree.
    pub first_leaf: u32,
    /// Leaves of that tree.
    pub leaves: u32,
    /// First node of the top-level tree.
    pub first_top: u32,
    /// Nodes of it, 0 without instances.
    pub top_nodes: u32,
    /// Nodes from `first_top` on that a rebuilt top-level tree may take; those beyond `top_nodes` may hold anything.
    pub top_capacity: u32,
    /// First of its own instances.
    pub first_instance: u32,
    /// Number of them.
    pub instances: u32,
    /// Emitting triangles among its own. Of objects other than the world, [`super::Triangle::light`] counts them: 0, 1, ...
    pub emitters: u32,
    /// Lights that an instance of it has: `emitters` and, one after the other, those of its own instances.
    pub lights: u32,
    /// Largest [`Instance::condition`] of its own instances, 0 without any.
    pub condition: f32,
}

/// A placement of an object in another one. What the transforms and the object determine ([`super::super::derive`]) is
/// stored with them: `inverse`, `condition` and two of the flags.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Instance {
    /// Rows of the affine maps from the object's space to that around the instance, when the shutter opens and when it
    /// closes. In between, entries are interpolated linearly.
    pub to_world: [[[f32; 4]; 3]; 2],
    /// Inverse of the first map's linear part, computed in `f64` and rounded; of a moving instance, rays compute their own.
    pub inverse: [[f32; 3]; 3],
    /// Object that it places.
    pub object: u32,
    /// World: index of its first light. In other objects: the same, counted from the first light of the instance around it.
    pub first_light: u32,
    /// [`INSTANCE_HIDDEN`], [`INSTANCE_MIRRORED`], [`INSTANCE_MOVING`].
    pub flags: u32,
    /// Bound of the largest row sum of `|A| |A^-1|` over the shutter's time, A the linear part: by how much rounding is
    /// worse than without the transform. At most [`MAX_CONDITION`].
    pub condition: f32,
    /// Zero.
    pub reserved: [u32; 3],
}

/// Nodes that a top-level tree over `n` instances and subtrees of triangles takes at most.
///
/// The builder gives nodes eight children, or as many as there are things where those are seven or fewer, all of them leaves
/// then: f full nodes and b others. Each but the root is a child: 8 f + 2 b <= f + b - 1 + n; others are children of full
/// nodes: b <= 7 f + 1. Together f + b <= 4 (n - 2) / 7 + 1 for n >= 2.
pub const fn top_capacity(n: u32) -> u32 {
    let most = (n.saturating_sub(2) as u64).saturating_mul(4).div_euclid(7).saturating_add(1);
    if most > u32::MAX as u64 { u32::MAX } else { most as u32 }
}

const _: () = assert!(size_of::<Object>() == 80 && size_of::<Instance>() == 160);
