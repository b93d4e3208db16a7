//! Tables that plastics need, by quadrature in f64.

use super::math::Math;
use crate::bsdf::ggx::{MAX_ALPHA, MIN_ALPHA};
use crate::scene::blob::TRANSMITTANCE_ENTRIES;
use core::f64::consts::PI;

/// Transmittance and internal reflectance of a rough coat.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughPlasticTable {
    /// T: energy transmitted from outside at cosines 0, 1/63, ... 1: the mean over visible normals of (1 - F)
    /// G1(refracted).
    pub transmittance: [f32; TRANSMITTANCE_ENTRIES],
    /// R: energy reflected from inside for diffuse light: twice the mean over the same 64 cosines of cosine times the
    /// mean over visible normals of F G1(reflected). The plain mean, not the integral, because Mitsuba's `roughplastic`
    /// uses it and its pictures are the references.
    pub r: f32,
}

/// Quadrature points per dimension; with them T and R are within 1e-4 of another quadrature over plain normals (test
/// `rough_plastic_tables`).
const POINTS: usize = 96;

/// Quadrature points of the diffuse Fresnel reflectance.
const DIFFUSE_POINTS: usize = 256;

/// Cosine that stands for 0, where visible normals have no limit that quadrature could use; Mitsuba's.
const GRAZING: f64 = 1e-6;

/// Table of a GGX coat of width `alpha` in (0, 10] and relative index `eta` = int_ior / ext_ior > 0. Takes about 10^6
/// evaluations of Fresnel's equations.
pub fn rough_plastic<M: Math>(alpha: f64, eta: f64) -> RoughPlasticTable {
    let alpha = alpha.clamp(f64::from(MIN_ALPHA), f64::from(MAX_ALPHA));
    let rule: [_; POINTS] = core::array::from_fn(|i| gauss_legendre::<M>(POINTS, i));
    let mu = |i: usize| (i as f64 / (TRANSMITTANCE_ENTRIES - 1) as f64).max(GRAZING);
    let transmittance = core::array::from_fn(|i| energy::<M>(&rule, alpha, eta, mu(i), false) as f32);
    let inside = |i| mu(i) * energy::<M>(&rule, alpha, 1.0 / eta, mu(i), true);
    let r = 2.0 * (0..TRANSMITTANCE_ENTRIES).map(inside).sum::<f64>() / TRANSMITTANCE_ENTRIES as f64;
    RoughPlasticTable { transmittance, r: r as f32 }
}

/// Diffuse Fresnel reflectance of the smooth interface from inside, `eta` = int_ior / ext_ior: the mean of F over
/// cosine-weighted directions; 0.5963 for 1.5. Error below 1e-6 for |eta - 1| > 1e-3.
pub fn diffuse_fresnel_inside<M: Math>(eta: f64) -> f32 {
    // F is smooth from the thin side; from the other, energy conservation: 1 - F_inside = (1 - F_outside) / eta^2
    let thin = eta.max(1.0 / eta);
    // cos = t^2 puts the points where F is steep
    let term = |(t, w): (f64, f64)| w * 4.0 * (t * t * t) * fresnel::<M>(t * t, thin).0;
    let outside: f64 = (0..DIFFUSE_POINTS).map(|i| term(gauss_legendre::<M>(DIFFUSE_POINTS, i))).sum();
    (if eta >= 1.0 { 1.0 - (1.0 - outside) / (eta * eta) } else { outside }) as f32
}

/// Reflectance and cosine of the transmitted ray; `eta` = index behind over index before.
pub fn fresnel<M: Math>(cos: f64, eta: f64) -> (f64, f64) {
    let s = cos * cos + (eta - 1.0) * (eta + 1.0);
    if s <= 0.0 {
        return (1.0, 0.0);
    }
    let cos_t = M::sqrt(s) / eta;
    let rs = (cos - eta * cos_t) / (cos + eta * cos_t);
    let rp = (eta * cos - cos_t) / (eta * cos + cos_t);
    (0.5 * (rs * rs + rp * rp), cos_t)
}

/// Mean over the normals visible at cosine `mu` of F G1(reflected) or (1 - F) G1(refracted).
fn energy<M: Math>(rule: &[(f64, f64)], alpha: f64, eta: f64, mu: f64, reflected: bool) -> f64 {
    let mut sum = 0.0;
    visible::<M>(rule, alpha, mu, |facet, weight| {
        let (f, cos_t) = fresnel::<M>(facet.cos, eta);
        let (leaves, part) =
            if reflected { (facet.reflected::<M>(), f) } else { (facet.refracted::<M>(eta, cos_t), 1.0 - f) };
        if let Some((z, denominator)) = leaves {
            sum += weight * part * 2.0 * z / denominator;
        }
    });
    sum
}

/// A microfacet that is seen at the cosine `mu` from the mean normal.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Cosine between view and facet normal, above 0.
    pub cos: f64,
    /// Cosine between facet and mean normal.
    m: f64,
    mu: f64,
    alpha: f64,
}

impl Facet {
    /// Cosine z of the reflected direction, and z + q where G1 = 2 z / (z + q); `None` if it leaves through the
    /// surface.
    pub fn reflected<M: Math>(&self) -> Option<(f64, f64)> {
        self.masked::<M>(2.0 * self.cos * self.m - self.mu)
    }

    /// Cosine of the direction refracted at `cos_t` into the relative index `eta`, seen from behind, as
    /// [`Self::reflected`].
    pub fn refracted<M: Math>(&self, eta: f64, cos_t: f64) -> Option<(f64, f64)> {
        self.masked::<M>(self.mu / eta - (self.cos / eta - cos_t) * self.m)
    }

    fn masked<M: Math>(&self, z: f64) -> Option<(f64, f64)> {
        let q = M::sqrt(self.alpha * self.alpha * (1.0 - z * z).max(0.0) + z * z);
        (z > 0.0).then_some((z, z + q))
    }
}

/// Calls `f` with the normals visible at cosine `mu` and their weights, 1 in all. They come from the cap map of Dupuy &
/// Benyoub 2023: smooth in both numbers, even in the azimuth.
pub fn visible<M: Math>(rule: &[(f64, f64)], alpha: f64, mu: f64, mut f: impl FnMut(Facet, f64)) {
    let sin = M::sqrt(1.0 - mu * mu);
    let length = M::sqrt(alpha * alpha * sin * sin + mu * mu);
    let (wx, wz) = (alpha * sin / length, mu / length);
    for &(u, weight_u) in rule {
        let t = u * (1.0 + wz);
        let r = M::sqrt(t * (2.0 - t));
        for &(v, weight_v) in rule {
            let (s, c) = M::sin_cos(PI * v);
            let h = [alpha * (r * c + wx), alpha * r * s, (1.0 - u) * (1.0 + wz)];
            let norm = M::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
            let m = h.map(|x| x / norm);
            let cos = sin * m[0] + mu * m[2];
            if cos > 0.0 {
                f(Facet { cos, m: m[2], mu, alpha }, weight_u * weight_v);
            }
        }
    }
}

/// Node `i` of the `n` of Gauss-Legendre quadrature on [0, 1], and its weight (Newton's method on the Legendre
/// polynomial).
pub fn gauss_legendre<M: Math>(n: usize, i: usize) -> (f64, f64) {
    let (_, mut x) = M::sin_cos(PI * (i as f64 + 0.75) / (n as f64 + 0.5));
    let mut slope = 1.0;
    for _ in 0..100 {
        let (mut p, mut before) = (1.0, 0.0);
        for k in 1..=n {
            let k = k as f64;
            (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
        }
        slope = n as f64 * (x * p - before) / (x * x - 1.0);
        let step = p / slope;
        x -= step;
        if step.abs() < 1e-15 {
            break;
        }
    }
    (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
}
