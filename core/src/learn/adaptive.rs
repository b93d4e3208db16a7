//! Adaptive sampling: how many camera samples the pixels of each tile get in an iteration.
//!
//! A pixel's error falls as variance over samples; the sum over the picture is least for a given work when the samples
//! are as the square root of variance over cost. Numbers are the same for a tile of 8x8 pixels, because a pixel's own
//! variance is mostly noise. Every pixel has one sample at least, and an iteration counts as much in all of them: were
//! samples pooled, a pixel that happened to look dark and smooth would keep its error for ever.

use super::estimate::Pixels;
use crate::film::{Film, SqrtNewton};
use crate::memory::{Carver, Measure, MemoryError};
use crate::tiles::{BlockGrid, film_index};

/// Least and greatest share of a pixel in the samples beyond its first, relative to what the mean pixel wishes.
const SHARES: [f64; 2] = [0.25, 8.0];

/// Camera samples per pixel, by tile.
#[derive(Debug)]
pub(super) struct SampleAllocation<'m> {
    size: [u32; 2],
    /// Empty if all pixels have as many.
    counts: &'m mut [u32],
    /// Mean over the pixels that was asked for.
    samples: u32,
}

impl<'m> SampleAllocation<'m> {
    pub(super) fn measure(m: Measure, size: [u32; 2], adaptive: bool) -> Measure {
        m.add::<u32>(if adaptive { BlockGrid::tiles(size).count() } else { 0 })
    }

    pub(super) fn carve(c: &mut Carver<'m>, size: [u32; 2], adaptive: bool) -> Result<Self, MemoryError> {
        Ok(Self { size, counts: c.take(if adaptive { BlockGrid::tiles(size).count() } else { 0 })?, samples: 1 })
    }

    /// Samples of each pixel of a tile.
    pub(super) fn of_tile(&self, tile: u32) -> u32 {
        self.counts.get(tile as usize).copied().unwrap_or(self.samples)
    }

    /// Samples of a pixel over the mean.
    #[inline]
    pub(super) fn share(&self, film: u32) -> f64 {
        if self.counts.is_empty() {
            return 1.0;
        }
        let n = self.of_tile(BlockGrid::tiles(self.size).of_pixel(film));
        if n > 0 { f64::from(n) / f64::from(self.samples.max(1)) } else { 1.0 }
    }

    /// Deals out `samples` camera samples per pixel in the mean: one to each, the others by the desired density of their tiles, with what
    /// rounding leaves over handed from tile to tile.
    pub(super) fn allocate(&mut self, samples: u32, film: &Film<'_>, pixels: &Pixels<'_>) {
        self.samples = samples;
        self.counts.fill(samples);
        if self.counts.is_empty() || !pixels.known() || samples < 2 {
            return;
        }
        // wishes wait where the counts will be
        let (mut wished, mut area) = (0.0, 0.0);
        for tile in 0..self.counts.len() {
            let desired_density = self.desired_density(tile as u32, film, pixels) as f32;
            let n = self.area(tile as u32);
            wished += f64::from(desired_density) * n;
            area += n;
            if let Some(count) = self.counts.get_mut(tile) {
                *count = desired_density.to_bits();
            }
        }
        let mean = wished / area;
        if !(mean > 0.0 && mean.is_finite()) {
            return self.counts.fill(samples);
        }
        let [least, most] = SHARES;
        let share = |bits: u32| (f64::from(f32::from_bits(bits)) / mean).clamp(least, most);
        let dealt: f64 = (0..).zip(&*self.counts).map(|(tile, &bits)| share(bits) * self.area(tile)).sum();
        let scale = f64::from(samples - 1) * area / dealt;
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

    /// Pixels of a tile.
    fn area(&self, tile: u32) -> f64 {
        f64::from(BlockGrid::tiles(self.size).area(tile))
    }

    /// sqrt(variance / cost) of a tile's samples. Pixels count their rays, of whatever kind, so the cost is their
    /// number.
    fn desired_density(&self, tile: u32, film: &Film<'_>, pixels: &Pixels<'_>) -> f64 {
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
