//! No roulette and no splitting: paths end at `max_depth` only, which biases the picture by the light beyond it.

use super::{RrsStrategy, Vertices8};
use croupier_simd::F32x8;

/// Neither roulette nor splitting: factor 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct None;

impl None {
    pub(super) fn parse(options: &str) -> Option<Self> {
        options.is_empty().then_some(Self)
    }
}

impl RrsStrategy for None {
    fn option_bits(&self) -> [u32; 4] {
        [0; 4]
    }

    fn factor(&self, _: &Vertices8) -> F32x8 {
        F32x8::ONE
    }
}
