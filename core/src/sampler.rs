//! What paths draw random numbers for, and where those come from. Another sampler is another file beside
//! `sampler/sobol.rs`, and a [`Sampler`].
//!
//! Every camera sample, sample of a vertex and vertex has a key ([`Key8`]); what a vertex or a sample draws are the
//! dimension blocks of its key, four numbers each.
//!
//! With [`Sampler::Hashed`] all bits of a key are random, and a block is a hash of them. With [`Sampler::Sobol`] a key
//! either is such a one, of which bit 63 is set, or it belongs to a sequence: then its low word is the same for all
//! samples of a half of a pixel, and its high word is the number of the camera sample in the half. Its blocks are
//! points of that number, of a sequence with a scramble of its own for each block, depth, half and pixel. Samples of
//! the first [`SOBOL_DEPTH`] vertices belong to sequences. Those that splitting makes of one path are siblings, each
//! with a number, and each number has a sequence of its own: they are independent of each other, and each is spread
//! evenly among the siblings of its number in the other paths of the pixel.
//!
//! What holds for both: numbers of different blocks and keys are independent, but for the samples of a half of a pixel
//! ([`Half`](crate::film::Half)): the film measures by the difference of the halves how well they are spread. Sequences
//! go on from iteration to iteration, so that an iteration fills what those before left open. What iterations learn may
//! decide how many samples roulette and splitting take, whose numbers belong to no sequence: expectations stay what
//! they are for any such decision. It must not decide what a number means, or how many points a pixel takes: its next
//! points depend on those before. So all pixels have sequences of their own in each iteration with adaptive sampling
//! ([`Origin::apart`]), and guided ones have them from the first bounce on that a guide may decide about
//! ([`Key8::of_iteration`]). What a guided sample draws before that bounce goes on, without adaptive sampling, and the light
//! sample at its vertex too: it must not be weighted by what the guide knows then.

mod sobol;

use crate::names::names;
use crate::rng::{Key8, mix};
use croupier_simd::{F32x8, Mask8, U32x8};

/// Where the numbers of paths come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampler {
    /// Independent numbers, hashes of pixel, sample and depth.
    Hashed,
    /// Owen-scrambled Sobol' points for the samples of a pixel, which are spread more evenly.
    #[default]
    Sobol,
}

names!(Sampler: Hashed = "hashed", Sobol = "sobol");

/// A key, and where its numbers come from.
#[derive(Clone, Copy, Debug)]
pub struct Numbers8 {
    /// The sampler that the key was made with.
    pub sampler: Sampler,
    /// The key.
    pub key: Key8,
}

impl Numbers8 {
    /// Independent numbers.
    pub const fn hashed(key: Key8) -> Self {
        Self { sampler: Sampler::Hashed, key }
    }
}

/// Vertices of a path whose samples may belong to sequences: beyond, numbers are hashed.
const SOBOL_DEPTH: u32 = 4;

/// Bit of a high word with which a key belongs to no sequence.
const HASHED: u32 = 1 << 31;
/// Bit of a high word whose key belongs to a sequence of one iteration alone.
const APART: u32 = 1 << 30;

/// Dimension blocks of a camera sample's key.
const PIXEL_BLOCK: u32 = 0;
const TIME_BLOCK: u32 = 1;
/// Dimension blocks of the key of a vertex's sample.
const SCATTER_BLOCK: u32 = 0;
const LIGHT_BLOCK: u32 = 1;
const SHADOW_BLOCK: u32 = 2;
const GUIDE_BLOCK: u32 = 3;
/// Dimension blocks of a vertex's key.
const STRAIGHT_BLOCK: u32 = 0;
const JITTER_BLOCK: u32 = 1;

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
    /// Key of the camera samples `sample` of an iteration, of which the first `in_first_half` belong to the first half
    /// of their pixel.
    #[inline(always)]
    pub(crate) fn camera_sample(
        sampler: Sampler,
        origin: Origin,
        pixel: U32x8,
        [sample, in_first_half]: [U32x8; 2],
    ) -> Self {
        match sampler {
            Sampler::Hashed => Self::camera(origin.seed, pixel, sample + U32x8::splat(origin.first)),
            Sampler::Sobol => {
                let first = sample.lt(in_first_half);
                let half = U32x8::select(first, U32x8::splat(0), U32x8::splat(1));
                let sequence = |seed| Self::camera(seed, pixel, half).lo;
                let within = U32x8::select(first, sample, sample - in_first_half);
                let before = halves(origin.first).map(U32x8::splat);
                let (lo, hi) = (sequence(origin.seed), within + U32x8::select(first, before[0], before[1]));
                let alone = if origin.alone { APART } else { 0 };
                Self { lo, hi: hi & U32x8::splat(!(HASHED | APART)) | U32x8::splat(alone) }
            }
        }
    }

    /// Lanes of keys of sequences that go on from iteration to iteration.
    #[inline(always)]
    pub(crate) fn goes_on(self, sampler: Sampler) -> Mask8 {
        match sampler {
            Sampler::Hashed => Mask8::NONE,
            Sampler::Sobol => self.hi.lt(U32x8::splat(APART)),
        }
    }

    /// In these lanes, of [`Self::goes_on`], keys of sequences of iteration `number` alone.
    #[inline(always)]
    pub(crate) fn of_iteration(self, number: u64, lanes: Mask8) -> Self {
        let seed = U32x8::splat((mix(number) >> 32) as u32);
        Self {
            lo: U32x8::select(lanes, self.lo ^ seed, self.lo),
            hi: U32x8::select(lanes, self.hi | U32x8::splat(APART), self.hi),
        }
    }

    /// Position in the pixel (two numbers) and on the lens (two).
    #[inline(always)]
    pub(crate) fn pixel_and_lens(self, sampler: Sampler) -> [F32x8; 4] {
        self.block(sampler, PIXEL_BLOCK).map(U32x8::to_unit)
    }

    /// Time of a camera sample; drawn only in scenes where something moves.
    #[inline(always)]
    pub(crate) fn time(self, sampler: Sampler) -> F32x8 {
        let [u, ..] = self.block(sampler, TIME_BLOCK);
        u.to_unit()
    }

    /// Numbers of a camera sample's or vertex sample's first (next) vertex, which has `depth` segments before it.
    #[inline(always)]
    pub(crate) fn next_vertex(self, sampler: Sampler, depth: U32x8) -> Self {
        let none = U32x8::splat(0);
        match sampler {
            Sampler::Hashed => self.child(none),
            Sampler::Sobol => self.descend(none, depth.lt(U32x8::splat(SOBOL_DEPTH + 1))),
        }
    }

    /// Numbers of sample `n` of a vertex.
    #[inline(always)]
    pub(crate) fn sample(self, sampler: Sampler, n: U32x8) -> Self {
        match sampler {
            Sampler::Hashed => self.child(n),
            Sampler::Sobol => self.descend(n, Mask8::all_lanes()),
        }
    }

    /// Direction (two numbers) and lobe of the scattered ray of a sample.
    #[inline(always)]
    pub(crate) fn scattering(self, sampler: Sampler) -> [F32x8; 3] {
        let [u, v, lobe, _] = self.block(sampler, SCATTER_BLOCK).map(U32x8::to_unit);
        [u, v, lobe]
    }

    /// Light (one word) and place on it (three) of the light sample of a sample.
    #[inline(always)]
    pub(crate) fn light(self, sampler: Sampler) -> [U32x8; 4] {
        match sampler {
            Sampler::Hashed => self.words(LIGHT_BLOCK),
            Sampler::Sobol => {
                // the best pair of coordinates for the place
                let [u, v, light, w] = self.sobol(LIGHT_BLOCK);
                [light, u, v, w]
            }
        }
    }

    /// Roulette for the shadow ray of a sample.
    #[inline(always)]
    pub(crate) fn shadow_roulette(self) -> F32x8 {
        let [u, ..] = self.uniforms(SHADOW_BLOCK);
        u
    }

    /// Words of a sample's guided direction; see [`crate::learn::guiding::Guide::sample`].
    #[inline(always)]
    pub(crate) fn guided_direction(self, sampler: Sampler) -> [U32x8; 4] {
        self.block(sampler, GUIDE_BLOCK)
    }

    /// Does light pass the surface at which the vertex of this key would be?
    #[inline(always)]
    pub(crate) fn straight(self) -> F32x8 {
        let [u, ..] = self.uniforms(STRAIGHT_BLOCK);
        u
    }

    /// Key of the next surface or stretch of a ray that goes straight on.
    #[inline(always)]
    pub(crate) fn straight_on(self, sampler: Sampler) -> Self {
        let n = U32x8::splat(u32::MAX);
        match sampler {
            Sampler::Hashed => self.child(n),
            Sampler::Sobol => self.descend(n, Mask8::all_lanes()),
        }
    }

    /// Key of the stretch of a sample's shadow ray behind so many surfaces.
    #[inline(always)]
    pub(crate) fn shadow_stretch(self, sampler: Sampler, passed: u32) -> Self {
        let n = U32x8::splat(!passed);
        match sampler {
            Sampler::Hashed => self.child(n),
            Sampler::Sobol => self.descend(n, Mask8::all_lanes()),
        }
    }

    /// Steps 2 `pair` and 2 `pair` + 1 of a flight through a medium: each the words of an optical depth and of a choice.
    #[inline(always)]
    pub(crate) fn flight_steps(self, sampler: Sampler, pair: u32) -> [[U32x8; 2]; 2] {
        let [a, b, c, d] = self.first_block(sampler, FLIGHT_BLOCK, pair);
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
    pub(crate) fn transmittance_steps(self, sampler: Sampler, four: u32) -> [U32x8; 4] {
        self.first_block(sampler, TRANSMITTANCE_BLOCK, four)
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

    /// Offset of a vertex's look-up in the cache, three numbers. With hashed numbers the bits of the key itself, of
    /// which everything that the vertex draws is a hash. The low 8 of each word, which the first two axes do not see,
    /// make the third.
    #[inline(always)]
    pub(crate) fn cache_jitter(self, sampler: Sampler) -> [F32x8; 3] {
        if sampler == Sampler::Sobol {
            let [x, y, z, _] = self.uniforms(JITTER_BLOCK);
            return [x, y, z];
        }
        let rest = self.lo << 24 | (self.hi & U32x8::splat(0xff)) << 16;
        [self.lo, self.hi, rest].map(U32x8::to_unit)
    }

    /// Numbers of a block.
    #[inline(always)]
    fn block(self, sampler: Sampler, block: u32) -> [U32x8; 4] {
        match sampler {
            Sampler::Hashed => self.words(block),
            Sampler::Sobol => self.sobol(block),
        }
    }

    /// Block `first + n`. Of those after the first, which few paths draw, numbers are hashed.
    #[inline(always)]
    fn first_block(self, sampler: Sampler, first: u32, n: u32) -> [U32x8; 4] {
        if n == 0 { self.block(sampler, first) } else { self.words(first + n) }
    }

    /// [`Self::block`] of keys of which some belong to sequences.
    #[inline(never)]
    fn sobol(self, block: u32) -> [U32x8; 4] {
        let hashed = self.is_hashed();
        // a half of more samples goes on with another sequence
        let sequence = self.hi >> sobol::INDEX_BITS | U32x8::splat(HASHED);
        let seeds = Self { lo: self.lo, hi: U32x8::select(hashed, self.hi, sequence) }.words(block);
        if hashed.all() {
            return seeds;
        }
        let index = self.hi & U32x8::splat((1 << sobol::INDEX_BITS) - 1);
        let [a, b, c, d] = sobol::points(index, seeds);
        let [e, f, g, h] = seeds;
        [(e, a), (f, b), (g, c), (h, d)].map(|(seed, x)| U32x8::select(hashed, seed, x))
    }

    /// Child number `n`; of keys of sequences those of the lanes of `keep` belong to one.
    #[inline(never)]
    fn descend(self, n: U32x8, keep: Mask8) -> Self {
        let keep = keep.and_not(self.is_hashed());
        let child = Self { lo: self.lo, hi: U32x8::select(keep, U32x8::splat(HASHED), self.hi) }.child(n);
        Self { lo: child.lo, hi: U32x8::select(keep, self.hi, child.hi | U32x8::splat(HASHED)) }
    }

    /// Lanes whose key belongs to no sequence.
    #[inline(always)]
    fn is_hashed(self) -> Mask8 {
        (self.hi >> 31).eq(U32x8::splat(1))
    }
}

/// Samples in the two halves ([`Half`](crate::film::Half)) of the first `n` samples of a pixel.
#[inline(always)]
fn halves(n: u32) -> [u32; 2] {
    [n - n / 2, n / 2]
}

/// How many samples of an iteration of `samples`, after so many, belong to the first half of their pixel: the first of
/// them, and as many as make it as large as the second one, or larger by one.
#[inline(always)]
pub(crate) fn in_first_half(before: u32, samples: u32) -> u32 {
    let [after, before] = [before.wrapping_add(samples), before].map(|n| halves(n)[0]);
    // none where numbers of samples begin anew at 0
    after.saturating_sub(before).min(samples)
}

/// What the numbers of an iteration depend on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Origin {
    /// Seed of the sequences.
    pub seed: u64,
    /// Number of the iteration.
    pub iteration: u64,
    /// Samples per pixel before it.
    pub first: u32,
    /// Are all sequences of this iteration alone?
    pub alone: bool,
}

impl Origin {
    /// For sequences of this iteration alone.
    pub(crate) fn apart(self) -> Self {
        let seed = self.seed ^ self.iteration.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Self { seed, iteration: 0, first: 0, alone: true }
    }
}

#[cfg(test)]
mod tests;
