//! Correlation of an iteration's samples, measured from outside. If iterations are independent, the expected squared
//! difference between the picture before and an iteration is the sum of their true variances, however samples correlate
//! within. Where Sobol' points go on from one to the next, they are not quite, and [`Continued`] corrects what is found.
//!
//! What is corrected is the variance that the merged pixels state. That is not the mean of the parts': samples that are
//! spread evenly differ more among each other than independent ones would, by (n - g) / (n - 1) with n samples whose
//! mean has g times the variance, so that a part of 4 samples states 1.17 of what the whole of 8 states 1.07 of.

use super::error::relative_denominator;
use super::pixel::{PixelStats, PixelSums};
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
pub(super) fn class(p: &PixelStats) -> usize {
    let (mean, variance) = (p.mean(), p.variance_of_mean());
    let square: f64 = mean.iter().map(|m| m * m).sum();
    let of_samples = variance.iter().sum::<f64>() * (p.weight * p.weight);
    SPREADS.iter().filter(|s| of_samples >= **s * square * p.weight_sqr).count()
}

/// How the samples of a film go on from iteration to iteration, and what that does to a ratio that was found as if
/// iterations were independent.
///
/// Let g(n) be the variance of the mean of the first n points of a sequence, over that of n independent ones. Part of an
/// integrand gains from the points (edges, soft shadows: its share of the variance falls like n^-3/2), part of it does
/// not (numbers of later vertices):
///
/// ```text
/// g(n) = a + (1 - a) / sqrt(n)                                   g(1) = 1
/// ```
///
/// Two halves of 2 n points are exchangeable, so their means A and B have var(A - B) = 4 (var(A) - var((A + B) / 2)), which
/// is 2 g(n) - g(2 n) times that of independent points. An iteration of m samples after many more has its own g(m) there,
/// and a little more, as it also fills what those before left open. Together, with the longest iteration m and y the
/// share of the samples that it has (fitted to what nets of 64 points do in sequences of up to 512):
///
/// ```text
/// found = a + (1 - a) r       r = (1.13 + 0.65 max(0, y - 1/4)) / sqrt(m)
/// ```
///
/// which gives a, and g for all samples of the film. Combs of roulette, too, make less of a ratio (to 0.4 where they meet
/// every path), and do not go on; found ratios do not tell one from the other. So [`MADE`] of the correction is made, a choice
/// between what is right without combs and without sequences, and [`DOUBT`] of it counts as a standard error.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Continued {
    /// Samples per pixel.
    samples: f64,
    /// Those of them that go on with sequences of others.
    in_sequence: f64,
    /// Samples per pixel of the longest iteration.
    longest: f64,
}

/// Samples per pixel at which the model has half the weight: it is coarse where there are few.
const TRUSTED: f64 = 32.0;
/// Parts of the model's correction that are made, and that count as its standard error.
const MADE: f64 = 0.7;
const DOUBT: f64 = 0.35;

impl Continued {
    /// Adds an iteration of so many samples per pixel, of which this share goes on with sequences.
    pub(super) fn add(&mut self, samples: u32, in_sequence: f64) {
        let samples = f64::from(samples);
        self.samples += samples;
        self.in_sequence += samples * in_sequence;
        self.longest = self.longest.max(samples);
    }

    /// The ratio of all samples.
    // once, not unrolled over the classes
    #[inline(never)]
    pub(super) fn ratio(&self, found: Independence) -> Independence {
        let Independence { ratio, noise } = found;
        if self.in_sequence <= 0.0 {
            return found;
        }
        let r = (1.13 + 0.65 * (self.longest / self.samples - 0.25).max(0.0)) / self.longest.sqrt_newton();
        let a = (ratio - r) / (1.0 - r);
        let g = a + (1.0 - a) / self.samples.sqrt_newton();
        if !(r < 0.8 && g < ratio) {
            return found;
        }
        let weight = self.in_sequence / (self.samples + TRUSTED);
        let change = weight * (ratio - g.max(0.5 * ratio));
        let doubt = DOUBT * change;
        Independence { ratio: ratio - MADE * change, noise: (noise * noise + doubt * doubt).sqrt_newton() }
    }
}

/// What squared standard errors of pixels ([`PixelStats::variance_of_mean`]) are to be multiplied by so that they are right
/// on average, with Sobol' points, roulette and splitting too: one factor for each of three classes of pixels, by the spread
/// of their samples (squared coefficient of variation below 1, below 8, from 8 on). A factor is 1 while the iterations do
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

/// Sums over the pixels of a class of an iteration that is being merged: squared differences from the picture before, and
/// variances as of independent samples. Relative, with the denominator of relMSE.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Differences {
    /// Squared differences of the means: true variance of the picture before plus true variance of the iteration.
    found: f64,
    /// Stated variances: of the picture before, of the iteration, and of both together.
    stated: [f64; 3],
    /// Sums over pixels of found^2, t^2 and found x t, t the variances of the picture before and of the iteration.
    squares: [f64; 3],
    /// Weights of the picture before and of the iteration.
    weight: [f64; 2],
}

impl Differences {
    /// Adds a pixel: its samples before the iteration, those of the iteration, each with weight `w`, and all together.
    pub(super) fn add(&mut self, p: &PixelStats, o: &PixelSums, w: f64, all: &PixelStats) {
        if p.samples < 2 || o.samples < 2 {
            return;
        }
        let (m, v, mean, variance) = (p.mean(), p.variance_of_mean(), all.mean(), all.variance_of_mean());
        let [mut found, mut before, mut new, mut both] = [0.0; 4];
        for (c, [iteration, of_iteration]) in o.mean_and_variance().into_iter().enumerate() {
            // of both together: the difference of two means does not depend on their weighted sum, but on each of them
            let scale = 1.0 / relative_denominator(mean[c], variance[c]);
            found += (iteration - m[c]) * (iteration - m[c]) * scale;
            before += v[c] * scale;
            new += of_iteration * scale;
            both += variance[c] * scale;
        }
        self.found += found;
        let parts = before + new;
        for (sum, x) in self.stated.iter_mut().zip([before, new, both]) {
            *sum += x;
        }
        for (sum, x) in self.squares.iter_mut().zip([found * found, parts * parts, found * parts]) {
            *sum += x;
        }
        self.weight[0] += p.weight;
        self.weight[1] += w * f64::from(o.samples);
    }
}

/// Least effective number of pixels that tell a ratio.
const FEWEST: f64 = 8.0;

/// An iteration is long if its squared weight is so many times that of the picture before.
const LONG: f64 = 2.0;

/// True variance of the pixels of a class over that of independent samples, and the standard error of this ratio.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Independence {
    pub ratio: f64,
    pub noise: f64,
}

impl Independence {
    /// Ratio before two iterations: samples are assumed to be independent.
    pub(super) const UNKNOWN: Self = Self { ratio: 1.0, noise: 0.0 };

    /// Ratio after an iteration: the picture before had variance r S, and the iteration has the rest of what was found.
    // once, not unrolled over the classes
    #[inline(never)]
    pub(super) fn after(self, d: &Differences) -> Self {
        let [s, t, both] = d.stated;
        if s + t <= 0.0 || both <= 0.0 {
            return self;
        }
        let r = d.found / (s + t);
        let [a, b, ab] = d.squares;
        if (s + t) * (s + t) < FEWEST * b {
            // the ratio of a few pixels says nothing of others
            return self;
        }
        // variance of what was found, beyond what was expected
        let noise = (a - 2.0 * r * ab + r * r * b).max(0.0);
        let [old, new] = d.weight.map(|w| w / (d.weight[0] + d.weight[1]));
        let [x, y] = [old * old, new * new];
        let next = if y > LONG * x {
            // a long iteration after a short one: the difference is mostly the short one's error and hardly depends on
            // the other
            Self { ratio: r, noise: noise.sqrt_newton() / (s + t) }
        } else {
            let rest = (x - y) * s;
            let noise = (rest * rest * self.noise * self.noise + y * y * noise).sqrt_newton();
            // nothing is known of a picture of one iteration: it is taken for what both are
            let before = if self.noise > 0.0 { self.ratio } else { r };
            Self { ratio: (rest * before + y * d.found) / both, noise: noise / both }
        };
        if next.ratio > 0.0 && next.ratio.is_finite() && next.noise.is_finite() { next } else { self }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// Uniform numbers in [0, 1).
    fn random(seed: u32) -> impl FnMut() -> f64 {
        let mut x = seed;
        move || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(x >> 8) / 16_777_216.0
        }
    }

    /// Samples of an iteration: one from each of `n` strata, so that their mean has 1 / n^2 of the variance of one.
    fn stratified(n: u32, random: &mut impl FnMut() -> f64) -> PixelSums {
        let mut sums = PixelSums::default();
        (0..n).for_each(|i| sums.add([10.0 + (f64::from(i) + random()) / f64::from(n); 3]));
        sums
    }

    /// The ratio makes the variance that merged pixels state the true one, after iterations of equal and of growing
    /// lengths. Killed by: a ratio over what the parts state (0.85 of the truth with halves of 4), weights that are not
    /// squared, the error of the picture before left out.
    #[test]
    fn merged_pixels_state_the_true_variance() {
        let mut random = random(7);
        for lengths in [&[4, 4][..], &[2, 2, 4, 8], &[4, 4, 4, 4], &[4, 4, 7]] {
            let (mut pixels, mut ratio) = ((0..4000).map(|_| PixelSums::default()).collect::<Vec<_>>(), 1.0);
            let mut known = Independence::UNKNOWN;
            let mut n = 0;
            for &more in lengths {
                let mut d = Differences::default();
                for p in &mut pixels {
                    let (before, o) = (p.stats(None, 0), stratified(more, &mut random));
                    p.merge(&o);
                    d.add(&before, &o, 1.0, &p.stats(None, 0));
                }
                n += more;
                known = known.after(&d);
                ratio = known.ratio;
            }
            let stated = pixels.iter().map(|p| p.stats(None, 0).variance_of_mean()[0]).sum::<f64>() / 4000.0;
            // each iteration of k samples has a mean of variance 1 / (12 k^3)
            let truth: f64 =
                lengths.iter().map(|k| (f64::from(*k) / f64::from(n)).powi(2) / 12.0 / f64::from(*k).powi(3)).sum();
            assert!((ratio * stated / truth - 1.0).abs() < 0.12, "{lengths:?}: {} of {truth}", ratio * stated);
            assert!(known.noise > 0.0 && known.noise < 0.2 * ratio, "{lengths:?}: {known:?}");
        }
    }

    /// Pixels whose samples are spread evenly do not take away from the error of those where one sample in many is bright:
    /// each class has its ratio. Killed by: one class, classes by the variance of the mean, which falls with the samples.
    #[test]
    fn rare_hits_keep_their_variance_beside_strata() {
        let mut random = random(11);
        for n in [16, 64] {
            let mut d = [Differences::default(); CLASSES];
            for i in 0..4000 {
                let mut samples = || match i % 2 {
                    0 => stratified(n, &mut random),
                    _ => {
                        let mut sums = PixelSums::default();
                        (0..n).for_each(|_| sums.add([if random() < 0.02 { 50.0 } else { 0.0 }; 3]));
                        sums
                    }
                };
                let (mut p, o) = (samples(), samples());
                let before = p.stats(None, 0);
                p.merge(&o);
                let all = p.stats(None, 0);
                d[class(&all)].add(&before, &o, 1.0, &all);
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
                let mut samples = || match i < pixels {
                    true => stratified(8, &mut random),
                    false => {
                        let mut sums = PixelSums::default();
                        (0..8).for_each(|_| sums.add([10.0; 3]));
                        sums
                    }
                };
                let (mut p, o) = (samples(), samples());
                let before = p.stats(None, 0);
                p.merge(&o);
                d.add(&before, &o, 1.0, &p.stats(None, 0));
            }
            let known = Independence::UNKNOWN.after(&d);
            assert_eq!((known.ratio < 0.5, known.noise > 0.0), (tells, tells), "{pixels} pixels: {known:?}");
        }
    }

    /// The ratio of a film whose sequences go on is that of all its samples together, for iterations that double and for
    /// equal ones: against the model itself, which the benchmark `samplers` compares with pictures. Killed by: a
    /// correction of what does not go on, of the wrong sign, one that does not grow with the samples.
    #[test]
    fn ratios_are_those_of_whole_sequences() {
        let of = |iterations: &[u32], share: f64, found: f64| {
            let mut c = Continued::default();
            iterations.iter().for_each(|n| c.add(*n, share));
            c.ratio(Independence { ratio: found, noise: 0.01 })
        };
        let doubling = [1, 1, 2, 4, 8, 16, 32, 64];
        let g = |a: f64, n: f64| a + (1.0 - a) / n.sqrt_newton();
        for a in [0.2, 0.5, 0.9] {
            let found = 2.0 * g(a, 64.0) - g(a, 128.0);
            let whole = of(&doubling, 1.0, found);
            let wanted = found + MADE * 128.0 / 160.0 * (g(a, 128.0) - found);
            assert!((whole.ratio / wanted - 1.0).abs() < 0.01, "{a}: {whole:?}, not {wanted}");
            assert!(whole.noise > 0.01 && whole.noise < 0.03);
            let half = of(&doubling, 0.5, found).ratio;
            assert!((half - 0.5 * (found + whole.ratio)).abs() < 1e-9);
            let found = a + (1.0 - a) * 1.13 / 8.0;
            let more = of(&[&doubling[..], &[64; 30]].concat(), 1.0, found).ratio;
            assert!((more / (found + MADE * (g(a, 2048.0) - found)) - 1.0).abs() < 0.02, "{a}: {more}");
        }
        // independent samples, apart or not, and films without any
        assert_eq!(of(&doubling, 0.0, 0.5).ratio, 0.5);
        assert_eq!(of(&[], 1.0, 1.0).ratio, 1.0);
        for found in [1.0, 1.3] {
            assert_eq!(of(&doubling, 1.0, found).ratio, found);
        }
        assert!(of(&[1, 1], 1.0, 0.9).ratio == 0.9);
    }

    /// Killed by: a ratio that counts though it is not sure, pixels of another class.
    #[test]
    fn factors_are_those_of_sure_classes() {
        let of = |ratio: f64, noise: f64| Independence { ratio, noise };
        let factors = VarianceFactors::told(&[of(0.5, 0.05), of(0.7, 0.3), of(0.9, 0.1)]);
        let pixel = |variance: f64| {
            let spread = variance * (64.0 * 64.0 - 64.0);
            PixelStats { sum: [64.0; 3], spread: [spread; 3], weight: 64.0, weight_sqr: 64.0, samples: 64, rays: 0 }
        };
        // squared coefficients of variation of 0.1, 3 and 20
        assert_eq!([0.1, 3.0, 20.0].map(|x| factors.of(&pixel(x / 64.0))), [0.5, 1.0, 0.9]);
    }
}
