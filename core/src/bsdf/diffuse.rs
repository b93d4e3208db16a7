//! Lambertian reflection: `f = rho / pi`, sampled by the cosine.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `reflectance` | rho per channel, may be textured | `REFLECTANCE_RANGE` |

use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8, warp};
use crate::scene::Scene;
use crate::scene::blob::Material;
use core::f32::consts::FRAC_1_PI;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Lambertian reflection.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    reflectance: Vec3x8,
}

impl Bsdf<'_> for Diffuse {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::DIFFUSE);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Normal;

    #[inline(always)]
    fn gather(_: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        Self { reflectance: inputs.reflectance.zero_unless(active) }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let above = wo.z.gt(F32x8::ZERO) & wi.z.gt(F32x8::ZERO);
        let pdf = wi.z * FRAC_1_PI;
        Eval8 { f: self.reflectance * pdf, pdf }.zero_unless(above)
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, _]: [F32x8; 3]) -> Sample8 {
        let wi = warp::cosine_hemisphere(u, v);
        let pdf = wi.z * FRAC_1_PI;
        let valid = wo.z.gt(F32x8::ZERO);
        Sample8 { wi, weight: self.reflectance, pdf, delta: Mask8::NONE, valid }.masked()
    }

    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        self.reflectance.zero_unless(wo.z.gt(F32x8::ZERO))
    }

    fn shininess(_: &Material) -> f32 {
        0.0
    }
}
