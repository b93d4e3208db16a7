//! What other pixels say of one: the model of [`super::surroundings`], whose head has its formulas.

use super::error::{REL_MSE_EPSILON, TAKEN_OFF, larger, relative_denominator};

/// Fewer other pixels say nothing.
const ENOUGH: f64 = 8.0;
/// The other k.
pub(super) const DOUBT: f64 = 4.0;

/// What other pixels say of one, in a channel.
#[derive(Clone, Copy, Default)]
pub(super) struct Others {
    pub pixels: f64,
    mean: f64,
    /// Variance among them beyond their noise.
    contrast: f64,
    /// Mean of their variances.
    noise: f64,
}

impl Others {
    /// From sums over so many pixels.
    #[inline(always)]
    pub(super) fn of(pixels: f64, [mean, square, variance]: [f64; 3]) -> Self {
        let n = 1.0 / larger(pixels, 1.0);
        let (mean, noise) = (mean * n, variance * n);
        Self { pixels, mean, contrast: larger(square * n - mean * mean - noise, 0.0), noise }
    }
}

/// D of a pixel of mean m and variance v, D with the other k, and what part of it the window tells: t of
/// [`super::contrast`]. Without branches: the loop over pixels becomes one over vectors.
#[inline(always)]
pub(super) fn denominators([m, v]: [f64; 2], window: &Others, block: &Others) -> (f64, f64, f64) {
    let (noise, contrast) = (window.noise, window.contrast);
    // a of a + b, 0 where there is none of it
    let share = |a: f64, b: f64| {
        let share = a / (a + b);
        if a > 0.0 { share } else { 0.0 }
    };
    let u = share(block.contrast, larger(noise, block.noise) / window.pixels);
    let mean = block.mean + u * (window.mean - block.mean);
    let off = (m - mean) * (m - mean);
    // a pixel that has found nothing knows nothing: it is as noisy as the others
    let own = if v > 0.0 { v } else { noise };
    let surer = share(contrast, larger(own, noise));
    let of_window = u * u * noise / window.pixels;
    let of_block = (1.0 - u) * (1.0 - u) * block.noise / block.pixels;
    let with = |k: f64| {
        let stands_out = 1.0 - k * own / off;
        let stands_out = if off > k * own { stands_out } else { 0.0 };
        let w = larger(surer, stands_out);
        let e = mean + w * (m - mean);
        let variance = TAKEN_OFF * w * w * v + (1.0 - w) * (1.0 - w) * (of_window + of_block);
        (larger(e * e - variance, 0.0) + REL_MSE_EPSILON, (1.0 - w) * u * u)
    };
    let ((d, left), (other, _)) = (with(1.0), with(DOUBT));
    let alone = relative_denominator(m, v);
    let enough = window.pixels >= ENOUGH && block.pixels >= ENOUGH;
    (if enough { d } else { alone }, if enough { other } else { alone }, if enough { left } else { 0.0 })
}
