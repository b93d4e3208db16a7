//! Camera samples that begin at points of surfaces, in place of rays: each is a white diffuse vertex, whatever the surface
//! is made of.

use super::camera_rays::{CameraSamples8, camera_media, camera_samples};
use super::first_surfaces::first_surfaces;
use super::job::Job;
use super::roulette::roulette;
use super::settle::settle;
use super::shading::{Arrival8, interpolated_normals};
use super::state::State;
use super::surfaces::places;
use super::vertex::PathVertex8;
use crate::cost::COST_CAMERA;
use crate::extension::Extension;
use crate::geometry::{Hit8, SurfaceHit8};
use crate::learn::cache::NO_BIN;
use crate::scene::blob::MaterialKind;
use crate::world::World;
use croupier_simd::{F32x8, U32x8, Vec3x8};

/// Up to eight camera samples of shard `index`, from the extension's points to the ring.
#[inline(never)]
pub(super) fn begin_at_points<W: World>(world: &W, job: &Job, index: u32, state: &mut State<'_>) {
    let State { cursor, ring, book, comb, .. } = state;
    let settings = &job.settings;
    let samples = camera_samples(world, job, index, cursor, book);
    let path = &samples.path;
    let (mut arrival, traced, hit) = arrive(world, &samples);
    let first = arrival.active;
    book.counters.camera_rays += samples.count;
    book.charge(first, path, COST_CAMERA);
    if book.wants_first_hits() && first.any() {
        let good = book.record_first_hit(first, path, F32x8::ZERO, arrival.vertex.ns, Vec3x8::ONE);
        if book.wants_surfaces() {
            let found = first_surfaces(world, settings.size, (&traced, &hit, None), good, false);
            book.record_surfaces(good, path, &found);
        }
    }
    arrival.active &= path.depth.lt(U32x8::splat(world.max_depth()));
    book.count_longest(settings, first.and_not(arrival.active));
    book.close_lanes::<W>(samples.asked.and_not(arrival.active), path);
    if arrival.active.none() {
        return;
    }
    if settings.strategy.needs_albedo() {
        arrival.albedo = Vec3x8::ONE;
    }
    let decision = roulette(world, settings, book, comb, ring.free(), &mut arrival);
    settle::<W>(book, ring, &arrival, &decision);
    book.counters.ring_peak = book.counters.ring_peak.max(ring.waiting() as u64);
}

/// White diffuse vertices at the extension's points, seen along their shading normals. Lanes whose numbers cannot be used
/// are not active. With the hits that rays at the points would have.
fn arrive<W: World>(world: &W, samples: &CameraSamples8) -> (Arrival8, Hit8, SurfaceHit8) {
    let scene = world.scene();
    let points = world.extension().points(scene, &samples.pixels);
    let [u, v] = points.weights;
    let known = points.triangle.lt(U32x8::splat(scene.triangles.len() as u32));
    let finite = u.is_finite() & v.is_finite() & points.scale.is_finite();
    let active = samples.asked & points.active & known & finite;
    let traced = Hit8 { hit: active, t: F32x8::ZERO, triangle: points.triangle, u, v, instance: points.instance };
    let mut hit = SurfaceHit8::gather(scene, &traced);
    let point = if places::<W>(scene) { hit.place(scene, samples.time) } else { hit.point() };
    let ns = interpolated_normals::<W>(scene, &hit, point.ng);
    // a normal that looks behind the surface is none of its front
    let ns = Vec3x8::select(ns.dot(point.ng).gt(F32x8::ZERO), ns, point.ng);
    let arrival = Arrival8 {
        vertex: PathVertex8 {
            p: point.p,
            error: point.error,
            ng: point.ng,
            ns,
            wo: ns,
            beta: points.scale,
            reflectance: Vec3x8::ONE,
            material: U32x8::new(hit.material),
            media: camera_media(world),
            path: samples.path,
            key: samples.key,
            albedo_product: F32x8::ONE,
            samples: U32x8::splat(0),
            nee_probability: F32x8::ONE,
            bin: U32x8::splat(NO_BIN),
            error_weight: samples.error_weight,
        },
        active,
        kind: [MaterialKind::LAMBERTIAN as u32; 8],
        straight: F32x8::ZERO,
        weight: points.scale,
        albedo: Vec3x8::ZERO,
    };
    (arrival, traced, hit)
}
