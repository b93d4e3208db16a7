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
#![no_std]
#![forbid(unsafe_code)]

pub mod accel;
pub mod bsdf;
pub mod camera;
pub mod light;
pub mod rng;
pub mod scene;
pub mod texture;

pub use croupier_simd as simd;
pub use scene::{Scene, SceneError};
