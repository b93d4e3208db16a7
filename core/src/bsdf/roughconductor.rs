//! GGX conductor: `f = F(wi.h) D G1(wi) G1(wo) / (4 cos_i cos_o)` times a scale. Walter et al. 2007, equation 20. Single
//! scattering, so rough metals lose energy, unless [`compensation`](super::compensation) gives it back.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `eta` | real refractive index per channel | `CONDUCTOR_RANGE`, eta or k from `MIN_CONDUCTOR` |
//! | `k` | extinction per channel | `CONDUCTOR_RANGE` |
//! | `reflectance` | scale per channel, may be textured | `REFLECTANCE_RANGE` |
//! | `alpha` | GGX width | `ALPHA_RANGE` |
//! | `table` | if compensated: s, `COMPENSATION_ENTRIES` numbers | `COMPENSATION_RANGE` |

use super::compensation::Compensation8;
use super::ggx::{Ggx8, mirrored_at};
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Materials8, Sample8, fresnel, lobes};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// GGX conductor, `COMPENSATED` if materials may ask for it.
#[derive(Clone, Copy, Debug)]
pub struct RoughConductor<'s, const COMPENSATED: bool = true> {
    reflectance: Vec3x8,
    eta: Vec3x8,
    k: Vec3x8,
    ggx: Ggx8,
    compensation: Compensation8<'s, COMPENSATED>,
}

impl<const COMPENSATED: bool> RoughConductor<'_, COMPENSATED> {
    #[inline(always)]
    fn fresnel(&self, cos: F32x8) -> Vec3x8 {
        fresnel::conductor(cos, self.eta, self.k) * self.reflectance
    }
}

impl<'s, const COMPENSATED: bool> Bsdf<'s> for RoughConductor<'s, COMPENSATED> {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::GLOSSY);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;

    #[inline(always)]
    fn gather(scene: &Scene<'s>, inputs: &Inputs8, active: Mask8) -> Self {
        let m = Materials8::new(scene, inputs, active);
        Self {
            reflectance: inputs.reflectance.zero_unless(active),
            eta: m.rgb(|m| m.eta),
            k: m.rgb(|m| m.k),
            ggx: Ggx8::new(m.get(|m| m.alpha)),
            compensation: Compensation8::gather(scene, &m, 0),
        }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let r = self.ggx.reflection(wo, wi);
        let reflectance = self.compensation.reflectance(self.fresnel(r.cos), &self.ggx, wo, wi);
        Eval8 { f: reflectance * (r.g1 * r.pdf), pdf: r.pdf }.zero_unless(r.valid)
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, _]: [F32x8; 3]) -> Sample8 {
        let m = self.ggx.sample_visible(wo, u, v);
        let cos = wo.dot(m);
        let wi = mirrored_at(wo, m, cos);
        let r = self.ggx.reflection_at(wo, wi, m, cos);
        let reflectance = self.compensation.reflectance(self.fresnel(r.cos), &self.ggx, wo, wi);
        Sample8 { wi, weight: reflectance * r.g1, pdf: r.pdf, delta: Mask8::NONE, valid: r.valid }.masked()
    }

    /// Albedo of the smooth conductor: an upper estimate for most angles; what a compensated one of F = 1 has.
    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        self.fresnel(wo.z).zero_unless(wo.z.gt(F32x8::ZERO))
    }

    fn shininess(material: &Material) -> f32 {
        lobes::phong_exponent(material.alpha)
    }
}
