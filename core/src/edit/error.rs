//! Why an edit is refused.

use crate::scene::blob::SectionKind;
use crate::scene::{InstanceFault, SceneError};
use core::fmt;

/// Why a record of a scene cannot be replaced.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum EditError {
    /// The scene has no such record.
    Missing {
        /// Section that was meant.
        of: SectionKind,
        /// Index that was asked for.
        index: u32,
    },
    /// The new record breaks a rule of the blob.
    Invalid(SceneError),
    /// The new record differs in what cannot change without baking: the light's kind, triangle or area, the
    /// environment's kind or size, the size of the material's tables, principled materials in place of others.
    Fixed {
        /// Section that was meant.
        of: SectionKind,
        /// Index that was asked for.
        index: u32,
    },
    /// New tables for a material would change what another one reads.
    Shared {
        /// Material that was meant.
        material: u32,
        /// Material that reads them too.
        with: u32,
    },
    /// Too little memory to build a tree in.
    Room {
        /// Primitives that room is needed for.
        needed: usize,
        /// Primitives that there is room for.
        given: usize,
    },
    /// A transform that an instance cannot have, or that the instance of the world that places the moved one cannot have then.
    Transform {
        /// Instance that was meant.
        index: u32,
        /// What is wrong.
        fault: InstanceFault,
    },
}

impl fmt::Display for EditError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { of, index } => write!(f, "edit: the scene has no record {index} of {}", of.name()),
            Self::Invalid(e) => write!(f, "edit: {e}"),
            Self::Fixed { of, index } => {
                write!(f, "edit: record {index} of {} differs in what only baking can change", of.name())
            }
            Self::Shared { material, with } => {
                write!(f, "edit: material {with} reads the tables of material {material} too")
            }
            Self::Room { needed, given } => {
                write!(f, "edit: a tree over {needed} instances needs room for as many primitives, not {given}")
            }
            Self::Transform { index, fault } => write!(f, "edit: transform of instance {index}: {fault}"),
        }
    }
}

impl core::error::Error for EditError {}

impl From<SceneError> for EditError {
    fn from(e: SceneError) -> Self {
        Self::Invalid(e)
    }
}
