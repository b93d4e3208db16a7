//! Scenes without files.

mod showcase;

pub use showcase::showcase;

use crate::description::*;
use std::collections::HashMap;

/// Reflectances and light of the Cornell box (Goral et al. 1984, in the usual RGB approximation), 2 x 2 x 2 units with
/// the floor at y = 0, open towards the camera; a metal sphere and a glass one stand in it. Each wall has texture coordinates of its own, from 0 to
/// 1, for lightmaps.
///
/// ```
/// let scene = croupier_host::builtin::cornell_box();
/// assert_eq!(scene.camera.size, [400, 400]);
/// assert!(scene.triangles.len() > 10_000);
/// ```
pub fn cornell_box() -> SceneDescription {
    let mut scene = SceneDescription::default();
    // So many pixels that the program's default number of samples takes seconds on two cores.
    add_room(&mut scene, [400, 400]);
    let glass = scene.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    // Silver-white: aluminium's eta and k at 630, 530 and 465 nm.
    let metal = scene.add_material(
        "metal",
        Model::Conductor {
            eta: [1.65746, 0.880369, 0.521229],
            k: [9.22387, 6.26952, 4.837],
            reflectance: Reflectance::Constant([1.0; 3]),
        },
    );
    add_sphere(&mut scene, "metal sphere", metal, [-0.42, 0.4, -0.35], 0.4);
    add_sphere(&mut scene, "glass sphere", glass, [0.45, 0.4, 0.3], 0.4);
    scene
}

/// The Cornell box with its two white blocks: everything diffuse, 32 triangles, 64 x 64 pixels. The scene that every
/// example of embedding renders (`embed-example/box.crp`).
///
/// ```
/// assert_eq!(croupier_host::builtin::cornell_blocks().triangles.len(), 32);
/// ```
pub fn cornell_blocks() -> SceneDescription {
    let mut scene = SceneDescription { max_depth: 8, ..SceneDescription::default() };
    let white = add_room(&mut scene, [64, 64]);
    add_block(&mut scene, "short block", white, [0.33, 0.37], 0.6, [0.955, -0.296]);
    add_block(&mut scene, "tall block", white, [-0.33, -0.3], 1.2, [0.952, 0.306]);
    scene
}

/// Walls, lamp and camera of both boxes; the white material.
fn add_room(scene: &mut SceneDescription, size: [u32; 2]) -> u32 {
    scene.camera =
        Camera { origin: [0.0, 1.0, 6.8], target: [0.0, 1.0, 0.0], vfov_deg: 20.2, size, ..Camera::default() };
    let diffuse = |rgb| Model::Diffuse { reflectance: Reflectance::Constant(rgb) };
    let white = scene.add_material("white", diffuse([0.725, 0.71, 0.68]));
    let red = scene.add_material("red", diffuse([0.63, 0.065, 0.05]));
    let green = scene.add_material("green", diffuse([0.14, 0.45, 0.091]));
    let lamp = scene.add_material("lamp", diffuse([0.0; 3]));
    // Corners counter-clockwise seen from inside.
    let walls: [(&str, u32, [[f32; 3]; 4]); 6] = [
        ("floor", white, [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]]),
        ("ceiling", white, [[-1.0, 2.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.0, 1.0], [-1.0, 2.0, 1.0]]),
        ("back wall", white, [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 2.0, -1.0], [-1.0, 2.0, -1.0]]),
        ("left wall", red, [[-1.0, 0.0, 1.0], [-1.0, 0.0, -1.0], [-1.0, 2.0, -1.0], [-1.0, 2.0, 1.0]]),
        ("right wall", green, [[1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [1.0, 2.0, 1.0], [1.0, 2.0, -1.0]]),
        // Just below the ceiling, so that the two are not in one plane.
        ("lamp", lamp, [[-0.24, 1.998, -0.22], [0.23, 1.998, -0.22], [0.23, 1.998, 0.16], [-0.24, 1.998, 0.16]]),
    ];
    for (name, material, corners) in walls {
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let vertex = |k: usize| Vertex { position: corners[k], uv: uv[k], ..Vertex::default() };
        scene.add_mesh(name, material, &[0, 1, 2, 3].map(vertex), &[[0, 1, 2], [0, 2, 3]], false);
    }
    scene.emitters.push(Emitter::Area { material: lamp, radiance: [17.0, 12.0, 4.0] });
    white
}

/// A block without a bottom, 0.6 wide and deep, that stands on the floor at `centre` (x, z), turned about the vertical by
/// an angle of cosine and sine `turn`.
fn add_block(scene: &mut SceneDescription, name: &str, material: u32, centre: [f32; 2], height: f32, turn: [f32; 2]) {
    let at = |[x, z]: [f32; 2], y| {
        let ([c, s], [x, z]) = (turn, [0.3 * x, 0.3 * z]);
        [centre[0] + c * x + s * z, y, centre[1] - s * x + c * z]
    };
    let ring = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    let mut add = |corners: [[f32; 3]; 4]| {
        let vertex = |position| Vertex { position, ..Vertex::default() };
        scene.add_mesh(name, material, &corners.map(vertex), &[[0, 1, 2], [0, 2, 3]], false);
    };
    add(ring.map(|p| at(p, height)));
    for (p, q) in ring.into_iter().zip([1, 2, 3, 0].map(|i: usize| ring[i])) {
        add([at(p, 0.0), at(q, 0.0), at(q, height), at(p, height)]);
    }
}

/// Subdivisions of the spheres: 20 480 triangles each, 0.06 % of the radius off the true sphere.
const SUBDIVISIONS: u32 = 5;

/// An icosahedron, subdivided and pushed onto the sphere, with the sphere's normals.
fn add_sphere(scene: &mut SceneDescription, name: &str, material: u32, centre: [f32; 3], radius: f32) {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<[f64; 3]> = Vec::new();
    for a in [-1.0, 1.0] {
        for b in [-golden, golden] {
            points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]].map(unit));
        }
    }
    // A face of the icosahedron: three points one edge apart (cosine 1 / sqrt 5), outwards.
    let close = |p: &[f64; 3], q: &[f64; 3]| dot(*p, *q) > 0.4;
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [points[i], points[j], points[k]];
                if close(&a, &b) && close(&b, &c) && close(&c, &a) {
                    let outwards = dot(a, cross(b, c)) > 0.0;
                    let face = if outwards { [i, j, k] } else { [i, k, j] };
                    faces.push(face.map(|v| v as u32));
                }
            }
        }
    }
    for _ in 0..SUBDIVISIONS {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let (p, q) = (points[a as usize], points[b as usize]);
                points.push(unit([p[0] + q[0], p[1] + q[1], p[2] + q[2]]));
                points.len() as u32 - 1
            })
        };
        let split = |&[a, b, c]: &[u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.iter().flat_map(split).collect();
    }
    let place = |p: &[f64; 3]| Vertex {
        position: std::array::from_fn(|i| (f64::from(centre[i]) + f64::from(radius) * p[i]) as f32),
        normal: p.map(|x| x as f32),
        uv: [0.0; 2],
    };
    let vertices: Vec<Vertex> = points.iter().map(place).collect();
    scene.add_mesh(name, material, &vertices, &faces, true);
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(p: [f64; 3]) -> [f64; 3] {
    let length = dot(p, p).sqrt();
    p.map(|x| x / length)
}

/// Environment map of a plain sky: white at the horizon, blue at the zenith, a dim ground below; radiance near 1.
///
/// With y the upward component of the direction, the sky is horizon + (zenith - horizon) sqrt(y); the square root puts
/// most of the change near the horizon, as haze does.
pub fn sky() -> Environment {
    const HORIZON: [f32; 3] = [1.0, 1.0, 1.0];
    const ZENITH: [f32; 3] = [0.3, 0.55, 1.0];
    const GROUND: [f32; 3] = [0.16, 0.14, 0.12];
    // Rows are 3 degrees apart; the map does not depend on the column.
    let (width, height) = (4, 61);
    let row = |j: u32| {
        let y = (f64::from(j) * std::f64::consts::PI / f64::from(height - 1)).cos() as f32;
        let t = y.max(0.0).sqrt();
        if y < -1e-6 { GROUND } else { std::array::from_fn(|c| HORIZON[c] + (ZENITH[c] - HORIZON[c]) * t) }
    };
    let texels = (0..height).flat_map(|j| [row(j); 4]).collect();
    let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Environment::Map { width, height, texels, scale: [1.0; 3], to_world }
}
