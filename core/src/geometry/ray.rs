//! Eight rays and what they hit.

use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Eight rays: points `o + t d`, `tmin < t < tmax`. Directions need not be unit.
#[derive(Clone, Copy, Debug)]
pub struct Ray8 {
    /// Origins, world space.
    pub o: Vec3x8,
    /// Directions.
    pub d: Vec3x8,
    /// Smallest parameter, exclusive.
    pub tmin: F32x8,
    /// Largest parameter, exclusive; infinity is allowed.
    pub tmax: F32x8,
    /// Time, from 0 where the shutter opens to 1 where it closes; only moving instances read it.
    pub time: F32x8,
}

impl Ray8 {
    /// Rays without an end, when the shutter opens.
    #[inline(always)]
    pub fn unbounded(o: Vec3x8, d: Vec3x8) -> Self {
        Self { o, d, tmin: F32x8::ZERO, tmax: F32x8::INFINITY, time: F32x8::ZERO }
    }

    /// The same rays at other times.
    #[inline(always)]
    pub fn at(self, time: F32x8) -> Self {
        Self { time, ..self }
    }
}

/// Eight closest hits; lanes outside `hit` hold `tmax`, [`crate::scene::blob::NONE`] and zeros.
#[derive(Clone, Copy, Debug)]
pub struct Hit8 {
    /// Lanes that hit.
    pub hit: Mask8,
    /// Ray parameter.
    pub t: F32x8,
    /// Triangle index, or from [`FIRST_OWN_SURFACE`](super::FIRST_OWN_SURFACE) on a surface of the host's own.
    pub triangle: U32x8,
    /// Barycentric weight of the triangle's vertex b. `u`, `v` and `instance` of an own surface are the host's to use.
    pub u: F32x8,
    /// Barycentric weight of the triangle's vertex c; vertex a has `1 - u - v`.
    pub v: F32x8,
    /// Instances around the triangle: the world's, and the one within it; [`crate::scene::blob::NONE`] where there is none.
    pub instance: [U32x8; 2],
}

/// No instance around any triangle.
pub const NO_INSTANCE: [U32x8; 2] = [U32x8::splat(crate::scene::blob::NONE); 2];
