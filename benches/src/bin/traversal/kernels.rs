//! The built-in traversal and obvhs's, over trees of the same triangles.

use crate::rays::{self, Camera, Set, Tri};
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::{Hit8, Ray8};
use croupier::unstable::scene::blob::{LEAF_BIT, NONE, Node};
use croupier::unstable::simd::Mask8;
use croupier_benches::clock::Clock;
use croupier_benches::results::Table;
use croupier_host::blob::AlignedBytes;
use croupier_host::bvh::{self, Effort, Tree};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

/// The kernels by number.
pub(crate) const NAMES: [&str; 3] = ["croupier", "obvhs Bvh2", "obvhs CwBvh"];

/// A scene with its trees.
pub(crate) struct Subject {
    pub name: String,
    pub triangles: Vec<Tri>,
    pub camera: Camera,
    pub tree: Tree,
    pub build_seconds: f64,
    /// The tree's records at multiples of 64 bytes, as sections of a blob are.
    nodes: AlignedBytes,
    leaves: AlignedBytes,
    bvh2: (Bvh2, Vec<Triangle>),
    cwbvh: (CwBvh, Vec<Triangle>),
}

impl Subject {
    /// Reads the scene, or generates one, and builds its trees.
    pub(crate) fn new(scene: Option<&Path>) -> Self {
        let (triangles, camera) = rays::scene(scene);
        Self::of(scene.map_or("generated".into(), name_of), triangles, camera)
    }

    /// Builds the trees of a scene.
    pub(crate) fn of(name: String, triangles: Vec<Tri>, camera: Camera) -> Self {
        let start = Instant::now();
        let tree = bvh::build(&triangles, Effort::Medium);
        let build_seconds = start.elapsed().as_secs_f64();
        let given: Vec<Triangle> =
            triangles.iter().map(|t| t.map(Vec3A::from_array)).map(|[v0, v1, v2]| Triangle { v0, v1, v2 }).collect();
        let bvh2 = build_bvh2_from_tris(&given, BvhBuildParams::medium_build(), &mut Duration::default());
        let cwbvh = build_cwbvh_from_tris(&given, BvhBuildParams::medium_build(), &mut Duration::default());
        let order = |ids: &[u32]| ids.iter().map(|&i| given[i as usize]).collect::<Vec<_>>();
        let (two, compressed) = (order(&bvh2.primitive_indices), order(&cwbvh.primitive_indices));
        let (nodes, leaves) = (aligned(&tree.nodes), aligned(&tree.leaves));
        Self {
            name,
            triangles,
            camera,
            tree,
            build_seconds,
            nodes,
            leaves,
            bvh2: (bvh2, two),
            cwbvh: (cwbvh, compressed),
        }
    }

    pub(crate) fn kernels(&self) -> Kernels<'_> {
        let wide = WideBvh::from_parts(bytemuck::cast_slice(&self.nodes), bytemuck::cast_slice(&self.leaves));
        Kernels { wide, bvh2: &self.bvh2, cwbvh: &self.cwbvh }
    }

    /// The tree in words.
    pub(crate) fn facts(&self) -> String {
        let Tree { nodes, leaves, depth, .. } = &self.tree;
        let [on_nodes, on_leaves] = visits(nodes);
        format!(
            "depth {depth}, {} nodes of {:.1} children, {} leaves of {:.1} triangles, {:.0} B/triangle, a line through \
             it meets {on_nodes:.2} nodes and {on_leaves:.2} leaves",
            nodes.len(),
            (nodes.len() + leaves.len() - 1) as f64 / nodes.len() as f64,
            leaves.len(),
            self.triangles.len() as f64 / leaves.len() as f64,
            self.bytes_per_triangle(),
        )
    }

    pub(crate) fn bytes_per_triangle(&self) -> f64 {
        (self.nodes.len() + self.leaves.len()) as f64 / self.triangles.len() as f64
    }
}

/// Nodes and leaves that a random line through the root's box meets: their areas over its own.
fn visits(nodes: &[Node]) -> [f64; 2] {
    let half_area = |[min, max]: [[f32; 3]; 2]| {
        let e = [0, 1, 2].map(|k| f64::from(max[k]) - f64::from(min[k]));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    };
    let bounds = |n: &Node, c: usize| [0, 3].map(|row| [0, 1, 2].map(|k| n.bounds[row + k][c]));
    let used = |n: &Node| (0..8).filter(|c| n.child[*c] != NONE).collect::<Vec<_>>();
    let Some(root) = nodes.first() else { return [0.0; 2] };
    let whole = used(root).into_iter().map(|c| bounds(root, c)).reduce(|a, b| {
        let pick = |row: usize, f: fn(f32, f32) -> f32| [0, 1, 2].map(|k| f(a[row][k], b[row][k]));
        [pick(0, f32::min), pick(1, f32::max)]
    });
    let whole = whole.map_or(1.0, half_area);
    let mut visits = [1.0, 0.0];
    for n in nodes {
        for c in used(n) {
            visits[usize::from(n.child[c] & LEAF_BIT != 0)] += half_area(bounds(n, c)) / whole;
        }
    }
    visits
}

/// Folder and file.
fn name_of(scene: &Path) -> String {
    let parts = [scene.parent().and_then(Path::file_name), scene.file_name()];
    parts.into_iter().flatten().map(|p| p.to_string_lossy()).collect::<Vec<_>>().join("/")
}

fn aligned<T: bytemuck::Pod>(records: &[T]) -> AlignedBytes {
    let bytes: &[u8] = bytemuck::cast_slice(records);
    let mut copy = AlignedBytes::zeroed(bytes.len());
    copy.as_mut().copy_from_slice(bytes);
    copy
}

/// The kernels.
pub(crate) struct Kernels<'a> {
    pub wide: WideBvh<'a>,
    bvh2: &'a (Bvh2, Vec<Triangle>),
    cwbvh: &'a (CwBvh, Vec<Triangle>),
}

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
    pub(crate) fn windows(&self, sets: &[Set], sizes: &[usize], rounds: usize) -> Table {
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
    pub(crate) fn run(&self, k: usize, set: &Set) -> (usize, f64) {
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

    /// CPU seconds of kernel `k` for the set, the mean of so many passes.
    pub(crate) fn seconds(&self, k: usize, set: &Set, passes: u32) -> f64 {
        timed(|| (0..passes).map(|_| self.run(k, set).0).sum::<usize>()).1 / f64::from(passes)
    }

    /// Compares the answers of the kernels with those of the first; how often each has to trace a set so that a
    /// measurement takes about `seconds`, which averages over what else the machine does.
    pub(crate) fn passes(&self, sets: &[Set], seconds: f64) -> Vec<[u32; 3]> {
        let of = |set: &Set| {
            let mut passes = [1; 3];
            let answers = [0, 1, 2].map(|k| {
                let start = Instant::now();
                let answer = self.run(k, set);
                passes[k] = (seconds / start.elapsed().as_secs_f64()).ceil().clamp(1.0, 100.0) as u32;
                answer
            });
            let (hits, sum) = answers[0];
            for (k, a) in answers.iter().enumerate().skip(1) {
                // CwBvh drops some hits of its quantised boxes
                let few = [0.0, 1e-3, 1e-2][k];
                let close =
                    hits.abs_diff(a.0) as f64 <= few * hits.max(1000) as f64 && (sum - a.1).abs() <= 2.0 * few * sum;
                assert!(close, "{}: {} says {a:?}, {} says {:?}", set.name, NAMES[k], NAMES[0], answers[0]);
            }
            passes
        };
        sets.iter().map(of).collect()
    }
}

/// How obvhs computes: glam's types live in a module named after their implementation.
pub(crate) fn vectors() -> &'static str {
    if std::any::type_name::<glam::BVec3A>().contains("scalar") { "with scalar vectors" } else { "with SIMD vectors" }
}

/// Seconds of this thread.
fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let clock = Clock::start();
    let out = black_box(f());
    (out, clock.seconds())
}

/// Median and quartile spread over the median.
pub(crate) fn median(mut v: Vec<f64>) -> (f64, f64) {
    v.sort_by(f64::total_cmp);
    let at = |q: f64| v[((v.len() - 1) as f64 * q).round() as usize];
    (at(0.5), (at(0.75) - at(0.25)) / at(0.5))
}
