//! Thin dielectric sheet: both interfaces at once. Summing all inner reflections, it reflects R' = 2R / (1 + R) and
//! passes the rest straight on ([`Bsdf::straight`]); the two 1 / eta^2 factors cancel.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `eta[0]` | int_ior / ext_ior | `ETA_RANGE` |

use super::fresnel::{self, Index8};
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8, lobes, mirrored};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Thin dielectric sheet.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric(Index8);

impl Bsdf<'_> for ThinDielectric {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::TRANSMISSION).with(Lobes::SPECULAR).with(Lobes::STRAIGHT);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::View;

    #[inline(always)]
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        Self(Index8::gather(scene, inputs, active))
    }

    #[inline(always)]
    fn eval(&self, _: Vec3x8, _: Vec3x8) -> Eval8 {
        Eval8::ZERO
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, _: [F32x8; 3]) -> Sample8 {
        Sample8::delta(mirrored(wo), Vec3x8::ONE, wo.z.abs().gt(F32x8::ZERO))
    }

    /// 1 - R'.
    #[inline(always)]
    fn straight(&self, wo: Vec3x8) -> F32x8 {
        let cos = wo.z.abs();
        let r = fresnel::dielectric(cos, self.0).reflectance;
        cos.gt(F32x8::ZERO).zero_unless(1.0 - (r + r) / (1.0 + r))
    }

    /// 1: no energy is lost.
    #[inline(always)]
    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        Vec3x8::ONE
    }

    fn shininess(_: &Material) -> f32 {
        lobes::MIRROR_SHININESS
    }
}
