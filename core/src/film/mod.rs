//! Sums of every pixel, so that the mean stays exact after 1e9 samples or a firefly (NUMERICS FLM-1), and the estimate of
//! the picture's error.
//!
//! | file | holds |
//! |---|---|
//! | `pixel` | sums of one pixel |
//! | `aov` | auxiliary values: [`Aov`], their planes |
//! | `coverage` | shares of a pixel by index |
//! | `short` | 32-bit numbers with the range of `f64` |
//! | `error` | relMSE of a pixel, [`ErrorEstimate`] |
//! | `film_sum` | films of several renders, added |
//! | `independence` | correlation of samples, measured |
//! | `sqrt` | square root in f64 |
//! | `surroundings` | what relMSE divides by |
//! | `others` | what other pixels say of one |
//! | `contrast` | how much more an error may be at an edge |
//! | `trimmed` | sums without the largest values |

mod aov;
mod contrast;
mod coverage;
mod error;
mod film_sum;
mod independence;
mod others;
mod pixel;
mod short;
mod sqrt;
mod surroundings;
mod trimmed;

pub use aov::{Aov, AovSet, PixelAov};
pub(crate) use aov::{AovLayout, AovSums};
pub use error::{ErrorEstimate, REL_MSE_EPSILON};
pub use film_sum::FilmSum;
pub use pixel::PixelStats;
pub(crate) use pixel::{Half, PixelSums, compared_channel};
pub(crate) use sqrt::SqrtNewton;
pub(crate) use trimmed::TrimmedSums;

use crate::memory::{Carver, Measure, MemoryError};
use aov::AovPlanes;
use bytemuck::{Pod, Zeroable};
pub use independence::VarianceFactors;
use independence::{CLASSES, Differences, Independence, class};
use pixel::PixelWeights;
use surroundings::{SIDE, Span, UNSURE_SHARE, relative_errors};

/// From this many pixels with most error that are left out on, a highlight that was not found does not matter: up to so many
/// would be among them, and of more one would have been found.
const FORGIVEN: u64 = 4;

/// What a film holds of each pixel besides its mean and error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilmLayout {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Samples have weights.
    pub weights: bool,
    /// Rays are counted.
    pub rays: bool,
    /// Auxiliary values.
    pub aovs: AovSet,
}

impl FilmLayout {
    /// Number of pixels.
    pub(crate) fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }

    fn aov_values(&self) -> usize {
        self.pixels().saturating_mul(AovLayout::new(self.aovs).planes)
    }

    fn if_any(&self, wanted: bool) -> usize {
        if wanted { self.pixels() } else { 0 }
    }
}

/// Picture: sums of all pixels, row 0 at the top.
#[derive(Debug)]
pub struct Film<'m> {
    size: [u32; 2],
    pixels: &'m mut [PixelSums],
    weights: &'m mut [PixelWeights],
    rays: &'m mut [u32],
    aovs: AovPlanes<'m>,
    scalars: FilmScalars,
}

/// All of a film but its pixels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FilmScalars {
    /// Of the merge that runs, by class of pixels.
    differences: [Differences; CLASSES],
    independence: [Independence; CLASSES],
    error: ErrorEstimate,
    /// 0 until an iteration is merged: what memory holds are no pixels then.
    filled: u64,
}

impl FilmScalars {
    /// Those of a film without samples.
    pub(crate) fn new() -> Self {
        Self {
            differences: [Differences::default(); CLASSES],
            independence: [Independence::UNKNOWN; CLASSES],
            error: ErrorEstimate { independence: Independence::UNKNOWN.ratio, ..ErrorEstimate::default() },
            filled: 0,
        }
    }
}

impl<'m> Film<'m> {
    pub(crate) fn measure(m: Measure, l: &FilmLayout) -> Measure {
        m.add::<PixelSums>(l.pixels())
            .add::<PixelWeights>(l.if_any(l.weights))
            .add::<u32>(l.if_any(l.rays))
            .add::<f32>(l.aov_values())
    }

    /// Carves without touching the memory.
    pub(crate) fn carve(c: &mut Carver<'m>, l: &FilmLayout, scalars: FilmScalars) -> Result<Self, MemoryError> {
        Ok(Self {
            size: l.size,
            pixels: c.take_unset(l.pixels())?,
            weights: c.take_unset(l.if_any(l.weights))?,
            rays: c.take_unset(l.if_any(l.rays))?,
            aovs: AovPlanes::new(AovLayout::new(l.aovs), l.pixels(), c.take_unset(l.aov_values())?),
            scalars,
        })
    }

    pub(crate) fn scalars(&self) -> FilmScalars {
        self.scalars
    }

    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        self.scalars = FilmScalars::new();
    }

    /// Columns and rows of the picture.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Number of pixels.
    pub(crate) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Has any iteration been merged?
    fn is_filled(&self) -> bool {
        self.scalars.filled != 0
    }

    /// Statistics of a pixel by its index, row by row from the top left; without samples before the end of the first
    /// iteration and for pixels that do not exist. While an iteration is being finished
    /// ([`crate::SessionState::finish_iteration`]), some pixels have it and others do not.
    #[inline]
    pub fn pixel(&self, index: usize) -> PixelStats {
        match self.pixels.get(index) {
            Some(p) if self.is_filled() => p.stats(self.weights.get(index), self.rays.get(index).copied().unwrap_or(0)),
            _ => PixelStats::default(),
        }
    }

    /// Number of samples of a pixel.
    pub(crate) fn samples(&self, index: usize) -> u32 {
        if self.is_filled() { self.pixels.get(index).map_or(0, |p| p.samples) } else { 0 }
    }

    /// Statistics of the pixels, row by row; see [`Self::pixel`].
    pub fn pixels(&self) -> impl ExactSizeIterator<Item = PixelStats> + DoubleEndedIterator + Clone + '_ {
        (0..self.pixels.len()).map(|i| self.pixel(i))
    }

    /// Plane `channel` of an auxiliary value ([`Aov::channels`]), one value per pixel, row by row from the top left; see
    /// [`Aov`] for its unit and divisor. `None` if the settings do not ask for it, and before the end of the first
    /// iteration.
    pub fn plane(&self, aov: Aov, channel: usize) -> Option<&[f32]> {
        self.aovs.plane(aov, channel).filter(|_| self.is_filled())
    }

    /// Auxiliary sums of the pixels, row by row; empty if the settings do not ask for any, and before the end of the first
    /// iteration.
    pub fn aovs(&self) -> impl ExactSizeIterator<Item = PixelAov> + DoubleEndedIterator + Clone + '_ {
        let n = if self.aovs.is_empty() || !self.is_filled() { 0 } else { self.pixels.len() };
        (0..n).map(|i| self.aovs.sums(i, self.samples(i)))
    }

    /// Standard error of a pixel's mean per channel, right on average over the pixels of its class: that of independent
    /// samples, times the root of its factor of [`Self::variance_factors`]. See [`Self::pixel`] for pixels without samples.
    pub fn standard_error(&self, index: usize) -> [f64; 3] {
        let p = self.pixel(index);
        let factor = self.variance_factors().of(&p);
        p.variance_of_mean().map(|v| (factor * v).sqrt_newton())
    }

    /// What the variances of pixels that independent samples would have are to be multiplied by, as of the last iteration
    /// whose pixels were all merged: the factors change before the end of an iteration that is finished in pieces
    /// ([`crate::SessionState::finish_iteration`]).
    pub fn variance_factors(&self) -> VarianceFactors {
        VarianceFactors::told(&self.scalars.independence)
    }

    /// [`ErrorEstimate::independence`] as of the end of the last iteration; `None` while the samples do not tell it.
    pub(crate) fn independence(&self) -> Option<f64> {
        Some(self.scalars.error.independence).filter(|x| *x != Independence::UNKNOWN.ratio)
    }

    /// Adds the sums of an iteration to a pixel, each sample with weight `w` if samples have weights.
    #[inline]
    pub(crate) fn merge(&mut self, pixel: usize, sums: &PixelSums, rays: u32, aov: &[f32], w: f64) {
        let fresh = !self.is_filled();
        let before = self.pixel(pixel);
        let Some(p) = self.pixels.get_mut(pixel) else { return };
        if fresh {
            *p = PixelSums::default();
        }
        let all = match self.weights.get_mut(pixel) {
            Some(weights) => {
                if fresh {
                    *weights = PixelWeights::default();
                }
                p.merge_weighted(weights, sums, w);
                p.stats(Some(weights), 0)
            }
            None => {
                p.merge(sums);
                p.stats(None, 0)
            }
        };
        if let Some(of_class) = self.scalars.differences.get_mut(class(&all)) {
            of_class.add(&all, compared_channel(pixel));
        }
        if let Some(r) = self.rays.get_mut(pixel) {
            *r = if fresh { rays } else { r.saturating_add(rays) };
        }
        let samples = before.samples as u32;
        if self.weights.is_empty() || w <= 0.0 {
            self.aovs.merge(pixel, samples, sums.samples, aov);
        } else {
            self.aovs.merge_weighted(pixel, samples, sums.samples, aov, before.weight / w);
        }
    }

    /// Begins the merge of an iteration; of one that was abandoned no sums are left.
    pub(crate) fn begin_merge(&mut self) {
        self.scalars.differences = Default::default();
    }

    /// Ends the merge of an iteration: all its pixels were added.
    pub(crate) fn end_merge(&mut self) {
        let s = &mut self.scalars;
        for (known, d) in s.independence.iter_mut().zip(core::mem::take(&mut s.differences)) {
            *known = known.after(&d);
        }
        s.filled = 1;
    }

    /// Estimated error of the picture, as of the end of the last iteration. Its interval holds the normal one over the pixels'
    /// contributions, which are independent, and what depends on how expectations of pixels are estimated; see
    /// [`ErrorEstimate::is_resolved`] for when it cannot be told.
    pub fn error_estimate(&self) -> ErrorEstimate {
        self.scalars.error
    }

    /// Blocks of pixels a row of blocks, and rows of blocks.
    fn block_grid(&self) -> [u32; 2] {
        self.size.map(|n| (n / SIDE).max(1))
    }

    /// Number of blocks that [`Self::show_errors`] counts.
    pub(crate) fn blocks(&self) -> u64 {
        let [columns, rows] = self.block_grid();
        u64::from(columns) * u64::from(rows)
    }

    /// Columns and rows of a block.
    fn block(&self, block: u64) -> [Span; 2] {
        let grid = self.block_grid();
        let columns = u64::from(grid[0]);
        let at = [block % columns, block / columns];
        core::array::from_fn(|k| {
            let size = self.size[k];
            let edge = |i: u64| (i * u64::from(size) / u64::from(grid[k])) as u32;
            Span { from: edge(at[k]), to: edge(at[k] + 1), size }
        })
    }

    /// Sums of the errors of the pixels, before any is shown.
    pub(crate) fn begin_errors(&self) -> TrimmedSums {
        TrimmedSums::new(Self::outliers(self.pixels.len() as u64))
    }

    /// Words that the sums of [`Self::begin_errors`] need for a film of so many pixels.
    pub(crate) fn largest_len(pixels: usize) -> usize {
        TrimmedSums::heap_len(Self::outliers(pixels as u64))
    }

    /// Shows the errors of pixels from block `at` on, some `limit` pixels. `highlight` is that of the scene
    /// ([`Records::highlight`](crate::unstable::scene::Records::highlight)). Blocks and pixels shown.
    pub(crate) fn show_errors(
        &self,
        at: u64,
        limit: usize,
        s: &mut TrimmedSums,
        largest: &mut [u32],
        highlight: f32,
    ) -> [u64; 2] {
        let (mut blocks, mut pixels) = (0, 0);
        while pixels < limit as u64 && at + blocks < self.blocks() {
            let pixel = |x: u32, y: u32| self.pixel(y as usize * self.size[0] as usize + x as usize);
            relative_errors(self.block(at + blocks), highlight, pixel, |e| {
                let class = e.class % CLASSES;
                let ratio = self.scalars.independence[class].ratio as f32;
                let mut of_classes = [0.0; CLASSES];
                of_classes[class] = e.error;
                let [a, b, c] = of_classes;
                let [error, other, contrast, unsure] = [e.error, e.other, e.contrast, e.unsure].map(|x| ratio * x);
                s.show([error, other, contrast, unsure, e.highlight, a, b, c], largest);
                pixels += 1;
            });
            blocks += 1;
        }
        [blocks, pixels]
    }

    /// Number of the pixels with most error that [`ErrorEstimate::rel_mse`] leaves out.
    pub(crate) fn outliers(pixels: u64) -> u64 {
        pixels / 10_000
    }

    /// Estimates the error from the sums that have seen all pixels, without the outliers, in pieces as of
    /// [`TrimmedSums::end`]. Work, and whether it is estimated.
    pub(crate) fn estimate_error(&mut self, t: &mut TrimmedSums, largest: &mut [u32], limit: u64) -> (u64, bool) {
        let (work, done) = t.end(Self::outliers(self.pixels.len() as u64), limit, largest);
        if done {
            self.set_error(t);
        }
        (work, done)
    }

    /// Sets the estimated error from sums without the outliers.
    fn set_error(&mut self, t: &TrimmedSums) {
        let m = t.count.max(1) as f64;
        let [mean, other, contrast, unsure, highlight, of_classes @ ..] = t.sums.map(|x| x / m);
        let noise =
            self.scalars.independence.iter().zip(of_classes).map(|(i, x)| i.noise * i.noise * x * x).sum::<f64>();
        let spread = (t.sum_sqr / m - mean * mean).max(0.0) / m + noise;
        // how much depends on the estimated expectations
        let doubts = [other - mean, contrast, UNSURE_SHARE * unsure];
        let half = (1.96 * 1.96 * spread + doubts.map(|x| x * x).iter().sum::<f64>()).sqrt_newton();
        let independent: f64 = of_classes.iter().sum();
        let known = self.scalars.independence.iter().any(|i| i.ratio != Independence::UNKNOWN.ratio);
        self.scalars.error = ErrorEstimate {
            rel_mse: mean,
            low: (mean - half).max(0.0),
            high: mean + half,
            at_least: (mean - unsure - contrast).max(0.0),
            rel_mse_all: (t.sums[0] + t.rest) / self.pixels.len().max(1) as f64,
            independence: if known && independent > 0.0 { mean / independent } else { Independence::UNKNOWN.ratio },
            highlight: if Self::outliers(self.pixels.len() as u64) < FORGIVEN { highlight / m } else { 0.0 },
            effective_pixels: if t.sum_sqr > 0.0 { t.sums[0] * t.sums[0] / t.sum_sqr } else { m },
        };
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::memory::BLOCK_ALIGN;
    use std::vec;

    fn with_film(pixels: u32, check: impl FnOnce(&mut Film<'_>)) {
        let layout = FilmLayout { size: [pixels, 1], weights: false, rays: false, aovs: AovSet::NONE };
        let needed = Film::measure(Measure::new(), &layout).layout().expect("a small film");
        let mut memory = vec![0u8; needed.size + BLOCK_ALIGN];
        let from = memory.as_ptr().align_offset(BLOCK_ALIGN);
        let mut c = Carver::new(&mut memory[from..], needed).expect("room");
        check(&mut Film::carve(&mut c, &layout, FilmScalars::new()).expect("room"));
    }

    /// Four samples, half of them in each half of the pixel.
    fn four_samples() -> PixelSums {
        let mut sums = PixelSums::default();
        (0..4u8).for_each(|i| sums.add([f64::from(i); 3], if i < 2 { Half::First } else { Half::Second }, 0));
        sums
    }

    /// What an end that was abandoned has gathered of the correlation does not count in the next one. Killed by: sums that
    /// are forgotten at the end of a merge only.
    #[test]
    fn an_abandoned_merge_is_forgotten() {
        with_film(1, |film| {
            let sums = four_samples();
            let nothing = |film: &Film<'_>| bytemuck::bytes_of(&film.scalars.differences).iter().all(|b| *b == 0);
            film.merge(0, &sums, 0, &[], 1.0);
            film.end_merge();
            film.merge(0, &sums, 0, &[], 1.0);
            assert!(!nothing(film));
            film.begin_merge();
            assert!(nothing(film));
        });
    }

    /// Killed by: a ratio of 1 before any samples tell it, one that stays unknown.
    #[test]
    fn independence_is_unknown_until_samples_tell_it() {
        with_film(64, |film| {
            let mut sums = TrimmedSums::default();
            sums.count = 64;
            (sums.sums[0], sums.sums[5]) = (64.0, 32.0);
            film.set_error(&sums);
            assert_eq!((film.independence(), film.error_estimate().independence), (None, 1.0));
            (0..64).for_each(|i| film.merge(i, &four_samples(), 0, &[], 1.0));
            film.end_merge();
            assert_eq!(film.independence(), None, "as of the last end");
            film.set_error(&sums);
            assert_eq!(film.independence(), Some(2.0));
        });
    }
}
