//! What the statistics leave out, and in which units first vertices are kept: one sample of enormous weight must not
//! decide all factors.

use croupier::Settings;
use croupier::unstable::film::PixelStats;
use croupier::unstable::learn::{Learning, PictureStatistics};
use croupier_host::description::*;
use croupier_tests::cache::{FIELDS, Oracle};
use croupier_tests::runner::{Learned, Schedule, learning, settings};
use croupier_tests::scenes::*;

const IN_ORDER: Schedule = Schedule::InOrder(1 << 20);
/// Number of the octree of diffuse first vertices.
const FIRST_MATTE: u32 = 2;

/// Picture of an environment of radiance 1 with emitters of 1e4 that cover a quarter of a pixel each.
fn starry(stars: usize) -> SceneDescription {
    let mut s = in_white_environment(camera([0.0; 3], [0.0, 0.0, -1.0], 90.0, [64, 64]));
    let emitter = s.add_material("emitter", grey(0.0));
    for star in 0..stars {
        // pixels are 1/32 wide where the emitters are
        let centre = [3 + 7 * (star % 8), 3 + 7 * (star / 8)].map(|i| (i as f32 + 0.5) / 32.0 - 1.0);
        let corners = facing_z(1.0 / 128.0, -1.0, 1.0).map(|[x, y, z]| [x + centre[0], y + centre[1], z]);
        add_quad(&mut s, "emitter", emitter, corners);
    }
    s.emitters.push(Emitter::Area { material: emitter, radiance: [1e4; 3] });
    s
}

/// Of 4096 pixels the 5 with the largest errors (0.1 %, rounded down, and one) are left out of the picture's variance,
/// and kept apart. Killed by: outliers that count, more or fewer of them, a limit that is not the smallest outlier's.
#[test]
fn the_worst_thousandth_is_kept_apart() {
    let measured = |stars: usize| {
        let scene = blob(&starry(stars));
        let s = settings(&scene, "ears");
        let mut found = None;
        learning(&scene, &s, &[64, 1024, 0], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if i == 0 {
                // the emitters are not in the estimate, so that each is an outlier, and nothing else is
                l.give(&[[1.0; 3]; 64 * 64]).unwrap();
            }
            found = Some(l.statistics()[0]);
        });
        found.unwrap()
    };
    let error = |p: &PictureStatistics| p.variance + p.outliers;
    // an emitter in a quarter of the pixel: mean squared error 0.25 (1e4 - 1)^2 over 1.01
    let one = 0.25 * 9999.0f64.powi(2) / 1.01 / 4096.0;
    for stars in [1, 4, 5] {
        let p = measured(stars);
        assert_eq!(p.variance, 0.0, "{stars} stars: {p:?}");
        assert!((p.outliers / (stars as f64 * one) - 1.0).abs() < 0.3, "{stars} stars: {p:?}");
    }
    // the limit is that of one sample: all 1024 of a pixel would make it such an outlier
    let five = measured(5);
    assert!((five.limit / 1024.0 / (4096.0 * one) - 1.0).abs() < 0.5 && measured(4).limit == 0.0, "{five:?}");
    let p = measured(40);
    assert!((error(&p) / (40.0 * one) - 1.0).abs() < 0.1, "{p:?}");
    let share = p.outliers / error(&p);
    assert!(share > 5.0 / 40.0 && share < 10.0 / 40.0, "{share}: 5 of 40 stars, the brightest");
}

/// Next event estimation on a floor where one light sample in 20,000 is 20,000 times as bright as the others: in the
/// moments of its cells it counts no more than the limit. Killed by: contributions that are logged as they are, a limit
/// in other units than those of the error, a clip that reaches the picture.
#[test]
fn moments_leave_fireflies_out() {
    let mut s = SceneDescription {
        camera: camera([0.0, 1.0, 0.0], [0.0, 0.0, 0.0], 40.0, [64, 64]),
        ..SceneDescription::default()
    };
    let floor = s.add_material("floor", grey(0.8));
    add_quad(&mut s, "floor", floor, facing_y(1.0, 0.0, 1.0));
    // lights are chosen by power, and a scene of this size makes the sun's enormous
    add_quad(&mut s, "far", floor, facing_y(1e-3, 0.0, 1.0).map(|[x, y, z]| [x + 565.0, y, z]));
    add_quad(&mut s, "far", floor, facing_y(1e-3, 0.0, 1.0).map(|[x, y, z]| [x - 565.0, y, z]));
    s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [100.0; 3] });
    s.emitters.push(Emitter::Point { position: [0.0, 2.0, 0.0], intensity: [400.0; 3] });
    // the other noise, without which every error would be an outlier
    s.environment = Some(Environment::Constant { radiance: [30.0; 3] });
    let scene = blob(&s);
    let s = settings(&scene, "ears");
    let s = Settings {
        max_depth: 2,
        seed: 3,
        learning: Learning { decay: 1.0, subdivide_count: f32::MAX, ..s.learning },
        ..s
    };
    let mut sums = [0.0; FIELDS];
    let image =
        learning(&scene, &s, &[[1].as_slice(), &[4; 40], &[0]].concat(), IN_ORDER, &mut |_, l: &mut dyn Learned| {
            let oracle = Oracle::new(&l.saved().unwrap());
            let leaf = oracle.cell(FIRST_MATTE, [0.0; 3]).leaf;
            sums = [0.0; FIELDS];
            oracle.leaves[leaf].iter().flat_map(|bin| bin.iter().enumerate()).for_each(|(i, x)| sums[i] += x);
        });
    let sun = (80.0 / std::f64::consts::PI).powi(2);
    let moment = |p: &PixelStats| p.spread[0] / p.samples as f64 + p.mean()[0].powi(2);
    let seen = image.pixels.iter().map(moment).sum::<f64>() / image.pixels.len() as f64 / sun;
    let logged = sums[6] / sums[0];
    assert!(seen > 1000.0, "{seen}: no firefly was met, so nothing is tested");
    // sun and environment, two lights of about equal power and probability, have the square of their sum as second
    // moment: between 0.44 and 1 of the pixel's square, as the pixel's estimate knows of the fireflies or not
    assert!(sums[0] > 1e5 && (0.3..3.0).contains(&logged), "{logged} in units of the pixel's square, {seen} seen");
}

/// Values at first vertices are in units of their pixel: a bright and a dim picture of the same thing give the same
/// statistics. Killed by: radiance, or radiance over albedo, in their place; a unit that is not that of the error.
#[test]
fn first_vertices_count_in_pixels() {
    for radiance in [0.1f32, 100.0] {
        let mut s = in_white_environment(camera([0.0, 1.0, 0.0], [0.0, 0.0, 0.0], 40.0, [16, 16]));
        s.environment = Some(Environment::Constant { radiance: [radiance; 3] });
        let floor = s.add_material("floor", grey(0.5));
        add_quad(&mut s, "floor", floor, facing_y(1.0, 0.0, 1.0));
        let scene = blob(&s);
        let s = Settings { max_depth: 2, ..settings(&scene, "ears") };
        let mut mean = 0.0;
        learning(&scene, &s, &[256, 64, 64, 0], IN_ORDER, &mut |_, l: &mut dyn Learned| {
            let oracle = Oracle::new(&l.saved().unwrap());
            let bins = oracle.leaves[oracle.cell(FIRST_MATTE, [0.0; 3]).leaf];
            let total = |i: usize| bins.iter().map(|b| b[i]).sum::<f64>();
            mean = total(3) / total(0).max(1.0);
        });
        let pixel = 0.5 * f64::from(radiance);
        let expected = pixel / (pixel * pixel + 0.01).sqrt();
        assert!((mean / expected - 1.0).abs() < 0.02, "radiance {radiance}: {mean}, not {expected}");
    }
}
