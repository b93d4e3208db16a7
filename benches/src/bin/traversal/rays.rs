//! The scene of the benchmark, and its sets of rays in the layouts of the kernels.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::Ray8;
use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};
use croupier_tests::geometry::star;
use glam::Vec3;
use obvhs::ray::Ray;
use std::path::Path;

/// Corners of a triangle.
pub(crate) type Tri = [[f32; 3]; 3];

/// What primary rays need of a camera.
pub(crate) struct Camera {
    origin: Vec3,
    target: Vec3,
    up: Vec3,
    vfov: f32,
    aspect: f32,
}

fn read_obj(path: &Path) -> Vec<Tri> {
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut out = Vec::new();
    for m in models {
        let p = |i: u32| [0, 1, 2].map(|k| m.mesh.positions[3 * i as usize + k]);
        out.extend(m.mesh.indices.chunks_exact(3).map(|f| [p(f[0]), p(f[1]), p(f[2])]));
    }
    out
}

fn read_camera(path: &Path) -> Option<Camera> {
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()?;
    let c = json.get("camera")?;
    let number = |v: &serde_json::Value| v.as_f64().map(|x| x as f32);
    let vector = |k: &str| -> Option<Vec3> {
        let a = c.get(k)?.as_array()?;
        Some(Vec3::new(number(a.first()?)?, number(a.get(1)?)?, number(a.get(2)?)?))
    };
    let (w, h) = (number(c.get("width")?)?, number(c.get("height")?)?);
    let vfov = number(c.get("vfov_deg")?)?;
    Some(Camera { origin: vector("origin")?, target: vector("target")?, up: vector("up")?, vfov, aspect: w / h })
}

/// A hilly floor with thousands of small pyramids, in a box: 200 000 triangles.
fn generated() -> (Vec<Tri>, Camera) {
    let (mut r, mut out) = (Random(5), Vec::new());
    let height = |x: f32, z: f32| 0.3 * (x * 1.7).sin() * (z * 1.3).cos();
    let n = 200;
    let at = |i: usize| 10.0 * (i as f32 / n as f32 - 0.5);
    let p = |i: usize, j: usize| [at(i), height(at(i), at(j)), at(j)];
    for i in 0..n {
        for j in 0..n {
            out.push([p(i, j), p(i + 1, j), p(i + 1, j + 1)]);
            out.push([p(i, j), p(i + 1, j + 1), p(i, j + 1)]);
        }
    }
    for _ in 0..30_000 {
        let (x, z, s) = (9.8 * (r.unit() - 0.5), 9.8 * (r.unit() - 0.5), 0.02 + 0.1 * r.unit());
        let y = height(x, z) + 2.5 * r.unit() * r.unit();
        let q = [[x - s, y, z - s], [x + s, y, z - s], [x + s, y, z + s], [x - s, y, z + s]];
        let top = [x, y + 2.0 * s, z];
        out.extend((0..4).map(|k| [q[k], q[(k + 1) % 4], top]));
    }
    let c = |i: usize| [[-5.0, 5.0][i & 1], [-1.0, 4.0][i >> 1 & 1], [-5.0, 5.0][i >> 2 & 1]];
    for f in [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]] {
        out.push([c(f[0]), c(f[1]), c(f[2])]);
        out.push([c(f[0]), c(f[2]), c(f[3])]);
    }
    let camera = Camera {
        origin: Vec3::new(0.3, 2.5, 4.6),
        target: Vec3::new(0.0, 0.5, 0.0),
        up: Vec3::Y,
        vfov: 45.0,
        aspect: 16.0 / 9.0,
    };
    (out, camera)
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = ((self.0 >> 18) ^ self.0) >> 27;
        ((x as u32).rotate_right((self.0 >> 59) as u32) >> 8) as f32 / 16_777_216.0
    }
}

/// One ray of a set.
#[derive(Clone, Copy)]
struct One {
    o: Vec3,
    d: Vec3,
    tmax: f32,
}

/// One set in the two layouts.
pub(crate) struct Set {
    pub name: &'static str,
    /// Is any hit enough?
    pub any: bool,
    pub single: Vec<Ray>,
    pub packets: Vec<(Ray8, Mask8)>,
}

impl Set {
    fn new(name: &'static str, any: bool, rays: &[One]) -> Self {
        let vector = |c: &[One], f: &dyn Fn(&One) -> Vec3| {
            Vec3x8::from_fn(|i| c.get(i).map_or([0.0, 0.0, 1.0], |r| f(r).to_array()))
        };
        let packets = rays.chunks(8).map(|c| {
            let ray = Ray8 {
                o: vector(c, &|r| r.o),
                d: vector(c, &|r| r.d),
                tmin: F32x8::ZERO,
                tmax: F32x8::from_fn(|i| c.get(i).map_or(1.0, |r| r.tmax)),
                time: F32x8::ZERO,
            };
            (ray, Mask8::first(c.len()))
        });
        let single = rays.iter().map(|r| Ray::new(r.o.into(), r.d.into(), 0.0, r.tmax));
        Self { name, any, single: single.collect(), packets: packets.collect() }
    }
}

/// Primary rays in the order of a render with one sample per pixel: tiles of 8 x 8 pixels, in each the Morton order, so
/// that eight rays are a block of 4 x 2.
fn primary(camera: &Camera, width: usize) -> Vec<One> {
    let width = width.next_multiple_of(8);
    let height = ((width as f32 / camera.aspect) as usize).next_multiple_of(8);
    let forward = (camera.target - camera.origin).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let h = (camera.vfov.to_radians() * 0.5).tan();
    let mut out = Vec::with_capacity(width * height);
    let even_bits = |x: usize| x & 1 | x >> 1 & 2 | x >> 2 & 4;
    for y in (0..height).step_by(8) {
        for x in (0..width).step_by(8) {
            for i in 0..64 {
                let sx = 2.0 * ((x + even_bits(i)) as f32 + 0.5) / width as f32 - 1.0;
                let sy = 1.0 - 2.0 * ((y + even_bits(i >> 1)) as f32 + 0.5) / height as f32;
                let d = forward + right * (sx * h * camera.aspect) + up * (sy * h);
                out.push(One { o: camera.origin, d: d.normalize(), tmax: f32::INFINITY });
            }
        }
    }
    out
}

/// Hit points with normals that face the rays; rays that miss are dropped.
fn hits(bvh: &WideBvh<'_>, triangles: &[Tri], rays: &[One]) -> Vec<(Vec3, Vec3)> {
    let mut out = Vec::new();
    for (rays, (ray, active)) in rays.chunks(8).zip(&Set::new("", false, rays).packets) {
        let h = bvh.closest(ray, *active);
        for i in h.hit.lanes() {
            let [a, b, c] = triangles[h.triangle.lane(i) as usize].map(Vec3::from_array);
            let (u, v) = (h.u.lane(i), h.v.lane(i));
            let n = (b - a).cross(c - a).normalize_or_zero();
            let n = if n.dot(rays[i].d) > 0.0 { -n } else { n };
            let p = a * (1.0 - u - v) + b * u + c * v;
            out.push((p + n * (1e-5 * (1.0 + p.abs().max_element())), n));
        }
    }
    out
}

fn bounce(points: &[(Vec3, Vec3)], r: &mut Random) -> Vec<One> {
    let sample = |&(o, n): &(Vec3, Vec3)| {
        let (z, phi) = (1.0 - 2.0 * r.unit(), std::f32::consts::TAU * r.unit());
        let s = (1.0 - z * z).max(0.0).sqrt();
        // a unit normal plus a point on the unit sphere: cosine-distributed
        let d = (n + 0.999 * Vec3::new(s * phi.cos(), s * phi.sin(), z)).normalize();
        One { o, d, tmax: f32::INFINITY }
    };
    points.iter().map(sample).collect()
}

fn shadow(points: &[(Vec3, Vec3)], emitter: (Vec3, f32), r: &mut Random) -> Vec<One> {
    let towards = |&(o, _): &(Vec3, Vec3)| {
        let q = emitter.0 + Vec3::new(r.unit() - 0.5, 0.0, r.unit() - 0.5) * emitter.1;
        One { o, d: q - o, tmax: 0.999 }
    };
    points.iter().map(towards).collect()
}

fn bounds(triangles: &[Tri]) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    triangles.iter().flatten().fold(start, |(lo, hi), p| {
        let p = Vec3::from_array(*p);
        (lo.min(p), hi.max(p))
    })
}

/// Triangles and camera of an OBJ file with its `scene.json`, or of a generated scene.
pub(crate) fn scene(path: Option<&Path>) -> (Vec<Tri>, Camera) {
    let Some(path) = path else { return generated() };
    let triangles = read_obj(path);
    let camera = read_camera(&path.with_file_name("scene.json")).unwrap_or_else(|| inside(&triangles));
    (triangles, camera)
}

/// A camera near a corner of the scene's bounds.
fn inside(triangles: &[Tri]) -> Camera {
    let (lo, hi) = bounds(triangles);
    Camera { origin: lo.lerp(hi, 0.9), target: (lo + hi) * 0.5, up: Vec3::Y, vfov: 60.0, aspect: 1.5 }
}

/// A closed mesh around `offset`, and rays from its middle to points of edges and to vertices, as closest-hit and as
/// any-hit rays. One that hits nothing has leaked.
pub(crate) fn aimed(offset: [f32; 3], scale: f32, number: usize) -> (Vec<Tri>, Camera, [Set; 4]) {
    let triangles = star(64, offset, scale, 7);
    let (mut r, middle) = (Random(11), Vec3::from_array(offset));
    let mut aim = |edges: bool| {
        let mut origin = middle;
        let ray = |i: usize| {
            // packets of one origin and of many
            if i.is_multiple_of(8) || (i / 8).is_multiple_of(2) {
                origin = middle + 0.3 * scale * Vec3::new(r.unit() - 0.5, r.unit() - 0.5, r.unit() - 0.5);
            }
            let t = triangles[(r.unit() * triangles.len() as f32) as usize % triangles.len()].map(Vec3::from_array);
            let e = (3.0 * r.unit()) as usize % 3;
            let s = if edges { r.unit() } else { 0.0 };
            One { o: origin, d: t[e].lerp(t[(e + 1) % 3], s) - origin, tmax: f32::INFINITY }
        };
        (0..number).map(ray).collect::<Vec<_>>()
    };
    let (edges, vertices) = (aim(true), aim(false));
    let camera = inside(&triangles);
    let sets = [
        Set::new("edges, closest hit", false, &edges),
        Set::new("edges, any hit", true, &edges),
        Set::new("vertices, closest hit", false, &vertices),
        Set::new("vertices, any hit", true, &vertices),
    ];
    (triangles, camera, sets)
}

/// Primary rays, bounces and shadow rays.
pub(crate) fn sets(wide: &WideBvh<'_>, triangles: &[Tri], camera: &Camera, width: usize) -> [Set; 5] {
    let mut r = Random(3);
    let (lo, hi) = bounds(triangles);
    let size = hi - lo;
    let emitter = (Vec3::new(0.5 * (lo.x + hi.x), hi.y - 0.05 * size.y, 0.5 * (lo.z + hi.z)), 0.1 * size.x);
    let p = primary(camera, width);
    let first = hits(wide, triangles, &p);
    let d1 = bounce(&first, &mut r);
    let second = hits(wide, triangles, &d1);
    let d2 = bounce(&second, &mut r);
    let d3 = bounce(&hits(wide, triangles, &d2), &mut r);
    let (s1, s2) = (shadow(&first, emitter, &mut r), shadow(&second, emitter, &mut r));
    [
        Set::new("primary", false, &p),
        Set::new("bounce 1", false, &d1),
        Set::new("bounce 3", false, &d3),
        Set::new("shadow 1", true, &s1),
        Set::new("shadow 2", true, &s2),
    ]
}
