//! Estimates of the pixels' radiance, by which errors are weighted: a relative error needs the value that it is
//! relative to.

use super::settings::{Learning, Objective, PixelEstimator};
use crate::denoise::{self, Planes};
use crate::film::{Film, REL_MSE_EPSILON};
use crate::memory::{Carver, Measure, MemoryError};
use crate::tiles::BlockGrid;
use bytemuck::{Pod, Zeroable};

/// Storage of the estimates.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per session, and no allocator to box it")]
enum Values<'m> {
    None,
    Denoised { planes: Planes<'m>, scratch: &'m mut [f32] },
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
}

impl<'m> PixelEstimates<'m> {
    pub(super) fn measure(m: Measure, size: [u32; 2], features: bool, how: Option<PixelEstimator>) -> Measure {
        match how {
            None => m,
            Some(PixelEstimator::Denoised) => {
                m.add::<f32>(Planes::len(size, features)).add::<f32>(denoise::scratch_len(size))
            }
            Some(PixelEstimator::Blocks) => (0..3).fold(m, |m, _| m.add::<f32>(BlockGrid::tiles(size).count())),
        }
    }

    pub(super) fn carve(
        c: &mut Carver<'m>,
        size: [u32; 2],
        features: bool,
        how: Option<PixelEstimator>,
        learning: &Learning,
        state: EstimateScalars,
    ) -> Result<Self, MemoryError> {
        let values = match how {
            None => Values::None,
            Some(PixelEstimator::Denoised) => {
                let memory = c.take_unset(Planes::len(size, features))?;
                let given = memory.len();
                let planes = Planes::carve(size, features, memory)
                    .map_err(|e| MemoryError::TooSmall { needed: e.needed, given })?;
                Values::Denoised { planes, scratch: c.take_unset(denoise::scratch_len(size))? }
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
            Values::Denoised { planes, .. } => (planes.out.each_ref(), film as usize),
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

    /// Plane with room for one value per pixel, on loan until [`Self::take_back`]; empty if there is none.
    pub(super) fn lend(&mut self) -> &'m mut [f32] {
        match &mut self.values {
            Values::Denoised { planes, .. } => core::mem::take(&mut planes.color[0]),
            Values::None | Values::Blocks(_) => &mut [],
        }
    }

    /// Returns the plane that [`Self::lend`] gave.
    pub(super) fn take_back(&mut self, plane: &'m mut [f32]) {
        if let Values::Denoised { planes, .. } = &mut self.values {
            planes.color[0] = plane;
        }
    }

    /// Estimates as rgb planes, if there is one per pixel.
    pub(super) fn planes(&self) -> Option<[&[f32]; 3]> {
        match &self.values {
            Values::Denoised { planes, .. } if self.known() => Some(planes.out.each_ref().map(|p| &**p)),
            _ => None,
        }
    }

    /// Replaces the built-in estimates by the host's from now on; `false` if there is not one per pixel.
    pub(super) fn give(&mut self, rgb: &[[f32; 3]]) -> bool {
        let Values::Denoised { planes, .. } = &mut self.values else { return false };
        if planes.out.iter().any(|p| p.len() != rgb.len()) {
            return false;
        }
        for (c, plane) in planes.out.iter_mut().enumerate() {
            for (to, from) in plane.iter_mut().zip(rgb) {
                *to = if from[c].is_finite() { from[c] } else { 0.0 };
            }
        }
        self.state = EstimateScalars { known: 1, given: 1 };
        true
    }

    /// Estimates the pixels anew from the film, unless the host has given estimates.
    pub(super) fn refresh(&mut self, film: &Film<'_>) {
        if self.state.given != 0 {
            return;
        }
        match &mut self.values {
            Values::None => return,
            Values::Denoised { planes, scratch } => {
                for (i, p) in film.pixels().iter().enumerate() {
                    planes.set(i, p, film.aovs().get(i));
                }
                // sizes are those of the plan, so this cannot fail; if it did, the last values would serve on
                let _ = planes.denoise(scratch);
            }
            Values::Blocks(planes) => {
                let tiles = BlockGrid::tiles(self.size);
                planes.iter_mut().for_each(|p| p.fill(0.0));
                for (i, p) in film.pixels().iter().enumerate() {
                    let tile = tiles.of_pixel(i as u32);
                    let area = f64::from(tiles.area(tile));
                    for (plane, mean) in planes.iter_mut().zip(p.mean()) {
                        if let Some(sum) = plane.get_mut(tile as usize) {
                            *sum += (mean / area) as f32;
                        }
                    }
                }
            }
        }
        self.state.known = 1;
    }
}
