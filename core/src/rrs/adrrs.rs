//! Adjoint-driven roulette and splitting (Vorba and Křivánek, SIGGRAPH 2016): a path keeps the weight at which its
//! expected contribution is the radiance of its pixel. Inside a window around that weight the factor is 1.
//!
//! | parameter | unit | value |
//! |---|---|---|
//! | [`LOWER`] | expected contribution over the pixel | 1/3 |
//! | [`UPPER`] | the same | 5/3 (a window of ratio 5 around 1) |

use super::{Classic, RrsStrategy, Space, Vertices8};
use croupier_simd::F32x8;

/// Lower end of the window, expected contribution over the pixel.
const LOWER: f32 = 1.0 / 3.0;
/// Upper end of the window, expected contribution over the pixel.
const UPPER: f32 = 5.0 / 3.0;
/// Samples of a bin at which its mean has as much weight as the rule that needs none.
const TRUST: f32 = 32.0;

/// Weight window: the factor that brings a path into it; the factor of `classic` where nothing is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Adrrs;

impl Adrrs {
    pub(super) fn parse(options: &str) -> Option<Self> {
        options.is_empty().then_some(Self)
    }
}

/// Factor that brings an expected contribution into the window.
#[inline(always)]
pub(super) fn window(v: F32x8) -> F32x8 {
    let (low, high) = (F32x8::splat(LOWER), F32x8::splat(UPPER));
    let s = v.lt(low).select(v / low, F32x8::ONE);
    v.gt(high).select(v / high, s)
}

/// Blend of `classic` and [`window`] by the samples behind the bin's mean.
#[inline(always)]
pub(super) fn guarded(v: &Vertices8) -> F32x8 {
    let l = &v.learned;
    let s = window(l.contribution(v.beta));
    let t = l.local.trust(TRUST);
    Classic::default().factor(v) * (F32x8::ONE - t) + s * t
}

impl RrsStrategy for Adrrs {
    const NEEDS_ALBEDO: bool = true;
    const SPACE: Option<Space> = Some(Space::Scene);

    fn option_bits(&self) -> [u32; 4] {
        [0; 4]
    }

    #[inline(always)]
    fn factor(&self, v: &Vertices8) -> F32x8 {
        guarded(v)
    }
}
