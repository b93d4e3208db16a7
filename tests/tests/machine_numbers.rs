//! Numbers that must not do harm: bad ones are counted and stay out of the film, large, small and far away scenes look
//! like others, bounds of steps and counters hold.

use croupier::unstable::MAX_PATH_LENGTH;
use croupier::unstable::accel::{Intersector, Occlusion8, WideBvh};
use croupier::unstable::film::{PixelAov, PixelStats};
use croupier::unstable::geometry::{Hit8, Ray8};
use croupier::unstable::profile::Full;
use croupier::unstable::scene::blob::NONE;
use croupier::unstable::simd::{F32x8, Mask8, U32x8};
use croupier::{Budget, Counters, Plan, Scene, Session, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::*;
use croupier_tests::runner::{Image, Schedule, render, render_with, scheduled, settings};
use croupier_tests::scenes::*;

const IN_ORDER: Schedule = Schedule::InOrder(1 << 20);

/// Every number of a film is finite.
fn all_finite(image: &Image) -> bool {
    let pixel = |p: &PixelStats| p.sum.iter().chain(&p.spread).all(|x| x.is_finite());
    let aov = |a: &PixelAov| bytemuck::cast_ref::<_, [f64; 17]>(a).iter().all(|x| x.is_finite());
    image.pixels.iter().all(pixel) && image.aovs.iter().all(aov)
}

/// The same sums but for the order of additions.
fn alike(a: &PixelStats, b: &PixelStats) -> bool {
    let close = |(x, y): (&f64, &f64)| (x - y).abs() <= 1e-12 * x.abs();
    a.samples == b.samples && a.rays == b.rays && a.sum.iter().zip(&b.sum).all(close)
}

/// What a faulty intersector answers.
#[derive(Clone, Copy, Debug)]
enum Fault {
    T(f32),
    Weights(f32),
    Triangle(u32),
    HitsWithoutTriangle,
}

/// The built-in intersector, but wrong for camera rays (those from `eye`) to the right (`d.x > 0`).
struct Faulty<'s> {
    inner: WideBvh<'s>,
    eye: [f32; 3],
    fault: Fault,
}

impl Intersector for Faulty<'_> {
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        let mut h = self.inner.closest(rays, active);
        let from_eye = (0..8).filter(|&i| rays.o.lane(i) == self.eye && rays.d.x.lane(i) > 0.0);
        let bad = Mask8::from_bits(from_eye.fold(0, |bits, i| bits | 1 << i)) & active;
        match self.fault {
            Fault::T(t) => h.t = (bad & h.hit).select(F32x8::splat(t), h.t),
            Fault::Weights(x) => {
                h.u = (bad & h.hit).select(F32x8::splat(x), h.u);
                h.v = (bad & h.hit).select(F32x8::splat(x), h.v);
            }
            Fault::Triangle(n) => h.triangle = U32x8::select(bad & h.hit, U32x8::splat(n), h.triangle),
            // lanes that are not active must not count either
            Fault::HitsWithoutTriangle => h.hit = h.hit | bad | Mask8::all_lanes().and_not(active),
        }
        h
    }

    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        self.inner.occluded(rays, active)
    }

    fn occluded_by(&self, rays: &Ray8, active: Mask8, blocks: &dyn Fn(u32) -> bool) -> Occlusion8 {
        self.inner.occluded_by(rays, active, blocks)
    }
}

/// A host's intersector may answer anything: nothing panics, nothing bad reaches the film, pixels whose rays were right
/// are right. Killed by: depths added without a look, a lane's NaN in a sum over the packet, an index without a bound.
#[test]
fn a_faulty_intersector_spoils_its_own_lanes_only() {
    let mut description = everything([24, 16]);
    // no lens: camera rays start at one point
    description.camera.lens = None;
    description.camera.origin[0] = 0.0;
    let bytes = blob(&description);
    let scene = Scene::from_bytes(&bytes).unwrap();
    let eye = scene.camera.origin;
    let settings = Settings { max_depth: 6, aovs: true.into(), ..settings(&bytes, "none") };
    let clean = scheduled(&bytes, &settings, &[4], IN_ORDER);
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let faults = [Fault::T(nan), Fault::T(inf), Fault::T(-1.0), Fault::T(0.0)];
    let faults = faults.into_iter().chain([Fault::Weights(nan), Fault::Weights(inf), Fault::Weights(1e30)]);
    let faults = faults.chain([Fault::Triangle(NONE), Fault::Triangle(1 << 30), Fault::HitsWithoutTriangle]);
    for fault in faults {
        let faulty = Faulty { inner: WideBvh::new(&scene), eye, fault };
        let image = render_with::<Full, _>(scene, faulty, &settings, &[4], IN_ORDER);
        assert!(all_finite(&image), "{fault:?} reached the film");
        assert_eq!(image.counters.camera_samples, clean.counters.camera_samples);
        for i in (0..24 * 16).filter(|i| i % 24 < 12) {
            assert!(alike(&image.pixels[i], &clean.pixels[i]), "{fault:?} reached column {}", i % 24);
        }
        if matches!(fault, Fault::T(t) if !t.is_finite()) {
            let c = image.counters;
            let column = (c.first_non_finite - 1) % 24;
            assert!(c.non_finite > 300 && column >= 12, "{} counted, first in column {column}", c.non_finite);
        }
    }
}

/// The strongest point light there is, 6e-8 from the sharpest rough metal: 1e18 / r^2 * D overflows. Such samples are
/// counted, with their pixel, and the film holds the others: the diffuse left half is as bright as it must be. Killed
/// by: a sum before the test, a NaN that spreads over the packet, infinity minus infinity in the variance.
#[test]
fn overflowing_radiance_is_counted_and_left_out() {
    let mut s =
        SceneDescription { camera: camera([0.0, 0.3, 0.4], [0.0; 3], 0.01, [12, 8]), ..SceneDescription::default() };
    let floor = s.add_material("floor", grey(0.8));
    let reflectance = Reflectance::Constant([1.0; 3]);
    let metal = Model::RoughConductor { eta: [0.2; 3], k: [3.0; 3], reflectance, alpha: 1e-4 };
    let metal = s.add_material("metal", metal);
    let half = |x: f32| [[x - 1.0, 0.0, 1.0], [x, 0.0, 1.0], [x, 0.0, -1.0], [x - 1.0, 0.0, -1.0]];
    add_quad(&mut s, "left", floor, half(0.0));
    add_quad(&mut s, "right", metal, half(1.0));
    let scale = 2f32.powi(-24);
    place(&mut s, scale, 0.0);
    let position = [0.0, 0.6 * scale, -0.8 * scale];
    s.emitters.push(Emitter::Point { position, intensity: [1e18, 1.0, 0.0] });
    let bytes = blob(&s);
    for strategy in ["none", "fixed:1.5", "classic:1"] {
        let settings = Settings { max_depth: 3, aovs: true.into(), ..settings(&bytes, strategy) };
        let image = scheduled(&bytes, &settings, &[16, 16], IN_ORDER);
        let c = image.counters;
        assert!(all_finite(&image), "{strategy}");
        assert!(c.non_finite > 100 && c.camera_samples == 32 * 96, "{strategy}: {c:?}");
        let first = c.first_non_finite - 1;
        assert!(first < 96 && first % 12 >= 6, "{strategy}: first in pixel {first}");
        assert!(image.error.rel_mse.is_finite() && image.error.rel_mse_all.is_finite());
        let expected = 0.8 * 0.6 / std::f64::consts::PI / f64::from(scale).powi(2);
        let left = image.pixels.iter().enumerate().filter(|(i, _)| i % 12 < 6);
        let sum = left.map(|(_, p)| p.mean()[1]).sum::<f64>() / 48.0;
        assert!((sum / expected - 1.0).abs() < if strategy == "none" { 1e-3 } else { 0.05 }, "{strategy}: {sum}");
    }
}

/// Emission as strong as the format allows gives the picture of weak emission, scaled. Killed by: squares in f32.
#[test]
fn the_strongest_emitters_do_not_overflow() {
    let image = |scale: f32| {
        let mut s = cornell([8, 8]);
        let Emitter::Area { radiance, .. } = &mut s.emitters[0] else { unreachable!() };
        *radiance = radiance.map(|x| x * scale);
        let scene = blob(&s);
        render(&scene, &Settings { max_depth: 6, ..settings(&scene, "none") }, 16)
    };
    let factor = 2f32.powi(57);
    let (weak, strong) = (image(1.0), image(factor));
    assert_eq!(strong.counters.non_finite, 0);
    for (a, b) in weak.pixels.iter().zip(&strong.pixels) {
        for c in 0..3 {
            assert!((b.mean()[c] / f64::from(factor) / a.mean()[c] - 1.0).abs() < 1e-12);
            assert!(
                (b.variance_of_mean()[c].sqrt() / f64::from(factor) / a.variance_of_mean()[c].sqrt() - 1.0).abs()
                    < 1e-9
            );
        }
    }
}

/// A scene of 2e-13 or of 2e6 units is the same picture, to the bit as the scale is a power of two. Killed by: a length
/// that is added to or compared with something, an epsilon with a unit.
#[test]
fn pictures_do_not_depend_on_the_unit_of_length() {
    for mut scene in [cornell([16, 12]), everything([16, 12])] {
        // power, unlike radiance, has a unit of length
        scene.emitters.retain(|e| !matches!(e, Emitter::Point { .. }));
        let image = |power: i32| {
            let mut s = scene.clone();
            let scale = 2f32.powi(power);
            place(&mut s, scale, 0.0);
            if let Some(l) = &mut s.camera.lens {
                (l.radius, l.focus_distance) = (l.radius * scale, l.focus_distance * scale);
            }
            let bytes = blob(&s);
            render(&bytes, &Settings { max_depth: 6, ..settings(&bytes, "classic:2") }, 32)
        };
        let unit = image(0);
        for power in [-40, -14, -13, -4, 1, 10, 20] {
            assert!(image(power).bits() == unit.bits(), "scaled by 2^{power}");
        }
    }
    // another factor rounds
    let image = |scale: f32| {
        let mut s = cornell([16, 12]);
        place(&mut s, scale, 0.0);
        let bytes = blob(&s);
        render(&bytes, &Settings { max_depth: 6, ..settings(&bytes, "none") }, 64)
    };
    let unit = image(1.0);
    for scale in [1e-4, 1e4, 1e6] {
        let other = image(scale);
        assert!((other.mean() / unit.mean() - 1.0).abs() < 1e-3, "{} for {} at {scale}", other.mean(), unit.mean());
    }
}

/// A scene of 1000 units at 1e6 from the origin in every direction looks as it does at the origin. Its corners are
/// exact; what is tested is the rounding of points between them, whose steps are 0.06. Killed by: spawned rays that
/// start inside (dark or leaking surfaces), points from `o + t d`, a camera that rounds its axis.
#[test]
fn far_scenes_look_the_same() {
    for (name, mut scene) in [("cornell", cornell([16, 16])), ("everything", everything([16, 16]))] {
        scene.emitters.retain(|e| !matches!(e, Emitter::Point { .. }));
        scene.camera.lens = None;
        let image = |scale: f32, offset: f32| {
            let mut s = scene.clone();
            place(&mut s, scale, offset);
            let bytes = blob(&s);
            render(&bytes, &Settings { max_depth: 6, ..settings(&bytes, "none") }, 256)
        };
        let near = image(1.0, 0.0);
        for (scale, offset, tolerance) in
            [(512.0, 1e6, 0.003), (512.0, -1e6, 0.003), (64.0, 1e6, 0.01), (1.0, 1e4, 0.006)]
        {
            let far = image(scale, offset);
            assert_eq!(far.counters.non_finite, 0);
            // the same random numbers: most of the noise is common
            let d = far.mean() / near.mean() - 1.0;
            assert!(d.abs() < tolerance, "{name} of {scale} at {offset}: off by {d}");
        }
    }
}

/// Surfaces of needles look like surfaces: a strip of 1e6 : 1, seen across, under a sun and an environment. Killed by:
/// a hit point or normal from weights that a needle makes uncertain, self-hits along it.
#[test]
fn strips_of_needles_are_plain_surfaces() {
    for turn in [0.0f64, 0.6] {
        let mut s = in_white_environment(camera([0.0, 0.001, 0.0], [0.0; 3], 20.0, [8, 8]));
        s.environment = Some(Environment::Constant { radiance: [0.5; 3] });
        let strip = s.add_material("strip", grey(0.8));
        // 1000 long, cut lengthwise into needles a thousandth wide
        let (sin, cos) = turn.sin_cos();
        for i in -4..4 {
            let z = |k: i32| f64::from(k) * 0.001;
            let at = |x: f64, z: f64| [(x * cos - z * sin) as f32, 0.0, (x * sin + z * cos) as f32];
            let corners = [at(-500.0, z(i + 1)), at(500.0, z(i + 1)), at(500.0, z(i)), at(-500.0, z(i))];
            add_quad(&mut s, "needles", strip, corners);
        }
        s.emitters.push(Emitter::Directional { direction: [0.6, -0.8, 0.0], irradiance: [1.0; 3] });
        let bytes = blob(&s);
        let image = render(&bytes, &Settings { max_depth: 3, ..settings(&bytes, "none") }, 2048);
        let expected = 0.8 * (0.5 + 0.8 / std::f64::consts::PI);
        let (mean, error) = (image.mean(), image.error_of_mean());
        assert!(error < 0.002 && (mean - expected).abs() < 5.0 * error, "{mean} +- {error}, expected {expected}");
    }
}

/// Books balance: every ray and sample is counted once, in the film as in the counters. Killed by: a shadow ray that is
/// not charged, packets counted per lane.
#[test]
fn counters_add_up() {
    for (name, scene) in [("cornell", cornell([20, 20])), ("everything", everything([20, 20]))] {
        let bytes = blob(&scene);
        for strategy in ["none", "classic:2", "fixed:2.5", "fixed:0.4", "ears"] {
            let mut s =
                Settings { max_depth: 5, shards: 3, ring: 200, aovs: true.into(), ..settings(&bytes, strategy) };
            s.shadow_roulette = strategy == "ears";
            let image = scheduled(&bytes, &s, &[3, 5], IN_ORDER);
            let c: Counters = image.counters;
            let what = format!("{name}, {strategy}: {c:?}");
            assert_eq!((c.camera_rays, c.camera_samples), (3200, 3200), "{what}");
            assert_eq!(c.trace.lanes, c.camera_rays + c.scatter_rays + c.straight_rays + c.light_path_rays, "{what}");
            assert_eq!(c.straight_rays, c.passed.lanes, "{what}");
            assert_eq!(c.straight_rays > 0, name == "everything", "{what}");
            assert_eq!(c.occlude.lanes, c.shadow_rays, "{what}");
            assert_eq!(c.scatter.lanes, c.vertex_samples, "{what}");
            assert!(c.shadow_rays + c.shadow_rays_terminated + c.light_samples_skipped <= c.vertex_samples, "{what}");
            assert_eq!(c.light_samples_skipped > 0 && c.shadow_rays_terminated > 0, strategy == "ears", "{what}");
            assert!(c.scatter_rays <= c.vertex_samples, "{what}");
            assert!(c.surface.lanes <= c.trace.lanes && c.surface.packets <= c.trace.packets, "{what}");
            assert!(c.ring_peak > 0 && c.ring_peak <= 200, "{what}");
            assert_eq!((c.non_finite, c.first_non_finite), (0, 0), "{what}");
            assert_eq!(image.pixels.iter().map(|p| p.rays).sum::<u64>(), c.rays(), "{what}");
            for u in [c.scatter, c.trace, c.occlude, c.surface] {
                assert!(u.lanes >= u.packets && u.lanes <= 8 * u.packets && u.share() <= 1.0, "{what}");
            }
            // one class of material keeps packets full
            let full = if name == "cornell" { 0.9 } else { 0.5 };
            assert!(c.scatter.share() > full, "{what}");
            let vertices: f64 = image.aovs.iter().flat_map(|a| a.vertices).sum();
            let hits: f64 = image.aovs.iter().map(|a| a.hits).sum();
            match strategy {
                "none" => {
                    assert_eq!(
                        (c.paths_terminated, c.splits, c.splits_limited_by_ring, c.splits_limited_by_budget),
                        (0, 0, 0, 0),
                        "{what}"
                    );
                    assert_eq!(vertices, c.vertex_samples as f64, "{what}");
                }
                "fixed:0.4" => assert!(c.paths_terminated > 0 && c.splits == 0, "{what}"),
                "fixed:2.5" => assert!(c.splits > c.camera_samples && c.paths_terminated == 0, "{what}"),
                _ => assert!(c.paths_terminated > 0, "{what}"),
            }
            // samples drawn = vertices - kills + splits
            assert_eq!(vertices as u64 + c.splits - c.paths_terminated, c.vertex_samples, "{what}");
            assert!(hits > 0.0 && hits <= c.camera_rays as f64, "{what}");
        }
    }
}

/// A step uses up its budget and passes it by less than a packet with its shadow rays. Killed by: a budget looked at
/// once per refill, splitting that runs to its end.
#[test]
fn steps_keep_to_their_budget() {
    // a shadow ray counts again behind each surface that it passes
    for (scene, most) in [(cornell([16, 16]), 16), (everything([16, 16]), 48)] {
        keeps_to_its_budget(&blob(&scene), most);
    }
    assert_eq!(MAX_PATH_LENGTH, 200);
}

fn keeps_to_its_budget(bytes: &[u8], most: u64) {
    let scene = Scene::from_bytes(bytes).unwrap();
    for strategy in ["none", "fixed:20"] {
        for ring in [16, 512] {
            let s = Settings { ring, max_depth: 4, split_budget: 100, ..settings(bytes, strategy) };
            let plan = Plan::new(&s).unwrap();
            for rays in [1u64, 7, 16, 100, 5000] {
                let mut shared = AlignedBytes::zeroed(plan.session().size);
                let mut block = AlignedBytes::zeroed(plan.shard().size);
                let bvh = WideBvh::new(&scene);
                let mut session = Session::builder(scene).intersector(bvh).build(&plan, shared.as_mut()).unwrap();
                let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
                session.begin_iteration(1);
                assert_eq!(shard.step(&session, Budget { rays: 0 }), StepResult::More);
                assert_eq!(shard.counters().rays(), 0);
                loop {
                    let before = shard.counters().rays();
                    let progress = shard.step(&session, Budget { rays });
                    let used = shard.counters().rays() - before;
                    assert!(used < rays + most, "{used} rays in a step of {rays}");
                    if progress == StepResult::Done {
                        break;
                    }
                    assert!(used >= rays, "{used} rays in a step of {rays} that is not the last");
                }
                let done = *shard.counters();
                assert_eq!(shard.step(&session, Budget { rays }), StepResult::Done);
                assert_eq!(*shard.counters(), done, "a finished shard does nothing");
            }
        }
    }
}
