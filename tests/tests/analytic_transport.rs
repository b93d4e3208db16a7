//! Paths whose radiance follows from counting: slabs, mirrors, depths, sides, invisible boundaries.

use croupier::Settings;
use croupier_host::description::*;
use croupier_tests::bsdf::fresnel_dielectric;
use croupier_tests::runner::{Image, Schedule, render, scheduled, settings};
use croupier_tests::scenes::*;

/// |z| that a comparison may reach: with the 60 of this file a false alarm in 1e5 runs.
const LIMIT: f64 = 5.2;

fn render_as(s: &SceneDescription, strategy: &str, max_depth: u32, spp: u32) -> Image {
    let scene = blob(s);
    let image = render(&scene, &Settings { max_depth, ..settings(&scene, strategy) }, spp);
    assert_eq!(image.counters.non_finite, 0);
    image
}

#[track_caller]
fn assert_mean(what: &str, image: &Image, expected: f64, power: f64) {
    let (mean, error) = (image.mean(), image.error_of_mean());
    assert!(error <= power * expected, "{what}: a standard error of {error} sees nothing");
    let off = (mean - expected).abs();
    assert!(off <= LIMIT * error + 1e-4 * expected, "{what}: {mean} +- {error}, expected {expected}");
}

/// A far emitting wall behind (z < 0) or on the side of the camera (z > 0).
fn add_wall_of_light(s: &mut SceneDescription, z: f32) {
    let emitter = s.add_material("emitter", grey(0.0));
    add_quad(s, "emitter", emitter, facing_z(2000.0, z, -z));
    s.emitters.push(Emitter::Area { material: emitter, radiance: [1.0; 3] });
}

/// A glass pane seen at 0 to 70 degrees passes (1 - R) / (1 + R) and reflects 2 R / (1 + R), as a real slab with all
/// its inner reflections and as a thin sheet. Killed by: a wrong Fresnel term from inside, 1/eta^2 left out on the way
/// out, paths that end early.
#[test]
fn slabs_pass_and_reflect_by_fresnel() {
    let (int_ior, ext_ior) = (1.5, 1.0);
    for degrees in [0.0f64, 40.0, 70.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let r = fresnel_dielectric(cos, 1.0, 1.5);
        for thin in [false, true] {
            for behind in [true, false] {
                let mut s = SceneDescription {
                    camera: camera([20.0 * sin, 0.0, 20.0 * cos], [0.0; 3], 0.1, [4, 4]),
                    ..SceneDescription::default()
                };
                add_wall_of_light(&mut s, if behind { -60.0 } else { 60.0 });
                if thin {
                    let sheet = s.add_material("sheet", Model::ThinDielectric { int_ior, ext_ior });
                    add_quad(&mut s, "sheet", sheet, facing_z(100.0, 0.0, 1.0));
                } else {
                    let glass = s.add_material("glass", Model::Dielectric { int_ior, ext_ior });
                    add_box(&mut s, glass, [-100.0, -100.0, -0.5], [100.0, 100.0, 0.5], false);
                }
                let expected = if behind { (1.0 - r) / (1.0 + r) } else { 2.0 * r / (1.0 + r) };
                let what = format!("{degrees} degrees, thin {thin}, from behind {behind}");
                assert_mean(&what, &render_as(&s, "none", 40, 8192), expected, 0.012);
                assert_mean(&what, &render_as(&s, "fixed:1.5", 12, 2048), expected, 0.025);
            }
        }
    }
}

/// Four reflections between parallel mirrors, then the environment: r^4, and nothing if paths end one segment earlier.
/// Killed by: a reflection about the wrong normal, a depth off by one.
#[test]
fn mirror_corridors_multiply() {
    let mut s = in_white_environment(camera([0.0; 3], [1.0, 0.0, 1.0], 0.05, [4, 4]));
    let tint = [0.9f32, 0.5, 0.2];
    let mirror = s.add_material("mirror", Model::Mirror { reflectance: Reflectance::Constant(tint) });
    // hits at z = 1, 3, 5, 7, then past z = 8
    let wall = |x: f32| [[x, -3.0, -0.5], [x, 3.0, -0.5], [x, 3.0, 8.0], [x, -3.0, 8.0]];
    add_quad(&mut s, "left", mirror, wall(-1.0));
    add_quad(&mut s, "right", mirror, wall(1.0));
    for max_depth in [5, 6, 40] {
        let image = render_as(&s, "none", max_depth, 16);
        for (c, r) in tint.into_iter().enumerate() {
            let expected = f64::from(r).powi(4);
            assert!((image.channel(c) - expected).abs() < 1e-5 * expected, "{} for {expected}", image.channel(c));
        }
        assert_eq!(image.counters.rays(), 16 * 16 * 5, "a ray per segment");
    }
    assert_eq!(render_as(&s, "none", 4, 16).mean(), 0.0);
}

/// Depth 1 sees emitters and the environment, depth 2 adds direct light, depth 3 one reflection more. Killed by: an
/// emitter that is not seen directly, light samples at the last vertex.
#[test]
fn depth_counts_segments() {
    let mut s = in_white_environment(camera([0.0, 1.0, 6.0], [0.0, 1.0, 0.0], 40.0, [32, 32]));
    s.environment = Some(Environment::Constant { radiance: [0.125; 3] });
    let floor = s.add_material("floor", grey(0.5));
    let emitter = s.add_material("emitter", grey(0.5));
    add_quad(&mut s, "floor", floor, facing_y(2.0, 0.0, 1.0));
    add_quad(&mut s, "emitter", emitter, facing_z(0.5, 0.0, 1.0).map(|[x, y, z]| [x, y + 1.5, z]));
    s.emitters.push(Emitter::Area { material: emitter, radiance: [3.0, 2.0, 1.0] });
    s.emitters.push(Emitter::Point { position: [0.0, 3.0, 1.0], intensity: [1.0; 3] });

    let (environment, front, ground) = ([0, 0], [15, 12], [15, 24]);
    let at = |image: &Image, [x, y]: [u32; 2]| image.pixels[(y * 32 + x) as usize].mean();

    let one = render_as(&s, "none", 1, 16);
    assert_eq!(one.counters.rays(), 32 * 32 * 16, "camera rays only");
    assert_eq!((at(&one, environment), at(&one, front), at(&one, ground)), ([0.125; 3], [3.0, 2.0, 1.0], [0.0; 3]));
    let two = render_as(&s, "none", 2, 64);
    assert_eq!(at(&two, environment), [0.125; 3]);
    assert!(at(&two, front)[0] > 3.01 && at(&two, ground)[0] > 0.02);
    let three = render_as(&s, "none", 3, 64);
    assert!(three.mean() > two.mean() * 1.001, "light between floor and emitter");
    let end = |max_depth| render_as(&s, "none", max_depth, 64).mean();
    assert!(end(30) > three.mean() && (end(60) / end(30) - 1.0).abs() < 1e-4);
}

/// Direct light is worth the same with every strategy, which plays before it is sampled. Killed by: light samples whose
/// weight lacks the factor.
#[test]
fn strategies_keep_direct_light() {
    let mut s = spot(0.5, [4, 4]);
    s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] });
    let expected = 0.5 / std::f64::consts::PI;
    for strategy in ["none", "classic", "classic:1", "contribution", "throughput", "albedo", "fixed:0.3", "fixed:4.5"] {
        assert_mean(strategy, &render_as(&s, strategy, 2, 4096), expected, 0.01);
    }
}

/// The same with strategies that learn. Light samples of two lights differ, so that there is something to learn.
#[test]
fn learned_strategies_keep_direct_light() {
    let mut s = spot(0.5, [4, 4]);
    s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] });
    s.emitters.push(Emitter::Point { position: [0.0, 2.0, 0.0], intensity: [12.0; 3] });
    let expected = 0.5 / std::f64::consts::PI * (1.0 + 12.0 / 4.0);
    let scene = blob(&s);
    for strategy in ["bolin-meyer", "adrr", "adrrs", "ear", "ears", "ear:plain", "ears:plain"] {
        let s = Settings { max_depth: 2, ..settings(&scene, strategy) };
        let image = scheduled(&scene, &s, &[64, 512, 1024, 4096, 4096], Schedule::InOrder(1 << 20));
        assert_mean(strategy, &image, expected, 0.01);
        assert!(image.counters.samples_logged > 500, "{strategy}");
    }
}

/// Boundaries of type `null` leave the picture alone: around objects, around the camera, before the environment. Killed
/// by: a delta lobe that is weighted against light sampling, a direction that changes on the way through.
#[test]
fn null_boundaries_are_invisible() {
    let plain = cornell([8, 8]);
    let mut veiled = plain.clone();
    let air = veiled.add_material("air", Model::Null);
    add_box(&mut veiled, air, [-0.6, -0.8, -0.7], [0.5, 0.4, 0.6], false);
    add_box(&mut veiled, air, [-0.2, -0.5, 3.9], [0.2, 0.5, 5.0], false);
    let a = render_as(&plain, "none", 30, 4096);
    let b = render_as(&veiled, "none", 60, 4096);
    for (i, (p, q)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        for c in 0..3 {
            let error = (p.variance_of_mean()[c] + q.variance_of_mean()[c]).sqrt();
            let z = (p.mean()[c] - q.mean()[c]) / error;
            assert!(z.abs() < LIMIT && error < 0.05 * p.mean()[c], "pixel {i}, channel {c}: {z} standard errors");
        }
    }
    let (difference, error) = (a.mean() - b.mean(), a.error_of_mean().hypot(b.error_of_mean()));
    assert!(difference.abs() < 4.0 * error && error < 0.004 * a.mean(), "{difference} +- {error}");

    // before the environment nothing is random, and a boundary is no segment
    let mut environment = in_white_environment(camera([0.0, 0.0, 5.0], [0.0; 3], 20.0, [8, 8]));
    let air = environment.add_material("air", Model::Null);
    add_sphere(&mut environment, air, [0.0; 3], 0.5, Sphere { subdivisions: 3, smooth: true, inwards: false });
    let image = render_as(&environment, "none", 1, 16);
    assert!(image.pixels.iter().all(|p| p.mean() == [1.0; 3]));
}

/// A one-sided wall is black from behind but still stops light. Killed by: culling of backs in traversal.
#[test]
fn one_sided_walls_cast_shadows() {
    for front in [1.0, -1.0] {
        let mut s = spot(0.5, [4, 4]);
        let wall = s.add_material("wall", grey(0.9));
        s.materials[wall as usize].two_sided = false;
        add_quad(&mut s, "wall", wall, facing_y(3.0, 1.0, front));
        s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] });
        assert_eq!(render_as(&s, "none", 2, 16).mean(), 0.0, "direct light is stopped");
        // with its front below it would light the floor again, had it light
        assert_eq!(render_as(&s, "none", 9, 16).mean(), 0.0);
    }
}

/// The emission of a two-sided surface still leaves from its front only. Killed by: emission that follows the shading
/// side.
#[test]
fn backs_do_not_emit() {
    for (front, expected) in [(1.0, 0.75), (-1.0, 0.0)] {
        let mut s =
            SceneDescription { camera: camera([0.0, 0.0, 5.0], [0.0; 3], 1.0, [4, 4]), ..SceneDescription::default() };
        let emitter = s.add_material("emitter", grey(0.5));
        add_quad(&mut s, "emitter", emitter, facing_z(1.0, 0.0, front));
        s.emitters.push(Emitter::Area { material: emitter, radiance: [0.75; 3] });
        assert_eq!(render_as(&s, "none", 10, 16).mean(), expected);
    }
}

/// A lens leaves the furnace alone and blurs what is out of focus, with the same total. Killed by: weights of lens
/// samples.
#[test]
fn lenses_blur_but_keep_light() {
    let scene = |radius: f32, focus_distance: f32| {
        let mut s = in_white_environment(camera([0.0, 0.0, 5.0], [0.0; 3], 30.0, [16, 16]));
        s.camera.lens = (radius > 0.0).then_some(ThinLens { radius, focus_distance });
        s.environment = None;
        let emitter = s.add_material("emitter", grey(0.0));
        add_quad(&mut s, "emitter", emitter, facing_z(0.4, 0.0, 1.0));
        s.emitters.push(Emitter::Area { material: emitter, radiance: [1.0; 3] });
        render_as(&s, "none", 1, 4096)
    };
    let (sharp, focused, blurred) = (scene(0.0, 1.0), scene(0.3, 5.0), scene(0.3, 2.5));
    let lit = |i: &Image| i.pixels.iter().filter(|p| p.mean()[0] > 0.0).count();
    let difference = (focused.mean() - sharp.mean()).abs();
    assert!(difference < 4.0 * focused.error_of_mean().hypot(sharp.error_of_mean()), "{difference}");
    assert_eq!(lit(&focused), lit(&sharp));
    assert!(lit(&blurred) > 2 * lit(&sharp), "{} pixels of {}", lit(&blurred), lit(&sharp));
}
