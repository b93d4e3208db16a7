//! What relMSE divides by, estimated: the squared expectation of a pixel, from its samples and from the pixels around it.
//!
//! The pixel's own mean will not do. A firefly raises mean and variance together and hides its own error (states 0.2 of it
//! in a pool lit through water); a pixel that has found its light once of many times has a variance as large as its squared
//! mean, so that next to nothing is left to divide by (390 times the error at the edges of small lights). So the picture is
//! cut into blocks of 16 to 31 pixels a side, and a pixel takes what the others of its block say, as far as it does not
//! know better:
//!
//! ```text
//! e = mu + w (m - mu)        m, v: mean of the pixel and its variance; mu: mean of the others
//! w = max(c / (c + max(v, mean of the others' variances)), 1 - k v / (m - mu)^2)
//! D = max(e^2 - Var e, 0) + 0.01
//! ```
//!
//! c is the variance among the others beyond their noise: where the block has contrast, pixels are what their samples say
//! (Lee, "Digital image enhancement and noise filtering by use of local statistics", 1980). The second term keeps pixels
//! that stand out beyond their own noise (the positive part of James and Stein, "Estimation with quadratic loss", 1961). The
//! others are those of other parity in column or row: the pixel is in none of their sums, and nothing is subtracted
//! (NUMERICS STA-4). k = 1 is the estimate; k = [`DOUBT`] says how much depends on this choice, which widens the interval.
//!
//! So does what a pixel's own noise makes of its denominator: where q = v / D is large, at the edges of lamps, in
//! caustics, D is hardly known. Each pixel adds q^2 / (q + [`UNSURE`]), all of q where it is large, next to nothing where
//! it is small, and [`UNSURE_SHARE`] of the sum counts. Both numbers were found with the benchmark `intervals`.

use super::error::{REL_MSE_EPSILON, relative_denominator};
use super::pixel::PixelStats;

/// Pixels a side of the smallest block.
pub(super) const SIDE: u32 = 16;
/// Fewer other pixels say nothing.
const ENOUGH: f64 = 8.0;
/// The other k.
const DOUBT: f64 = 4.0;
/// Relative squared error of a pixel of which half is unsure.
const UNSURE: f64 = 0.25;
/// Part of what is unsure by which an interval is widened to both sides.
pub(super) const UNSURE_SHARE: f64 = 0.5;

/// Sums over some pixels of a block, or their means, by channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    pixels: f64,
    mean: [f64; 3],
    /// Of squared means.
    square: [f64; 3],
    /// Of variances of means.
    variance: [f64; 3],
}

impl Sums {
    fn add(&mut self, p: &PixelStats) {
        let (m, v) = (p.mean(), p.variance_of_mean());
        self.pixels += 1.0;
        for c in 0..3 {
            self.mean[c] += m[c];
            self.square[c] += m[c] * m[c];
            self.variance[c] += v[c];
        }
    }

    fn join(&mut self, o: &Self) {
        self.pixels += o.pixels;
        for c in 0..3 {
            self.mean[c] += o.mean[c];
            self.square[c] += o.square[c];
            self.variance[c] += o.variance[c];
        }
    }
}

/// The pixels of one parity of a block, as those of the other three parities see them.
#[derive(Clone, Copy, Default)]
struct Others {
    pixels: f64,
    mean: [f64; 3],
    /// Variance among them beyond their noise.
    contrast: [f64; 3],
    /// Mean of their variances.
    noise: [f64; 3],
}

/// Relative squared errors of a pixel, means over channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PixelError {
    /// Variance over the denominator.
    pub error: f64,
    /// The same with the other k.
    pub other: f64,
    /// What of it is unsure because of the pixel's own noise.
    pub unsure: f64,
}

/// A block of pixels.
pub(super) struct Block([Others; 4]);

/// Parity of column and row, 0 to 3.
fn parity(column: u32, row: u32) -> usize {
    (row & 1) as usize * 2 + (column & 1) as usize
}

impl Block {
    /// Of these pixels, with column and row of each.
    pub(super) fn of(pixels: impl Iterator<Item = ([u32; 2], PixelStats)>) -> Self {
        let mut sums = [Sums::default(); 4];
        for ([x, y], p) in pixels {
            sums[parity(x, y) & 3].add(&p);
        }
        Self(core::array::from_fn(|own| {
            let mut all = Sums::default();
            sums.iter().enumerate().filter(|(class, _)| *class != own).for_each(|(_, s)| all.join(s));
            let n = all.pixels.max(1.0);
            let mean = all.mean.map(|x| x / n);
            let noise = all.variance.map(|x| x / n);
            let contrast = core::array::from_fn(|c| (all.square[c] / n - mean[c] * mean[c] - noise[c]).max(0.0));
            Others { pixels: all.pixels, mean, contrast, noise }
        }))
    }

    /// Relative squared error of a pixel of the block, and how well it is known.
    pub(super) fn relative_error(&self, [x, y]: [u32; 2], p: &PixelStats) -> PixelError {
        let (m, v) = (p.mean(), p.variance_of_mean());
        let others = &self.0[parity(x, y) & 3];
        let mut sum = PixelError::default();
        for c in 0..3 {
            // without an error there is nothing to divide
            if v[c] > 0.0 {
                let [q, other] = [1.0, DOUBT].map(|k| v[c] / others.denominator(c, [m[c], v[c]], k));
                sum.error += q / 3.0;
                sum.other += other / 3.0;
                sum.unsure += q * (q / (q + UNSURE)) / 3.0;
            }
        }
        sum
    }
}

impl Others {
    fn denominator(&self, c: usize, [m, v]: [f64; 2], k: f64) -> f64 {
        if self.pixels < ENOUGH {
            return relative_denominator(m, v);
        }
        let (mean, contrast, noise) = (self.mean[c], self.contrast[c], self.noise[c]);
        let off = (m - mean) * (m - mean);
        let stands_out = if off > k * v { 1.0 - k * v / off } else { 0.0 };
        // v > 0
        let w = (contrast / (contrast + v.max(noise))).max(stands_out);
        let e = mean + w * (m - mean);
        let variance = w * w * v + (1.0 - w) * (1.0 - w) * noise / self.pixels;
        (e * e - variance).max(0.0) + REL_MSE_EPSILON
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// A pixel after `n` samples with this mean and variance of the mean, in all channels.
    fn pixel(n: u64, mean: f64, variance: f64) -> PixelStats {
        let w = n as f64;
        let spread = variance * (w * w - w);
        PixelStats { sum: [mean * w; 3], spread: [spread; 3], weight: w, weight_sqr: w, samples: n, rays: 0 }
    }

    /// Means of error, other error and what is unsure over a block of 16 x 16 pixels.
    fn errors(pixels: &[PixelStats]) -> [f64; 3] {
        let placed = || pixels.iter().enumerate().map(|(i, p)| ([i as u32 % 16, i as u32 / 16], *p));
        let block = Block::of(placed());
        let each = placed().map(|(place, p)| block.relative_error(place, &p));
        let sum = each.fold([0.0; 3], |[a, b, c], e| [a + e.error, b + e.other, c + e.unsure]);
        sum.map(|x| x / pixels.len() as f64)
    }

    /// Uniform numbers in [0, 1).
    fn random(seed: u32) -> impl FnMut() -> f64 {
        let mut x = seed;
        move || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(x >> 8) / 16_777_216.0
        }
    }

    /// Pixels each of `n` samples that are `1 / p` with probability p: of mean 1 and variance (1 / p - 1) / n.
    fn rare(n: u64, p: f64, seed: u32) -> Vec<PixelStats> {
        let mut random = random(seed);
        let one = |hits: f64| {
            let (n, mean) = (n as f64, hits / (n as f64 * p));
            let square = hits / (n * p * p);
            (mean, (square - mean * mean) / (n - 1.0))
        };
        (0..256)
            .map(|_| one((0..n).filter(|_| random() < p).count() as f64))
            .map(|(mean, variance)| pixel(n, mean, variance))
            .collect()
    }

    /// Where each pixel has found the light once or never, the block tells what to divide by: on average over 60 pictures
    /// the error is the true one within 25 %. Killed by: the pixel's own mean as the denominator (0.01 of the truth here),
    /// a mean of the others that the pixel is part of.
    #[test]
    fn rare_light_does_not_hide_its_error() {
        for (n, p) in [(8, 0.05), (32, 0.01), (64, 0.05)] {
            let truth = (1.0 / p - 1.0) / n as f64 / 1.01;
            let found = (0..60).map(|seed| errors(&rare(n, p, seed * 77 + 1))[0]).sum::<f64>() / 60.0;
            assert!((found / truth - 1.0).abs() < 0.25, "{n} samples, {p}: {found} of {truth}");
        }
    }

    /// Bright pixels in the dark whose mean is far above their noise count by their own mean. Killed by: denominators of
    /// the surroundings alone (10^4 times the truth).
    #[test]
    fn what_stands_out_counts_by_itself() {
        let mut pixels = [pixel(16, 1e-3, 1e-8); 256].to_vec();
        pixels[100] = pixel(16, 100.0, 100.0);
        let [error, other, _] = errors(&pixels);
        let truth = 0.01 / 256.0;
        assert!((error / truth - 1.0).abs() < 0.1 && (other / truth - 1.0).abs() < 0.2, "{error} {other} {truth}");
    }

    /// In a block of two halves, one of 10 and one of 0.1, pixels of both count by their own. Killed by: a contrast
    /// that is not seen, noise that is not taken off it.
    #[test]
    fn contrast_keeps_pixels_apart() {
        let pixels: Vec<_> =
            (0..256).map(|i| if i % 16 < 8 { pixel(64, 10.0, 0.01) } else { pixel(64, 0.1, 1e-4) }).collect();
        let truth = 0.5 * (0.01 / 100.01 + 1e-4 / 0.02);
        let [error, ..] = errors(&pixels);
        assert!((error / truth - 1.0).abs() < 0.05, "{error} {truth}");
    }

    /// What is unsure is all of the error where pixels are noise, and a small part of it where they are not. Killed by: a
    /// pixel's error that counts by its variance, not by its relative one.
    #[test]
    fn noisy_pixels_are_unsure() {
        let [error, _, unsure] = errors(&rare(8, 0.01, 5));
        assert!(unsure > 0.9 * error, "{unsure} of {error}");
        for scale in [1.0, 1e-6, 1e6] {
            let [error, _, unsure] = errors(&[pixel(64, 10.0, scale)].repeat(256));
            let q = scale / 100.01;
            // noise that is larger than the mean leaves less than its square to divide by
            let least = q / (q + UNSURE) - 1e-3;
            assert!(unsure / error > least && (q > 1.0 || unsure / error < least + 2e-3), "{unsure} of {error}");
        }
    }

    /// Nothing that is finite makes an error that is not: pixels alone, black, huge, of one sample. Killed by: a division
    /// by nothing.
    #[test]
    fn errors_are_finite() {
        for p in
            [pixel(4, 0.0, 0.0), pixel(4, 1e30, 1e60), pixel(1, 5.0, 0.0), pixel(4, 1e-30, 1e-62), pixel(0, 0.0, 0.0)]
        {
            for n in [1, 2, 256] {
                let all = errors(&[p].repeat(n));
                assert!(all.iter().all(|e| e.is_finite() && *e >= 0.0), "{p:?} {n}");
            }
        }
        let [a, ..] = errors(&[pixel(4, 2.0, 0.1)]);
        assert!((a - 0.1 / (4.0 - 0.1 + 0.01)).abs() < 1e-12);
    }
}
