//! The scene of `croupier` without arguments: a still life of metal, glazed ceramics and plaster under sun and sky.

use super::{add_sphere, cross, unit};
use crate::description::*;
use crate::look::{Axes, Sun, daylight};
use std::f64::consts::TAU;

type V = [f64; 3];

/// Albedo of the ground.
const GROUND: f32 = 0.42;

/// A copper knot on a plinth, a vase and balls, in the light of a clear afternoon. Everything that shines is a little
/// rough, so that the sun shows in it; nothing focuses light, so that few samples make a clean picture.
///
/// ```
/// let scene = croupier_host::builtin::showcase();
/// assert_eq!(scene.camera.size, [640, 432]);
/// ```
pub fn showcase() -> SceneDescription {
    let mut scene = SceneDescription {
        camera: Camera {
            origin: [2.55, 1.75, 6.4],
            target: [0.02, 0.9, 0.0],
            vfov_deg: 25.5,
            size: [640, 432],
            ..Camera::default()
        },
        max_depth: 12,
        ..SceneDescription::default()
    };
    let diffuse = |rgb| Model::Diffuse { reflectance: Reflectance::Constant(rgb) };
    let glazed =
        |rgb| Model::RoughPlastic { reflectance: Reflectance::Constant(rgb), int_ior: 1.5, ext_ior: 1.0, alpha: 0.06 };
    let white = Reflectance::Constant([1.0; 3]);
    // eta and k at 630, 530 and 465 nm
    let copper = Model::RoughConductor {
        eta: [0.2004, 0.9240, 1.1022],
        k: [3.9129, 2.4528, 2.1421],
        reflectance: white,
        alpha: 0.14,
    };
    let gold = Model::RoughConductor {
        eta: [0.1431, 0.3749, 1.4424],
        k: [3.9831, 2.3857, 1.6032],
        reflectance: white,
        alpha: 0.07,
    };
    let mut material = |name: &str, model| {
        let index = scene.add_material(name, model);
        scene.materials[index as usize].compensated = true;
        index
    };
    let ground = material("ground", diffuse([GROUND; 3]));
    let plaster = material("plaster", diffuse([0.74, 0.72, 0.69]));
    let copper = material("copper", copper);
    let gold = material("gold", gold);
    let teal = material("teal glaze", glazed([0.03, 0.27, 0.30]));
    let cream = material("cream glaze", glazed([0.72, 0.66, 0.55]));
    let coral = material("coral glaze", glazed([0.62, 0.12, 0.07]));
    let navy = material("blue glaze", glazed([0.05, 0.10, 0.34]));

    let far = 60.0;
    let corners = [[-far, 0.0, far], [far, 0.0, far], [far, 0.0, -far], [-far, 0.0, -far]];
    let vertices = corners.map(|position| Vertex { position, ..Vertex::default() });
    scene.add_mesh("ground", ground, &vertices, &[[0, 1, 2], [0, 2, 3]], false);

    // rows close to the edges keep the flat parts flat
    let plinth = [
        [0.0, 0.3],
        [0.9, 0.3],
        [1.04, 0.3],
        [1.06, 0.298],
        [1.078, 0.285],
        [1.085, 0.265],
        [1.085, 0.2],
        [1.085, 0.0],
    ];
    lathe(&mut scene, "plinth", plaster, [0.0; 3], &plinth);
    let knot = standing_knot();
    let lowest = knot.0.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
    let lifted: Vec<V> = knot.0.iter().map(|[x, y, z]| [*x, y - lowest + 0.3, *z]).collect();
    add_smooth(&mut scene, "knot", copper, &lifted, &knot.1);
    lathe(&mut scene, "vase", teal, [-1.72, 0.0, -0.75], &vase());
    lathe(&mut scene, "bowl", cream, [1.62, 0.0, 0.35], &bowl());
    let balls = [
        ("gold ball", gold, [-1.18, 0.24, 0.78], 0.24),
        ("coral ball", coral, [-0.62, 0.14, 1.28], 0.14),
        ("cream ball", cream, [0.92, 0.17, 1.3], 0.17),
        ("blue ball", navy, [1.62, 0.30, 0.35], 0.22),
        ("small gold ball", gold, [1.42, 0.09, 1.2], 0.09),
    ];
    for (name, material, centre, radius) in balls {
        add_sphere(&mut scene, name, material, centre, radius);
    }
    let (sun, sky) = daylight(Sun { azimuth_deg: -58.0, elevation_deg: 33.0 }, &Axes::Y, GROUND.into());
    scene.emitters.push(sun);
    scene.environment = Some(sky);
    scene
}

/// Points and quads of a tube around the torus knot (2, 3) that stands on two of its lobes.
fn standing_knot() -> (Vec<V>, Vec<[u32; 4]>) {
    const SCALE: f64 = 0.265;
    const TUBE: f64 = 0.46;
    const ALONG: usize = 480;
    const AROUND: usize = 48;
    // one lobe upwards, the curve's plane towards the camera
    let curve = |t: f64| -> V {
        let r = 2.0 + (3.0 * t).cos();
        let a = 2.0 * t + TAU / 4.0;
        [r * a.cos(), r * a.sin(), (3.0 * t).sin()]
    };
    let mut points = Vec::with_capacity(ALONG * AROUND);
    for i in 0..ALONG {
        let t = TAU * i as f64 / ALONG as f64;
        let (p, next) = (curve(t), curve(t + 1e-4));
        let tangent = unit(std::array::from_fn(|k| next[k] - p[k]));
        // outwards from the middle, across the tangent
        let side = unit(cross(tangent, p));
        let outwards = cross(side, tangent);
        for j in 0..AROUND {
            let (sin, cos) = (TAU * j as f64 / AROUND as f64).sin_cos();
            points.push(std::array::from_fn(|k| SCALE * (p[k] + TUBE * (outwards[k] * cos + side[k] * sin))));
        }
    }
    let at = |i: usize, j: usize| (i % ALONG * AROUND + j % AROUND) as u32;
    let quads = (0..ALONG * AROUND).map(|k| {
        let (i, j) = (k / AROUND, k % AROUND);
        [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]
    });
    (points, quads.collect())
}

/// Profile of a vase, radius and height, up its outside and down its inside.
fn vase() -> Vec<[f64; 2]> {
    let radius = |y: f64| 0.19 + 0.28 * (y * 2.15 + 0.35).sin().max(-1.0) * (-0.55 * y).exp() + 0.055 * y;
    let heights = || (0..=72).map(|i| 1.62 * f64::from(i) / 72.0);
    let foot = [[0.0, 0.0], [radius(0.0) - 0.02, 0.0], [radius(0.0) - 0.005, 0.004]];
    let outside = heights().skip(1).map(|y| [radius(y), y]);
    let inside = heights().rev().skip(1).take(60).map(|y| [radius(y) - 0.03, y]);
    foot.into_iter().chain(outside).chain(inside).collect()
}

/// Profile of a shallow bowl.
fn bowl() -> Vec<[f64; 2]> {
    let arc = |a: f64, r: f64| [r * a.sin(), 0.47 - r * a.cos()];
    let foot = [[0.0, 0.0], [0.17, 0.0], [0.18, 0.012], [0.18, 0.03]];
    let outside = (12..=40).map(|i| arc(TAU / 4.0 * f64::from(i) / 48.0, 0.45));
    let inside = (0..=40).rev().map(|i| arc(TAU / 4.0 * f64::from(i) / 48.0, 0.425));
    foot.into_iter().chain(outside).chain(inside).collect()
}

/// Turns a profile of radius and height, whose solid lies left of its course from the axis on, around an upright axis.
fn lathe(scene: &mut SceneDescription, name: &str, material: u32, at: V, profile: &[[f64; 2]]) {
    const AROUND: usize = 160;
    let mut points = Vec::with_capacity(profile.len() * AROUND);
    for [r, y] in profile {
        for j in 0..AROUND {
            let (sin, cos) = (TAU * j as f64 / AROUND as f64).sin_cos();
            points.push([at[0] + r * cos, at[1] + y, at[2] - r * sin]);
        }
    }
    // A profile that begins below goes up its outside; the plinth's begins on top and goes down.
    let rising = profile.first().zip(profile.last()).is_some_and(|(a, b)| a[1] < b[1] || b[0] == 0.0);
    let at = |i: usize, j: usize| (i * AROUND + j % AROUND) as u32;
    let quads: Vec<[u32; 4]> = (0..(profile.len() - 1) * AROUND)
        .map(|k| {
            let (i, j) = (k / AROUND, k % AROUND);
            let quad = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            if rising { quad } else { [quad[3], quad[2], quad[1], quad[0]] }
        })
        .collect();
    add_smooth(scene, name, material, &points, &quads);
}

/// Adds quads with normals that are the mean of their neighbours', weighted by area.
fn add_smooth(scene: &mut SceneDescription, name: &str, material: u32, points: &[V], quads: &[[u32; 4]]) {
    let mut normals = vec![[0.0; 3]; points.len()];
    let corners = |t: &[u32; 3]| t.map(|v| points[v as usize].map(|x| x as f32));
    // quads at a pole have two corners in one place
    let has_area = |t: &[u32; 3]| {
        let [a, b, c] = corners(t);
        a != b && b != c && c != a
    };
    let halves = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    let triangles: Vec<[u32; 3]> = halves.filter(has_area).collect();
    for t in &triangles {
        let [a, b, c] = t.map(|v| points[v as usize]);
        let n = cross(std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
        for v in t {
            (0..3).for_each(|k| normals[*v as usize][k] += n[k]);
        }
    }
    let vertices: Vec<Vertex> = points
        .iter()
        .zip(normals)
        .map(|(p, n)| Vertex { position: p.map(|x| x as f32), normal: n.map(|x| x as f32), ..Vertex::default() })
        .collect();
    scene.add_mesh(name, material, &vertices, &triangles, true);
}
