//! Roulette, the cache of statistics, and the ledger of unfinished samples.

use super::{Kernels, Outcome, PACKETS, close, each, expect, leak};
use croupier::Strategy;
use croupier::unstable::learn::cache::{Cache, Training};
use croupier::unstable::ledger::{Ledger, NO_RECORD};
use croupier::unstable::rng::Key8;
use croupier::unstable::rrs::{Learned8, MAX_FACTOR, MIN_FACTOR, Vertices8, comb};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_host::blob::AlignedBytes;
use croupier_tests::cache::{BOUNDS, Blocks, Oracle, any_kind, iterate, kind, saved, vertex};
use croupier_tests::stats::SplitMix;
use std::hint::black_box;

pub(super) fn add(k: &mut Kernels) -> Outcome {
    each([roulette, random, cache, ledger], |add| add(k))
}

fn roulette(k: &mut Kernels) -> Outcome {
    let mut rng = SplitMix(13);
    let draws: Vec<(F32x8, u32)> =
        (0..PACKETS).map(|_| (F32x8::from_fn(|_| rng.range(0.05, 6.0) as f32), rng.word())).collect();
    for (s, u) in &draws {
        let mut before = u64::from(*u);
        for (i, n) in comb(*s, *u).into_iter().enumerate() {
            // factors are whole numbers of 2^-32 here
            let after = before + (f64::from(s.lane(i)) * 2f64.powi(32)) as u64;
            let want = (after >> 32) - (before >> 32);
            expect(u64::from(n) == want, format_args!("comb: {n} samples, expected {want}"))?;
            before = after;
        }
    }
    k.packets(("roulette", "comb"), 8.0, draws, |(s, u)| comb(*s, *u));
    for (name, _) in Strategy::TABLE {
        let text = if *name == "fixed" { "fixed:2.5" } else { name };
        let strategy = Strategy::parse(text).map_err(|e| e.to_string())?;
        let vertices: Vec<Vertices8> = (0..PACKETS).map(|_| vertices(&mut rng)).collect();
        for v in &vertices {
            let s = strategy.factor(v);
            for i in 0..8 {
                let (s, product) = (s.lane(i), (v.beta * v.albedo).max_component().lane(i));
                let range = if strategy.is_biased() { 0.0..=1.0 } else { MIN_FACTOR..=MAX_FACTOR };
                expect(range.contains(&s), format_args!("{name}: a factor of {s}"))?;
                match *name {
                    "none" => expect(s == 1.0, format_args!("{name}: {s}"))?,
                    "fixed" => expect(s == 2.5, format_args!("{name}: {s}"))?,
                    "classic" => {
                        let want = f64::from(product.clamp(MIN_FACTOR, 1.0));
                        let want = if v.depth.lane(i) > 4 { want } else { 1.0 };
                        close(format_args!("{name}, depth {}", v.depth.lane(i)), f64::from(s), want, 1e-6)?;
                    }
                    _ => (),
                }
            }
        }
        k.packets(("roulette factor", name), 8.0, vertices, move |v| strategy.factor(v));
    }
    Ok(())
}

fn vertices(rng: &mut SplitMix) -> Vertices8 {
    let color = |rng: &mut SplitMix| Vec3x8::from_fn(|_| [(); 3].map(|()| rng.range(0.01, 0.9) as f32));
    Vertices8 {
        beta: color(rng),
        last_weight: color(rng),
        albedo: color(rng),
        albedo_product: F32x8::from_fn(|_| rng.range(0.01, 0.9) as f32),
        depth: U32x8::from_fn(|_| 1 + rng.word() % 12),
        shininess: F32x8::from_fn(|_| rng.range(0.0, 100.0) as f32),
        learned: Learned8::NONE,
    }
}

/// Random numbers of a vertex.
fn random(k: &mut Kernels) -> Outcome {
    let keys: Vec<Key8> =
        (0..PACKETS as u32).map(|n| Key8::camera(1, U32x8::splat(n), U32x8::from_fn(|i| i as u32))).collect();
    let child = |key: &Key8| key.child(U32x8::splat(1));
    let mut all = std::collections::HashSet::new();
    for key in &keys {
        expect(all.insert(format!("{:?}", child(key))), "two keys alike")?;
    }
    k.packets(("random", "key of a child"), 8.0, keys, child);
    Ok(())
}

fn cache(k: &mut Kernels) -> Outcome {
    let mut rng = SplitMix(14);
    let blocks = Box::leak(Box::new(Blocks::leaves(400, 1)));
    let (mut cache, mut shards) = blocks.carve(BOUNDS[0], BOUNDS[1]);
    // learning until the trees have grown
    for _ in 0..3 {
        iterate(&mut cache, &mut shards, 4000, 100.0, &mut rng);
    }
    expect(cache.leaves() > 100, format_args!("the cache has {} leaves only", cache.leaves()))?;
    let oracle = Oracle::new(&saved(&cache));
    let cache: &'static Cache<'static> = leak(cache);
    let places: Vec<_> = (0..PACKETS)
        .map(|_| {
            let vertices: [_; 8] = std::array::from_fn(|_| vertex(&mut rng));
            let number = any_kind(&mut rng);
            (number, Vec3x8::from_fn(|i| vertices[i].0), Vec3x8::from_fn(|i| vertices[i].1))
        })
        .collect();
    let find = |(number, p, d): &(u32, Vec3x8, Vec3x8)| cache.find(kind(*number), *p, *d, Mask8::all_lanes());
    let mut leaf_of = std::collections::HashMap::new();
    for place in &places {
        let bins = find(place);
        for i in 0..8 {
            let p = oracle.clamp(place.1.lane(i).map(f64::from));
            if !oracle.ambiguous(p) {
                let leaf = oracle.cell(place.0, p).leaf;
                // 16 directions in each leaf
                let known = *leaf_of.entry(bins.lane(i) / 16).or_insert(leaf);
                expect(known == leaf, format_args!("cache: bin {} is of two leaves", bins.lane(i)))?;
            }
        }
    }
    let bins: Vec<U32x8> = places.iter().map(find).collect();
    for bin in &bins {
        let local = cache.local(*bin, Mask8::all_lanes());
        for i in 0..8 {
            let sums = oracle_sums(&oracle, bin.lane(i), &leaf_of);
            if let Some(want) = sums {
                close("samples of a bin", f64::from(local.count.lane(i)), want, 1.0 / 64.0)?;
            }
        }
    }
    k.packets(("cache", "find"), 8.0, places, find);
    k.packets(("cache", "local statistics"), 8.0, bins.clone(), |bin| cache.local(*bin, Mask8::all_lanes()));
    log(k, bins, shards.remove(0))
}

/// Samples that the oracle counts in a bin.
fn oracle_sums(oracle: &Oracle, bin: u32, leaf_of: &std::collections::HashMap<u32, usize>) -> Option<f64> {
    leaf_of.get(&(bin / 16)).map(|leaf| oracle.leaves[*leaf][bin as usize % 16][0])
}

/// Samples logged: a sample, its difference from the one before, its shadow ray, per lane.
fn log(k: &mut Kernels, bins: Vec<U32x8>, mut training: Training<'static>) -> Outcome {
    let used = bins.iter().flat_map(|b| b.to_array()).max().unwrap_or(0) + 1;
    training.clear(used);
    for bin in bins.iter().flat_map(|b| b.to_array()) {
        let logged =
            training.log(bin, [0.5; 3], 2.0) & training.log_pair(bin, [0.1; 3]) & training.log_shadow(bin, true);
        expect(logged, format_args!("bin {bin} takes no samples"))?;
    }
    let units = bins.len();
    k.whole(("cache", "log of sample, pair, shadow ray"), ("8 lanes", units), move || {
        // sums have a limit, behind which nothing is logged
        training.clear(used);
        for bin in black_box(&bins) {
            for bin in bin.to_array() {
                black_box(training.log(bin, [0.5; 3], 2.0));
                black_box(training.log_pair(bin, [0.1; 3]));
                black_box(training.log_shadow(bin, true));
            }
        }
    });
    Ok(())
}

/// Two samples of a vertex, both of which meet light: opened, accumulated, closed.
fn ledger(k: &mut Kernels) -> Outcome {
    const CAPACITY: usize = 256;
    let size = Ledger::layout(CAPACITY).ok_or("no layout of a ledger")?.size;
    let block = Box::leak(Box::new(AlignedBytes::zeroed(size)));
    let mut ledger = Ledger::new(CAPACITY, block.as_mut()).map_err(|e| e.to_string())?;
    fn two_samples(ledger: &mut Ledger<'_>, mut log: impl FnMut(&croupier::unstable::ledger::Finished)) {
        let camera = ledger.open(NO_RECORD, false);
        ledger.arrive(camera, 7, [2.0, 3.0, 4.0], [0.5; 3]);
        ledger.draw(camera, 2, true);
        for n in 0..2u8 {
            let sample = ledger.open(camera, true);
            ledger.charge(sample, 1.5);
            ledger.accumulate(sample, [1.0 + f32::from(n), 1.0, 0.0]);
            ledger.close(sample, |f| log(&f));
        }
    }
    let mut finished = vec![];
    two_samples(&mut ledger, |f| finished.push(*f));
    expect(finished.len() == 2, format_args!("ledger: {} of 2 samples are finished", finished.len()))?;
    for (f, want) in finished.iter().zip([[2.0, 3.0, 0.0], [4.0, 3.0, 0.0]]) {
        expect((f.bin, f.value, f.cost) == (7, want, 1.5), format_args!("ledger: {f:?}, expected {want:?}"))?;
    }
    // half the squared difference
    expect(finished[1].pair == Some([2.0, 0.0, 0.0]), format_args!("ledger: {:?}", finished[1].pair))?;
    k.whole(("ledger", "a vertex of two samples, opened and closed"), ("vertex", PACKETS), move || {
        for _ in 0..PACKETS {
            // what statistics take of it; path guiding takes more
            two_samples(&mut ledger, |f| {
                black_box((f.bin, f.value, f.cost, f.pair));
            });
        }
    });
    Ok(())
}
