//! Smooth conductor: perfect reflection times the exact Fresnel reflectance per channel times a scale.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `eta` | real refractive index per channel | `CONDUCTOR_RANGE`, eta or k from `MIN_CONDUCTOR` |
//! | `k` | extinction per channel | `CONDUCTOR_RANGE` |
//! | `reflectance` | scale per channel, may be textured | `REFLECTANCE_RANGE` |

use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Materials8, Sample8, fresnel, lobes, mirrored};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Smooth conductor.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    reflectance: Vec3x8,
    eta: Vec3x8,
    k: Vec3x8,
}

impl Bsdf<'_> for Conductor {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::SPECULAR);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;

    #[inline(always)]
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        let m = Materials8::new(scene, inputs, active);
        Self { reflectance: inputs.reflectance.zero_unless(active), eta: m.rgb(|m| m.eta), k: m.rgb(|m| m.k) }
    }

    #[inline(always)]
    fn eval(&self, _: Vec3x8, _: Vec3x8) -> Eval8 {
        Eval8::ZERO
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, _: [F32x8; 3]) -> Sample8 {
        Sample8::delta(mirrored(wo), self.albedo(wo), wo.z.gt(F32x8::ZERO))
    }

    /// Exact.
    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        (fresnel::conductor(wo.z, self.eta, self.k) * self.reflectance).zero_unless(wo.z.gt(F32x8::ZERO))
    }

    fn shininess(_: &Material) -> f32 {
        lobes::MIRROR_SHININESS
    }
}
