//! How far the samples of pixels are from independent ones, measured from outside. Sobol' points are spread evenly over
//! a pixel, and the combs of roulette round samples of one packet together, so that the picture is better than the
//! spread of its samples says. The two halves of a pixel's samples ([`Half`](super::pixel::Half)) are independent of
//! each other, so the expected squared difference of their sums is the true variance of the sum of both, however
//! samples correlate within a half and whatever iterations they are of:
//!
//! ```text
//! d = a - b - (n_a - n_b) mean       a, b: sums of the halves, with n_a and n_b samples, n in all
//! Var mean = E[d^2] / (n^2 - (n_a - n_b)^2)
//! ```
//!
//! which is exact for halves of the same size, and for others if samples are independent. One pixel says next to
//! nothing so; the ratio to the variance of independent samples, over the pixels of a class, is known well.

use super::error::relative_denominator;
use super::pixel::PixelStats;
use super::sqrt::SqrtNewton;
use bytemuck::{Pod, Zeroable};

/// Number of classes of pixels; see [`class`].
pub(super) const CLASSES: usize = 3;

/// Least squared coefficients of variation of the samples in the classes after the first.
const SPREADS: [f64; CLASSES - 1] = [1.0, 8.0];

/// Class of a pixel by the squared coefficient of variation of its samples. How much samples correlate depends on where
/// their noise comes from: rounding by a comb and points that are spread evenly make half the variance, or less, where
/// all samples are of one size, and change nothing where few samples have found all there is. One ratio for all pixels is
/// mostly that of the former, and states too little of the error of the latter.
#[inline]
pub(super) fn class(p: &PixelStats) -> usize {
    let (mean, variance) = (p.mean(), p.variance_of_mean());
    let square: f64 = mean.iter().map(|m| m * m).sum();
    let of_samples = variance.iter().sum::<f64>() * (p.weight * p.weight);
    SPREADS.iter().filter(|s| of_samples >= **s * square * p.weight_sqr).count()
}

/// What squared standard errors of pixels ([`PixelStats::variance_of_mean`]) are to be multiplied by so that they are right
/// on average, with Sobol' points, roulette and splitting too: one factor for each of three classes of pixels, by the spread
/// of their samples (squared coefficient of variation below 1, below 8, from 8 on). A factor is 1 while the samples do
/// not tell it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VarianceFactors {
    pub(super) of_classes: [f64; CLASSES],
}

/// Relative standard error of a ratio below which it counts.
const SURE: f64 = 0.2;

impl VarianceFactors {
    /// Ratios of classes, as far as their standard errors are small.
    pub(super) fn told(classes: &[Independence; CLASSES]) -> Self {
        Self { of_classes: classes.map(|i| if i.noise < SURE * i.ratio { i.ratio } else { 1.0 }) }
    }

    /// The factor of a pixel's class.
    pub fn of(&self, p: &PixelStats) -> f64 {
        self.of_classes[class(p) % CLASSES]
    }
}

/// Sums over the pixels of a class: true variances as the halves show them, and variances as of independent samples.
/// Relative, with the denominator of relMSE.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Differences {
    /// From squared differences of the halves.
    found: f64,
    /// Stated by the samples.
    stated: f64,
    /// Sums over pixels of found^2, stated^2 and found x stated.
    squares: [f64; 3],
}

impl Differences {
    /// Adds a pixel, whose halves are compared in this channel.
    #[inline]
    pub(super) fn add(&mut self, p: &PixelStats, channel: usize) {
        let (ahead, c) = (p.ahead, channel.min(2));
        let left = p.weight * p.weight - ahead * ahead;
        // both halves have samples
        if p.samples < 2 || left <= 0.0 {
            return;
        }
        let (mean, variance) = (p.mean()[c], p.variance_of_mean()[c]);
        let scale = 1.0 / relative_denominator(mean, variance);
        let d = p.difference - ahead * mean;
        let (found, stated) = (d * d / left * scale, variance * scale);
        self.found += found;
        self.stated += stated;
        for (sum, x) in self.squares.iter_mut().zip([found * found, stated * stated, found * stated]) {
            *sum += x;
        }
    }
}

/// Least effective number of pixels that tell a ratio.
const FEWEST: f64 = 8.0;

/// No samples have a ratio this large; forged ones may.
const MOST: f64 = 1e30;

/// True variance of the pixels of a class over that of independent samples, and the standard error of this ratio.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Independence {
    pub ratio: f64,
    pub noise: f64,
}

impl Independence {
    /// Ratio before pixels have two samples: these are assumed to be independent.
    pub(super) const UNKNOWN: Self = Self { ratio: 1.0, noise: 0.0 };

    /// Ratio that all pixels show, or the one before if they show none.
    // once, not unrolled over the classes
    #[inline(never)]
    pub(super) fn after(self, d: &Differences) -> Self {
        let [a, b, ab] = d.squares;
        // the ratio of a few pixels says nothing of others
        if d.stated <= 0.0 || d.stated * d.stated < FEWEST * b {
            return self;
        }
        let r = d.found / d.stated;
        // variance of what was found, beyond what was expected
        let noise = (a - 2.0 * r * ab + r * r * b).max(0.0).sqrt_newton() / d.stated;
        let sound = r > 0.0 && r < MOST && noise < MOST;
        if sound { Self { ratio: r, noise } } else { self }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::film::pixel::{Half, PixelSums, PixelWeights};

    /// Uniform numbers in [0, 1).
    fn random(seed: u32) -> impl FnMut() -> f64 {
        let mut x = seed;
        move || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(x >> 8) / 16_777_216.0
        }
    }

    /// Adds a sample from each of `n` strata to a half, so that their mean has 1 / n^2 of the variance of one.
    fn add_strata(sums: &mut PixelSums, half: Half, n: u32, random: &mut impl FnMut() -> f64) {
        (0..n).for_each(|i| sums.add([10.0 + (f64::from(i) + random()) / f64::from(n); 3], half, 1));
    }

    const BOTH: [Half; 2] = [Half::First, Half::Second];

    /// The ratio makes the variance that pixels state the true one, for halves that go on over iterations and halves of
    /// almost the same size. Killed by: the variance of half the samples, a difference that knows no sizes.
    #[test]
    fn pixels_state_the_true_variance() {
        let mut random = random(7);
        for (sizes, iterations) in [([8, 8], 1), ([4, 4], 3), ([8, 7], 1), ([1, 1], 1)] {
            let (mut d, mut stated) = (Differences::default(), 0.0);
            for _ in 0..8000 {
                let mut p = PixelSums::default();
                for _ in 0..iterations {
                    let mut o = PixelSums::default();
                    BOTH.iter().zip(sizes).for_each(|(half, n)| add_strata(&mut o, *half, n, &mut random));
                    p.merge(&o);
                }
                let p = p.stats(None, 0);
                stated += p.variance_of_mean()[1] / 8000.0;
                d.add(&p, 1);
            }
            let known = Independence::UNKNOWN.after(&d);
            let [a, b] = sizes.map(f64::from);
            // the mean of k strata has variance 1 / (12 k^3)
            let truth = (1.0 / a + 1.0 / b) / 12.0 / (a + b).powi(2) / f64::from(iterations);
            assert!(
                (known.ratio * stated / truth - 1.0).abs() < 0.06,
                "{sizes:?}: {} of {truth}",
                known.ratio * stated
            );
            // two samples show what they state
            let least = if sizes == [1, 1] && iterations == 1 { 0.0 } else { 1e-6 };
            assert!(known.noise >= least && known.noise < 0.05 * known.ratio, "{sizes:?}: {known:?}");
        }
    }

    /// Independent samples of which one half has twice as many, and samples with weights, make a ratio of 1. Killed by:
    /// a difference that is not that of the means, one over the squared sum of weights alone (0.9).
    #[test]
    fn unequal_halves_of_independent_samples_have_a_ratio_of_one() {
        let mut random = random(5);
        let mut d = Differences::default();
        for _ in 0..20_000 {
            let (mut p, mut weights) = (PixelSums::default(), PixelWeights::default());
            for w in [1.0, 0.5] {
                let mut o = PixelSums::default();
                for (half, n) in BOTH.into_iter().zip([8, 4]) {
                    (0..n).for_each(|_| o.add([10.0 + random(); 3], half, 0));
                }
                p.merge_weighted(&mut weights, &o, w);
            }
            d.add(&p.stats(Some(&weights), 0), 0);
        }
        let Independence { ratio, noise } = Independence::UNKNOWN.after(&d);
        assert!((ratio - 1.0).abs() < 0.04 && noise < 0.02, "{ratio} {noise}");
    }

    /// Pixels whose samples are spread evenly do not take away from the error of those where one sample in many is bright:
    /// each class has its ratio. Killed by: one class, classes by the variance of the mean, which falls with the samples.
    #[test]
    fn rare_hits_keep_their_variance_beside_strata() {
        let mut random = random(11);
        for n in [16, 64] {
            let mut d = [Differences::default(); CLASSES];
            for i in 0..8000 {
                let mut sums = PixelSums::default();
                for half in BOTH {
                    match i % 2 {
                        0 => add_strata(&mut sums, half, n, &mut random),
                        _ => (0..n).for_each(|_| sums.add([if random() < 0.02 { 50.0 } else { 0.0 }; 3], half, 1)),
                    }
                }
                let all = sums.stats(None, 0);
                d[class(&all)].add(&all, 1);
            }
            let [even, .., rare] = d.map(|d| Independence::UNKNOWN.after(&d));
            // strata: 1 / n^3 of the variance of a sample in a mean, over the 1 / n that the spread of both halves states
            let square = f64::from(n).powi(2);
            assert!((even.ratio * square - 1.0).abs() < 0.15, "{n} samples: {even:?}");
            assert!((rare.ratio - 1.0).abs() < 0.1 && rare.noise > 0.0, "{n} samples: {rare:?}");
        }
    }

    /// A few pixels tell no ratio, however many there are without an error. Killed by: a ratio of one pixel, whose noise
    /// would be 0.
    #[test]
    fn few_pixels_tell_nothing() {
        for (pixels, tells) in [(1, false), (4, false), (40, true)] {
            let (mut random, mut d) = (random(3), Differences::default());
            for i in 0..1000 {
                let mut sums = PixelSums::default();
                for half in BOTH {
                    match i < pixels {
                        true => add_strata(&mut sums, half, 8, &mut random),
                        false => (0..8).for_each(|_| sums.add([10.0; 3], half, 1)),
                    }
                }
                d.add(&sums.stats(None, 0), 1);
            }
            let known = Independence::UNKNOWN.after(&d);
            assert_eq!((known.ratio < 0.5, known.noise > 0.0), (tells, tells), "{pixels} pixels: {known:?}");
        }
    }

    /// What is finite stays so, however bright. Killed by: a difference that is infinite.
    #[test]
    fn bright_halves_stay_finite() {
        let mut sums = PixelSums::default();
        (0..9).for_each(|i| sums.add([3e38; 3], BOTH[i / 5], 1));
        assert!(sums.is_sound());
        let mut d = Differences::default();
        d.add(&sums.stats(None, 0), 1);
        assert!(d.found.is_finite() && Independence::UNKNOWN.after(&d).ratio.is_finite());
    }

    /// Killed by: a ratio that counts though it is not sure, pixels of another class.
    #[test]
    fn factors_are_those_of_sure_classes() {
        let of = |ratio: f64, noise: f64| Independence { ratio, noise };
        let factors = VarianceFactors::told(&[of(0.5, 0.05), of(0.7, 0.3), of(0.9, 0.1)]);
        let pixel = |variance: f64| {
            let spread = variance * (64.0 * 64.0 - 64.0);
            PixelStats {
                sum: [64.0; 3],
                spread: [spread; 3],
                weight: 64.0,
                weight_sqr: 64.0,
                samples: 64,
                ..PixelStats::default()
            }
        };
        // squared coefficients of variation of 0.1, 3 and 20
        assert_eq!([0.1, 3.0, 20.0].map(|x| factors.of(&pixel(x / 64.0))), [0.5, 1.0, 0.9]);
    }
}
