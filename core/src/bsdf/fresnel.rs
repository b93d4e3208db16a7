//! Fresnel reflectance for unpolarised light, in forms that do not cancel.

use crate::scene::blob::CONDUCTOR_RANGE;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Relative refractive index of an interface as seen from one side.
#[derive(Clone, Copy, Debug)]
pub struct Index8 {
    /// Index behind over index before, > 0.
    pub eta: F32x8,
    /// 1 / eta.
    pub inverse: F32x8,
    /// eta^2 - 1.
    pub k: F32x8,
}

impl Index8 {
    /// Index as seen from the side where it is `eta`.
    #[inline(always)]
    pub fn new(eta: F32x8) -> Self {
        Self { eta, inverse: 1.0 / eta, k: (eta - 1.0) * (eta + 1.0) }
    }

    /// Turned around in the lanes of `behind`. k does not come from the rounded 1 / eta, whose distance from 1 may have
    /// few bits left.
    #[inline(always)]
    pub fn seen_from(self, behind: Mask8) -> Self {
        Self {
            eta: behind.select(self.inverse, self.eta),
            inverse: behind.select(self.eta, self.inverse),
            k: behind.select(-(self.k * self.inverse * self.inverse), self.k),
        }
    }
}

/// Reflectance of a dielectric interface and where the transmitted ray goes.
#[derive(Clone, Copy, Debug)]
pub struct Interface8 {
    /// Reflected fraction of the energy, in [0, 1]; exactly 1 under total internal reflection, exactly 0 for eta = 1.
    pub reflectance: F32x8,
    /// |cos| of the transmitted ray; 0 under total internal reflection.
    pub cos_t: F32x8,
}

/// Interface seen at `cos` >= 0 from the normal.
///
/// With k = eta^2 - 1 and e = eta cos_t = sqrt(cos^2 + k): `r_s = -k / (cos + e)^2`, `r_p = k ((eta^2 + 1) cos^2 - 1) /
/// (eta^2 cos + e)^2` (NUMERICS FRE-1: absolute error up to 1.3e-6 near eta = 1, where the textbook form is off by 0.2;
/// up to 7e-5 within 1e-6 of the critical cos^2). Total internal reflection is `reflectance == 1`, decided here only:
/// evaluation, density and sampling must all take it from this function (FRE-2).
#[inline(always)]
pub fn dielectric(cos: F32x8, index: Index8) -> Interface8 {
    let Index8 { eta, inverse, k } = index;
    let (c2, eta2) = (cos * cos, eta * eta);
    let s = c2 + k;
    let e = s.safe_sqrt();
    let rs = k / (cos + e).sqr();
    let rp = k * ((eta2 + 1.0) * c2 - 1.0) / (eta2 * cos + e).sqr();
    let r = ((rs * rs + rp * rp) * 0.5).min(F32x8::ONE);
    let total = s.le(F32x8::ZERO) & k.lt(F32x8::ZERO);
    let r = total.select(F32x8::ONE, r);
    // eta = 1 at cos = 0 is 0 / 0
    let r = k.eq(F32x8::ZERO).select(F32x8::ZERO, r);
    Interface8 { reflectance: r, cos_t: e * inverse }
}

/// Transmitted fraction of the energy at an interface that meets the rays at `cos` and `cos_t`, both > 0: 1 - F as a
/// sum of positive terms, `2 c e (1 / (c + e)^2 + eta^2 / (eta^2 c + e)^2)` with e = eta cos_t. It keeps its relative
/// precision where almost nothing passes.
#[inline(always)]
pub fn transmittance(cos: F32x8, cos_t: F32x8, eta: F32x8) -> F32x8 {
    let (eta2, e) = (eta * eta, eta * cos_t);
    cos * e * 2.0 * (1.0 / (cos + e).sqr() + eta2 / (eta2 * cos + e).sqr())
}

/// Largest refractive index and extinction of a conductor that [`conductor`] tells apart: beyond it 4th powers
/// overflow.
pub const MAX_INDEX: f32 = 1e6;

// No index that a scene may hold is changed.
const _: () = assert!(CONDUCTOR_RANGE[1] <= MAX_INDEX);

/// Reflectance of a conductor of index `eta + i k` per channel, seen from vacuum at `cos` in [0, 1].
///
/// Born & Wolf 14.2 as usual, but a = sqrt((sqrt(t0^2 + 4 eta^2 k^2) + t0) / 2) is rationalised for t0 < 0
/// (NUMERICS FRE-3: absolute error below 1e-6, without it 1e-4 for k >> eta; 3e-6 at the critical angle of an index
/// below 1 with almost no extinction).
#[inline(always)]
pub fn conductor(cos: F32x8, eta: Vec3x8, k: Vec3x8) -> Vec3x8 {
    let c = cos.min(F32x8::ONE);
    let c2 = c * c;
    let s2 = 1.0 - c2;
    let channel = |n: F32x8, k: F32x8| {
        let (n, k) = (n.clamp(0.0, MAX_INDEX), k.clamp(0.0, MAX_INDEX));
        let t0 = (n - k) * (n + k) - s2;
        let nk = n * k;
        let root = (t0 * t0 + nk * nk * 4.0).sqrt();
        let low = t0.lt(F32x8::ZERO);
        // sqrt((root + t0) / 2), times and divided by sqrt(root - t0) where t0 < 0
        let half = ((root + t0.abs()) * 0.5).sqrt();
        let a = low.select(nk / half, half);
        let (t1, t2) = (root + c2, c * a * 2.0);
        let rs = (t1 - t2) / (t1 + t2);
        let (t3, t4) = (root * c2 + s2 * s2, t2 * s2);
        let rp = rs * (t3 - t4) / (t3 + t4);
        // 0/0 only for a matched interface at grazing incidence; clamp makes that 0
        ((rs + rp) * 0.5).clamp(0.0, 1.0)
    };
    Vec3x8::new(channel(eta.x, k.x), channel(eta.y, k.y), channel(eta.z, k.z))
}
