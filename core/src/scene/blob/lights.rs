//! Lights, the environment and alias tables: the records, and the tables of what readers and writers of a blob know
//! about each kind.
//!
//! A light is a row of `light_table` here, a file `light/NAME.rs`, and a row of `models!` in `light/mod.rs`. From the
//! row here follow its effects and the validator's checks.

use bytemuck::{Pod, Zeroable};

/// Largest emission (radiance, intensity or irradiance, any channel): its square still fits `f32`.
pub const MAX_EMISSION: f32 = 1e18;

/// Most lights with shapes: every ray is tested against each of them.
pub const MAX_SHAPE_LIGHTS: usize = 1024;
/// Range of the radius and of the length of half an edge of a light with a shape. The solid-angle density of the smallest
/// light seen from the largest distance still fits `f32`.
pub const SHAPE_SIZE_RANGE: [f32; 2] = [1e-9, 1e9];
/// A rectangle or disk emits from its back, too; a sphere also to its inside.
pub const SHAPE_TWO_SIDED: u32 = 1;
/// Camera rays do not see the light; all others do.
pub const SHAPE_HIDDEN: u32 = 2;

/// The light kinds, one row each, handed to the macro `$then`: kind and number in the blob, name, effects of which a
/// kernel needs at least one to sample it, and the fields of the record that it uses.
macro_rules! light_table {
    ($then:ident) => {
        $then! {
            /// Emitting triangle (its front side).
            Area = 0, "area", [AREA_LIGHTS], [Triangle, Emission];
            /// Environment, map or constant.
            Environment = 1, "environment", [ENVIRONMENT, CONSTANT], [Environment];
            /// Isotropic point.
            Point = 2, "point", [DELTA_LIGHTS], [Position, Emission];
            /// Parallel light.
            Directional = 3, "directional", [DELTA_LIGHTS], [Direction, Emission];
            /// Point that shines into a cone.
            Spot = 4, "spot", [DELTA_LIGHTS], [Position, Cone, Emission];
            /// Parallel light with the spread of a distant disk.
            Sun = 5, "sun", [DELTA_LIGHTS], [Direction, Disk, Emission];
            /// Sphere that emits to its outside.
            Sphere = 6, "sphere", [SHAPE_LIGHTS], [Shape, Position, Radius, Emission];
            /// Rectangle that emits from its front.
            Rectangle = 7, "rectangle", [SHAPE_LIGHTS], [Shape, Position, HalfEdges, Emission];
            /// Disk that emits from its front.
            Disk = 8, "disk", [SHAPE_LIGHTS], [Shape, Position, Circle, Emission];
        }
    };
}
pub(crate) use light_table;

/// The environment kinds, one row each, handed to the macro `$then`: kind and number in the blob, name in scene files,
/// effect.
macro_rules! environment_table {
    ($then:ident) => {
        $then! {
            /// Constant radiance.
            Constant = 0, "constant", CONSTANT;
            /// Lat-long map.
            Map = 1, "envmap", ENVIRONMENT;
        }
    };
}
pub(crate) use environment_table;

macro_rules! define_lights {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal, [$($effect:ident),*], [$($field:ident),*];)*) => {
        kinds! {
            /// Light kinds.
            LightKind { $($(#[$doc])* $kind = $number, $name;)* }
        }

        impl LightKind {
            /// Fields of [`Light`] that it uses.
            pub const fn fields(self) -> &'static [LightField] {
                match self { $(Self::$kind => &[$(LightField::$field),*]),* }
            }
        }
    };
}
light_table!(define_lights);

macro_rules! define_environments {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal, $effect:ident;)*) => {
        kinds! {
            /// Environment kinds.
            EnvironmentKind { $($(#[$doc])* $kind = $number, $name;)* }
        }
    };
}
environment_table!(define_environments);

/// Fields of a [`Light`] that a kind may use, a closed set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightField {
    /// `triangle`, `area` and `instance`: a triangle that refers back, its area, and the instance that it is in.
    Triangle,
    /// The scene's one [`Environment`], which refers back; it holds what is emitted, and which effect that is.
    Environment,
    /// `vector`: a position.
    Position,
    /// `vector`: the unit direction towards the light.
    Direction,
    /// `emission`, up to [`MAX_EMISSION`].
    Emission,
    /// `params`: the unit axis along which the light travels, 1 - cos of the outer and of the inner half angle.
    Cone,
    /// `params`: 1 - cos of the angular radius of a disk at infinity.
    Disk,
    /// `triangle`: flags of a light with a shape, [`SHAPE_TWO_SIDED`] and [`SHAPE_HIDDEN`]. Such lights come last in
    /// their section, and are at most [`MAX_SHAPE_LIGHTS`].
    Shape,
    /// `params`: a radius.
    Radius,
    /// `params`: two vectors, perpendicular to 1e-3, from the middle of a rectangle to the middles of two edges; the
    /// front is where their cross product points.
    HalfEdges,
    /// `params`: the unit normal of the front of a disk, its radius.
    Circle,
}

impl LightKind {
    /// Has a light of this kind a shape that rays may meet, without triangles?
    pub const fn has_shape(self) -> bool {
        matches!(self.fields(), [LightField::Shape, ..])
    }
}

/// One light, a cache line; fields a kind does not use are 0.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Light {
    /// [`LightKind`].
    pub kind: u32,
    /// Area: index of the triangle. Sphere, rectangle, disk: flags, [`SHAPE_TWO_SIDED`] and [`SHAPE_HIDDEN`].
    pub triangle: u32,
    /// Area: area of the triangle, world units squared; in a moving instance, when the shutter opens.
    pub area: f32,
    /// Area: 1 + index of the world's [`super::Instance`] that the triangle is in; 0 if it is the world's own.
    pub instance: u32,
    /// Point, spot: position. Sphere, rectangle, disk: middle. Directional, sun: unit direction towards the light.
    pub vector: [f32; 3],
    /// Area, sphere, rectangle, disk: radiance. Point: intensity. Spot: intensity on the axis. Directional, sun: irradiance on a facing surface.
    pub emission: [f32; 3],
    /// Spot: unit axis, 1 - cos of the outer and of the inner half angle, 0. Sun: 1 - cos of its angular radius, then 0.
    /// Sphere: radius, then 0. Rectangle: two halves of edges. Disk: unit normal, radius, 0. Others: zero, room for kinds
    /// to come, so that they need no other version of the blob.
    pub params: [f32; 6],
}

/// Entry of an alias table over n items (Vose 1991) with integer thresholds: a 32-bit number r picks slot
/// `i = (r * n) >> 32` and keeps it if the low word `(r * n) as u32 < threshold`, else takes `alias`. A threshold of
/// `u32::MAX` means "always keep" and has `alias == i`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Alias {
    /// Keep slot i below this.
    pub threshold: u32,
    /// Item that is picked instead of i.
    pub alias: u32,
    /// Probability of item i over all slots.
    pub probability: f32,
}

/// Environment of the scene.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Environment {
    /// [`EnvironmentKind`].
    pub kind: u32,
    /// Index of the environment's light.
    pub light: u32,
    /// Map: columns, >= 1.
    pub width: u32,
    /// Map: rows, >= 2.
    pub height: u32,
    /// Map: rows of the rotation world -> map space.
    pub to_local: [[f32; 3]; 3],
    /// Constant: radiance. Map: scale.
    pub radiance: [f32; 3],
}

const _: () = assert!(size_of::<Light>() == 64);
