//! Meshes, random rays and an f64 brute-force oracle for traversal.

use crate::records::none;
use croupier::unstable::geometry::Ray8;
use croupier::unstable::scene::blob::{Camera, NONE, SceneInfo, Triangle, Vertex};
use croupier::unstable::scene::{Records, Scene};
use croupier::unstable::simd::{F32x8, Vec3x8};
use croupier_host::bvh::{Effort, Tree, build};

/// A triangle's vertices.
pub type Tri = [[f32; 3]; 3];

/// PCG XSH-RR 32, good enough for test data.
#[derive(Clone, Copy, Debug)]
pub struct Rng(pub u64);

impl Rng {
    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = ((self.0 >> 18) ^ self.0) >> 27;
        (x as u32).rotate_right((self.0 >> 59) as u32)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    /// Uniform in the cube [-1, 1)^3.
    pub fn cube(&mut self) -> [f32; 3] {
        [self.signed(), self.signed(), self.signed()]
    }

    /// Below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        self.bits() as usize % n
    }

    /// 10^U(lo, hi).
    pub fn log(&mut self, lo: f32, hi: f32) -> f32 {
        10f32.powf(lo + (hi - lo) * self.unit())
    }
}

/// One ray.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin.
    pub o: [f32; 3],
    /// Direction.
    pub d: [f32; 3],
    /// Exclusive.
    pub tmin: f32,
    /// Exclusive.
    pub tmax: f32,
}

impl Ray {
    /// From `o` along `d`, unlimited.
    pub fn new(o: [f32; 3], d: [f32; 3]) -> Self {
        Self { o, d, tmin: 0.0, tmax: f32::INFINITY }
    }
}

/// Eight rays as a packet; lane `i` is `rays[i]`, missing ones repeat the first.
pub fn packet(rays: &[Ray]) -> Ray8 {
    let at = |i: usize| rays.get(i).unwrap_or(&rays[0]);
    Ray8 {
        o: Vec3x8::from_fn(|i| at(i).o),
        d: Vec3x8::from_fn(|i| at(i).d),
        tmin: F32x8::from_fn(|i| at(i).tmin),
        tmax: F32x8::from_fn(|i| at(i).tmax),
        time: F32x8::ZERO,
    }
}

/// `a - b`.
pub fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

/// `n` random triangles of about `extent` times `size` in a cube of half-width `size` around `offset`.
pub fn soup(n: usize, offset: [f32; 3], size: f32, extent: f32, r: &mut Rng) -> Vec<Tri> {
    let triangle = |_| {
        let c = r.cube();
        [0, 1, 2].map(|_| {
            let e = r.cube();
            [0, 1, 2].map(|k| offset[k] + size * (c[k] + extent * e[k]))
        })
    };
    (0..n).map(triangle).collect()
}

/// Closed, star-shaped mesh around `offset`: a sphere of `n` x `n` vertices with radii in [1, 6] `scale`.
pub fn star(n: usize, offset: [f32; 3], scale: f32, seed: u64) -> Vec<Tri> {
    let mut r = Rng(seed);
    let mut v: Vec<[f32; 3]> = Vec::new();
    for i in 0..n {
        let theta = std::f32::consts::PI * i as f32 / (n - 1) as f32;
        for j in 0..n - 1 {
            let phi = std::f32::consts::TAU * j as f32 / (n - 1) as f32;
            let radius = 1.0 + 5.0 * r.unit();
            v.push(match i {
                0 => [0.0, 0.0, 1.0],
                _ if i == n - 1 => [0.0, 0.0, -1.0],
                _ => [radius * theta.sin() * phi.cos(), radius * theta.sin() * phi.sin(), radius * theta.cos()],
            });
        }
    }
    for p in &mut v {
        *p = [0, 1, 2].map(|k| offset[k] + scale * p[k]);
    }
    let at = |i: usize, j: usize| v[i * (n - 1) + j % (n - 1)];
    let mut out = Vec::new();
    for j in 0..n - 1 {
        out.push([at(0, 0), at(1, j), at(1, j + 1)]);
        for i in 1..n - 2 {
            out.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            out.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        out.push([at(n - 1, 0), at(n - 2, j + 1), at(n - 2, j)]);
    }
    out
}

/// Triangles with a tree, and what else a [`Scene`] needs.
pub struct Mesh {
    /// The triangles.
    pub triangles: Vec<Tri>,
    /// Their tree.
    pub tree: Tree,
    records: Vec<Triangle>,
    vertices: Vec<Vertex>,
    info: SceneInfo,
    camera: Camera,
}

impl Mesh {
    /// Builds the tree.
    pub fn new(triangles: Vec<Tri>) -> Self {
        let tree = build(&triangles, Effort::Medium);
        let vertices = triangles.iter().flatten().map(|&p| Vertex { p, n: [0.0, 0.0, 1.0], uv: [0.0; 2] }).collect();
        let record = |i: u32| Triangle { vertex: [3 * i, 3 * i + 1, 3 * i + 2], material: 0, light: NONE, flags: 0 };
        Self {
            records: (0..triangles.len() as u32).map(record).collect(),
            triangles,
            tree,
            vertices,
            info: bytemuck::Zeroable::zeroed(),
            camera: bytemuck::Zeroable::zeroed(),
        }
    }

    /// As a scene of bare geometry.
    pub fn scene(&self) -> Scene<'_> {
        Scene::assume_valid(Records {
            nodes: &self.tree.nodes,
            leaves: &self.tree.leaves,
            triangles: &self.records,
            vertices: &self.vertices,
            ..none(&self.info, &self.camera)
        })
    }
}

/// What exact arithmetic says of one ray and one triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Clearly outside, behind or beyond.
    Miss,
    /// Clearly inside, at this parameter.
    Hit(f64),
    /// Within rounding of an edge, of the limits, or seen edge-on; the parameter if it is a hit.
    Close(f64),
}

/// Moeller-Trumbore in f64, with margins: `slack` is the relative uncertainty granted to f32 in units of the operands
/// (distances over |o - p|).
pub fn judge(r: &Ray, t: &Tri, slack: f64) -> Verdict {
    let w = |a: [f32; 3]| a.map(f64::from);
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let len = |a: [f64; 3]| dot(a, a).sqrt();
    let (o, d) = (w(r.o), w(r.d));
    let p = t.map(w);
    // signed volumes of the ray with each edge, each against the size of its terms
    let q = p.map(|p| sub(p, o));
    let dl = len(d);
    let volume = |a: [f64; 3], b: [f64; 3]| (dot(d, cross(a, b)), dl * len(a) * len(b));
    let e = [volume(q[1], q[2]), volume(q[2], q[0]), volume(q[0], q[1])];
    let det = e[0].0 + e[1].0 + e[2].0;
    let sure = |(v, s): (f64, f64)| v.abs() > slack * s;
    let t = if det == 0.0 { 0.0 } else { (0..3).map(|i| e[i].0 * dot(q[i], d)).sum::<f64>() / det / (dl * dl) };
    if e.iter().any(|&x| x.0 > 0.0 && sure(x)) && e.iter().any(|&x| x.0 < 0.0 && sure(x)) {
        return Verdict::Miss;
    }
    let scale = e.iter().map(|x| x.1).fold(0.0, f64::max);
    let reach = q.iter().map(|&q| len(q)).fold(0.0, f64::max) / dl;
    if det.abs() <= slack * scale {
        return Verdict::Close(t);
    }
    let t_slack = slack * scale / det.abs() * reach;
    if t < f64::from(r.tmin) - t_slack || t > f64::from(r.tmax) + t_slack {
        return Verdict::Miss;
    }
    let inside = e.iter().all(|&x| x.0 * det.signum() > 0.0 && sure(x));
    if inside && t > f64::from(r.tmin) + t_slack && t < f64::from(r.tmax) - t_slack {
        Verdict::Hit(t)
    } else {
        Verdict::Close(t)
    }
}
