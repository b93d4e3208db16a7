//! Settings of the strategies that learn.

use crate::names::names;
use crate::rrs::{Learned8, MAX_FACTOR, MIN_FACTOR, Norm};
use crate::setting::{SettingRange, SettingValue, Unreadable, Value, named_values, settings};
use core::fmt;
use croupier_simd::Vec3x8;

/// Error of the picture that learning minimises.
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

/// Method of the pixel estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelEstimator {
    /// Built-in denoiser, which uses albedo and normals if they are in [`crate::Settings::aovs`]; takes 20 bytes per
    /// pixel, scratch included.
    #[default]
    Denoised,
    /// Means over squares of 8x8 pixels: 12 bytes for 64 pixels.
    Blocks,
}

names!(PixelEstimator: Denoised = "denoised", Blocks = "blocks");

named_values!(Objective, PixelEstimator);

/// Control variate of roulette: the radiance assumed for skipped samples (Szécsi et al. 2003).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ControlVariate {
    /// Radiance 0: plain roulette.
    #[default]
    Off,
    /// Cached mean of reflected radiance, reduced towards 0 where it comes from few samples. Needs a strategy that
    /// learns from the scene.
    Cached,
    /// Radiance of this value in all channels.
    Number(f32),
}

/// Samples at which the cached mean has weight 1/2.
const MEAN_TRUST: f32 = 64.0;

impl ControlVariate {
    /// The value per lane; `None` if it is 0 everywhere.
    #[inline]
    pub(crate) fn of(self, learned: &Learned8) -> Option<Vec3x8> {
        match self {
            Self::Off => None,
            Self::Cached => Some(learned.local.mean * learned.local.trust(MEAN_TRUST)),
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

/// Use of path guiding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guiding {
    /// None.
    #[default]
    Off,
    /// While it is worth its cost, as guiding a part of the pixels predicts. Needs kernels with it
    /// ([`crate::unstable::profile::Profile::GUIDING`]), and an estimate of the pixels.
    Auto,
    /// Wherever the statistics promise a gain. Needs kernels with it ([`crate::unstable::profile::Profile::GUIDING`]).
    On,
}

names!(Guiding: Off = "off", Auto = "auto", On = "on");
named_values!(Guiding);

settings! {
    /// Settings of the strategies that learn.
    pub struct Learning {
        cache_bytes: usize = 24 << 20 =>
            "cache-bytes", "Memory for statistics of the scene, the session's and those of all shards together";
        ledger: u32 = 2048 =>
            "ledger", "Samples in flight per shard that can be learned from, of 68 bytes each",
            SettingRange::Integers { min: 1, max: 1 << 24 };
        /// More make statistics better and iterations slower. Path guiding takes 32 at least of pixels that it guides.
        samples: u32 = 8 =>
            "learn-samples", "Camera samples per pixel that are learned from in each iteration, the first ones",
            SettingRange::Integers { min: 1, max: u32::MAX as u64 };
        /// EARS: 40,000.
        subdivide_count: f32 = 10_000.0 =>
            "subdivide-count", "Samples in a leaf of the octree at which it is subdivided",
            SettingRange::Positive;
        decay: f32 = 0.75 =>
            "decay", "Weight that the statistics keep from one iteration to the next",
            SettingRange::Numbers { min: 0.0, max: 1.0 };
        pixel_estimator: PixelEstimator = PixelEstimator::Denoised =>
            "pixel-estimator",
            "Pixel estimate for relative errors: the denoised picture (20 bytes a pixel) or means of 8x8 pixels (12 bytes)";
        objective: Objective = Objective::Relative =>
            "objective", "Error of the picture to minimise: relative to the pixel (relMSE), or absolute (MSE)";
        norm: Norm = Norm::Mean =>
            "norm", "Norm of the errors of the three channels";
        guiding: Guiding = Guiding::Off =>
            "guiding", "Path guiding: scattering by learned distributions of directions, besides those of materials and media";
        /// Shards also need the ledger then, with 36 bytes more for each record, whatever the strategy.
        guide_bytes: usize = 8 << 20 =>
            "guide-bytes", "Memory for path guiding, the session's and the logs of all shards together";
        factors: [f32; 2] = [MIN_FACTOR, MAX_FACTOR] =>
            "factors", "Smallest and largest factor of roulette and splitting that is learned",
            SettingRange::Pair { first: [MIN_FACTOR, 1.0], second: [1.0, MAX_FACTOR] };
    }
}
