//! Changes of a scene in memory between frames: camera, materials, lights and environment, each in a time that does not
//! depend on the size of the scene's geometry, textures and maps.
//!
//! | file | holds |
//! |---|---|
//! | `editable` | [`EditableScene`]: a validated blob that may change |
//! | `light_table` | the table that chooses among lights, built in place |

mod editable;
mod light_table;

pub use editable::{EditError, EditableScene, SceneEdit};
