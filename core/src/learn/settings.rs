//! What the caller chooses about learning.

use super::cache::CacheSize;
use super::estimate::PixelEstimator;
use crate::rrs::{Learned8, MAX_FACTOR, MIN_FACTOR, Norm, Space};
use core::fmt;
use croupier_simd::Vec3x8;

/// Which error is to be small.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Objective {
    /// Squared error over the squared pixel (plus 0.01): relMSE, eq. 28 of EARS.
    #[default]
    Relative = 1,
    /// Squared error.
    Absolute = 2,
}

impl Objective {
    pub(super) fn from_u32(x: u32) -> Option<Self> {
        [Self::Relative, Self::Absolute].into_iter().find(|o| *o as u32 == x)
    }
}

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Relative => "relative",
            Self::Absolute => "absolute",
        })
    }
}

/// The known value that stands in for what roulette skips (Szecsi et al. 2003).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ControlVariate {
    /// 0: plain roulette.
    #[default]
    Off,
    /// The cached mean of reflected radiance, shrunk towards 0 where few samples stand behind it. Needs a strategy that
    /// learns from the scene.
    Cached,
    /// This radiance in all channels.
    Number(f32),
}

/// Samples at which the cached mean counts half.
const CONSTANT_TRUST: f32 = 64.0;

impl ControlVariate {
    /// The value per lane; `None` if it is 0 everywhere.
    pub(crate) fn of(self, learned: &Learned8) -> Option<Vec3x8> {
        match self {
            Self::Off => None,
            Self::Cached => Some(learned.local.mean * learned.local.trust(CONSTANT_TRUST)),
            Self::Number(x) => Some(Vec3x8::splat(x, x, x)),
        }
    }
}

/// Choices of the strategies that learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learning {
    /// Bytes of all statistics of the scene: the session's and those of every shard.
    pub cache_bytes: usize,
    /// Samples in flight per shard that can be learned from.
    pub ledger: u32,
    /// Camera samples of a pixel that are learned from in every iteration, the first ones. More make statistics better
    /// and iterations slower.
    pub samples: u32,
    /// Samples in a leaf of the octree at which it is divided (EARS: 40,000).
    pub subdivide_count: f32,
    /// Part of the statistics that an iteration hands on to the next, in [0, 1].
    pub decay: f32,
    /// How the estimate of the pixels is made.
    pub estimate: PixelEstimator,
    /// Which error is to be small.
    pub objective: Objective,
    /// How the errors of the channels become one.
    pub norm: Norm,
    /// Smallest and largest learned factor, within [`MIN_FACTOR`] and [`MAX_FACTOR`].
    pub factors: [f32; 2],
}

impl Default for Learning {
    fn default() -> Self {
        Self {
            cache_bytes: 24 << 20,
            ledger: 2048,
            samples: 8,
            subdivide_count: 10_000.0,
            decay: 0.75,
            estimate: PixelEstimator::Denoised,
            objective: Objective::Relative,
            norm: Norm::Mean,
            factors: [MIN_FACTOR, MAX_FACTOR],
        }
    }
}

/// What a render learns, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// The film holds albedos and normals, which the denoiser looks at.
    pub features: bool,
    /// Over what local statistics are kept, if at all.
    pub space: Option<Space>,
    /// Room for local statistics, if there are any.
    pub cache: Option<CacheSize>,
    /// How the pixels are estimated, if anything needs that.
    pub pixels: Option<PixelEstimator>,
    /// Pixels get samples by their error.
    pub adaptive: bool,
    /// The caller's choices.
    pub learning: Learning,
}
