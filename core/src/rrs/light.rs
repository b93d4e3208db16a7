//! Roulette for light samples ([`crate::Settings::shadow_roulette`]), in two rounds: before one is drawn, by what those
//! of its place have given; before its ray is traced, by what it would give.
//!
//! Both are eq. 32 of EARS with another second moment and the cost of a shadow ray, as roulette only (Veach 1997,
//! section 10.4.1, "efficiency-optimised Russian roulette", has the same idea of a threshold). That cost stands for
//! drawing as well, which is not counted as work. A sample that survives both counts over both chances, each of at
//! least [`MIN_FACTOR`], so a wrong guess costs noise, never the mean.

use super::ears::{TRUST_MOMENT, least_throughput};
use super::{Learned8, MIN_FACTOR};
use crate::cost::COST_SHADOW;
use croupier_simd::{F32x8, Vec3x8};

impl Learned8 {
    /// Chance in [[`MIN_FACTOR`], 1] that a sample of a vertex draws a light sample: `beta` is the prefix weight of the
    /// vertex's samples, roulette included. 1 where nothing is known; it grows out of that with the samples behind the
    /// second moment, and keeps the limit of throughput, as [`super::Ears`] does.
    #[inline(always)]
    pub fn nee_probability(&self, beta: Vec3x8, albedo: Vec3x8) -> F32x8 {
        let one = F32x8::ONE;
        let error = self.norm.of(beta * beta * self.error_weight * self.local.moment) * self.local.nee_share;
        let best = (error * self.cost_over_variance * F32x8::splat(1.0 / COST_SHADOW)).sqrt();
        let known = self.local.count.gt(F32x8::ZERO) & self.cost_over_variance.gt(F32x8::ZERO) & best.is_finite();
        let grown = one + (best.min(one) - one) * self.local.trust(TRUST_MOMENT);
        known.select(grown.max(least_throughput(beta, albedo)).clamp(MIN_FACTOR, 1.0), one)
    }

    /// Chance in [[`MIN_FACTOR`], 1] that the ray to a light sample is traced, which adds the radiance `value` to the
    /// camera sample if nothing hides it; `root` is the square root of the chance that nothing does.
    #[inline(always)]
    pub fn shadow_ray_probability(&self, value: Vec3x8, root: F32x8) -> F32x8 {
        let error = self.norm.of(value * value * self.error_weight);
        let p = (error * self.cost_over_variance * F32x8::splat(1.0 / COST_SHADOW)).sqrt() * root;
        let known = self.cost_over_variance.gt(F32x8::ZERO) & p.is_finite();
        known.select(p, F32x8::ONE).clamp(MIN_FACTOR, 1.0)
    }
}
