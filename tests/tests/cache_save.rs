//! The statistics cache as bytes: round trips, merging, damaged bytes.

use croupier::unstable::learn::Objective;
use croupier::unstable::learn::cache::CacheError;
use croupier_tests::cache::*;
use croupier_tests::stats::SplitMix;

const LO: [f32; 3] = BOUNDS[0];
const HI: [f32; 3] = BOUNDS[1];

/// Bytes of a cache of some `leaves` that has learned from four iterations with a seed.
fn learned(leaves: usize, seed: u64, split: f64) -> Vec<u8> {
    let (mut blocks, mut rng) = (Blocks::leaves(leaves, 1), SplitMix(seed));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    (0..4).for_each(|_| iterate(&mut cache, &mut shards, 10_000, split, &mut rng));
    saved(&cache)
}

/// Killed by: leaves saved in the order of their numbers, a field left out, sums of the old cache kept, look-ups not
/// recomputed.
#[test]
fn a_saved_cache_comes_back_bit_for_bit() {
    let (mut blocks, mut rng) = (Blocks::leaves(300, 1), SplitMix(1));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    (0..4).for_each(|_| iterate(&mut cache, &mut shards, 10_000, 200.0, &mut rng));
    let bytes = saved(&cache);
    assert!(cache.leaves() > 100 && bytes.len() == cache.saved_len());
    let mut other_blocks = Blocks::leaves(400, 1);
    let (mut other, mut other_shards) = other_blocks.carve(LO, HI);
    iterate(&mut other, &mut other_shards, 30_000, 70.0, &mut rng);
    other.load(&bytes).unwrap();
    assert_eq!(saved(&other), bytes);
    for _ in 0..10_000 {
        let (p, d) = vertex(&mut rng);
        let [a, b] = [&cache, &other].map(|c| {
            let bin = croupier::unstable::simd::U32x8::splat(find(c, 0, p, d));
            let l = c.local(bin, croupier::unstable::simd::Mask8::first(1));
            let others = [l.cost.lane(0), l.count.lane(0), c.visibility_root(bin).lane(0)];
            ([l.mean.lane(0), l.moment.lane(0), l.variance.lane(0), others], l.nee_share.lane(0))
        });
        assert_eq!(a, b);
    }
    let mut short = vec![0; bytes.len() - 1];
    let length = CacheError::Length { needed: bytes.len(), given: bytes.len() - 1 };
    assert_eq!(cache.save(&mut short), Err(length));
    assert_eq!(other.load(&bytes[..bytes.len() - 1]), Err(length));
}

/// Sums of multiples of 2^-10 are exact, so two streams in one cache and two caches merged have the same bits. Killed
/// by: a leaf merged twice or into its neighbour, merging that discounts.
#[test]
fn merging_is_logging_both() {
    let logged = |seeds: &[u64]| {
        let mut blocks = Blocks::leaves(300, 2);
        let (mut cache, mut shards) = blocks.carve(LO, HI);
        // the tree first, from samples that are all of one value, then forgotten
        iterate(&mut cache, &mut shards, 10_000, 200.0, &mut SplitMix(5));
        cache.begin_merge(0.0);
        for seed in seeds {
            iterate(&mut cache, &mut shards, 3000, f64::INFINITY, &mut SplitMix(*seed));
        }
        saved(&cache)
    };
    let (a, b, both) = (logged(&[6]), logged(&[7]), logged(&[6, 7]));
    // room for as many leaves beside one shard as there is beside two
    let mut blocks = Blocks::leaves(310, 1);
    let (mut cache, _) = blocks.carve(LO, HI);
    cache.load(&a).unwrap();
    cache.merge(&b).unwrap();
    assert!(cache.leaves() > 100);
    assert_eq!(saved(&cache), both);
}

/// Trees that differ: the result is as fine as either, loses nothing, and does not depend on which came first. In a
/// small arena it takes what fits. Killed by: a share of a quarter, growth forgotten, coarse sums given to one child.
#[test]
fn merging_trees_that_differ() {
    let (fine, coarse) = (learned(300, 2, 200.0), learned(300, 3, 5000.0));
    let merge = |leaves: usize, files: [&[u8]; 2]| {
        let mut blocks = Blocks::leaves(leaves, 1);
        let (mut cache, _) = blocks.carve(LO, HI);
        files.iter().for_each(|f| cache.merge(f).unwrap());
        locals(&cache).for_each(|l| assert_sane(&l));
        (saved(&cache), cache.subdivisions_refused())
    };
    let (bytes, refused) = merge(600, [&fine, &coarse]);
    assert_eq!(merge(600, [&coarse, &fine]).0, bytes);
    let [o, f, c] = [&bytes, &fine, &coarse].map(|b| Oracle::new(b));
    assert!(refused == 0 && o.leaves.len() == f.leaves.len() && c.leaves.len() < f.leaves.len() / 2);
    let (small, refused) = merge(30, [&fine, &coarse]);
    let s = Oracle::new(&small);
    assert!(refused > 0 && s.leaves.len() >= 23 && s.leaves.len() < 50);
    for field in 0..14 {
        let sum = f.total(field) + c.total(field);
        assert!((o.total(field) - sum).abs() <= 1e-12 * sum && (s.total(field) - sum).abs() <= 1e-12 * sum);
    }
    // Loading never prunes.
    let mut blocks = Blocks::leaves(30, 1);
    let (mut cache, _) = blocks.carve(LO, HI);
    let room = cache.size().leaves();
    let before = saved(&cache);
    assert_eq!(cache.load(&fine), Err(CacheError::Full { needed: f.leaves.len() as u32, room }));
    assert_eq!(saved(&cache), before);
}

/// Each kind of damage is named, and leaves the cache as it was. Killed by: any of the checks removed.
#[test]
fn damage_is_named() {
    let bytes = learned(60, 4, 2000.0);
    let (mut blocks, sums) = (Blocks::leaves(100, 1), sums_at(&bytes));
    let (mut cache, _) = blocks.carve(LO, HI);
    cache.load(&bytes).unwrap();
    let mut try_load = |edit: &dyn Fn(&mut Vec<u8>), hash: bool| {
        let mut b = bytes.clone();
        edit(&mut b);
        if hash {
            rehash(&mut b);
        }
        let [loaded, merged] = [cache.load(&b).unwrap_err(), cache.merge(&b).unwrap_err()];
        assert!(loaded == merged || format!("{loaded}") == format!("{merged}"));
        assert_eq!(saved(&cache), bytes);
        loaded
    };
    assert!(matches!(try_load(&|b| b[0] = 0, true), CacheError::Magic(_)));
    assert!(matches!(try_load(&|b| b[16] = 9, true), CacheError::Version { found: 9, known: 5 }));
    assert!(matches!(try_load(&|b| b[sums + 3] ^= 1, false), CacheError::Hash { .. }));
    assert!(matches!(try_load(&|b| b.push(0), true), CacheError::Length { .. }));
    assert!(matches!(try_load(&|b| b.truncate(40), false), CacheError::Length { needed: 64, given: 40 }));
    assert!(matches!(try_load(&|b| b.clear(), false), CacheError::Length { needed: 64, given: 0 }));
    assert!(matches!(try_load(&|b| b[24..28].fill(0xff), true), CacheError::Length { .. }));
    assert!(matches!(try_load(&|b| b[32] ^= 1, true), CacheError::Bounds { index: 1, .. }));
    assert!(matches!(try_load(&|b| b[40] ^= 1, true), CacheError::Bounds { index: 3, .. }));
    for (found, said) in [(2, "the objective absolute, need relative"), (0, "an unknown objective, 0, need relative")] {
        let e = try_load(&|b| b[44] = found, true);
        assert_eq!(e, CacheError::Objective { expected: Objective::Relative, found: found.into() });
        assert!(format!("{e}").ends_with(said), "{e}");
    }
    assert!(matches!(try_load(&|b| b[65] = 2, true), CacheError::OctreeNode { index: 1, found: 2, depth: 1 }));
    assert!(matches!(try_load(&|b| b[64] = 0, true), CacheError::Shape { .. }));
    // as many bytes as before, all inner: too deep
    assert!(matches!(
        try_load(&|b| b[64..sums].fill(1), true),
        CacheError::OctreeNode { index: 16, found: 1, depth: 16 }
    ));
    assert!(matches!(try_load(&|b| b[64..sums].fill(0), true), CacheError::Shape { found: [6, 6], .. }));
    for x in [-1.0, f64::NAN, f64::INFINITY, 1e101, -1e-300] {
        let edit =
            |b: &mut Vec<u8>| b[sums + 8 * (16 * FIELDS + FIELDS + 2)..][..8].copy_from_slice(&f64::to_le_bytes(x));
        let e = try_load(&edit, true);
        assert!(matches!(e, CacheError::Sum { leaf: 1, bin: 1, field: 2, found } if found.to_bits() == x.to_bits()));
        assert!(format!("{e}").starts_with("leaf 1 bin 1 field 2 of the saved statistics is "), "{e}");
    }
}

/// 2000 random corruptions, half of them with a hash that fits: an error, or a cache that works. Killed by: a panic
/// anywhere, a cycle, sums that are not checked.
#[test]
fn random_damage_never_panics() {
    let (bytes, mut rng) = (learned(60, 4, 2000.0), SplitMix(10));
    let (mut blocks, sums) = (Blocks::leaves(100, 1), sums_at(&bytes));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    let (mut loaded, mut refused) = (0, 0);
    for turn in 0..2000 {
        let mut b = bytes.clone();
        for _ in 0..1 + rng.bits() % 4 {
            // header and shape are small: aim at them
            let end = [64, sums, b.len()][(rng.bits() % 3) as usize].min(b.len());
            let at = (rng.bits() % end.max(1) as u64) as usize;
            match rng.bits() % 4 {
                0 => b[at] = (rng.bits() % 3) as u8,
                1 => b[at] ^= 1 << (rng.bits() % 8),
                2 => b[at..].iter_mut().take(8).for_each(|x| *x = rng.bits() as u8),
                _ if rng.bits() % 8 == 0 && at > 64 => b.truncate(at),
                _ => b[at] = 0xff,
            }
            if b.is_empty() {
                break;
            }
        }
        if turn % 2 == 0 && b.len() > 16 {
            rehash(&mut b);
        }
        let result = if turn % 3 == 0 { cache.merge(&b) } else { cache.load(&b) };
        if let Err(e) = result {
            refused += 1;
            assert!(!format!("{e}").is_empty());
            continue;
        }
        loaded += 1;
        locals(&cache).for_each(|l| assert_sane(&l));
        if loaded % 10 == 0 {
            iterate(&mut cache, &mut shards, 300, 500.0, &mut rng);
        }
    }
    assert!(loaded > 50 && refused > 1000, "{loaded} loaded, {refused} refused");
}

/// A cache full of random numbers from 0 to 1e100, which no samples explain, still gives finite look-ups, also after
/// subdividing and logging. Killed by: no saturation, a division by a count of 0, a variance below 0.
#[test]
fn a_poisoned_cache_gives_finite_numbers() {
    let (bytes, mut rng) = (learned(60, 4, 2000.0), SplitMix(11));
    let mut blocks = Blocks::leaves(100, 1);
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    for _ in 0..200 {
        let mut b = bytes.clone();
        let start = sums_at(&b);
        for x in b[start..].chunks_exact_mut(8) {
            let value = match rng.bits() % 8 {
                0 => 0.0,
                1 => f64::MIN_POSITIVE * rng.f64(),
                2 => 1e100,
                3 => rng.f64(),
                _ => 10f64.powf(rng.range(-300.0, 100.0)),
            };
            x.copy_from_slice(&value.to_le_bytes());
        }
        rehash(&mut b);
        cache.load(&b).unwrap();
        locals(&cache).for_each(|l| assert_sane(&l));
        cache.merge(&b).unwrap();
        iterate(&mut cache, &mut shards, 100, 1e50, &mut rng);
        locals(&cache).for_each(|l| assert_sane(&l));
        for keep in [f64::NAN, -1.0, f64::INFINITY, 1e-300] {
            cache.begin_merge(keep);
            cache.freeze(f64::NEG_INFINITY);
            locals(&cache).for_each(|l| assert_sane(&l));
        }
    }
}
