//! Factors per pixel and path length (Bolin and Meyer 1997): those of EARS with statistics that know nothing but the block of
//! pixels and the depth. Two vertices of one depth under one pixel get the same factor however much they differ.

use super::{RrsStrategy, Space, Vertices8, ears};
use croupier_simd::F32x8;

/// The most efficient factor for the contributions of this depth; 1 until there are any.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BolinMeyer;

impl BolinMeyer {
    pub(super) fn parse(options: &str) -> Option<Self> {
        options.is_empty().then_some(Self)
    }
}

impl RrsStrategy for BolinMeyer {
    const NEEDS_ALBEDO: bool = true;
    const SPACE: Option<Space> = Some(Space::Image);

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        let l = &v.learned;
        let known = l.count.gt(F32x8::ZERO) & l.cost_over_variance.gt(F32x8::ZERO);
        known.select(ears::split_or_kill(l, v.beta), F32x8::ONE)
    }
}
