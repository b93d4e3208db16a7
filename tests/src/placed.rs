//! Instances for tests: random maps, and the flat scene that is to look the same.

use crate::geometry::Rng;
use croupier_host::description::{Instance, Prototype, SceneDescription, Triangle, Vertex};

/// Rows of an affine map.
pub type Map = [[f32; 4]; 3];

/// The identity.
pub const IDENTITY: Map = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// A translation.
pub fn translation(t: [f32; 3]) -> Map {
    let mut m = IDENTITY;
    (0..3).for_each(|k| m[k][3] = t[k]);
    m
}

/// A point through a map, in `f64`.
pub fn apply(m: &Map, p: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|r| (0..3).map(|c| f64::from(m[r][c]) * p[c]).sum::<f64>() + f64::from(m[r][3]))
}

/// A vector through the linear part of a map, in `f64`.
pub fn turn(m: &Map, v: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|r| (0..3).map(|c| f64::from(m[r][c]) * v[c]).sum::<f64>())
}

type Matrix = [[f64; 3]; 3];

fn product(a: Matrix, b: Matrix) -> Matrix {
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| (0..3).map(|k| a[r][k] * b[k][c]).sum()))
}

/// A random rotation.
pub fn rotation(r: &mut Rng) -> Matrix {
    let q: [f64; 4] = loop {
        let q = [0; 4].map(|_| f64::from(r.signed()));
        let n: f64 = q.iter().map(|x| x * x).sum();
        if n > 0.01 && n < 1.0 {
            break q.map(|x| x / n.sqrt());
        }
    };
    let [w, x, y, z] = q;
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Kinds of random maps, all of which happen in scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Rotation and uniform scale.
    Similar,
    /// The same, mirrored.
    Mirrored,
    /// Scales along three axes that differ by up to 100 : 1, between rotations.
    Stretched,
    /// Sheared by up to 2, and scaled.
    Sheared,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 4] = [Self::Similar, Self::Mirrored, Self::Stretched, Self::Sheared];

    /// A random map of the kind, with scales around `scale` and a translation.
    pub fn map(self, r: &mut Rng, scale: f64, t: [f64; 3]) -> Map {
        let diagonal = |d: [f64; 3]| [[d[0], 0.0, 0.0], [0.0, d[1], 0.0], [0.0, 0.0, d[2]]];
        let linear = match self {
            Self::Similar => product(rotation(r), diagonal([scale; 3])),
            Self::Mirrored => product(rotation(r), diagonal([scale, -scale, scale])),
            Self::Stretched => {
                let d = [0; 3].map(|_| scale * f64::from(r.log(-1.0, 1.0)));
                product(product(rotation(r), diagonal(d)), rotation(r))
            }
            Self::Sheared => {
                let mut shear = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                (shear[0][1], shear[2][0]) = (2.0 * f64::from(r.signed()), 2.0 * f64::from(r.signed()));
                product(product(rotation(r), shear), diagonal([scale; 3]))
            }
        };
        [0, 1, 2].map(|k| [linear[k][0] as f32, linear[k][1] as f32, linear[k][2] as f32, t[k] as f32])
    }
}

/// Moves what was added to a scene since `first` triangles into a prototype; returns its index.
pub fn add_prototype(scene: &mut SceneDescription, name: &str, first: u32, instances: Vec<Instance>) -> u32 {
    let triangles = first..scene.triangles.len() as u32;
    scene.prototypes.push(Prototype { name: name.into(), triangles, instances });
    scene.prototypes.len() as u32 - 1
}

/// The scene with every visible instance made of triangles of its own, as the shutter opens: those of the world first, then
/// those of each instance and those within it. Smooth triangles get normals through the inverse transpose.
pub fn flatten(scene: &SceneDescription) -> SceneDescription {
    let mut out = SceneDescription { prototypes: vec![], instances: vec![], triangles: vec![], ..scene.clone() };
    let placed = |i: &u32| scene.prototypes.iter().any(|p| p.triangles.contains(i));
    let world = (0..scene.triangles.len() as u32).filter(|i| !placed(i));
    out.triangles.extend(world.map(|i| scene.triangles[i as usize]));
    for i in scene.instances.iter().filter(|i| i.visible) {
        expand(scene, &mut out, i, &[]);
    }
    out
}

fn expand(scene: &SceneDescription, out: &mut SceneDescription, i: &Instance, around: &[Map]) {
    let maps: Vec<Map> = [i.to_world].into_iter().chain(around.iter().copied()).collect();
    let prototype = &scene.prototypes[i.prototype as usize];
    let mirrored = maps.iter().filter(|m| determinant(m) < 0.0).count() % 2 == 1;
    for t in prototype.triangles.clone() {
        let t = scene.triangles[t as usize];
        let first = out.vertices.len() as u32;
        for v in t.vertices {
            let v = scene.vertices[v as usize];
            let p = maps.iter().fold(v.position.map(f64::from), |p, m| apply(m, p));
            let n = maps.iter().fold(v.normal.map(f64::from), |n, m| cofactor_times(m, n));
            out.vertices.push(Vertex { position: p.map(|x| x as f32), normal: unit(n), ..v });
        }
        let vertices = if mirrored { [first, first + 2, first + 1] } else { [first, first + 1, first + 2] };
        out.triangles.push(Triangle { vertices, ..t });
    }
    for inner in prototype.instances.iter().filter(|i| i.visible) {
        expand(scene, out, inner, &maps);
    }
}

fn unit(n: [f64; 3]) -> [f32; 3] {
    let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { n.map(|x| (x / length) as f32) } else { [0.0; 3] }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn column(m: &Map, c: usize) -> [f64; 3] {
    [0, 1, 2].map(|r| f64::from(m[r][c]))
}

fn determinant(m: &Map) -> f64 {
    let n = cross(column(m, 1), column(m, 2));
    column(m, 0).iter().zip(n).map(|(a, b)| a * b).sum()
}

/// The inverse transpose, up to a positive factor.
fn cofactor_times(m: &Map, n: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = [0, 1, 2].map(|c| column(m, c));
    let (a, b, c) = (cross(y, z), cross(z, x), cross(x, y));
    let sign = determinant(m).signum();
    [0, 1, 2].map(|k| sign * (a[k] * n[0] + b[k] * n[1] + c[k] * n[2]))
}
