//! Variance and cost of the picture per camera sample (EARS, eqs. 33 and 34).

use super::adaptive::SampleAllocation;
use super::estimate::PixelEstimates;
use super::settings::Learning;
use crate::counters::Counters;
use crate::film::{PixelSums, TrimmedSums};
use crate::rrs::Norm;
use bytemuck::{Pod, Zeroable};

/// Share of the pixels whose variance is left out of the picture's. A single outlier would decide all factors. The
/// 0.001 % of EARS (section 5.2) leave out no pixel of a small picture: one bright sample made all vertices look
/// worthless, and roulette then produced more such samples.
const OUTLIERS: f64 = 1e-3;

/// Variance and cost of the picture per camera sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PictureStatistics {
    /// Mean weighted squared error over the pixels (eq. 34), without the outliers.
    pub variance: f64,
    /// The outliers' part of that mean.
    pub outliers: f64,
    /// Mean counted cost (eq. 33), in scattered rays ([`crate::unstable::cost`]).
    pub cost: f64,
    /// Weighted squared error at which one sample makes its pixel an outlier.
    pub limit: f64,
}

/// Statistics of the picture, over the iterations.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Picture {
    /// Statistics of the last iteration.
    pub last: PictureStatistics,
    /// Statistics of all iterations, older ones discounted.
    pub blended: PictureStatistics,
    /// Weight of `blended`: counted cost.
    weight: f64,
    /// Number of iterations measured.
    measured: u64,
}

impl Picture {
    /// Has an iteration been measured?
    pub(super) fn known(&self) -> bool {
        self.measured > 0
    }

    /// Mean cost over mean error; 0 while unknown.
    pub(super) fn cost_over_variance(&self) -> f32 {
        let b = &self.blended;
        if b.variance > 0.0 { (b.cost / b.variance).min(1e30) as f32 } else { 0.0 }
    }

    /// Takes the errors of an iteration's pixels ([`error_of`]), of which the outliers were left out.
    pub(super) fn measured(&mut self, learning: &Learning, t: &TrimmedSums, counters: &Counters) {
        let n = t.shown().max(1) as f64;
        let work = counters.cost();
        let s = PictureStatistics {
            variance: t.sums[0] / t.count.max(1) as f64,
            outliers: t.rest / n,
            cost: work / counters.camera_samples.max(1) as f64,
            limit: f64::from(t.limit) * counters.camera_samples as f64 / n,
        };

        let old = self.weight * f64::from(learning.decay);
        self.weight = old + work;
        let blend = |a: f64, b: f64| (a * old + b * work) / self.weight.max(f64::MIN_POSITIVE);
        let b = self.blended;
        self.blended = PictureStatistics {
            variance: blend(b.variance, s.variance),
            outliers: blend(b.outliers, s.outliers),
            cost: blend(b.cost, s.cost),
            limit: s.limit,
        };
        self.last = s;
        self.measured = self.measured.saturating_add(1);
    }
}

/// How many of so many pixels are outliers.
pub(super) fn outliers(pixels: u64) -> u64 {
    ((pixels as f64 * OUTLIERS) as u64 + 1).min(pixels.saturating_sub(1))
}

/// Mean squared error of a pixel's samples against its estimate, times its error weight, as a norm over the channels.
/// It is divided by the pixel's share of the samples, so that the mean over the pixels is the picture's.
pub(super) fn error_of(
    film: u32,
    p: &PixelSums,
    norm: Norm,
    pixels: &PixelEstimates<'_>,
    allocation: &SampleAllocation<'_>,
) -> f32 {
    let share = allocation.share(film);
    let (value, error_weight) = (pixels.value(film), pixels.error_weight(film));
    let square = p.mean_square_about(value);
    let error = |c: usize| square[c] * f64::from(error_weight[c]) / share;
    // sums of finite samples may make errors that f32 does not hold
    norm.of_color([error(0), error(1), error(2)]).min(f64::from(f32::MAX)) as f32
}
