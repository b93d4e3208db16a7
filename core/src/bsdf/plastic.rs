//! Smooth dielectric coat over a diffuse base: `f = F delta + (1 - F(wi)) (1 - F(wo)) / eta^2 rho / (1 - rho Fdr) /
//! pi`, light scattered back and forth under the coat summed with colour shifts.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `reflectance` | rho per channel, may be textured | `REFLECTANCE_RANGE` |
//! | `eta[0]` | int_ior / ext_ior | `ETA_RANGE` |
//! | `fdr` | Fdr, reflectance of the coat from inside for diffuse light | `FDR_RANGE` |
//!
//! With r = rho / (1 - rho Fdr), the base reflects `(1 - F(wo)) r (1 - Fdr)`, because reciprocity makes the mean of 1 -
//! F from outside eta^2 (1 - Fdr). Let d be the mean of that over the channels: the coat is chosen with probability F /
//! (F + d), and the albedo is known exactly.

use super::fresnel::{self, Index8};
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Materials8, Sample8, mirrored, warp};
use crate::scene::Scene;
use crate::scene::blob::Material;
use core::f32::consts::FRAC_1_PI;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Smooth coat over a diffuse base.
#[derive(Clone, Copy, Debug)]
pub struct Plastic {
    index: Index8,
    base: Base8,
}

/// The diffuse base under a coat, smooth or rough.
#[derive(Clone, Copy, Debug)]
pub(super) struct Base8 {
    /// rho / (1 - rho Fdr).
    pub r: Vec3x8,
    /// 1 - Fdr.
    pub escape: F32x8,
    /// 1 / eta^2.
    pub inv_eta2: F32x8,
}

impl Base8 {
    #[inline(always)]
    pub(super) fn gather(m: &Materials8<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        let fdr = m.get(|m| m.fdr);
        let rho = inputs.reflectance.zero_unless(active);
        // the floor only keeps unphysical parameters finite
        let r = rho.map(|c| c / (1.0 - c * fdr).max(F32x8::splat(1e-6)));
        Self { r, escape: 1.0 - fdr, inv_eta2: 1.0 / m.get(|m| m.eta[0]).sqr() }
    }

    /// Albedo of light that a fraction `entered` of came through the coat.
    #[inline(always)]
    pub(super) fn albedo(&self, entered: F32x8) -> Vec3x8 {
        self.r * (entered * self.escape)
    }
}

impl Plastic {
    #[inline(always)]
    fn fresnel(&self, cos: F32x8) -> F32x8 {
        fresnel::dielectric(cos, self.index).reflectance
    }
}

impl Bsdf<'_> for Plastic {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::DIFFUSE).with(Lobes::SPECULAR);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;

    #[inline(always)]
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        let m = Materials8::new(scene, inputs, active);
        Self { index: Index8::new(m.get(|m| m.eta[0])), base: Base8::gather(&m, inputs, active) }
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let above = wo.z.gt(F32x8::ZERO) & wi.z.gt(F32x8::ZERO);
        let (fo, fi) = (self.fresnel(wo.z), self.fresnel(wi.z));
        let entered = 1.0 - fo;
        let d = self.base.albedo(entered).mean();
        let cosine = wi.z * FRAC_1_PI;
        let f = self.base.r * (entered * (1.0 - fi) * self.base.inv_eta2 * cosine);
        let scatters = above & (fo + d).gt(F32x8::ZERO);
        Eval8 { f, pdf: d / (fo + d) * cosine }.zero_unless(scatters)
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, lobe]: [F32x8; 3]) -> Sample8 {
        let fo = self.fresnel(wo.z);
        let d = self.base.albedo(1.0 - fo).mean();
        let total = fo + d;
        let coat = lobe.lt(fo / total);
        let below = warp::cosine_hemisphere(u, v);
        let wi = Vec3x8::select(coat, mirrored(wo), below);
        // f cos / pdf with what cancels left out: F(wo) and the cosine
        let base = self.base.r
            * ((1.0 - self.fresnel(below.z)) * self.base.inv_eta2 * total / (self.base.escape * self.base.r.mean()));
        let weight = Vec3x8::select(coat, Vec3x8::grey(total), base);
        let valid = wo.z.gt(F32x8::ZERO) & (coat | d.gt(F32x8::ZERO));
        Sample8 { wi, weight, pdf: d / total * (wi.z * FRAC_1_PI), delta: coat, valid }.masked()
    }

    /// Exact.
    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        let fo = self.fresnel(wo.z);
        let a = self.base.albedo(1.0 - fo) + Vec3x8::grey(fo);
        a.map(|c| c.clamp(0.0, 1.0)).zero_unless(wo.z.gt(F32x8::ZERO))
    }

    fn shininess(_: &Material) -> f32 {
        0.0
    }
}
