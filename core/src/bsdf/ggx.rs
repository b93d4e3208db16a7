//! The isotropic GGX (Trowbridge-Reitz) microfacet distribution with separable Smith masking and sampling of visible
//! normals: what the rough models share. Walter et al. 2007, Heitz 2014 and 2018, Dupuy & Benyoub 2023.
//!
//! Forms that stay finite and accurate for every width and every grazing angle (NUMERICS GGX-1, 3, 5), with
//! q(w) = sqrt(alpha^2 (x^2 + y^2) + z^2):
//!
//! | quantity | form |
//! |---|---|
//! | D(h) | 1 / (pi alpha^2 ((x^2 + y^2) / alpha^2 + z^2)^2) for unit h: no 1 - cos^2 |
//! | G1(w) | 2 abs(z) / (abs(z) + q(w)) |
//! | density of a reflection | D / (2 (wo.z + q(wo))): the cosines of the visible-normal density and of the Jacobian cancel |
//! | f cos / density | F G1(wi): no D |

use crate::scene::blob::ALPHA_RANGE;
use core::f32::consts::FRAC_1_PI;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Narrower lobes are widened to this: 1e-4 rad, below what a pixel resolves, and D^2 still fits (NUMERICS GGX-2).
pub const MIN_ALPHA: f32 = 1e-4;
/// Wider lobes are narrowed to this.
pub const MAX_ALPHA: f32 = 10.0;

// No width that a scene may hold is changed.
const _: () = assert!(MIN_ALPHA <= ALPHA_RANGE[0] && ALPHA_RANGE[1] <= MAX_ALPHA);

/// Half vectors at a smaller cosine to `wo` scatter nothing; evaluation, density and sampling share it. Far below the
/// rounding of the directions themselves; it only keeps squares from underflowing.
pub const MIN_COS: f32 = 1e-12;

/// Eight distributions.
#[derive(Clone, Copy, Debug)]
pub struct Ggx8 {
    alpha: F32x8,
}

/// One reflection off the microfacets.
#[derive(Clone, Copy, Debug)]
pub struct Reflection8 {
    /// wo.h.
    pub cos: F32x8,
    /// Density of sampling `wi` through visible normals, 1/sr; 0 outside `valid`.
    pub pdf: F32x8,
    /// G1(wi): `f cos = F g1 pdf`; 0 outside `valid`.
    pub g1: F32x8,
    /// Both directions above the horizon and the facet visible from both.
    pub valid: Mask8,
}

impl Ggx8 {
    /// Distributions of width `alpha`, clamped to [`MIN_ALPHA`]..[`MAX_ALPHA`].
    #[inline(always)]
    pub fn new(alpha: F32x8) -> Self {
        Self { alpha: alpha.clamp(MIN_ALPHA, MAX_ALPHA) }
    }

    /// Width alpha.
    #[inline(always)]
    pub fn alpha(&self) -> F32x8 {
        self.alpha
    }

    /// D of the direction of `h`, whose length is free: 1/sr, with integral of D cos = 1 over the hemisphere.
    #[inline(always)]
    pub fn d(&self, h: Vec3x8) -> F32x8 {
        let (x, y) = (h.x / self.alpha, h.y / self.alpha);
        let t = h.length_sqr() / (x * x + y * y + h.z * h.z);
        // t^2 first would underflow for short h
        (t / self.alpha).sqr() * FRAC_1_PI
    }

    /// |z| + q(w), the denominator of G1(w) = 2 |z| / (|z| + q) and of the sampling density.
    #[inline(always)]
    pub fn denominator(&self, w: Vec3x8) -> F32x8 {
        w.z.abs() + (self.alpha.sqr() * (w.x * w.x + w.y * w.y) + w.z * w.z).sqrt()
    }

    /// Smith masking of `w`, in [0, 1].
    #[inline(always)]
    pub fn g1(&self, w: Vec3x8) -> F32x8 {
        w.z.abs() * 2.0 / self.denominator(w)
    }

    /// Unit normal with the density of the normals visible from `wo`, `wo.z > 0`: G1(wo) (wo.h) D(h) / wo.z, by the
    /// spherical cap of Dupuy & Benyoub 2023. The cap's height is kept as t = 1 - z, so that neither sin nor h.z cancel
    /// and h.z > 0 always.
    #[inline(always)]
    pub fn sample_visible(&self, wo: Vec3x8, u: F32x8, v: F32x8) -> Vec3x8 {
        let w = Vec3x8::new(wo.x * self.alpha, wo.y * self.alpha, wo.z).normalize_fast();
        let top = 1.0 + w.z;
        let t = u * top;
        let r = (t * (2.0 - t)).safe_sqrt();
        let (s, c) = v.sin_cos_2pi();
        let h = Vec3x8::new((r * c + w.x) * self.alpha, (r * s + w.y) * self.alpha, (1.0 - u) * top);
        h.normalize_fast()
    }

    /// The reflection wo -> wi whose half vector points along `h` (any length) with `cos` = wo.h.
    #[inline(always)]
    pub fn reflection_at(&self, wo: Vec3x8, wi: Vec3x8, h: Vec3x8, cos: F32x8) -> Reflection8 {
        let valid = wo.z.gt(F32x8::ZERO) & wi.z.gt(F32x8::ZERO) & cos.gt(F32x8::splat(MIN_COS));
        let pdf = self.d(h) / (self.denominator(wo) * 2.0);
        Reflection8 { cos, pdf: valid.zero_unless(pdf), g1: valid.zero_unless(self.g1(wi)), valid }
    }

    /// The reflection wo -> wi.
    #[inline(always)]
    pub fn reflection(&self, wo: Vec3x8, wi: Vec3x8) -> Reflection8 {
        let h = wo + wi;
        // |wo + wi| / 2 is wo.h for unit vectors, without its cancellation at opposite grazing directions
        self.reflection_at(wo, wi, h, h.length() * 0.5)
    }
}

/// `wo` mirrored at the microfacet normal `m`, `cos` = wo.m.
#[inline(always)]
pub fn mirrored_at(wo: Vec3x8, m: Vec3x8, cos: F32x8) -> Vec3x8 {
    m * (cos + cos) - wo
}
