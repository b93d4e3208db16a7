//! Factors per pixel and path length (Bolin and Meyer 1997): those of EARS with statistics that know nothing but the
//! block of pixels and the depth. Two vertices of one depth under one pixel get the same factor however much they
//! differ.
//!
//! Guarded as [`super::Ears`] is: trusted at once, statistics of a few fireflies split paths for ever or kill them, and
//! come back as samples so rare that a picture of 512 samples a pixel looks biased (kitchen).

use super::{RrsStrategy, Space, Vertices8, ears};
use core::fmt;
use croupier_simd::F32x8;

/// The most efficient factor for the contributions of this depth; that of `classic` where little is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BolinMeyer {
    /// Trust statistics at once.
    pub plain: bool,
}

impl BolinMeyer {
    pub(super) fn parse(options: &str) -> Option<Self> {
        ears::parse_plain(options).map(|plain| Self { plain })
    }
}

impl RrsStrategy for BolinMeyer {
    const NEEDS_ALBEDO: bool = true;
    const SPACE: Option<Space> = Some(Space::Image);

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.plain { "plain" } else { "" })
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        ears::grown(v, ears::split_or_kill(&v.learned, v.beta), self.plain)
    }
}
