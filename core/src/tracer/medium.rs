//! Stage `medium`: what befalls rays on their way through media, before they reach the surfaces that they hit.

use super::book::{Beyond, Bookkeeping};
use super::class::PHASE_KIND;
use super::emission;
use super::packets::{Contribution8, RayState8};
use super::passing::wait;
use super::ring::Ring;
use super::shading::Arrival8;
use crate::geometry::Hit8;
use crate::media::{self, Segment8};
use crate::sampler::Numbers8;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Scattering in media.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Collision8 {
    /// Lanes that scatter.
    pub mask: Mask8,
    /// Where.
    pub t: F32x8,
    /// Single-scattering albedo there.
    pub albedo: Vec3x8,
    /// Index of the medium.
    pub medium: U32x8,
}

impl Collision8 {
    /// No lane scatters in a medium.
    pub(crate) const NONE: Self =
        Self { mask: Mask8::NONE, t: F32x8::ZERO, albedo: Vec3x8::ZERO, medium: U32x8::splat(0) };
}

/// Sends the rays through the media that they are inside of. What the media emit is added; rays that scatter, end or stop
/// on the way do not reach their hits: they are taken out of `hit`, and those that end or wait out of `rays`.
///
/// `light` are the distances, from the vertices that the rays left, of the nearest lights with shapes; infinity without
/// one. A flight ends there, so that the light counts if the ray survives to it, and goes on from there as a waiting ray.
#[inline(never)]
pub(crate) fn cross_media<W: World>(
    world: &W,
    book: &mut Bookkeeping<'_>,
    ring: &mut Ring<'_>,
    rays: &mut RayState8,
    hit: &mut Hit8,
    light: F32x8,
) -> Collision8 {
    let inside = rays.active & rays.media.inside();
    let medium = rays.media.met();
    let end = hit.hit.select(hit.t, rays.ray.tmax);
    let stops = light.lt(rays.travelled + end);
    let tmax = stops.select(F32x8::ZERO.max(light - rays.travelled), end);
    let segment = Segment8 { o: rays.ray.o, d: rays.ray.d, tmax };
    let numbers = Numbers8 { sampler: world.sampler(), key: rays.key };
    let flight = media::fly(W::EFFECTS, world.scene(), medium, &segment, rays.beta, numbers, inside);
    book.charge_medium(inside, &rays.path, flight.steps, flight.roulettes);
    let found = Contribution8 { pixel: rays.beta * flight.emitted, local: rays.weight * flight.emitted };
    book.accumulate(inside, &rays.path, &found, Beyond::Ray);
    rays.beta = Vec3x8::select(inside, rays.beta * flight.weight, rays.beta);
    rays.weight = Vec3x8::select(inside, rays.weight * flight.weight, rays.weight);
    let goes_on = rays.beta.any_positive() & rays.beta.is_finite();
    book.break_lanes(inside.and_not(rays.beta.is_finite()), &rays.path);
    let reached = inside & flight.passed & goes_on & light.is_finite();
    let stopped = reached & stops;
    if reached.any() {
        let found = emission::shapes(world, rays, stops.select(light, rays.travelled + end), reached);
        book.accumulate_emission::<W>(reached, &rays.path, &found);
        wait(ring, rays, stopped, (rays.ray.o + rays.ray.d * tmax, light, rays.media), world.sampler());
    }
    let unfinished = inside & flight.unfinished & goes_on;
    if unfinished.any() {
        let o = rays.ray.o + rays.ray.d * flight.t;
        wait(ring, rays, unfinished, (o, rays.travelled + flight.t, rays.media), world.sampler());
    }
    let ended = inside.and_not((flight.collided | flight.passed | flight.unfinished) & goes_on);
    book.close_lanes::<W>(ended, &rays.path);
    rays.active = rays.active.and_not(ended | unfinished | stopped);
    let mask = inside & flight.collided & goes_on;
    hit.hit &= rays.active.and_not(mask);
    Collision8 { mask, t: flight.t, albedo: flight.albedo, medium }
}

/// Puts vertices in media where `c` has collisions: they have no normal, and the frame of the phase function is `wo`.
#[inline(never)]
pub(crate) fn arrive_in_media(rays: &RayState8, c: &Collision8, a: &mut Arrival8) {
    let (on, v, wo) = (c.mask, &mut a.vertex, -rays.ray.d);
    v.p = Vec3x8::select(on, rays.ray.o + rays.ray.d * c.t, v.p);
    v.error = on.select(F32x8::ZERO, v.error);
    v.ng = Vec3x8::select(on, Vec3x8::ZERO, v.ng);
    v.ns = Vec3x8::select(on, wo, v.ns);
    v.reflectance = Vec3x8::select(on, c.albedo, v.reflectance);
    v.material = U32x8::select(on, c.medium, v.material);
    a.straight = on.select(F32x8::ZERO, a.straight);
    a.active |= on;
    on.lanes().for_each(|i| a.kind[i] = PHASE_KIND);
}
