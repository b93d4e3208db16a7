//! Adjoint-driven roulette (Vorba and Křivánek, SIGGRAPH 2016): the roulette of [`super::Adrrs`] without its splitting.

use super::{RrsStrategy, Space, Vertices8, adrrs};
use croupier_simd::F32x8;

/// Weight window without splitting: its factor, at most 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Adrr;

impl Adrr {
    pub(super) fn parse(options: &str) -> Option<Self> {
        options.is_empty().then_some(Self)
    }
}

impl RrsStrategy for Adrr {
    const NEEDS_ALBEDO: bool = true;
    const SPACE: Option<Space> = Some(Space::Scene);

    fn option_bits(&self) -> [u32; 4] {
        [0; 4]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        adrrs::guarded(v).min(F32x8::ONE)
    }
}
