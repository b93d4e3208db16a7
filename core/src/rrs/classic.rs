//! Baseline of the EARS paper (SIGGRAPH 2022, section 6): throughput times albedo from the fifth bounce. Other
//! renderers mean the absolute form; the authors' program plays relative to the pixel, which suits dark pictures.
//!
//! | parameter | unit | range | default |
//! |---|---|---|---|
//! | `start` | bounces before the first roulette | >= 1 | 5 |
//! | `relative` | over the estimate of the pixel | yes or no | no |

use super::{RrsStrategy, Vertices8};
use core::fmt;
use croupier_simd::{F32x8, U32x8};

/// Roulette by throughput times albedo: the largest rgb, over the pixel if `relative`, at most 1, from bounce `start`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classic {
    /// First bounce at which roulette is played.
    pub start: u32,
    /// Throughput over the estimate of the pixel, instead of absolute throughput.
    pub relative: bool,
}

impl Default for Classic {
    fn default() -> Self {
        Self { start: 5, relative: false }
    }
}

impl Classic {
    pub(super) fn parse(options: &str) -> Option<Self> {
        let (start, relative) = match options.split_once(':') {
            Some((start, "relative")) => (start, true),
            Some(_) => return None,
            None => (options, false),
        };
        super::number(start, 5).filter(|&s: &u32| s >= 1).map(|start| Self { start, relative })
    }
}

impl RrsStrategy for Classic {
    const NEEDS_ALBEDO: bool = true;
    const NEEDS_IMAGE: bool = true;

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.start, if self.relative { ":relative" } else { "" })
    }

    fn reads_image(&self) -> bool {
        self.relative
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.start, self.relative.into(), 0, 0]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let early = v.depth.lt(U32x8::splat(self.start));
        let expected = v.beta * v.albedo;
        let expected = if self.relative { expected * v.learned.root_error_weight() } else { expected };
        early.select(F32x8::ONE, expected.max_component().min(F32x8::ONE))
    }
}
