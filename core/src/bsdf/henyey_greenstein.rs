//! The phase function of Henyey and Greenstein 1941: what a participating medium scatters, as a scattering model
//! without a surface.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `reflectance` | single-scattering albedo per channel, sigma_s / sigma_t where the path collides | 0..=1 |
//! | `g` | mean cosine between the directions before and after, of the medium `Inputs8::material` | `MAX_ANISOTROPY` |
//!
//! The frame is that of the path: +z is `wo`, so that the cosine between the direction of propagation -`wo` and `wi` is
//! -`wi.z`. There is no surface, hence no cosine factor:
//!
//! ```text
//! f = albedo p,   p = (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2)),   integral of p over the sphere = 1
//! ```
//!
//! It is no material kind and has no row in the table of models: media have one phase function each.
//!
//! *Without cancellation* (NUMERICS MED-8). The textbook inversion of the cosine divides a difference by 2 g and loses
//! everything for small g; its denominator loses half of the digits near the peak for large g. Both are written with
//! a = |g| and q = 1 - cos, cos taken towards the peak (for g < 0 the peak is backwards):
//!
//! ```text
//! 1 + g^2 - 2 g cos = (1 - a)^2 + 2 a q
//! q = 2 u ((1 - a)^2 (1 + a (1 - u))) / (1 - a + 2 a (1 - u))^2        u uniform
//! ```
//!
//! Every term is positive, so one form serves all g, to a few roundings of q itself. Tried and dropped: the textbook
//! form above |g| = 1/2 with a form that does not divide by g below, which is off by 1.4e-5 at g = 0.99.

use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8};
use crate::scene::Scene;
use crate::scene::blob::{MAX_ANISOTROPY, Material};
use core::f32::consts::FRAC_1_PI;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Henyey-Greenstein phase function.
#[derive(Clone, Copy, Debug)]
pub struct HenyeyGreenstein {
    /// Single-scattering albedo.
    albedo: Vec3x8,
    /// Mean cosine.
    g: F32x8,
}

impl HenyeyGreenstein {
    /// q of a direction, the cosine `towards` taken towards the peak: from the sine where the cosine is near 1.
    #[inline(always)]
    fn off_peak(&self, wi: Vec3x8) -> F32x8 {
        let towards = -wi.z * F32x8::ONE.copysign(self.g);
        let from_sine = (wi.x * wi.x + wi.y * wi.y) / (1.0 + towards);
        towards.gt(F32x8::ZERO).select(from_sine, 1.0 - towards)
    }

    /// Density of the direction of `wi`, 1/sr.
    #[inline(always)]
    fn density(&self, wi: Vec3x8) -> F32x8 {
        let a = self.g.abs();
        let d = (1.0 - a).sqr() + (a + a) * self.off_peak(wi);
        (1.0 - a) * (1.0 + a) / (d * d.sqrt()) * (0.25 * FRAC_1_PI)
    }
}

impl Bsdf<'_> for HenyeyGreenstein {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::TRANSMISSION).with(Lobes::GLOSSY);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::View;

    /// `inputs.material` is the index of the medium; one out of range scatters evenly.
    #[inline(always)]
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        let (index, bits) = (inputs.material.to_array(), active.bits());
        let g = F32x8::from_fn(|i| {
            let medium = if bits >> i & 1 == 1 { scene.media.get(index[i] as usize) } else { None };
            medium.map_or(0.0, |m| m.g)
        });
        Self { albedo: inputs.reflectance.zero_unless(active), g: g.clamp(-MAX_ANISOTROPY, MAX_ANISOTROPY) }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let pdf = self.density(wi);
        Eval8 { f: self.albedo * pdf, pdf }.zero_unless(wo.is_finite() & pdf.is_finite())
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, _]: [F32x8; 3]) -> Sample8 {
        let a = self.g.abs();
        let (narrow, rest) = (1.0 - a, 1.0 - u);
        let scale = narrow / (narrow + (a + a) * rest);
        let q = (u + u) * scale * scale * (1.0 + a * rest);
        let (sin, cos) = v.sin_cos_2pi();
        let r = (q * (2.0 - q)).safe_sqrt();
        let wi = Vec3x8::new(r * cos, r * sin, (q.min(F32x8::splat(2.0)) - 1.0) * F32x8::ONE.copysign(self.g));
        let pdf = self.density(wi);
        let valid = wo.is_finite() & wi.is_finite();
        Sample8 { wi, weight: self.albedo, pdf, delta: Mask8::NONE, valid }.masked()
    }

    /// The single-scattering albedo.
    #[inline(always)]
    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        self.albedo
    }

    /// 0: a medium is no material.
    fn shininess(_: &Material) -> f32 {
        0.0
    }
}
