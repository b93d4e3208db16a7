//! Sphere, rectangle and disk lights in renders: closed forms on a diffuse floor, quadrature on glossy ones with both
//! techniques and with scattered rays alone, rays that pass lights and things straight on, and media.

use croupier::unstable::accel::WideBvh;
use croupier::unstable::light::LightSelector;
use croupier::unstable::scene::blob::{MaterialKind, NONE};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::*;
use croupier_tests::bsdf::{Case, unit};
use croupier_tests::light_oracle::{V, cross, dot, polygon_irradiance, wide};
use croupier_tests::media_scene::*;
use croupier_tests::runner::{Image, render, settings};
use croupier_tests::scenes::*;
use std::f64::consts::{PI, TAU};

/// |z| that a comparison may reach: with the 100 of this file a false alarm in 5e4 runs.
const LIMIT: f64 = 5.2;

fn shape(shape: LightShape, position: [f32; 3], radiance: [f32; 3]) -> ShapeLight {
    ShapeLight { shape, position, radiance, two_sided: false, visible: true }
}

fn sphere(position: [f32; 3], radius: f32, radiance: [f32; 3]) -> ShapeLight {
    shape(LightShape::Sphere { radius }, position, radiance)
}

fn rectangle(position: [f32; 3], edges: [[f32; 3]; 2], radiance: [f32; 3]) -> ShapeLight {
    shape(LightShape::Rectangle { edges }, position, radiance)
}

fn disk(position: [f32; 3], direction: [f32; 3], radius: f32, radiance: [f32; 3]) -> ShapeLight {
    shape(LightShape::Disk { direction, radius }, position, radiance)
}

/// Directions from the origin to the points of a light, unit, with their solid angles.
fn directions(l: &ShapeLight) -> Vec<(V, f64)> {
    let n = 500;
    let middle = wide(l.position);
    let flat = |q: V, area: V, weight: f64| {
        let r2 = dot(q, q);
        (unit(q), weight * dot(area, unit(q)).abs() / r2)
    };
    let at = |k: usize| [k / n, k % n].map(|k| (k as f64 + 0.5) / n as f64);
    let all = (0..n * n).map(at);
    let part = 1.0 / (n * n) as f64;
    match l.shape {
        LightShape::Sphere { radius } => {
            let sin2 = f64::from(radius).powi(2) / dot(middle, middle);
            let cone = sin2 / (1.0 + (1.0 - sin2).sqrt());
            let axis = unit(middle);
            let x = unit(cross(axis, [0.1, 0.9, 0.3]));
            let y = cross(axis, x);
            all.map(|[u, v]| {
                let (z, phi) = (1.0 - cone * u, TAU * v);
                let r = (1.0 - z * z).sqrt();
                let d = std::array::from_fn(|k| axis[k] * z + r * (x[k] * phi.cos() + y[k] * phi.sin()));
                (d, TAU * cone * part)
            })
            .collect()
        }
        LightShape::Rectangle { edges } => {
            let [a, b] = edges.map(wide);
            all.map(|[u, v]| {
                let q = std::array::from_fn(|k| middle[k] + a[k] * (u - 0.5) + b[k] * (v - 0.5));
                flat(q, cross(a, b), part)
            })
            .collect()
        }
        LightShape::Disk { direction, radius } => {
            let normal = unit(wide(direction));
            let x = unit(cross(normal, [0.1, 0.3, 0.9]));
            let y = cross(normal, x);
            all.map(|[u, v]| {
                let (r, phi) = (f64::from(radius) * u.sqrt(), TAU * v);
                let q = std::array::from_fn(|k| middle[k] + r * (x[k] * phi.cos() + y[k] * phi.sin()));
                flat(q, normal, PI * f64::from(radius).powi(2) * part)
            })
            .collect()
        }
    }
}

fn render_as(s: &SceneDescription, strategy: &str, max_depth: u32, spp: u32) -> Image {
    let scene = blob(s);
    let image = render(&scene, &Settings { max_depth, ..settings(&scene, strategy) }, spp);
    assert_eq!(image.counters.non_finite, 0);
    image
}

/// What the floor at the origin receives.
fn irradiance(l: &ShapeLight) -> f64 {
    directions(l).iter().map(|(d, weight)| d[1].max(0.0) * weight).sum()
}

/// Small and large, near and far, low over the floor.
fn lights() -> Vec<(&'static str, ShapeLight)> {
    let rgb = [2.0, 1.0, 0.5];
    let edges = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.5]];
    vec![
        ("sphere", sphere([0.5, 1.2, -0.2], 0.6, rgb)),
        ("small sphere", sphere([2.0, 3.0, 1.0], 0.01, rgb)),
        ("near sphere", sphere([0.0, 0.5, 0.0], 0.49, rgb)),
        ("rectangle", rectangle([0.3, 1.5, 0.2], edges, rgb)),
        ("wide rectangle", rectangle([2.0, 0.4, 1.0], edges.map(|e| e.map(|x| 8.0 * x)), rgb)),
        ("upright rectangle", rectangle([-1.0, 1.0, 0.0], [[0.0, 1.6, 0.0], [0.0, 0.0, 1.5]], rgb)),
        ("disk", disk([0.3, 1.5, 0.2], [0.0, -2.0, 0.3], 0.5, rgb)),
        ("near disk", disk([0.5, 0.4, 0.0], [0.0, -1.0, 0.0], 1.0, rgb)),
    ]
}

/// Each light on a diffuse floor, alone; within a `null` box whose side cuts through it, and behind sheets that pass
/// everything; in the plane of a ceiling; with split paths. Killed by: a density of another solid angle, weights that do
/// not add up to 1, a light that a piece of a ray counts twice or leaves out, one that hides what is behind it.
#[test]
fn shapes_light_floors() {
    for (name, light) in lights() {
        let mut open = spot(0.8, [4, 4]);
        open.emitters.push(Emitter::Shape(light));
        let expected = light.radiance.map(|l| 0.8 / PI * f64::from(l) * irradiance(&light));
        let assert_same = |what: &str, s: &SceneDescription, strategy: &str| {
            let image = render_as(s, strategy, 2, 16_384);
            assert_channels(&format!("{name}, {what}, {strategy}"), &image, expected, [LIMIT, 0.006, 2e-4, 0.0]);
        };
        assert_same("alone", &open, "none");
        assert_same("alone", &open, "fixed:3");

        let mut cut = open.clone();
        let air = cut.add_material("air", Model::Null);
        let [x, y, z] = light.position;
        add_box(&mut cut, air, [x - 0.13, y - 0.11, z - 0.05], [x + 0.3, y + 0.3, z + 0.2], false);
        assert_same("cut", &cut, "none");

        let mut behind = open.clone();
        let air = behind.add_material("air", Model::Null);
        for height in [0.005, 0.006, 0.2] {
            add_quad(&mut behind, "sheet", air, facing_y(50.0, height, 1.0));
        }
        assert_same("behind sheets", &behind, "none");

        // a light above hides nothing, and is hidden by nothing but surfaces
        let flat = matches!(light.shape, LightShape::Rectangle { .. }) && light.position[1] > 1.2;
        if flat {
            let mut ceiling = open.clone();
            let black = ceiling.add_material("ceiling", grey(0.0));
            add_quad(&mut ceiling, "ceiling", black, facing_y(50.0, light.position[1], -1.0));
            assert_same("in a ceiling", &ceiling, "none");
            ceiling.vertices.iter_mut().filter(|v| v.position[1] > 1.0).for_each(|v| v.position[1] -= 0.01);
            assert_eq!(render_as(&ceiling, "none", 2, 64).mean(), 0.0, "{name} behind a ceiling");
        }
    }
    let corners = [[-0.2, 1.5, -0.55], [0.8, 1.5, -0.55], [0.8, 1.5, 0.95], [-0.2, 1.5, 0.95]];
    let by_lambert = polygon_irradiance(&corners);
    assert!((irradiance(&lights()[3].1) / by_lambert - 1.0).abs() < 1e-4, "quadrature against Lambert's formula");
}

/// Never chooses a light: scattered rays alone find them.
#[derive(Debug)]
struct Never;

impl LightSelector for Never {
    fn select(&self, _: Vec3x8, _: Vec3x8, _: U32x8, _: Mask8) -> (U32x8, F32x8) {
        (U32x8::splat(NONE), F32x8::ZERO)
    }

    fn probability(&self, _: Vec3x8, _: Vec3x8, _: U32x8, _: Mask8) -> F32x8 {
        F32x8::ZERO
    }
}

/// A render without light samples.
fn by_scattering(s: &SceneDescription, spp: u32) -> Image {
    let bytes = blob(s);
    let scene = Scene::from_bytes(&bytes).unwrap();
    let plan = Plan::new(&Settings { max_depth: 2, ..settings(&bytes, "none") }).unwrap();
    let [mut shared, mut block] = [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
    let builder = Session::builder(scene).intersector(WideBvh::new(&scene)).light_selector(Never);
    let mut session = builder.build(&plan, shared.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
    session.begin_iteration(spp);
    while shard.step(&session, Budget { rays: 1 << 20 }) == StepResult::More {}
    session.end_iteration([&shard]).unwrap();
    let film = session.film();
    Image {
        size: film.size(),
        pixels: film.pixels().collect(),
        aovs: Vec::new(),
        counters: *session.counters(),
        error: film.error_estimate(),
    }
}

/// Highlights from sharp to broad follow quadrature with both techniques and with scattered rays alone, in the open and
/// behind sheets. Killed by: a weight of one technique with the density of the other, a density that a ray forgets when it
/// passes a sheet, light samples without a weight.
#[test]
fn highlights_have_the_same_mean_by_both_techniques() {
    let (eta, k, reflectance) = ([0.2; 3], [3.0; 3], Reflectance::Constant([0.7; 3]));
    let local = |v: V| [v[0], v[2], v[1]];
    let wo = unit(local([0.0, 0.3, 0.4]));
    for alpha in [0.03f32, 0.1, 0.4] {
        for (name, light) in [
            ("sphere", sphere([0.1, 0.9, -1.2], 0.4, [2.0; 3])),
            ("rectangle", rectangle([0.1, 0.9, -1.2], [[0.8, 0.0, 0.0], [0.0, 0.6, 0.45]], [2.0; 3])),
            ("disk", disk([0.1, 0.9, -1.2], [0.0, -0.9, 1.2], 0.4, [2.0; 3])),
            ("near disk", disk([0.0, 0.6, -0.6], [0.0, -0.9, 0.9], 0.8, [2.0; 3])),
        ] {
            let mut light = light;
            // the front, wherever it is
            light.two_sided = true;
            let case = Case::new(MaterialKind::RoughConductor, [0.7; 3], eta, k, alpha);
            let reflected = |(d, weight): &(V, f64)| case.eval(wo, local(*d)).f[0] * weight;
            let expected = [2.0 * directions(&light).iter().map(reflected).sum::<f64>(); 3];
            for sheets in [0, 2] {
                let mut s = spot(0.8, [4, 4]);
                s.materials[0].model = Model::RoughConductor { eta, k, reflectance, alpha };
                s.emitters.push(Emitter::Shape(light));
                if sheets > 0 {
                    let air = s.add_material("air", Model::Null);
                    for height in [0.2, 0.7] {
                        add_quad(&mut s, "sheet", air, facing_y(90.0, height, 1.0));
                    }
                }
                let what = format!("{name}, alpha {alpha}, {sheets} sheets");
                let both = render_as(&s, "none", 2, 8192);
                assert_channels(&format!("{what}, both"), &both, expected, [LIMIT, 0.01, 1e-3, 0.0]);
                let alone = by_scattering(&s, 8192);
                assert_eq!(alone.counters.shadow_rays, 0);
                assert_channels(&format!("{what}, scattering"), &alone, expected, [LIMIT, 0.02, 1e-3, 0.0]);
            }
        }
    }
}

/// Radiance of the light in the plane of the wall.
const IN_WALL: [f32; 3] = [0.0, 0.0, 32.0];

/// Lights in a row along -z, the last behind a wall, with what the camera sees of them.
fn row(spheres_inside: bool) -> (SceneDescription, [f64; 3]) {
    let mut s = one_line([0.0; 3], [0.0, 0.0, -1.0], [0.0; 3]);
    s.environment = None;
    let black = s.add_material("wall", grey(0.0));
    add_quad(&mut s, "wall", black, facing_z(9.0, -20.0, 1.0));
    let edges = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let back = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    let hidden = ShapeLight { visible: false, ..sphere([0.0, 0.0, -9.0], 1.0, [50.0; 3]) };
    let inside = ShapeLight { two_sided: true, ..sphere([0.0, 0.0, 0.5], 1.0, [4.0, 0.0, 0.0]) };
    for light in [
        sphere([0.1, 0.2, -4.0], 1.0, [1.0, 2.0, 3.0]),
        rectangle([0.1, 0.2, -6.0], edges, [0.5, 0.25, 0.0]),
        rectangle([0.1, 0.2, -7.0], back, [70.0; 3]),
        disk([0.1, 0.2, -8.0], [0.3, 0.1, 2.0], 1.0, [0.125, 0.0, 8.0]),
        hidden,
        ShapeLight { two_sided: true, ..rectangle([0.1, 0.2, -10.0], back, [0.0, 16.0, 0.0]) },
        disk([0.1, 0.2, -11.0], [0.0, 0.0, -1.0], 1.0, [90.0; 3]),
        // in the plane of the wall, and behind it
        disk([0.1, 0.2, -20.0], [0.0, 0.0, 1.0], 1.0, IN_WALL),
        sphere([0.0, 0.0, -23.0], 1.0, [100.0; 3]),
    ] {
        s.emitters.push(Emitter::Shape(light));
    }
    let mut seen = [1.625, 18.25, 43.0];
    if spheres_inside {
        s.emitters.push(Emitter::Shape(inside));
        seen[0] += 4.0;
    }
    (s, seen)
}

/// A camera ray takes the radiance of each light along once, whatever it passes on its way, sheets within a sphere and in
/// the plane of a light among them. Killed by: a light that ends the ray, one that two pieces of the ray count, or none; a
/// back that shines, a hidden light that is seen, light through walls.
#[test]
fn camera_rays_meet_each_light_once() {
    for inside in [false, true] {
        let (s, seen) = row(inside);
        assert_exact("in the open", &render_as(&s, "none", 1, 16), seen, 1e-6);
        assert_exact("longer paths", &render_as(&s, "none", 4, 16), seen, 1e-6);
        let mut sheets = s.clone();
        let air = sheets.add_material("air", Model::Null);
        for z in [-0.2, -2.5, -3.0, -3.5, -4.5, -4.75, -5.5, -6.0, -6.0, -7.5, -8.0, -19.0] {
            add_quad(&mut sheets, "sheet", air, facing_z(9.0, z, 1.0).map(|[x, y, z]| [x + 0.5, y + 0.25, z]));
        }
        // behind sheets distances add up too coarsely for a light that lies in a plane with the wall
        sheets.emitters.retain(|e| !matches!(e, Emitter::Shape(l) if l.radiance == IN_WALL));
        let seen = std::array::from_fn(|c| seen[c] - f64::from(IN_WALL[c]));
        assert_exact("through sheets", &render_as(&sheets, "none", 1, 16), seen, 1e-6);
    }
}

/// A camera in fog sees lights as far as light survives: e^(-sigma d) for each, exact where the fog only absorbs, on
/// average where it scatters, in grids as well; rays start inside or outside of it. Killed by: a light that counts whether
/// or not the ray reaches it, a flight that does not go on behind it, the weight of the ray's end.
#[test]
fn lights_in_media_are_dimmed() {
    let (near, far) = ([3.0f32, 2.0, 1.0], [1.0f32, 4.0, 2.0]);
    let edges = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for entry in [0.0f64, 1.5] {
        let mut base = one_line([0.0; 3], [0.0, 0.0, -1.0], [0.0; 3]);
        base.environment = None;
        base.emitters.push(Emitter::Shape(sphere([0.0, 0.0, -4.0], 1.0, near)));
        base.emitters.push(Emitter::Shape(rectangle([0.0, 0.0, -6.0], edges, far)));
        base.emitters.push(Emitter::Shape(disk([0.0, 0.0, -9.0], [0.0, 0.0, 1.0], 1.0, [1.0; 3])));
        let bounds = [[-3.0, -3.0, -8.0], [3.0, 3.0, if entry > 0.0 { -1.5 } else { 5.0 }]];
        let (sigma_a, sigma_s) = ([0.1f32, 0.2, 0.05], [0.15f32, 0.05, 0.4]);
        let expected = |sigma: [f32; 3]| -> [f64; 3] {
            std::array::from_fn(|c| {
                let through = |d: f64| (-f64::from(sigma[c]) * (d - entry)).exp();
                f64::from(near[c]) * through(3.0) + f64::from(far[c]) * through(6.0) + through(8.0)
            })
        };
        let mut clear = base.clone();
        add_medium_box(&mut clear, homogeneous(sigma_a, [0.0; 3], 0.0), bounds[0], bounds[1]);
        assert_exact(&format!("absorbing from {entry}"), &render_as(&clear, "none", 1, 16), expected(sigma_a), 1e-5);

        let sum = std::array::from_fn(|c| sigma_a[c] + sigma_s[c]);
        let fog = homogeneous(sigma_a, sigma_s, 0.3);
        let grid = in_grid(fog.clone(), [4, 4, 4], bounds, vec![1.0; 64]);
        for (name, medium) in [("fog", fog), ("grid", grid)] {
            let mut s = base.clone();
            add_medium_box(&mut s, medium, bounds[0], bounds[1]);
            let image = render_as(&s, "none", 1, 16_384);
            assert!(image.counters.straight_rays > 0);
            assert_channels(&format!("{name} from {entry}"), &image, expected(sum), [LIMIT, 0.006, 1e-4, 0.0]);
        }
    }
}

/// Scattering in fog finds lights by both techniques alike: one bounce of light from a sphere, against scattered rays
/// alone. Killed by: a density that phase functions are not weighted with, a light within a medium that is counted behind
/// its own transmittance twice.
#[test]
fn scattering_in_fog_finds_lights_alike() {
    let mut s = one_line([0.0, 0.0, 2.0], [0.0; 3], [0.0; 3]);
    s.environment = None;
    add_medium_box(&mut s, homogeneous([0.1, 0.2, 0.3], [0.6, 0.5, 0.4], 0.5), [-3.0; 3], [3.0; 3]);
    s.emitters.push(Emitter::Shape(sphere([1.0, 0.5, 0.0], 0.6, [2.0, 3.0, 4.0])));
    s.emitters.push(Emitter::Shape(rectangle([0.0, -1.0, 0.0], [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], [1.0; 3])));
    let (both, alone) = (render_as(&s, "none", 2, 8192), by_scattering(&s, 32_768));
    let expected: [f64; 3] = std::array::from_fn(|c| alone.channel(c));
    for (c, expected) in expected.into_iter().enumerate() {
        let error = both.error_of_channel(c).hypot(alone.error_of_channel(c));
        assert!(error < 0.012 * expected, "channel {c}: {error} of {}", expected);
        let off = both.channel(c) - expected;
        assert!(off.abs() < LIMIT * error, "channel {c}: {} and {}, +- {error}", both.channel(c), expected);
    }
}
