//! Pictures of scenes with instances: those of the flat scene, known radiances, coverage that is linear in time.

use croupier::Settings;
use croupier_host::description::*;
use croupier_tests::geometry::Rng;
use croupier_tests::placed::{IDENTITY, Kind, Map, add_prototype, flatten, translation};
use croupier_tests::runner::{Image, render, scheduled, settings};
use croupier_tests::scenes::*;

/// |z| that a comparison may reach: with the 40 of this file a false alarm in 1e5 runs.
const LIMIT: f64 = 5.2;

fn scaled(s: [f32; 3], t: [f32; 3]) -> Map {
    let mut m = translation(t);
    (0..3).for_each(|k| m[k][k] = s[k]);
    m
}

fn moving(name: &str, prototype: u32, open: Map, close: Map) -> Instance {
    Instance { to_world_end: Some(close), ..Instance::new(name, prototype, open) }
}

/// A room of triangles of the world with instances of a lamp, of a smooth ball, and of a shelf that holds lamps and balls.
fn room(size: [u32; 2]) -> SceneDescription {
    let mut s = SceneDescription {
        camera: camera([0.1, -0.1, 0.9], [0.1, 0.0, -1.0], 80.0, size),
        ..SceneDescription::default()
    };
    let wall = s.add_material("wall", diffuse([0.7, 0.5, 0.3]));
    let glow = s.add_material("glow", grey(0.4));
    let metal = s.add_material("metal", Model::Mirror { reflectance: Reflectance::Constant([0.9, 0.8, 0.7]) });
    add_quad(&mut s, "lamp", glow, facing_y(0.5, 0.0, -1.0));
    let lamp = add_prototype(&mut s, "lamp", 0, vec![]);
    add_box(&mut s, wall, [-1.0; 3], [1.0; 3], true);
    let first = s.triangles.len() as u32;
    add_sphere(&mut s, metal, [0.0; 3], 0.5, Sphere { subdivisions: 2, smooth: true, inwards: false });
    let ball = add_prototype(&mut s, "ball", first, vec![]);
    let first = s.triangles.len() as u32;
    add_box(&mut s, wall, [-0.5, -0.1, -0.1], [0.5, 0.0, 0.1], false);
    let mut r = Rng(3);
    let on_shelf = vec![
        Instance::new("left ball", ball, scaled([0.2; 3], [-0.3, 0.12, 0.0])),
        Instance::new("lamp", lamp, Kind::Mirrored.map(&mut r, 0.2, [0.0, 0.2, 0.0])),
        Instance::new("right ball", ball, Kind::Similar.map(&mut r, 0.3, [0.3, 0.16, 0.0])),
    ];
    let shelf = add_prototype(&mut s, "shelf", first, on_shelf);
    s.instances = vec![
        Instance::new("ceiling lamp", lamp, scaled([0.6; 3], [0.0, 0.96, 0.0])),
        Instance::new("ball", ball, Kind::Mirrored.map(&mut r, 0.5, [-0.4, -0.6, -0.3])),
        Instance::new("shelf", shelf, Kind::Similar.map(&mut r, 0.8, [0.3, 0.0, -0.5])),
        Instance::new("mirrored shelf", shelf, Kind::Mirrored.map(&mut r, 0.6, [-0.4, 0.2, -0.4])),
        Instance { visible: false, ..Instance::new("hidden lamp", lamp, scaled([0.5; 3], [0.0, 0.0, 0.5])) },
        Instance::new("wall lamp", lamp, Kind::Stretched.map(&mut r, 0.05, [0.7, 0.5, -0.8])),
    ];
    s.emitters.push(Emitter::Area { material: glow, radiance: [5.0, 6.0, 7.0] });
    s
}

#[track_caller]
fn assert_mean(what: &str, image: &Image, expected: f64, power: f64) {
    let (mean, error) = (image.mean(), image.error_of_mean());
    println!("{what}: {mean:.6} +- {error:.6}, expected {expected:.6}");
    assert!(error <= power * expected, "{what}: a standard error of {error} sees nothing");
    assert!((mean - expected).abs() <= LIMIT * error + 1e-4 * expected, "{what}: {mean} +- {error}, not {expected}");
}

/// With the same random numbers nearly all paths are the same, so that the pictures agree far below their noise. Killed by:
/// a light of another instance, an area in the object's units, a density that the sampler does not have, a front that
/// turned, a normal that is not mirrored.
#[test]
fn pictures_are_those_of_the_flat_scene() {
    let mut description = room([24, 24]);
    // its lights would be in one of the two tables only, and numbers would choose others
    description.instances.retain(|i| i.visible);
    let (placed, flat) = (blob(&description), blob(&flatten(&description)));
    for strategy in ["classic", "ears"] {
        let of = |scene: &[u8]| {
            scheduled(scene, &settings(scene, strategy), &[4, 8], croupier_tests::runner::Schedule::InOrder(1 << 20))
        };
        let (a, b) = (of(&placed), of(&flat));
        assert_eq!((a.counters.non_finite, b.counters.non_finite), (0, 0));
        let (means, error) = ([a.mean(), b.mean()], b.error_of_mean());
        println!("{strategy}: {means:?}, noise {error}");
        assert!(error < 0.05 * means[1]);
        assert!((means[0] - means[1]).abs() < LIMIT * 1.5 * error, "{strategy}: {means:?}, noise {error}");
        let alike = a.pixels.iter().zip(&b.pixels).filter(|(a, b)| {
            let (a, b) = (a.mean(), b.mean());
            (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-2 * b[c].abs())
        });
        let share = alike.count() as f64 / a.pixels.len() as f64;
        println!("{strategy}: {share} of the pixels alike");
        assert!(strategy != "classic" || share > 0.8, "{share}");
    }
}

/// The same with other random numbers, and many of them: means of the two scenes within 10 %, at five standard errors. Killed by: an emissive
/// instance that is chosen with another probability than its table says, lights counted twice.
#[test]
fn expected_radiance_is_that_of_the_flat_scene() {
    let description = room([16, 16]);
    let (placed, flat) = (blob(&description), blob(&flatten(&description)));
    let of = |scene: &[u8], seed| render(scene, &Settings { seed, ..settings(scene, "classic") }, 1024);
    let (a, b) = (of(&placed, 1), of(&flat, 2));
    for c in 0..3 {
        let (d, e) = (a.channel(c) - b.channel(c), a.error_of_channel(c).hypot(b.error_of_channel(c)));
        println!("channel {c}: {d:.5} +- {e:.5} of {:.5}", b.channel(c));
        assert!(d.abs() + LIMIT * e < 0.1 * b.channel(c), "channel {c}: {d} +- {e}");
    }
}

/// A room lit by a small lamp, with a hidden one that would more than double the light: the picture is that without it,
/// within 1 % at five standard errors. Killed by: a hidden lamp that emits, or that is in the way.
#[test]
fn a_hidden_lamp_is_not_there() {
    let mut description = room([16, 16]);
    description.instances.retain(|i| ["ball", "hidden lamp"].contains(&i.name.as_str()));
    description.emitters.push(Emitter::Point { position: [0.1, 0.7, 0.3], intensity: [0.4; 3] });
    let of = |description: &SceneDescription, seed, samples| {
        let scene = blob(description);
        render(&scene, &Settings { seed, max_depth: 3, ..settings(&scene, "none") }, samples)
    };
    let mut shown = description.clone();
    shown.instances.iter_mut().for_each(|i| i.visible = true);
    let mut without = description.clone();
    without.instances.retain(|i| i.visible);
    let [hidden, without, shown] = [of(&description, 1, 2048), of(&without, 2, 2048), of(&shown, 3, 64)];
    let (d, e) = (hidden.mean() - without.mean(), hidden.error_of_mean().hypot(without.error_of_mean()));
    println!("{:.5} hidden, {:.5} without, {e:.5}, {:.5} shown", hidden.mean(), without.mean(), shown.mean());
    assert!(d.abs() + LIMIT * e < 0.01 * without.mean(), "{d} +- {e} of {}", without.mean());
    assert!(shown.mean() > 2.0 * without.mean());
}

/// Every wall of a closed box emits, through sheared, stretched, mirrored and nested maps: radiance is e / (1 - rho)
/// everywhere. Killed by: a density in solid angle by the object's area, a light that is behind its own plane.
#[test]
fn a_glowing_box_is_as_bright_through_any_map() {
    let mut r = Rng(4);
    for (case, kind) in Kind::ALL.into_iter().chain([Kind::Stretched]).enumerate() {
        let mut s = SceneDescription {
            camera: camera([0.01, -0.02, 0.03], [0.4, 0.3, -1.0], 70.0, [8, 8]),
            max_depth: 64,
            ..SceneDescription::default()
        };
        let wall = s.add_material("wall", grey(0.5));
        add_box(&mut s, wall, [-2.0; 3], [2.0; 3], true);
        let shape = add_prototype(&mut s, "box", 0, vec![]);
        let map = kind.map(&mut r, 2.0, [0.0; 3]);
        if case == 4 {
            let inner = Instance::new("inner", shape, Kind::Mirrored.map(&mut r, 1.5, [0.1; 3]));
            let none = s.triangles.len() as u32;
            let outer = add_prototype(&mut s, "outer", none, vec![inner]);
            s.instances.push(Instance::new("outer", outer, map));
        } else {
            s.instances.push(Instance::new("box", shape, map));
        }
        s.emitters.push(Emitter::Area { material: wall, radiance: [1.0; 3] });
        let scene = blob(&s);
        let image = render(&scene, &settings(&scene, "classic"), 400);
        assert_eq!(image.counters.non_finite, 0);
        assert_mean(&format!("{kind:?} {case}"), &image, 2.0, 0.01);
    }
}

/// Light through absorbing instances: exp(-sigma d) with the length in the world. Killed by: a segment in the object's
/// units, a boundary that is passed in the object's space.
#[test]
fn media_fill_instances() {
    let mut s =
        SceneDescription { camera: camera([0.0, 0.0, 8.0], [0.0; 3], 0.5, [4, 4]), ..SceneDescription::default() };
    let glow = s.add_material("glow", grey(0.0));
    let boundary = s.add_material("boundary", Model::Null);
    s.materials[boundary as usize].medium = Some(0);
    s.media.push(Medium { name: "fog".into(), sigma_a: [0.25; 3], ..Medium::default() });
    add_quad(&mut s, "glow", glow, facing_z(4.0, -4.0, 1.0));
    let first = s.triangles.len() as u32;
    add_box(&mut s, boundary, [-1.0; 3], [1.0; 3], false);
    let shape = add_prototype(&mut s, "box", first, vec![]);
    s.instances.push(Instance::new("far", shape, scaled([1.0, 1.0, -1.5], [0.0, 0.0, -1.5])));
    s.instances.push(Instance::new("near", shape, scaled([1.0, 1.0, 0.5], [0.0, 0.0, 3.0])));
    s.emitters.push(Emitter::Area { material: glow, radiance: [1.0; 3] });
    let scene = blob(&s);
    let image = render(&scene, &Settings { max_depth: 4, ..settings(&scene, "none") }, 16);
    let expected = (-0.25f64 * (3.0 + 1.0)).exp();
    assert!((image.mean() - expected).abs() < 1e-4, "{}, not {expected}", image.mean());
}

/// A camera that sees x and y from -1 to 1 at z = 0.
fn plane_camera(size: [u32; 2]) -> Camera {
    camera([0.0, 0.0, 10.0], [0.0; 3], 2.0 * (0.1f64).atan().to_degrees(), size)
}

/// Length of the overlap of two intervals.
fn overlap(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[1].min(b[1]) - a[0].max(b[0])).max(0.0)
}

/// A strip that moves and grows while the shutter is open: each pixel's mean over time. Killed by: times that are not
/// uniform, one time for all rays of a pixel, a map that is not linear in time, a key forgotten.
#[test]
fn moving_emitters_cover_pixels_for_their_share_of_time() {
    const COLUMNS: usize = 16;
    let mut s = SceneDescription { camera: plane_camera([COLUMNS as u32; 2]), ..SceneDescription::default() };
    let glow = s.add_material("glow", grey(0.0));
    add_quad(&mut s, "strip", glow, [[0.0, -2.0, 0.0], [0.3, -2.0, 0.0], [0.3, 2.0, 0.0], [0.0, 2.0, 0.0]]);
    let strip = add_prototype(&mut s, "strip", 0, vec![]);
    let (open, close) = (scaled([1.0; 3], [-0.9, 0.0, 0.0]), scaled([2.0, 1.0, 1.0], [0.2, 0.0, 0.0]));
    for nested in [false, true] {
        s.instances = vec![moving("strip", strip, open, close)];
        if nested {
            let inner = s.instances.clone();
            let none = s.triangles.len() as u32;
            let outer = add_prototype(&mut s, "outer", none, inner);
            s.instances = vec![Instance::new("outer", outer, IDENTITY)];
        }
        s.emitters = vec![Emitter::Area { material: glow, radiance: [1.0; 3] }];
        let scene = blob(&s);
        let image = render(&scene, &Settings { max_depth: 1, ..settings(&scene, "none") }, 1024);
        for x in 0..COLUMNS {
            let width = 2.0 / COLUMNS as f64;
            let pixel = [-1.0 + x as f64 * width, -1.0 + (x + 1) as f64 * width];
            let steps = 20_000;
            let at = |k: i32| {
                let t = (f64::from(k) + 0.5) / f64::from(steps);
                let left = -0.9 + 1.1 * t;
                overlap(pixel, [left, left + 0.3 * (1.0 + t)]) / width
            };
            let expected: f64 = (0..steps).map(at).sum::<f64>() / f64::from(steps);
            let column = (0..COLUMNS).map(|y| image.pixels[y * COLUMNS + x].mean()[0]).sum::<f64>() / COLUMNS as f64;
            let n = 1024.0 * COLUMNS as f64;
            let error = (expected * (1.0 - expected) / n).sqrt().max(1e-4);
            assert!((column - expected).abs() <= LIMIT * error, "column {x}: {column}, not {expected} +- {error}");
        }
    }
}

/// Light of a lamp that moves, turns and grows, on a floor: the mean over lamps that stand still at many times. Killed by: a
/// light sample at another time than its shadow ray, an area of another time, a path whose bounces see another time.
#[test]
fn moving_lamps_give_the_mean_of_still_ones() {
    let mut s = spot(0.8, [4, 4]);
    let glow = s.add_material("glow", grey(0.0));
    let first = s.triangles.len() as u32;
    add_quad(&mut s, "lamp", glow, facing_y(0.4, 0.0, -1.0));
    let lamp = add_prototype(&mut s, "lamp", first, vec![]);
    s.emitters.push(Emitter::Area { material: glow, radiance: [2.0; 3] });
    let open: Map = [[1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 0.0, 0.6], [0.0, 0.0, 1.0, 0.0]];
    let close: Map = [[1.2, 0.8, 0.0, 0.5], [-0.8, 1.2, 0.0, 1.4], [0.0, 0.0, 2.0, 0.3]];
    // independent pictures: with one seed their errors would be alike
    let picture = |s: &SceneDescription, spp, seed| {
        let scene = blob(s);
        render(&scene, &Settings { max_depth: 2, seed, ..settings(&scene, "none") }, spp)
    };
    let times = 64;
    let still = |k: i32| {
        let t = (k as f32 + 0.5) / times as f32;
        let map = [0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| open[r][c] + t * (close[r][c] - open[r][c])));
        let mut s = s.clone();
        s.instances.push(Instance::new("lamp", lamp, map));
        let image = picture(&flatten(&s), 512, 1 + k as u64);
        (image.mean(), image.error_of_mean())
    };
    let (sum, square) = (0..times).map(still).fold((0.0, 0.0), |(m, e), (mean, error)| (m + mean, e + error * error));
    let (expected, own) = (sum / f64::from(times), square.sqrt() / f64::from(times));
    s.instances.push(moving("lamp", lamp, open, close));
    let image = picture(&s, 16_384, 0);
    let (mean, error) = (image.mean(), image.error_of_mean().hypot(own));
    println!("{mean} +- {error}, expected {expected}");
    assert!(error < 0.004 * expected);
    // the midpoint rule with 64 steps is good to 1e-4 of this integral
    assert!((mean - expected).abs() < LIMIT * error + 1e-4 * expected, "{mean} +- {error}, not {expected}");
}

/// A key that says the same as the other one draws no time and changes no bit. Killed by: an effect that is called for by
/// the presence of a key.
#[test]
fn equal_keys_are_no_motion() {
    let description = room([8, 8]);
    let still = blob(&description);
    let mut keyed = description;
    keyed.instances.iter_mut().for_each(|i| i.to_world_end = Some(i.to_world));
    assert_eq!(blob(&keyed)[..], still[..]);
}
