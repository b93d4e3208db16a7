//! Adaptive sampling: how many camera samples the pixels of each tile get in an iteration.
//!
//! A pixel's error falls as variance over samples; the sum over the picture is least for a given work when the samples are
//! as the square root of variance over cost. Numbers are the same for a tile of 8x8 pixels, because a pixel's own variance is
//! mostly noise. Every pixel has one sample at least, and the weight of an iteration is that of the whole picture: were
//! samples pooled, a pixel that happened to look dark and smooth would keep its error for ever.

use super::estimate::{Pixels, tile_of, tiles};
use crate::film::{Film, SqrtNewton};
use crate::memory::{Carver, Measure, MemoryError};
use crate::tiles::TILE;

/// Fewest and most samples of a pixel over the mean.
const SHARES: [f64; 2] = [0.25, 8.0];

/// Camera samples per pixel, by tile.
#[derive(Debug)]
pub(super) struct Allotment<'m> {
    size: [u32; 2],
    /// Empty if all pixels have as many.
    counts: &'m mut [u32],
    /// Mean over the pixels that was asked for.
    samples: u32,
}

impl<'m> Allotment<'m> {
    pub(super) fn measure(m: Measure, size: [u32; 2], adaptive: bool) -> Measure {
        m.add::<u32>(if adaptive { tiles(size) } else { 0 })
    }

    pub(super) fn carve(c: &mut Carver<'m>, size: [u32; 2], adaptive: bool) -> Result<Self, MemoryError> {
        Ok(Self { size, counts: c.take(if adaptive { tiles(size) } else { 0 })?, samples: 1 })
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
        let n = self.of_tile(tile_of(self.size, film) as u32);
        if n > 0 { f64::from(n) / f64::from(self.samples.max(1)) } else { 1.0 }
    }

    /// Deals out `samples` camera samples per pixel in the mean.
    pub(super) fn deal(&mut self, samples: u32, film: &Film<'_>, pixels: &Pixels<'_>) {
        self.samples = samples;
        self.counts.fill(samples);
        if self.counts.is_empty() || !pixels.known() || samples == 0 {
            return;
        }
        let (mut sum, mut area) = (0.0, 0.0);
        for tile in 0..self.counts.len() {
            let (wish, n) = self.wish(tile as u32, film, pixels);
            sum += wish * n;
            area += n;
        }
        if sum <= 0.0 || !f64::is_finite(sum) {
            return;
        }
        for tile in 0..self.counts.len() {
            let share = self.wish(tile as u32, film, pixels).0 * area / sum;
            let [least, most] = SHARES;
            if let Some(n) = self.counts.get_mut(tile) {
                *n = ((share.clamp(least, most) * f64::from(samples) + 0.5) as u32).max(1);
            }
        }
    }

    /// sqrt(variance / cost) of a tile's samples, and its pixels.
    fn wish(&self, tile: u32, film: &Film<'_>, pixels: &Pixels<'_>) -> (f64, f64) {
        let [w, h] = self.size;
        let columns = w.div_ceil(TILE);
        let (x0, y0) = (tile % columns * TILE, tile / columns * TILE);
        let (mut error, mut rays, mut n) = (0.0, 0.0, 0.0);
        for y in y0..(y0 + TILE).min(h) {
            for x in x0..(x0 + TILE).min(w) {
                let i = y * w + x;
                let Some(p) = film.pixels().get(i as usize) else { continue };
                let e = p.variance_of_mean().into_iter().zip(pixels.importance(i)).map(|(v, w)| v * f64::from(w));
                error += e.sum::<f64>() * p.samples as f64;
                rays += p.rays as f64 / p.samples.max(1) as f64;
                n += 1.0;
            }
        }
        ((error / f64::max(rays, 1.0)).sqrt_newton(), n)
    }
}
