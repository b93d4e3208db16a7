//! Share of a leaf's samples that is guided, in closed form: a sample of a mixture tells what second moment any other
//! mixture would have had. With q the guide's density, p the BSDF's, and m = g q + (1 - g) p the one that was sampled,
//!
//! ```text
//! integral of F^2 / m_k  =  E[ X^2 m / m_k ],      X = F / m,      m_k = g_k q + (1 - g_k) p
//! ```
//!
//! for each of eight shares g_k, one vector of eight lanes. Where pixels that are not guided teach too, m is the one mixture
//! that all samples count as (`tracer/guided.rs`, `as_one_mixture`). q is that of an earlier iteration, so what it promises is
//! not what it was fitted to. Where few samples tell (by their effective number, (sum X^2)^2 / sum X^4) the moments are
//! shrunk towards those of a useless guide, 1 / (1 - g_k) of that without it: little knowledge means BSDF sampling.
//!
//! Not the share with the least moment is taken, but the largest one whose moment is at most [`TOLERANCE`] above it. X^2 has
//! the noise of the rest of the path in it, most of it where light is found after several bounces, and there a direction
//! matters little as long as the rest is noisy: each leaf by itself would not be guided, and all of them together gain.

use bytemuck::{Pod, Zeroable};
use croupier_simd::F32x8;

/// Shares to choose from. The largest bounds what a guide that is wrong everywhere costs: 1 / (1 - 3/4) times the
/// second moment.
const SHARES: [f32; 8] = [0.0, 0.0625, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75];

/// The largest share in 65536ths.
pub(super) const MOST_FRACTION: u32 = 49_152;

/// Effective samples that a useless guide counts for.
const PRIOR: f64 = 2.0;

/// Effective samples that an arrival of a light path counts for: directions were learned from the same ones, and that the
/// surface is diffuse is a guess.
const PER_ARRIVAL: f32 = 0.25;
/// Most effective samples that all of them count for.
const MOST_PRIOR: f32 = 32.0;

/// How much more than the least moment a larger share may have. Below 1/7, so that a useless guide gets less than
/// [`LEAST_SHARE`].
const TOLERANCE: f64 = 0.1;

/// Index of the smallest share of [`SHARES`] that is guided; a useless guide would be given the one below.
const LEAST_SHARE: usize = 2;

/// What a leaf has learned besides its directions.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct LeafSums {
    /// Contributions, older ones discounted.
    pub(super) hits: f32,
    /// Sum of the squares of contributions where the guide's density was known.
    square: f32,
    /// Sum of their squares.
    fourth: f32,
    reserved: f32,
    /// Sums of the squares if the share had been each of [`SHARES`].
    moments: [f32; 8],
}

impl LeafSums {
    /// Nothing learned.
    pub(super) const EMPTY: Self = Self { hits: 0.0, square: 0.0, fourth: 0.0, reserved: 0.0, moments: [0.0; 8] };

    /// Adds a contribution with this square; `share` is that of the guide in the sum of both densities, `fraction` the
    /// share of samples that were guided.
    pub(super) fn add(&mut self, square: f32, share: Option<f32>, fraction: f32, weight: f32) {
        self.hits += weight;
        let Some(t) = share else { return };
        let mixed = |g: f32| g * t + (1.0 - g) * (1.0 - t);
        let shares = F32x8::new(SHARES);
        let others = shares * t + (1.0 - shares) * (1.0 - t);
        let (x, limit) = (square * weight, F32x8::splat(f32::MAX));
        let moments = F32x8::new(self.moments) + F32x8::splat(x * mixed(fraction)) / others;
        self.moments = moments.min(limit).to_array();
        self.square = (self.square + x).min(f32::MAX);
        self.fourth = (self.fourth + x * x).min(f32::MAX);
    }

    /// Multiplies what was learned by `keep`, the moments by its square: densities change from iteration to iteration.
    pub(super) fn discount(&mut self, keep: f32) {
        self.hits *= keep;
        self.scale_moments(keep * keep);
    }

    /// Adds a share of what another leaf has learned.
    pub(super) fn merge(&mut self, o: &Self, share: f32) {
        let mut part = *o;
        part.scale_moments(share);
        let add = |a: &mut f32, b: f32| *a = (*a + b).min(f32::MAX);
        add(&mut self.hits, o.hits * share);
        add(&mut self.square, part.square);
        add(&mut self.fourth, part.fourth);
        self.moments.iter_mut().zip(part.moments).for_each(|(a, b)| add(a, b));
    }

    /// The part of one of eight children.
    pub(super) fn eighth(&self) -> Self {
        let mut part = *self;
        part.hits *= 0.125;
        part.scale_moments(0.125);
        part
    }

    /// Makes sums over arrivals of light paths what they would be over a few contributions of this mean square.
    pub(super) fn become_prior(&mut self, mean_square: f32) {
        let known = self.square * self.square / self.fourth;
        let n = (known * PER_ARRIVAL).min(MOST_PRIOR);
        if known > 0.0 && self.square < f32::MAX {
            let by = mean_square * n / self.square;
            self.moments.iter_mut().for_each(|m| *m = (*m * by).min(f32::MAX));
            (self.square, self.fourth) = (mean_square * n, mean_square * mean_square * n);
        } else {
            *self = Self::EMPTY;
        }
        self.hits = 0.0;
    }

    fn scale_moments(&mut self, by: f32) {
        self.square *= by;
        self.fourth *= by;
        self.moments.iter_mut().for_each(|m| *m *= by);
    }

    /// Are these sums that contributions may have?
    pub(super) fn is_sound(&self) -> bool {
        let all = [self.hits, self.square, self.fourth].into_iter().chain(self.moments);
        all.into_iter().all(|x| (0.0..=f32::MAX).contains(&x))
    }

    /// The share of samples to guide, in 65536ths.
    pub(super) fn fraction(&self) -> u16 {
        let square = f64::from(self.square);
        let known = square * square / f64::from(self.fourth);
        if !known.is_finite() {
            return 0;
        }
        // moments over that of the samples as they were drawn; a guide that helped makes that without it large
        let shrunk = |g: f32, m: f32| known * f64::from(m) / square + PRIOR / (1.0 - f64::from(g));
        let all: [f64; 8] = core::array::from_fn(|k| shrunk(SHARES[k], self.moments[k]));
        let least = all.into_iter().fold(f64::INFINITY, f64::min);
        let best = all.iter().rposition(|m| *m <= least * (1.0 + TOLERANCE)).filter(|k| *k >= LEAST_SHARE);
        (best.map_or(0.0, |k| SHARES[k]) * 65_536.0) as u16
    }
}
