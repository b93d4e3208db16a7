//! Light probes against environments whose coefficients are known, and against each other.

use croupier::{Scene, Settings, Strategy};
use croupier_host::description::*;
use croupier_host::drive::Unobserved;
use croupier_host::probes::{COEFFICIENTS, Probe, ProbeFile, ProbeOptions, grid, render_probes};
use croupier_host::render::RenderOptions;
use croupier_tests::light_oracle::Map;
use croupier_tests::scenes::{add_box, blob, camera, cornell, grey};
use std::f64::consts::PI;

/// Largest deviation in standard errors that chance explains: with a few hundred comparisons and seven iterations or
/// more, the tails of whose means are wider than a normal distribution's.
const SIGMAS: f64 = 7.0;

fn options(strategy: &str, rays: u32) -> ProbeOptions {
    let settings = RenderOptions::new(Strategy::parse(strategy).unwrap()).settings;
    ProbeOptions { settings, rays, ..ProbeOptions::default() }
}

#[track_caller]
fn render(scene: &SceneDescription, positions: &[[f32; 3]], options: &ProbeOptions) -> Vec<Probe> {
    let bytes = blob(scene);
    render_probes(Scene::from_bytes(&bytes).unwrap(), scene, positions, options, &Unobserved).unwrap()
}

/// Nothing but a small triangle far away, so that the scene has one.
fn under(environment: Environment) -> SceneDescription {
    let mut scene = SceneDescription {
        camera: camera([0.0, 0.0, 5.0], [0.0; 3], 40.0, [8, 8]),
        environment: Some(environment),
        ..SceneDescription::default()
    };
    let black = scene.add_material("black", grey(0.0));
    let corners = [[0.0, -900.0, 0.0], [1e-3, -900.0, 0.0], [0.0, -900.0, 1e-3]];
    let corners = corners.map(|position| Vertex { position, ..Vertex::default() });
    scene.add_mesh("speck", black, &corners, &[[0, 1, 2]], false);
    scene
}

/// Of a constant every cell has the same share, so that there is no noise in the first coefficient. Killed by: a solid
/// angle other than 4 pi, cells that are counted twice or not at all, radiance of the iterations before that is counted
/// again.
#[test]
fn a_constant_environment_is_one_coefficient() {
    let scene = under(Environment::Constant { radiance: [1.0, 2.0, 0.5] });
    for rays in [2, 100, 4096] {
        let probes = render(&scene, &[[0.0; 3], [3.0, -2.0, 1.0], [0.5; 3]], &options("ears", rays));
        for probe in &probes {
            for c in 0..3 {
                let radiance = [1.0, 2.0, 0.5][c];
                assert!((probe.radiance.0[0][c] / (radiance * (4.0 * PI).sqrt()) - 1.0).abs() < 1e-6, "{rays}");
                for i in 1..COEFFICIENTS {
                    let (found, noise) = (probe.radiance.0[i][c], probe.stderr.0[i][c]);
                    // two iterations have no variance that one could rely on
                    assert!(
                        found.abs() < SIGMAS * noise || rays < 100 && found.abs() < 4.0 * radiance,
                        "{i}: {found} +- {noise}"
                    );
                }
                if rays > 1000 {
                    let e = probe.radiance.irradiance([0.6, 0.0, 0.8])[c];
                    assert!((e / (PI * radiance) - 1.0).abs() < 0.02, "{e}");
                }
            }
            assert!(probe.valid && probe.backs == 0.0);
        }
    }
}

/// Radiance of a map: three bands in all axes, another mixture in each channel.
fn radiance([x, y, z]: [f64; 3]) -> [f64; 3] {
    [1.0 + 0.5 * y, 1.0 + 0.3 * x - 0.4 * z, 2.0 + 0.8 * x * y - 0.6 * (3.0 * z * z - 1.0) + 0.5 * y * z]
}

/// Killed by: coefficients in another order, axes that change places or point the other way, a factor of a band left out
/// of the irradiance, channels that are mixed.
#[test]
fn gradients_are_in_their_coefficients() {
    let (width, height) = (128u32, 129u32);
    let dark = Map::new(&vec![[0.0; 3]; (width * height) as usize], width as usize, height as usize);
    let direction = |i: u32| {
        let (column, row) = ((i % width) as usize, (i / width) as usize);
        // the upper edge of a row of cells; the last row is the lower edge of the one above
        let last = row + 1 == height as usize;
        dark.direction(column, row - usize::from(last), 0.0, f64::from(u8::from(last)))
    };
    let texels = (0..width * height).map(|i| radiance(direction(i)).map(|x| x as f32)).collect();
    let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let scene = under(Environment::Map { width, height, texels, scale: [1.0; 3], to_world });
    // in units of the functions: what multiplies 1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2
    let exact = [
        [1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, -0.4, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        [2.0, 0.0, 0.0, 0.0, 0.8, 0.5, -0.6, 0.0, 0.0],
    ];
    let band2 = 0.25 * (15.0 / PI).sqrt();
    let first = 0.5 * (3.0 / PI).sqrt();
    let unit =
        [0.5 / PI.sqrt(), first, first, first, 2.0 * band2, 2.0 * band2, 0.25 * (5.0 / PI).sqrt(), 2.0 * band2, band2];
    let probe = render(&scene, &[[0.0; 3]], &options("classic", 16384))[0];
    for i in 0..COEFFICIENTS {
        for (c, exact) in exact.iter().enumerate() {
            let wanted = exact[i] / unit[i];
            let (found, noise) = (probe.radiance.0[i][c], probe.stderr.0[i][c]);
            assert!(noise < 0.02, "{i}: {noise}");
            // the map is linear between its texels
            assert!(
                (found - wanted).abs() < SIGMAS * noise + 2e-3,
                "coefficient {i}, channel {c}: {found}, not {wanted} +- {noise}"
            );
        }
    }
    for n in [[0.0, 1.0, 0.0], [0.6, 0.0, -0.8], [0.48, -0.6, 0.64]] {
        // by the integral of each band: pi, 2 pi / 3 and pi / 4
        let [x, y, z] = n;
        let third = 0.8 * x * y - 0.6 * (3.0 * z * z - 1.0) + 0.5 * y * z;
        let wanted =
            [PI + 2.0 * PI / 3.0 * 0.5 * y, PI + 2.0 * PI / 3.0 * (0.3 * x - 0.4 * z), 2.0 * PI + PI / 4.0 * third];
        let found = probe.radiance.irradiance(n);
        (0..3).for_each(|c| assert!((found[c] - wanted[c]).abs() < 0.05, "{n:?}: {found:?}, not {wanted:?}"));
        let found = probe.radiance.eval(n);
        (0..3).for_each(|c| assert!((found[c] - radiance(n)[c]).abs() < 0.06, "{n:?}: {found:?}"));
    }
}

/// Strategies differ in noise alone. Killed by: learned factors that move the mean, an iteration whose directions are
/// not those that its rays had.
#[test]
fn strategies_agree_in_the_box() {
    let scene = cornell([8, 8]);
    let positions = grid([[-0.8, -0.8, -0.8], [0.8, 0.8, 0.8]], [3, 2, 2]);
    assert_eq!(positions.len(), 12);
    for (at, wanted) in [(0, [-1.6 / 3.0, -0.4, -0.4]), (1, [0.0, -0.4, -0.4]), (11, [1.6 / 3.0, 0.4, 0.4])] {
        (0..3).for_each(|c| assert!((positions[at][c] - wanted[c]).abs() < 1e-6, "{at}: {:?}", positions[at]));
    }
    let [a, b] = ["classic", "ears"].map(|s| render(&scene, &positions, &options(s, 16384)));
    let seeded =
        ProbeOptions { settings: Settings { seed: 3, ..options("classic", 1).settings }, ..options("classic", 16384) };
    let other = render(&scene, &positions, &seeded);
    for (p, (q, r)) in a.iter().zip(b.iter().zip(&other)) {
        for (k, other) in [("ears", q), ("another seed", r)] {
            assert_ne!(p.radiance, other.radiance);
            for i in 0..COEFFICIENTS {
                for c in 0..3 {
                    let noise = p.stderr.0[i][c].hypot(other.stderr.0[i][c]);
                    let difference = p.radiance.0[i][c] - other.radiance.0[i][c];
                    assert!(noise < 0.05 * p.radiance.0[0][c], "{noise}");
                    assert!(difference.abs() < SIGMAS * noise, "{k}, {i}: {difference} +- {noise}");
                }
            }
        }
        assert!(p.valid);
        // the emitter is above
        assert!(p.radiance.irradiance([0.0, 1.0, 0.0])[1] > 2.0 * p.radiance.irradiance([0.0, -1.0, 0.0])[1]);
    }
}

/// Killed by: probes inside of things that pass for valid, ones outside that do not, sheets of glass that hide one.
#[test]
fn probes_inside_of_things_are_not_valid() {
    let mut scene = under(Environment::Constant { radiance: [1.0; 3] });
    let glass = scene.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    add_box(&mut scene, 0, [-1.0; 3], [1.0; 3], false);
    add_box(&mut scene, glass, [2.0, -1.0, -1.0], [4.0, 1.0, 1.0], false);
    let probes = render(&scene, &[[0.0; 3], [1.5, 0.0, 0.0], [3.0, 0.0, 0.0]], &options("classic", 64));
    assert_eq!(probes.iter().map(|p| p.valid).collect::<Vec<_>>(), [false, true, true]);
    assert_eq!((probes[0].backs, probes[1].backs), (1.0, 0.0));
    assert_eq!(probes[0].radiance.0[0], [0.0; 3]);
    let json = serde_json::to_value(ProbeFile::new(&probes)).unwrap();
    assert_eq!(
        (json["probes"][0]["valid"].as_bool(), json["probes"][1]["position"][0].as_f64()),
        (Some(false), Some(1.5))
    );
    assert_eq!(json["probes"][2]["coefficients"].as_array().map(Vec::len), Some(9));
    assert!(json["convention"].as_str().unwrap().contains("Ramamoorthi"));
}

/// Killed by: anything that depends on the order in which threads finish; positions that no message names.
#[test]
fn probes_do_not_depend_on_threads() {
    let scene = cornell([8, 8]);
    let positions = grid([[-0.8; 3], [0.8; 3]], [3, 3, 1]);
    let of = |threads| render(&scene, &positions, &ProbeOptions { threads, ..options("ears", 256) });
    let one = of(1);
    assert!(one == of(2) && one == of(4));
    let bytes = blob(&scene);
    let view = Scene::from_bytes(&bytes).unwrap();
    let error = |positions: &[[f32; 3]]| {
        render_probes(view, &scene, positions, &options("ears", 4), &Unobserved).unwrap_err().to_string()
    };
    assert!(error(&[]).contains("at least one"));
    assert_eq!(error(&[[0.0; 3], [f32::NAN, 0.0, 0.0]]), "the position of probe 1 is not finite");
}
