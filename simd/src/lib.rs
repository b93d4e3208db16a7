//! Eight lanes of everything a path tracer needs, over [`wide`] behind thin types of our own.
//!
//! This layer knows floats, integers, masks, vectors and elementary functions. It must not know rays,
//! light or scenes.
//!
//! Two arithmetics: the default, *reproducible*, uses only IEEE `+ - * / sqrt`, comparisons and integer
//! operations in a fixed order, so that every target computes the same bits. With the feature `fast`
//! [`F32x8::mul_add`] fuses where the target can; nothing else changes.
//!
//! Operations are inlined, which is right for processors with vector instructions. On one without, each is some 30
//! instructions: with the feature `compact` they are called instead. That changes size and speed only.
#![no_std]
#![deny(unsafe_code)]

#[cfg(target_endian = "big")]
compile_error!(
    "croupier needs a little-endian target: scene blobs, shards and learned statistics are little-endian records that are \
     read where they lie, so that a big-endian machine would compute with other numbers"
);

mod f32x8;
mod int;
mod mask;
mod math;
mod prefetch;
mod vec3;

pub use f32x8::F32x8;
pub use int::{I32x8, U32x8};
pub use mask::Mask8;
pub use prefetch::prefetch;
pub use vec3::{Frame8, LUMINANCE, Vec3x8};

/// Lanes of every vector type here.
pub const LANES: usize = 8;

/// Is this the arithmetic whose results have the same bits on every target? `false` with the feature `fast`.
pub const REPRODUCIBLE: bool = !cfg!(feature = "fast");
