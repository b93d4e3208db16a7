//! The layout of a scene blob, version 4. Little-endian, position-independent, every record Pod.
//!
//! Materials, lights and media, with the tables of their kinds, objects and instances are in `blob/`.
//!
//! A blob is a [`Header`], a table of [`Section`]s, then the sections, each at an offset that is a multiple of
//! [`ALIGN`]. Indices are `u32`; [`NONE`] is absence. Bytes become a [`super::Scene`] through
//! [`super::Scene::from_bytes`] only.

use bytemuck::{Pod, Zeroable};

/// First bytes of every blob.
pub const MAGIC: [u8; 8] = *b"CROUPIER";
/// Version of this layout.
pub const VERSION: u32 = 4;
/// Sections start at multiples of this many bytes; a blob aligned to it traverses fastest (4 is enough).
pub const ALIGN: usize = 64;
/// "No such index".
pub const NONE: u32 = u32::MAX;
/// Set in a child reference that is a leaf: bits 0..27 index [`Leaf`]s, bits 27..31 count its triangles (1..=8); in
/// top-level trees the count is 0, and bits 0..27 index [`Instance`]s.
pub const LEAF_BIT: u32 = 1 << 31;
/// Bits of a child reference that index.
pub const CHILD_INDEX: u32 = (1 << 27) - 1;
/// Deepest tree that validates: with 7 pushed siblings per level a traversal stack of 256 never overflows.
pub const MAX_TREE_DEPTH: u32 = 34;

/// Largest magnitude of a coordinate: cross products of two edges then have a squared length that `f32` can hold
/// (edges up to 2e9, products up to 8e18, squares of three components up to 1.92e38).
pub const MAX_COORDINATE: f32 = 1e9;
/// Most columns or rows of a texture, an environment map or an image: an `f32` position in it keeps 8 bits of fraction.
pub const MAX_SIDE: u32 = 1 << 16;

macro_rules! kinds {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $v:ident = $n:expr, $text:literal;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum $name { $($(#[$vdoc])* $v = $n),* }
        impl $name {
            /// Every kind, in the order of the numbers.
            pub const ALL: &'static [Self] = &[$(Self::$v),*];

            /// Kind of a number in the blob.
            pub const fn from_u32(x: u32) -> Option<Self> {
                match x { $($n => Some(Self::$v),)* _ => None }
            }

            /// Name in scene files.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$v => $text),* }
            }

            /// Kind of a name in scene files.
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $($text => Some(Self::$v),)* _ => None }
            }
        }
    };
}

mod instances;
mod light_tree;
mod lights;
mod materials;
mod media;
mod principled;

pub use instances::*;
pub use light_tree::*;
pub use lights::*;
pub use materials::*;
pub use media::*;
pub use principled::*;

kinds! {
    /// Kinds of sections.
    SectionKind {
        /// [`SceneInfo`], exactly one.
        Info = 0, "info";
        /// [`Node`]s; the root is node 0. Empty for an empty scene.
        Nodes = 1, "nodes";
        /// [`Leaf`]s.
        Leaves = 2, "leaves";
        /// [`Triangle`]s.
        Triangles = 3, "triangles";
        /// [`Vertex`]es.
        Vertices = 4, "vertices";
        /// [`Material`]s.
        Materials = 5, "materials";
        /// [`Texture`]s.
        Textures = 6, "textures";
        /// `u32` texels: bytes r, g, b, alpha; r, g, b sRGB-encoded.
        Texels = 7, "texels";
        /// `f32` tables that materials refer to.
        Tables = 8, "tables";
        /// [`Light`]s.
        Lights = 9, "lights";
        /// [`Alias`] table over the lights, as many entries as lights; may be empty if no light emits.
        LightAlias = 10, "light alias table";
        /// [`Environment`], none or one.
        Environment = 11, "environment";
        /// `[f32; 3]` radiance texels of the environment map, row 0 first.
        EnvTexels = 12, "environment texels";
        /// [`Alias`] tables of the environment map: one over the cell rows, then one per row over its cells. Empty if
        /// the map is black. Rows of probability 0 may hold any well-formed table.
        EnvAlias = 13, "environment alias tables";
        /// [`Camera`], exactly one.
        Cameras = 14, "camera";
        /// Bytes: names, each ended by a newline, UTF-8: of all materials in their order, then, as far as there are any, of
        /// the world's instances and of the objects of its own triangles ([`Scene::object_of`](crate::Scene::object_of));
        /// or nothing.
        Names = 15, "names";
        /// [`Medium`]s, at most [`MAX_MEDIA`], those of higher priority first.
        Media = 16, "media";
        /// `f32` densities of grid media.
        Densities = 17, "densities";
        /// `f32` majorants of grid media.
        Majorants = 18, "majorants";
        /// [`Object`]s, the world first; empty without instances.
        Objects = 19, "objects";
        /// [`Instance`]s, those of each object in a run.
        Instances = 20, "instances";
        /// [`LightNode`]s of the tree that chooses among lights; none where they are chosen by [`Self::LightAlias`].
        LightNodes = 21, "light nodes";
        /// `u32` trails, as many as lights: where the light tree has them ([`LightNode`]).
        LightTrails = 22, "light trails";
    }
}

/// Header of a blob.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: [u8; 8],
    /// [`VERSION`].
    pub version: u32,
    /// Number of [`Section`]s that follow.
    pub sections: u32,
    /// Bytes in all.
    pub length: u64,
    /// [`content_hash`] of everything after the header; identifies the scene.
    pub hash: u64,
    /// Zero.
    pub reserved: [u32; 8],
}

/// One entry of the section table.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Section {
    /// [`SectionKind`].
    pub kind: u32,
    /// Bytes per record.
    pub stride: u32,
    /// Bytes from the start of the blob, a multiple of [`ALIGN`].
    pub offset: u64,
    /// Number of records.
    pub count: u64,
}

/// Facts about the whole scene.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SceneInfo {
    /// Smallest coordinates of triangles and instances, world space; zeros in an empty scene.
    pub bounds_min: [f32; 3],
    /// Largest coordinates.
    pub bounds_max: [f32; 3],
    /// Path segments from the camera (1 sees emitters only, 2 adds direct light); a default for the settings.
    pub max_depth: u32,
    /// Degenerate triangles that baking dropped.
    pub dropped_triangles: u32,
}

/// Eight child boxes and references. Unused slots hold an empty box (+inf, -inf) and [`NONE`]. Any slots are right;
/// rays that look for any hit try the first ones first, so leaves and large boxes belong there.
///
/// Nodes and leaves are numbered depth-first in preorder, children in slot order: walking the tree from node 0 that way
/// meets nodes 0, 1, 2 ... and, counted apart, leaves 0, 1, 2 ... Each triangle is in exactly one leaf, every vertex
/// inside (closed, exactly) the boxes of all its ancestors, at most [`MAX_TREE_DEPTH`] nodes lie on a path. With
/// instances this holds for each tree of each object, from its first node and leaf on ([`Object`]).
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Rows: min x, min y, min z, max x, max y, max z of the eight children.
    pub bounds: [[f32; 8]; 6],
    /// Child references: a node index, or [`LEAF_BIT`] | count << 27 | leaf index, or [`NONE`].
    pub child: [u32; 8],
    /// Zero.
    pub reserved: [u32; 8],
}

/// Up to eight triangles in the first slots; unused slots hold zeros and [`NONE`].
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Leaf {
    /// Rows: ax, ay, az, bx, by, bz, cx, cy, cz.
    pub p: [[f32; 8]; 9],
    /// Triangle indices.
    pub triangle: [u32; 8],
}

/// One triangle for shading.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Triangle {
    /// Vertex indices; counter-clockwise seen from the front.
    pub vertex: [u32; 3],
    /// Material index.
    pub material: u32,
    /// Light index if it emits, else [`NONE`]. Of an instanced object: its number among the object's emitting triangles.
    pub light: u32,
    /// [`TRIANGLE_SMOOTH`], and the number of the object from bit [`TRIANGLE_OBJECT_SHIFT`] on.
    pub flags: u32,
}

/// Interpolate the vertex normals; else the geometric normal shades.
pub const TRIANGLE_SMOOTH: u32 = 1;

/// First bit of the object's number in [`Triangle::flags`], which auxiliary values show
/// ([`Scene::object_of`](crate::Scene::object_of)); transport does not read it.
pub const TRIANGLE_OBJECT_SHIFT: u32 = 8;

/// One vertex, world space or that of its object.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// Position.
    pub p: [f32; 3],
    /// Unit normal (within 1e-3 of the squared length) where a smooth triangle uses it, else any finite vector.
    pub n: [f32; 3],
    /// Texture coordinates, v upwards.
    pub uv: [f32; 2],
}

kinds! {
    /// Projections of a camera.
    CameraKind {
        /// Pinhole or thin lens.
        Perspective = 0, "perspective";
        /// Parallel rays.
        Orthographic = 1, "orthographic";
        /// Every direction, latitude by longitude.
        Panoramic = 2, "panoramic";
    }
}

/// Camera. A pixel sample is a point (x, y) in [0, width) x [0, height), y down; with X = 2 x / width - 1 and Y = 2 y /
/// height - 1 its ray
///
/// * of a perspective camera looks along `forward + right X + down Y`, from `origin` or a point of the lens,
/// * of an orthographic one begins at `origin + right X + down Y` and runs along `forward`,
/// * of a panoramic one looks from `origin` to longitude `pi X` (0 is `forward`, positive towards `right`) and latitude
///   `pi/2 Y` (positive towards `down`).
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Camera {
    /// [`CameraKind`].
    pub kind: u32,
    /// World position.
    pub origin: [f32; 3],
    /// Unit viewing axis.
    pub forward: [f32; 3],
    /// Vector from the image centre to its right edge: perspective at distance 1, orthographic in world units;
    /// panoramic a unit vector.
    pub right: [f32; 3],
    /// Vector from the image centre to its lower edge, likewise.
    pub down: [f32; 3],
    /// Lens radius; 0 is a pinhole, and 0 for other projections than perspective.
    pub lens_radius: f32,
    /// Distance of the plane in focus along the axis.
    pub focus_distance: f32,
    /// Default image size in pixels.
    pub size: [u32; 2],
}

/// Identifies content: 64-bit FNV-1a over the bytes taken as little-endian 64-bit words, the tail padded with zeros,
/// each step followed by a rotation.
pub fn content_hash(bytes: &[u8]) -> u64 {
    let mut h: u64 = 0xcbf2_9ce4_8422_2325;
    for c in bytes.chunks(8) {
        let mut w = [0u8; 8];
        for (d, s) in w.iter_mut().zip(c) {
            *d = *s;
        }
        h = (h ^ u64::from_le_bytes(w)).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29);
    }
    h
}
