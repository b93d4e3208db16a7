//! Eight rays on their way to the next vertex, and what they carry.

use super::path::Path8;
use crate::geometry::Ray8;
use crate::rng::Key8;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// One ray per lane, from the camera or from a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayState8 {
    /// Lanes with a ray.
    pub active: Mask8,
    /// The rays; unit directions.
    pub ray: Ray8,
    /// Vertices that the rays left (before the offset), from where light sampling could have found what they hit.
    pub from: Vec3x8,
    /// Geometric normals there.
    pub normal: Vec3x8,
    /// Prefix weight including the bounce.
    pub beta: Vec3x8,
    /// Weight of the bounce alone, `f cos / pdf`.
    pub weight: Vec3x8,
    /// Solid-angle density of the direction.
    pub pdf: F32x8,
    /// Lanes that light sampling cannot reach (camera rays, specular bounces): emission counts in full.
    pub skip_mis: Mask8,
    /// Whose rays these are; the segment counts in their depth.
    pub path: Path8,
    /// Random keys of the vertices to come.
    pub key: Key8,
    /// Product of the albedos of the vertices so far.
    pub albedo_product: F32x8,
    /// See [`PixelTarget::error_weight`](super::root::PixelTarget::error_weight).
    pub error_weight: Vec3x8,
}
