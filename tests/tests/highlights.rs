//! Highlights that a picture may not have found yet: which scenes have them, and what they make of its stated error.

use croupier::{EditableScene, Scene};
use croupier_host::description::{
    Emitter, Environment, LightShape, Model, Principled, Reflectance, SceneDescription, ShapeLight,
};
use croupier_tests::runner::{Schedule, render, scheduled, settings};
use croupier_tests::scenes::*;

const WHITE: Reflectance = Reflectance::Constant([1.0; 3]);

/// A diffuse Cornell box whose lamp has a radiance of 6, with a box of this model in it.
fn with_box(model: Model) -> SceneDescription {
    let mut s = cornell([16, 16]);
    let material = s.add_material("box", model);
    add_box(&mut s, material, [-0.4, -1.0, -0.4], [0.2, -0.4, 0.2], false);
    s
}

fn highlight(s: &SceneDescription) -> f32 {
    Scene::from_bytes(&blob(s)).expect("a valid scene").highlight
}

/// Killed by: a lobe whose width is not looked at, a coat that is forgotten, boundaries of media that count as smooth.
#[test]
fn narrow_lobes_show_the_lamp() {
    let (int_ior, ext_ior, reflectance) = (1.5, 1.0, WHITE);
    let (eta, k) = ([0.2; 3], [3.0; 3]);
    let layered = |roughness, coat, coat_roughness| {
        Model::Principled(Principled { roughness, coat, coat_roughness, ..Principled::default() })
    };
    let narrow = [
        Model::Mirror { reflectance },
        Model::Conductor { eta, k, reflectance },
        Model::Dielectric { int_ior, ext_ior },
        Model::ThinDielectric { int_ior, ext_ior },
        Model::Plastic { reflectance, int_ior, ext_ior },
        Model::RoughConductor { eta, k, reflectance, alpha: 0.04 },
        Model::RoughDielectric { int_ior, ext_ior, alpha: 0.04 },
        Model::RoughPlastic { reflectance, int_ior, ext_ior, alpha: 0.04 },
        layered(0.2, 0.0, 0.5),
        layered(0.5, 1.0, 0.2),
    ];
    let wide = [
        Model::Diffuse { reflectance },
        Model::Null,
        Model::RoughConductor { eta, k, reflectance, alpha: 0.06 },
        Model::RoughDielectric { int_ior, ext_ior, alpha: 0.06 },
        Model::RoughPlastic { reflectance, int_ior, ext_ior, alpha: 0.06 },
        layered(0.5, 0.0, 0.2),
        layered(0.5, 1.0, 0.5),
    ];
    for model in narrow {
        assert_eq!(highlight(&with_box(model)), 6.0, "{model:?}");
    }
    for model in wide {
        assert_eq!(highlight(&with_box(model)), 0.0, "{model:?}");
    }
}

/// The brightest of what rays can meet: emitters of triangles and of shapes, constants, maps times their scale by channel;
/// not points and suns, which no ray meets. Killed by: a maximum over texels of other channels' scale, light that only
/// light samples find.
#[test]
fn the_brightest_that_rays_can_meet_counts() {
    let mut s = with_box(Model::Mirror { reflectance: WHITE });
    s.emitters.push(Emitter::Point { position: [0.0; 3], intensity: [1e3; 3] });
    s.emitters.push(Emitter::Sun { direction: [0.0, -1.0, 0.0], irradiance: [1e3; 3], angle_deg: 0.5 });
    assert_eq!(highlight(&s), 6.0);
    s.environment = Some(Environment::Constant { radiance: [7.0, 1.0, 1.0] });
    assert_eq!(highlight(&s), 7.0);
    let texels = (0..8 * 5).map(|i| [0.5, if i == 9 { 3.0 } else { 0.1 }, 0.25]).collect();
    let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    s.environment = Some(Environment::Map { texels, width: 8, height: 5, to_world, scale: [10.0, 4.0, 2.0] });
    assert_eq!(highlight(&s), 12.0);
    let shape = LightShape::Sphere { radius: 0.1 };
    s.emitters.push(Emitter::Shape(ShapeLight {
        shape,
        position: [0.0, 0.5, 0.0],
        radiance: [1.0, 2.0, 20.0],
        two_sided: false,
        visible: true,
    }));
    assert_eq!(highlight(&s), 20.0);
}

/// After edits of materials, lamps and sky it is what a validator finds in the same bytes. Killed by: an edit that leaves
/// the old one, a scene that is edited twice and remembers the first time.
#[test]
fn edits_change_it() {
    let mut s = with_box(Model::RoughConductor { eta: [0.2; 3], k: [3.0; 3], reflectance: WHITE, alpha: 0.5 });
    s.environment = Some(Environment::Constant { radiance: [0.5; 3] });
    let mut scene = EditableScene::new(blob(&s)).expect("a valid scene");
    let index = s.materials.iter().position(|m| m.name == "box").expect("its material") as u32;
    let mut edit = |alpha: f32, lamp: f32, sky: f32, expected: f32| {
        let material = scene.scene().materials[index as usize];
        let sky = croupier::unstable::scene::blob::Environment {
            radiance: [sky; 3],
            ..*scene.scene().environment.expect("a sky")
        };
        let emitter = s.materials.iter().position(|m| m.name == "emitter").expect("its material") as u32;
        let mut e = scene.edit();
        e.material(index, croupier::unstable::scene::blob::Material { alpha, ..material }, &[]).expect("a material");
        e.emission(emitter, [lamp; 3]).expect("a radiance");
        e.environment(sky).expect("a sky");
        drop(e);
        assert_eq!(scene.scene().highlight, expected, "{alpha} {lamp}");
        scene.seal();
        assert_eq!(Scene::from_bytes(scene.bytes()).expect("a valid scene").highlight, expected);
    };
    edit(0.01, 6.0, 0.5, 6.0);
    edit(0.01, 3.0, 0.5, 3.0);
    edit(0.01, 3.0, 9.0, 9.0);
    edit(0.5, 3.0, 9.0, 0.0);
    edit(0.02, 3.0, 1.0, 3.0);
}

/// A wall of mean 1/2 with something smooth behind it and a lamp of radiance 3.5: a sample of that in a pixel of n would be
/// an error of (3/n)^2 / (1/4 + 0.01) there. Killed by: an error of the whole picture in each pixel, n or L in place of their
/// squares, a highlight that replaces nothing, samples of the last iteration alone, a picture of 40,000 pixels that has
/// worst ones to leave out.
#[test]
fn one_highlight_more_is_told() {
    let of = |size: [u32; 2], iterations: &[u32]| {
        let mut s = in_white_environment(camera([0.0, 0.0, 10.0], [0.0; 3], 1.0, size));
        let wall = s.add_material("wall", grey(0.5));
        add_quad(&mut s, "wall", wall, facing_z(1.0, 0.0, 1.0));
        let mirror = s.add_material("mirror", Model::Mirror { reflectance: WHITE });
        add_quad(&mut s, "mirror", mirror, facing_z(0.1, -1.0, 1.0));
        // behind the wall, turned away from it
        let lamp = s.add_material("lamp", grey(0.0));
        add_quad(&mut s, "lamp", lamp, facing_z(0.1, -2.0, -1.0));
        s.emitters.push(Emitter::Area { material: lamp, radiance: [3.5; 3] });
        let scene = blob(&s);
        scheduled(&scene, &settings(&scene, "none"), iterations, Schedule::InOrder(1 << 20)).error
    };
    for (size, iterations, n) in [([32, 32], &[16][..], 16.0), ([40, 20], &[4, 12, 16], 32.0)] {
        let e = of(size, iterations);
        let expected = 9.0 / (n * n * 0.26 * f64::from(size[0] * size[1]));
        assert!((e.highlight / expected - 1.0).abs() < 0.05, "{} for {expected}", e.highlight);
    }
    assert!(of([199, 201], &[2]).highlight > 0.0);
    assert_eq!(of([200, 200], &[2]).highlight, 0.0);
}

/// A small bright emitter and something smooth leave the error of a picture open until there are enough samples; without
/// anything smooth it is told. Killed by: a flag that the highlight does not reach.
#[test]
fn bright_lamps_in_mirrors_leave_the_error_open() {
    let of = |model: Model, spp: u32| {
        let mut s = with_box(model);
        s.camera.size = [48, 48];
        s.emitters.clear();
        let lamp = s.add_material("lamp", grey(0.0));
        add_quad(&mut s, "lamp", lamp, facing_y(0.02, 0.9, -1.0));
        s.emitters.push(Emitter::Area { material: lamp, radiance: [80.0; 3] });
        s.environment = Some(Environment::Constant { radiance: [1.0; 3] });
        let scene = blob(&s);
        render(&scene, &settings(&scene, "classic"), spp).error
    };
    let mirror = Model::Mirror { reflectance: WHITE };
    for (model, spp, resolved) in [(grey(0.5), 8, true), (mirror, 8, false), (mirror, 1024, true)] {
        let e = of(model, spp);
        assert!(e.effective_pixels > 64.0, "{model:?} {spp}: {e:?}");
        assert_eq!(e.is_resolved(), resolved, "{model:?} {spp}: {e:?}");
        assert_eq!(e.interval().is_some(), resolved);
    }
}
