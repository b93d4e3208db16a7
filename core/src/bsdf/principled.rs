//! Principled material: layers of sheen, coat, metal, dielectric, transmission and a diffuse base. Not complete yet:
//! the diffuse base alone.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `reflectance` | base colour, before texturing | `REFLECTANCE_RANGE` |
//! | `table` | record of the other parameters; most are from 0 to 1 | `REFLECTANCE_RANGE` |

use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8, flip, warp};
use crate::scene::Scene;
use crate::scene::blob::Material;
use core::f32::consts::FRAC_1_PI;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Principled material.
#[derive(Clone, Copy, Debug)]
pub struct Principled {
    reflectance: Vec3x8,
}

impl Bsdf<'_> for Principled {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::TRANSMISSION).with(Lobes::DIFFUSE).with(Lobes::GLOSSY);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;

    #[inline(always)]
    fn gather(_: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        Self { reflectance: inputs.reflectance.zero_unless(active) }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let pdf = wi.z.abs() * FRAC_1_PI;
        Eval8 { f: self.reflectance * pdf, pdf }.zero_unless((wo.z * wi.z).gt(F32x8::ZERO))
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, _]: [F32x8; 3]) -> Sample8 {
        let wi = warp::cosine_hemisphere(u, v);
        let pdf = wi.z * FRAC_1_PI;
        let valid = wo.z.abs().gt(F32x8::ZERO);
        let wi = flip(wi, wo.z.lt(F32x8::ZERO));
        Sample8 { wi, weight: self.reflectance, pdf, delta: Mask8::NONE, valid }.masked()
    }

    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        self.reflectance.zero_unless(wo.z.abs().gt(F32x8::ZERO))
    }

    fn shininess(_: &Material) -> f32 {
        0.0
    }
}
