//! Images of means with their variances, and figures that follow from both.

use super::metric::{CompareError, RELMSE_EPSILON, mean, same_size};
use crate::image::Rgb;
use serde::Serialize;

/// Image of means with the variance of each mean: the input of the tests for bias.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Mean per pixel and channel.
    pub mean: Vec<[f64; 3]>,
    /// Variance of the mean per pixel and channel.
    pub variance: Vec<[f64; 3]>,
}

impl MeanImage {
    /// Means from an image and the standard error of its pixels; without one the image is taken as exact.
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

    /// Means of independent images of one picture that differ in their seed only, and variances from their spread. With fewer than two the variance is unknown and stays 0.
    pub fn from_seeds(images: &[Rgb]) -> Result<Self, CompareError> {
        let first = images.first().ok_or(CompareError::Empty)?;
        let mut means = Self::from_image(first, None)?;
        let mut squares = means.variance.clone();
        // Welford's update: the spread may be 1e-6 of the mean.
        for (i, image) in images.iter().enumerate().skip(1) {
            same_size(first, image)?;
            let n = (i + 1) as f64;
            for ((m, s), p) in means.mean.iter_mut().zip(&mut squares).zip(&image.pixels) {
                for ((m, s), &x) in m.iter_mut().zip(s).zip(p) {
                    let d = f64::from(x) - *m;
                    *m += d / n;
                    *s += d * (f64::from(x) - *m);
                }
            }
        }
        let n = images.len() as f64;
        let scale = if n > 1.0 { 1.0 / (n * (n - 1.0)) } else { 0.0 };
        means.variance = squares.iter().map(|s| s.map(|s| s * scale)).collect();
        Ok(means)
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
    /// Mean per channel.
    pub mean: [f64; 3],
    /// Standard error per channel, if known.
    pub stderr: Option<[f64; 3]>,
}

/// Brightness of an image relative to its reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratio {
    /// Sum of all pixels and channels over that of the reference.
    pub value: f64,
    /// Standard error of the ratio to first order, if those of both means are known. The three channels of a pixel see the same paths:
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

/// Expected relMSE of an image of means against its expectation, from its variances, over all pixels.
pub fn relmse_of(image: &MeanImage) -> f64 {
    mean(&relmse_of_per_pixel(image))
}

/// Contribution of every pixel to [`relmse_of`].
pub fn relmse_of_per_pixel(image: &MeanImage) -> Vec<f64> {
    let of_pixel =
        |(m, v): (&[f64; 3], &[f64; 3])| m.iter().zip(v).map(|(m, v)| v / (m * m + RELMSE_EPSILON)).sum::<f64>() / 3.0;
    image.mean.iter().zip(&image.variance).map(of_pixel).collect()
}
