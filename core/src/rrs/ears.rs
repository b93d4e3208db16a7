//! Efficiency-aware roulette and splitting (Rath et al., SIGGRAPH 2022): the factors that minimise variance x cost of
//! the whole picture, from local and global variance and cost (eq. 32), as a fixed point over the iterations.
//!
//! Where little is known the paper's rule acts on noise: a bin whose few samples found nothing terminates every path.
//! So the factor is a geometric blend of rules by the number of samples: `classic` without any, `adrrs` (which needs a
//! mean) with some, EARS (which needs a second moment) with more.
//!
//! Factors above 1 are whole numbers of samples ([`whole`]), but for the paper's own rule.
//!
//! | parameter | unit | value |
//! |---|---|---|
//! | [`TRUST_MEAN`] | samples of a bin | 32 |
//! | [`TRUST_MOMENT`] | samples of a bin | 256 |
//! | [`MOST_THROUGHPUT`] | throughput after roulette | 10 |

use super::{Classic, Learned8, MAX_FACTOR, MIN_FACTOR, RrsStrategy, Space, Vertices8, adrrs};
use core::fmt;
use croupier_simd::{F32x8, I32x8, Vec3x8};

/// Samples at which the rule of the mean has half the weight.
const TRUST_MEAN: f32 = 32.0;
/// Samples at which the rule of the second moment has half the weight.
pub(super) const TRUST_MOMENT: f32 = 256.0;
/// Bits of the float 1.
const ONE: i32 = 0x3F80_0000;
/// Largest throughput (times albedo) that roulette may lead to.
const MOST_THROUGHPUT: f32 = 10.0;

/// Efficiency-aware roulette and splitting: the most efficient factor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ears {
    /// Full trust in statistics from the first sample on, and factors that are no whole numbers, as in the paper.
    pub plain: bool,
}

impl Ears {
    pub(super) fn parse(options: &str) -> Option<Self> {
        parse_plain(options).map(|plain| Self { plain })
    }
}

pub(super) fn parse_plain(options: &str) -> Option<bool> {
    match options {
        "" => Some(false),
        "plain" => Some(true),
        _ => None,
    }
}

/// Factor of eq. 27, robust where moment and variance disagree: roulette by the moment, splitting by the variance, else
/// 1.
#[inline(always)]
pub(super) fn efficient_factor(l: &Learned8, beta: Vec3x8) -> F32x8 {
    let one = F32x8::ONE;
    let (roulette, splitting) = (l.efficient_square(beta, l.local.moment), l.efficient_square(beta, l.local.variance));
    roulette.le(one).select(roulette, splitting.max(one)).sqrt()
}

/// Level of a factor: number of floats from 1 to it, which is 2^23 times its logarithm to base 2, linear between powers
/// of 2. Means of levels are geometric means within 6 %, exact at both ends, and take no logarithm.
#[inline(always)]
fn level(s: F32x8) -> F32x8 {
    (s.clamp(MIN_FACTOR, MAX_FACTOR).to_bits().to_i32() - I32x8::splat(ONE)).to_f32()
}

/// Factor of a [`level`].
#[inline(always)]
fn from_level(level: F32x8) -> F32x8 {
    F32x8::from_bits((level.to_i32() + I32x8::splat(ONE)).to_u32())
}

/// Smallest factor of roulette that keeps the throughput within its limit, at most 1.
#[inline(always)]
pub(super) fn least_throughput(beta: Vec3x8, albedo: Vec3x8) -> F32x8 {
    ((beta * albedo).max_component() / MOST_THROUGHPUT).min(F32x8::ONE)
}

/// Blend of `s`, where much is known, with simpler rules, where less is.
#[inline(always)]
pub(super) fn grown(v: &Vertices8, s: F32x8, plain: bool) -> F32x8 {
    let l = &v.learned;
    let classic = Classic::default().factor(v);
    let known = l.local.count.gt(F32x8::ZERO) & l.cost_over_variance.gt(F32x8::ZERO);
    if plain {
        return known.select(s, classic);
    }
    let blend = |a: F32x8, b: F32x8, t: F32x8| a + (b - a) * t;
    let window = adrrs::window(l.contribution(v.beta));
    let broken = known.and_not(s.is_finite() & window.is_finite());
    let learned = blend(level(window), level(s), l.local.trust(TRUST_MOMENT));
    let s = known.select(from_level(blend(level(classic), learned, l.local.trust(TRUST_MEAN))), classic);
    // paths terminated for lack of statistics come back as a few samples of enormous weight: no factor below 1 brings
    // the throughput over the limit
    let s = s.max(least_throughput(v.beta, v.albedo));
    // levels hide what is not finite, `Strategy::factor` looks for it
    broken.select(F32x8::splat(f32::NAN), s)
}

/// Number of samples in place of a factor above 1. With f = s - k between 0 and 1, k or k + 1 samples over s leave the
/// variance V / s of the samples, and rounding adds f (1 - f) / s^2 of their squared mean, which eq. 32 leaves out and
/// which is most of the error where samples hardly differ. At the prices of eq. 32 k + 1 samples are worth more than k where
/// V / k - V / (k + 1) is worth the cost of one, which is where s^2 > k (k + 1).
#[inline(always)]
fn whole(s: F32x8) -> F32x8 {
    let k = (F32x8::splat(0.5) + (s * s + F32x8::splat(0.25)).sqrt()).floor();
    s.gt(F32x8::ONE).select(k, s)
}

impl RrsStrategy for Ears {
    const NEEDS_ALBEDO: bool = true;
    const EFFICIENCY_AWARE: bool = true;
    const SPACE: Option<Space> = Some(Space::Scene);

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.plain { "plain" } else { "" })
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.plain.into(), 0, 0, 0]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let s = grown(v, efficient_factor(&v.learned, v.beta), self.plain);
        if self.plain { s } else { whole(s) }
    }
}
