//! Adaptive sampling: allocation of an iteration's camera samples to the pixels of each tile.
//!
//! A pixel's squared error falls as variance over samples. For a given total cost, the sum over the picture is least
//! when the density of samples is proportional to sqrt(variance / cost). All pixels of a tile get the same number,
//! because a pixel's own variance is mostly noise. Every pixel gets one sample at least, and an iteration has the same
//! weight in all of them: if samples were pooled, a pixel that happened to look dark and smooth would keep its error.

use super::estimate::PixelEstimates;
use crate::film::{Film, SqrtNewton};
use crate::memory::{Carver, Measure, MemoryError};
use crate::tiles::{BlockGrid, film_index};
use bytemuck::{Pod, Zeroable};

/// Least and greatest density of the samples beyond a pixel's first, relative to the mean desired density.
const SHARES: [f64; 2] = [0.25, 8.0];

/// Camera samples per pixel of an iteration, by tile.
#[derive(Debug)]
pub(super) struct SampleAllocation<'m> {
    size: [u32; 2],
    /// Samples of each pixel of a tile; empty without adaptive sampling.
    counts: &'m mut [u32],
    /// Desired density of each tile's samples, as of the end of the last iteration.
    densities: &'m mut [f32],
    state: AllocationScalars,
}

/// All of a sample allocation but its tables.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct AllocationScalars {
    /// Sum of the desired densities over the pixels of the tiles below `tile`.
    desired: f64,
    /// Sum of the clamped shares over the pixels of the tiles below `tile`, in the second round.
    allocated: f64,
    /// Mean samples over the pixels, as the host asked for them.
    samples: u32,
    /// Next tile whose density is computed.
    tile: u32,
    /// 0: in the first round; 1: in the second; 2: densities can be used.
    round: u32,
    /// Not 0: all pixels have the same number of samples.
    uniform: u32,
}

/// Value of [`AllocationScalars::round`] from which on densities can be used.
const READY: u32 = 2;

impl AllocationScalars {
    /// Those of the same number of samples everywhere.
    pub(super) fn new() -> Self {
        Self { desired: 0.0, allocated: 0.0, samples: 1, tile: 0, round: 0, uniform: 1 }
    }
}

impl<'m> SampleAllocation<'m> {
    fn tiles(size: [u32; 2], adaptive: bool) -> usize {
        if adaptive { BlockGrid::tiles(size).count() } else { 0 }
    }

    pub(super) fn measure(m: Measure, size: [u32; 2], adaptive: bool) -> Measure {
        m.add::<u32>(Self::tiles(size, adaptive)).add::<f32>(Self::tiles(size, adaptive))
    }

    /// Carves without touching the memory.
    pub(super) fn carve(
        c: &mut Carver<'m>,
        size: [u32; 2],
        adaptive: bool,
        state: AllocationScalars,
    ) -> Result<Self, MemoryError> {
        let tiles = Self::tiles(size, adaptive);
        Ok(Self { size, counts: c.take_unset(tiles)?, densities: c.take_unset(tiles)?, state })
    }

    pub(super) fn scalars(&self) -> AllocationScalars {
        self.state
    }

    /// Forgets the densities.
    pub(super) fn begin_densities(&mut self) {
        self.state = AllocationScalars { desired: 0.0, allocated: 0.0, tile: 0, round: 0, ..self.state };
    }

    /// Samples of each pixel of a tile.
    pub(super) fn of_tile(&self, tile: u32) -> u32 {
        match self.counts.get(tile as usize) {
            Some(n) if self.state.uniform == 0 => *n,
            _ => self.state.samples,
        }
    }

    /// Samples of a pixel over the mean pixel's.
    #[inline]
    pub(super) fn share(&self, film: u32) -> f64 {
        if self.counts.is_empty() || self.state.uniform != 0 {
            return 1.0;
        }
        let n = self.of_tile(BlockGrid::tiles(self.size).of_pixel(film));
        if n > 0 { f64::from(n) / f64::from(self.state.samples.max(1)) } else { 1.0 }
    }

    /// Density of a tile, clamped, relative to the mean.
    fn clamped(&self, tile: u32, mean: f64) -> f64 {
        let [least, most] = SHARES;
        (f64::from(self.densities.get(tile as usize).copied().unwrap_or(0.0)) / mean).clamp(least, most)
    }

    /// Mean density over the pixels.
    fn mean(&self) -> f64 {
        self.state.desired / (f64::from(self.size[0]) * f64::from(self.size[1]))
    }

    /// Computes what the next iteration's allocation needs of one tile; `true` after the last.
    pub(super) fn density_of_next(&mut self, film: &Film<'_>, pixels: &PixelEstimates<'_>) -> bool {
        let (tile, mean) = (self.state.tile, self.mean());
        if tile as usize >= self.densities.len() || self.state.round >= READY {
            return true;
        }
        let n = self.area(tile);
        if self.state.round == 0 {
            let density = self.desired_density(tile, film, pixels) as f32;
            self.state.desired += f64::from(density) * n;
            if let Some(d) = self.densities.get_mut(tile as usize) {
                *d = density;
            }
        } else {
            self.state.allocated += self.clamped(tile, mean) * n;
        }
        self.state.tile = tile + 1;
        if self.state.tile as usize >= self.densities.len() {
            (self.state.tile, self.state.round) = (0, self.state.round + 1);
        }
        self.state.round >= READY
    }

    /// Allocates `samples` camera samples per pixel in the mean: one to each, the others by the desired density of
    /// their tile. What rounding leaves over goes to the next tile (error diffusion).
    pub(super) fn allocate(&mut self, samples: u32) {
        (self.state.samples, self.state.uniform) = (samples, 1);
        let mean = self.mean();
        let usable = mean > 0.0 && mean.is_finite() && self.state.round >= READY;
        if self.counts.is_empty() || !usable || samples < 2 {
            return;
        }
        self.state.uniform = 0;
        let area = f64::from(self.size[0]) * f64::from(self.size[1]);
        let scale = f64::from(samples - 1) * area / self.state.allocated;
        let mut left = 0.0;
        for tile in 0..self.counts.len() {
            let n = self.area(tile as u32);
            left += self.clamped(tile as u32, mean) * scale * n;
            let more = (left / n + 0.5) as u32;
            left -= f64::from(more) * n;
            if let Some(count) = self.counts.get_mut(tile) {
                *count = more.saturating_add(1);
            }
        }
    }

    /// Number of pixels in a tile.
    fn area(&self, tile: u32) -> f64 {
        f64::from(BlockGrid::tiles(self.size).area(tile))
    }

    /// Desired density of a tile's samples: sqrt(variance / cost). The cost is the number of rays of all kinds, which
    /// is what pixels count.
    fn desired_density(&self, tile: u32, film: &Film<'_>, pixels: &PixelEstimates<'_>) -> f64 {
        let [from, to] = BlockGrid::tiles(self.size).corners(tile);
        let (mut error, mut rays) = (0.0, 0.0);
        for y in from[1]..to[1] {
            for x in from[0]..to[0] {
                let i = film_index(self.size, [x, y]);
                let p = film.pixel(i);
                let e =
                    p.variance_of_mean().into_iter().zip(pixels.error_weight(i as u32)).map(|(v, w)| v * f64::from(w));
                error += e.sum::<f64>() * p.samples as f64;
                rays += p.rays as f64 / p.samples.max(1) as f64;
            }
        }
        (error / f64::max(rays, 1.0)).sqrt_newton()
    }
}
