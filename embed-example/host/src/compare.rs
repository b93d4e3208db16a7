//! Comparison of an image with a reference: error, bias, perceived difference. Everything in f64.
//!
//! | figure | answers |
//! |---|---|
//! | [`relmse`], [`mse`] | how large is the error, noise and bias together |
//! | [`Bias`] | is there an error that noise does not explain, and where |
//! | [`Ratio`] | is the whole image too bright or too dark |
//! | [`crate::flip`] | how large is the difference to the eye |
//! | [`equivalence()`] | is a difference shown to be *small* (not just: not shown to be large) |

mod bias;
mod equivalence;
mod mean_image;
mod metric;

pub use bias::{Bias, BiasOptions, BlockZ, bias, block_scores};
pub use equivalence::{Equivalence, equivalence, normal_cdf, normal_quantile};
pub use mean_image::{ImageMean, MeanImage, Ratio, ratio, relmse_of, relmse_of_per_pixel};
pub use metric::{CompareError, OUTLIERS, PixelError, RELMSE_EPSILON, mse, relmse, relmse_per_pixel, relmse_without};

use crate::flip::{self, Viewing};
use crate::image::Rgb;
use crate::tonemap::{Curve, expose};
use metric::{mean, same_size};
use serde::Serialize;

/// Images to compare.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// One image, or several independent ones of the same picture that differ in their seed.
    pub images: &'a [Rgb],
    /// Standard error per pixel of the image; not used when there are several.
    pub stderr: Option<&'a Rgb>,
    /// Reference image.
    pub reference: &'a Rgb,
    /// Standard error per pixel of the reference; without it the reference is taken as exact.
    pub reference_stderr: Option<&'a Rgb>,
}

/// Options of [`compare`].
#[derive(Clone, Copy, Debug, Default)]
pub struct CompareOptions {
    /// Whether relMSE keeps the pixels with the largest error.
    pub keep_outliers: bool,
    /// Stops of exposure before the tone mapping that FLIP sees.
    pub exposure: f32,
    /// Options of the tests for bias.
    pub bias: BiasOptions,
}

/// Figures of a comparison.
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
    /// Pixels that `relmse` leaves out.
    pub relmse_discarded_pixels: usize,
    /// Part of relMSE that is noise of the reference: mean of se² / (ref² + [`RELMSE_EPSILON`]).
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
    /// Ratio of `image_mean` to `reference_mean`.
    pub ratio: Ratio,
    /// Plain test for bias; absent if the standard error of the image is unknown.
    pub bias: Option<Bias>,
    /// Firefly-robust test for bias; absent if the standard error of the image is unknown.
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
    let means = if images.len() > 1 { MeanImage::from_seeds(images)? } else { MeanImage::from_image(first, stderr)? };
    let exact = MeanImage::from_image(reference, reference_stderr)?;
    let test = |robust| bias(&means, &exact, &BiasOptions { robust, ..options.bias });
    let known = images.len() > 1 || stderr.is_some();
    let (mut image_mean, reference_mean) = (means.image_mean(), exact.image_mean());
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
