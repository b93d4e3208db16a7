//! The scene blob: Pod sections in one block of bytes, validated once, read in place.

pub mod blob;
mod effects;
mod view;

pub use effects::Effects;
pub use view::{Scene, SceneError};
