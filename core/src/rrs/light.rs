//! Roulette for light samples ([`crate::Settings::shadow_roulette`]), in two rounds: before one is drawn, by what those
//! of its place have given; before its ray is traced, by what it would give.
//!
//! Both are eq. 32 of EARS with another second moment, as roulette only (Veach 1997, section 10.4.1, "efficiency-
//! optimised Russian roulette", has the same idea of a threshold). A sample that survives both counts over both chances,
//! so a wrong guess costs noise, never the mean.
//!
//! No chance is below [`MIN_FACTOR`].

use super::ears::{TRUST_MOMENT, least_throughput};
use super::{Learned8, MIN_FACTOR};
use crate::learn::COST_SHADOW;
use croupier_simd::{F32x8, Vec3x8};

impl Learned8 {
    /// Chance that a sample of a vertex draws a light sample: `beta` is the weight of the vertex' samples, after
    /// roulette. 1 where nothing is known; growing out of 1 as [`super::Ears`] grows out of simpler rules, and with the
    /// same limit of the throughput.
    #[inline(always)]
    pub(crate) fn drawn(&self, beta: Vec3x8, albedo: Vec3x8) -> F32x8 {
        let one = F32x8::ONE;
        let error = self.norm.of(beta * beta * self.importance * self.moment) * self.light_share;
        let best = (error * self.cost_over_variance * F32x8::splat(1.0 / COST_SHADOW)).sqrt();
        let known = self.count.gt(F32x8::ZERO) & self.cost_over_variance.gt(F32x8::ZERO) & best.is_finite();
        let grown = one + (best.min(one) - one) * self.trust(TRUST_MOMENT);
        known.select(grown.max(least_throughput(beta, albedo)).clamp(MIN_FACTOR, 1.0), one)
    }

    /// Chance that the ray to a light sample is traced, which gives `value` (its weight in the pixel included) if
    /// nothing hides it; `root` is the square root of the chance that nothing does.
    #[inline(always)]
    pub(crate) fn traced(&self, value: Vec3x8, root: F32x8) -> F32x8 {
        let error = self.norm.of(value * value * self.importance);
        let p = (error * self.cost_over_variance * F32x8::splat(1.0 / COST_SHADOW)).sqrt() * root;
        let known = self.cost_over_variance.gt(F32x8::ZERO) & p.is_finite();
        known.select(p, F32x8::ONE).clamp(MIN_FACTOR, 1.0)
    }
}
