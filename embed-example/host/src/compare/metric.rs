//! relMSE and MSE of an image against a reference.

use crate::image::Rgb;
use serde::Serialize;
use std::{error, fmt};

/// Term that keeps the relative error of dark pixels finite: the `1e-2` of the definition of relMSE.
pub const RELMSE_EPSILON: f64 = 1e-2;
/// Part of the pixels, those with the largest error, that [`relmse`] leaves out unless told to keep them.
pub const OUTLIERS: f64 = 1e-4;

/// Reason why images cannot be compared.
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

/// Mean error over the pixels of an image.
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

/// [`relmse`] without another share of the pixels, in [0, 1): the larger it is, the less a few fireflies count.
pub fn relmse_without(image: &Rgb, reference: &Rgb, outliers: f64) -> Result<PixelError, CompareError> {
    mean_error(image, relmse_per_pixel(image, reference)?, outliers)
}

/// MSE: the mean over all pixels and channels of (x - ref)².
pub fn mse(image: &Rgb, reference: &Rgb) -> Result<PixelError, CompareError> {
    mean_error(image, per_pixel(image, reference, |x, r| (x - r) * (x - r))?, 0.0)
}

/// Contribution of every pixel to relMSE, mean over its channels; infinite where the image is not finite.
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

/// Fails unless the images have pixels, and as many.
pub(super) fn same_size(a: &Rgb, b: &Rgb) -> Result<(), CompareError> {
    if (a.width, a.height) != (b.width, b.height) {
        return Err(CompareError::Size { first: (a.width, a.height), second: (b.width, b.height) });
    }
    if a.pixels.is_empty() { Err(CompareError::Empty) } else { Ok(()) }
}

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
