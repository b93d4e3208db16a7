//! Estimates of the pixels' radiance, by which errors are weighted: a relative error needs the value that it is
//! relative to.

use super::settings::{Learning, Objective, PixelEstimator};
use crate::denoise::{NoisySource, Progress, Work, window_len};
use crate::film::{Aov, Film, REL_MSE_EPSILON};
use crate::memory::{Carver, Measure, MemoryError};
use crate::tiles::{BlockGrid, film_index};
use bytemuck::{Pod, Zeroable};
use croupier_simd::F32x8;

/// Storage of the estimates.
#[derive(Debug)]
enum Values<'m> {
    None,
    /// Three planes of the denoised picture, and what the denoiser works in.
    Denoised(Work<'m>),
    Blocks([&'m mut [f32]; 3]),
}

/// Estimates of the pixels' radiance, linear Rec. 709: denoised, means of blocks, or given by the host.
#[derive(Debug)]
pub(super) struct PixelEstimates<'m> {
    size: [u32; 2],
    relative: bool,
    values: Values<'m>,
    state: EstimateScalars,
}

/// State of the estimates, apart from their values.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct EstimateScalars {
    /// Not 0: there are estimates.
    known: u32,
    /// Not 0: the estimates are the host's.
    given: u32,
    /// How far the denoiser has come.
    progress: Progress,
    /// Next row of the means of blocks.
    row: u32,
    reserved: u32,
}

impl<'m> PixelEstimates<'m> {
    pub(super) fn measure(m: Measure, size: [u32; 2], how: Option<PixelEstimator>) -> Measure {
        match how {
            None => m,
            Some(PixelEstimator::Denoised) => {
                let pixels = size[0] as usize * size[1] as usize;
                (0..5).fold(m, |m, _| m.add::<f32>(pixels)).add::<f32>(window_len(size))
            }
            Some(PixelEstimator::Blocks) => (0..3).fold(m, |m, _| m.add::<f32>(BlockGrid::tiles(size).count())),
        }
    }

    pub(super) fn carve(
        c: &mut Carver<'m>,
        size: [u32; 2],
        how: Option<PixelEstimator>,
        learning: &Learning,
        state: EstimateScalars,
    ) -> Result<Self, MemoryError> {
        let values = match how {
            None => Values::None,
            Some(PixelEstimator::Denoised) => {
                let pixels = size[0] as usize * size[1] as usize;
                Values::Denoised(Work {
                    e: [c.take_unset(pixels)?, c.take_unset(pixels)?, c.take_unset(pixels)?],
                    variance: c.take_unset(pixels)?,
                    reach: c.take_unset(pixels)?,
                    window: c.take_unset(window_len(size))?,
                })
            }
            Some(PixelEstimator::Blocks) => {
                let tiles = BlockGrid::tiles(size).count();
                Values::Blocks([c.take_unset(tiles)?, c.take_unset(tiles)?, c.take_unset(tiles)?])
            }
        };
        Ok(Self { size, relative: learning.objective == Objective::Relative, values, state })
    }

    /// Are there estimates?
    pub(super) fn known(&self) -> bool {
        self.state.known != 0
    }

    pub(super) fn scalars(&self) -> EstimateScalars {
        self.state
    }

    /// Forgets all estimates.
    pub(super) fn clear(&mut self) {
        self.state = EstimateScalars::default();
    }

    /// Estimate of a pixel, 0 while unknown.
    #[inline]
    pub(super) fn value(&self, film: u32) -> [f32; 3] {
        if !self.known() {
            return [0.0; 3];
        }
        let (planes, i) = match &self.values {
            Values::None => return [0.0; 3],
            Values::Denoised(work) => (work.e.each_ref(), film as usize),
            Values::Blocks(planes) => (planes.each_ref(), BlockGrid::tiles(self.size).of_pixel(film) as usize),
        };
        planes.map(|p| p.get(i).copied().unwrap_or(0.0))
    }

    /// Weight of a squared error of a pixel in the error of the picture, per channel.
    #[inline]
    pub(super) fn error_weight(&self, film: u32) -> [f32; 3] {
        if !self.known() || !self.relative {
            return [1.0; 3];
        }
        self.value(film).map(|x| 1.0 / (x * x + REL_MSE_EPSILON as f32))
    }

    /// Estimates as rgb planes, if there is one per pixel.
    pub(super) fn planes(&self) -> Option<[&[f32]; 3]> {
        match &self.values {
            Values::Denoised(work) if self.known() => Some(work.e.each_ref().map(|p| &**p)),
            _ => None,
        }
    }

    /// Replaces the built-in estimates by the host's from now on; `false` if there is not one per pixel.
    pub(super) fn give(&mut self, rgb: &[[f32; 3]]) -> bool {
        let Values::Denoised(work) = &mut self.values else { return false };
        if work.e.iter().any(|p| p.len() != rgb.len()) {
            return false;
        }
        for (c, plane) in work.e.iter_mut().enumerate() {
            for (to, from) in plane.iter_mut().zip(rgb) {
                *to = if from[c].is_finite() { from[c] } else { 0.0 };
            }
        }
        self.state = EstimateScalars { known: 1, given: 1, ..EstimateScalars::default() };
        true
    }

    /// Begins to estimate the pixels anew, unless the host has given estimates.
    pub(super) fn begin_refresh(&mut self) {
        if self.state.given == 0 {
            self.clear();
        }
    }

    /// See [`Progress::rows_to_load`].
    pub(super) fn rows_to_load(&self) -> u32 {
        match &self.values {
            Values::Denoised(_) if self.state.given == 0 => self.state.progress.rows_to_load(),
            _ => 0,
        }
    }

    /// Estimates the pixels anew from the film, a row of one pass; `true` after the last.
    pub(super) fn refresh_row(&mut self, film: &Film<'_>) -> bool {
        if self.state.given != 0 {
            return true;
        }
        let done = match &mut self.values {
            Values::None => return true,
            Values::Denoised(work) => self.state.progress.row(self.size, &NoisyFilm::new(film), work),
            Values::Blocks(planes) => {
                let (y, [columns, rows]) = (self.state.row, self.size);
                if y == 0 {
                    planes.iter_mut().for_each(|p| p.fill(0.0));
                }
                let tiles = BlockGrid::tiles(self.size);
                for x in 0..if y < rows { columns } else { 0 } {
                    let i = film_index(self.size, [x, y]);
                    let tile = tiles.of_pixel(i as u32);
                    let area = f64::from(tiles.area(tile));
                    for (plane, mean) in planes.iter_mut().zip(film.pixel(i).mean()) {
                        if let Some(sum) = plane.get_mut(tile as usize) {
                            *sum += (mean / area) as f32;
                        }
                    }
                }
                self.state.row = y.saturating_add(1);
                self.state.row >= rows
            }
        };
        self.state.known = u32::from(done);
        done
    }
}

/// A film as the denoiser reads it: pixels without samples count as absent.
struct NoisyFilm<'a, 'm> {
    film: &'a Film<'m>,
    /// Planes of albedo and normal, if the film has them.
    features: [[Option<&'a [f32]>; 3]; 2],
}

impl<'a, 'm> NoisyFilm<'a, 'm> {
    fn new(film: &'a Film<'m>) -> Self {
        let planes = |aov| [0, 1, 2].map(|c| film.plane(aov, c));
        Self { film, features: [planes(Aov::Albedo), planes(Aov::Normal)] }
    }
}

impl NoisySource for NoisyFilm<'_, '_> {
    fn color(&self, at: usize) -> ([F32x8; 3], [F32x8; 3]) {
        let (mut color, mut variance) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        for i in 0..8 {
            let p = self.film.pixel(at + i);
            let (m, v) = (p.mean(), p.variance_of_mean());
            for c in 0..3 {
                color[c][i] = if p.samples > 0 { m[c] as f32 } else { f32::NAN };
                variance[c][i] = v[c] as f32;
            }
        }
        (color.map(F32x8::new), variance.map(F32x8::new))
    }

    // once: it is called in several passes, which small modules cannot afford
    #[inline(never)]
    fn features(&self, at: usize) -> ([F32x8; 3], [F32x8; 3]) {
        let load = |plane: Option<&[f32]>, unknown: f32| match plane {
            Some(plane) => match plane.get(at..).and_then(|p| p.first_chunk()) {
                Some(a) => F32x8::new(*a),
                None => F32x8::from_fn(|i| plane.get(at + i).copied().unwrap_or(unknown)),
            },
            None => F32x8::splat(unknown),
        };
        let [albedo, normal] = self.features;
        (albedo.map(|plane| load(plane, 1.0)), normal.map(|plane| load(plane, 0.0)))
    }
}
