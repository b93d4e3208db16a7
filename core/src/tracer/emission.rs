//! Emission that rays meet, weighted against the light sample that could have found it.

use super::packets::{Contribution8, Emission8, RayState8};
use crate::geometry::SurfaceHit8;
use crate::light::{self, LightSelector, ShapeRays8, TEXTURED_EMISSION, power_heuristic};
use crate::scene::{Effects, Scene};
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Radiance of the environment along the rays that `escaped`; `None` without one.
#[inline(always)]
pub(crate) fn environment<W: World>(world: &W, rays: &RayState8, escaped: Mask8) -> Option<Emission8> {
    let scene = world.scene();
    let any = Effects::ENVIRONMENT.with(Effects::CONSTANT);
    if !W::EFFECTS.intersects(any) || scene.environment.is_none() {
        return None;
    }
    let (at, d) = ([rays.from, rays.normal], rays.ray.d);
    let (radiance, pdf) = if W::LIGHT_TREES {
        light::environment_met(scene, world.lights(), at, d, escaped)
    } else {
        light::environment_met(scene, &world.lights().without_tree(), at, d, escaped)
    };
    Some(weighted(rays, radiance, pdf))
}

/// Radiance of the hit emitters, in the lanes of [`SurfaceHit8::emitters`]; `ng` are the normals by winding. `None` if
/// there is no emitter.
#[inline(always)]
pub(crate) fn area<W: World>(world: &W, rays: &RayState8, hit: &SurfaceHit8, ng: Vec3x8) -> Option<Emission8> {
    let emitters = hit.emitters();
    if !W::EFFECTS.contains(Effects::AREA_LIGHTS) || emitters.none() {
        return None;
    }
    let scene = world.scene();
    let mut radiance = light::area_radiance(scene, hit, rays.ray.d, ng, emitters);
    if W::EFFECTS.contains(TEXTURED_EMISSION) && scene.effects.contains(TEXTURED_EMISSION) {
        radiance *= light::area_texture(scene, hit, emitters);
    }
    let sampled = emitters.and_not(rays.skip_mis);
    if sampled.none() {
        return Some(counted(rays, radiance, F32x8::ONE));
    }
    let (from, n, d) = (rays.from, rays.normal, rays.ray.d);
    let pdf = if W::LIGHT_TREES {
        light::area_pdf(scene, world.lights(), from, n, hit, d, sampled)
    } else {
        light::area_pdf(scene, &world.lights().without_tree(), from, n, hit, d, sampled)
    };
    Some(weighted(rays, radiance, pdf))
}

/// Does the scene have lights with shapes, which rays meet without a hit?
#[inline(always)]
pub(crate) fn has_shapes<W: World>(scene: &Scene<'_>) -> bool {
    W::EFFECTS.contains(Effects::SHAPE_LIGHTS) && scene.effects.contains(Effects::SHAPE_LIGHTS)
}

/// The part of the rays in `mask` that ends at the distance `upto` from their last vertices.
#[inline(always)]
fn part(rays: &RayState8, upto: F32x8, mask: Mask8) -> ShapeRays8 {
    let camera = rays.path.depth.eq(U32x8::splat(1));
    ShapeRays8 { p: rays.from, d: rays.ray.d, after: rays.travelled, upto, mask, camera }
}

/// Distance, from the vertices that the rays in `mask` left, to the nearest light with a shape on their parts up to
/// `upto`; infinity where there is none.
#[inline(always)]
pub(crate) fn nearest_shape<W: World>(world: &W, rays: &RayState8, upto: F32x8, mask: Mask8) -> F32x8 {
    light::nearest_shape(world.scene(), &part(rays, upto, mask))
}

/// Radiance of all lights with shapes that the rays in `mask` meet on their parts up to `upto`.
#[inline(never)]
pub(crate) fn shapes<W: World>(world: &W, rays: &RayState8, upto: F32x8, mask: Mask8) -> Emission8 {
    let (mut sum, mut all) = (Vec3x8::ZERO, F32x8::ZERO);
    let part = part(rays, upto, mask);
    let met = |met: Mask8, radiance: Vec3x8, pdf: F32x8| {
        let weight = rays.skip_mis.select(F32x8::ONE, power_heuristic(rays.pdf, pdf));
        sum += radiance * met.zero_unless(weight);
        if W::GUIDING {
            all += met.zero_unless(radiance.mean());
        }
    };
    let (scene, n, sampled) = (world.scene(), rays.normal, !rays.skip_mis);
    if W::LIGHT_TREES {
        light::meet_shapes(scene, world.lights(), &part, n, sampled, met);
    } else {
        light::meet_shapes(scene, &world.lights().without_tree(), &part, n, sampled, met);
    }
    let weight = if W::GUIDING { all.gt(F32x8::ZERO).select(sum.mean() / all, F32x8::ONE) } else { F32x8::ONE };
    Emission8 { weight, ..counted(rays, sum, F32x8::ONE) }
}

/// `radiance` times the MIS weight of rays whose directions light sampling has with density `pdf`.
#[inline(always)]
fn weighted(rays: &RayState8, radiance: Vec3x8, pdf: F32x8) -> Emission8 {
    counted(rays, radiance, rays.skip_mis.select(F32x8::ONE, power_heuristic(rays.pdf, pdf)))
}

/// `radiance` times a weight.
#[inline(always)]
fn counted(rays: &RayState8, radiance: Vec3x8, weight: F32x8) -> Emission8 {
    let found = Contribution8 { pixel: rays.beta * radiance * weight, local: rays.weight * radiance * weight };
    Emission8 { found, weight }
}
