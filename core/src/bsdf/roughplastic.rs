//! GGX dielectric coat over a diffuse base:
//! `f = F D G1(wi) G1(wo) / (4 cos_i cos_o) + T(wi) T(wo) / eta^2 rho / (1 - rho R) / pi`.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `reflectance` | rho per channel, may be textured | `REFLECTANCE_RANGE` |
//! | `eta[0]` | int_ior / ext_ior | `ETA_RANGE` |
//! | `alpha` | GGX width | `ALPHA_RANGE` |
//! | `fdr` | R, reflectance of the coat from inside for diffuse light | `FDR_RANGE` |
//! | `table` | T, energy the coat transmits from outside, `TRANSMITTANCE_ENTRIES` numbers | `REFLECTANCE_RANGE` |
//! | `table` | behind T, if compensated: s, `COMPENSATION_ENTRIES` numbers | `COMPENSATION_RANGE` |
//!
//! T is interpolated linearly. Samples come from the coat's visible normals with probability s / (s + d) and from the
//! cosine with d / (s + d): s = 1 - T(wo), not below 2^-10 so that no odd table starves a narrow highlight, and d the
//! mean over the channels of `T(wo) (1 - R) rho / (1 - rho R)`. Value and density are those of the mixture.
//!
//! Single scattering loses energy, in the coat's reflection as in T, unless [`compensation`](super::compensation) gives
//! it back: the coat then reflects like a conductor of reflectance F, T is what it does not reflect, and R follows from
//! the mean of T by reciprocity.

use super::compensation::Compensation8;
use super::fresnel::{self, Index8};
use super::ggx::{Ggx8, Reflection8, mirrored_at};
use super::plastic::Base8;
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Materials8, Sample8, warp};
use crate::scene::Scene;
use crate::scene::blob::{Material, TRANSMITTANCE_ENTRIES};
use core::f32::consts::FRAC_1_PI;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Table of lanes without one.
const IDLE_TABLE: &[f32; TRANSMITTANCE_ENTRIES] = &[0.5; TRANSMITTANCE_ENTRIES];

/// GGX coat over a diffuse base, `COMPENSATED` if materials may ask for it.
#[derive(Clone, Copy, Debug)]
pub struct RoughPlastic<'s, const COMPENSATED: bool = true> {
    index: Index8,
    base: Base8,
    ggx: Ggx8,
    table: [&'s [f32; TRANSMITTANCE_ENTRIES]; 8],
    compensation: Compensation8<'s, COMPENSATED>,
}

impl<const COMPENSATED: bool> RoughPlastic<'_, COMPENSATED> {
    /// T at `mu`.
    #[inline(always)]
    fn transmittance(&self, mu: F32x8) -> F32x8 {
        let last = TRANSMITTANCE_ENTRIES - 1;
        let x = mu.clamp(0.0, 1.0) * last as f32;
        let cell = x.floor().min(F32x8::splat((last - 1) as f32));
        let i = cell.to_i32().to_array();
        let entry = |lane: usize, step: usize| {
            self.table[lane].get((i[lane] as usize).wrapping_add(step)).copied().unwrap_or_default()
        };
        let (a, b) = (F32x8::from_fn(|l| entry(l, 0)), F32x8::from_fn(|l| entry(l, 1)));
        a + (x - cell) * (b - a)
    }

    /// T(wo) and the lobes' shares s and d.
    #[inline(always)]
    fn shares(&self, wo: Vec3x8) -> (F32x8, F32x8, F32x8) {
        let t = self.transmittance(wo.z);
        let s = (1.0 - t).max(F32x8::splat(1.0 / 1024.0));
        (t, s, self.base.albedo(t).mean())
    }

    /// Value and density of the mixture where the coat's part is `coat`.
    #[inline(always)]
    fn mixture(&self, wo: Vec3x8, wi: Vec3x8, coat: &Reflection8, (t, s, d): (F32x8, F32x8, F32x8)) -> Eval8 {
        let cosine = wi.z * FRAC_1_PI;
        let fresnel = fresnel::dielectric(coat.cos, self.index).reflectance;
        let specular = self.compensation.grey_reflectance(fresnel, &self.ggx, wo, wi) * coat.g1 * coat.pdf;
        let f = self.base.r * (t * self.transmittance(wi.z) * self.base.inv_eta2 * cosine) + Vec3x8::grey(specular);
        Eval8 { f, pdf: (s * coat.pdf + d * cosine) / (s + d) }.zero_unless(coat.valid)
    }
}

impl<'s, const COMPENSATED: bool> Bsdf<'s> for RoughPlastic<'s, COMPENSATED> {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::DIFFUSE).with(Lobes::GLOSSY);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;

    #[inline(always)]
    fn gather(scene: &Scene<'s>, inputs: &Inputs8, active: Mask8) -> Self {
        let m = Materials8::new(scene, inputs, active);
        let table = m.0.map(|m| {
            let rest = scene.tables.get(m.table as usize..);
            rest.and_then(|t| t.first_chunk()).unwrap_or(IDLE_TABLE)
        });
        Self {
            index: Index8::new(m.get(|m| m.eta[0])),
            base: Base8::gather(&m, inputs, active),
            ggx: Ggx8::new(m.get(|m| m.alpha)),
            table,
            compensation: Compensation8::gather(scene, &m, TRANSMITTANCE_ENTRIES as u32),
        }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        self.mixture(wo, wi, &self.ggx.reflection(wo, wi), self.shares(wo))
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, lobe]: [F32x8; 3]) -> Sample8 {
        let shares @ (_, s, d) = self.shares(wo);
        let coat = lobe.lt(s / (s + d));
        let m = self.ggx.sample_visible(wo, u, v);
        let cos = wo.dot(m);
        let wi = Vec3x8::select(coat, mirrored_at(wo, m, cos), warp::cosine_hemisphere(u, v));
        // the half vector that was sampled is better than one rebuilt from the rounded direction
        let half = wo + wi;
        let r = self.ggx.reflection_at(wo, wi, Vec3x8::select(coat, m, half), coat.select(cos, half.length() * 0.5));
        let e = self.mixture(wo, wi, &r, shares);
        Sample8 { wi, weight: e.f / e.pdf, pdf: e.pdf, delta: Mask8::NONE, valid: r.valid & e.pdf.gt(F32x8::ZERO) }
            .masked()
    }

    /// 1 - T for the coat, which counts what single scattering loses there as reflected; exact if compensated.
    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        let t = self.transmittance(wo.z);
        let a = self.base.albedo(t) + Vec3x8::grey(1.0 - t);
        a.map(|c| c.clamp(0.0, 1.0)).zero_unless(wo.z.gt(F32x8::ZERO))
    }

    fn shininess(_: &Material) -> f32 {
        0.0
    }
}
