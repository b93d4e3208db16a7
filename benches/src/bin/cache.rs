//! Nanoseconds of the statistics cache: look-ups of eight vertices on a tree of some 2000 leaves, and logging.
//!
//! `cargo run --release --bin cache`. Vertices lie near a surface; *coherent* packets take eight neighbours of it, as
//! siblings of one vertex are, *scattered* ones any eight. Fastest of many rounds:
//! other programs only add to it.

use croupier::learn::cache::{Cache, Training, VertexKind, VertexKind8};
use croupier::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::cache::{BOUNDS, Blocks, iterate, vertex};
use croupier_tests::stats::SplitMix;
use std::hint::black_box;
use std::time::Instant;

const PACKETS: usize = 20_000;
const ROUNDS: usize = 60;

struct Packet {
    p: Vec3x8,
    d: Vec3x8,
    jitter: [F32x8; 3],
    kind: VertexKind8,
}

fn packets(coherent: bool, rng: &mut SplitMix) -> Vec<Packet> {
    (0..PACKETS)
        .map(|_| {
            let first = vertex(rng);
            let v: [_; 8] = std::array::from_fn(|_| if coherent { first } else { vertex(rng) });
            Packet {
                p: Vec3x8::from_fn(|i| v[i].0.map(|x| x + 0.002 * rng.f32())),
                d: Vec3x8::from_fn(|i| v[i].1),
                jitter: [(); 3].map(|()| F32x8::from_fn(|_| rng.f32())),
                kind: VertexKind8::splat(VertexKind::ALL[rng.bits() as usize % VertexKind::ALL.len()]),
            }
        })
        .collect()
}

/// Computes `x` and forgets it.
fn ignore<T>(x: T) {
    black_box(x);
}

/// Least nanoseconds per call of `f`, which makes `calls`.
fn time(calls: usize, mut f: impl FnMut()) -> f64 {
    let rounds = (0..ROUNDS).map(|_| {
        let start = Instant::now();
        f();
        start.elapsed().as_secs_f64() * 1e9 / calls as f64
    });
    rounds.fold(f64::INFINITY, f64::min)
}

fn look_ups(name: &str, cache: &Cache<'_>, packets: &[Packet]) {
    let all = Mask8::all_lanes();
    let local = |bin: U32x8| {
        let l = cache.local(bin, all);
        l.mean.x + l.moment.y + l.variance.z + l.cost + l.count
    };
    let plain = |k: &Packet| cache.find(k.kind, k.p, k.d, all);
    let moved = |k: &Packet| cache.find_jittered(k.kind, k.p, k.d, k.jitter, all);
    let find = time(PACKETS, || packets.iter().for_each(|k| ignore(plain(k))));
    let both = time(PACKETS, || packets.iter().for_each(|k| ignore(local(plain(k)))));
    let find_moved = time(PACKETS, || packets.iter().for_each(|k| ignore(moved(k))));
    let both_moved = time(PACKETS, || packets.iter().for_each(|k| ignore(local(moved(k)))));
    println!(
        "{name:<10} find {find:6.1}  find+local {both:6.1}  jittered: find {find_moved:6.1}  find+local {both_moved:6.1}"
    );
}

fn log(cache: &Cache<'_>, t: &mut Training<'_>, packets: &[Packet]) {
    let bins: Vec<_> = packets.iter().map(|k| cache.find(k.kind, k.p, k.d, Mask8::all_lanes()).to_array()).collect();
    let x = packets.iter().map(|k| k.jitter.map(|j| j.lane(0)));
    let samples: Vec<_> = bins.iter().zip(x).collect();
    t.clear(cache.bins());
    assert!(samples.iter().all(|(bins, x)| bins.iter().all(|b| t.log(*b, *x, 2.0))), "a sample was refused");
    let ns = time(8 * PACKETS, || {
        t.clear(cache.bins());
        for (bins, x) in &samples {
            bins.iter().for_each(|b| ignore(t.log(*b, *x, 2.0)));
        }
    });
    let pair = time(8 * PACKETS, || {
        t.clear(cache.bins());
        for (bins, x) in &samples {
            bins.iter().for_each(|b| ignore(t.log_pair(*b, *x)));
        }
    });
    let clear = time(1, || t.clear(cache.bins()));
    println!("log {ns:.1}, log_pair {pair:.1} a sample; clear {:.0} us", clear * 1e-3);
}

fn main() {
    let (mut blocks, mut rng) = (Blocks::leaves(2000, 1), SplitMix(1));
    let (mut cache, mut shards) = blocks.carve(BOUNDS[0], BOUNDS[1]);
    (0..6).for_each(|_| iterate(&mut cache, &mut shards, 100_000, 420.0, &mut rng));
    println!("{} leaves, {} nodes; nanoseconds per eight vertices", cache.leaves(), cache.nodes());
    for (name, coherent) in [("coherent", true), ("scattered", false)] {
        look_ups(name, &cache, &packets(coherent, &mut rng));
    }
    if let Some(t) = shards.first_mut() {
        log(&cache, t, &packets(false, &mut rng));
    }
    let absorb = time(1, || shards.iter().for_each(|t| cache.absorb(t)));
    let freeze = time(1, || cache.freeze(f64::INFINITY));
    println!("absorb {:.0} us, freeze {:.0} us", absorb * 1e-3, freeze * 1e-3);
}
