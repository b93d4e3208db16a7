//! Roulette for next event estimation ([`crate::Settings::shadow_roulette`]), in two rounds: before a light is sampled,
//! by what light samples of the same bin have contributed; before the shadow ray is traced, by what this one would
//! contribute.
//!
//! Both are eq. 32 of EARS with another second moment and the cost of a shadow ray, as roulette only (compare
//! "efficiency-optimized Russian roulette", Veach 1997, section 10.4.1). That cost covers sampling the light as well,
//! which is not counted as work. A light sample that survives both rounds is divided by both probabilities, each at
//! least [`MIN_FACTOR`], so wrong statistics cost noise, never bias.

use super::ears::{TRUST_MOMENT, least_throughput};
use super::{Learned8, MIN_FACTOR};
use crate::cost::COST_SHADOW;
use croupier_simd::{F32x8, Vec3x8};

impl Learned8 {
    /// Probability in [[`MIN_FACTOR`], 1] that a sample of a vertex uses next event estimation: `beta` is the prefix
    /// weight of the vertex's samples, roulette included. It is 1 where nothing is known, is blended by the samples
    /// behind the second moment, and keeps the limit of throughput, like the factor of [`super::Ears`].
    #[inline(always)]
    pub fn nee_probability(&self, beta: Vec3x8, albedo: Vec3x8) -> F32x8 {
        let one = F32x8::ONE;
        let error = self.norm.of(beta * beta * self.error_weight * self.local.moment) * self.local.nee_share;
        let best = (error * self.cost_over_variance * F32x8::splat(1.0 / COST_SHADOW)).sqrt();
        let known = self.local.count.gt(F32x8::ZERO) & self.cost_over_variance.gt(F32x8::ZERO) & best.is_finite();
        let grown = one + (best.min(one) - one) * self.local.trust(TRUST_MOMENT);
        known.select(grown.max(least_throughput(beta, albedo)).clamp(MIN_FACTOR, 1.0), one)
    }

    /// Probability in [[`MIN_FACTOR`], 1] that the shadow ray of a light sample is traced: `value` is the radiance that
    /// it adds to the camera sample if unoccluded, `root` the square root of the probability of that.
    #[inline(always)]
    pub fn shadow_ray_probability(&self, value: Vec3x8, root: F32x8) -> F32x8 {
        let error = self.norm.of(value * value * self.error_weight);
        let p = (error * self.cost_over_variance * F32x8::splat(1.0 / COST_SHADOW)).sqrt() * root;
        let known = self.cost_over_variance.gt(F32x8::ZERO) & p.is_finite();
        known.select(p, F32x8::ONE).clamp(MIN_FACTOR, 1.0)
    }
}
