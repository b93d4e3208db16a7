//! Croupier: light transport in packets of eight, in the caller's memory.
//!
//! Data flows one way: scene bytes -> [`Scene`] (validated once) -> plan (how many bytes) -> the caller's
//! memory -> session and shards -> `step` ... -> film.
//!
//! Layers, lowest first; each may use those above it in the table, and no others:
//!
//! | layer | knows | must not know |
//! |---|---|---|
//! | `instructions` | what this build needs of the processor | what runs on it |
//! | `memory` | sizes first, then one carve | what is stored |
//! | `bits` | sets, one bit each | what is in them |
//! | `names` | enumerations with names | what they stand for |
//! | `cost` | counted cost of rays | clocks |
//! | `counters` | what happened, bounds met | why |
//! | `tiles` | which pixels belong to which shard | threads |
//! | `rng` | keys and hashes | what is drawn |
//! | `sampler` | what paths draw, in which dimensions | rays, light |
//! | `scene` | the blob's sections, validation | how light moves |
//! | `profile` | sets of effects | kernels |
//! | `geometry` | rays, hits, points on surfaces | trees, materials |
//! | `camera` | rays through pixels | scenes beyond the camera |
//! | `texture` | texels at coordinates | materials |
//! | `accel` | rays against the tree | materials, light |
//! | `bsdf` | scattering in local frames | geometry, lights |
//! | `light` | emission and its sampling | scattering |
//! | `rrs` | how many samples a vertex gets | where it is |
//! | `media` | free flights and transmittance in media | surfaces, phase functions, which medium a path is in |
//! | `film` | sums per pixel and their error | paths |
//! | `denoise` | pictures and their errors | paths, films but for one copy |
//! | `setting` | settings by name and text | what they set |
//! | `learn` | statistics by place and direction | materials, lights, how paths are traced |
//! | `settings` | the caller's choices, their ranges | how they are followed |
//! | `edit` | changes of a scene between frames | sessions, how paths are traced |
//! | `compose` | whole scenes from arrays | sessions, how paths are traced |
//! | `extension` | what hosts compute in place of the core | where it is used |
//! | `world` | what paths read | who owns it |
//! | `tracer` | packets, the refill ring, stages, books | files, threads, clocks |
//! | `record` | scalars of a suspended session | what they stand for |
//! | `plan` | how many bytes a render needs | where they come from |
//! | `schedule` | how many samples an iteration takes | clocks, who renders them |
//! | `session` | iterations: merge, learn, begin again | how paths are traced |
//!
//! [`unstable`] shows most of them to hosts that want more than the names at the top.
//!
//! A host asks how much memory is needed, hands it over, and steps the shards from as many threads as it likes:
//!
//! ```
//! use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
//!
//! /// Renders 16 samples per pixel and returns the estimated relMSE.
//! fn render(blob: &[u8], shared: &mut [u8], block: &mut [u8]) -> Result<f64, Box<dyn core::error::Error>> {
//!     let scene = Scene::from_bytes(blob)?;
//!     // `plan.session()` and `plan.shard()` are the sizes of the two blocks; see `BLOCK_ALIGN` for their alignment.
//!     let plan = Plan::new(&Settings::for_scene(&scene))?;
//!     let mut session = Session::new(scene, &plan, shared)?;
//!     let mut shard = Shard::new(&plan, 0, block)?;
//!     for _ in 0..2 {
//!         session.begin_iteration(8);
//!         while shard.step(&session, Budget { rays: 10_000 }) == StepResult::More {}
//!         session.end_iteration([&shard])?;
//!     }
//!     Ok(session.film().error_estimate().rel_mse)
//! }
//! assert!(render(b"no scene", &mut [], &mut []).is_err());
//! ```
//!
//! The picture is a function of scene bytes, settings and samples per iteration: threads, order of the shards and step
//! sizes do not change a bit of it, and neither does the instruction set unless the feature `fast` is on. The crate
//! computes with the instructions it is compiled for ([`INSTRUCTION_SET`]); on x86-64 set `-C target-cpu=x86-64-v3` in the
//! program's own build. A processor that lacks them is an error of [`Scene::from_bytes`] and [`Session::new`]; a host that is
//! there in several builds chooses by [`processor_instruction_set`].
//!
//! Comments that say `NUMERICS XXX-n` refer to the rows of docs/NUMERICS.md: hard numerical cases and their tests.
#![no_std]
#![forbid(unsafe_code)]
#![deny(clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_used)]

mod accel;
mod bits;
mod bsdf;
mod camera;
mod compose;
mod cost;
mod counters;
mod denoise;
mod edit;
mod extension;
mod film;
mod geometry;
mod instructions;
mod learn;
mod light;
mod media;
mod memory;
mod names;
mod plan;
mod profile;
mod record;
mod rng;
mod rrs;
mod sampler;
mod scene;
mod schedule;
mod session;
mod setting;
mod settings;
#[cfg(test)]
mod testing;
mod texture;
mod tiles;
mod tracer;
mod world;

pub use counters::Counters;
pub use edit::{EditError, EditableScene, SceneEdit};
pub use film::{ErrorEstimate, Film};
pub use instructions::{INSTRUCTION_SET, missing_instructions, processor_instruction_set};
pub use memory::{BLOCK_ALIGN, MemoryError};
pub use plan::Plan;
pub use rrs::Strategy;
pub use scene::{Scene, SceneError};
pub use session::{Session, SessionBuilder, SessionError, SessionState, SessionView};
pub use setting::SettingError;
pub use settings::{Settings, SettingsError};
pub use tracer::{Budget, SavedShardError, Shard, ShardError, StepResult};

/// The embedding guide.
pub mod guide {
    #![doc = include_str!("guide.md")]
}

/// Everything else that a host may replace, measure or test: kernels, statistics, the scene's layout.
///
/// **Unstable.** Names, signatures and behaviour in here may change in any 0.x version, without a version that announces
/// it. The names at the top of the crate change only with a note in CHANGELOG.
pub mod unstable {
    pub use crate::counters::Utilisation;
    pub use crate::memory::Layout;
    pub use crate::plan::STACK_BYTES;
    pub use crate::record::ResumeError;
    pub use crate::sampler::{Numbers8, Sampler};
    pub use crate::scene::Effects;
    pub use crate::session::{Phase, Unguided};
    pub use crate::setting::{SettingInfo, SettingRange, SettingValue};
    pub use crate::settings::{MAX_PATH_LENGTH, MIN_RING};
    pub use crate::tracer::{BYTES_PER_PATH, MAX_PASSED};
    pub use crate::world::{Identity, Iteration, World};
    pub use croupier_simd as simd;

    /// Rays against triangles.
    pub mod accel {
        pub use crate::accel::*;
    }
    /// Scattering models in the local shading frame.
    pub mod bsdf {
        pub use crate::bsdf::*;
    }
    /// Rays through pixels.
    pub mod camera {
        pub use crate::camera::*;
    }
    /// Scenes from arrays.
    pub mod compose {
        pub use crate::compose::*;
    }
    /// Counted cost of rays.
    pub mod cost {
        pub use crate::cost::*;
    }
    /// Denoising of pictures with known errors.
    pub mod denoise {
        pub use crate::denoise::*;
    }
    /// Sums per pixel and their errors.
    pub mod film {
        pub use crate::film::*;
    }
    /// What hosts compute in place of the core.
    pub mod extension {
        pub use crate::extension::*;
    }
    /// Rays, hits and points on surfaces.
    pub mod geometry {
        pub use crate::geometry::*;
    }
    /// Statistics learned from paths.
    pub mod learn {
        pub use crate::learn::*;
    }
    /// What each sample of a path gave, until it is finished.
    pub mod ledger {
        pub use crate::tracer::{Finished, Ledger, NO_RECORD};
    }
    /// Emission and its sampling.
    pub mod light {
        pub use crate::light::*;
    }
    /// Free flights and transmittance in participating media.
    pub mod media {
        pub use crate::media::*;
    }
    /// Kernel profiles: effects that are compiled in.
    pub mod profile {
        pub use crate::profile::*;
    }
    /// Counter-based random numbers.
    pub mod rng {
        pub use crate::rng::*;
    }
    /// Strategies of Russian roulette and splitting.
    pub mod rrs {
        pub use crate::rrs::*;
    }
    /// Samples of the next iteration.
    pub mod schedule {
        pub use crate::schedule::*;
    }
    /// The scene blob and its records.
    pub mod scene {
        pub use crate::scene::*;
    }
    /// Texture look-up.
    pub mod texture {
        pub use crate::texture::*;
    }
}
