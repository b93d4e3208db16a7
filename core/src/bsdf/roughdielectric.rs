//! GGX dielectric interface, Walter et al. 2007, equations 20 and 21; single scattering, unless
//! [`compensation`](super::compensation) gives back what that loses. Radiance scales by 1 / eta^2 on transmission.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `eta[0]` | int_ior / ext_ior; +z is the exterior | `ETA_RANGE` |
//! | `alpha` | GGX width | `ALPHA_RANGE` |
//! | `table` | if compensated: E from outside, then from inside, `COMPENSATION_ENTRIES` numbers each | `ENERGY_RANGE` |
//!
//! A microfacet m visible from `wo` is sampled, then reflection with probability F(wo.m). Everything is computed on the
//! side of `wo` (z negated below), with eta = index behind / index before, k = eta^2 - 1, c = wo.m and e = eta cos_t.
//! Because c^2 - e^2 = -k exactly:
//!
//! - the refracted direction is `-wo / eta - k m / (eta (c + e))` (NUMERICS REF-1);
//! - the Jacobian `eta^2 cos_t / (c - e)^2` is `eta e (c + e)^2 / k^2`: no difference of close numbers.
//!
//! Rebuilding m from two rounded directions cannot be that good: the half vector has the length |eta - 1|, so D is off
//! by 1e-7 / (alpha |eta - 1|) (REF-2). Where that reaches 1 %, `alpha |eta - 1| < 1e-5` or `|eta - 1| < 1e-4`, the
//! transmitted lobe is narrower than 1e-4 rad and is a *delta* lobe to the caller: still sampled through m, so nothing
//! is lost or bent, but evaluation and density do not know it. The reflected lobe stays rough.

use super::compensation::Compensation8;
use super::fresnel::{self, Index8};
use super::ggx::{Ggx8, MIN_COS, mirrored_at};
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Materials8, Sample8, flip, lobes};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// |eta - 1| below which transmission is a delta lobe.
const MIN_CONTRAST: f32 = 1e-4;
/// alpha |eta - 1| below which transmission is a delta lobe.
const MIN_WIDTH: f32 = 1e-5;

/// GGX dielectric interface, `COMPENSATED` if materials may ask for it.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric<'s, const COMPENSATED: bool = true> {
    index: Index8,
    ggx: Ggx8,
    /// Lanes whose transmitted lobe is a delta lobe.
    narrow: Mask8,
    compensation: Compensation8<'s, COMPENSATED>,
}

impl<const COMPENSATED: bool> RoughDielectric<'_, COMPENSATED> {
    /// Density of the refracted direction given c, cos_t, D of its microfacet and wo.z + q(wo).
    #[inline(always)]
    fn refraction_pdf(index: &Index8, c: F32x8, cos_t: F32x8, d: F32x8, denominator: F32x8) -> F32x8 {
        let e = index.eta * cos_t;
        let visible = c * d * 2.0 / denominator;
        fresnel::transmittance(c, cos_t, index.eta) * visible * (index.eta * e) * ((c + e) / index.k).sqr()
    }
}

impl<'s, const COMPENSATED: bool> Bsdf<'s> for RoughDielectric<'s, COMPENSATED> {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::TRANSMISSION).with(Lobes::GLOSSY).with(Lobes::SPECULAR);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::View;

    #[inline(always)]
    fn gather(scene: &Scene<'s>, inputs: &Inputs8, active: Mask8) -> Self {
        let m = Materials8::new(scene, inputs, active);
        let (eta, ggx) = (m.get(|m| m.eta[0]), Ggx8::new(m.get(|m| m.alpha)));
        let contrast = (eta - 1.0).abs();
        let narrow = contrast.lt(F32x8::splat(MIN_CONTRAST)) | (ggx.alpha() * contrast).lt(F32x8::splat(MIN_WIDTH));
        let compensation = Compensation8::gather(scene, &m, 0);
        Self { index: Index8::new(eta), ggx, narrow, compensation }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let below = wo.z.lt(F32x8::ZERO);
        let index = self.index.seen_from(below);
        let (wo, wi) = (flip(wo, below), flip(wi, below));
        let reflect = wi.z.gt(F32x8::ZERO);

        // h of any length along the microfacet normal; on transmission it is wo + eta wi, turned to the side of wo
        // (eta - 1 = k / (eta + 1), so that what cancels is the directions only)
        let bent = (wo + wi) + wi * (index.k / (index.eta + 1.0));
        let bent = Vec3x8::select(index.k.gt(F32x8::ZERO), -bent, bent);
        let h = Vec3x8::select(reflect, wo + wi, bent);
        let length = h.length();
        let c = reflect.select(length * 0.5, wo.dot(h) / length);
        // wi knows its own cosine; Snell's law applied to c would lose it near the critical angle
        let cos_t = -(wi.dot(h) / length);
        let (d, denominator) = (self.ggx.d(h), self.ggx.denominator(wo));

        let pdf = reflect.select(
            fresnel::dielectric(c, index).reflectance * d / (denominator * 2.0),
            Self::refraction_pdf(&index, c, cos_t, d, denominator),
        );
        let scale = reflect.select(F32x8::ONE, index.inverse * index.inverse);
        // a facet that refracts is seen from its front by wo and from its back by wi
        let transmits = wi.z.lt(F32x8::ZERO) & h.z.gt(F32x8::ZERO) & cos_t.gt(F32x8::ZERO);
        let valid = wo.z.gt(F32x8::ZERO) & c.gt(F32x8::splat(MIN_COS)) & (reflect | transmits.and_not(self.narrow));
        let f = self.compensation.over_energy(pdf * self.ggx.g1(wi) * scale, &self.ggx, wo.z, below);
        Eval8 { f: Vec3x8::grey(f), pdf }.zero_unless(valid)
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, lobe]: [F32x8; 3]) -> Sample8 {
        let below = wo.z.lt(F32x8::ZERO);
        let index = self.index.seen_from(below);
        let wo = flip(wo, below);
        let m = self.ggx.sample_visible(wo, u, v);
        let c = wo.dot(m);
        let i = fresnel::dielectric(c, index);
        let reflect = lobe.lt(i.reflectance);
        let through = -(wo * index.inverse) - m * (index.k * index.inverse / (c + index.eta * i.cos_t));
        let wi = Vec3x8::select(reflect, mirrored_at(wo, m, c), through);

        let (d, denominator) = (self.ggx.d(m), self.ggx.denominator(wo));
        let pdf = reflect
            .select(i.reflectance * d / (denominator * 2.0), Self::refraction_pdf(&index, c, i.cos_t, d, denominator));
        let scale = reflect.select(F32x8::ONE, index.inverse * index.inverse);
        let delta = self.narrow.and_not(reflect);
        let leaves = reflect.select(wi.z, -wi.z).gt(F32x8::ZERO);
        let valid = wo.z.gt(F32x8::ZERO) & c.gt(F32x8::splat(MIN_COS)) & leaves;
        Sample8 {
            wi: flip(wi, below),
            weight: Vec3x8::grey(self.compensation.over_energy(self.ggx.g1(wi) * scale, &self.ggx, wo.z, below)),
            pdf: delta.select(F32x8::ZERO, pdf),
            delta,
            valid,
        }
        .masked()
    }

    /// 1: what single scattering loses is not counted; exact if compensated.
    #[inline(always)]
    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        Vec3x8::ONE
    }

    fn shininess(material: &Material) -> f32 {
        lobes::phong_exponent(material.alpha)
    }
}
