//! Layer of fibres: the distribution and masking of Estevez & Kulla, "Production Friendly Microfacet Sheen BRDF"
//! (SIGGRAPH 2017 course notes), as glTF's `KHR_materials_sheen` has it:
//! `D = (2 + 1 / a) sin(theta)^(1 / a) / (2 pi)`, `f = D / (4 (1 + L(wo) + L(wi)) cos_o cos_i)`.

use core::f32::consts::FRAC_1_PI;
use croupier_simd::{F32x8, Vec3x8};

/// Parameters a to e of the fit of L for smooth (a = 0) and rough (a = 1) fibres.
const FIT: [[f32; 2]; 5] =
    [[25.3245, 21.5473], [3.32435, 3.82987], [0.16801, 0.19823], [-1.27393, -1.97760], [-4.85967, -4.32054]];

/// Eight distributions of fibres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fibres8 {
    inverse: F32x8,
    fit: [F32x8; 5],
}

impl Fibres8 {
    /// Distributions of width `alpha`, above 0.
    #[inline(always)]
    pub(super) fn new(alpha: F32x8) -> Self {
        let smooth = (1.0 - alpha).sqr();
        Self { inverse: 1.0 / alpha, fit: FIT.map(|[a, b]| (a - b) * smooth + b) }
    }

    /// Exponent of the masking at the cosine `x` up to 1/2.
    #[inline(always)]
    fn exponent(&self, x: F32x8) -> F32x8 {
        let [a, b, c, d, e] = self.fit;
        a / (b * x.powf(c) + 1.0) + d * x + e
    }

    /// L at the cosine `mu`.
    #[inline(always)]
    fn lambda(&self, mu: F32x8) -> F32x8 {
        let half = F32x8::splat(0.5);
        let steep = mu.lt(half);
        let l = self.exponent(steep.select(mu, 1.0 - mu).max(F32x8::ZERO));
        steep.select(l, self.exponent(half) * 2.0 - l).exp()
    }

    /// f cos of a white layer for directions above the surface.
    #[inline(always)]
    pub(super) fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> F32x8 {
        let h = wo + wi;
        let sin2 = (h.x * h.x + h.y * h.y) / h.length_sqr();
        let d = (self.inverse + 2.0) * sin2.min(F32x8::ONE).powf(self.inverse * 0.5) * (0.5 * FRAC_1_PI);
        d / ((self.lambda(wo.z) + self.lambda(wi.z) + 1.0) * 4.0 * wo.z.max(F32x8::splat(1e-6)))
    }
}
