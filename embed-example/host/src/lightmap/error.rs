//! Why there is no lightmap.

use crate::bake::BakeError;
use crate::drive::DriveError;
use crate::text::excerpt;
use std::fmt;

/// Most texels of a map.
pub const MAX_TEXELS: u64 = 1 << 28;

/// Error of a lightmap; every text names the object.
#[derive(Debug)]
#[non_exhaustive]
pub enum LightmapError {
    /// No object or instance has the name.
    NoObject {
        /// Name that was asked for.
        object: String,
        /// Names that there are.
        known: Vec<String>,
    },
    /// The object is in the world through instances only.
    InPrototype {
        /// Name that was asked for.
        object: String,
        /// Prototype that it is part of.
        prototype: String,
    },
    /// No triangle of the object has an area in texture coordinates.
    NoCoordinates {
        /// Object.
        object: String,
        /// Its triangles.
        triangles: usize,
    },
    /// Texture coordinates outside of the unit square.
    Outside {
        /// Object.
        object: String,
        /// Triangles with such a corner.
        triangles: usize,
        /// Triangles of the object.
        of: usize,
    },
    /// The blob was not baked from the description that the surface is of.
    OtherScene {
        /// Triangles of the blob.
        given: usize,
        /// Triangles of the description that are baked.
        wanted: usize,
    },
    /// A map without texels, or with too many.
    Size {
        /// Columns and rows.
        size: [u32; 2],
    },
    /// The description cannot be baked.
    Bake(BakeError),
    /// The render failed.
    Drive(DriveError),
}

/// Most names that a message lists.
const LISTED: usize = 8;

impl fmt::Display for LightmapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoObject { object, known } => {
                write!(f, "there is no object `{}`", excerpt(object))?;
                let listed: Vec<String> =
                    known.iter().take(LISTED).map(|n| format!("`{}`", excerpt_short(n))).collect();
                let more = if known.len() > LISTED { ", ..." } else { "" };
                if listed.is_empty() { Ok(()) } else { write!(f, "; there are {}{more}", listed.join(", ")) }
            }
            Self::InPrototype { object, prototype } => {
                let (object, prototype) = (excerpt(object), excerpt(prototype));
                write!(f, "object `{object}` is part of the prototype `{prototype}`: name one of its instances")
            }
            Self::NoCoordinates { object, triangles } => write!(
                f,
                "object `{}` has no texture coordinates: none of its {triangles} triangles has an area in them",
                excerpt(object)
            ),
            Self::Outside { object, triangles, of } => write!(
                f,
                "object `{}`: {triangles} of {of} triangles have texture coordinates outside of 0 to 1, where the map is",
                excerpt(object)
            ),
            Self::OtherScene { given, wanted } => {
                write!(f, "the baked scene has {given} triangles, the description of the surface {wanted}")
            }
            Self::Size { size: [width, height] } => {
                write!(f, "a map of {width}x{height} texels: there must be 1 to {MAX_TEXELS}")
            }
            Self::Bake(e) => e.fmt(f),
            Self::Drive(e) => e.fmt(f),
        }
    }
}

/// A name in a list of names.
fn excerpt_short(name: &str) -> String {
    let text = excerpt(name);
    if text.chars().count() <= 24 { text.into_owned() } else { text.chars().take(21).chain("...".chars()).collect() }
}

impl std::error::Error for LightmapError {}

impl From<BakeError> for LightmapError {
    fn from(e: BakeError) -> Self {
        Self::Bake(e)
    }
}

impl From<DriveError> for LightmapError {
    fn from(e: DriveError) -> Self {
        Self::Drive(e)
    }
}
