//! Roulette by the weight of the last bounce, `f cos / pdf` (Arvo and Kirk, SIGGRAPH 1990): the throughput then stays
//! near its value before the bounce.

use super::{RrsStrategy, Vertices8};
use croupier_simd::F32x8;

/// Roulette by the last bounce: the largest rgb of its weight, at most 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contribution;

impl Contribution {
    pub(super) fn parse(options: &str) -> Option<Self> {
        options.is_empty().then_some(Self)
    }
}

impl RrsStrategy for Contribution {
    fn option_bits(&self) -> [u32; 4] {
        [0; 4]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        v.last_weight.max_component().min(F32x8::ONE)
    }
}
