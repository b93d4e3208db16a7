//! Light paths: what path guiding learns from before camera paths have found any light. They begin at lights, and note at
//! every vertex from where how much power arrives. What light does behind glass or water is found at once so, while camera
//! paths hardly ever find it (Jensen, "Importance Driven Path Tracing using the Photon Map", 1995; Vorba et al., "On-line
//! Learning of Parametric Mixture Models for Light Transport Simulation", 2014). They count in no pixel.
//!
//! A packet of eight goes from the lights to the ends of its paths in one turn. Power that arrives straight from a light is
//! not noted: light samples find it. Nor is what no camera path finds: the light of points, cones and the sun (`sun.rs`)
//! behind mirrors and smooth glass. Roulette goes by what surfaces absorb.
//!
//! What is noted need not be exact, since it decides how directions are sampled, not what they count. So surfaces are where
//! they are when the shutter opens, lights within media are taken to be in those of the camera, and flights through media
//! that take too many steps end. Refraction has the weights of radiance: within glass fewer paths are left, by the squared
//! index, and have more power when they leave it.

use super::book::Bookkeeping;
use super::class::{Kernel, PacketClass};
use super::crossing::across;
use super::guide_notes::GuideNote8;
use super::guided::wide_lobes;
use super::job::Job;
use super::ledger::NO_RECORD;
use super::media_set::MediaSet8;
use super::medium::{Collision8, arrive_in_media};
use super::packets::{RayState8, Samples8};
use super::path::Path8;
use super::scatter::scatter;
use super::shading::{Arrival8, may_pass, shade};
use super::surfaces::{own_surfaces, places};
use crate::cost::MEDIUM_STEPS_PER_RAY;
use crate::counters::Counters;
use crate::geometry::{self, Hit8, Ray8, SurfaceHit8};
use crate::learn::guiding::{Guide, GuideLog, sphere};
use crate::light::{LightSelector, emission_of};
use crate::media::{self, Segment8};
use crate::rng::Key8;
use crate::sampler::{Numbers8, Sampler};
use crate::scene::Effects;
use crate::tiles::Tiles;
use crate::world::World;
use core::f32::consts::{FRAC_1_PI, PI};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Pixels for each light path. With two, short renders of scenes that are not guided take up to 1.1 times the work
/// (benches/EFFICIENCY.md).
const PIXELS: u64 = 4;
/// Fewest light paths of a picture, unless that is more than one for two pixels: with half as many `pool` misses what they
/// have to find.
const FEWEST: u64 = 8192;

/// Arrivals of power after which no more light paths begin: each shard has an equal part of them. Caustics lose by fewer, more
/// gain nothing.
const ENOUGH: u32 = 4096;

/// Most rays of a light path.
const MOST_RAYS: u32 = 32;

/// What is added to the seed, so that light paths have numbers of their own.
const SEED: u64 = 0x6c69_6768_7470_6174;

// dimension blocks and children of the keys of light paths
const LIGHT_BLOCK: u32 = 0;
const DIRECTION_BLOCK: u32 = 1;
const ROULETTE_BLOCK: u32 = 2;
const FIRST_RAY: u32 = 0;
const SAMPLE: u32 = 1;
const NEXT_RAY: u32 = 2;

/// Packets of light paths of shard `index`.
pub(super) fn packets_of(tiles: &Tiles, index: u32) -> u32 {
    let pixels = tiles.pixels().max(1);
    let paths = (pixels / PIXELS).max(FEWEST.min(2 * pixels / PIXELS)).max(1);
    // a picture has less than 2^32 pixels
    // and compilers do not see that they are not 0 times 8
    let packets = (tiles.pixels_of(index) as u64 * paths).div_ceil((8 * pixels).max(1));
    u32::try_from(packets).unwrap_or(u32::MAX)
}

/// The next light paths of shard `index`, of which so many packets are left.
#[inline(never)]
pub(super) fn trace_light_paths<W: World>(
    world: &W,
    job: &Job,
    index: u32,
    book: &mut Bookkeeping<'_>,
    left: &mut u32,
) {
    let enough = ENOUGH.div_ceil(job.settings.shards.max(1));
    let Some((guide, log)) =
        world.learned().guide().zip(book.guide.log_mut()).filter(|(_, log)| log.offered() < enough)
    else {
        *left = 0;
        return;
    };
    *left = left.saturating_sub(1);
    let number = U32x8::from_fn(|i| left.wrapping_mul(8).wrapping_add(i as u32));
    let (mut rays, delta) = emitted(world, Key8::camera(job.settings.seed ^ SEED, U32x8::splat(index), number));
    if rays.active.none() {
        // no light emits: packets without a ray would take no budget
        *left = 0;
    }
    let mut noted = Mask8::NONE;
    for _ in 0..MOST_RAYS {
        if rays.active.none() {
            return;
        }
        let (arrival, mut next) = arrive(world, &mut book.counters, &mut rays);
        let scattered = scatter_all(world, (guide, log), &rays, &arrival, &mut next, noted);
        // what scatters in one direction alone hides lights that no ray hits from light samples
        noted |= scattered.and_not(delta & next.skip_mis);
        survive(&rays, &mut next);
        rays = next;
    }
}

/// Rays that leave the lights, and the lanes whose light no camera path hits.
fn emitted<W: World>(world: &W, key: Key8) -> (RayState8, Mask8) {
    let words = [LIGHT_BLOCK, DIRECTION_BLOCK].map(|block| key.words(block));
    // by power: a tree leaves out lights that the middle of the scene does not see
    let lights = world.lights().without_tree();
    let e = emission_of(W::EFFECTS, world.scene(), &lights, words, Mask8::all_lanes());
    let media = if W::EFFECTS.contains(Effects::MEDIA) {
        MediaSet8::splat(world.camera_media()).select(e.infinite, MediaSet8::NONE)
    } else {
        MediaSet8::NONE
    };
    let rays = RayState8 {
        active: e.valid,
        ray: Ray8::unbounded(e.o, e.d),
        from: e.o,
        normal: Vec3x8::ZERO,
        travelled: F32x8::ZERO,
        media,
        beta: e.power,
        weight: e.power,
        pdf: F32x8::ONE,
        skip_mis: Mask8::all_lanes(),
        path: Path8 { root: U32x8::splat(0), record: U32x8::splat(NO_RECORD), depth: U32x8::splat(1) },
        key: key.child(U32x8::splat(FIRST_RAY)),
        albedo_product: F32x8::ONE,
        error_weight: Vec3x8::ZERO,
    };
    (rays, e.delta)
}

/// Where rays arrive, and those that go straight on there. Those that media end are taken out of `rays`.
fn arrive<W: World>(world: &W, counters: &mut Counters, rays: &mut RayState8) -> (Arrival8, RayState8) {
    let scene = world.scene();
    let n = rays.active.count();
    counters.light_path_rays += u64::from(n);
    counters.trace.count(n);
    let mut traced = world.closest(&rays.ray, rays.active);
    traced.hit &= rays.active;
    let in_media = W::EFFECTS.contains(Effects::MEDIA) && (rays.active & rays.media.inside()).any();
    let collision = if in_media { fly(world, counters, rays, &mut traced) } else { Collision8::NONE };
    let mut hit = SurfaceHit8::gather(scene, &traced);
    let mut point = if places::<W>(scene) { hit.place(scene, rays.ray.time) } else { hit.point() };
    let own = own_surfaces(world.intersector(), &rays.ray, &mut traced, &mut hit, &mut point);
    let mut a = shade(world, rays, &hit, &point, own.as_ref());
    let mut next = *rays;
    next.active = Mask8::NONE;
    if may_pass::<W>(scene) {
        let (v, d) = (&a.vertex, rays.ray.d);
        let passed = hit.mask & rays.key.straight().lt(a.straight);
        let on = RayState8 {
            active: passed,
            ray: Ray8::unbounded(geometry::offset(v.p, v.ng, v.error, d), d),
            media: across(world, rays.media, &hit, v.ng, d, passed),
            key: rays.key.straight_on(Sampler::Hashed),
            ..*rays
        };
        next.take(passed, &on);
        a.active = a.active.and_not(passed);
    }
    if W::EFFECTS.contains(Effects::MEDIA) && collision.mask.any() {
        arrive_in_media(rays, &collision, &mut a);
    }
    (a, next)
}

/// Sends rays through the media that they are inside of, as `medium.rs` does; collisions are taken out of `hit`.
fn fly<W: World>(world: &W, counters: &mut Counters, rays: &mut RayState8, hit: &mut Hit8) -> Collision8 {
    let inside = rays.active & rays.media.inside();
    let medium = rays.media.met();
    let segment = Segment8 { o: rays.ray.o, d: rays.ray.d, tmax: hit.hit.select(hit.t, rays.ray.tmax) };
    let numbers = Numbers8::hashed(rays.key);
    let f = media::fly(W::EFFECTS, world.scene(), medium, &segment, rays.beta, numbers, inside);
    counters.light_path_rays += u64::from(f.steps).div_ceil(MEDIUM_STEPS_PER_RAY);
    rays.beta = Vec3x8::select(inside, rays.beta * f.weight, rays.beta);
    let on = (f.collided | f.passed) & rays.beta.any_positive() & rays.beta.is_finite();
    rays.active = rays.active.and_not(inside.and_not(on));
    let mask = rays.active & inside & f.collided;
    hit.hit &= rays.active.and_not(mask);
    Collision8 { mask, t: f.t, albedo: f.albedo, medium }
}

/// Notes what has arrived at the vertices of `a` in the lanes of `noted`, and scatters it into `next`, class by class. The
/// lanes that have scattered.
fn scatter_all<W: World>(
    world: &W,
    (guide, log): (&Guide<'_>, &mut GuideLog<'_>),
    rays: &RayState8,
    a: &Arrival8,
    next: &mut RayState8,
    noted: Mask8,
) -> Mask8 {
    let mut left = a.active;
    while let Some(first) = left.lanes().next() {
        let kind = a.kind[first & 7];
        let lanes = Mask8::from_bits(left.lanes().filter(|&i| a.kind[i] == kind).fold(0, |m, i| m | 1 << i));
        left = left.and_not(lanes);
        let Some(class) = PacketClass::of_kind(kind) else { continue };
        if !class.is_delta() {
            note(world, (guide, &mut *log), rays, a, class.kernel(), lanes & noted);
        }
        let samples = Samples8 {
            vertex: a.vertex,
            active: lanes,
            continues: lanes,
            class,
            with_nee: false,
            path: a.vertex.path,
            key: a.vertex.key.child(U32x8::splat(SAMPLE)),
            time: F32x8::ZERO,
            guided: Mask8::NONE,
        };
        let mut note = GuideNote8::NONE;
        let out = scatter(world, &samples, None, &mut note);
        next.take(lanes, &out.rays);
    }
    a.active
}

/// Notes the power of `rays` that has arrived in `lanes`, all of one kernel.
fn note<W: World>(
    world: &W,
    (guide, log): (&Guide<'_>, &mut GuideLog<'_>),
    rays: &RayState8,
    a: &Arrival8,
    kernel: Kernel,
    lanes: Mask8,
) {
    if lanes.none() {
        return;
    }
    let v = &a.vertex;
    let lanes = lanes & wide_lobes::<W>(world.scene(), kernel, v.material);
    let surface = matches!(kernel, Kernel::Surface(_));
    let place = guide.place(v.p, surface.then_some(v.ns));
    // what the BSDF of a diffuse surface, or an isotropic phase function, would sample the direction with
    let pdf = if surface { v.wo.dot(v.ns).abs() * FRAC_1_PI } else { F32x8::splat(0.25 / PI) };
    let (point, power) = (sphere::quantised(v.wo), rays.beta.mean());
    for i in lanes.lanes() {
        log.add_light(place.lane(i), point.lane(i), power.lane(i), pdf.lane(i));
    }
}

/// Roulette: rays survive with the share of the luminance that they have left, and have all of it then.
fn survive(before: &RayState8, next: &mut RayState8) {
    let share = (next.beta.luminance() / before.beta.luminance()).min(F32x8::ONE);
    let [u, ..] = next.key.uniforms(ROULETTE_BLOCK);
    next.active &= u.lt(share);
    next.beta = next.beta / share.max(F32x8::splat(f32::MIN_POSITIVE));
    next.active &= next.beta.is_finite();
    next.key = next.key.child(U32x8::splat(NEXT_RAY));
}

impl RayState8 {
    /// Takes over where the rays are in the lanes of `mask`, which way they go, what they carry, how they were scattered, and
    /// their keys.
    fn take(&mut self, mask: Mask8, o: &Self) {
        self.active = (mask & o.active) | self.active.and_not(mask);
        self.ray.o = Vec3x8::select(mask, o.ray.o, self.ray.o);
        self.ray.d = Vec3x8::select(mask, o.ray.d, self.ray.d);
        self.beta = Vec3x8::select(mask, o.beta, self.beta);
        self.skip_mis = (mask & o.skip_mis) | self.skip_mis.and_not(mask);
        self.media = self.media.select(mask, o.media);
        self.key.lo = U32x8::select(mask, o.key.lo, self.key.lo);
        self.key.hi = U32x8::select(mask, o.key.hi, self.key.hi);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: as many paths for each pixel of every picture, small pictures with more paths than pixels, a product that
    /// overflows, shards that do not share the paths.
    #[test]
    fn small_pictures_have_as_many_light_paths() {
        for (size, paths) in [
            ([16, 16], 128),
            ([64, 64], 2048),
            ([128, 128], 8192),
            ([176, 160], 8192),
            ([256, 256], 16_384),
            ([32_768, 32_768], 1 << 28),
        ] {
            for shards in [1, 16] {
                let tiles = Tiles::new(size, shards);
                let all: u64 = (0..shards).map(|i| 8 * u64::from(packets_of(&tiles, i))).sum();
                assert!((paths..paths + 8 * u64::from(shards)).contains(&all), "{size:?}, {shards} shards: {all}");
            }
        }
    }
}
