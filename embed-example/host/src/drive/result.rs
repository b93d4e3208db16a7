//! Results of a render: sums of the pixels, and a record of every iteration.

use super::calibrate::Calibration;
use super::guide_view::GuideView;
use croupier::unstable::film::{Aov, PixelAov, PixelStats, VarianceFactors};
use croupier::unstable::learn::PictureStatistics;
use croupier::unstable::learn::guiding::GuideUse;
use croupier::unstable::schedule::Work;
use croupier::{Counters, ErrorEstimate};

/// One finished iteration.
#[derive(Clone, Copy, Debug)]
pub struct IterationRecord {
    /// Camera samples per pixel, rays, and seconds with all phases.
    pub work: Work,
    /// Counters of the iteration.
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
    /// Size of the cache after the iteration, if there is one.
    pub cache: Option<CacheRecord>,
    /// Error estimate of the picture after the iteration.
    pub error: ErrorEstimate,
}

/// The cache's size after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheRecord {
    /// Leaves in use.
    pub leaves: u32,
    /// Subdivisions of leaves for which there was no room, in all iterations so far. A leaf that remains too large
    /// counts again in each.
    pub subdivisions_refused: u64,
}

/// What path guiding has learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideRecord {
    /// Leaves of the octrees.
    pub leaves: u32,
    /// Nodes of all leaves.
    pub nodes: u32,
    /// Mean share of guided samples where the guide is asked, over the contributions that were learned from.
    pub share: f64,
    /// Whether it pays, if that was left to the render.
    pub watched: Option<GuideUse>,
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
    /// Planes of the auxiliary values that were asked for: each with its channels, row by row.
    pub planes: Vec<(Aov, Vec<Vec<f32>>)>,
    /// Counters of the whole render.
    pub counters: Counters,
    /// Error estimate of the picture.
    pub error: ErrorEstimate,
    /// What the pixels' variances of independent samples are to be multiplied by.
    pub variance_factors: VarianceFactors,
    /// Number of the first camera sample of each pixel: not 0 in parts of a picture ([`Part`](super::Part)).
    pub first_sample: u32,
    /// Camera samples per pixel of the finished iterations.
    pub spp: u32,
    /// Wall time of rendering alone.
    pub seconds: f64,
    /// Name of the kernel profile.
    pub profile: &'static str,
    /// Bytes of the shared block and of all shards.
    pub memory: [usize; 2],
    /// Whether the observer ended the render before its target.
    pub stopped_early: bool,
    /// Error of the first checkpoint that could not be written; the render went on without further ones.
    pub checkpoint_error: Option<String>,
    /// Threads that traced.
    pub threads: usize,
    /// Records of all iterations, the one that was stopped included.
    pub iterations: Vec<IterationRecord>,
    /// What path guiding has learned, if it is on.
    pub guide: Option<GuideRecord>,
    /// The same as the camera sees it, if asked for.
    pub guide_view: Option<GuideView>,
    /// Saved cache, if asked for.
    pub cache: Option<Vec<u8>>,
    /// Seconds of a look-up and of recording a sample, if asked for and anything is looked up.
    pub calibration: Option<Calibration>,
}

impl Rendered {
    /// Mean radiance, row by row, rgb.
    pub fn image(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|p| p.mean().map(|x| x as f32)).collect()
    }

    /// Standard error of the mean radiance, row by row, rgb; right on average over the pixels of each class
    /// ([`VarianceFactors`]).
    pub fn stderr(&self) -> Vec<[f32; 3]> {
        let of_pixel = |p: &PixelStats| {
            let factor = self.variance_factors.of(p);
            p.variance_of_mean().map(|v| (factor * v).sqrt() as f32)
        };
        self.pixels.iter().map(of_pixel).collect()
    }

    /// Channels of an auxiliary value, if it was asked for.
    pub fn channels(&self, aov: Aov) -> Option<&[Vec<f32>]> {
        self.planes.iter().find(|p| p.0 == aov).map(|p| p.1.as_slice())
    }

    /// Rays per second, in millions.
    pub fn mrays_per_s(&self) -> f64 {
        self.counters.rays() as f64 / self.seconds.max(1e-9) * 1e-6
    }

    /// Order-sensitive hash of the picture's bits: equal for any number of threads and any instruction set.
    pub fn hash(&self) -> u64 {
        let image = self.image();
        croupier::unstable::scene::blob::content_hash(bytemuck::cast_slice(&image))
    }
}
