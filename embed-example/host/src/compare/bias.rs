//! The test for bias: z-scores of block means.
//!
//! Noise averages out over a block of pixels, bias does not. For each block and channel
//!
//! ```text
//! z = (mean of the image - mean of the reference) / sqrt(variance of the one + variance of the other)
//! ```
//!
//! which is a standard normal variable if there is no bias: 0.27 % beyond 3, mean 0, and, of 1e4 of them, one in 50 000
//! trials beyond 6.
//!
//! *Fireflies.* With rare bright samples that breaks: a block that missed its fireflies has too low a mean *and* too
//! low a variance, one that was hit has both too high. If the reference has fewer samples than the image, the mean of z
//! drifts above 0 (by 0.1 to 0.3 with one firefly a block) without any bias. Robust location estimates are no way out:
//! the median of means, winsorised and trimmed means of skewed noise are themselves biased, and the reference is a
//! plain mean. The robust test therefore keeps the means and corrects the variances: a block's relative variance is the
//! larger of its own and the average over the 3x3 blocks around it, for image and reference apart, because what one
//! block missed its neighbours have seen. That takes the drift below 0.1 and only ever makes |z| smaller (Gaussian
//! noise: 0.2 % beyond 3 instead of 0.27 %); a bias over an area larger than its noise still shows.

use super::mean_image::MeanImage;
use super::metric::CompareError;
use serde::Serialize;

/// Options of the test for bias.
#[derive(Clone, Copy, Debug)]
pub struct BiasOptions {
    /// Side of the square blocks in pixels, >= 1; blocks at the right and lower edge may be smaller.
    pub block: usize,
    /// Firefly-robust variances (see the module's text).
    pub robust: bool,
    /// Standard error, relative to the reference, that every block mean has at least: rounding of stored f32 pixels.
    pub floor: f64,
}

impl Default for BiasOptions {
    fn default() -> Self {
        Self { block: 8, robust: false, floor: 1e-6 }
    }
}

/// Score of one block and channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BlockZ {
    /// First column of the block.
    pub x: usize,
    /// First row of the block.
    pub y: usize,
    /// Channel: 0, 1, 2 for R, G, B.
    pub channel: usize,
    /// z-score; infinite if a mean is not finite.
    pub z: f64,
    /// Mean of the image over the block.
    pub image: f64,
    /// Mean of the reference over the block.
    pub reference: f64,
}

/// Scores of all blocks and channels, summed up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bias {
    /// Number of z-scores: three per block.
    pub scores: usize,
    /// Part of them beyond 3 in absolute value; 0.0027 without bias.
    pub beyond3: f64,
    /// Mean score. Its own standard error is about 1/sqrt(number of blocks): channels are correlated.
    pub mean: f64,
    /// Root mean square score; 1 without bias and with right variances.
    pub rms: f64,
    /// Largest absolute score.
    pub max: f64,
    /// Every block beyond 6, largest first.
    pub beyond6: Vec<BlockZ>,
}

/// Tests `image` against `reference`. Both variances count; where one is 0 that side is taken as exact.
pub fn bias(image: &MeanImage, reference: &MeanImage, options: &BiasOptions) -> Result<Bias, CompareError> {
    Ok(Bias::of(&block_scores(image, reference, options)?))
}

impl Bias {
    /// Sums up scores, all of [`block_scores`] or a part of them. Everything is 0 without scores.
    pub fn of(scores: &[BlockZ]) -> Self {
        let n = scores.len().max(1) as f64;
        let beyond3 = scores.iter().filter(|b| b.z.abs() > 3.0).count() as f64 / n;
        let mut beyond6: Vec<BlockZ> = scores.iter().filter(|b| b.z.abs() > 6.0).copied().collect();
        beyond6.sort_by(|a, b| b.z.abs().total_cmp(&a.z.abs()));
        Self {
            scores: scores.len(),
            beyond3,
            mean: scores.iter().map(|b| b.z).sum::<f64>() / n,
            rms: (scores.iter().map(|b| b.z * b.z).sum::<f64>() / n).sqrt(),
            max: scores.iter().map(|b| b.z.abs()).fold(0.0, f64::max),
            beyond6,
        }
    }
}

/// Means over blocks, and the variances of those means, per channel.
struct Blocks {
    mean: Vec<[f64; 3]>,
    variance: Vec<[f64; 3]>,
}

impl Blocks {
    fn of(e: &MeanImage, side: usize, columns: usize, rows: usize) -> Self {
        let mut mean = vec![[0.0; 3]; columns * rows];
        let mut variance = mean.clone();
        let mut pixels = vec![0.0; columns * rows];
        for (i, (m, v)) in e.mean.iter().zip(&e.variance).enumerate() {
            let b = i / e.width / side * columns + i % e.width / side;
            pixels[b] += 1.0;
            for c in 0..3 {
                mean[b][c] += m[c];
                variance[b][c] += v[c];
            }
        }
        for ((m, v), n) in mean.iter_mut().zip(&mut variance).zip(pixels) {
            *m = m.map(|m| m / n);
            *v = v.map(|v| v / (n * n));
        }
        Self { mean, variance }
    }

    /// Raises each relative variance (`variance / level²`) to its average over the blocks around.
    fn spread(&mut self, level: &[[f64; 3]], columns: usize, rows: usize) {
        let relative = |v: f64, m: f64| if m > 0.0 { v / (m * m) } else { 0.0 };
        let own = self.variance.clone();
        for (i, variance) in self.variance.iter_mut().enumerate() {
            let (x, y) = (i % columns, i / columns);
            for c in 0..3 {
                let (mut sum, mut n) = (0.0, 0.0);
                for y in y.saturating_sub(1)..(y + 2).min(rows) {
                    for x in x.saturating_sub(1)..(x + 2).min(columns) {
                        let j = y * columns + x;
                        sum += relative(own[j][c], level[j][c]);
                        n += 1.0;
                    }
                }
                variance[c] = variance[c].max(sum / n * level[i][c] * level[i][c]);
            }
        }
    }
}

/// The score of every block and channel, row by row.
pub fn block_scores(
    image: &MeanImage,
    reference: &MeanImage,
    options: &BiasOptions,
) -> Result<Vec<BlockZ>, CompareError> {
    let (width, height) = (image.width, image.height);
    if (width, height) != (reference.width, reference.height) {
        return Err(CompareError::Size { first: (width, height), second: (reference.width, reference.height) });
    }
    if width == 0 || height == 0 {
        return Err(CompareError::Empty);
    }
    let side = options.block.max(1);
    let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
    let mut a = Blocks::of(image, side, columns, rows);
    let mut b = Blocks::of(reference, side, columns, rows);
    if options.robust {
        // The brightness of a block as both see it: a firefly in one of them should not hide its own variance.
        let both = |(a, b): (&[f64; 3], &[f64; 3])| [0, 1, 2].map(|c| (a[c].abs() + b[c].abs()) / 2.0);
        let level: Vec<[f64; 3]> = a.mean.iter().zip(&b.mean).map(both).collect();
        a.spread(&level, columns, rows);
        b.spread(&level, columns, rows);
    }
    let mut scores = Vec::with_capacity(3 * columns * rows);
    for i in 0..columns * rows {
        for channel in 0..3 {
            let (x, r) = (a.mean[i][channel], b.mean[i][channel]);
            let floor = options.floor * r;
            let se = (a.variance[i][channel] + b.variance[i][channel] + floor * floor).sqrt();
            let z = match x - r {
                0.0 => 0.0,
                d if (d / se).is_nan() => f64::INFINITY,
                d => d / se,
            };
            scores.push(BlockZ { x: i % columns * side, y: i / columns * side, channel, z, image: x, reference: r });
        }
    }
    Ok(scores)
}
