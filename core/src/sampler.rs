//! What paths draw random numbers for, and where those come from. Another sampler is another version of this file.
//!
//! Every camera sample, sample of a vertex and vertex has a key ([`Key8`]); what a vertex or a sample draws are the
//! dimension blocks of its key, four numbers each.

use crate::rng::Key8;
use croupier_simd::{F32x8, U32x8};

/// Dimension blocks of a camera sample's key.
const PIXEL_BLOCK: u32 = 0;
const TIME_BLOCK: u32 = 1;
/// Dimension blocks of the key of a vertex's sample.
const SCATTER_BLOCK: u32 = 0;
const LIGHT_BLOCK: u32 = 1;
const SHADOW_BLOCK: u32 = 2;
/// Dimension blocks of a vertex's key.
const STRAIGHT_BLOCK: u32 = 0;

/// Dimension blocks of the key of a segment through a medium: of flights, two steps each, then one for the roulette.
const FLIGHT_BLOCK: u32 = 16;
const FLIGHT_ROULETTE_BLOCK: u32 = FLIGHT_BLOCK + MAX_FLIGHT_STEPS / 2;
/// Of transmittances, four steps each, then as many for the roulette.
const TRANSMITTANCE_BLOCK: u32 = FLIGHT_ROULETTE_BLOCK + 1;
const TRANSMITTANCE_ROULETTE_BLOCK: u32 = TRANSMITTANCE_BLOCK + MAX_TRANSMITTANCE_STEPS / 4;

/// Most steps of a flight through a medium with one key.
pub(crate) const MAX_FLIGHT_STEPS: u32 = 64;
/// Most steps of a transmittance.
pub(crate) const MAX_TRANSMITTANCE_STEPS: u32 = 4096;

impl Key8 {
    /// Position in the pixel (two numbers) and on the lens (two).
    #[inline(always)]
    pub(crate) fn pixel_and_lens(self) -> [F32x8; 4] {
        self.uniforms(PIXEL_BLOCK)
    }

    /// Time of a camera sample; drawn only in scenes where something moves.
    #[inline(always)]
    pub(crate) fn time(self) -> F32x8 {
        let [u, ..] = self.uniforms(TIME_BLOCK);
        u
    }

    /// Numbers of a camera sample's or vertex sample's first (next) vertex.
    #[inline(always)]
    pub(crate) fn next_vertex(self) -> Self {
        self.child(U32x8::splat(0))
    }

    /// Numbers of sample `n` of a vertex.
    #[inline(always)]
    pub(crate) fn sample(self, n: U32x8) -> Self {
        self.child(n)
    }

    /// Direction (two numbers) and lobe of the scattered ray of a sample.
    #[inline(always)]
    pub(crate) fn scattering(self) -> [F32x8; 3] {
        let [u, v, lobe, _] = self.uniforms(SCATTER_BLOCK);
        [u, v, lobe]
    }

    /// Light (one word) and place on it (three) of the light sample of a sample.
    #[inline(always)]
    pub(crate) fn light(self) -> [U32x8; 4] {
        self.words(LIGHT_BLOCK)
    }

    /// Roulette for the shadow ray of a sample.
    #[inline(always)]
    pub(crate) fn shadow_roulette(self) -> F32x8 {
        let [u, ..] = self.uniforms(SHADOW_BLOCK);
        u
    }

    /// Does light pass the surface at which the vertex of this key would be?
    #[inline(always)]
    pub(crate) fn straight(self) -> F32x8 {
        let [u, ..] = self.uniforms(STRAIGHT_BLOCK);
        u
    }

    /// Key of the next surface or stretch of a ray that goes straight on.
    #[inline(always)]
    pub(crate) fn straight_on(self) -> Self {
        self.child(U32x8::splat(u32::MAX))
    }

    /// Steps 2 `pair` and 2 `pair` + 1 of a flight through a medium: each the words of an optical depth and of a choice.
    #[inline(always)]
    pub(crate) fn flight_steps(self, pair: u32) -> [[U32x8; 2]; 2] {
        let [a, b, c, d] = self.words(FLIGHT_BLOCK + pair);
        [[a, b], [c, d]]
    }

    /// Roulette at the end of a flight's steps.
    #[inline(always)]
    pub(crate) fn flight_roulette(self) -> F32x8 {
        let [u, ..] = self.uniforms(FLIGHT_ROULETTE_BLOCK);
        u
    }

    /// Words of the optical depths of steps 4 `four` to 4 `four` + 3 of a transmittance.
    #[inline(always)]
    pub(crate) fn transmittance_steps(self, four: u32) -> [U32x8; 4] {
        self.words(TRANSMITTANCE_BLOCK + four)
    }

    /// Roulette after a step of a transmittance.
    #[inline(always)]
    pub(crate) fn transmittance_roulette(self, step: u32) -> F32x8 {
        let [a, b, c, d] = self.uniforms(TRANSMITTANCE_ROULETTE_BLOCK + step / 4);
        match step % 4 {
            0 => a,
            1 => b,
            2 => c,
            _ => d,
        }
    }

    /// Offset of a vertex's look-up in the cache, three numbers: the bits of the key itself, of which everything that
    /// the vertex draws is a hash. The low 8 of each word, which the first two axes do not see, make the third.
    #[inline(always)]
    pub(crate) fn cache_jitter(self) -> [F32x8; 3] {
        let rest = self.lo << 24 | (self.hi & U32x8::splat(0xff)) << 16;
        [self.lo, self.hi, rest].map(U32x8::to_unit)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// No bit of a key moves two axes, each axis has its whole range. Killed by: an axis used twice, a shift by less.
    #[test]
    fn axes_share_no_bits() {
        let bits =
            |lo: u32, hi: u32| Key8 { lo: U32x8::splat(lo), hi: U32x8::splat(hi) }.cache_jitter().map(|x| x.lane(5));
        assert_eq!(bits(0, 0), [0.0; 3]);
        assert!(bits(!0, !0).iter().all(|x| (0.9999..1.0).contains(x)));
        for bit in 0..64 {
            let key = 1u64 << bit;
            let moved = bits(key as u32, (key >> 32) as u32).iter().filter(|x| **x > 0.0).count();
            assert_eq!(moved, 1, "bit {bit}");
        }
    }

    /// Of keys as vertices have them: uniform, and no axis goes with another or with what the first sample draws to
    /// scatter. 64k keys, so that correlations of 0.02 are 5 standard deviations. Killed by: keys that count, an axis
    /// that is drawn again.
    #[test]
    fn jitter_is_uniform_and_independent() {
        let mut rows: Vec<[f64; 7]> = Vec::new();
        for k in 0..8192u32 {
            let index = U32x8::from_fn(|i| 8 * k + i as u32);
            let key = Key8::camera(1, index, U32x8::splat(k & 3)).next_vertex();
            let (j, drawn) = (key.cache_jitter(), key.sample(U32x8::splat(0)).uniforms(SCATTER_BLOCK));
            let column = |c: usize| if c < 3 { j[c] } else { drawn[c - 3] };
            rows.extend((0..8).map(|i| core::array::from_fn(|c| f64::from(column(c).lane(i)))));
        }
        let mean = |f: &dyn Fn(&[f64; 7]) -> f64| rows.iter().map(f).sum::<f64>() / rows.len() as f64;
        for a in 0..3 {
            for b in 0..7 {
                let moment = 12.0 * mean(&|r| (r[a] - 0.5) * (r[b] - 0.5));
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((moment - expected).abs() < 0.02, "axes {a} and {b}: {moment}");
            }
            assert!((mean(&|r| r[a]) - 0.5).abs() < 0.006, "axis {a}");
        }
    }
}
