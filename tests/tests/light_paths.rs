//! Light paths, which a guide that has learned nothing learns from in its first iteration.

use croupier::unstable::learn::Guiding;
use croupier::unstable::light::{LightSelector, TreeSelector};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::{Scene, Settings};
use croupier_host::description::{Emitter, Model, Reflectance, SceneDescription};
use croupier_tests::runner::{Image, Learned, Schedule, learning, settings};
use croupier_tests::scenes::*;

fn guided(scene: &[u8], guiding: Guiding) -> Settings {
    let mut s = Settings { max_depth: 6, shards: 3, seed: 2, size: [64, 64], ..settings(scene, "ears") };
    s.learning.cache_bytes = 1 << 20;
    (s.learning.guiding, s.learning.guide_bytes) = (guiding, 1 << 20);
    s
}

fn run(scene: &[u8], s: &Settings, iterations: &[u32], before: &mut dyn FnMut(usize, &mut dyn Learned)) -> Image {
    learning(scene, s, iterations, Schedule::InOrder(1 << 20), before)
}

/// A box whose small emitter lies behind a slab of glass: where camera paths go on from the floor they hardly ever meet it,
/// and light samples never see it.
fn behind_glass() -> SceneDescription {
    let mut s = box_with_emitter();
    let glass = s.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    add_box(&mut s, glass, [-0.99, 0.7, -0.99], [0.99, 0.8, 0.99], false);
    let small = s.add_material("small", grey(0.0));
    add_quad(&mut s, "small", small, facing_y(0.1, 0.9, -1.0));
    s.emitters = vec![Emitter::Area { material: small, radiance: [50.0, 60.0, 70.0] }];
    s
}

/// Lights are chosen by power, wherever they face: here none is seen from the middle of the scene, where a light tree would
/// choose none. Killed by: the tree's choice.
#[test]
fn lights_emit_that_the_middle_does_not_see() {
    let mut s = box_with_emitter();
    let up = s.add_material("up", grey(0.0));
    let mut face = facing_y(0.1, 0.5, 1.0);
    for x in 0..40 {
        face.iter_mut().for_each(|p| p[1] += 0.01);
        add_quad(&mut s, &format!("up {x}"), up, face);
    }
    s.emitters = vec![Emitter::Area { material: up, radiance: [5.0, 6.0, 7.0] }];
    let scene = blob(&s);
    let view = Scene::from_bytes(&scene).expect("a valid scene");
    let middle = Vec3x8::ZERO;
    let (_, tree) = TreeSelector(view).select(middle, Vec3x8::ZERO, U32x8::splat(1 << 31), Mask8::all_lanes());
    assert!(!view.light_nodes.is_empty() && tree.eq(F32x8::ZERO).all(), "the tree chooses a light: {tree:?}");
    let image = run(&scene, &guided(&scene, Guiding::On), &[1], &mut |_, _| ());
    assert!(image.counters.light_path_rays > 1000, "{:?}", image.counters);
}

/// Between a black floor and a mirror nothing is learned but what light paths note on the floor: of a surface that emits its
/// image, which camera paths can meet; of a point nothing, since nothing but light samples finds it, and not in mirrors.
/// Killed by: notes of what no camera path finds, lights that are taken for points.
#[test]
fn images_of_points_are_not_noted() {
    let image = Emitter::Area { material: 2, radiance: [5.0; 3] };
    for (emitter, noted) in [(Emitter::Point { position: [0.0; 3], intensity: [1.0; 3] }, false), (image, true)] {
        let mut s = SceneDescription {
            camera: camera([0.0, 0.5, 0.0], [0.1, -1.0, 0.1], 70.0, [64, 64]),
            ..SceneDescription::default()
        };
        let black = s.add_material("black", grey(0.0));
        let mirror = s.add_material("mirror", Model::Mirror { reflectance: Reflectance::Constant([0.9; 3]) });
        let small = s.add_material("small", grey(0.0));
        assert_eq!(small, 2, "the emitter's material");
        add_quad(&mut s, "floor", black, facing_y(10.0, -1.0, 1.0));
        add_quad(&mut s, "mirror", mirror, facing_y(10.0, 1.0, -1.0));
        add_quad(&mut s, "small", small, facing_y(0.1, 0.0, 1.0));
        s.emitters = vec![emitter];
        let scene = blob(&s);
        let mut guides = vec![];
        let image = run(&scene, &guided(&scene, Guiding::On), &[1, 1], &mut |_, l| {
            guides.push(l.guide().expect("a guide").0);
        });
        assert!(image.counters.light_path_rays > 1000, "{:?}", image.counters);
        assert_eq!(guides[1] != guides[0], noted, "{} and {} bytes", guides[0].len(), guides[1].len());
    }
}

/// In the first iteration alone, of guides that have learned nothing, within the work that one camera sample for each pixel
/// takes. Killed by: light paths in every iteration, with a guide that was loaded, without a guide, as many as camera
/// samples.
#[test]
fn light_paths_are_traced_once() {
    let scene = blob(&mirror_and_glass());
    let traced = |s: &Settings, iterations: &[u32]| run(&scene, s, iterations, &mut |_, _| ()).counters.light_path_rays;
    let s = guided(&scene, Guiding::On);
    let once = traced(&s, &[1]);
    assert!((1000..64 * 64 * 4).contains(&once), "{once} rays");
    assert_eq!((traced(&s, &[1, 1, 2]), traced(&s, &[16])), (once, once));
    assert_eq!(traced(&guided(&scene, Guiding::Off), &[1, 1]), 0);
    let mut saved = None;
    run(&scene, &s, &[1, 1], &mut |_, l| saved = l.saved_statistics());
    let saved = saved.expect("statistics");
    let again = run(&scene, &s, &[1, 1], &mut |i, l| {
        if i == 0 {
            l.load_statistics(&saved).expect("statistics of this scene");
        }
    });
    assert_eq!(again.counters.light_path_rays, 0);
}

/// Light behind glass and mirrors is known after one camera sample for each pixel, and known to gain two samples later:
/// camera paths take far more. Killed by: arrivals of another place, normal or direction than those of camera paths that
/// find the light, shares of guided samples that stay 0, arrivals straight from the light alone.
#[test]
fn caustics_are_found_at_once() {
    let scene = blob(&behind_glass());
    let mut gains = 0;
    for seed in 0..6 {
        let (mut found, mut once) = (None, false);
        let s = Settings { seed, ..guided(&scene, Guiding::Auto) };
        run(&scene, &s, &[1, 1, 1, 1], &mut |_, l| {
            found = l.guide_use();
            // the bound that the guide was enabled above when light paths were tuned, in a picture of unknown independence
            let gain = found.and_then(|f| f.gain).map(|g| 0.85 * g.gain * (1.0 - 0.25 * g.error));
            once |= gain.is_some_and(|gain| gain > 1.08);
        });
        println!("seed {seed}: a gain {once}, {found:?}");
        gains += u32::from(once);
    }
    assert!(gains >= 4, "a gain with {gains} of 6 seeds");
}
