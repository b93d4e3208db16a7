//! GGX conductor: `f = F(wi.h) D G1(wi) G1(wo) / (4 cos_i cos_o)` times a scale. Single scattering, so rough metals
//! lose energy. Walter et al. 2007, equation 20.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `eta` | real refractive index per channel | `CONDUCTOR_RANGE`, eta or k from `MIN_CONDUCTOR` |
//! | `k` | extinction per channel | `CONDUCTOR_RANGE` |
//! | `reflectance` | scale per channel, may be textured | `REFLECTANCE_RANGE` |
//! | `alpha` | GGX width | `ALPHA_RANGE` |

use super::ggx::{Ggx8, mirrored_at};
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Materials8, Sample8, fresnel, lobes};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// GGX conductor.
#[derive(Clone, Copy, Debug)]
pub struct RoughConductor {
    reflectance: Vec3x8,
    eta: Vec3x8,
    k: Vec3x8,
    ggx: Ggx8,
}

impl RoughConductor {
    #[inline(always)]
    fn fresnel(&self, cos: F32x8) -> Vec3x8 {
        fresnel::conductor(cos, self.eta, self.k) * self.reflectance
    }
}

impl Bsdf<'_> for RoughConductor {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::GLOSSY);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;

    #[inline(always)]
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        let m = Materials8::new(scene, inputs, active);
        Self {
            reflectance: inputs.reflectance.zero_unless(active),
            eta: m.rgb(|m| m.eta),
            k: m.rgb(|m| m.k),
            ggx: Ggx8::new(m.get(|m| m.alpha)),
        }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let r = self.ggx.reflection(wo, wi);
        Eval8 { f: self.fresnel(r.cos) * (r.g1 * r.pdf), pdf: r.pdf }.zero_unless(r.valid)
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, _]: [F32x8; 3]) -> Sample8 {
        let m = self.ggx.sample_visible(wo, u, v);
        let cos = wo.dot(m);
        let wi = mirrored_at(wo, m, cos);
        let r = self.ggx.reflection_at(wo, wi, m, cos);
        Sample8 { wi, weight: self.fresnel(r.cos) * r.g1, pdf: r.pdf, delta: Mask8::NONE, valid: r.valid }.masked()
    }

    /// Albedo of the smooth conductor: an upper estimate for most angles.
    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        self.fresnel(wo.z).zero_unless(wo.z.gt(F32x8::ZERO))
    }

    fn shininess(material: &Material) -> f32 {
        lobes::phong_exponent(material.alpha)
    }
}
