//! Errors of baking.

use std::{error, fmt};

/// Error in a [`crate::description::SceneDescription`]; every text names the object.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum BakeError {
    /// A coordinate that is not finite, or too large.
    Vertex {
        /// Object that uses it first.
        object: String,
        /// Vertex index.
        vertex: u32,
        /// `position`, `normal` or `texture coordinate`.
        what: &'static str,
        /// Value found.
        found: f32,
    },
    /// A triangle that refers to a vertex or material that is not there.
    Index {
        /// Object.
        object: String,
        /// Triangle index.
        triangle: u32,
        /// `vertex` or `material`.
        what: &'static str,
        /// Index found.
        found: u32,
        /// Number of those that exist.
        count: usize,
    },
    /// A parameter of a material out of range.
    Material {
        /// Name of the material.
        material: String,
        /// Parameter.
        what: &'static str,
        /// Value found.
        found: f32,
        /// Range allowed.
        range: [f32; 2],
    },
    /// A material that refers to a texture that is not there.
    TextureIndex {
        /// Name of the material.
        material: String,
        /// Index found.
        found: u32,
        /// Number of those that exist.
        count: usize,
    },
    /// A texture or environment map whose size is not allowed or not that of its texels.
    Image {
        /// Name of the image.
        image: String,
        /// Columns and rows.
        size: [u32; 2],
        /// Texels.
        texels: usize,
    },
    /// A number of an emitter or of the environment.
    Emitter {
        /// Position and type of the emitter.
        emitter: String,
        /// `radiance`, `position`, ...
        what: &'static str,
        /// Value found.
        found: f32,
    },
    /// An area emitter on a material that is not there or that already has one.
    EmitterMaterial {
        /// Position and type of the emitter.
        emitter: String,
        /// Material index.
        found: u32,
        /// Whether it is the second emitter of the material.
        repeated: bool,
    },
    /// The environment's `to_world` is not a rotation.
    Rotation,
    /// A number of the camera.
    Camera {
        /// Name of the number.
        what: &'static str,
        /// Value found.
        found: f64,
    },
    /// More of something than indices of 31 bits can tell apart.
    TooMany {
        /// Plural of the thing.
        what: &'static str,
        /// Count found.
        count: usize,
    },
}

impl fmt::Display for BakeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Vertex { object, vertex, what, found } => {
                write!(f, "object `{object}`: {what} of vertex {vertex} is {found}")
            }
            Self::Index { object, triangle, what, found, count } => {
                write!(f, "object `{object}`: triangle {triangle} refers to {what} {found}, there are {count}")
            }
            Self::Material { material, what, found, range: [lo, hi] } => {
                write!(f, "material `{material}`: {what} is {found}, it must be from {lo} to {hi}")
            }
            Self::TextureIndex { material, found, count } => {
                write!(f, "material `{material}` refers to texture {found}, there are {count}")
            }
            Self::Image { image, size: [w, h], texels } => {
                write!(f, "image `{image}` of {w} x {h} pixels with {texels} texels cannot be used")
            }
            Self::Emitter { emitter, what, found } => write!(f, "{emitter}: {what} is {found}"),
            Self::EmitterMaterial { emitter, found, repeated: true } => {
                write!(f, "{emitter}: material {found} already emits")
            }
            Self::EmitterMaterial { emitter, found, repeated: false } => {
                write!(f, "{emitter}: there is no material {found}")
            }
            Self::Rotation => write!(f, "environment: `to_world` is not a rotation"),
            Self::Camera { what, found } => write!(f, "camera: {what} is {found}"),
            Self::TooMany { what, count } => write!(f, "{count} {what} are too many"),
        }
    }
}

impl error::Error for BakeError {}
