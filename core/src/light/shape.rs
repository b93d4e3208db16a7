//! Lights with shapes of their own, without triangles: spheres, rectangles, disks. One shape per file, which implements
//! [`Shape`].
//!
//! They hide nothing: a ray that meets one takes its radiance along, weighted against the light sample that could have
//! found it, and goes on, as in Cycles and Arnold. Surfaces hide them. Every ray is tested against each of them, one
//! after the other, at 13 (sphere), 15 (disk) or 25 (rectangle) instructions per ray and light (AVX2); they are the last
//! lights of the scene, so that the search ends at the first one of another kind.
//!
//! A ray may be traced in pieces, because it passes things straight on. Whether it meets a light is decided from the point
//! where it left its last vertex, for the whole ray; a piece takes the lights whose distance from there lies in its part, and
//! the parts leave no gap and have no overlap.

use super::{Chosen, LightSample8, LightSelector, area, usable};
use super::{disk::Disk, rectangle::Rectangle, sphere::Sphere};
use crate::geometry::OFFSET_BOUND;
use crate::scene::Scene;
use crate::scene::blob::{Light, LightKind, SHAPE_HIDDEN, SHAPE_TWO_SIDED};
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
    /// Numbers of `params`.
    fn params<const N: usize>(&self, of: impl Fn(&[f32; 6]) -> [f32; N]) -> [F32x8; N];
    /// Middles.
    fn vector(&self) -> Vec3x8;
    /// Lanes that also emit from the back.
    fn two_sided(&self) -> Mask8;
}

/// A light of its own per lane.
impl ShapeFields for Chosen<'_> {
    #[inline(always)]
    fn params<const N: usize>(&self, of: impl Fn(&[f32; 6]) -> [f32; N]) -> [F32x8; N] {
        let lanes = self.record.map(|l| of(&l.params));
        core::array::from_fn(|k| F32x8::from_fn(|i| lanes[i][k]))
    }

    #[inline(always)]
    fn vector(&self) -> Vec3x8 {
        self.vector
    }

    #[inline(always)]
    fn two_sided(&self) -> Mask8 {
        !(U32x8::from_fn(|i| self.record[i].triangle) & U32x8::splat(SHAPE_TWO_SIDED)).eq(U32x8::splat(0))
    }
}

/// One light in all lanes.
impl ShapeFields for Light {
    #[inline(always)]
    fn params<const N: usize>(&self, of: impl Fn(&[f32; 6]) -> [f32; N]) -> [F32x8; N] {
        of(&self.params).map(F32x8::splat)
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
pub(super) fn shape_sample<S: Shape>(light: &Chosen<'_>, p: Vec3x8, words: [U32x8; 3]) -> LightSample8 {
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

/// Rays along which lights with shapes are looked for.
#[derive(Clone, Copy, Debug)]
pub struct ShapeRays8 {
    /// Vertices that the rays left, world space; distances count from here.
    pub p: Vec3x8,
    /// Unit directions.
    pub d: Vec3x8,
    /// Distances up to which lights were looked for before; 0 at first.
    pub after: F32x8,
    /// Distances up to which they are looked for; infinity is allowed.
    pub upto: F32x8,
    /// Lanes with a ray.
    pub mask: Mask8,
    /// Lanes whose ray comes from the camera.
    pub camera: Mask8,
}

impl ShapeRays8 {
    /// `t` and what its rounding may take away: a light in the plane of a surface is in front of it.
    #[inline(always)]
    fn reach(&self, t: F32x8) -> F32x8 {
        t + (t + self.p.abs().max_component()) * OFFSET_BOUND
    }

    /// Lanes that meet a light, and where.
    #[inline(always)]
    fn meet(&self, light: &Light) -> (Mask8, F32x8) {
        let t = match LightKind::from_u32(light.kind) {
            Some(LightKind::Sphere) => Sphere::read(light).meet(self.p, self.d),
            Some(LightKind::Rectangle) => Rectangle::read(light).meet(self.p, self.d),
            Some(LightKind::Disk) => Disk::read(light).meet(self.p, self.d),
            _ => F32x8::INFINITY,
        };
        let from = self.after.gt(F32x8::ZERO).zero_unless(self.reach(self.after));
        let met = self.mask & t.is_finite() & t.gt(from) & t.le(self.reach(self.upto));
        (if light.triangle & SHAPE_HIDDEN != 0 { met.and_not(self.camera) } else { met }, t)
    }
}

/// Lights with shapes and their indices.
fn shapes<'s>(scene: &Scene<'s>) -> impl Iterator<Item = (u32, &'s Light)> {
    let has_shape = |l: &Light| LightKind::from_u32(l.kind).is_some_and(LightKind::has_shape);
    let last_first = scene.lights.iter().enumerate().rev();
    last_first.take_while(move |(_, l)| has_shape(l)).map(|(i, l)| (i as u32, l))
}

/// Distances of the nearest lights with shapes; infinity where there is none.
#[inline(never)]
pub fn nearest_shape(scene: &Scene<'_>, rays: &ShapeRays8) -> F32x8 {
    shapes(scene).fold(F32x8::INFINITY, |nearest, (_, light)| {
        let (met, t) = rays.meet(light);
        nearest.min(met.select(t, F32x8::INFINITY))
    })
}

/// Calls `met(lanes, radiance, pdf)` for each light with a shape that rays meet. `pdf` is the density with which
/// [`super::sample_of`] at `p` with normals `n` chooses the direction to it: selection probability times solid-angle
/// density, in the lanes of `sampled`; 0 where the sampler gives up.
pub fn meet_shapes<S: LightSelector>(
    scene: &Scene<'_>,
    selector: &S,
    rays: &ShapeRays8,
    n: Vec3x8,
    sampled: Mask8,
    mut met: impl FnMut(Mask8, Vec3x8, F32x8),
) {
    for (index, light) in shapes(scene) {
        let (lanes, t) = rays.meet(light);
        if lanes.none() {
            continue;
        }
        let [r, g, b] = light.emission;
        let weighted = lanes & sampled;
        let mut pdf = F32x8::ZERO;
        if weighted.any() {
            let density = match LightKind::from_u32(light.kind) {
                Some(LightKind::Sphere) => Sphere::read(light).density(rays.p, t),
                Some(LightKind::Rectangle) => Rectangle::read(light).density(rays.p, t),
                Some(LightKind::Disk) => Disk::read(light).density(rays.p, t),
                _ => F32x8::ZERO,
            };
            let density = density * selector.probability(rays.p, n, U32x8::splat(index), weighted);
            pdf = (weighted & usable(density)).zero_unless(density);
        }
        met(lanes, Vec3x8::splat(r, g, b), pdf);
    }
}
