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
//! | `tracer` | packets, queues, stages | files, threads, clocks |
//! | [`film`] | sums per pixel and their error | paths |
#![no_std]
#![forbid(unsafe_code)]

pub mod accel;
pub mod bsdf;
pub mod camera;
pub mod film;
pub mod light;
mod memory;
pub mod profile;
pub mod rng;
pub mod rrs;
pub mod scene;
mod session;
mod settings;
pub mod texture;
mod tiles;
mod tracer;

pub use croupier_simd as simd;
pub use film::{ErrorEstimate, Film};
pub use memory::{BLOCK_ALIGN, Layout, MemoryError};
pub use rrs::Strategy;
pub use scene::{Effects, Scene, SceneError};
pub use session::{Iteration, Session, SessionError};
pub use settings::{HARD_STOP, MIN_RING, Plan, Settings, SettingsError};
pub use tracer::{BYTES_PER_PATH, Budget, Counters, Progress, Shard, ShardError, Utilisation};
