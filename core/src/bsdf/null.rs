//! Index-matched boundary: all light passes straight on ([`Bsdf::straight`]), so that nothing is scattered. No
//! parameters.

use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8, lobes};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Index-matched boundary.
#[derive(Clone, Copy, Debug)]
pub struct Null;

impl Bsdf<'_> for Null {
    const LOBES: Lobes = Lobes::TRANSMISSION.with(Lobes::SPECULAR).with(Lobes::STRAIGHT);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::View;

    #[inline(always)]
    fn gather(_: &Scene<'_>, _: &Inputs8, _: Mask8) -> Self {
        Self
    }

    #[inline(always)]
    fn eval(&self, _: Vec3x8, _: Vec3x8) -> Eval8 {
        Eval8::ZERO
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, _: [F32x8; 3]) -> Sample8 {
        Sample8::delta(-wo, Vec3x8::ZERO, Mask8::NONE)
    }

    /// 1.
    #[inline(always)]
    fn straight(&self, _: Vec3x8) -> F32x8 {
        F32x8::ONE
    }

    /// 1.
    #[inline(always)]
    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        Vec3x8::ONE
    }

    fn shininess(_: &Material) -> f32 {
        lobes::MIRROR_SHININESS
    }
}
