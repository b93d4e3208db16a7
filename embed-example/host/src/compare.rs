//! How far an image is from a reference: error, bias, perceived difference. Everything in f64.
//!
//! | figure | answers |
//! |---|---|
//! | [`relmse`], [`mse`] | how large is the error, noise and bias together |
//! | [`Bias`] | is there an error that noise does not explain, and where |
//! | [`Ratio`] | is the whole image too bright or too dark |
//! | [`crate::flip`] | how large is the difference to the eye |
//! | [`equivalence`] | is a difference shown to be *small* (not just: not shown to be large) |

mod bias;
mod equivalence;

pub use bias::{Bias, BiasOptions, BlockZ, bias, block_scores};
pub use equivalence::{Equivalence, equivalence, normal_cdf, normal_quantile};

use crate::flip::{self, Viewing};
use crate::image::Rgb;
use crate::tonemap::{Curve, expose};
use serde::Serialize;
use std::{error, fmt};

/// Keeps the relative error of dark pixels finite: the `1e-2` of the definition of relMSE.
pub const RELMSE_EPSILON: f64 = 1e-2;
/// Part of the pixels, those with the largest error, that [`relmse`] leaves out unless told to keep them.
pub const OUTLIERS: f64 = 1e-4;

/// What cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CompareError {
    /// Two images that belong together differ in size.
    Size {
        /// Columns and rows of the first.
        first: (usize, usize),
        /// Columns and rows of the second.
        second: (usize, usize),
    },
    /// No image, or an image without pixels.
    Empty,
}

impl fmt::Display for CompareError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { first: (w, h), second: (v, g) } => {
                write!(f, "images differ in size: {w}x{h} and {v}x{g} pixels")
            }
            Self::Empty => write!(f, "there are no pixels to compare"),
        }
    }
}

impl error::Error for CompareError {}

/// A mean error over the pixels of an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PixelError {
    /// Mean over pixels and channels. Infinite if a pixel that counts is not finite.
    pub value: f64,
    /// Pixels left out as outliers.
    pub discarded: usize,
    /// Pixels of the image, outliers included, with a NaN or infinite channel.
    pub nonfinite: usize,
}

/// relMSE: the mean over pixels and channels of (x - ref)² / (ref² + [`RELMSE_EPSILON`]).
///
/// Unless `keep_outliers`, the floor([`OUTLIERS`] n) of the n pixels with the largest error (mean of their three
/// channels) are left out. A pixel that is not finite counts as an infinite error.
pub fn relmse(image: &Rgb, reference: &Rgb, keep_outliers: bool) -> Result<PixelError, CompareError> {
    relmse_without(image, reference, if keep_outliers { 0.0 } else { OUTLIERS })
}

/// [`relmse`] with another part of the pixels left out, in [0, 1): the more, the less a few fireflies count.
pub fn relmse_without(image: &Rgb, reference: &Rgb, outliers: f64) -> Result<PixelError, CompareError> {
    mean_error(image, relmse_per_pixel(image, reference)?, outliers)
}

/// MSE: the mean over all pixels and channels of (x - ref)².
pub fn mse(image: &Rgb, reference: &Rgb) -> Result<PixelError, CompareError> {
    mean_error(image, per_pixel(image, reference, |x, r| (x - r) * (x - r))?, 0.0)
}

/// What every pixel adds to relMSE, mean over its channels; infinite where the image is not finite.
pub fn relmse_per_pixel(image: &Rgb, reference: &Rgb) -> Result<Vec<f64>, CompareError> {
    per_pixel(image, reference, |x, r| (x - r) * (x - r) / (r * r + RELMSE_EPSILON))
}

fn per_pixel(image: &Rgb, reference: &Rgb, error: impl Fn(f64, f64) -> f64) -> Result<Vec<f64>, CompareError> {
    same_size(image, reference)?;
    let of_pixel = |(x, r): (&[f32; 3], &[f32; 3])| {
        let e: f64 = x.iter().zip(r).map(|(&x, &r)| error(f64::from(x), f64::from(r))).sum();
        if e.is_finite() { e / 3.0 } else { f64::INFINITY }
    };
    Ok(image.pixels.iter().zip(&reference.pixels).map(of_pixel).collect())
}

fn mean_error(image: &Rgb, mut errors: Vec<f64>, outliers: f64) -> Result<PixelError, CompareError> {
    let nonfinite = image.pixels.iter().filter(|p| p.iter().any(|x| !x.is_finite())).count();
    let discarded = (errors.len() as f64 * outliers) as usize;
    errors.sort_by(f64::total_cmp);
    errors.truncate(errors.len() - discarded);
    Ok(PixelError { value: mean(&errors), discarded, nonfinite })
}

/// An image of means with the variance of each mean: what the tests for bias compare.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Mean per pixel and channel.
    pub mean: Vec<[f64; 3]>,
    /// Variance of that mean.
    pub variance: Vec<[f64; 3]>,
}

impl Estimate {
    /// From an image and the standard error of its pixels; without one the image is taken as exact.
    pub fn from_image(image: &Rgb, stderr: Option<&Rgb>) -> Result<Self, CompareError> {
        if image.pixels.is_empty() {
            return Err(CompareError::Empty);
        }
        let variance = match stderr {
            Some(stderr) => {
                same_size(image, stderr)?;
                stderr.pixels.iter().map(|p| p.map(|s| f64::from(s) * f64::from(s))).collect()
            }
            None => vec![[0.0; 3]; image.pixels.len()],
        };
        let mean = image.pixels.iter().map(|p| p.map(f64::from)).collect();
        Ok(Self { width: image.width, height: image.height, mean, variance })
    }

    /// From independent images of one picture that differ in their seed only: their mean, and its variance from their
    /// spread. With fewer than two the variance is unknown and stays 0.
    pub fn from_seeds(images: &[Rgb]) -> Result<Self, CompareError> {
        let first = images.first().ok_or(CompareError::Empty)?;
        let mut estimate = Self::from_image(first, None)?;
        let mut squares = estimate.variance.clone();
        // Welford's update: the spread may be 1e-6 of the mean.
        for (i, image) in images.iter().enumerate().skip(1) {
            same_size(first, image)?;
            let n = (i + 1) as f64;
            for ((m, s), p) in estimate.mean.iter_mut().zip(&mut squares).zip(&image.pixels) {
                for ((m, s), &x) in m.iter_mut().zip(s).zip(p) {
                    let d = f64::from(x) - *m;
                    *m += d / n;
                    *s += d * (f64::from(x) - *m);
                }
            }
        }
        let n = images.len() as f64;
        let scale = if n > 1.0 { 1.0 / (n * (n - 1.0)) } else { 0.0 };
        estimate.variance = squares.iter().map(|s| s.map(|s| s * scale)).collect();
        Ok(estimate)
    }

    /// Mean of the whole image per channel, and its standard error (pixels are taken as independent: box filter).
    pub fn image_mean(&self) -> ImageMean {
        let n = self.mean.len() as f64;
        let sum = |pixels: &[[f64; 3]], c: usize| pixels.iter().map(|p| p[c]).sum::<f64>();
        let channels = [0, 1, 2];
        ImageMean {
            mean: channels.map(|c| sum(&self.mean, c) / n),
            stderr: Some(channels.map(|c| sum(&self.variance, c).sqrt() / n)),
        }
    }
}

/// Mean of a whole image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImageMean {
    /// Per channel.
    pub mean: [f64; 3],
    /// Standard error of each, if known.
    pub stderr: Option<[f64; 3]>,
}

/// Brightness of an image relative to its reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratio {
    /// Sum of all pixels and channels over that of the reference.
    pub value: f64,
    /// Its standard error to first order, if those of both are known. The three channels of a pixel see the same paths:
    /// they are taken as wholly correlated, which can only overstate it.
    pub stderr: Option<f64>,
}

/// The ratio of two image means.
pub fn ratio(image: &ImageMean, reference: &ImageMean) -> Ratio {
    let [a, b] = [image, reference].map(|m| m.mean.iter().sum::<f64>());
    let [sa, sb] = [image, reference].map(|m| m.stderr.map(|s| s.iter().sum::<f64>()));
    let value = a / b;
    let stderr = sa.zip(sb).map(|(sa, sb)| ((sa / b).powi(2) + (value * sb / b).powi(2)).sqrt());
    Ratio { value, stderr }
}

/// What is compared.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// One image, or several independent ones of the same picture that differ in their seed.
    pub images: &'a [Rgb],
    /// Standard error per pixel of the image; not used when there are several.
    pub stderr: Option<&'a Rgb>,
    /// The reference.
    pub reference: &'a Rgb,
    /// Standard error per pixel of the reference; without it the reference is taken as exact.
    pub reference_stderr: Option<&'a Rgb>,
}

/// How [`compare`] compares.
#[derive(Clone, Copy, Debug, Default)]
pub struct CompareOptions {
    /// Leave nothing out of relMSE.
    pub keep_outliers: bool,
    /// Stops of exposure before the tone mapping that FLIP sees.
    pub exposure: f32,
    /// Tests for bias.
    pub bias: BiasOptions,
}

/// Everything [`compare`] finds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Images compared.
    pub images: usize,
    /// [`relmse`], averaged over the images.
    pub relmse: f64,
    /// Pixels that it leaves out.
    pub relmse_discarded_pixels: usize,
    /// What the noise of the reference adds to relMSE: mean of se² / (ref² + [`RELMSE_EPSILON`]).
    pub relmse_of_reference: Option<f64>,
    /// [`mse`], averaged over the images.
    pub mse: f64,
    /// Mean LDR-FLIP of the tone-mapped images (clamped sRGB), averaged over the images.
    pub flip: f64,
    /// Pixels with a NaN or infinite channel, over all images.
    pub nonfinite_pixels: usize,
    /// Mean of the (averaged) image.
    pub image_mean: ImageMean,
    /// Mean of the reference.
    pub reference_mean: ImageMean,
    /// Of these two.
    pub ratio: Ratio,
    /// Plain test; absent if the standard error of the image is unknown.
    pub bias: Option<Bias>,
    /// Firefly-robust test; absent likewise.
    pub bias_robust: Option<Bias>,
}

/// Compares images with a reference by every measure of this module.
pub fn compare(inputs: &Inputs<'_>, options: &CompareOptions) -> Result<Comparison, CompareError> {
    let Inputs { images, stderr, reference, reference_stderr } = *inputs;
    let first = images.first().ok_or(CompareError::Empty)?;
    same_size(first, reference)?;
    let mut relative = Vec::new();
    let mut squared = Vec::new();
    let mut perceived = Vec::new();
    let display = |image: &Rgb| expose(image, options.exposure, Curve::Clamp);
    for image in images {
        relative.push(relmse(image, reference, options.keep_outliers)?);
        squared.push(mse(image, reference)?.value);
        let (width, height) = (reference.width, reference.height);
        let map = flip::flip(width, height, &display(reference), &display(image), Viewing::default());
        perceived.push(mean(&map));
    }
    let estimate = if images.len() > 1 { Estimate::from_seeds(images)? } else { Estimate::from_image(first, stderr)? };
    let exact = Estimate::from_image(reference, reference_stderr)?;
    let test = |robust| bias(&estimate, &exact, &BiasOptions { robust, ..options.bias });
    let known = images.len() > 1 || stderr.is_some();
    let (mut image_mean, reference_mean) = (estimate.image_mean(), exact.image_mean());
    image_mean.stderr = image_mean.stderr.filter(|_| known);
    Ok(Comparison {
        width: reference.width,
        height: reference.height,
        images: images.len(),
        relmse: mean(&relative.iter().map(|e| e.value).collect::<Vec<_>>()),
        relmse_discarded_pixels: relative.first().map_or(0, |e| e.discarded),
        relmse_of_reference: reference_stderr.map(|_| relmse_of(&exact)),
        mse: mean(&squared),
        flip: mean(&perceived),
        nonfinite_pixels: relative.iter().map(|e| e.nonfinite).sum(),
        image_mean,
        reference_mean,
        ratio: ratio(&image_mean, &reference_mean),
        bias: if known { Some(test(false)?) } else { None },
        bias_robust: if known { Some(test(true)?) } else { None },
    })
}

/// Expected relMSE of an estimate against the truth, from its variance, over all pixels.
pub fn relmse_of(estimate: &Estimate) -> f64 {
    mean(&relmse_of_per_pixel(estimate))
}

/// What the noise of every pixel adds to [`relmse_of`].
pub fn relmse_of_per_pixel(estimate: &Estimate) -> Vec<f64> {
    let of_pixel =
        |(m, v): (&[f64; 3], &[f64; 3])| m.iter().zip(v).map(|(m, v)| v / (m * m + RELMSE_EPSILON)).sum::<f64>() / 3.0;
    estimate.mean.iter().zip(&estimate.variance).map(of_pixel).collect()
}

fn same_size(a: &Rgb, b: &Rgb) -> Result<(), CompareError> {
    if (a.width, a.height) != (b.width, b.height) {
        return Err(CompareError::Size { first: (a.width, a.height), second: (b.width, b.height) });
    }
    if a.pixels.is_empty() { Err(CompareError::Empty) } else { Ok(()) }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
