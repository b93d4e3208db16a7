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
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// No bit of a key moves two axes, each axis has its whole range. Killed by: an axis used twice, a shift by less.
    #[test]
    fn axes_share_no_bits() {
        let bits = |lo: u32, hi: u32| {
            Key8 { lo: U32x8::splat(lo), hi: U32x8::splat(hi) }.cache_jitter(Sampler::Hashed).map(|x| x.lane(5))
        };
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
    /// that is drawn again, the bits of a sequence's key.
    #[test]
    fn jitter_is_uniform_and_independent() {
        for sampler in [Sampler::Hashed, Sampler::Sobol] {
            let mut rows: Vec<[f64; 6]> = Vec::new();
            for k in 0..8192u32 {
                let pixel = U32x8::from_fn(|i| 8 * k + i as u32);
                let key = vertex(sampler, 1, pixel, U32x8::splat(k & 3));
                let (j, drawn) = (key.cache_jitter(sampler), key.sample(sampler, ZERO).scattering(sampler));
                let column = |c: usize| if c < 3 { j[c] } else { drawn[c - 3] };
                rows.extend((0..8).map(|i| core::array::from_fn(|c| f64::from(column(c).lane(i)))));
            }
            let mean = |f: &dyn Fn(&[f64; 6]) -> f64| rows.iter().map(f).sum::<f64>() / rows.len() as f64;
            for a in 0..3 {
                for b in 0..6 {
                    let moment = 12.0 * mean(&|r| (r[a] - 0.5) * (r[b] - 0.5));
                    let expected = if a == b { 1.0 } else { 0.0 };
                    assert!((moment - expected).abs() < 0.02, "{sampler:?}, axes {a} and {b}: {moment}");
                }
                assert!((mean(&|r| r[a]) - 0.5).abs() < 0.006, "{sampler:?}, axis {a}");
            }
        }
    }

    const ZERO: U32x8 = U32x8::splat(0);

    /// Keys of the first vertices of camera samples.
    fn vertex(sampler: Sampler, iteration: u64, pixel: U32x8, sample: U32x8) -> Key8 {
        let origin = Origin { seed: 9, iteration, first: 0, alone: false };
        let key = Key8::camera_sample(sampler, origin, pixel, [sample, U32x8::splat(64)]);
        let key = key.next_vertex(sampler, U32x8::splat(1));
        key.of_iteration(iteration, key.goes_on(sampler))
    }

    /// What 64 samples of a pixel draw with Sobol' points at vertex `depth`: sample number `n` of each.
    fn drawn(iteration: u64, pixel: u32, depth: u32, n: u32) -> Vec<[[f32; 3]; 2]> {
        let (s, mut out) = (Sampler::Sobol, Vec::new());
        for first in (0..64).step_by(8) {
            let mut key = vertex(s, iteration, U32x8::splat(pixel), U32x8::from_fn(|i| first + i as u32));
            for d in 2..=depth {
                key = key.sample(s, ZERO).next_vertex(s, U32x8::splat(d));
            }
            let sample = key.sample(s, U32x8::splat(n));
            let (scattering, [light, u, v, _]) = (sample.scattering(s), sample.light(s).map(U32x8::to_unit));
            let numbers = [scattering, [u, v, light]];
            out.extend((0..8).map(|i| numbers.map(|x| x.map(|x| x.lane(i)))));
        }
        out
    }

    /// Number of the 64 cells of 8 x 8 that have points of the first pair of a block.
    fn cells(points: &[[[f32; 3]; 2]], block: usize) -> usize {
        let cell = |p: &[[f32; 3]; 2]| (p[block][0] * 8.0) as usize * 8 + (p[block][1] * 8.0) as usize;
        points.iter().map(cell).collect::<std::collections::HashSet<_>>().len()
    }

    /// Samples of vertices 1 to 4 belong to sequences, in every block, whatever their number among siblings; later ones
    /// do not: 64 independent points leave 23 of 64 cells empty. Killed by: a depth that is off by one, a child that
    /// forgets its sample's number, keys of one depth in another.
    #[test]
    fn samples_of_early_vertices_are_stratified() {
        for pixel in 0..8 {
            for depth in 1..=SOBOL_DEPTH + 2 {
                for n in [0, 1, 7] {
                    let points = drawn(1, pixel, depth, n);
                    for block in 0..2 {
                        let found = cells(&points, block);
                        let sequence = depth <= SOBOL_DEPTH;
                        let expected = if sequence { found == 64 } else { (30..52).contains(&found) };
                        assert!(expected, "pixel {pixel}, depth {depth}, sibling {n}: {found} cells of 64");
                    }
                }
            }
        }
    }

    /// First steps through media belong to sequences as samples of vertices do: flights to vertices 1 to 4, and shadow rays
    /// from there, behind however many surfaces; later steps do not. With hashed numbers all are words of the key.
    /// Killed by: a block of steps that is hashed, a stretch whose key leaves the sequence or is that of another.
    #[test]
    fn first_steps_through_media_are_stratified() {
        let intervals = |words: &dyn Fn(Key8) -> U32x8, sampler, depth: u32| {
            let mut found = std::collections::HashSet::new();
            for first in (0..64).step_by(8) {
                let mut key = vertex(sampler, 1, U32x8::splat(5), U32x8::from_fn(|i| first + i as u32));
                for d in 2..=depth {
                    key = key.sample(sampler, ZERO).next_vertex(sampler, U32x8::splat(d));
                }
                found.extend(words(key).to_array().map(|w| w >> 26));
            }
            found.len()
        };
        for sampler in [Sampler::Sobol, Sampler::Hashed] {
            for depth in 1..=SOBOL_DEPTH + 1 {
                for n in 0..2 {
                    let spread = sampler == Sampler::Sobol && depth <= SOBOL_DEPTH && n == 0;
                    let check = |found: usize, what: &str| {
                        let expected = if spread { found == 64 } else { (30..52).contains(&found) };
                        assert!(expected, "{sampler:?}, depth {depth}, block {n}, {what}: {found} of 64");
                    };
                    for word in 0..4 {
                        let flight = |key: Key8| key.flight_steps(sampler, n)[word / 2][word % 2];
                        check(intervals(&flight, sampler, depth), "flight");
                        for passed in [0, 1, 9] {
                            let through = |key: Key8| {
                                let stretch = key.sample(sampler, ZERO).shadow_stretch(sampler, passed);
                                stretch.transmittance_steps(sampler, n)[word]
                            };
                            check(intervals(&through, sampler, depth), "transmittance");
                        }
                    }
                }
            }
        }
        let key = vertex(Sampler::Hashed, 1, ZERO, ZERO);
        let [a, b] = [0, 1].map(|passed| key.shadow_stretch(Sampler::Hashed, passed));
        assert_ne!((a.lo, a.hi), (b.lo, b.hi));
        assert_eq!(key.flight_steps(Sampler::Hashed, 0).concat(), key.words(FLIGHT_BLOCK));
        assert_eq!(a.transmittance_steps(Sampler::Hashed, 0), a.words(TRANSMITTANCE_BLOCK));
    }

    /// Siblings, depths, blocks, pixels and iterations: no two draw alike. Over 512 pixels the correlation of what the
    /// same camera sample draws is below 0.13, 3 standard deviations of one pair and 5 of none of these. Killed by: a
    /// scramble that two of them share, an iteration that begins as the one before.
    #[test]
    fn sequences_are_independent() {
        let columns: Vec<Vec<f64>> =
            [(1, 1, 0, 0), (1, 1, 1, 0), (1, 2, 0, 0), (1, 1, 0, 1), (2, 1, 0, 0), (1, 5, 0, 0)]
                .into_iter()
                .map(|(iteration, depth, n, block)| {
                    (0..512).map(|p| f64::from(drawn(iteration, p, depth, n)[3][block][0]) - 0.5).collect()
                })
                .chain([(0..512).map(|p| f64::from(drawn(1, p + 1, 1, 0)[3][0][0]) - 0.5).collect()])
                .collect();
        for a in 0..columns.len() {
            for b in 0..=a {
                let r = columns[a].iter().zip(&columns[b]).map(|(a, b)| a * b).sum::<f64>() * 12.0 / 512.0;
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((r - expected).abs() < 0.22, "columns {a} and {b}: {r}");
            }
        }
    }

    /// The sequence of each half goes on from iteration to iteration: its 64 samples fill all 64 cells, however they
    /// are divided, and so do what goes before a bounce that is guided, but not that bounce, whose numbers are independent
    /// of those of iterations before. Killed by: an iteration that begins anew, one that repeats points, lanes that are
    /// guided and others exchanged, halves of other sizes.
    #[test]
    fn sequences_go_on_in_each_half() {
        let s = Sampler::Sobol;
        for (lengths, odd) in
            [(&[128][..], false), (&[1, 1, 2, 4, 8, 112], false), (&[3, 5, 50, 70], false), (&[60, 68], true)]
        {
            let mut cells = [(); 2].map(|()| [(); 3].map(|()| std::collections::HashSet::new()));
            let (mut before, mut counts) = (0, [0; 2]);
            for (iteration, &samples) in lengths.iter().enumerate() {
                let origin = Origin { seed: 9, iteration: iteration as u64 + 1, first: before, alone: false };
                let first = in_first_half(before, samples);
                for sample in 0..samples {
                    let numbers = [sample, first].map(U32x8::splat);
                    let key = Key8::camera_sample(s, origin, U32x8::splat(3), numbers);
                    let vertex = key.next_vertex(s, U32x8::splat(1)).sample(s, ZERO);
                    let guided = Mask8::from_bits(0b1010_1010) & vertex.goes_on(s);
                    let bounce = vertex.of_iteration(origin.iteration, guided);
                    assert!(vertex.goes_on(s).all() && bounce.goes_on(s).bits() == 0b0101_0101);
                    let half = usize::from(sample >= first);
                    let [pixel, light] = [key.pixel_and_lens(s), vertex.light(s).map(U32x8::to_unit)];
                    let direction = bounce.scattering(s);
                    let lane = usize::from(odd);
                    let drawn = [[pixel[0], pixel[1]], [light[1], light[2]], [direction[0], direction[1]]];
                    for (cells, [u, v]) in cells[half].iter_mut().zip(drawn) {
                        cells.insert((u.lane(lane) * 8.0) as usize * 8 + (v.lane(lane) * 8.0) as usize);
                    }
                    counts[half] += 1;
                }
                before += samples;
                assert!(counts[0] == counts[1] || counts[0] == counts[1] + 1, "{counts:?} of {before}");
            }
            for [pixel, light, bounce] in cells.map(|half| half.map(|cells| cells.len())) {
                assert_eq!((pixel, light, bounce == 64), (64, 64, !odd), "{lengths:?}: {bounce} cells");
            }
        }
    }

    /// With sequences of one iteration alone, the samples of a half fill all cells, none goes on at any depth, so that
    /// bounces that a guide decides about have no others, and another iteration draws other numbers. Killed by: keys that are
    /// taken for ones that go on, hashed ones, an iteration that repeats points.
    #[test]
    fn sequences_alone_do_not_go_on() {
        let s = Sampler::Sobol;
        let drawn = |iteration: u64| {
            let mut cells = std::collections::HashSet::new();
            let mut first = [0.0; 2];
            for sample in (0..64).step_by(8) {
                let origin = Origin { seed: 9, iteration, first: 7, alone: false }.apart();
                let numbers = [U32x8::from_fn(|i| sample + i as u32), U32x8::splat(64)];
                let mut key = Key8::camera_sample(s, origin, U32x8::splat(3), numbers);
                assert!(key.goes_on(s).none());
                for depth in 1..=SOBOL_DEPTH {
                    key = key.next_vertex(s, U32x8::splat(depth)).sample(s, ZERO);
                    assert!(key.goes_on(s).none() && key.is_hashed().none(), "depth {depth}");
                }
                let [u, v, _] = key.scattering(s);
                for i in 0..8 {
                    cells.insert((u.lane(i) * 8.0) as usize * 8 + (v.lane(i) * 8.0) as usize);
                }
                first = [u.lane(0), v.lane(0)];
            }
            assert_eq!(cells.len(), 64, "iteration {iteration}");
            first
        };
        assert_ne!(drawn(1), drawn(2));
    }

    /// The halves of a pixel draw independently of each other: over 512 pixels the correlation of their samples is
    /// below 0.22, 5 standard deviations. Killed by: one scramble for both.
    #[test]
    fn halves_are_independent() {
        let s = Sampler::Sobol;
        let origin = Origin { seed: 9, iteration: 1, first: 0, alone: false };
        for n in [0, 1, 5] {
            let product = |pixel: u32| {
                let sample = U32x8::from_fn(|i| n + 8 * (i as u32 & 1));
                let key = Key8::camera_sample(s, origin, U32x8::splat(pixel), [sample, U32x8::splat(8)]);
                let [u, ..] = key.pixel_and_lens(s);
                12.0 * f64::from(u.lane(0) - 0.5) * f64::from(u.lane(1) - 0.5)
            };
            let r = (0..512).map(product).sum::<f64>() / 512.0;
            assert!(r.abs() < 0.22, "sample {n}: {r}");
        }
    }

    /// Hashed numbers are what they were before there was a choice. Killed by: a key that another sampler changed.
    #[test]
    fn hashed_keys_are_hashes() {
        let (pixel, sample) = (U32x8::from_fn(|i| i as u32), U32x8::splat(5));
        let origin = Origin { seed: 9, iteration: 3, first: 40, alone: false };
        let key = Key8::camera_sample(Sampler::Hashed, origin, pixel, [sample, sample]);
        assert!(key.goes_on(Sampler::Hashed).none());
        let wanted = Key8::camera(9, pixel, U32x8::splat(45));
        assert_eq!((key.lo, key.hi), (wanted.lo, wanted.hi));
        let (a, b) = (key.next_vertex(Sampler::Hashed, ZERO), wanted.child(ZERO));
        assert_eq!((a.lo, a.hi), (b.lo, b.hi));
        assert_eq!(a.light(Sampler::Hashed), b.words(LIGHT_BLOCK));
    }
}
