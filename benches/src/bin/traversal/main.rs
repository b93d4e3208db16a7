//! Rays per second of the built-in traversal beside obvhs's own Bvh2 and CwBvh traversals, on identical ray arrays.
//!
//! Sets: primary rays, first and third diffuse bounce, shadow rays from primary and from first-bounce hits towards a
//! square emitter below the top of the scene. Kernels take turns inside each round; the table shows medians over the
//! rounds, the spread between the quartiles, and the ratio to Bvh2. Times are CPU times of this thread where the system
//! tells them. Answers are checked against each other first.
//!
//! `--write` puts the table, and times of repeated windows of packets (`--window` of 512, 64 and 1), into
//! `benches/results/traversal.md`.
//!
//! Beware: `glam` with `scalar-math` anywhere in the same build turns obvhs's own vectors scalar, which about halves
//! its Bvh2 on closest hits. The header of the table says which it is.

mod rays;

use clap::Parser;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::{Hit8, Ray8};
use croupier::unstable::simd::Mask8;
use croupier_benches::clock::Clock;
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_host::bvh::{self, Effort};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;
use rays::Set;
use std::error::Error;
use std::hint::black_box;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
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
    window: Option<NonZero<usize>>,
    /// One line of JSON instead of the table.
    #[arg(long)]
    json: bool,
    /// Write benches/results/traversal.md; needs the kitchen.
    #[arg(long, conflicts_with_all = ["scene", "only", "window", "json"])]
    write: bool,
}

const NAME: &str = "traversal";
/// Packets of the windows in the committed results.
const WINDOWS: [usize; 3] = [512, 64, 1];

/// Folder and file.
fn name_of(scene: &Path) -> String {
    let parts = [scene.parent().and_then(Path::file_name), scene.file_name()];
    parts.into_iter().flatten().map(|p| p.to_string_lossy()).collect::<Vec<_>>().join("/")
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

    /// Nanoseconds per ray in the built-in traversal when windows of `size` packets are traced once, and when they are
    /// traced again, three times.
    fn window(&self, set: &Set, size: usize, rounds: usize) -> [f64; 2] {
        let repeat = |times: usize| {
            let window = |w| (0..times).map(|_| self.packets(black_box(w), set.any).0).sum::<usize>();
            let (hits, seconds) = timed(|| set.packets.chunks(size).map(window).sum::<usize>());
            assert_eq!(hits, times * self.packets(&set.packets, set.any).0, "{}", set.name);
            seconds
        };
        let (once, again) = (0..rounds.max(1)).map(|_| (repeat(1), repeat(4))).map(|(a, b)| (a, (b - a) / 3.0)).unzip();
        [once, again].map(|t| 1e9 * median(t).0 / set.single.len() as f64)
    }

    /// The first time is that of the last size.
    fn windows(&self, sets: &[Set], sizes: &[usize], rounds: usize) -> Table {
        let again: Vec<String> = sizes.iter().map(|n| format!("again in windows of {n}")).collect();
        let mut table = Table::new("Nanoseconds per ray", &format!("rays, first time, {}", again.join(", ")));
        for set in sets {
            let times: Vec<[f64; 2]> = sizes.iter().map(|&size| self.window(set, size, rounds)).collect();
            let first = times.last().map(|t| t[0]);
            let figures = first.into_iter().chain(times.iter().map(|t| t[1])).map(|t| format!("{t:.1}"));
            table.add([set.name.to_string()].into_iter().chain(figures));
        }
        table
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

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut results = Results::of_this_run(NAME);
    let kitchen = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes/kitchen/scene.obj"));
    let scene = args.scene.clone().or_else(|| kitchen.exists().then_some(kitchen));
    if args.write && scene.is_none() {
        return Err("--write: there is no kitchen".into());
    }
    let (triangles, camera) = rays::scene(scene.as_deref());
    let name = scene.as_ref().map_or("generated".into(), |p| name_of(p));

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

    let sets = rays::sets(&kernels.wide, &triangles, &camera, args.width);
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
        print!("{}", kernels.windows(&sets, &[size.get()], args.rounds));
        return Ok(());
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
        return Ok(());
    }
    let facts = [
        ("scene", format!("{name}, {} triangles; tree built in {build_seconds:.1} s", triangles.len())),
        (
            "tree",
            format!(
                "depth {}, {} nodes of {width:.1} children, {} leaves of {fill:.1} triangles, {per_triangle:.0} B/triangle",
                tree.depth,
                tree.nodes.len(),
                tree.leaves.len()
            ),
        ),
        ("obvhs", vectors().into()),
        ("figures", format!("Mrays/s, medians of {} rounds (spread between the quartiles)", args.rounds.max(1))),
    ];
    facts.iter().for_each(|(key, value)| println!("- {key}: {value}"));
    results.header.extend(facts.map(|(key, value)| (key.into(), value)));
    let mut table = Table::new("Speed", &format!("rays, number, {}, ratio to Bvh2", NAMES.join(", ")));
    for (set, s) in rows {
        let kernels = s.iter().map(|(speed, spread)| format!("{speed:.2} ({:.0} %)", 100.0 * spread));
        let ratio = format!("{:.2}", s[0].0 / s[1].0);
        table.add([set.name.to_string(), set.single.len().to_string()].into_iter().chain(kernels).chain([ratio]));
    }
    print!("\n{table}");
    results.tables.push(table);
    if args.write {
        let table = kernels.windows(&sets, &WINDOWS, args.rounds);
        print!("\n{table}");
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()).map(|()| true))
}
