//! Factors per pixel and path length (Bolin and Meyer, "An error metric for Monte Carlo ray tracing", 1997): the rule
//! of EARS with statistics by block of pixels and depth only. Two vertices of one depth under one pixel get the same
//! factor however much they differ.
//!
//! Guarded like [`super::Ears`]: with statistics that are trusted at once, a few fireflies make paths split without end
//! or terminate, and their light comes back in samples so rare that a picture of 512 samples per pixel looks biased
//! (scene kitchen).

use super::{RrsStrategy, Space, Vertices8, ears};
use core::fmt;
use croupier_simd::F32x8;

/// Most efficient factor for the contributions of this depth; the factor of `classic` where little is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BolinMeyer {
    /// Full trust in statistics from the first sample on.
    pub plain: bool,
}

impl BolinMeyer {
    pub(super) fn parse(options: &str) -> Option<Self> {
        ears::parse_plain(options).map(|plain| Self { plain })
    }
}

impl RrsStrategy for BolinMeyer {
    const NEEDS_ALBEDO: bool = true;
    const SPACE: Option<Space> = Some(Space::Image);

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.plain { "plain" } else { "" })
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.plain.into(), 0, 0, 0]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        ears::grown(v, ears::efficient_factor(&v.learned, v.beta), self.plain)
    }
}
