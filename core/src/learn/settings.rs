//! Settings of the strategies that learn.

use crate::names::names;
use crate::rrs::{Learned8, MAX_FACTOR, MIN_FACTOR, Norm};
use crate::setting::{SettingRange, SettingValue, Unreadable, Value, named_values, settings};
use core::fmt;
use croupier_simd::{F32x8, Vec3x8};

/// Error of the picture that learning makes small.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Objective {
    /// Squared error over the squared pixel (plus 0.01): relMSE, eq. 28 of EARS.
    #[default]
    Relative = 1,
    /// Squared error.
    Absolute = 2,
}

names!(Objective: Relative = "relative", Absolute = "absolute");

impl Objective {
    pub(super) fn from_u32(x: u32) -> Option<Self> {
        [Self::Relative, Self::Absolute].into_iter().find(|o| *o as u32 == x)
    }
}

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How the estimate of the pixels is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelEstimator {
    /// By the built-in denoiser, which looks at albedo and normals if [`crate::Settings::aovs`] has them gathered;
    /// takes about 140 bytes a pixel, scratch included.
    #[default]
    Denoised,
    /// Means over squares of 8x8 pixels: 12 bytes for 64 pixels.
    Blocks,
}

names!(PixelEstimator: Denoised = "denoised", Blocks = "blocks");

named_values!(Objective, PixelEstimator);

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
            Self::Cached => Some(learned.mean * (learned.count / (learned.count + F32x8::splat(CONSTANT_TRUST)))),
            Self::Number(x) => Some(Vec3x8::splat(x, x, x)),
        }
    }
}

impl Value for ControlVariate {
    const PLACEHOLDER: &'static str = "off|cached|X";
    const RANGE: SettingRange = SettingRange::WordsOrNumber(&["off", "cached"]);

    fn parse(text: &str) -> Result<Self, Unreadable> {
        match text {
            "off" => Ok(Self::Off),
            "cached" => Ok(Self::Cached),
            _ => f32::parse(text).map(Self::Number),
        }
    }

    fn value(self) -> SettingValue {
        match self {
            Self::Off => SettingValue::Word("off"),
            Self::Cached => SettingValue::Word("cached"),
            Self::Number(x) => SettingValue::Number(x),
        }
    }
}

settings! {
    /// Settings of the strategies that learn.
    pub struct Learning {
        cache_bytes: usize = 24 << 20 =>
            "cache-bytes", "Memory for statistics of the scene, the session's and those of all shards together";
        ledger: u32 = 2048 =>
            "ledger", "Samples in flight per shard that can be learned from, of 68 bytes each",
            SettingRange::Integers { min: 1, max: 1 << 24 };
        /// More make statistics better and iterations slower.
        samples: u32 = 8 =>
            "learn-samples", "Camera samples per pixel that are learned from in each iteration, the first ones",
            SettingRange::Integers { min: 1, max: u32::MAX as u64 };
        /// EARS: 40,000.
        subdivide_count: f32 = 10_000.0 =>
            "subdivide-count", "Samples in a leaf of the octree at which it is subdivided",
            SettingRange::Positive;
        decay: f32 = 0.75 =>
            "decay", "Part of the statistics that an iteration hands on to the next",
            SettingRange::Numbers { min: 0.0, max: 1.0 };
        estimate: PixelEstimator = PixelEstimator::Denoised =>
            "estimate",
            "What errors are judged by: the denoised picture (140 bytes a pixel) or means over 8x8 pixels (12 bytes for each)";
        objective: Objective = Objective::Relative =>
            "objective", "Error of the picture that is to be small: relative to the pixel, or absolute";
        norm: Norm = Norm::Mean =>
            "norm", "How the errors of the channels become one";
        factors: [f32; 2] = [MIN_FACTOR, MAX_FACTOR] =>
            "factors", "Smallest and largest learned factor",
            SettingRange::Pair { first: [MIN_FACTOR, 1.0], second: [1.0, MAX_FACTOR] };
    }
}
