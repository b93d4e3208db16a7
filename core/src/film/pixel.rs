//! Sums of one pixel: of an iteration, and of all of them.

use super::short::{long, short};
use bytemuck::{Pod, Zeroable};

/// Sums over the camera samples of a pixel, either of one iteration in a shard or of all of them in the film.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PixelSums {
    /// Sum of w x: radiance in linear Rec. 709, times the weight of the iteration.
    pub sum: [f64; 3],
    /// Sum of w^2 (x - mean)^2 as [`short`] numbers: moments about the mean lose nothing where the mean is much larger
    /// than the deviations (Chan, Golub and LeVeque 1983; NUMERICS STA-1).
    pub spread: [u32; 3],
    /// Number of camera samples, at most 2^32 - 1.
    pub samples: u32,
    /// Sum of w x in one channel over the samples of the first half ([`Half`]) minus that over those of the second. In
    /// an iteration of more than some 100,000 samples rounding adds to it.
    pub difference: f32,
    /// Number of samples of the first half minus that of the second.
    pub ahead: i32,
}

/// Camera samples of a pixel belong to two halves of as many samples, as nearly as can be, which draw random numbers
/// independently of each other, whatever the samples within a half have to do with each other: the difference of their
/// means shows the variance of the pixel (independent replicates: Owen, "Randomly permuted (t,m,s)-nets and
/// (t,s)-sequences", 1995; in pictures "half buffers"). A half goes on from iteration to iteration. Points that are
/// spread over half of the samples are worse than over all of them, which is what it costs that the error is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Half {
    First,
    Second,
}

/// Channel in which the halves of a pixel are compared: noise has much the same size in all three, and one of them
/// costs a third of the memory.
pub(crate) fn compared_channel(film_index: usize) -> usize {
    film_index % 3
}

/// `x`, or the largest finite number of its sign.
fn finite(x: f64) -> f32 {
    const MOST: f64 = f32::MAX as f64;
    let x = if x < MOST { x } else { MOST };
    (if x > -MOST { x } else { -MOST }) as f32
}

/// What the film of an adaptive render holds of a pixel besides its sums.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PixelWeights {
    /// Sum of w.
    pub weight: f64,
    /// Sum of w^2.
    pub weight_sqr: f64,
    /// Sum of w^2 (x - mean); 0 if all weights are equal.
    pub cross: [f64; 3],
    /// Sum of w over the samples of the first half minus that over those of the second.
    pub ahead: f64,
}

impl PixelSums {
    /// Adds a camera sample of weight 1; halves are compared in this channel.
    #[inline]
    pub(crate) fn add(&mut self, radiance: [f64; 3], half: Half, channel: usize) {
        let sign = if half == Half::First { 1 } else { -1 };
        let compared = radiance.get(channel).copied().unwrap_or(0.0);
        self.difference = finite(f64::from(self.difference) + f64::from(sign) * compared);
        self.ahead = self.ahead.saturating_add(sign);
        if self.samples == 0 {
            // a single sample has no deviation
            self.sum.iter_mut().zip(radiance).for_each(|(sum, x)| *sum += x);
            self.samples = 1;
            return;
        }
        let n = f64::from(self.samples);
        let scale = 1.0 / (n * (n + 1.0));
        for (c, x) in radiance.into_iter().enumerate() {
            // n (x - mean of the samples before)
            let d = n * x - self.sum[c];
            self.spread[c] = short(long(self.spread[c]) + d * d * scale);
            self.sum[c] += x;
        }
        self.samples = self.samples.saturating_add(1);
    }

    /// Are these sums that samples may have?
    pub(crate) fn is_sound(&self) -> bool {
        self.sum.iter().all(|x| x.is_finite())
            && self.spread.iter().all(|x| long(*x).is_finite())
            && self.difference.is_finite()
    }

    /// Mean squared difference of the samples from `x` per channel, for one sample of weight 1 at least.
    #[inline]
    pub(crate) fn mean_square_about(&self, x: [f32; 3]) -> [f64; 3] {
        let n = f64::from(self.samples);
        core::array::from_fn(|c| {
            let d = self.sum[c] / n - f64::from(x[c]);
            long(self.spread[c]) / n + d * d
        })
    }

    /// Adds the samples of an iteration, all with weight 1.
    #[inline]
    pub(super) fn merge(&mut self, o: &Self) {
        if self.samples == 0 || o.samples == 0 {
            if self.samples == 0 {
                *self = *o;
            }
            return;
        }
        let (n, m) = (f64::from(self.samples), f64::from(o.samples));
        let scale = 1.0 / (n * m * (n + m));
        for c in 0..3 {
            let d = n * o.sum[c] - m * self.sum[c];
            self.spread[c] = short(long(self.spread[c]) + long(o.spread[c]) + d * d * scale);
            self.sum[c] += o.sum[c];
        }
        self.merge_halves(o, 1.0);
    }

    /// Adds the number of samples and what the halves differ by.
    #[inline]
    fn merge_halves(&mut self, o: &Self, w: f64) {
        self.samples = self.samples.saturating_add(o.samples);
        self.difference = finite(f64::from(self.difference) + w * f64::from(o.difference));
        self.ahead = self.ahead.saturating_add(o.ahead);
    }

    /// Adds the samples of an iteration, each with weight `w`.
    pub(super) fn merge_weighted(&mut self, weights: &mut PixelWeights, o: &Self, w: f64) {
        if o.samples == 0 {
            return;
        }
        let (m, w2, before) = (f64::from(o.samples), w * w, *weights);
        weights.weight += w * m;
        weights.weight_sqr += w2 * m;
        weights.ahead += w * f64::from(o.ahead);
        for c in 0..3 {
            let old = if self.samples == 0 { 0.0 } else { self.sum[c] / before.weight };
            self.sum[c] += w * o.sum[c];
            let mean = self.sum[c] / weights.weight;
            // both parts are moved to the new mean
            let (step, off) = (mean - old, o.sum[c] / m - mean);
            let moved = long(self.spread[c]) - 2.0 * step * before.cross[c] + step * step * before.weight_sqr;
            self.spread[c] = short(moved.max(0.0) + w2 * (long(o.spread[c]) + m * off * off));
            weights.cross[c] = before.cross[c] - step * before.weight_sqr + w2 * m * off;
        }
        self.merge_halves(o, w);
    }

    /// Statistics of the pixel; `weights` if its samples have weights.
    #[inline]
    pub(super) fn stats(&self, weights: Option<&PixelWeights>, rays: u32) -> PixelStats {
        let n = f64::from(self.samples);
        let alike = (n, n, f64::from(self.ahead));
        let (weight, weight_sqr, ahead) = weights.map_or(alike, |w| (w.weight, w.weight_sqr, w.ahead));
        PixelStats {
            sum: self.sum,
            spread: self.spread.map(long),
            weight,
            weight_sqr,
            samples: u64::from(self.samples),
            rays: u64::from(rays),
            difference: self.difference.into(),
            ahead,
        }
    }
}

/// Weighted sums over the camera samples of one pixel. All samples of the pixel in an iteration have the same weight
/// `w`: 1, less where adaptive sampling took more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PixelStats {
    /// Sum of w x, x the radiance of a camera sample in linear Rec. 709.
    pub sum: [f64; 3],
    /// Sum of w^2 (x - mean)^2, kept with 22 significant bits.
    pub spread: [f64; 3],
    /// Sum of w.
    pub weight: f64,
    /// Sum of w^2.
    pub weight_sqr: f64,
    /// Number of camera samples, at most 2^32 - 1.
    pub samples: u64,
    /// Number of rays traced for them, of all kinds; 0 unless the settings ask for it ([`Aov::Cost`](super::Aov::Cost) or
    /// [`crate::Settings::adaptive`]).
    pub rays: u64,
    /// Sum of w x over the first half of the samples minus that over the second, in one channel: that of the pixel's
    /// index in the film, modulo 3. The halves are independent of each other, unlike the samples in each.
    pub difference: f64,
    /// Sum of w over the first half of the samples minus that over the second.
    pub ahead: f64,
}

impl PixelStats {
    /// Mean radiance; 0 before the first sample.
    #[inline]
    pub fn mean(&self) -> [f64; 3] {
        let w = if self.samples == 0 { 1.0 } else { self.weight };
        self.sum.map(|s| s / w)
    }

    /// Squared standard error of the mean per channel, for independent samples. With Sobol' points, roulette or splitting
    /// that is an upper bound: one comb rounds a packet, and the roundings of its samples cancel (standard errors of up
    /// to twice the true ones were measured). [`Film::standard_error`](super::Film::standard_error) corrects it. One sample
    /// has no measurable variance: its square is used.
    #[inline]
    pub fn variance_of_mean(&self) -> [f64; 3] {
        let (w, w2) = (self.weight, self.weight_sqr);
        match self.samples {
            0 => [0.0; 3],
            1 => self.mean().map(|m| m * m),
            // w^2 - w2 is w^2 (1 - 1 / n) for n samples of equal weight
            _ => self.spread.map(|s| s / (w * w - w2)),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// Mean and squared standard error of weighted samples, by definition.
    fn oracle(samples: &[(f64, f64)]) -> (f64, f64) {
        let w: f64 = samples.iter().map(|(w, _)| w).sum();
        let w2: f64 = samples.iter().map(|(w, _)| w * w).sum();
        let mean = samples.iter().map(|(w, x)| w * x).sum::<f64>() / w;
        let spread: f64 = samples.iter().map(|(w, x)| w * w * (x - mean) * (x - mean)).sum();
        (mean, spread / (w * w - w2))
    }

    fn numbers(n: usize, seed: u32, center: f64, width: f64) -> Vec<f64> {
        let mut x = seed;
        let mut next = || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            center + width * (f64::from(x) / 4_294_967_296.0 - 0.5)
        };
        (0..n).map(|_| next()).collect()
    }

    fn sums(values: &[f64]) -> PixelSums {
        let mut sums = PixelSums::default();
        values.iter().for_each(|x| sums.add([*x, 2.0 * x, 0.0], Half::First, 0));
        sums
    }

    /// Deviations far below the mean, a firefly, iterations of different lengths and weights, against sums by definition.
    /// Killed by: squares minus squared means, a cross term left out, a weight that is not squared.
    #[test]
    fn moments_about_the_mean_are_those_of_the_samples() {
        for (center, width) in [(0.0, 2.0), (1e6, 1e-2), (0.5, 1e-4)] {
            // in few samples each term counts
            for (counts, weights) in [
                ([3, 1, 4000], [1.0, 1.0, 1.0]),
                ([3, 1, 4000], [1.0, 0.25, 2.0]),
                ([3, 2, 5], [1.0, 1.0, 1.0]),
                ([3, 2, 5], [1.0, 0.25, 2.0]),
            ] {
                let (mut film, mut side, mut all) = (PixelSums::default(), PixelWeights::default(), Vec::new());
                for (i, (n, w)) in counts.into_iter().zip(weights).enumerate() {
                    let mut values = numbers(n, i as u32 + 1, center + width * i as f64, width);
                    if n > 1000 {
                        values[7] += 1e3 * width;
                    }
                    all.extend(values.iter().map(|x| (w, *x)));
                    film.merge_weighted(&mut side, &sums(&values), w);
                }
                let (mean, variance) = oracle(&all);
                let stats = film.stats(Some(&side), 0);
                assert!((stats.mean()[0] / mean - 1.0).abs() < 1e-12);
                assert!((stats.variance_of_mean()[0] / variance - 1.0).abs() < 1e-4, "{center} {width} {weights:?}");
                assert!((stats.variance_of_mean()[1] / variance - 4.0).abs() < 1e-3);
                assert_eq!(stats.variance_of_mean()[2], 0.0);
            }
        }
    }

    /// Without weights the merged sums are those with weights of 1. Killed by: a term of one of the two formulas.
    #[test]
    fn weights_of_one_change_nothing() {
        let (mut plain, mut weighted, mut side) = (PixelSums::default(), PixelSums::default(), PixelWeights::default());
        for (i, n) in [5, 9, 300].into_iter().enumerate() {
            let o = sums(&numbers(n, i as u32 + 7, 3.0, 1.0));
            plain.merge(&o);
            weighted.merge_weighted(&mut side, &o, 1.0);
        }
        let (a, b) = (plain.stats(None, 0), weighted.stats(Some(&side), 0));
        assert_eq!((a.sum, a.weight, a.weight_sqr, a.samples), (b.sum, b.weight, b.weight_sqr, b.samples));
        assert!((a.spread[0] / b.spread[0] - 1.0).abs() < 1e-6);
    }

    /// 3 million samples of one iteration, and as many iterations of one sample, keep their variance. Killed by: sums or
    /// a spread in f32, or one that is rounded towards 0.
    #[test]
    fn long_sums_do_not_stall() {
        let n = 3_000_000;
        let mut one = PixelSums::default();
        let mut film = PixelSums::default();
        for i in 0..n {
            let x = [10.3 + f64::from(i % 2), 0.0, 0.0];
            one.add(x, Half::First, 0);
            let mut single = PixelSums::default();
            single.add(x, Half::First, 0);
            film.merge(&single);
        }
        for (what, sums) in [("samples", one), ("iterations", film)] {
            let s = sums.stats(None, 0);
            assert!((s.mean()[0] / 10.8 - 1.0).abs() < 1e-9, "{what}: {}", s.mean()[0]);
            let ratio = s.spread[0] / (0.25 * f64::from(n));
            assert!((ratio - 1.0).abs() < 1e-3, "{what}: {ratio}");
        }
    }
}
