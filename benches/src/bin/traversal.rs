//! Rays per second of the built-in traversal beside obvhs's own Bvh2 and CwBvh traversals, on identical ray arrays.
//!
//! Sets: primary rays, first and third diffuse bounce, shadow rays from primary and from first-bounce hits towards a
//! square lamp below the top of the scene. Kernels take turns inside each round; the table shows medians over the
//! rounds, the spread between the quartiles, and the ratio to Bvh2. Times are CPU times of this thread where the system
//! tells them. Answers are checked against each other first.
//!
//! Beware: `glam` with `scalar-math` anywhere in the same build turns obvhs's own vectors scalar, which about halves
//! its Bvh2 on closest hits. The first line of the output says which it is.

use clap::Parser;
use croupier::accel::{Intersector, WideBvh};
use croupier::geometry::{Hit8, Ray8};
use croupier::simd::{F32x8, Mask8, Vec3x8};
use croupier_benches::clock::Clock;
use croupier_host::bvh::{self, Effort};
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

#[derive(Parser)]
#[command(about = "Rays per second of the traversal, beside obvhs")]
struct Args {
    /// Scene: an OBJ file, its camera in scene.json beside it. Default: the kitchen if it is there, else a generated
    /// one.
    scene: Option<PathBuf>,
    /// Rounds.
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Primary rays across.
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Only sets whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Instead of the table: nanoseconds per ray when windows of this many packets are traced again and again, which
    /// tells what waiting for memory and unpredictable branches cost.
    #[arg(long, value_name = "PACKETS", conflicts_with = "json")]
    window: Option<std::num::NonZeroUsize>,
    /// One line of JSON instead of the table.
    #[arg(long)]
    json: bool,
}

type Tri = [[f32; 3]; 3];

struct Camera {
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
struct Set {
    name: &'static str,
    any: bool,
    single: Vec<Ray>,
    packets: Vec<(Ray8, Mask8)>,
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

fn shadow(points: &[(Vec3, Vec3)], lamp: (Vec3, f32), r: &mut Random) -> Vec<One> {
    let towards = |&(o, _): &(Vec3, Vec3)| {
        let q = lamp.0 + Vec3::new(r.unit() - 0.5, 0.0, r.unit() - 0.5) * lamp.1;
        One { o, d: q - o, tmax: 0.999 }
    };
    points.iter().map(towards).collect()
}

/// The kernels.
struct Kernels<'a> {
    wide: WideBvh<'a>,
    bvh2: (Bvh2, Vec<Triangle>),
    cwbvh: (CwBvh, Vec<Triangle>),
}

const NAMES: [&str; 3] = ["croupier", "obvhs Bvh2", "obvhs CwBvh"];

impl Kernels<'_> {
    /// Runs the built-in traversal; returns hits and a checksum.
    fn packets(&self, packets: &[(Ray8, Mask8)], any: bool) -> (usize, f64) {
        let (mut n, mut sum) = (0, 0.0);
        for (ray, active) in packets {
            if any {
                n += self.wide.occluded(ray, *active).count() as usize;
            } else {
                let h: Hit8 = self.wide.closest(ray, *active);
                n += h.hit.count() as usize;
                sum += f64::from(h.hit.zero_unless(h.t).sum());
            }
        }
        (n, sum)
    }

    /// Prints what a ray takes in the built-in traversal when windows of `size` packets are traced once, and what when
    /// they are traced again, three times.
    fn windows(&self, sets: &[Set], size: usize, rounds: usize) {
        println!("nanoseconds per ray, windows of {size} packets: the first time, again");
        for set in sets {
            let repeat = |times: usize| {
                let window = |w| (0..times).map(|_| self.packets(black_box(w), set.any).0).sum::<usize>();
                let (hits, seconds) = timed(|| set.packets.chunks(size).map(window).sum::<usize>());
                assert_eq!(hits, times * self.packets(&set.packets, set.any).0, "{}", set.name);
                seconds
            };
            let (once, again) =
                (0..rounds.max(1)).map(|_| (repeat(1), repeat(4))).map(|(a, b)| (a, (b - a) / 3.0)).unzip();
            let [once, again] = [once, again].map(|t| 1e9 * median(t).0 / set.single.len() as f64);
            println!("{:<10}{once:>8.1}{again:>8.1}", set.name);
        }
    }

    /// Runs kernel `k` over the set; returns hits and a checksum.
    fn run(&self, k: usize, set: &Set) -> (usize, f64) {
        let (mut n, mut sum) = (0, 0.0);
        match (k, set.any) {
            (0, _) => (n, sum) = self.packets(&set.packets, set.any),
            (_, false) => {
                for ray in &set.single {
                    let mut h = RayHit::none();
                    let hit = if k == 1 {
                        self.bvh2.0.ray_traverse(*ray, &mut h, |r, i| self.bvh2.1[i].intersect(r))
                    } else {
                        self.cwbvh.0.ray_traverse(*ray, &mut h, |r, i| self.cwbvh.1[i].intersect(r))
                    };
                    n += usize::from(hit);
                    sum += if hit { f64::from(h.t) } else { 0.0 };
                }
            }
            (_, true) => {
                for ray in &set.single {
                    let miss = if k == 1 {
                        self.bvh2.0.ray_traverse_miss(*ray, |r, i| self.bvh2.1[i].intersect(r))
                    } else {
                        self.cwbvh.0.ray_traverse_miss(*ray, |r, i| self.cwbvh.1[i].intersect(r))
                    };
                    n += usize::from(!miss);
                }
            }
        }
        (n, sum)
    }
}

/// How obvhs computes: glam's types live in a module named after their implementation.
fn vectors() -> &'static str {
    if std::any::type_name::<glam::BVec3A>().contains("scalar") { "with scalar vectors" } else { "with SIMD vectors" }
}

/// A copy that starts at a multiple of 64 bytes, as sections of a blob do.
fn aligned<'a, T: bytemuck::Pod>(records: &[T], memory: &'a mut Vec<u8>) -> &'a [T] {
    let bytes: &[u8] = bytemuck::cast_slice(records);
    memory.resize(bytes.len() + 64, 0);
    let start = memory.as_ptr().align_offset(64);
    memory[start..start + bytes.len()].copy_from_slice(bytes);
    bytemuck::cast_slice(&memory[start..start + bytes.len()])
}

/// Seconds of this thread.
fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let clock = Clock::start();
    let out = black_box(f());
    (out, clock.seconds())
}

/// Median and quartile spread over the median.
fn median(mut v: Vec<f64>) -> (f64, f64) {
    v.sort_by(f64::total_cmp);
    let at = |q: f64| v[((v.len() - 1) as f64 * q).round() as usize];
    (at(0.5), (at(0.75) - at(0.25)) / at(0.5))
}

fn main() {
    let args = Args::parse();
    let kitchen = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes/kitchen/scene.obj"));
    let scene = args.scene.clone().or_else(|| kitchen.exists().then_some(kitchen));
    let (triangles, camera) = match &scene {
        Some(path) => {
            let triangles = read_obj(path);
            let (lo, hi) = bounds(&triangles);
            let around =
                Camera { origin: lo.lerp(hi, 0.9), target: (lo + hi) * 0.5, up: Vec3::Y, vfov: 60.0, aspect: 1.5 };
            (triangles, read_camera(&path.with_file_name("scene.json")).unwrap_or(around))
        }
        None => generated(),
    };
    let name = scene.as_ref().map_or("generated".into(), |p| p.display().to_string());

    let start = Instant::now();
    let tree = bvh::build(&triangles, Effort::Medium);
    let build_seconds = start.elapsed().as_secs_f64();
    let given: Vec<Triangle> =
        triangles.iter().map(|t| t.map(Vec3A::from_array)).map(|[v0, v1, v2]| Triangle { v0, v1, v2 }).collect();
    let bvh2 = build_bvh2_from_tris(&given, BvhBuildParams::medium_build(), &mut Duration::default());
    let cwbvh = build_cwbvh_from_tris(&given, BvhBuildParams::medium_build(), &mut Duration::default());
    let order = |ids: &[u32]| ids.iter().map(|&i| given[i as usize]).collect::<Vec<_>>();
    let (two, compressed) = (order(&bvh2.primitive_indices), order(&cwbvh.primitive_indices));
    let (mut nodes, mut leaves) = (Vec::new(), Vec::new());
    let kernels = Kernels {
        wide: WideBvh::from_parts(aligned(&tree.nodes, &mut nodes), aligned(&tree.leaves, &mut leaves)),
        bvh2: (bvh2, two),
        cwbvh: (cwbvh, compressed),
    };

    let mut r = Random(3);
    let (lo, hi) = bounds(&triangles);
    let size = hi - lo;
    let lamp = (Vec3::new(0.5 * (lo.x + hi.x), hi.y - 0.05 * size.y, 0.5 * (lo.z + hi.z)), 0.1 * size.x);
    let p = primary(&camera, args.width);
    let first = hits(&kernels.wide, &triangles, &p);
    let d1 = bounce(&first, &mut r);
    let second = hits(&kernels.wide, &triangles, &d1);
    let d2 = bounce(&second, &mut r);
    let d3 = bounce(&hits(&kernels.wide, &triangles, &d2), &mut r);
    let (s1, s2) = (shadow(&first, lamp, &mut r), shadow(&second, lamp, &mut r));
    let sets = [
        Set::new("primary", false, &p),
        Set::new("bounce 1", false, &d1),
        Set::new("bounce 3", false, &d3),
        Set::new("shadow 1", true, &s1),
        Set::new("shadow 2", true, &s2),
    ];

    let sets: Vec<Set> = sets.into_iter().filter(|s| s.name.contains(&args.only)).collect();
    // enough passes per measurement to average over what else the machine does
    let mut passes = vec![[1u32; 3]; sets.len()];
    for (set, passes) in sets.iter().zip(&mut passes) {
        let answers: Vec<(usize, f64)> = (0..3)
            .map(|k| {
                let start = Instant::now();
                let answer = kernels.run(k, set);
                passes[k] = (0.15 / start.elapsed().as_secs_f64()).ceil().clamp(1.0, 100.0) as u32;
                answer
            })
            .collect();
        for (k, a) in answers.iter().enumerate().skip(1) {
            let (hits, sum) = answers[0];
            // CwBvh drops some hits of its quantised boxes
            let few = [0.0, 1e-3, 1e-2][k];
            let close =
                hits.abs_diff(a.0) as f64 <= few * hits.max(1000) as f64 && (sum - a.1).abs() <= 2.0 * few * sum;
            assert!(close, "{}: {} says {a:?}, {} says {:?}", set.name, NAMES[k], NAMES[0], answers[0]);
        }
    }
    if let Some(size) = args.window {
        return kernels.windows(&sets, size.get(), args.rounds);
    }

    let mut times = vec![vec![Vec::new(); 3]; sets.len()];
    for round in 0..args.rounds.max(1) {
        for ((set, times), passes) in sets.iter().zip(&mut times).zip(&passes) {
            for k in 0..3 {
                let k = (k + round) % 3;
                let run = || (0..passes[k]).map(|_| kernels.run(k, set).0).sum::<usize>();
                times[k].push(timed(run).1 / f64::from(passes[k]));
            }
        }
    }

    let bytes = size_of_val(&tree.nodes[..]) + size_of_val(&tree.leaves[..]);
    let per_triangle = bytes as f64 / triangles.len() as f64;
    let fill = triangles.len() as f64 / tree.leaves.len() as f64;
    let width = (tree.nodes.len() + tree.leaves.len() - 1) as f64 / tree.nodes.len() as f64;
    let mut rows = Vec::new();
    for (set, times) in sets.iter().zip(times) {
        let speed = times.into_iter().map(|t| {
            let (t, spread) = median(t);
            (set.single.len() as f64 / t * 1e-6, spread)
        });
        rows.push((set, speed.collect::<Vec<_>>()));
    }
    if args.json {
        let sets: Vec<_> = rows
            .iter()
            .map(|(set, s)| {
                let kernel = |k: usize| serde_json::json!({"mrays_per_s": s[k].0, "spread": s[k].1});
                serde_json::json!({
                    "set": set.name, "rays": set.single.len(), "ratio": s[0].0 / s[1].0,
                    "croupier": kernel(0), "bvh2": kernel(1), "cwbvh": kernel(2),
                })
            })
            .collect();
        let tree = serde_json::json!({
            "depth": tree.depth, "nodes": tree.nodes.len(), "leaves": tree.leaves.len(),
            "bytes_per_triangle": per_triangle, "build_seconds": build_seconds,
        });
        println!(
            "{}",
            serde_json::json!({"scene": name, "triangles": triangles.len(), "obvhs": vectors(), "tree": tree, "sets": sets})
        );
        return;
    }
    println!("{name}: {} triangles, built in {build_seconds:.1} s; obvhs {}", triangles.len(), vectors());
    println!(
        "tree: depth {}, {} nodes of {width:.1} children, {} leaves of {fill:.1} triangles, {per_triangle:.0} B/triangle",
        tree.depth,
        tree.nodes.len(),
        tree.leaves.len()
    );
    println!("{:<10}{:>9}  Mrays/s (spread between quartiles)", "", "rays");
    for (set, s) in rows {
        print!("{:<10}{:>9}", set.name, set.single.len());
        for k in 0..3 {
            print!("  {} {:.2} ({:.0} %)", NAMES[k], s[k].0, 100.0 * s[k].1);
        }
        println!("  ratio to Bvh2 {:.2}", s[0].0 / s[1].0);
    }
}

fn bounds(triangles: &[Tri]) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    triangles.iter().flatten().fold(start, |(lo, hi), p| {
        let p = Vec3::from_array(*p);
        (lo.min(p), hi.max(p))
    })
}
