//! Light that passes panes, holes of cut-outs and boundaries straight on: light samples see through them, rays that pass
//! keep the density that they began with, and a window costs little.

use croupier::Settings;
use croupier_host::description::*;
use croupier_tests::bsdf::fresnel_dielectric;
use croupier_tests::media_scene::{assert_channels, assert_exact};
use croupier_tests::runner::{Image, Schedule, render, scheduled, settings};
use croupier_tests::scenes::*;
use croupier_tests::texture_oracle::lookup;
use std::f64::consts::PI;

/// |z| that a comparison may reach: with the 100 of this file a false alarm in 5e4 runs.
const LIMIT: f64 = 5.2;

const PANE: Model = Model::ThinDielectric { int_ior: 1.5, ext_ior: 1.0 };

fn render_as(s: &SceneDescription, strategy: &str, max_depth: u32, spp: u32) -> Image {
    let scene = blob(s);
    render(&scene, &Settings { max_depth, ..settings(&scene, strategy) }, spp)
}

/// Share of light that passes a thin sheet of index 1.5 at a cosine.
fn passes(cos: f64) -> f64 {
    let r = fresnel_dielectric(cos, 1.0, 1.5);
    1.0 - 2.0 * r / (1.0 + r)
}

/// Horizontal panes of one material at the heights `y` above the spot at the origin. No ray of the tests meets the edge
/// between their triangles, where a search counts both.
fn add_panes(s: &mut SceneDescription, model: Model, y: &[f32]) {
    let pane = s.add_material("pane", model);
    for y in y {
        add_quad(s, "pane", pane, facing_y(4000.0, *y, 1.0).map(|[x, y, z]| [x + 1.0, y, z + 0.25]));
    }
}

/// rho / pi E cos (1 - R')^n through n panes, without noise: parallel light, and a point. Killed by: a pane that blocks
/// shadow rays, a transmittance by chance, the reflectance of one interface, a cosine of another direction, a shadow ray
/// to a point that is not shortened behind a pane.
#[test]
fn panes_before_delta_lights_are_a_factor() {
    for degrees in [0.0f64, 30.0, 60.0, 80.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        for heights in [&[][..], &[1.0], &[0.75, 2.0], &[0.75, 0.751, 0.752, 1.5]] {
            let factor = passes(cos).powi(heights.len() as i32);
            let mut s = spot(0.5, [4, 4]);
            add_panes(&mut s, PANE, heights);
            let mut points = s.clone();
            s.emitters
                .push(Emitter::Directional { direction: [-sin as f32, -cos as f32, 0.0], irradiance: [3.0, 2.0, 1.0] });
            let expected = [3.0, 2.0, 1.0].map(|e| 0.5 / PI * e * cos * factor);
            let what = format!("{degrees} degrees, {} panes", heights.len());
            let image = render_as(&s, "none", 2, 16);
            assert_exact(&what, &image, expected, 2e-5);
            // a search for what blocks for sure, and one for each pane, all counted
            assert_eq!(image.counters.shadow_rays, 256 * (1 + heights.len() as u64), "{what}");
            // panes above the point are not passed
            let at = 1.2f64;
            points.emitters.push(Emitter::Point {
                position: [(at * sin / cos) as f32, at as f32, 0.0],
                intensity: [3.0, 2.0, 1.0],
            });
            let below = heights.iter().filter(|y| f64::from(**y) < at).count();
            let far = at / cos;
            let expected = [3.0, 2.0, 1.0].map(|i| 0.5 / PI * i / (far * far) * cos * passes(cos).powi(below as i32));
            assert_exact(&format!("point, {what}"), &render_as(&points, "none", 2, 16), expected, 5e-4);
        }
    }
}

/// Area lights from tiny to huge and the environment behind one pane or two, which light samples and scattered rays both
/// find. Killed by: the weight of a ray that has forgotten its density behind a pane, or how far it has come; light that
/// counts in full by both techniques.
#[test]
fn panes_before_area_lights_follow_quadrature() {
    for heights in [&[1.0f32][..], &[0.75, 1.25]] {
        let through = |cos: f64| passes(cos).powi(heights.len() as i32);
        for half in [0.05f64, 1.0, 8.0] {
            let mut s = spot(0.8, [4, 4]);
            add_panes(&mut s, PANE, heights);
            let emitter = s.add_material("emitter", grey(0.0));
            add_quad(&mut s, "emitter", emitter, facing_y(half as f32, 2.0, -1.0));
            s.emitters.push(Emitter::Area { material: emitter, radiance: [2.0; 3] });
            let (n, mut sum) = (400, 0.0);
            for i in 0..n {
                for j in 0..n {
                    let at = |i: i32| (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0) * half;
                    let d2 = at(i).powi(2) + at(j).powi(2) + 4.0;
                    let cos = 2.0 / d2.sqrt();
                    sum += 2.0 * through(cos) * cos * cos / d2;
                }
            }
            let expected = 0.8 / PI * sum * (2.0 * half / f64::from(n)).powi(2);
            let image = render_as(&s, "none", 2, 8192);
            let what = format!("half a width of {half}, {} panes", heights.len());
            assert_channels(&what, &image, [expected; 3], [LIMIT, 0.006, 1e-4, 0.0]);
        }
        let mut s = spot(0.8, [4, 4]);
        add_panes(&mut s, PANE, heights);
        s.environment = Some(Environment::Constant { radiance: [1.0; 3] });
        let n = 20_000;
        let cos = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
        let sum: f64 = (0..n).map(|i| 2.0 * cos(i) * through(cos(i))).sum::<f64>() / f64::from(n);
        for strategy in ["none", "fixed:2"] {
            let image = render_as(&s, strategy, 2, 8192);
            let what = format!("environment, {} panes, {strategy}", heights.len());
            // the panes end at 4000 times their height
            assert_channels(&what, &image, [0.8 * sum; 3], [LIMIT, 0.006, 2e-4, 0.0]);
        }
    }
}

/// A black texture of 2 x 2 texels with those alphas, row 0 at the top.
fn cutout(s: &mut SceneDescription, alpha: [u8; 4]) -> u32 {
    let texels = alpha.map(|a| [0, 0, 0, a]).to_vec();
    s.textures.push(Texture { name: "holes".into(), width: 2, height: 2, texels, ..Texture::default() });
    let material = s.add_material("cut-out", Model::Diffuse { reflectance: Reflectance::Texture(0) });
    s.materials[material as usize].cutout = true;
    material
}

const CONSTANT: [u8; 4] = [64; 4];
const CHECKS: [u8; 4] = [255, 0, 0, 200];

/// Light passes a cut-out by 1 - alpha: without noise where light samples look through it, on the average where the
/// camera does, at an emitter or at the sky. Killed by: alpha for 1 - alpha, alpha decoded as a colour, shadow rays that
/// read another texel than camera rays.
#[test]
fn cut_outs_pass_what_alpha_leaves() {
    for alphas in [CONSTANT, CHECKS] {
        // the spot is lit through the point of the texture above it
        for [x, z] in [[0.0f32, 0.0], [0.3, -0.2], [-0.8, 0.55], [0.1, 0.9]] {
            let mut s = spot(0.5, [4, 4]);
            let holes = cutout(&mut s, alphas);
            add_quad(&mut s, "holes", holes, facing_y(1.0, 1.0, 1.0).map(|p| [p[0] + x, p[1], p[2] + z]));
            s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] });
            // u along x, v along -z; alpha is linear, a code for every channel gives it as a colour of 0 or 1
            let uv = [f64::from(1.0 - x) / 2.0, f64::from(1.0 + z) / 2.0];
            let share = |code: u8| lookup(&alphas.map(|a| [if a == code { 255 } else { 0 }; 3]), 2, 2, uv)[0];
            let mut codes = alphas.to_vec();
            codes.sort_unstable();
            codes.dedup();
            let alpha: f64 = codes.iter().map(|a| f64::from(*a) / 255.0 * share(*a)).sum();
            let image = render_as(&s, "none", 2, 16);
            assert_exact(&format!("{alphas:?} at {x} {z}"), &image, [0.5 / PI * (1.0 - alpha); 3], 3e-4);
        }
        // all of the texture fills the picture
        let mean = alphas.iter().map(|a| f64::from(*a) / 255.0).sum::<f64>() / 4.0;
        for behind in ["sky", "emitter"] {
            let mut s = SceneDescription {
                camera: camera([0.0, 0.0, 1.0], [0.0; 3], 90.0, [8, 8]),
                ..SceneDescription::default()
            };
            let holes = cutout(&mut s, alphas);
            add_quad(&mut s, "holes", holes, facing_z(1.0, 0.0, 1.0));
            if behind == "sky" {
                s.environment = Some(Environment::Constant { radiance: [2.0; 3] });
            } else {
                let emitter = s.add_material("emitter", grey(0.0));
                add_quad(&mut s, "emitter", emitter, facing_z(90.0, -3.0, 1.0));
                s.emitters.push(Emitter::Area { material: emitter, radiance: [2.0; 3] });
            }
            let image = render_as(&s, "none", 1, 4096);
            assert_channels(
                &format!("{behind}, {alphas:?}"),
                &image,
                [2.0 * (1.0 - mean); 3],
                [LIMIT, 0.004, 1e-4, 0.0],
            );
        }
    }
}

/// Boundaries without a medium around the camera, the lights and everything change no expectation, whatever the
/// strategy, and no path gets longer. Killed by: a passage with a factor of roulette, a segment, a forgotten density.
#[test]
fn boundaries_around_everything_change_nothing() {
    let plain = cornell([8, 8]);
    let mut veiled = plain.clone();
    let air = veiled.add_material("air", Model::Null);
    add_box(&mut veiled, air, [-30.0; 3], [30.0; 3], false);
    add_box(&mut veiled, air, [-0.97; 3], [0.97; 3], false);
    // what `ears` learns in such small pictures makes its paths longer or shorter, by a percent with one seed or another
    for (strategy, iterations, seeds) in
        [("none", &[512][..], 1), ("classic", &[512], 1), ("fixed:1.7", &[256], 1), ("ears", &[16, 64, 128, 512], 8)]
    {
        let both = [&plain, &veiled].map(|s| {
            let scene = blob(s);
            let base = Settings { max_depth: 6, ..settings(&scene, strategy) };
            let render = |seed| scheduled(&scene, &Settings { seed, ..base }, iterations, Schedule::InOrder(1 << 20));
            (0..seeds).map(render).collect::<Vec<_>>()
        });
        let [a, b] = [&both[0][0], &both[1][0]];
        let (difference, error) = (a.mean() - b.mean(), a.error_of_mean().hypot(b.error_of_mean()));
        assert!(difference.abs() < LIMIT * error, "{strategy}: {difference} +- {error}");
        assert!(error < 0.008 * a.mean(), "{strategy}: {error} of {}", a.mean());
        let of_all = |images: &[Image], f: fn(&Image) -> u64| images.iter().map(f).sum::<u64>() as f64;
        let [of_plain, of_veiled] =
            [&both[0], &both[1]].map(|i| of_all(i, |i| i.counters.path_segments) / of_all(i, |i| i.counters.paths()));
        assert!((of_veiled / of_plain - 1.0).abs() < 0.02, "{strategy}: paths of {of_veiled}, not {of_plain} segments");
        assert_eq!((b.counters.passages_cut, b.counters.non_finite), (0, 0));
    }
}

/// A room with a window, before a sun and a sky.
fn room(pane: bool) -> SceneDescription {
    let mut s = SceneDescription {
        camera: camera([-0.6, 0.1, 0.9], [0.5, -0.35, -0.6], 60.0, [24, 24]),
        max_depth: 8,
        ..SceneDescription::default()
    };
    let white = s.add_material("white", diffuse([0.7, 0.65, 0.6]));
    let z = |z: f32, to: f32| facing_z(1.0, z, to);
    add_quad(&mut s, "floor", white, facing_y(1.0, -1.0, 1.0));
    add_quad(&mut s, "ceiling", white, facing_y(1.0, 1.0, -1.0));
    add_quad(&mut s, "back", white, z(-1.0, 1.0));
    add_quad(&mut s, "front", white, z(1.0, -1.0));
    add_quad(&mut s, "left", white, [[-1.0, -1.0, 1.0], [-1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, 1.0, 1.0]]);
    // the right wall has a hole
    let strip = |z: [f32; 2], y: [f32; 2]| [[1.0, y[0], z[0]], [1.0, y[0], z[1]], [1.0, y[1], z[1]], [1.0, y[1], z[0]]];
    let hole = [[-0.5, 0.5], [-0.2, 0.6]];
    let strips = [
        ([-1.0, 1.0], [-1.0, hole[1][0]]),
        ([-1.0, 1.0], [hole[1][1], 1.0]),
        ([-1.0, hole[0][0]], hole[1]),
        ([hole[0][1], 1.0], hole[1]),
    ];
    for (z, y) in strips {
        add_quad(&mut s, "right", white, strip(z, y));
    }
    if pane {
        let glass = s.add_material("pane", PANE);
        add_quad(&mut s, "pane", glass, strip(hole[0], hole[1]));
    }
    s.emitters.push(Emitter::Directional { direction: [-1.0, -0.8, -0.3], irradiance: [8.0, 7.0, 6.0] });
    s.environment = Some(Environment::Constant { radiance: [0.5, 0.7, 1.0] });
    s
}

/// A room that a sun and a sky light through a pane costs at most 1.3 times the room with an open window, and has at most
/// 1.3 times its relMSE at the same number of samples. Killed by: a pane that blocks shadow rays (the sun is never found,
/// the sky by chance), a pane that is a vertex with factors of its own.
#[test]
fn a_pane_in_a_window_costs_little() {
    for strategy in ["none", "classic", "ears"] {
        let [(open, open_mse), (shut, shut_mse)] = [false, true].map(|pane| {
            let scene = blob(&room(pane));
            let settings = settings(&scene, strategy);
            // the film's own estimate is itself a random number: seeds tell how good it is
            let images: Vec<Image> = (0..4)
                .map(|seed| {
                    let settings = Settings { seed, ..settings };
                    scheduled(&scene, &settings, &[8, 24, 32, 64], Schedule::InOrder(1 << 20))
                })
                .collect();
            let mse: Vec<f64> = images.iter().map(|i| i.error.rel_mse).collect();
            let mean = mse.iter().sum::<f64>() / 4.0;
            let spread = (mse.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 12.0).sqrt();
            (images, [mean, spread])
        });
        let cost = |images: &[Image]| images.iter().map(|i| i.counters.cost()).sum::<f64>();
        let (cost, mse) = (cost(&shut) / cost(&open), shut_mse[0] / open_mse[0]);
        let spread = mse * (shut_mse[1] / shut_mse[0]).hypot(open_mse[1] / open_mse[0]);
        println!("{strategy}: with a pane {cost:.3} times the cost, {mse:.3} +- {spread:.3} times the relMSE");
        assert!(cost <= 1.3, "{strategy}: {cost} times the cost");
        assert!(spread < 0.07 && mse + 2.0 * spread <= 1.3, "{strategy}: {mse} +- {spread} times the relMSE");
        for image in &shut {
            assert_eq!((image.counters.passages_cut, image.counters.non_finite), (0, 0));
            assert!(image.counters.passed.lanes > 1000);
        }
        // what the pane keeps out: at least the sun's 8.6 %
        let mean = |images: &[Image]| images.iter().map(Image::mean).sum::<f64>() / 4.0;
        let kept = mean(&shut) / mean(&open);
        assert!((0.80..0.96).contains(&kept), "{kept}");
    }
}

/// Shadow rays look through 1,000 sheets without a loss; behind 2,000 they are taken for blocked, which is counted, and
/// camera rays pass all the same. Killed by: a loop without a bound, a bound that nobody hears of.
#[test]
fn rows_of_panes_are_bounded_and_counted() {
    let clear = Model::ThinDielectric { int_ior: 1.0, ext_ior: 1.0 };
    for (model, n) in [(Model::Null, 1000), (clear, 1000), (Model::Null, 2000), (clear, 2000)] {
        let mut s = spot(0.5, [4, 4]);
        let heights: Vec<f32> = (0..n).map(|i| 1.0 + i as f32 / 256.0).collect();
        add_panes(&mut s, model, &heights);
        s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] });
        let image = render_as(&s, "none", 2, 2);
        let c = image.counters;
        assert_eq!((c.non_finite, c.camera_samples), (0, 32));
        if n == 1000 {
            assert_exact("1000 sheets", &image, [0.5 / PI; 3], 1e-4);
            assert_eq!((c.passages_cut, c.shadow_rays), (0, 32 * 1001));
        } else {
            assert_eq!((image.mean(), c.passages_cut), (0.0, 32));
            // a search for what blocks for sure, then one for each sheet
            assert_eq!(c.shadow_rays, 32 * (1 + u64::from(croupier::unstable::MAX_PASSED)));
        }
        // from above through all of them
        s.camera = camera([0.0, 20.0, 0.0], [0.0; 3], 0.01, [4, 4]);
        s.emitters = vec![Emitter::Area { material: 0, radiance: [0.75; 3] }];
        let image = render_as(&s, "none", 1, 2);
        assert_exact("from above", &image, [0.75; 3], 1e-6);
        assert_eq!(image.counters.straight_rays, 32 * n as u64);
    }
    // the reflections of real panes end with the path, not with their number
    let mut s = spot(0.5, [4, 4]);
    let heights: Vec<f32> = (0..2000).map(|i| 1.0 + i as f32 / 256.0).collect();
    add_panes(&mut s, PANE, &heights);
    s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] });
    let c = render_as(&s, "none", 60, 2).counters;
    assert_eq!((c.non_finite, c.camera_samples), (0, 32));
    println!("2000 panes: {} rays, {} cut", c.rays(), c.passages_cut);
    assert!(c.rays() < 32 * 60 * 1024 * 2, "{} rays", c.rays());
}
