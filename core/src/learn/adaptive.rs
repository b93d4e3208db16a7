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

/// Least and greatest density of the samples beyond a pixel's first, relative to the mean desired density.
const SHARES: [f64; 2] = [0.25, 8.0];

/// Camera samples per pixel of an iteration, by tile.
#[derive(Debug)]
pub(super) struct SampleAllocation<'m> {
    size: [u32; 2],
    /// Samples of each pixel of a tile; empty if all pixels have the same number.
    counts: &'m mut [u32],
    /// Mean over the pixels, as the host asked for it.
    samples: u32,
}

impl<'m> SampleAllocation<'m> {
    pub(super) fn measure(m: Measure, size: [u32; 2], adaptive: bool) -> Measure {
        m.add::<u32>(if adaptive { BlockGrid::tiles(size).count() } else { 0 })
    }

    pub(super) fn carve(c: &mut Carver<'m>, size: [u32; 2], adaptive: bool, samples: u32) -> Result<Self, MemoryError> {
        Ok(Self { size, counts: c.take_unset(if adaptive { BlockGrid::tiles(size).count() } else { 0 })?, samples })
    }

    /// Mean samples per pixel, as the host asked for them.
    pub(super) fn samples(&self) -> u32 {
        self.samples
    }

    /// Samples of each pixel of a tile.
    pub(super) fn of_tile(&self, tile: u32) -> u32 {
        self.counts.get(tile as usize).copied().unwrap_or(self.samples)
    }

    /// Samples of a pixel over the mean pixel's.
    #[inline]
    pub(super) fn share(&self, film: u32) -> f64 {
        if self.counts.is_empty() {
            return 1.0;
        }
        let n = self.of_tile(BlockGrid::tiles(self.size).of_pixel(film));
        if n > 0 { f64::from(n) / f64::from(self.samples.max(1)) } else { 1.0 }
    }

    /// Allocates `samples` camera samples per pixel in the mean: one to each, the others by the desired density of
    /// their tile. What rounding leaves over goes to the next tile (error diffusion).
    pub(super) fn allocate(&mut self, samples: u32, film: &Film<'_>, pixels: &PixelEstimates<'_>) {
        self.samples = samples;
        self.counts.fill(samples);
        if self.counts.is_empty() || !pixels.known() || samples < 2 {
            return;
        }
        // densities are stored where the counts will be
        let (mut desired, mut area) = (0.0, 0.0);
        for tile in 0..self.counts.len() {
            let desired_density = self.desired_density(tile as u32, film, pixels) as f32;
            let n = self.area(tile as u32);
            desired += f64::from(desired_density) * n;
            area += n;
            if let Some(count) = self.counts.get_mut(tile) {
                *count = desired_density.to_bits();
            }
        }
        let mean = desired / area;
        if !(mean > 0.0 && mean.is_finite()) {
            return self.counts.fill(samples);
        }
        let [least, most] = SHARES;
        let share = |bits: u32| (f64::from(f32::from_bits(bits)) / mean).clamp(least, most);
        let allocated: f64 = (0..).zip(&*self.counts).map(|(tile, &bits)| share(bits) * self.area(tile)).sum();
        let scale = f64::from(samples - 1) * area / allocated;
        let mut left = 0.0;
        for tile in 0..self.counts.len() {
            let n = self.area(tile as u32);
            let Some(count) = self.counts.get_mut(tile) else { continue };
            left += share(*count) * scale * n;
            let more = (left / n + 0.5) as u32;
            left -= f64::from(more) * n;
            *count = 1 + more;
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
                let Some(p) = film.pixels().get(i) else { continue };
                let e =
                    p.variance_of_mean().into_iter().zip(pixels.error_weight(i as u32)).map(|(v, w)| v * f64::from(w));
                error += e.sum::<f64>() * p.samples as f64;
                rays += p.rays as f64 / p.samples.max(1) as f64;
            }
        }
        (error / f64::max(rays, 1.0)).sqrt_newton()
    }
}
