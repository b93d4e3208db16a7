//! Errors of composing.

use crate::memory::MemoryError;
use crate::scene::blob::SectionKind;
use crate::scene::{Field, SceneError};
use core::fmt;

/// Reason why no scene can be composed of some parts. Records are numbered as in the arrays that were given.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ComposeError {
    /// A record that breaks a rule of the blob: its section, its number, and what is wrong with it.
    Scene(SceneError),
    /// An array that must have an entry for each record of another one, or be empty.
    Length {
        /// What it states.
        what: PerRecord,
        /// Entries found.
        found: usize,
        /// Records that there are.
        records: usize,
    },
    /// More records than a blob can hold.
    TooMany {
        /// Section.
        of: SectionKind,
        /// Records found.
        found: usize,
        /// Most records.
        most: usize,
    },
    /// A light of a kind that is not given as a record: emitting triangles follow from
    /// [`SceneParts::emission`](super::SceneParts::emission), the environment from
    /// [`SceneParts::environment`](super::SceneParts::environment).
    Light {
        /// Light.
        index: u32,
    },
    /// A medium with a density grid, which only baking can tabulate.
    Grid {
        /// Medium.
        index: u32,
    },
    /// A material whose tables composing does not compute: principled, or without a table of its own though
    /// compensated.
    Tables {
        /// Material.
        index: u32,
    },
    /// The block for the blob is too small or misaligned.
    Blob(MemoryError),
    /// The block for intermediate results is too small or misaligned.
    Scratch(MemoryError),
}

/// What an array states about each record of another array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PerRecord {
    /// Normals of vertices.
    Normals,
    /// Texture coordinates of vertices.
    Uvs,
    /// Materials of triangles.
    TriangleMaterials,
    /// Radiance of materials.
    Emission,
}

impl PerRecord {
    const fn names(self) -> [&'static str; 2] {
        match self {
            Self::Normals => ["normals", "vertices"],
            Self::Uvs => ["texture coordinates", "vertices"],
            Self::TriangleMaterials => ["material indices", "triangles"],
            Self::Emission => ["emitted radiances", "materials"],
        }
    }
}

impl fmt::Display for ComposeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Scene(e) => write!(f, "{e}"),
            Self::Length { what, found, records } => {
                let [what, of] = what.names();
                write!(f, "{found} {what} for {records} {of}: one for each, or none")
            }
            Self::TooMany { of, found, most } => write!(f, "{found} {}, at most {most} are possible", of.name()),
            Self::Light { index } => {
                write!(f, "lights[{index}]: emitting triangles and the environment are not given as records of lights")
            }
            Self::Grid { index } => write!(f, "media[{index}]: media with density grids must be baked"),
            Self::Tables { index } => write!(f, "materials[{index}]: its tables must be given, they are not derived"),
            Self::Blob(e) => write!(f, "blob: {e}"),
            Self::Scratch(e) => write!(f, "scratch: {e}"),
        }
    }
}

impl core::error::Error for ComposeError {}

impl From<SceneError> for ComposeError {
    fn from(e: SceneError) -> Self {
        Self::Scene(e)
    }
}

/// A number that a record cannot have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldError {
    /// Field of the record.
    pub field: Field,
    /// Value found.
    pub found: f32,
}

impl fmt::Display for FieldError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {}, out of range", self.field.name(), self.found)
    }
}

impl core::error::Error for FieldError {}
