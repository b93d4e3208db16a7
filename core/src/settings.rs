//! What the caller chooses.

use crate::learn::cache::CacheSize;
use crate::learn::{ControlVariate, Learning, Needs};
use crate::rrs::{MAX_FACTOR, MIN_FACTOR, Space, Strategy};
use crate::scene::Scene;
use core::fmt;

/// Paths end after this many segments whatever the settings say.
pub const MAX_PATH_LENGTH: u32 = 200;

/// Fewest waiting vertices a shard can work with: two packets.
pub const MIN_RING: u32 = 16;

/// All choices of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// Seed of every random number.
    pub seed: u64,
    /// Units of parallel work. The picture depends on it (rounding and the comb), never on threads.
    pub shards: u32,
    /// Path segments from the camera: 1 sees emitters only, 2 direct light. At most [`MAX_PATH_LENGTH`].
    pub max_depth: u32,
    /// Roulette and splitting.
    pub strategy: Strategy,
    /// Vertices that may wait in a shard, at least [`MIN_RING`]; 512 keep packets full with every material in the
    /// scene.
    pub ring: u32,
    /// Samples that splitting may add to one camera sample; beyond it factors are at most 1 (unbiased, counted).
    pub split_budget: u32,
    /// Also gather albedo, normal, depth and factors. The denoised estimate of the pixels that strategies learn with is
    /// better with them.
    pub aovs: bool,
    /// Give pixels with much error more samples, others fewer, from the second iteration on. Every pixel gets one at
    /// least, and every iteration counts as much in all of them, so that no pixel's mean hangs on its own noise.
    pub adaptive: bool,
    /// Play roulette for light samples too, with the most efficient factor: before their shadow ray is traced, and with
    /// strategies that learn before they are drawn. Those also learn where light samples are hidden. Worth it with
    /// [`crate::rrs::Ears`], whose rule it is.
    pub shadow_roulette: bool,
    /// What stands in for samples that roulette skips.
    pub control_variate: ControlVariate,
    /// Choices of the strategies that learn.
    pub learning: Learning,
}

impl Settings {
    /// Defaults for a scene: its camera's size and depth, one shard.
    pub fn for_scene(scene: &Scene<'_>) -> Self {
        Self {
            size: scene.camera.size,
            seed: 0,
            shards: 1,
            max_depth: scene.info.max_depth,
            strategy: Strategy::default(),
            ring: 512,
            split_budget: 4096,
            aovs: false,
            adaptive: false,
            shadow_roulette: false,
            control_variate: ControlVariate::Off,
            learning: Learning::default(),
        }
    }
    /// Checks every setting; the room for statistics of the scene, if they are wanted.
    pub(crate) fn check(&self) -> Result<Option<CacheSize>, SettingsError> {
        #[expect(clippy::eq_op, reason = "equal to itself unless a number in it is NaN")]
        if self != self {
            return Err(SettingsError::NotANumber);
        }
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        if pixels == 0 || pixels > 1 << 31 {
            return Err(SettingsError::Size(self.size));
        }
        if self.shards == 0 || self.shards > 65_536 {
            return Err(SettingsError::Shards(self.shards));
        }
        if self.max_depth == 0 {
            return Err(SettingsError::Depth(self.max_depth));
        }
        if self.ring < MIN_RING || self.ring > 1 << 24 {
            return Err(SettingsError::Ring(self.ring));
        }
        self.check_control_variate()?;
        self.check_learning()?;
        if self.strategy.space().is_none() {
            return Ok(None);
        }
        let needed = CacheSize::SMALLEST.bytes(self.shards).ok_or(SettingsError::Memory)?;
        let given = self.learning.cache_bytes;
        CacheSize::within(given, self.shards).map(Some).ok_or(SettingsError::Cache { needed, given })
    }

    fn check_control_variate(&self) -> Result<(), SettingsError> {
        let fits = match self.control_variate {
            ControlVariate::Off => true,
            ControlVariate::Cached => self.strategy.space() == Some(Space::Scene),
            ControlVariate::Number(x) => x.is_finite() && !self.strategy.is_biased(),
        };
        if fits { Ok(()) } else { Err(SettingsError::ControlVariate) }
    }

    fn check_learning(&self) -> Result<(), SettingsError> {
        let l = &self.learning;
        let [least, most] = l.factors;
        let fits = (MIN_FACTOR..=1.0).contains(&least)
            && (1.0..=MAX_FACTOR).contains(&most)
            && (1..=1 << 24).contains(&l.ledger)
            && l.samples > 0
            && l.subdivide_count > 0.0
            && (0.0..=1.0).contains(&l.decay);
        if fits { Ok(()) } else { Err(SettingsError::Learning) }
    }

    /// What these settings have the render learn, with room for `cache`.
    pub(crate) fn needs(&self, cache: Option<CacheSize>) -> Needs {
        let pixels = self.strategy.needs_image() || self.shadow_roulette || self.adaptive;
        Needs {
            size: self.size,
            features: self.aovs,
            space: self.strategy.space(),
            cache,
            pixels: pixels.then_some(self.learning.estimate),
            adaptive: self.adaptive,
            learning: self.learning,
        }
    }
}

/// Which setting cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SettingsError {
    /// The picture has no pixel, or more than 2^31.
    Size([u32; 2]),
    /// No shard, or more than 65,536.
    Shards(u32),
    /// `max_depth` is 0.
    Depth(u32),
    /// The ring has fewer than [`MIN_RING`] or more than 2^24 vertices.
    Ring(u32),
    /// The bytes of the cache do not suffice for the roots of its trees in the session and in every shard.
    Cache {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// The constant is not a finite number, is for `threshold`, or is to be the cached mean with a strategy that learns
    /// nothing of the scene.
    ControlVariate,
    /// A choice of [`Learning`] is out of range.
    Learning,
    /// A parameter of the strategy or a choice of [`Learning`] is NaN.
    NotANumber,
    /// The memory would exceed what can be addressed.
    Memory,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size([w, h]) => write!(f, "picture of {w} x {h} pixels: need at least 1 and at most 2^31"),
            Self::Shards(n) => write!(f, "{n} shards: need 1 to 65536"),
            Self::Depth(n) => write!(f, "max_depth {n}: need at least 1"),
            Self::Ring(n) => write!(f, "ring of {n} vertices: need {MIN_RING} to 2^24"),
            Self::Cache { needed, given } => write!(f, "cache of {given} bytes: with so many shards it needs {needed}"),
            Self::ControlVariate => f.write_str("the constant of roulette must be finite and cannot serve threshold; the cached mean needs ear, ears, adrr or adrrs"),
            Self::Learning => f.write_str("learning: need a ledger of 1 to 2^24 records, at least 1 sample to learn from, a split count above 0, a decay of 0 to 1, factors around 1 in 0.05 to 20"),
            Self::NotANumber => f.write_str("a parameter of the strategy, or of learning, is not a number"),
            Self::Memory => f.write_str("these settings need more memory than can be addressed"),
        }
    }
}

impl core::error::Error for SettingsError {}
