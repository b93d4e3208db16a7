//! Every stage by itself, on packets made by hand in the scene of [`crate::testing`].

extern crate std;

use super::book::Beyond;
use super::cache_key::cache_lookup;
use super::camera_rays::{CameraCursor, camera_rays};
use super::class::PacketClass;
use super::emission;
use super::first_surfaces::FirstSurfaces8;
use super::guide_notes::GuideNote8;
use super::ledger::NO_RECORD;
use super::media_set::MediaSet8;
use super::nee::{sample_lights, shadow_rays};
use super::occlude::occlude;
use super::packets::{Contribution8, RayKind, RayState8, Samples8, ShadowRays8};
use super::path::Path8;
use super::refill::{Refill, refill, samples};
use super::root::PixelTarget;
use super::roulette::{Decision8, roulette};
use super::scatter::scatter;
use super::settle::settle;
use super::shading::{Arrival8, albedo, shade};
use super::shard::Shard;
use super::state::State;
use super::trace::trace;
use super::vertex::PathVertex8;
use crate::film::{Aov, AovSet};
use crate::geometry::{Ray8, SurfaceHit8};
use crate::learn::cache::NO_BIN;
use crate::light::power_heuristic;
use crate::rng::Key8;
use crate::rrs::{Space, Strategy};
use crate::scene::blob::{MaterialKind, NONE};
use crate::settings::Settings;
use crate::testing::{EMISSION, ENVIRONMENT, FLOOR, TestWorld, world};
use crate::world::World;
use core::f32::consts::PI;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Floor, floor, floor (smooth), floor from below, emitter, emitter from behind, mirror, nothing.
const ORIGINS: [[f32; 3]; 8] = [
    [0.25, 0.25, 0.5],
    [0.125, 0.25, 0.5],
    [0.75, 0.75, 0.5],
    [0.25, 0.25, -0.5],
    [0.25, 0.25, 0.5],
    [0.25, 0.25, 1.5],
    [0.5, 0.25, 0.25],
    [0.5, 0.25, 0.25],
];
const DIRECTIONS: [[f32; 3]; 8] = [
    [0.0, 0.0, -1.0],
    [0.0, 0.0, -1.0],
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
];

fn strategy(name: &str) -> impl FnOnce(&mut Settings) {
    move |s| s.strategy = Strategy::parse(name).expect("a strategy")
}

/// A camera sample per lane, of pixel `i`.
fn paths(shard: &mut Shard<'_>, depth: u32) -> Path8 {
    let root = U32x8::from_fn(|i| {
        shard.state.book.begin_pixel(i as u32);
        let target = PixelTarget::numbered([1.0; 3], 1.0, i as u32, i as u32, 0);
        shard.state.book.open_camera_sample(target, false).expect("a root").0
    });
    Path8 { root, record: U32x8::splat(NO_RECORD), depth: U32x8::splat(depth) }
}

fn rays(shard: &mut Shard<'_>) -> RayState8 {
    let (o, d) = (Vec3x8::from_fn(|i| ORIGINS[i]), Vec3x8::from_fn(|i| DIRECTIONS[i]));
    RayState8 {
        active: Mask8::all_lanes(),
        ray: Ray8::unbounded(o, d),
        from: o,
        normal: Vec3x8::ZERO,
        travelled: F32x8::ZERO,
        media: MediaSet8::NONE,
        beta: Vec3x8::splat(0.5, 1.0, 2.0),
        weight: Vec3x8::splat(1.0, 0.5, 0.25),
        pdf: F32x8::splat(0.25),
        skip_mis: Mask8::all_lanes(),
        path: paths(shard, 1),
        key: Key8::camera(3, U32x8::from_fn(|i| i as u32), U32x8::splat(0)),
        albedo_product: F32x8::ONE,
        error_weight: Vec3x8::ONE,
    }
}

fn arrive(world: &TestWorld<'_>, shard: &mut Shard<'_>, depth: u32) -> (RayState8, SurfaceHit8, Arrival8) {
    let mut rays = rays(shard);
    rays.path.depth = U32x8::splat(depth);
    let hit = SurfaceHit8::gather(world.scene(), &trace(world, &mut shard.state.book, &rays, RayKind::Camera));
    let arrival = shade(world, &rays, &hit, &hit.point(), None);
    (rays, hit, arrival)
}

/// A vertex on the floor in every lane, seen along the normal.
fn floor(shard: &mut Shard<'_>) -> PathVertex8 {
    PathVertex8 {
        p: Vec3x8::splat(0.25, 0.25, 0.0),
        error: F32x8::splat(1e-6),
        ng: Vec3x8::splat(0.0, 0.0, 1.0),
        ns: Vec3x8::splat(0.0, 0.0, 1.0),
        wo: Vec3x8::splat(0.0, 0.0, 1.0),
        beta: Vec3x8::ONE,
        reflectance: Vec3x8::from_fn(|_| FLOOR),
        material: U32x8::splat(0),
        media: MediaSet8::NONE,
        path: paths(shard, 1),
        key: Key8::camera(5, U32x8::from_fn(|i| i as u32), U32x8::splat(1)),
        albedo_product: F32x8::ONE,
        samples: U32x8::splat(1),
        nee_probability: F32x8::ONE,
        bin: U32x8::splat(NO_BIN),
        error_weight: Vec3x8::ONE,
    }
}

fn floor_samples(shard: &mut Shard<'_>, kind: MaterialKind, with_nee: bool) -> Samples8 {
    let vertex = floor(shard);
    Samples8 {
        active: Mask8::all_lanes(),
        guided: Mask8::all_lanes(),
        continues: Mask8::all_lanes(),
        class: PacketClass::of_kind(kind as u32).expect("a class"),
        with_nee,
        path: vertex.path,
        key: vertex.key,
        vertex,
        time: F32x8::ZERO,
    }
}

fn close(found: f32, wanted: f32) {
    assert!((found - wanted).abs() <= 1e-5 * wanted.abs().max(1e-3), "{found}, not {wanted}");
}

/// Killed by: an empty ring that gives samples, camera samples while eight others wait, a packet of two queues, a
/// shard that never ends.
#[test]
fn refill_takes_what_waits_before_camera_samples() {
    world(
        |_| (),
        |world, shard| {
            assert!(matches!(
                refill(&shard.state.cursor, &mut shard.state.ring, &mut shard.state.book),
                Refill::Camera
            ));
            let mut v = floor(shard);
            v.samples = U32x8::new([8, 9, 1, 1, 1, 1, 1, 1]);
            let class = |kind| PacketClass::of_kind(kind as u32).expect("a class");
            let records = v.records();
            shard.state.ring.push(class(MaterialKind::Diffuse), records[0]);
            shard.state.ring.push(class(MaterialKind::Mirror), records[1]);
            let Refill::Samples(taken) = refill(&shard.state.cursor, &mut shard.state.ring, &mut shard.state.book)
            else {
                panic!("samples wait")
            };
            let s = samples(world, &shard.state.ring, &mut shard.state.book, &taken);
            assert_eq!((s.class, s.active.count(), s.with_nee), (class(MaterialKind::Mirror), 8, false));
            assert_eq!(s.path.root.to_array(), [v.path.root.lane(1); 8]);
            assert_eq!(shard.state.book.roots.get(v.path.root.lane(1)).open, 9, "eight lanes and the vertex");
            assert_eq!(shard.state.book.counters.vertex_samples, 8);
            assert!(s.continues.all() && s.key.lo.lane(0) != s.key.lo.lane(1));

            shard.state.cursor = CameraCursor::finished();
            let mut rest = 0;
            while let Refill::Samples(taken) = refill(&shard.state.cursor, &mut shard.state.ring, &mut shard.state.book)
            {
                rest += taken.lanes;
            }
            assert_eq!(rest, 9);
            assert!(matches!(refill(&shard.state.cursor, &mut shard.state.ring, &mut shard.state.book), Refill::Done));
        },
    );
}

/// Paths at their last depth scatter no more. Killed by: `<=`.
#[test]
fn samples_at_the_last_depth_do_not_continue() {
    world(
        |s| s.max_depth = 1,
        |world, shard| {
            let mut v = floor(shard);
            v.samples = U32x8::splat(2);
            shard.state.ring.push(PacketClass::of_kind(0).expect("a class"), v.records()[0]);
            shard.state.cursor = CameraCursor::finished();
            let Refill::Samples(taken) = refill(&shard.state.cursor, &mut shard.state.ring, &mut shard.state.book)
            else {
                panic!()
            };
            let s = samples(world, &shard.state.ring, &mut shard.state.book, &taken);
            assert_eq!((s.active.count(), s.continues.count()), (2, 0));
        },
    );
}

/// Killed by: samples that share a root, rays beside their pixel, a pixel with other than its four samples.
#[test]
fn camera_rays_go_through_their_pixels() {
    world(
        |_| (),
        |world, shard| {
            let Shard { job, state: State { cursor, book, .. }, .. } = shard;
            let mut samples = [0; 256];
            loop {
                let r = camera_rays(world, job, 0, cursor, book);
                if r.active.none() {
                    break;
                }
                let target = book.roots.targets(r.path.root, r.active).film;
                for i in r.active.lanes() {
                    let ([x, y, z], film) = (r.ray.d.lane(i), target.lane(i));
                    let at = [(x / -z / 0.125 + 1.0) * 8.0, (y / z / 0.125 + 1.0) * 8.0];
                    let pixel = [film % 16, film / 16].map(|p| p as f32);
                    assert!(
                        (0..2).all(|k| (pixel[k] - 1e-3..pixel[k] + 1.001).contains(&at[k])),
                        "{at:?} of {pixel:?}"
                    );
                    samples[film as usize] += 1;
                }
                assert!(r.skip_mis.all() && r.path.depth.to_array() == [1; 8]);
                book.close_lanes::<TestWorld<'_>>(r.active, &r.path);
            }
            assert_eq!(samples, [4; 256]);
            assert_eq!((book.counters.camera_rays, book.counters.camera_samples), (1024, 1024));
        },
    );
}

/// Killed by: light samples for delta lobes or for samples that skip them.
#[test]
fn only_samples_with_nee_draw_light_samples() {
    world(
        |_| (),
        |world, shard| {
            assert!(sample_lights(world, &floor_samples(shard, MaterialKind::Diffuse, true)).is_some());
            assert!(sample_lights(world, &floor_samples(shard, MaterialKind::Diffuse, false)).is_none());
            assert!(sample_lights(world, &floor_samples(shard, MaterialKind::Mirror, true)).is_none());
            let mut ended = floor_samples(shard, MaterialKind::Diffuse, true);
            ended.continues = Mask8::NONE;
            assert!(sample_lights(world, &ended).is_none());
        },
    );
}

/// What shadow rays bring: beta f L w / (p q), q the probability of drawing a light sample. Killed by: any of the
/// factors left out, a ray that ends beyond its light.
#[test]
fn shadow_rays_bring_weighted_radiance() {
    world(
        |_| (),
        |world, shard| {
            let mut s = floor_samples(shard, MaterialKind::Diffuse, true);
            s.vertex.nee_probability = F32x8::splat(0.5);
            s.vertex.beta = Vec3x8::splat(1.0, 2.0, 4.0);
            let l = sample_lights(world, &s).expect("light samples");
            let f = scatter(world, &s, Some(l.wi), &mut { GuideNote8::NONE }).nee;
            let rays = shadow_rays(world, &mut shard.state.book, &s, &l, &f, false).expect("rays");
            let (mut area, mut far) = (0, 0);
            for i in rays.active.lanes() {
                let cos = l.wi.lane(i)[2];
                let radiance = if l.infinite.lane(i) { ENVIRONMENT } else { EMISSION };
                let w = power_heuristic(l.pdf, F32x8::splat(cos / PI)).lane(i);
                for c in 0..3 {
                    let local = FLOOR[c] * cos / PI * radiance[c] * w / (l.pdf.lane(i) * 0.5);
                    close(rays.found.local.lane(i)[c], local);
                    close(rays.found.pixel.lane(i)[c], local * [1.0, 2.0, 4.0][c]);
                }
                let end = rays.ray.tmax.lane(i);
                assert!(if l.infinite.lane(i) { end == f32::INFINITY } else { end == 1.0 });
                (area, far) = (area + usize::from(!l.infinite.lane(i)), far + usize::from(l.infinite.lane(i)));
            }
            assert!(area > 0 && far > 0, "{area} to the emitter, {far} to the environment");
        },
    );
}

/// Killed by: rays that pass the floor, lanes that were not asked, a ray that costs nothing.
#[test]
fn occlusion_is_found_and_charged() {
    world(
        |_| (),
        |world, shard| {
            let path = paths(shard, 1);
            let d = Vec3x8::from_fn(|i| [0.0, 0.0, if i % 2 == 0 { -1.5 } else { 0.4 }]);
            let o = Vec3x8::splat(0.25, 0.25, 0.5);
            let ray = Ray8 { tmax: F32x8::ONE, ..Ray8::unbounded(o, d) };
            let found = Contribution8 { pixel: Vec3x8::ONE, local: Vec3x8::ONE };
            let active = Mask8::from_bits(0b0011_1111);
            let samples = Samples8 { path, ..floor_samples(shard, MaterialKind::Diffuse, true) };
            let mut s = ShadowRays8 { active, ray, path, found, towards: U32x8::splat(NO_BIN) };
            assert_eq!(occlude(world, &mut shard.state.book, &samples, &mut s).bits(), 0b0010_1010);
            let rays = path.root.to_array().map(|r| shard.state.book.roots.get(r).rays);
            assert_eq!(rays, [1, 1, 1, 1, 1, 1, 0, 0]);
            assert_eq!((shard.state.book.counters.shadow_rays, shard.state.book.counters.occlude.lanes), (6, 6));
        },
    );
}

/// Killed by: a density or weight of another model, directions below the surface, a depth that stays, lanes that go on
/// though they may not.
#[test]
fn scattering_samples_the_bsdf() {
    world(
        |_| (),
        |world, shard| {
            let mut s = floor_samples(shard, MaterialKind::Diffuse, false);
            s.continues = Mask8::from_bits(0b0111_1111);
            s.vertex.beta = Vec3x8::from_fn(|i| if i == 6 { [f32::INFINITY; 3] } else { [2.0; 3] });
            let up = Vec3x8::splat(0.0, 0.0, 1.0);
            let out = scatter(world, &s, Some(up), &mut { GuideNote8::NONE });
            assert_eq!((out.rays.active.bits(), out.broken.bits()), (0b0011_1111, 0b0100_0000));
            for i in 0..6 {
                let cos = out.rays.ray.d.lane(i)[2];
                assert!(cos > 0.0 && out.rays.ray.o.lane(i)[2] > 0.0);
                close(out.rays.pdf.lane(i), cos / PI);
                close(out.nee.pdf.lane(i), 1.0 / PI);
                for (c, rho) in FLOOR.into_iter().enumerate() {
                    close(out.rays.weight.lane(i)[c], rho);
                    close(out.rays.beta.lane(i)[c], 2.0 * rho);
                    close(out.nee.f.lane(i)[c], rho / PI);
                }
            }
            assert_eq!(out.rays.path.depth.to_array(), [2; 8]);
            assert!(out.rays.skip_mis.none());
            shard.state.book.break_lanes(out.broken, &s.path);
            assert_eq!((shard.state.book.counters.non_finite, shard.state.book.counters.first_non_finite), (1, 7));
        },
    );
}

/// Killed by: a hit in a lane without a ray, a ray that is not counted or not charged.
#[test]
fn rays_find_what_they_hit() {
    world(
        |_| (),
        |world, shard| {
            let mut r = rays(shard);
            r.active = Mask8::from_bits(0b1111_1101);
            let hit = trace(world, &mut shard.state.book, &r, RayKind::Camera);
            assert_eq!(hit.hit.bits(), 0b0111_1101);
            assert_eq!(hit.triangle.to_array()[2..7], [1, 0, 2, 2, 3]);
            assert_eq!([0, 4, 5, 6].map(|i| hit.t.lane(i)), [0.5, 0.5, 0.5, 1.5]);
            let charged = r.path.root.to_array().map(|root| shard.state.book.roots.get(root).rays);
            assert_eq!(charged, [1, 0, 1, 1, 1, 1, 1, 1]);
            assert_eq!((shard.state.book.counters.trace.lanes, shard.state.book.counters.scatter_rays), (7, 0));
            trace(world, &mut shard.state.book, &r, RayKind::Scattered);
            assert_eq!(shard.state.book.counters.scatter_rays, 7);
        },
    );
}

/// Killed by: emission from behind, a weight in lanes that light samples cannot reach, none in others, a density
/// without the probability of choosing the light.
#[test]
fn emission_is_weighted_against_light_samples() {
    world(
        |_| (),
        |world, shard| {
            let mut r = rays(shard);
            let hit = SurfaceHit8::gather(world.scene(), &trace(world, &mut shard.state.book, &r, RayKind::Camera));
            let ng = hit.point().ng;
            let escaped = Mask8::from_bits(0b1000_0000);
            for skip_mis in [true, false] {
                r.skip_mis = if skip_mis { Mask8::all_lanes() } else { Mask8::NONE };
                let area = emission::area(world, &r, &hit, ng).expect("an emitter");
                let far = emission::environment(world, &r, escaped).expect("an environment");
                let weights = [area.weight.lane(4), far.weight.lane(7)];
                let (area, far) = (area.found, far.found);
                let weight = |other: f32| if skip_mis { 1.0 } else { 0.0625 / (0.0625 + other * other) };
                // r^2 / (A cos) and 1 / (4 pi), each chosen with probability 1/2
                let (w_area, w_far) = (weight(0.5 * 0.25 / 0.5), weight(0.5 * 0.25 / PI));
                close(weights[0], w_area);
                close(weights[1], w_far);
                for c in 0..3 {
                    let (beta, bounce) = ([0.5, 1.0, 2.0][c], [1.0, 0.5, 0.25][c]);
                    close(area.pixel.lane(4)[c], beta * EMISSION[c] * w_area);
                    close(area.local.lane(4)[c], bounce * EMISSION[c] * w_area);
                    close(far.pixel.lane(7)[c], beta * ENVIRONMENT[c] * w_far);
                    close(far.local.lane(7)[c], bounce * ENVIRONMENT[c] * w_far);
                    assert_eq!(area.pixel.lane(5)[c], 0.0, "emission from behind");
                }
            }
            assert_eq!(hit.emitters().bits(), 0b0011_0000);
        },
    );
}

/// Killed by: one-sided surfaces that scatter from behind, another lane's material, normals that are not interpolated.
#[test]
fn hits_become_vertices() {
    world(
        |_| (),
        |world, shard| {
            let (rays, hit, a) = arrive(world, shard, 1);
            assert_eq!(hit.smooth.bits(), 0b0000_0100);
            assert_eq!(a.active.bits(), 0b0101_0111, "front sides of floor, emitter and mirror");
            assert_eq!(a.vertex.material.to_array()[..7], [0, 0, 0, 0, 1, 1, 2]);
            let (diffuse, mirror) = (MaterialKind::Diffuse as u32, MaterialKind::Mirror as u32);
            assert_eq!(a.kind[..7], [diffuse, diffuse, diffuse, diffuse, diffuse, diffuse, mirror]);
            for i in [0, 1, 2] {
                assert_eq!((a.vertex.ns.lane(i), a.vertex.reflectance.lane(i)), ([0.0, 0.0, 1.0], FLOOR));
                assert_eq!(a.vertex.wo.lane(i), [-0.0, -0.0, 1.0]);
            }
            assert_eq!(a.vertex.p.lane(6), [2.0, 0.25, 0.25]);
            assert_eq!(a.weight.lane(0), rays.weight.lane(0));
            let albedo = albedo(world, &a, Mask8::from_bits(0b0100_0001));
            assert_eq!([0, 1, 6].map(|i| albedo.lane(i)), [FLOOR, [0.0; 3], [0.5; 3]]);
        },
    );
}

/// Killed by: sums of another pixel, values that are not finite, a factor at another depth.
#[test]
fn auxiliary_values_go_to_their_pixels() {
    world(
        |s| s.aovs = AovSet::STANDARD.with(AovSet::of(&[Aov::Material])),
        |world, shard| {
            let (rays, hit, a) = arrive(world, shard, 1);
            let t = F32x8::from_fn(|i| if i == 1 { f32::NAN } else { hit.t.lane(i) });
            let first = Mask8::from_bits(0b0000_0111);
            let floor = Vec3x8::from_fn(|_| FLOOR);
            let good = shard.state.book.record_first_hit(first, &rays.path, t, a.vertex.ns, floor);
            assert_eq!(good.bits(), 0b0000_0101);
            let found =
                FirstSurfaces8 { material: U32x8::splat(7), object: U32x8::splat(NONE), motion: [F32x8::ZERO; 2] };
            shard.state.book.record_surfaces(good, &rays.path, &found);
            let mut of =
                |pixel: usize, aov: Aov, channel: usize| *shard.state.book.aovs.get(pixel, aov, channel).unwrap();
            assert_eq!((of(0, Aov::Alpha, 0), of(0, Aov::Depth, 0), of(0, Aov::Material, 0)), (1.0, 0.5, 7.0));
            assert_eq!([0, 1, 2].map(|c| of(0, Aov::Normal, c)), [0.0, 0.0, 1.0]);
            assert_eq!([0, 1, 2].map(|c| of(0, Aov::Albedo, c)), FLOOR);
            assert_eq!((of(1, Aov::Alpha, 0), of(1, Aov::Material, 0)), (0.0, -1.0));
            assert_eq!((shard.state.book.counters.non_finite, shard.state.book.counters.first_non_finite), (1, 2));
            let path = Path8 { depth: U32x8::new([1, 2, 3, 4, 5, 9, 1, 1]), ..rays.path };
            shard.state.book.record_factors(Mask8::from_bits(0b0011_1111), &path, F32x8::splat(2.0));
            let mut of = |p: usize, c: usize| *shard.state.book.aovs.get(p, Aov::Factors, c).unwrap();
            let column = [0, 1, 2, 3, 4, 5].map(|p| (0..4).find(|c| of(p, *c) == 2.0));
            assert_eq!(column, [Some(0), Some(1), Some(2), Some(3), Some(3), Some(3)]);
            assert_eq!([4, 5, 6, 7].map(|c| of(6, c)), [0.0; 4]);
        },
    );
}

/// A factor of 3 gives three samples, each a third; bounds take splitting away before anything is weighed, and are
/// counted. Killed by: a weight over n instead of s, a bound that lowers n and not s, factors in lanes that ended.
#[test]
fn roulette_rounds_factors_and_divides_by_them() {
    let run = |free: usize, budget: u32| {
        let change = |s: &mut Settings| (strategy("fixed:3")(s), s.split_budget = budget).0;
        world(change, |world, shard| {
            let (_, _, mut a) = arrive(world, shard, 1);
            let Shard { job, state: State { book, comb, .. }, .. } = shard;
            let d = roulette(world, &job.settings, book, comb, free, &mut a);
            assert_eq!(d.with_nee, d.n, "without roulette for light samples all draw one");
            let limited = [book.counters.splits_limited_by_ring, book.counters.splits_limited_by_budget];
            (d.n, a.vertex.beta.lane(0), a.vertex.samples.lane(0), limited)
        })
    };
    let third = [0.5f32 / 3.0, 1.0 / 3.0, 2.0 / 3.0];
    assert_eq!(run(500, 100), ([3, 3, 3, 0, 3, 0, 3, 0], third, 3 | 3 << 16, [0, 0]));
    assert_eq!(run(8, 100), ([1, 1, 1, 0, 1, 0, 1, 0], [0.5, 1.0, 2.0], 1 | 1 << 16, [5, 0]));
    assert_eq!(run(500, 0), ([1, 1, 1, 0, 1, 0, 1, 0], [0.5, 1.0, 2.0], 1 | 1 << 16, [0, 5]));
}

/// A factor of 1/2 lets every other lane of a packet live, with twice the weight: the comb. Killed by: rounding lanes
/// independently, the mean over packets off one half.
#[test]
fn the_comb_keeps_half_of_every_packet() {
    world(strategy("fixed:0.5"), |world, shard| {
        let (_, _, arrival) = arrive(world, shard, 1);
        let mut kept = [0; 8];
        for _ in 0..4096 {
            let mut a = arrival;
            let Shard { job, state: State { book, comb, .. }, .. } = &mut *shard;
            let d = roulette(world, &job.settings, book, comb, 500, &mut a);
            let n: u32 = d.n.iter().sum();
            assert!(n == 2 || n == 3, "{n} of 5 lanes");
            assert_eq!(a.vertex.beta.lane(0), [1.0, 2.0, 4.0]);
            kept.iter_mut().zip(d.n).for_each(|(k, n)| *k += n);
        }
        for i in arrival.active.lanes() {
            assert!(kept[i].abs_diff(2048) < 160, "lane {i}: {} of 4096, five standard deviations off", kept[i]);
        }
    });
}

/// Killed by: bins of the camera's vertices among others, a mirror keyed as if it were diffuse, samples logged without
/// their albedo.
#[test]
fn vertices_are_looked_up_by_what_decides_their_radiance() {
    world(strategy("ears"), |world, shard| {
        let (_, _, mut a) = arrive(world, shard, 2);
        a.albedo = Vec3x8::splat(0.5, 0.25, 0.0);
        let later = cache_lookup(world, &shard.state.book, &a, Space::Scene);
        assert_eq!((later.unscale.lane(0), later.scale.lane(0)), ([0.5, 0.25, 0.0], [2.0, 4.0, 0.0]));
        let leaf = |bin: u32| bin / 16;
        let bin = later.bin.to_array();
        assert!(a.active.lanes().all(|i| bin[i] < NO_BIN) && bin[7] == NO_BIN);
        assert_eq!((leaf(bin[0]), bin[0]), (leaf(bin[4]), bin[1]), "diffuse vertices share a tree");
        assert!(leaf(bin[6]) != leaf(bin[0]) && bin[4] != bin[0], "a tree for glossy ones, a bin for each normal");
        a.vertex.path.depth = U32x8::splat(1);
        let first = cache_lookup(world, &shard.state.book, &a, Space::Scene);
        assert_eq!(first.bin.to_array(), [NO_BIN; 8], "pixels are not known yet");
    });
}

/// Killed by: a path that ends and waits too, a vertex in another class's queue, splits not counted.
#[test]
fn vertices_wait_or_their_paths_end() {
    world(
        |_| (),
        |world, shard| {
            let (_, _, mut a) = arrive(world, shard, 1);
            let n = [2, 0, 1, 0, 0, 0, 5, 0];
            let decision = Decision8 { n, with_nee: [1, 0, 1, 0, 0, 0, 5, 0] };
            a.vertex.samples = U32x8::from_fn(|i| n[i] | decision.with_nee[i] << 16);
            settle::<TestWorld<'_>>(&mut shard.state.book, &mut shard.state.ring, &a, &decision);
            let c = &shard.state.book.counters;
            assert_eq!((c.paths_terminated, c.camera_samples, c.splits, c.light_samples_skipped), (2, 2, 5, 1));
            assert_eq!(shard.state.ring.waiting(), 3);
            let mirror = PacketClass::of_kind(MaterialKind::Mirror as u32).expect("a class");
            assert_eq!(shard.state.ring.fullest(), Some((mirror.queue(true), 5)));
            assert_eq!(shard.state.book.roots.get(a.vertex.path.root.lane(6)).splits, 4);
        },
    );
}

/// Radiance reaches its camera sample, and its pixel when the path ends; what is not finite reaches neither. Killed by:
/// a lane added twice, an infinity in the film, a pixel that gets another's sample.
#[test]
fn books_close_into_pixels() {
    world(
        |_| (),
        |_, shard| {
            let path = paths(shard, 3);
            let x = Vec3x8::from_fn(|i| [i as f32, 1.0, if i == 5 { f32::INFINITY } else { 0.5 }]);
            let found = Contribution8 { pixel: x, local: x };
            shard.state.book.accumulate(Mask8::from_bits(0b0011_0110), &path, &found, Beyond::Ray);
            shard.state.book.accumulate(Mask8::from_bits(0b0000_0010), &path, &found, Beyond::Ray);
            shard.state.book.close_lanes::<TestWorld<'_>>(Mask8::all_lanes(), &path);
            let sums = [0, 1, 2, 5].map(|p| shard.state.book.pixel(p).0).map(|p| (p.sum, p.samples));
            assert_eq!(sums, [([0.0; 3], 1), ([2.0, 2.0, 1.0], 1), ([2.0, 1.0, 0.5], 1), ([0.0; 3], 1)]);
            let c = &shard.state.book.counters;
            assert_eq!((c.non_finite, c.first_non_finite, c.path_segments), (1, 6, 24));
        },
    );
}
