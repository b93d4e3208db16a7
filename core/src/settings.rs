//! Settings of a render.

use crate::film::{Aov, AovSet, Film, FilmLayout};
use crate::learn::cache::CacheSize;
use crate::learn::guiding::{COMPILED, GuideSize};
use crate::learn::{ControlVariate, Guiding, LearnedState, Learning, Needs};
use crate::rrs::{Space, Strategy};
use crate::sampler::Sampler;
use crate::scene::Scene;
use crate::setting::{SettingInfo, SettingRange, SettingValue, settings};
use core::fmt;

/// Paths end after this many segments whatever the settings say.
pub const MAX_PATH_LENGTH: u32 = 200;

/// Fewest waiting vertices a shard can work with: two packets.
pub const MIN_RING: u32 = 16;

settings! {
    /// All settings of a render.
    ///
    /// [`Self::default`] leaves open what the scene decides (size 0 x 0, depth 0), which no render accepts:
    /// [`Self::for_scene`] or [`Self::with_scene`] fill it in.
    pub struct Settings {
        size: [u32; 2] = [0, 0] =>
            "size", "Size of the picture in pixels",
            SettingRange::Size { max_pixels: 1 << 31 }, scene;
        seed: u64 = 0 =>
            "seed", "Seed of all random numbers: another one gives another, independent image";
        /// Sequences of Sobol' points go on from iteration to iteration, but for pixels that are guided and with
        /// [`Self::adaptive`].
        sampler: Sampler = Sampler::Sobol =>
            "sampler", "Random numbers: Owen-scrambled Sobol points, spread evenly over a pixel, or independent hashes";
        /// The picture depends on it (rounding and the comb), never on threads.
        shards: u32 = 1 =>
            "shards", "Units of parallel work; the image depends on their number",
            SettingRange::Integers { min: 1, max: 65_536 };
        /// At most [`MAX_PATH_LENGTH`] have an effect.
        max_depth: u32 = 0 =>
            "max-depth", "Path segments from the camera: 1 shows emitters only, 2 adds direct light",
            SettingRange::Integers { min: 1, max: u32::MAX as u64 }, scene;
        strategy: Strategy = Strategy::default() =>
            "rrs", "Strategy of roulette and splitting";
        /// 512 keep packets full with every material in the scene.
        ring: u32 = 512 =>
            "ring", "Path vertices that may wait in a shard; with fewer, factors above 1 become 1 more often",
            SettingRange::Integers { min: MIN_RING as u64, max: 1 << 24 };
        /// Beyond it factors are at most 1 (unbiased, counted).
        split_budget: u32 = 4096 =>
            "split-budget", "Samples that splitting may add to one camera sample";
        /// Denoising, that of the pixel estimate included, is better with them.
        /// What is not in the set costs neither memory nor time.
        aovs: AovSet = AovSet::NONE =>
            "aovs", "Auxiliary values besides the picture; true are those of first hits, factors, paths and cost";
        /// From the second iteration on. Every pixel gets one at least, and every iteration counts as much in all of
        /// them, so that no pixel's mean depends on its own noise.
        adaptive: bool = false =>
            "adaptive", "More samples for pixels with much error, fewer for others";
        /// With the most efficient factor, before the shadow ray is traced, and with strategies that learn from the
        /// scene before the light sample is drawn; those also learn visibility. Pays with [`crate::rrs::Ears`], whose
        /// rule it is.
        shadow_roulette: bool = false =>
            "shadow-roulette", "Russian roulette of next event estimation: of light samples and of their shadow rays";
        control_variate: ControlVariate = ControlVariate::Off =>
            "control-variate",
            "Control variate of roulette, the radiance assumed for skipped samples: 0, the learned mean, or a number";
    }
    nested {
        /// Settings of the strategies that learn.
        learning: Learning,
    }
}

impl Settings {
    /// Defaults for a scene: its camera's size and depth, one shard.
    pub fn for_scene(scene: &Scene<'_>) -> Self {
        Self::default().with_scene(scene)
    }

    /// These settings with the scene's own values where they are left open.
    #[must_use]
    pub fn with_scene(mut self, scene: &Scene<'_>) -> Self {
        if self.size == [0, 0] {
            self.size = scene.camera.size;
        }
        if self.max_depth == 0 {
            self.max_depth = scene.info.max_depth;
        }
        self
    }

    /// Checks every setting; the room for statistics of the scene, if they are wanted.
    pub(crate) fn check(&self) -> Result<Option<CacheSize>, SettingsError> {
        for setting in Self::TABLE {
            if let Some(value) = self.value(setting.name).filter(|value| !setting.range.contains(*value)) {
                return Err(SettingsError::Range { setting, value });
            }
        }
        self.check_control_variate()?;
        self.check_guiding()?;
        if self.strategy.space().is_none() {
            return Ok(None);
        }
        let needed = CacheSize::SMALLEST.bytes(self.shards).ok_or(SettingsError::Memory)?;
        let given = self.learning.cache_bytes;
        CacheSize::within(given, self.shards).map(Some).ok_or(SettingsError::Cache { needed, given })
    }

    /// Room for path guiding, if it is on and compiled in.
    pub fn guide_size(&self) -> Option<GuideSize> {
        (COMPILED && self.guides()).then(|| GuideSize::within(self.learning.guide_bytes, self.shards)).flatten()
    }

    /// Is path guiding on?
    pub fn guides(&self) -> bool {
        self.learning.guiding != Guiding::Off
    }

    fn check_guiding(&self) -> Result<(), SettingsError> {
        let given = self.learning.guide_bytes;
        if !self.guides() || GuideSize::within(given, self.shards).is_some() {
            return Ok(());
        }
        Err(SettingsError::Guide { needed: GuideSize::least(self.shards).ok_or(SettingsError::Memory)?, given })
    }

    fn check_control_variate(&self) -> Result<(), SettingsError> {
        let fits = match self.control_variate {
            ControlVariate::Off => true,
            ControlVariate::Cached => self.strategy.space() == Some(Space::Scene),
            ControlVariate::Number(_) => !self.strategy.is_biased(),
        };
        if fits { Ok(()) } else { Err(SettingsError::ControlVariate) }
    }

    /// What the film holds.
    pub(crate) fn film_layout(&self) -> FilmLayout {
        FilmLayout { size: self.size, weights: self.adaptive, rays: self.counts_rays(), aovs: self.aovs }
    }

    /// Words of memory for the pixels with most error, at the end of an iteration.
    pub(crate) fn largest_len(&self) -> usize {
        let pixels = self.film_layout().pixels();
        let measured = if self.estimates_pixels() { LearnedState::largest_len(pixels) } else { 0 };
        Film::largest_len(pixels).max(measured)
    }

    /// Is there an estimate of the pixels, against which iterations are measured?
    fn estimates_pixels(&self) -> bool {
        let tries = self.learning.guiding == Guiding::Auto;
        self.strategy.needs_image() || self.shadow_roulette || self.adaptive || tries
    }

    /// Does anything learn between iterations, so that the cost of a camera sample changes?
    pub fn learns(&self) -> bool {
        self.strategy.needs_image() || self.shadow_roulette || self.adaptive || self.guides()
    }

    /// Are the rays of every pixel counted?
    pub(crate) fn counts_rays(&self) -> bool {
        self.aovs.has(Aov::Cost) || self.adaptive
    }

    /// What these settings have the render learn, with room for `cache`.
    pub(crate) fn needs(&self, cache: Option<CacheSize>) -> Needs {
        Needs {
            size: self.size,
            space: self.strategy.space(),
            cache,
            guide: self.guide_size(),
            pixels: self.estimates_pixels().then_some(self.learning.pixel_estimator),
            adaptive: self.adaptive,
            learning: self.learning,
        }
    }
}

/// Why settings cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SettingsError {
    /// A value out of its setting's range.
    Range {
        /// The setting.
        setting: &'static SettingInfo,
        /// Value that was given.
        value: SettingValue,
    },
    /// Fewer bytes for the cache than the roots of its trees need in the session and in every shard.
    Cache {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// Fewer bytes for path guiding than its smallest trees need in the session and in every shard.
    Guide {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// A control variate with `threshold`, or the cached mean with a strategy that learns nothing of the scene.
    ControlVariate,
    /// More memory than can be addressed.
    Memory,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { setting: SettingInfo { name, range, .. }, value } => {
                write!(f, "{name} {value}: need {range}")
            }
            Self::Cache { needed, given } => write!(f, "cache of {given} bytes: with so many shards it needs {needed}"),
            Self::Guide { needed, given } => {
                write!(f, "guide of {given} bytes: with so many shards it needs {needed}")
            }
            Self::ControlVariate => f.write_str(
                "a control variate cannot serve threshold, and the cached mean needs ear, ears, adrr or adrrs",
            ),
            Self::Memory => f.write_str("these settings need more memory than can be addressed"),
        }
    }
}

impl core::error::Error for SettingsError {}
