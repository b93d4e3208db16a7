//! Eight rays on their way to the next vertex, and what they carry.

use crate::accel::Ray8;
use crate::rng::Key8;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// One ray per lane, from the camera or from a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayState8 {
    /// Lanes in the air.
    pub active: Mask8,
    /// The rays; unit directions.
    pub ray: Ray8,
    /// The vertex they left (before the offset), from where light sampling could have found what they hit.
    pub from: Vec3x8,
    /// Geometric normal there.
    pub normal: Vec3x8,
    /// Prefix weight including the bounce.
    pub beta: Vec3x8,
    /// The bounce's own weight.
    pub weight: Vec3x8,
    /// Solid-angle density of the direction.
    pub pdf: F32x8,
    /// Lanes that light sampling cannot reach: emission counts in full.
    pub alone: Mask8,
    /// Root slots.
    pub root: U32x8,
    /// Ledger records of the samples that they are.
    pub ledger: U32x8,
    /// Random keys of the vertices to come.
    pub key: Key8,
    /// Path segments including this one.
    pub depth: U32x8,
    /// Product of the albedos of the vertices so far.
    pub albedo_product: F32x8,
    /// See [`Target::error_weight`](super::root::Target::error_weight).
    pub error_weight: Vec3x8,
}
