//! Times of the statistics cache: look-ups of eight vertices on a tree of some 2000 leaves, and logging.
//!
//! Vertices lie near a surface; *coherent* packets take eight neighbours of it, as siblings of one vertex are,
//! *scattered* ones any eight. Fastest of many rounds: other programs only add to it. `--write` puts the tables into
//! `benches/results/cache.md`.

use clap::Parser;
use croupier::unstable::learn::cache::{Cache, Training, VertexKind, VertexKind8};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_benches::results::{Results, Table};
use croupier_tests::cache::{BOUNDS, Blocks, iterate, vertex};
use croupier_tests::stats::SplitMix;
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

#[derive(Parser)]
#[command(about = "Times of the statistics cache")]
struct Args {
    /// Write benches/results/cache.md.
    #[arg(long)]
    write: bool,
}

const NAME: &str = "cache";
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

/// Nanoseconds per packet: finding the bins, and also reading them; without jitter and with it.
fn look_ups(cache: &Cache<'_>, packets: &[Packet]) -> [f64; 4] {
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
    [find, both, find_moved, both_moved]
}

/// Nanoseconds per sample of logging alone and in pairs, and per clearing.
fn log(cache: &Cache<'_>, t: &mut Training<'_>, packets: &[Packet]) -> [f64; 3] {
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
    [ns, pair, time(1, || t.clear(cache.bins()))]
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let mut results = Results::of_this_run(NAME);
    let (mut blocks, mut rng) = (Blocks::leaves(2000, 1), SplitMix(1));
    let (mut cache, mut shards) = blocks.carve(BOUNDS[0], BOUNDS[1]);
    (0..6).for_each(|_| iterate(&mut cache, &mut shards, 100_000, 420.0, &mut rng));
    results.header.push(("tree".into(), format!("{} leaves, {} nodes", cache.leaves(), cache.nodes())));

    let columns = "packets, find, find and read, find with jitter, find with jitter and read";
    let mut table = Table::new("Nanoseconds per look-up of eight vertices", columns);
    for (name, coherent) in [("coherent", true), ("scattered", false)] {
        let times = look_ups(&cache, &packets(coherent, &mut rng));
        table.add([name.to_string()].into_iter().chain(times.map(|t| format!("{t:.1}"))));
    }
    results.tables.push(table);

    let mut table = Table::new("Other operations", "operation, time, unit");
    if let Some(t) = shards.first_mut() {
        let [single, pair, clear] = log(&cache, t, &packets(false, &mut rng));
        table.add(["log a sample".into(), format!("{single:.1}"), "ns".into()]);
        table.add(["log a sample of a pair".into(), format!("{pair:.1}"), "ns".into()]);
        table.add(["clear a shard's statistics".into(), format!("{:.0}", clear * 1e-3), "us".into()]);
    }
    let absorb = time(1, || shards.iter().for_each(|t| cache.absorb(t)));
    let freeze = time(1, || cache.freeze(f64::INFINITY));
    table.add(["absorb the shards' statistics".into(), format!("{:.0}", absorb * 1e-3), "us".into()]);
    table.add(["freeze".into(), format!("{:.0}", freeze * 1e-3), "us".into()]);
    results.tables.push(table);

    results.tables.iter().for_each(|t| println!("{t}"));
    if args.write {
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(())
}
