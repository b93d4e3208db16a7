//! Perfect reflection without Fresnel.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `reflectance` | reflected fraction per channel, may be textured | `REFLECTANCE_RANGE` |

use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8, lobes, mirrored};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Perfect mirror.
#[derive(Clone, Copy, Debug)]
pub struct HenyeyGreenstein {
    reflectance: Vec3x8,
}

impl Bsdf<'_> for HenyeyGreenstein {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::SPECULAR);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::View;

    #[inline(always)]
    fn gather(_: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        Self { reflectance: inputs.reflectance.zero_unless(active) }
    }

    #[inline(always)]
    fn eval(&self, _: Vec3x8, _: Vec3x8) -> Eval8 {
        Eval8::ZERO
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, _: [F32x8; 3]) -> Sample8 {
        Sample8::delta(mirrored(wo), self.reflectance, wo.z.gt(F32x8::ZERO))
    }

    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        self.reflectance.zero_unless(wo.z.gt(F32x8::ZERO))
    }

    fn shininess(_: &Material) -> f32 {
        lobes::MIRROR_SHININESS
    }
}
