//! Sums of every pixel in f64, so that the mean stays exact after 1e9 samples or a firefly (NUMERICS FLM-1), and the
//! estimate of the picture's error.
//!
//! | file | holds |
//! |---|---|
//! | `pixel` | sums of one pixel |
//! | `error` | relMSE of a pixel, [`ErrorEstimate`] |
//! | `independence` | correlation of an iteration's samples, measured |
//! | `trimmed` | sums without the largest values |
//! | `sqrt` | square root in f64 |

mod error;
mod independence;
mod pixel;
mod sqrt;
mod trimmed;

pub use error::{ErrorEstimate, REL_MSE_EPSILON};
pub(crate) use pixel::PixelSums;
pub use pixel::{PixelAov, PixelStats};
pub(crate) use sqrt::SqrtNewton;
pub(crate) use trimmed::trimmed;

use bytemuck::{Pod, Zeroable};
use error::relative_error;
use independence::{Differences, Independence};

/// Picture: sums of all pixels, row 0 at the top.
#[derive(Debug)]
pub struct Film<'m> {
    size: [u32; 2],
    pixels: &'m mut [PixelStats],
    aovs: &'m mut [PixelAov],
    scalars: FilmScalars,
}

/// All of a film but its pixels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FilmScalars {
    differences: Differences,
    independence: Independence,
}

impl FilmScalars {
    /// Those of a film without samples.
    pub(crate) fn new() -> Self {
        Self { differences: Differences::default(), independence: Independence::UNKNOWN }
    }
}

impl<'m> Film<'m> {
    pub(crate) fn new(
        size: [u32; 2],
        pixels: &'m mut [PixelStats],
        aovs: &'m mut [PixelAov],
        scalars: FilmScalars,
    ) -> Self {
        Self { size, pixels, aovs, scalars }
    }

    pub(crate) fn scalars(&self) -> FilmScalars {
        self.scalars
    }

    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        self.pixels.fill(PixelStats::default());
        self.aovs.fill(PixelAov::default());
        self.scalars = FilmScalars::new();
    }

    /// Columns and rows of the picture.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Sums of the pixels, row by row.
    pub fn pixels(&self) -> &[PixelStats] {
        self.pixels
    }

    /// Auxiliary sums of the pixels, row by row; empty if the settings do not ask for them.
    pub fn aovs(&self) -> &[PixelAov] {
        self.aovs
    }

    /// Adds the sums of an iteration to a pixel, each sample with weight `w`.
    pub(crate) fn merge(&mut self, pixel: usize, sums: &PixelSums, aov: Option<&PixelAov>, w: f64) {
        if let Some(p) = self.pixels.get_mut(pixel) {
            self.scalars.differences.add(p, sums, w);
            p.merge(sums, w);
        }
        if let (Some(a), Some(b)) = (self.aovs.get_mut(pixel), aov) {
            a.merge(b);
        }
    }

    /// Ends the merge of an iteration: all its pixels were added.
    pub(crate) fn end_iteration(&mut self) {
        let s = &mut self.scalars;
        s.independence = s.independence.after(&core::mem::take(&mut s.differences));
    }

    /// Estimated error of the picture. The interval is the normal one over the pixels' contributions, which are
    /// independent; it is wide while few samples cause most of the error.
    pub fn error_estimate(&self) -> ErrorEstimate {
        let n = self.pixels.len();
        if n == 0 {
            return ErrorEstimate::default();
        }
        let t = trimmed(n / 10_000, |show| self.pixels.iter().for_each(|p| show(relative_error(p))));
        let m = t.count.max(1) as f64;
        let mean = t.sum / m;
        let Independence { ratio, noise } = self.scalars.independence;
        let spread = (t.sum_sqr / m - mean * mean).max(0.0) / m;
        let spread = (ratio * ratio * spread + noise * noise * mean * mean).sqrt_newton();
        ErrorEstimate {
            rel_mse: ratio * mean,
            low: (ratio * mean - 1.96 * spread).max(0.0),
            high: ratio * mean + 1.96 * spread,
            rel_mse_all: ratio * (t.sum + t.rest) / n as f64,
            independence: ratio,
        }
    }
}
