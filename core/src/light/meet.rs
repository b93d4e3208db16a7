//! Rays that meet lights with shapes (`shape.rs`).
//!
//! A ray may be traced in pieces, because it passes things straight on. Whether it meets a light is decided from the point
//! where it left its last vertex, for the whole ray; a piece takes the lights whose distance from there lies in its part, and
//! the parts leave no gap and have no overlap.

use super::shape::Shape;
use super::{LightSelector, usable};
use super::{disk::Disk, rectangle::Rectangle, sphere::Sphere};
use crate::geometry::OFFSET_BOUND;
use crate::scene::Scene;
use crate::scene::blob::{Light, LightKind, SHAPE_HIDDEN};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

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
