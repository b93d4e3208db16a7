//! One measure for all renderers, which needs nothing but their pictures.

use croupier_benches::stats::jackknife;
use croupier_host::compare::{Bias, BiasOptions, CompareError, MeanImage, RELMSE_EPSILON, block_scores};
use croupier_host::image::Rgb;

/// Shares of the pixels that are left out.
pub(crate) const TRIMS: [f64; 3] = [1e-4, 1e-3, 5e-3];

/// Share that is left out where pictures are weighted.
const WEIGHT_TRIM: f64 = 1e-3;

/// Side of the blocks whose means are compared.
const BLOCK: usize = 16;

/// All renders of a scene in one way: by seed.
#[derive(Default)]
pub(crate) struct Side {
    pub(crate) pictures: Vec<Rgb>,
    pub(crate) core_seconds: Vec<f64>,
    /// Per pixel.
    pub(crate) samples: Vec<f64>,
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

impl Side {
    /// Without one of the seeds.
    fn without(&self, seed: usize) -> Self {
        let mut side = Self {
            pictures: self.pictures.clone(),
            core_seconds: self.core_seconds.clone(),
            samples: self.samples.clone(),
        };
        side.pictures.remove(seed);
        side.core_seconds.remove(seed);
        side.samples.remove(seed);
        side
    }

    /// Relative variance of a picture, pixel by pixel, sorted.
    fn errors(&self, means: &MeanImage, truth: &[[f64; 3]]) -> Vec<f64> {
        let seeds = self.pictures.len() as f64;
        let of_pixel = |(t, v): (&[f64; 3], &[f64; 3])| {
            seeds * t.iter().zip(v).map(|(t, v)| v / (t * t + RELMSE_EPSILON)).sum::<f64>() / 3.0
        };
        let mut errors: Vec<f64> = truth.iter().zip(&means.variance).map(of_pixel).collect();
        errors.sort_by(f64::total_cmp);
        errors
    }
}

/// Mean of sorted errors without the worst ones.
fn trimmed(errors: &[f64], trim: f64) -> f64 {
    mean(&errors[..errors.len() - (errors.len() as f64 * trim) as usize])
}

/// The sides' pictures as one, each weighted.
fn pooled(means: &[&MeanImage], weights: &[f64]) -> Option<MeanImage> {
    let sum: f64 = weights.iter().sum();
    let mut all = MeanImage::clone(means.first()?);
    let mix = |part: fn(&MeanImage) -> &Vec<[f64; 3]>, power: i32| -> Vec<[f64; 3]> {
        let value = |i: usize, c: usize| {
            means.iter().zip(weights).map(|(m, w)| (w / sum).powi(power) * part(m)[i][c]).sum::<f64>()
        };
        (0..part(means[0]).len()).map(|i| [0, 1, 2].map(|c| value(i, c))).collect()
    };
    (all.mean, all.variance) = (mix(|m| &m.mean, 1), mix(|m| &m.variance, 2));
    Some(all)
}

/// Sides of a scene, measured.
pub(crate) struct Measured {
    means: Vec<MeanImage>,
    weights: Vec<f64>,
    /// Error x core-seconds of each side, by [`TRIMS`].
    pub(crate) figures: Vec<[f64; 3]>,
}

impl Measured {
    /// All sides need at least two pictures, of the same size.
    ///
    /// Errors are relative to the mean of all pictures of all sides. Every side's weight in it is the inverse of its
    /// error (relative to the plain mean): noise of the mean raises its square, and where a picture has a firefly it
    /// hides the firefly's own error, so that the side with most noise must not have a say as large as the others. One
    /// weight per side, not per pixel, since weights that know a pixel's noise would bias its mean.
    pub(crate) fn of(sides: &[Side]) -> Result<Self, CompareError> {
        let means: Vec<MeanImage> =
            sides.iter().map(|s| MeanImage::from_seeds(&s.pictures)).collect::<Result<_, _>>()?;
        let all: Vec<&MeanImage> = means.iter().collect();
        let plain = pooled(&all, &vec![1.0; means.len()]).ok_or(CompareError::Empty)?;
        let weight = |(side, m): (&Side, &MeanImage)| {
            let error = trimmed(&side.errors(m, &plain.mean), WEIGHT_TRIM);
            // no side is without any noise, but a picture may be black
            1.0 / error.max(1e-12)
        };
        let weights: Vec<f64> = sides.iter().zip(&means).map(weight).collect();
        let truth = pooled(&all, &weights).ok_or(CompareError::Empty)?;
        let figures = |(side, m): (&Side, &MeanImage)| {
            let errors = side.errors(m, &truth.mean);
            TRIMS.map(|trim| trimmed(&errors, trim) * mean(&side.core_seconds))
        };
        let figures = sides.iter().zip(&means).map(figures).collect();
        Ok(Self { means, weights, figures })
    }

    /// The figure of the best of `others` over that of a side, as its logarithm.
    fn ratio(&self, side: usize, others: &[usize], trim: usize) -> f64 {
        let best = others.iter().map(|&o| self.figures[o][trim]).fold(f64::INFINITY, f64::min);
        (best / self.figures[side][trim]).ln()
    }

    /// Do the pictures of a side show what those of `others` show?
    pub(crate) fn agreement(&self, side: usize, others: &[usize]) -> Result<Agreement, CompareError> {
        let means: Vec<&MeanImage> = others.iter().map(|&o| &self.means[o]).collect();
        let weights: Vec<f64> = others.iter().map(|&o| self.weights[o]).collect();
        let others = pooled(&means, &weights).ok_or(CompareError::Empty)?;
        let options = BiasOptions { block: BLOCK, robust: true, ..BiasOptions::default() };
        let scores = block_scores(&self.means[side], &others, &options)?;
        // relative in the way of the errors
        let relative = scores.iter().map(|b| (b.image - b.reference) / b.reference.hypot(RELMSE_EPSILON.sqrt()));
        Ok(Agreement { difference: relative.sum::<f64>() / scores.len() as f64, scores: Bias::of(&scores) })
    }
}

/// How a side's pictures differ from those of others.
pub(crate) struct Agreement {
    /// Mean over blocks and channels of the relative difference.
    pub(crate) difference: f64,
    /// z-scores of the blocks.
    pub(crate) scores: Bias,
}

/// A ratio in logarithms, and half the width of its 95 % interval.
#[derive(Clone, Copy)]
pub(crate) struct LogRatio(pub(crate) f64, pub(crate) Option<f64>);

/// How much better each of `ours` is than the best of `others`, by [`TRIMS`]. Intervals are those of the jackknife: a
/// seed is left out of all sides at once, since its renders shared the state of the machine, and the best of the others
/// is chosen anew.
pub(crate) fn gains(
    sides: &[Side],
    all: &Measured,
    ours: &[usize],
    others: &[usize],
) -> Result<Vec<[LogRatio; 3]>, CompareError> {
    let seeds = sides.first().map_or(0, |s| s.pictures.len());
    // one picture has no variance
    let left_out = if seeds < 3 { 0 } else { seeds };
    let without = |seed| Measured::of(&sides.iter().map(|s| s.without(seed)).collect::<Vec<_>>());
    let without: Vec<Measured> = (0..left_out).map(without).collect::<Result<_, _>>()?;
    let gain = |&side: &usize| {
        [0, 1, 2].map(|trim| {
            let of = |m: &Measured| m.ratio(side, others, trim);
            LogRatio(of(all), jackknife(&without.iter().map(of).collect::<Vec<_>>()))
        })
    };
    Ok(ours.iter().map(gain).collect())
}
