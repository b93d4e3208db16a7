//! Roulette by albedo (EARS, SIGGRAPH 2022, sections 2 and 6.4): of this vertex, or the product over all vertices so
//! far. Path guiding needs the product, because a guided throughput does not say how much light is left.

use super::{RrsStrategy, Vertices8};
use core::fmt;
use croupier_simd::F32x8;

/// Roulette by the mean albedo of the vertex, or by the product along the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Albedo {
    /// Product of the albedos of all vertices so far, instead of the albedo of this vertex.
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

    fn option_bits(&self) -> [u32; 4] {
        [self.product.into(), 0, 0, 0]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let a = v.albedo.mean();
        let a = if self.product { a * v.albedo_product } else { a };
        a.min(F32x8::ONE)
    }
}
