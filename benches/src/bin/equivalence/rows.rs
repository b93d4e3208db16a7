//! The rows of the table: scenes, strategies, and what is made hard for them.

use croupier::unstable::learn::{ControlVariate, Guiding, Learning, PixelEstimator};
use croupier::unstable::{MIN_RING, Sampler};
use croupier::{Counters, Settings};

/// What is made hard for a strategy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Trial {
    None,
    /// The smallest ring.
    Ring,
    /// A ledger of 4 records: hardly a sample can be learned from.
    Ledger,
    /// A cache of little more than its roots.
    Cache,
    /// All of that, with blocks for the denoiser, roulette for light samples and a cached constant.
    Small,
    /// Roulette for light samples and their rays.
    Shadow,
    /// Samples where the error is.
    Adaptive,
    /// Every second iteration begins with a cache that another session saved half-way.
    Reloaded,
    /// Random numbers replace all statistics before each iteration but the first.
    Poisoned,
    /// Splitting may add 4 samples to a camera sample.
    Budget,
    /// Sobol' points in place of hashed numbers.
    Sobol,
    /// Sobol' points, light roulette and path guiding from the first statistics on.
    Guided,
    /// The same with a guide of 24 KiB, whose logs are too small.
    Thinned,
}

impl Trial {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Ring => ", ring of 16",
            Self::Ledger => ", ledger of 4",
            Self::Cache => ", cache of 20 KiB",
            Self::Small => ", everything small",
            Self::Shadow => ", shadow roulette",
            Self::Adaptive => ", adaptive",
            Self::Reloaded => ", reloaded cache",
            Self::Poisoned => ", poisoned cache",
            Self::Budget => ", split budget of 4",
            Self::Sobol => ", Sobol' points",
            Self::Guided => ", guided",
            Self::Thinned => ", guided from 24 KiB",
        }
    }

    pub(crate) fn set(self, s: &mut Settings) {
        match self {
            Self::None | Self::Reloaded => {}
            Self::Ring => s.ring = MIN_RING,
            Self::Ledger => s.learning.ledger = 4,
            Self::Cache => s.learning.cache_bytes = 20 << 10,
            Self::Shadow => s.shadow_roulette = true,
            Self::Adaptive => s.adaptive = true,
            Self::Poisoned => s.learning.cache_bytes = 32 << 10,
            Self::Budget => s.split_budget = 4,
            Self::Sobol => s.sampler = Sampler::Sobol,
            Self::Guided | Self::Thinned => {
                (s.sampler, s.shadow_roulette) = (Sampler::Sobol, s.strategy.name() == "ears");
                s.learning.guiding = Guiding::On;
                s.learning.guide_bytes = if self == Self::Guided { 1 << 20 } else { 24 << 10 };
            }
            Self::Small => {
                (s.ring, s.shadow_roulette, s.control_variate) = (MIN_RING, true, ControlVariate::Cached);
                s.learning = Learning {
                    ledger: 4,
                    cache_bytes: 20 << 10,
                    pixel_estimator: PixelEstimator::Blocks,
                    ..s.learning
                };
            }
        }
    }

    /// Did it happen? Else the row means nothing. Settings alone need no check.
    /// `guided` is the largest share of samples that a guide took.
    pub(crate) fn happened(self, c: &Counters, guided: f64) -> bool {
        match self {
            Self::None | Self::Cache | Self::Adaptive | Self::Reloaded | Self::Sobol => true,
            Self::Guided | Self::Thinned => guided > 0.1,
            Self::Ring => c.splits_limited_by_ring > 0,
            Self::Shadow => {
                c.shadow_rays_terminated > c.shadow_rays / 50 && c.light_samples_skipped > c.vertex_samples / 100
            }
            Self::Ledger | Self::Small => c.ledger_full > c.samples_logged,
            Self::Poisoned => c.paths_terminated > c.camera_samples / 20 && c.splits > c.camera_samples / 20,
            Self::Budget => c.splits_limited_by_budget > 0,
        }
    }
}

/// One row of the table for one scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) strategy: &'static str,
    pub(crate) trial: Trial,
    pub(crate) depth: u32,
    /// Camera samples per pixel of the iterations of a render.
    pub(crate) iterations: &'static [u32],
    /// Without the noisiest pixels.
    pub(crate) calm: bool,
    pub(crate) quick: bool,
}

/// Long enough to learn, short enough for many seeds.
const USUAL: &[u32] = &[2, 2, 4, 8, 16, 32];

const fn plain(strategy: &'static str) -> Row {
    Row { strategy, trial: Trial::None, depth: 40, iterations: USUAL, calm: false, quick: false }
}

const fn tried(strategy: &'static str, trial: Trial) -> Row {
    Row { trial, ..plain(strategy) }
}

/// Factors that multiply noise or work at every vertex need short paths.
const fn short(strategy: &'static str, trial: Trial, depth: u32, iterations: &'static [u32]) -> Row {
    Row { trial, depth, iterations, ..plain(strategy) }
}

const fn quick(row: Row) -> Row {
    Row { quick: true, ..row }
}

const fn calm(row: Row) -> Row {
    Row { calm: true, ..row }
}

/// A scene, the size of its picture, and its rows.
pub(crate) type Rows = (&'static str, [u32; 2], &'static [Row]);

/// The scene of the tests with fog, smoke in a grid, marble, a pane and a cut-out.
pub(crate) const MISTY: &str = "misty";

pub(crate) const SCENES: [Rows; 4] = [
    ("cbox", [24, 24], CBOX),
    ("veach_mis", [32, 18], VEACH_MIS),
    ("material_spheres", [32, 24], MATERIAL_SPHERES),
    (MISTY, [24, 18], MISTY_ROWS),
];

const CBOX: &[Row] = &[
    plain("contribution"),
    plain("throughput"),
    plain("throughput:luminance"),
    plain("throughput:mean"),
    plain("albedo"),
    plain("classic"),
    plain("classic:5:relative"),
    plain("winners"),
    plain("bolin-meyer"),
    plain("adrr"),
    plain("adrrs"),
    plain("ear"),
    plain("ear:plain"),
    plain("ears"),
    quick(tried("ears", Trial::Shadow)),
    plain("ears:plain"),
    quick(plain("fixed:0.7")),
    short("fixed:3.3", Trial::None, 4, &[8]),
    short("fixed:20", Trial::None, 3, &[2]),
    short("fixed:0.05", Trial::None, 2, &[64]),
    quick(short("fixed:3.3", Trial::Ring, 4, &[8])),
    short("fixed:3.3", Trial::Budget, 4, &[8]),
    short("fixed:20", Trial::Ring, 3, &[2]),
    tried("adrrs", Trial::Ledger),
    tried("adrrs", Trial::Cache),
    tried("adrrs", Trial::Small),
    tried("adrrs", Trial::Reloaded),
    short("adrrs", Trial::Poisoned, 3, USUAL),
    tried("ears", Trial::Ring),
    tried("ears", Trial::Ledger),
    tried("ears", Trial::Cache),
    quick(tried("ears", Trial::Small)),
    tried("ears", Trial::Adaptive),
    tried("ears", Trial::Reloaded),
    quick(short("ears", Trial::Poisoned, 3, USUAL)),
    tried("ears", Trial::Sobol),
    tried("classic", Trial::Guided),
    quick(tried("ears", Trial::Guided)),
    tried("ears", Trial::Thinned),
    quick(plain("threshold")),
];

const VEACH_MIS: &[Row] = &[
    plain("contribution"),
    plain("throughput"),
    calm(plain("albedo")),
    plain("classic"),
    plain("classic:5:relative"),
    calm(plain("winners")),
    calm(plain("bolin-meyer")),
    plain("adrr"),
    plain("adrrs"),
    plain("ear"),
    plain("ears"),
    quick(tried("ears", Trial::Shadow)),
    plain("ears:plain"),
    calm(plain("fixed:0.7")),
    tried("adrrs", Trial::Ledger),
    tried("adrrs", Trial::Cache),
    calm(tried("adrrs", Trial::Small)),
    tried("adrrs", Trial::Reloaded),
    short("adrrs", Trial::Poisoned, 3, USUAL),
    calm(short("fixed:3.3", Trial::Ring, 3, &[8])),
    tried("ears", Trial::Ledger),
    tried("ears", Trial::Cache),
    calm(tried("ears", Trial::Small)),
    tried("ears", Trial::Reloaded),
    calm(short("ears", Trial::Poisoned, 3, USUAL)),
    tried("ears", Trial::Sobol),
    tried("ears", Trial::Guided),
];

const MATERIAL_SPHERES: &[Row] = &[
    calm(plain("contribution")),
    calm(plain("throughput")),
    calm(plain("albedo")),
    plain("classic"),
    plain("classic:5:relative"),
    calm(plain("winners")),
    calm(plain("bolin-meyer")),
    plain("adrr"),
    calm(plain("adrrs")),
    calm(plain("ear")),
    calm(plain("ears")),
    calm(quick(tried("ears", Trial::Shadow))),
    calm(short("fixed:0.7", Trial::None, 4, USUAL)),
    calm(short("fixed:3.3", Trial::None, 3, &[8])),
    calm(short("fixed:20", Trial::None, 2, &[4])),
    calm(short("fixed:0.05", Trial::None, 2, &[64])),
    calm(short("fixed:3.3", Trial::Ring, 3, &[8])),
    calm(short("fixed:3.3", Trial::Budget, 3, &[8])),
    calm(short("fixed:20", Trial::Ring, 3, &[2])),
    calm(tried("adrrs", Trial::Ring)),
    calm(tried("adrrs", Trial::Small)),
    calm(tried("adrrs", Trial::Reloaded)),
    calm(short("adrrs", Trial::Poisoned, 3, USUAL)),
    calm(tried("ears", Trial::Ring)),
    calm(tried("ears", Trial::Small)),
    calm(tried("ears", Trial::Reloaded)),
    calm(short("ears", Trial::Poisoned, 3, USUAL)),
    calm(tried("ears", Trial::Sobol)),
    calm(tried("ears", Trial::Guided)),
];

const MISTY_ROWS: &[Row] = &[
    plain("contribution"),
    plain("throughput"),
    plain("albedo"),
    plain("classic"),
    plain("classic:2"),
    plain("winners"),
    plain("bolin-meyer"),
    plain("adrr"),
    plain("adrrs"),
    plain("ear"),
    plain("ears"),
    plain("ears:plain"),
    short("fixed:0.5", Trial::None, 4, USUAL),
    short("fixed:2", Trial::None, 4, &[8]),
    quick(short("fixed:3.3", Trial::Ring, 4, &[8])),
    tried("adrrs", Trial::Small),
    tried("adrrs", Trial::Reloaded),
    quick(tried("ears", Trial::Small)),
    tried("ears", Trial::Shadow),
    tried("ears", Trial::Adaptive),
    tried("ears", Trial::Reloaded),
    quick(short("ears", Trial::Poisoned, 3, USUAL)),
    tried("ears", Trial::Sobol),
    quick(tried("ears", Trial::Guided)),
];
