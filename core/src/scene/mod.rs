//! The scene blob: Pod sections in one block of bytes, validated once, read in place.
//!
//! [`blob`] is the layout, `sections` finds the records, `validate` proves what everything downstream relies on
//! (`tree`, `instances`, `geometry`, `media`, `materials`, `lights`, `environment`, one file each), `view` is what is left:
//! slices, of which `gather` reads the records of eight lanes. [`derive`] says what the transforms of an instance determine.
//! Caller's data is handled with checked arithmetic and checked access only.
#![deny(clippy::arithmetic_side_effects, clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

pub mod blob;
mod effects;
mod error;
mod gather;
mod instances;
mod records;
mod sections;
mod validate;
mod view;

pub use effects::Effects;
pub use error::{ChildFault, Field, ObjectFault, SceneError, SectionFault, SlotFault};
pub(crate) use gather::gather;
pub(crate) use instances::inverse;
pub use instances::{Derived, InstanceFault, derive};
pub use records::Records;
pub(crate) use sections::{SectionTable, Sections};
pub(crate) use validate::single as check;
pub use view::Scene;
