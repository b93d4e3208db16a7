//! Croupier: light transport in packets of eight, in the caller's memory.
//!
//! Data flows one way: scene bytes -> [`Scene`] (validated once) -> plan (how many bytes) -> the caller's
//! memory -> session and shards -> `step` ... -> film.
//!
//! | layer | knows | must not know |
//! |---|---|---|
//! | [`scene`] | the blob's sections, validation | how light moves |
//! | [`accel`] | rays against the tree | materials, light |
//! | [`bsdf`] | scattering in local frames | geometry, lights |
//! | [`light`] | emission and its sampling | scattering |
//! | [`rrs`] | how many samples a vertex gets | where it is |
//! | [`learn`] | statistics by place and direction | how paths are traced |
//! | `tracer` | packets, queues, stages | files, threads, clocks |
//! | [`film`] | sums per pixel and their error | paths |
//! | [`denoise`] | pictures and their errors | paths, films but for one copy |
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
//!     session.begin_iteration(16);
//!     while shard.step(&session, Budget { rays: 10_000 }) == StepResult::More {}
//!     session.end_iteration([&shard])?;
//!     Ok(session.film().error_estimate().rel_mse)
//! }
//! assert!(render(b"no scene", &mut [], &mut []).is_err());
//! ```
//!
//! The picture is a function of scene bytes, settings and samples per iteration: threads, order of the shards and step
//! sizes do not change a bit of it, and neither does the instruction set unless the feature `fast` is on. The crate
//! computes with the instructions it is compiled for; on x86-64 set `-C target-cpu=x86-64-v3` in the program's own
//! build.
//!
//! Comments that say `NUMERICS XXX-n` refer to the rows of docs/NUMERICS.md: hard numerical cases and their tests.
#![no_std]
#![forbid(unsafe_code)]

pub mod accel;
pub mod bsdf;
pub mod camera;
pub mod cost;
mod counters;
pub mod denoise;
pub mod film;
pub mod geometry;
pub mod learn;
pub mod light;
mod memory;
mod names;
mod plan;
pub mod profile;
pub mod rng;
pub mod rrs;
mod sampler;
pub mod scene;
mod session;
mod setting;
mod settings;
#[cfg(test)]
mod testing;
pub mod texture;
mod tiles;
mod tracer;
mod world;

pub use counters::{Counters, Utilisation};
pub use croupier_simd as simd;
pub use film::{ErrorEstimate, Film};
pub use memory::{BLOCK_ALIGN, Layout, MemoryError};
pub use plan::Plan;
pub use rrs::Strategy;
pub use scene::{Effects, Scene, SceneError};
pub use session::{Phase, Session, SessionBuilder, SessionError};
pub use setting::{SettingError, SettingInfo, SettingRange, SettingValue};
pub use settings::{MAX_PATH_LENGTH, MIN_RING, Settings, SettingsError};
pub use tracer::{BYTES_PER_PATH, Budget, Shard, ShardError, StepResult};
pub use world::{Iteration, World};
