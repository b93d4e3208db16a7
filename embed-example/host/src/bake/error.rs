//! Errors of baking.

use crate::text::{excerpt, number};
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
    /// A texture that only principled materials can use: of numbers, or not repeated.
    TextureUse {
        /// Name of the material.
        material: String,
        /// Name of the texture.
        texture: String,
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
        /// What it must be, in words.
        range: &'static str,
    },
    /// A material that refers to a medium that is not there.
    MediumIndex {
        /// Name of the material.
        material: String,
        /// Index found.
        found: u32,
        /// Number of those that exist.
        count: usize,
    },
    /// A number of a medium out of range.
    Medium {
        /// Name of the medium.
        medium: String,
        /// Parameter.
        what: &'static str,
        /// Value found.
        found: f32,
        /// Range allowed.
        range: [f32; 2],
    },
    /// A density grid whose cells are not those of its values, or too many.
    Grid {
        /// Name of the medium.
        medium: String,
        /// Cells along x, y, z.
        cells: [u32; 3],
        /// Values.
        values: usize,
    },
    /// More media than a path can tell apart.
    Media {
        /// Count found.
        count: usize,
        /// Most that are allowed.
        most: usize,
    },
    /// A medium without a triangle in front of it.
    NoBoundary {
        /// Name of the medium.
        medium: String,
    },
    /// A boundary of a medium that is not closed, or not oriented alike everywhere.
    Leak {
        /// Name of the medium.
        medium: String,
        /// Object with the edge.
        object: String,
        /// Ends of the edge, in the order of the triangle's corners.
        edge: [[f32; 3]; 2],
        /// Times that triangles run along the edge in this direction, and in the other.
        times: [u32; 2],
    },
    /// A closed boundary whose front sides face the medium.
    InsideOut {
        /// Name of the medium.
        medium: String,
        /// Object with the first triangle.
        object: String,
    },
    /// An instance that cannot be.
    Instance {
        /// Name of the instance.
        name: String,
        /// Name of what it places.
        prototype: String,
        /// Fault of the instance.
        what: String,
    },
    /// A prototype that cannot be.
    Prototype {
        /// Name of the prototype.
        name: String,
        /// Fault of the prototype.
        what: String,
    },
    /// More of something than indices of 31 bits can tell apart, or than there may be.
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
                write!(f, "object `{}`: {what} of vertex {vertex} is {}", excerpt(object), number((*found).into()))
            }
            Self::Index { object, triangle, what, found, count } => {
                write!(
                    f,
                    "object `{}`: triangle {triangle} refers to {what} {found}, there are {count}",
                    excerpt(object)
                )
            }
            Self::Material { material, what, found, range: [lo, hi] } => {
                let [found, lo, hi] = [*found, *lo, *hi].map(|x| number(x.into()));
                write!(f, "material `{}`: {what} is {found}, it must be from {lo} to {hi}", excerpt(material))
            }
            Self::TextureIndex { material, found, count } => {
                write!(f, "material `{}` refers to texture {found}, there are {count}", excerpt(material))
            }
            Self::TextureUse { material, texture } => write!(
                f,
                "material `{material}` is not principled: it cannot use texture `{texture}`, which is linear or not repeated"
            ),
            Self::Image { image, size: [w, h], texels } => {
                write!(f, "image `{}` of {w} x {h} pixels with {texels} texels cannot be used", excerpt(image))
            }
            Self::Emitter { emitter, what, found } => write!(f, "{emitter}: {what} is {}", number((*found).into())),
            Self::EmitterMaterial { emitter, found, repeated: true } => {
                write!(f, "{emitter}: material {found} already emits")
            }
            Self::EmitterMaterial { emitter, found, repeated: false } => {
                write!(f, "{emitter}: there is no material {found}")
            }
            Self::Rotation => write!(f, "environment: `to_world` is not a rotation"),
            Self::Camera { what, found, range } => {
                write!(f, "camera: {what} is {}, it must be {range}", number(*found))
            }
            Self::MediumIndex { material, found, count } => {
                write!(f, "material `{}` refers to medium {found}, there are {count}", excerpt(material))
            }
            Self::Medium { medium, what, found, range: [lo, hi] } => {
                let [found, lo, hi] = [*found, *lo, *hi].map(|x| number(x.into()));
                write!(f, "medium `{}`: {what} is {found}, it must be from {lo} to {hi}", excerpt(medium))
            }
            Self::Grid { medium, cells: [x, y, z], values } => {
                write!(
                    f,
                    "medium `{}`: a grid of {x} x {y} x {z} cells with {values} values cannot be used",
                    excerpt(medium)
                )
            }
            Self::Media { count, most } => write!(f, "{count} media are too many, there may be {most}"),
            Self::NoBoundary { medium } => write!(f, "medium `{}`: no triangle bounds it", excerpt(medium)),
            Self::Leak { medium, object, edge: [a, b], times: [there, back] } => write!(
                f,
                "medium `{}`: its boundary is not closed: object `{}` has an edge from {a:?} to {b:?} \
                 (triangles that way: {there}, the other way: {back})",
                excerpt(medium),
                excerpt(object)
            ),
            Self::InsideOut { medium, object } => {
                write!(
                    f,
                    "medium `{}`: the front sides of its boundary (object `{}`) face inwards",
                    excerpt(medium),
                    excerpt(object)
                )
            }
            Self::Instance { name, prototype, what } => write!(f, "instance `{name}` of `{prototype}`: {what}"),
            Self::Prototype { name, what } => write!(f, "prototype `{name}`: {what}"),
            Self::TooMany { what, count } => write!(f, "{count} {what} are too many"),
        }
    }
}

impl error::Error for BakeError {}
