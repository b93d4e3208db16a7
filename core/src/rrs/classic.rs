//! The baseline of the EARS paper (section 6): throughput times albedo from the fifth bounce. This is the absolute form,
//! which other renderers mean by "classic"; the form relative to the pixel needs a pixel estimate.
//!
//! | parameter | unit | range | default |
//! |---|---|---|---|
//! | `start` | bounces before the first roulette | >= 1 | 5 |

use super::{RrsStrategy, Vertices8};
use croupier_simd::{F32x8, U32x8};

/// max rgb of (prefix weight x albedo), at most 1, from bounce `start`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classic {
    /// First bounce that plays.
    pub start: u32,
}

impl Default for Classic {
    fn default() -> Self {
        Self { start: 5 }
    }
}

impl Classic {
    pub(super) fn parse(options: &str) -> Option<Self> {
        super::number(options, 5).filter(|&s: &u32| s >= 1).map(|start| Self { start })
    }
}

impl RrsStrategy for Classic {
    const NEEDS_ALBEDO: bool = true;

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let early = v.depth.lt(U32x8::splat(self.start));
        early.select(F32x8::ONE, (v.beta * v.albedo).max_component().min(F32x8::ONE))
    }
}
