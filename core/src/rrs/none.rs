//! No roulette and no splitting; `max_depth` is the only end. Biased by what lies beyond it (seeds 000, 003).

use super::{RrsStrategy, Vertices8};
use croupier_simd::F32x8;

/// Factor 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct None;

impl None {
    pub(super) fn parse(options: &str) -> Option<Self> {
        options.is_empty().then_some(Self)
    }
}

impl RrsStrategy for None {
    fn factor(&self, _: &Vertices8) -> F32x8 {
        F32x8::ONE
    }
}
