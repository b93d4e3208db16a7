//! The place of a host's own scattering model: materials of kind `own`, whose kernel is
//! [`Extension::Bsdf`](crate::unstable::extension::Extension::Bsdf).
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `reflectance` | per channel, or a texture | `REFLECTANCE_RANGE` |
//! | `alpha` | as the model takes it | `ALPHA_RANGE` |
//!
//! The other numbers of the record are the model's to use; they are finite.
//!
//! What the tracer knows of such a material without asking the model: it scatters to both sides, is no delta lobe, lets
//! nothing pass straight on, and its statistics are keyed by the mirror direction.

use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// No model: black.
#[derive(Clone, Copy, Debug)]
pub struct NoBsdf;

impl<'s> Bsdf<'s> for NoBsdf {
    const LOBES: Lobes = Lobes::GLOSSY.with(Lobes::TRANSMISSION);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;

    fn gather(_: &Scene<'s>, _: &Inputs8, _: Mask8) -> Self {
        Self
    }

    fn eval(&self, _: Vec3x8, _: Vec3x8) -> Eval8 {
        Eval8::ZERO
    }

    fn sample(&self, _: Vec3x8, _: [F32x8; 3]) -> Sample8 {
        Sample8 {
            wi: Vec3x8::splat(0.0, 0.0, 1.0),
            weight: Vec3x8::ZERO,
            pdf: F32x8::ZERO,
            delta: Mask8::NONE,
            valid: Mask8::NONE,
        }
    }

    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        Vec3x8::ZERO
    }

    fn shininess(_: &Material) -> f32 {
        0.0
    }
}
