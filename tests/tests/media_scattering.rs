//! Scattering in media, in the whole renderer: single scattering against quadrature, and furnaces, in which nothing may
//! be seen of a medium that loses nothing, whatever the strategy.

use croupier::Settings;
use croupier::unstable::learn::ControlVariate;
use croupier_host::description::*;
use croupier_tests::light_oracle::{V, dot, length, sub, unit};
use croupier_tests::media_oracle::{MediaScene, henyey_greenstein, homogeneous as oracle};
use croupier_tests::media_scene::*;
use croupier_tests::quadrature::midpoint;
use croupier_tests::runner::{Schedule, render, scheduled, settings};
use croupier_tests::scenes::*;

/// |z| that a comparison may reach: with the 400 of this file a false alarm in 1e4 runs.
const LIMIT: f64 = 5.2;

const LO: V = [-1.0; 3];
const HI: V = [1.0; 3];
const BOUNDS: [[f32; 3]; 2] = [[-1.0; 3], [1.0; 3]];

/// A ramp along x with a slope along z.
const CELLS: [u32; 3] = [6, 1, 3];

fn ramp() -> Vec<f32> {
    (0..18).map(|i| 0.1 + 0.3 * (i % 6) as f32 + 0.2 * (i / 6) as f32).collect()
}

/// Radiance along `o + t d` (`d` a unit vector) of light that `light` sends and the box of the scene's medium scatters
/// once. By quadrature over the part u = 1 - exp(-sigma_t s) of what collides along the line, or over s itself in a grid.
fn scattered_once(medium: &Medium, o: V, d: V, light: &Emitter) -> [f64; 3] {
    let [begin, end] = through_box(o, d, LO, HI).expect("a line through the box");
    let entry: V = std::array::from_fn(|i| o[i] + begin * d[i]);
    let point = |s: f64| -> V { std::array::from_fn(|i| entry[i] + s * d[i]) };
    // per channel, what light scatters at a point towards the camera by sigma_s = 1; its direction, and its way in the box
    let at = |p: V| {
        let (to, irradiance, most) = match light {
            Emitter::Directional { direction, irradiance } => {
                (unit(direction.map(|x| -f64::from(x))), irradiance.map(f64::from), f64::INFINITY)
            }
            Emitter::Point { position, intensity } => {
                let v = sub(position.map(f64::from), p);
                (unit(v), intensity.map(|x| f64::from(x) / dot(v, v)), length(v))
            }
            Emitter::Area { .. } | Emitter::Spot { .. } | Emitter::Sun { .. } => panic!("no closed form"),
        };
        let way = through_box(p, to, LO, HI).expect("a point inside")[1].min(most);
        (irradiance.map(|e| e * henyey_greenstein(f64::from(medium.g), dot(to, d))), to, way)
    };
    let sigma_s = medium.sigma_s.map(f64::from);
    let sigma_t: V = std::array::from_fn(|c| sigma_s[c] + f64::from(medium.sigma_a[c]));
    if matches!(medium.density, Density::Homogeneous) {
        return std::array::from_fn(|c| {
            let all = -(-sigma_t[c] * (end - begin)).exp_m1();
            let f = |u: f64| {
                let (light, _, way) = at(point(-(-u).ln_1p() / sigma_t[c]));
                sigma_s[c] / sigma_t[c] * light[c] * (-sigma_t[c] * way).exp()
            };
            if sigma_s[c] > 0.0 { midpoint(2000, 0.0, all, f) } else { 0.0 }
        });
    }
    let grid = MediaScene::default().with_grid(oracle([0.0; 3], [0.0; 3], [0.0; 3]), BOUNDS, CELLS, &ramp());
    let (steps, mut seen, mut sum) = (200, 0.0, [0.0; 3]);
    let h = (end - begin) / f64::from(steps);
    for i in 0..steps {
        let p = point((f64::from(i) + 0.5) * h);
        let density = grid.density(0, p);
        let (light, to, way) = at(p);
        let thickness = seen + 0.5 * h * density + grid.thickness(0, p, to, [0.0, way], 40);
        seen += h * density;
        for c in 0..3 {
            sum[c] += h * sigma_s[c] * density * light[c] * (-sigma_t[c] * thickness).exp();
        }
    }
    sum
}

/// Light of a direction and of points outside and inside, scattered once in a box: forwards, backwards, isotropically,
/// by channels of 10 : 1 : 0.1, by one that is clear and one that is nearly opaque, and by a density that rises. Killed
/// by: a phase function of the opposite direction, an albedo that is left out or counted twice, a shadow ray that does
/// not see the medium, or sees it to the end of the box behind a point light, a weight of another channel.
#[test]
fn light_scattered_once_follows_quadrature() {
    let lights = [
        Emitter::Directional { direction: [-1.0, -2.0, -0.5], irradiance: [1.0, 2.0, 3.0] },
        Emitter::Point { position: [0.4, 3.0, 1.0], intensity: [9.0, 6.0, 3.0] },
        Emitter::Point { position: [-0.5, 0.7, 0.6], intensity: [1.0; 3] },
    ];
    let (o, target) = ([0.9, 1.3, 4.0], [0.2, -0.1, 0.0]);
    let d = unit(sub(target, o));
    let cases = [
        ([0.0; 3], [1.0, 1.0, 1.0], true),
        ([0.2, 1.0, 0.1], [0.3, 0.7, 2.0], true),
        ([0.0; 3], [5.0, 0.5, 0.05], true),
        ([0.0, 0.3, 900.0], [0.0, 0.6, 100.0], false),
    ];
    for (sigma_a, sigma_s, also_grid) in cases {
        for g in [-0.5, 0.0, 0.7f32] {
            for (i, light) in lights.iter().enumerate() {
                for grid in [false, true] {
                    if grid && !also_grid {
                        continue;
                    }
                    let medium = homogeneous(sigma_a, sigma_s, g);
                    let medium = if grid { in_grid(medium, CELLS, BOUNDS, ramp()) } else { medium };
                    let expected = scattered_once(&medium, o, d, light);
                    let mut s = in_the_dark(o, target, *light);
                    add_medium_box(&mut s, medium, [-1.0; 3], [1.0; 3]);
                    let scene = blob(&s);
                    let image = render(&scene, &Settings { max_depth: 2, ..settings(&scene, "none") }, 8192);
                    let what = format!("light {i}, g {g}, {sigma_a:?}, {sigma_s:?}, grid {grid}");
                    let least = expected[0].max(expected[1]).max(expected[2]) / 20.0;
                    // positions near the border of the opaque channel are as coarse as 1e-3 of a free path
                    let rounding = if sigma_a[2] > 1.0 { 2e-3 } else { 3e-4 };
                    assert_channels(
                        &what,
                        &image,
                        expected,
                        [LIMIT, if sigma_a[2] > 1.0 { 0.04 } else { 0.02 }, rounding, least],
                    );
                }
            }
        }
    }
}

/// A strategy, the optical thicknesses that it can manage, and camera samples of a pixel by iterations.
struct Furnace {
    strategy: &'static str,
    tau: &'static [f32],
    iterations: &'static [u32],
    shadow_roulette: bool,
    control_variate: ControlVariate,
}

/// Half of all paths at every vertex end with `fixed:0.5`: in thick media the variance is infinite.
const FURNACES: [Furnace; 9] = {
    const fn of(strategy: &'static str, tau: &'static [f32], iterations: &'static [u32]) -> Furnace {
        Furnace { strategy, tau, iterations, shadow_roulette: false, control_variate: ControlVariate::Off }
    }
    const ALL: &[f32] = &[0.1, 1.0, 10.0];
    const ONE: &[u32] = &[1024];
    const LEARN: &[u32] = &[16, 48, 128, 256, 512];
    [
        of("none", ALL, ONE),
        of("classic", ALL, ONE),
        of("throughput", ALL, ONE),
        of("albedo", ALL, ONE),
        of("adrrs", ALL, LEARN),
        of("ears", ALL, LEARN),
        of("fixed:0.5", &[0.1, 0.5], &[8192]),
        of("fixed:2", ALL, &[128]),
        Furnace { shadow_roulette: true, control_variate: ControlVariate::Cached, ..of("ears", ALL, LEARN) },
    ]
};

/// A medium of albedo 1 in light of radiance 1 from everywhere is invisible, thin or thick, homogeneous or in a grid.
/// Paths of 200 segments leave out less than 1e-6 of what is in the thickest. Killed by: a factor of roulette that the
/// weight does not see, a vertex of a medium whose light sample counts in full beside the ray that finds the same, an
/// albedo below 1, a control variate that is added without having been taken away.
#[test]
fn lossless_media_are_invisible() {
    for furnace in &FURNACES {
        for &tau in furnace.tau {
            for grid in [false, true] {
                let medium = homogeneous([0.0; 3], [tau / 2.0; 3], 0.2);
                let values = |i: u32| 0.5 + (i * 7 % 11) as f32 / 10.0;
                let medium =
                    if grid { in_grid(medium, [5; 3], BOUNDS, (0..125).map(values).collect()) } else { medium };
                let mut s = in_white_environment(camera([0.4, 0.9, 5.0], [0.0; 3], 20.0, [8, 8]));
                add_medium_box(&mut s, medium, [-1.0; 3], [1.0; 3]);
                let scene = blob(&s);
                let settings = Settings {
                    max_depth: 200,
                    split_budget: 16,
                    shadow_roulette: furnace.shadow_roulette,
                    control_variate: furnace.control_variate,
                    ..settings(&scene, furnace.strategy)
                };
                let start = std::time::Instant::now();
                let image = scheduled(&scene, &settings, furnace.iterations, Schedule::InOrder(1 << 20));
                let what = format!("{}, thickness {tau}, grid {grid}", furnace.strategy);
                let c = &image.counters;
                println!(
                    "{what}: {} +- {}, {:.2} Mrays, {:.2} s",
                    image.mean(),
                    image.error_of_mean(),
                    c.rays() as f64 * 1e-6,
                    start.elapsed().as_secs_f64()
                );
                let power = if tau > 1.0 { 0.01 } else { 0.005 };
                assert_channels(&what, &image, [1.0; 3], [LIMIT, power, 5e-5, 0.0]);
                assert!(c.vertex_samples > c.camera_samples / 100, "{what}: a medium scatters");
            }
        }
    }
}

/// A medium that emits radiance 1 in an environment of radiance 1 is in equilibrium: 1 is seen, whatever is absorbed and
/// whatever scattered, by paths that roulette ends. Killed by: emission that is not weighted by absorption, emission
/// that is met once more behind a scattering.
#[test]
fn media_in_equilibrium_are_invisible() {
    for (sigma_a, sigma_s) in
        [([0.3, 1.0, 2.0], [0.0; 3]), ([0.3, 1.0, 2.0], [1.0, 0.5, 0.2]), ([0.1, 0.02, 4.0], [0.05, 2.0, 0.4])]
    {
        for grid in [false, true] {
            let medium = Medium { emission: [1.0; 3], ..homogeneous(sigma_a, sigma_s, -0.3) };
            let medium = if grid { in_grid(medium, CELLS, BOUNDS, ramp()) } else { medium };
            for (strategy, iterations) in
                [("none", &[2048][..]), ("classic:2", &[4096]), ("fixed:1.5", &[1024]), ("ears", &[32, 96, 256, 512])]
            {
                let mut s = in_white_environment(camera([0.4, 0.9, 5.0], [0.0; 3], 20.0, [8, 8]));
                add_medium_box(&mut s, medium.clone(), [-1.0; 3], [1.0; 3]);
                let scene = blob(&s);
                let settings = Settings { max_depth: 200, split_budget: 16, ..settings(&scene, strategy) };
                let image = scheduled(&scene, &settings, iterations, Schedule::InOrder(1 << 20));
                let what = format!("{strategy}, {sigma_a:?}, {sigma_s:?}, grid {grid}");
                assert_channels(&what, &image, [1.0; 3], [LIMIT, 0.005, 5e-5, 0.0]);
            }
        }
    }
}

/// A closed white box full of a medium that loses nothing, with walls that emit: the geometric series of the walls'
/// albedo, as without the medium. Killed by: light lost between a boundary and a wall behind it.
#[test]
fn a_lossless_medium_changes_nothing_in_a_glowing_box() {
    let mut s = glowing_box(0.5, 0.75, [4, 4]);
    add_medium_box(&mut s, homogeneous([0.0; 3], [0.4, 0.2, 0.1], 0.3), [-0.95; 3], [0.95; 3]);
    let scene = blob(&s);
    for strategy in ["none", "classic", "fixed:1.3"] {
        let settings = Settings { max_depth: 60, split_budget: 8, ..settings(&scene, strategy) };
        let image = render(&scene, &settings, 512);
        assert_channels(strategy, &image, [1.5; 3], [LIMIT, 0.015, 5e-5, 0.0]);
    }
}
