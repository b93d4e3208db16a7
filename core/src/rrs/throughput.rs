//! Roulette by throughput, the textbook rule (Arvo and Kirk, SIGGRAPH 1990; Pharr, Jakob and Humphreys, "Physically
//! Based Rendering", section 13.4 of the fourth edition).
//!
//! | parameter | unit | range | default |
//! |---|---|---|---|
//! | `norm` | of the prefix weight's rgb | max, luminance, mean | max |
//! | `low`, `high` | factor | 0.05 <= low <= high <= 20 | 0.05, 0.95 |
//! | `start` | path segments from the camera | >= 1 | 1 |

use super::{MAX_FACTOR, MIN_FACTOR, Norm, RrsStrategy, Vertices8};
use core::fmt;
use croupier_simd::{F32x8, U32x8};

/// Roulette by throughput: clamp(norm(throughput), low, high) from depth `start`, 1 before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Throughput {
    /// Norm of the throughput.
    pub norm: Norm,
    /// Smallest factor.
    pub low: f32,
    /// Largest factor.
    pub high: f32,
    /// First depth at which roulette is played, path segments from the camera.
    pub start: u32,
}

impl Default for Throughput {
    fn default() -> Self {
        Self { norm: Norm::Max, low: MIN_FACTOR, high: 0.95, start: 1 }
    }
}

impl Throughput {
    pub(super) fn parse(options: &str) -> Option<Self> {
        let mut parts = options.split(':');
        let mut part = || parts.next().unwrap_or("");
        let d = Self::default();
        let x = Self {
            norm: Norm::parse(part())?,
            low: super::number(part(), d.low)?,
            high: super::number(part(), d.high)?,
            start: super::number(part(), d.start)?,
        };
        let fits = MIN_FACTOR <= x.low && x.low <= x.high && x.high <= MAX_FACTOR;
        (fits && parts.next().is_none()).then_some(x)
    }
}

impl RrsStrategy for Throughput {
    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}:{}", self.norm.name(), self.low, self.high, self.start)
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.norm as u32, self.low.to_bits(), self.high.to_bits(), self.start]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let early = v.depth.lt(U32x8::splat(self.start));
        early.select(F32x8::ONE, self.norm.of(v.beta).clamp(self.low, self.high))
    }
}
