//! relMSE: of one pixel, and as a film estimates its own.

use bytemuck::{Pod, Zeroable};

/// Estimated relMSE of the picture against its own expectation.
///
/// Camera samples are not independent where roulette or splitting meets every path: one comb rounds the samples of a
/// packet together, which makes the picture better than its standard errors say, in a diffuse box up to 2.4 times with
/// `classic:1`; so do Sobol' points ([`Sampler::Sobol`](crate::unstable::Sampler::Sobol)), there up to 4 times. Two
/// halves of the samples of each pixel are independent of each other: how much they differ, over what their samples let
/// expect, corrects the estimate (`core/src/film/independence.rs`), from two samples per pixel on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ErrorEstimate {
    /// Mean over pixels and channels of variance / (expectation^2 + 0.01), without the worst 0.01 % of pixels, times
    /// `independence`. The expectation is estimated from the pixel and those around it; at edges, where it may be that of
    /// either side, the estimate is in the middle of what that makes of the error.
    pub rel_mse: f64,
    /// Lower end of the 95 % confidence interval of `rel_mse`; see [`Self::interval`].
    pub low: f64,
    /// Upper end of that interval.
    pub high: f64,
    /// What the true relMSE is at least, whatever few pixels cause the rest: each counts with less than a quarter.
    pub at_least: f64,
    /// Mean as of `rel_mse`, over all pixels.
    pub rel_mse_all: f64,
    /// Variance of the pixels over that of independent samples, measured between the halves of their samples, for
    /// pixels whose samples are alike and for those that live on few of them apart, and weighted as their errors; 1 while
    /// there are too few.
    pub independence: f64,
    /// What `rel_mse` would grow by, on average over the pixels, if one of the camera samples had shown the brightest light
    /// of the scene in a mirror or another narrow lobe
    /// ([`Records::highlight`](crate::unstable::scene::Records::highlight)): no light sample finds that, and few camera samples
    /// may. 0 without such surfaces, and in pictures of 40,000 pixels and more, whose worst pixels are left out.
    pub highlight: f64,
    /// How many pixels would cause the error if each caused as much: (sum q)^2 / sum q^2 over the pixels' contributions q. Few
    /// if the error is that of few fireflies.
    pub effective_pixels: f64,
}

/// Fewest effective pixels of an error that is told from samples.
const RESOLVED: f64 = 64.0;
/// Most that one highlight may be of it.
const HIGHLIGHT: f64 = 0.1;

impl ErrorEstimate {
    /// Whether the samples tell the error: 64 effective pixels or more, and no single highlight that is not found yet would
    /// make it more than a tenth larger. If fewer pixels cause most of what is found (heavy tails), more of their kind are
    /// probably not found yet, or one that is found counts for more than it is; and a picture in which no sample has found
    /// a light's reflection in a chrome tap knows nothing of it. Then the error is `at_least` so large, and `low` and
    /// `high` mean nothing. Pictures of less than some hundred pixels are never resolved.
    pub fn is_resolved(&self) -> bool {
        self.effective_pixels >= RESOLVED && self.highlight <= HIGHLIGHT * self.rel_mse
    }

    /// 95 % confidence interval of `rel_mse`; `None` where the samples do not tell it.
    pub fn interval(&self) -> Option<[f64; 2]> {
        self.is_resolved().then_some([self.low, self.high])
    }

    /// Figure of merit of a render that took `work`, in any unit: 1 / (relMSE x work). It is about the same however long
    /// a render goes on, so that it tells which of two renders of a scene is the more efficient; infinite without error or
    /// work.
    ///
    /// ```
    /// let short = croupier::ErrorEstimate { rel_mse: 0.04, ..Default::default() };
    /// let long = croupier::ErrorEstimate { rel_mse: 0.01, ..Default::default() };
    /// assert_eq!(short.figure_of_merit(5.0), long.figure_of_merit(20.0));
    /// ```
    pub fn figure_of_merit(&self, work: f64) -> f64 {
        1.0 / (self.rel_mse * work)
    }
}

/// Constant in the denominator of relMSE, added to the squared mean so that black pixels do not dominate.
pub const REL_MSE_EPSILON: f64 = 1e-2;

/// Part of a variance that is taken off a squared mean to estimate the squared expectation. All of it would be unbiased,
/// but leaves next to nothing to divide by where a pixel has found its light once, and a few such pixels would make up
/// the whole sum.
pub(super) const TAKEN_OFF: f64 = 0.9;

/// The larger number; unlike that of `f64` a single comparison.
#[inline(always)]
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Denominator of relMSE, of a mean and its variance.
#[inline(always)]
pub(super) fn relative_denominator(mean: f64, variance: f64) -> f64 {
    larger(mean * mean - TAKEN_OFF * variance, 0.0) + REL_MSE_EPSILON
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: an interval of what is not resolved, for want of pixels or for a highlight.
    #[test]
    fn what_is_not_resolved_has_no_interval() {
        let e =
            ErrorEstimate { low: 1.0, high: 3.0, independence: 0.5, effective_pixels: RESOLVED, ..Default::default() };
        assert_eq!(e.interval(), Some([1.0, 3.0]));
        let few = ErrorEstimate { effective_pixels: RESOLVED - 1.0, ..e };
        assert_eq!(few.interval(), None);
        let with = |highlight: f64| ErrorEstimate { rel_mse: 1.0, highlight, ..e }.interval();
        assert_eq!((with(0.11), with(0.09)), (None, Some([1.0, 3.0])));
    }

    /// Killed by: all of the variance taken off where a pixel has found its light once.
    #[test]
    fn one_hit_leaves_something_to_divide_by() {
        assert!((relative_denominator(100.0, 1e4) - 1000.01).abs() < 1e-9);
        assert_eq!(relative_denominator(1.0, 4.0), REL_MSE_EPSILON);
    }
}
