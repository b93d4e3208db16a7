//! Kinds of vertices whose statistics are kept apart.

/// Kinds of vertices, each with an octree of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    /// Diffuse, keyed by the shading normal.
    Diffuse = 0,
    /// All others, keyed by the direction that decides what they show.
    Glossy = 1,
    /// Diffuse ones that the camera sees. Their values are in units of their pixel.
    FirstDiffuse = 2,
    /// The other ones that the camera sees.
    FirstGlossy = 3,
}
