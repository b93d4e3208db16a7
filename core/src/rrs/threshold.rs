//! Deterministic termination below a throughput: biased on purpose, to show what bias looks like.
//!
//! | parameter | unit | range | default |
//! |---|---|---|---|
//! | `eps` | throughput, largest rgb | >= 0 | 0.1 |

use super::{RrsStrategy, Vertices8};
use core::fmt;
use croupier_simd::F32x8;

/// Deterministic termination: factor 1 while the largest rgb of the throughput exceeds `eps`, else 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// Throughput at and below which paths end.
    pub eps: f32,
}

impl Threshold {
    pub(super) fn parse(options: &str) -> Option<Self> {
        super::number(options, 0.1).filter(|&eps: &f32| eps >= 0.0).map(|eps| Self { eps })
    }
}

impl RrsStrategy for Threshold {
    const BIASED: bool = true;

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.eps)
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.eps.to_bits(), 0, 0, 0]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        v.beta.max_component().gt(F32x8::splat(self.eps)).zero_unless(F32x8::ONE)
    }
}
