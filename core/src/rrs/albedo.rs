//! Roulette by albedo (EARS sections 2 and 6.4): of this vertex, or of all vertices so far multiplied, which path
//! guiding needs because a guided throughput says nothing about how much light is left.

use super::{RrsStrategy, Vertices8};
use core::fmt;
use croupier_simd::F32x8;

/// Mean albedo of the vertex, or the product along the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Albedo {
    /// Multiply the albedos of all vertices so far.
    pub product: bool,
}

impl Albedo {
    pub(super) fn parse(options: &str) -> Option<Self> {
        match options {
            "" => Some(Self { product: false }),
            "product" => Some(Self { product: true }),
            _ => None,
        }
    }
}

impl RrsStrategy for Albedo {
    const NEEDS_ALBEDO: bool = true;

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.product { "product" } else { "" })
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let a = v.albedo.mean();
        let a = if self.product { a * v.albedo_product } else { a };
        a.min(F32x8::ONE)
    }
}
