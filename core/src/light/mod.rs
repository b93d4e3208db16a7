//! Emission and its sampling.

use crate::scene::Scene;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// One light sample per lane, seen from the reference points.
#[derive(Clone, Copy, Debug)]
pub struct LightSample8 {
    /// Unit direction to the light, world space.
    pub wi: Vec3x8,
    /// Point on the light; for the environment and directional lights meaningless (see `infinite`).
    pub point: Vec3x8,
    /// Geometric unit normal of an area light at `point`.
    pub normal: Vec3x8,
    /// Rounding error bound of `point` along `normal`, world units (NUMERICS OFF-1).
    pub point_error: F32x8,
    /// Radiance towards the reference point; delta lights: irradiance at normal incidence.
    pub radiance: Vec3x8,
    /// Selection probability times solid-angle density; delta lights: the selection probability.
    pub pdf: F32x8,
    /// Lanes whose light no scattered ray can hit.
    pub delta: Mask8,
    /// Lanes whose light is at infinity along `wi`.
    pub infinite: Mask8,
    /// Lanes with a usable sample.
    pub valid: Mask8,
}

/// How a light is chosen for a reference point; a light tree can replace the power-weighted table.
pub trait LightSelector {
    /// Light index and its probability from a 32-bit random number.
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8) -> (U32x8, F32x8);

    /// Probability that [`Self::select`] picks `light` in the lanes of `mask`.
    fn probability(&self, point: Vec3x8, normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8;
}

/// Power-weighted selection through the scene's alias table.
#[derive(Clone, Copy, Debug)]
pub struct PowerSelector<'s>(pub Scene<'s>);
