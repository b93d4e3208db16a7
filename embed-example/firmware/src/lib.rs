//! What the firmware computes: [`probe`], numbers that tell machines apart, and [`Renderer`], a picture in small steps.
//! Hosts run the same functions and must get the same numbers: in `reproducible` arithmetic they do not depend on the
//! machine.
#![no_std]
#![forbid(unsafe_code)]

mod picture;
mod probe;
mod sensor;

pub use picture::{
    BETWEEN_TICKS, Failure, ITERATIONS, Kernels, Renderer, SESSION_BYTES, SHARD_BYTES, box_bytes, settings,
};
pub use probe::{ProbeKernels, probe, scene_bytes};
pub use sensor::Sensor;

/// Bytes at an address that is a multiple of 64, as scenes and blocks of memory need it.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Aligned<const N: usize>(pub [u8; N]);
