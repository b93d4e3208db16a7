//! Efficiency-aware roulette: [`super::Ears`] without splitting.

use super::{RrsStrategy, Space, Vertices8, ears};
use core::fmt;
use croupier_simd::F32x8;

/// The most efficient factor of at most 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ear {
    /// Trust statistics at once, as the paper does.
    pub plain: bool,
}

impl Ear {
    pub(super) fn parse(options: &str) -> Option<Self> {
        ears::parse_plain(options).map(|plain| Self { plain })
    }
}

impl RrsStrategy for Ear {
    const NEEDS_ALBEDO: bool = true;
    const EFFICIENCY_AWARE: bool = true;
    const SPACE: Option<Space> = Some(Space::Scene);

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.plain { "plain" } else { "" })
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let l = &v.learned;
        ears::grown(v, l.efficient_square(v.beta, l.local.moment).sqrt(), self.plain).min(F32x8::ONE)
    }
}
