//! Scattering models in the local shading frame: +z is the shading normal, `wo` points to the viewer, `wi` to where the
//! path goes on (or to the light). All directions are unit vectors. Radiance transport.

use crate::scene::Scene;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Value of `f(wo, wi) |cos wi|` and the solid-angle density of sampling `wi`.
#[derive(Clone, Copy, Debug)]
pub struct Eval8 {
    /// `f |cos|`, 1/sr; 0 for delta lobes.
    pub f: Vec3x8,
    /// Density of [`Bsdf::sample`]'s non-delta part, 1/sr, lobe probabilities included.
    pub pdf: F32x8,
}

/// One sampled direction per lane.
#[derive(Clone, Copy, Debug)]
pub struct Sample8 {
    /// Local direction, unit.
    pub wi: Vec3x8,
    /// `f |cos| / pdf` (delta lobes: their weight over the lobe's probability).
    pub weight: Vec3x8,
    /// Solid-angle density, as [`Eval8::pdf`]; meaningless in delta lanes.
    pub pdf: F32x8,
    /// Lanes that sampled a delta lobe.
    pub delta: Mask8,
    /// Lanes with a usable sample; others scatter nothing (weight 0).
    pub valid: Mask8,
}

/// What a model reads per lane.
#[derive(Clone, Copy, Debug)]
pub struct Inputs8 {
    /// Material index.
    pub material: U32x8,
    /// Reflectance after texturing.
    pub reflectance: Vec3x8,
}

/// One scattering model over eight lanes. Two-sidedness is the caller's: for two-sided materials the frame already
/// faces `wo`.
pub trait Bsdf: Copy {
    /// Only delta lobes: no light sampling.
    const DELTA: bool;

    /// Gathers the parameters of the lanes in `active`; other lanes may hold any material index.
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self;

    /// Value and density of the non-delta part.
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8;

    /// Samples `wi` with three numbers in [0, 1).
    fn sample(&self, wo: Vec3x8, u: [F32x8; 3]) -> Sample8;

    /// Directional-hemispherical reflectance + transmittance to use in roulette by albedo; an estimate in [0, 1].
    fn albedo(&self, wo: Vec3x8) -> Vec3x8;
}
