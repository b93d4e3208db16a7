//! Changes of a scene in memory between frames: camera, materials, lights and environment, each in a time that does not
//! depend on the size of the scene's geometry, textures and maps.
//!
//! | file | holds |
//! |---|---|
//! | `editable` | [`EditableScene`]: a validated blob that may change; edits of camera, lights and environment |
//! | `materials` | edits of materials and their tables |
//! | `instances` | edits of instances, and what follows from them |
//! | `light_table` | the table that chooses among lights, built in place |

mod editable;
mod error;
mod instances;
pub(crate) mod light_table;
mod materials;

pub use editable::{EditableScene, SceneEdit};
pub use error::EditError;
