//! What a render gives: sums of the pixels, and a record of every iteration.

use super::calibrate::Calibration;
use super::schedule::Work;
use croupier::film::{PixelAov, PixelStats};
use croupier::learn::PictureStatistics;
use croupier::{Counters, ErrorEstimate};

/// One finished iteration.
#[derive(Clone, Copy, Debug)]
pub struct IterationRecord {
    /// Camera samples per pixel, rays, and seconds with all phases.
    pub work: Work,
    /// What happened in it.
    pub counters: Counters,
    /// Seconds of tracing.
    pub tracing: f64,
    /// Seconds of merging the shards' pixels and measuring the picture's variance.
    pub merging: f64,
    /// Seconds of estimating the pixels (denoising).
    pub estimating: f64,
    /// Seconds of merging the scene's statistics and rebuilding their tree.
    pub learning: f64,
    /// Error and cost of a camera sample; `None` unless something learns from the picture.
    pub picture: Option<PictureStatistics>,
    /// Leaves of the cache after it, and splits for which there was no room until then.
    pub cache: Option<CacheRecord>,
    /// Estimated error of the picture after it.
    pub error: ErrorEstimate,
}

/// The cache's size after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheRecord {
    /// Leaves in use.
    pub leaves: u32,
    /// Splits for which there was no room, in all iterations so far. A leaf that remains too large counts again in
    /// each.
    pub subdivisions_refused: u64,
}

/// A finished render.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Sums per pixel, row by row.
    pub pixels: Vec<PixelStats>,
    /// Auxiliary sums; empty if not asked for.
    pub aovs: Vec<PixelAov>,
    /// What happened.
    pub counters: Counters,
    /// Estimated error.
    pub error: ErrorEstimate,
    /// Camera samples per pixel of the finished iterations.
    pub spp: u32,
    /// Wall time of rendering alone.
    pub seconds: f64,
    /// Name of the kernel profile.
    pub profile: &'static str,
    /// Bytes of the shared block and of all shards.
    pub memory: [usize; 2],
    /// The observer asked to stop before the target.
    pub stopped_early: bool,
    /// Threads that traced.
    pub threads: usize,
    /// Every iteration, the one that was stopped too.
    pub iterations: Vec<IterationRecord>,
    /// The saved cache, if asked for.
    pub cache: Option<Vec<u8>>,
    /// What look-ups take, if asked for and anything is looked up.
    pub calibration: Option<Calibration>,
}

impl Rendered {
    /// Mean radiance, row by row, rgb.
    pub fn image(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|p| p.mean().map(|x| x as f32)).collect()
    }

    /// Standard error of the mean.
    pub fn stderr(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|p| p.variance_of_mean().map(|v| v.sqrt() as f32)).collect()
    }

    /// Rays per second, in millions.
    pub fn mrays_per_s(&self) -> f64 {
        self.counters.rays() as f64 / self.seconds.max(1e-9) * 1e-6
    }

    /// Order-sensitive hash of the picture's bits: equal for any number of threads and any instruction set.
    pub fn hash(&self) -> u64 {
        let image = self.image();
        croupier::scene::blob::content_hash(bytemuck::cast_slice(&image))
    }
}
