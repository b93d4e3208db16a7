//! Efficiency-aware roulette (EARS, SIGGRAPH 2022): [`super::Ears`] without splitting.

use super::{Ears, RrsStrategy, Space, Vertices8, ears};
use core::fmt;
use croupier_simd::F32x8;

/// Efficiency-aware roulette: the most efficient factor of at most 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ear {
    /// Full trust in statistics from the first sample on, as in the paper.
    pub plain: bool,
}

impl Ear {
    pub(super) fn parse(options: &str) -> Option<Self> {
        ears::parse_plain(options).map(|plain| Self { plain })
    }
}

impl RrsStrategy for Ear {
    const NEEDS_ALBEDO: bool = Ears::NEEDS_ALBEDO;
    const EFFICIENCY_AWARE: bool = Ears::EFFICIENCY_AWARE;
    const SPACE: Option<Space> = Ears::SPACE;

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Ears { plain: self.plain }.write_options(f)
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.plain.into(), 0, 0, 0]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let l = &v.learned;
        ears::grown(v, l.efficient_square(v.beta, l.local.moment).sqrt(), self.plain).min(F32x8::ONE)
    }
}
