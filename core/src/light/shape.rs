//! Lights with shapes of their own, without triangles: spheres, rectangles, disks. One shape per file, which implements
//! [`Shape`].
//!
//! They hide nothing: a ray that meets one takes its radiance along, weighted against the light sample that could have
//! found it, and goes on, as in Cycles and Arnold. Surfaces hide them. Every ray is tested against each of them, one
//! after the other, at 13 (sphere), 15 (disk) or 25 (rectangle) instructions per ray and light (AVX2); they are the last
//! lights of the scene, so that the search ends at the first one of another kind.

use super::{Chosen, LightSample8, area};
use crate::scene::blob::{Light, SHAPE_TWO_SIDED};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Directions to eight points on lights.
pub(super) struct Sampled8 {
    pub wi: Vec3x8,
    pub point: Vec3x8,
    pub normal: Vec3x8,
    pub point_error: F32x8,
    /// Solid-angle density.
    pub pdf: F32x8,
    pub valid: Mask8,
}

/// Fields of eight lights.
pub(super) trait ShapeFields {
    /// Numbers of [`Light::params`].
    fn params(&self) -> [F32x8; 6];
    /// Middles.
    fn vector(&self) -> Vec3x8;
    /// Lanes that also emit from the back.
    fn two_sided(&self) -> Mask8;
}

/// A light of its own per lane.
impl ShapeFields for Chosen {
    #[inline(always)]
    fn params(&self) -> [F32x8; 6] {
        self.params
    }

    #[inline(always)]
    fn vector(&self) -> Vec3x8 {
        self.vector
    }

    #[inline(always)]
    fn two_sided(&self) -> Mask8 {
        !(self.triangle & U32x8::splat(SHAPE_TWO_SIDED)).eq(U32x8::splat(0))
    }
}

/// One light in all lanes.
impl ShapeFields for Light {
    #[inline(always)]
    fn params(&self) -> [F32x8; 6] {
        self.params.map(F32x8::splat)
    }

    #[inline(always)]
    fn vector(&self) -> Vec3x8 {
        let [x, y, z] = self.vector;
        Vec3x8::splat(x, y, z)
    }

    #[inline(always)]
    fn two_sided(&self) -> Mask8 {
        Mask8::splat(self.triangle & SHAPE_TWO_SIDED != 0)
    }
}

/// Contract of a shape: eight of them, as seen from points `p`.
pub(super) trait Shape {
    fn read(of: &impl ShapeFields) -> Self;

    /// Distance at which rays with unit directions `d` meet the side that emits; infinity where they do not.
    fn meet(&self, p: Vec3x8, d: Vec3x8) -> F32x8;

    /// Solid-angle density with which [`Self::sample`] chooses the direction to a point at distance `t` of a side that
    /// emits. May be infinite or not a number where nothing can be sampled.
    fn density(&self, p: Vec3x8, t: F32x8) -> F32x8;

    /// A direction to the side that emits, from two numbers in [0, 1).
    fn sample(&self, p: Vec3x8, u: [F32x8; 2]) -> Sampled8;
}

/// Sides that emit.
pub(super) fn sides(light: &Light) -> f64 {
    if light.triangle & SHAPE_TWO_SIDED != 0 { 2.0 } else { 1.0 }
}

/// Density of the uniform distribution on a flat `area` in a plane at distance `h`, at distance `r` along the ray.
#[inline(always)]
pub(super) fn area_density(r: F32x8, h: F32x8, area: F32x8) -> F32x8 {
    area::density(r, h / r, area)
}

/// Samples of lights of one shape.
#[inline(always)]
pub(super) fn shape_sample<S: Shape>(light: &Chosen, p: Vec3x8, words: [U32x8; 3]) -> LightSample8 {
    let s = S::read(light).sample(p, [words[0], words[1]].map(U32x8::to_unit));
    LightSample8 {
        wi: s.wi,
        point: s.point,
        normal: s.normal,
        point_error: s.point_error,
        radiance: light.emission,
        pdf: s.pdf,
        valid: s.valid,
        ..LightSample8::NONE
    }
}
