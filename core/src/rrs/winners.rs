//! "Go with the winners" (Szirmay-Kalos, Antal and Sbert 2005): expected contribution of a path times the relative
//! standard deviation of its samples. The variance of a vertex is modelled as that of reflected light plus that of
//! visibility, which is less for narrower lobes.
//!
//! | parameter | unit | range | default |
//! |---|---|---|---|
//! | `reflected` | variance relative to the mean's square | >= 0 | 1 |
//! | `visible` | the same, for a diffuse surface | >= 0 | 3 |

use super::{RrsStrategy, Vertices8};
use core::fmt;
use croupier_simd::F32x8;

/// Go with the winners: max rgb of (prefix weight x albedo) x sqrt(`reflected` + `visible` / (shininess + 1)^2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winners {
    /// Relative variance of reflected light.
    pub reflected: f32,
    /// Relative variance of visibility.
    pub visible: f32,
}

impl Winners {
    pub(super) fn parse(options: &str) -> Option<Self> {
        let (reflected, visible) = options.split_once(':').unwrap_or((options, ""));
        let x = Self { reflected: super::number(reflected, 1.0)?, visible: super::number(visible, 3.0)? };
        (x.reflected >= 0.0 && x.visible >= 0.0).then_some(x)
    }
}

impl RrsStrategy for Winners {
    const NEEDS_ALBEDO: bool = true;
    const NEEDS_SHININESS: bool = true;

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.reflected, self.visible)
    }

    fn option_bits(&self) -> [u32; 4] {
        [self.reflected.to_bits(), self.visible.to_bits(), 0, 0]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let narrow = v.shininess + F32x8::ONE;
        let variance = F32x8::splat(self.reflected) + F32x8::splat(self.visible) / (narrow * narrow);
        (v.beta * v.albedo).max_component() * variance.sqrt()
    }
}
