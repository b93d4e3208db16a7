//! The picture that every host of this repository renders, in steps of a few rays.

use crate::Aligned;
use croupier::unstable::Effects;
use croupier::unstable::learn::{Learning, PixelEstimator};
use croupier::unstable::profile::Custom;
use croupier::unstable::rrs::Ears;
use croupier::{
    Budget, Film, MemoryError, Plan, Scene, SceneError, Session, SessionError, Settings, SettingsError, Shard,
    ShardError, StepResult, Strategy,
};

/// Kernels for the box: what it calls for, and no more. Scenes with other effects are refused.
pub type Kernels = Custom<{ Effects::DIFFUSE.with(Effects::AREA_LIGHTS).0 }>;

/// The scene, a Cornell box with two blocks, in flash.
static BOX: &Aligned<{ include_bytes!("../../box.crp").len() }> = &Aligned(*include_bytes!("../../box.crp"));

/// Camera samples per pixel of each iteration.
pub const ITERATIONS: [u32; 3] = [2, 2, 4];

/// Rays after which the main loop gets the processor back. A step exceeds it by less than one packet: 16 rays.
pub const BETWEEN_TICKS: u64 = 48;

/// Bytes of the session's block, [`Plan::session`]: a constant, because the memory is static. A test compares the two.
pub const SESSION_BYTES: usize = 231_232;
/// Bytes of the shard's block, [`Plan::shard_of`]; as above.
pub const SHARD_BYTES: usize = 239_424;

/// The scene's bytes.
pub fn box_bytes() -> &'static [u8] {
    &BOX.0
}

/// Settings of the picture, small in memory.
pub fn settings(scene: &Scene<'_>) -> Settings {
    Settings {
        strategy: Strategy::Ears(Ears::default()),
        ring: 64,
        split_budget: 64,
        learning: Learning {
            ledger: 256,
            cache_bytes: 64 << 10,
            pixel_estimator: PixelEstimator::Blocks,
            ..Learning::default()
        },
        ..Settings::for_scene(scene)
    }
}

/// Why there is no picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// The bytes are no scene.
    Scene(SceneError),
    /// The settings cannot be used.
    Settings(SettingsError),
    /// The session's block is too small, or the scene calls for effects that the kernels lack.
    Session(SessionError),
    /// The shard's block is too small.
    Shard(ShardError),
}

impl Failure {
    /// What failed, in a word.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Scene(_) => "scene",
            Self::Settings(_) => "settings",
            Self::Session(_) => "session",
            Self::Shard(_) => "shard",
        }
    }

    /// Bytes of the block that was too small; 0 if it is something else.
    pub fn needed(&self) -> usize {
        match self {
            Self::Session(SessionError::Memory(MemoryError::TooSmall { needed, .. }))
            | Self::Shard(ShardError::Memory(MemoryError::TooSmall { needed, .. })) => *needed,
            _ => 0,
        }
    }
}

/// A picture under way, in two blocks of memory.
#[derive(Debug)]
pub struct Renderer<'m> {
    session: Session<'m, 'm, Kernels>,
    shard: Shard<'m>,
    /// Samples per pixel of the iterations that have not begun.
    to_do: core::slice::Iter<'static, u32>,
    /// The shard has finished the iteration.
    ending: bool,
    /// Rays of the iterations that shards have finished.
    rays: u64,
}

impl<'m> Renderer<'m> {
    /// Checks the scene and begins with its first iteration.
    pub fn new(scene: &'m [u8], session: &'m mut [u8], shard: &'m mut [u8]) -> Result<Self, Failure> {
        let scene = Scene::from_bytes(scene).map_err(Failure::Scene)?;
        let plan = Plan::new(&settings(&scene)).map_err(Failure::Settings)?;
        let builder = Session::builder(scene).profile::<Kernels>();
        let mut renderer = Self {
            session: builder.build(&plan, session).map_err(Failure::Session)?,
            shard: Shard::new(&plan, 0, shard).map_err(Failure::Shard)?,
            to_do: ITERATIONS.iter(),
            ending: false,
            rays: 0,
        };
        renderer.begin();
        Ok(renderer)
    }

    /// Begins the next iteration; `false` if that was the last.
    fn begin(&mut self) -> bool {
        let next = self.to_do.next();
        if let Some(samples) = next {
            self.session.begin_iteration(*samples);
        }
        next.is_some()
    }

    /// Works for about `rays` rays, or as long at the end of an iteration; `false` when the picture is finished.
    pub fn work(&mut self, rays: u64) -> Result<bool, Failure> {
        let budget = Budget { rays };
        if !self.ending {
            self.ending = self.shard.step(&self.session, budget) == StepResult::Done;
            if self.ending {
                self.rays += self.shard.counters().rays();
            }
            return Ok(true);
        }
        match self.session.finish_iteration([&self.shard], budget).map_err(Failure::Session)? {
            StepResult::More => Ok(true),
            StepResult::Done => {
                self.ending = false;
                Ok(self.begin())
            }
        }
    }

    /// Rays traced so far.
    pub fn rays(&self) -> u64 {
        let under_way = !self.ending && self.shard.has_joined(&self.session);
        self.rays + if under_way { self.shard.counters().rays() } else { 0 }
    }

    /// What the picture took, by name: the same numbers on every machine.
    pub fn report(&self) -> [(&'static str, u64); 12] {
        let c = self.session.counters();
        [
            ("camera_samples", c.camera_samples),
            ("rays", c.rays()),
            ("shadow_rays", c.shadow_rays),
            ("paths_terminated", c.paths_terminated),
            ("splits", c.splits),
            ("splits_limited_by_ring", c.splits_limited_by_ring),
            ("splits_limited_by_budget", c.splits_limited_by_budget),
            ("samples_logged", c.samples_logged),
            ("ledger_full", c.ledger_full),
            ("non_finite", c.non_finite),
            ("ring_peak", c.ring_peak),
            // estimated relMSE of the picture, in millionths
            ("rel_mse_1e-6", (self.session.film().error_estimate().rel_mse * 1e6) as u64),
        ]
    }

    /// Hash of the picture: 64-bit FNV-1a of the means as little-endian `f32`, red, green, blue, row by row.
    pub fn hash(&self) -> u64 {
        hash(self.session.film())
    }
}

fn hash(film: &Film<'_>) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for pixel in film.pixels() {
        for byte in pixel.mean().into_iter().flat_map(|x| (x as f32).to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    hash
}
