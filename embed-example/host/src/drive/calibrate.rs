//! Seconds of a look-up in the learned statistics and of recording a sample, measured on the statistics of a finished
//! render.

use crate::blob::AlignedBytes;
use croupier::Scene;
use croupier::unstable::learn::cache::{Cache, Training, VertexKind, VertexKind8};
use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};
use std::hint::black_box;
use std::time::Instant;

/// Packets of eight per round.
const PACKETS: usize = 1 << 12;
/// Rounds, of which the fastest counts: other work of the machine slows the others down.
const ROUNDS: usize = 5;

/// Seconds that one operation takes one thread. Measured in a loop of nothing else: in a render, where rays compete for
/// the processor's caches, it takes rather more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Calibration {
    /// Look-up of the statistics of a packet of eight vertices.
    pub look_up: f64,
    /// Recording of one finished sample: adding it to its bin, without its bookkeeping in the ledger before.
    pub log: f64,
}

/// Measurement at random points of the scene's triangles with their normals. `None` if there is no memory for it.
pub(super) fn calibrate(cache: &Cache<'_>, scene: &Scene<'_>) -> Option<Calibration> {
    let mut random = Random(scene.hash | 1);
    let vertices: Vec<_> = (0..PACKETS).map(|_| Packet::new(scene, &mut random)).collect();
    let all = Mask8::first(8);
    let diffuse = VertexKind8::splat(VertexKind::Diffuse);
    let bin = |i: usize| cache.find_jittered(diffuse, vertices[i].p, vertices[i].n, vertices[i].jitter, all);
    let look_up = seconds_of(|| {
        for i in 0..PACKETS {
            black_box(cache.local(bin(i), all));
        }
    });
    let mut block = AlignedBytes::zeroed(Training::layout(cache.size())?.size);
    let mut training = Training::new(cache.size(), block.as_mut()).ok()?;
    training.clear(cache.bins());
    let bins: Vec<_> = (0..PACKETS).flat_map(|i| bin(i).to_array()).collect();
    let log = seconds_of(|| {
        for b in &bins {
            black_box(training.log(*b, black_box([0.5, 0.25, 0.125]), 3.0));
        }
    });
    Some(Calibration { look_up: look_up / PACKETS as f64, log: log / bins.len() as f64 })
}

fn seconds_of(mut work: impl FnMut()) -> f64 {
    let rounds = (0..ROUNDS).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    });
    rounds.fold(f64::INFINITY, f64::min)
}

/// Eight vertices on surfaces.
struct Packet {
    p: Vec3x8,
    n: Vec3x8,
    jitter: [F32x8; 3],
}

impl Packet {
    fn new(scene: &Scene<'_>, random: &mut Random) -> Self {
        let on_triangles = [(); 8].map(|()| random.on_triangle(scene));
        let jitter = [(); 3].map(|()| F32x8::from_fn(|_| random.uniform()));
        Self {
            p: Vec3x8::from_fn(|i| on_triangles[i].0.to_array()),
            n: Vec3x8::from_fn(|i| on_triangles[i].1.to_array()),
            jitter,
        }
    }
}

/// Splitmix64.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, n: u32) -> u32 {
        (self.bits() % u64::from(n.max(1))) as u32
    }

    fn uniform(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// A place on a random triangle, each equally likely, and its normal.
    fn on_triangle(&mut self, scene: &Scene<'_>) -> (glam::Vec3, glam::Vec3) {
        let Some(t) = scene.triangles.get(self.below(scene.triangles.len() as u32) as usize) else {
            return (glam::Vec3::from(scene.info.bounds_min), glam::Vec3::Z);
        };
        let [a, b, c] = t.vertex.map(|v| glam::Vec3::from(scene.vertices[v as usize].p));
        let (mut u, mut v) = (self.uniform(), self.uniform());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        (a + (b - a) * u + (c - a) * v, (b - a).cross(c - a).normalize_or(glam::Vec3::Z))
    }
}
