//! Constant factor at every vertex, for tests of roulette and splitting.
//!
//! | parameter | unit | range | default |
//! |---|---|---|---|
//! | `factor` | samples per vertex | 0.05 to 20 | none |

use super::{MAX_FACTOR, MIN_FACTOR, RrsStrategy, Vertices8};
use core::fmt;
use croupier_simd::F32x8;

/// Constant factor at every vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fixed {
    /// Samples per vertex.
    pub factor: f32,
}

impl Fixed {
    pub(super) fn parse(options: &str) -> Option<Self> {
        let factor: f32 = options.parse().ok()?;
        (MIN_FACTOR..=MAX_FACTOR).contains(&factor).then_some(Self { factor })
    }
}

impl RrsStrategy for Fixed {
    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.factor)
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.factor.to_bits(), 0, 0, 0]
    }

    #[inline(always)]
    fn factor(&self, _: &Vertices8) -> F32x8 {
        F32x8::splat(self.factor)
    }
}
