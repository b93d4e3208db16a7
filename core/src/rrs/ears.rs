//! Efficiency-aware roulette and splitting (Rath et al., SIGGRAPH 2022): the factors that make error x cost of the whole
//! picture least, from local and global variance and cost (eq. 32), as a fixed point over the iterations.
//!
//! Where little is known the paper's rule acts on noise: a bin whose few samples found nothing kills every path. So the factor
//! grows out of simpler rules, geometrically: `classic` without samples, `adrrs` (which needs a mean) with some, EARS (which
//! needs a second moment) with more.
//!
//! | parameter | unit | value |
//! |---|---|---|
//! | [`TRUST_MEAN`] | samples of a bin | 32 |
//! | [`TRUST_MOMENT`] | samples of a bin | 256 |
//! | [`MOST_THROUGHPUT`] | throughput after roulette | 10 |

use super::{Classic, MAX_FACTOR, MIN_FACTOR, RrsStrategy, Space, Vertices8, adrrs};
use croupier_simd::F32x8;

/// Samples at which the mean counts half.
const TRUST_MEAN: f32 = 32.0;
/// Samples at which the second moment counts half.
const TRUST_MOMENT: f32 = 256.0;
/// Throughput (times albedo) that roulette may lead to.
const MOST_THROUGHPUT: f32 = 10.0;

/// The most efficient factor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ears {
    /// Trust statistics at once, as the paper does.
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

/// Eq. 27, robust where moment and variance disagree: roulette by the moment, splitting by the variance, else neither.
#[inline(always)]
pub(super) fn split_or_kill(by_moment: F32x8, by_variance: F32x8) -> F32x8 {
    let one = F32x8::ONE;
    by_moment.le(one).select(by_moment, by_variance.max(one))
}

/// `s` where much is known, simpler rules where less is.
#[inline(always)]
pub(super) fn grown(v: &Vertices8, s: F32x8, plain: bool) -> F32x8 {
    let l = &v.learned;
    let classic = Classic::default().factor(v);
    let known = l.count.gt(F32x8::ZERO) & l.cost_over_variance.gt(F32x8::ZERO);
    if plain {
        return known.select(s, classic);
    }
    let log = |x: F32x8| x.clamp(MIN_FACTOR, MAX_FACTOR).ln();
    let blend = |a: F32x8, b: F32x8, t: F32x8| a + (b - a) * t;
    let window = adrrs::window(l.contribution(v.beta));
    let learned = blend(log(window), log(s), l.trust(TRUST_MOMENT));
    let s = known.select(blend(log(classic), learned, l.trust(TRUST_MEAN)).exp(), classic);
    // what is killed out of ignorance comes back as a few samples of enormous weight: no factor below 1 brings the
    // throughput over the limit
    s.max(((v.beta * v.albedo).max_component() / MOST_THROUGHPUT).min(F32x8::ONE))
}

impl RrsStrategy for Ears {
    const NEEDS_ALBEDO: bool = true;
    const SPACE: Option<Space> = Some(Space::Scene);

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let l = &v.learned;
        let s = split_or_kill(l.efficient(v.beta, l.moment), l.efficient(v.beta, l.variance));
        grown(v, s, self.plain)
    }
}
