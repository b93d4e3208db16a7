//! The statistics cache: bins of vertices, sums, growth of the tree, look-ups.

use croupier::unstable::learn::cache::{BIN_LIMIT, Cache, CacheSize, MAX_VALUE, NO_BIN, VertexKind, VertexKind8};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::cache::*;
use croupier_tests::stats::{FAMILY_ALPHA, SplitMix, chi_square, sidak};
use std::collections::{HashMap, HashSet};

const LO: [f32; 3] = BOUNDS[0];
const HI: [f32; 3] = BOUNDS[1];
const ALL: fn() -> Mask8 = Mask8::all_lanes;

/// Every bin stands for one leaf of the oracle and one direction bin, and the other way round; places inside, outside
/// and with numbers that are not finite; inactive lanes. Killed by: axes swapped in the octant, the wrong root, a level
/// left out, no clamping, `NO_BIN` missing.
#[test]
fn find_agrees_with_an_oracle() {
    // too small for a grid, a coarse one, a finer one
    [(400, 300), (2000, 1500), (9000, 1500)].into_iter().for_each(|(room, least)| agrees_with_an_oracle(room, least));
}

fn agrees_with_an_oracle(room: usize, least: u32) {
    let (mut blocks, mut rng) = (Blocks::leaves(room, 2), SplitMix(1));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    (0..5).for_each(|_| iterate(&mut cache, &mut shards, 60_000, 300.0, &mut rng));
    assert!(cache.leaves() >= least, "{}", cache.leaves());
    let oracle = Oracle::new(&saved(&cache));
    assert_eq!(oracle.leaves.len(), cache.leaves() as usize);
    let (mut place_of, mut bin_of, mut leaves) = (HashMap::new(), HashMap::new(), HashSet::new());
    for turn in 0..30_000 {
        let vertices: [_; 8] = std::array::from_fn(|_| {
            let (p, d) = vertex(&mut rng);
            let anywhere = std::array::from_fn(|a| rng.range(LO[a] as f64 - 1.0, HI[a] as f64 + 1.0) as f32);
            (any_kind(&mut rng), if turn % 2 == 0 { p } else { anywhere }, d)
        });
        let active = Mask8::from_bits(rng.bits() as u32);
        let kind = VertexKind8::from_fn(|i| VertexKind::ALL[vertices[i].0 as usize]);
        let bins = cache.find(kind, Vec3x8::from_fn(|i| vertices[i].1), Vec3x8::from_fn(|i| vertices[i].2), active);
        for (i, (kind, p, d)) in vertices.into_iter().enumerate() {
            let (bin, p) = (bins.lane(i), oracle.clamp(p.map(f64::from)));
            if !active.lane(i) {
                assert_eq!(bin, NO_BIN);
                continue;
            }
            let [height, azimuth] = height_and_azimuth(d.map(f64::from));
            let [h, a] = [(height + 1.0) * 2.0, azimuth / std::f64::consts::FRAC_PI_2];
            if oracle.ambiguous(p) || [h, a].iter().any(|x| (x - x.round()).abs() < 1e-5) {
                continue;
            }
            let leaf = oracle.cell(kind, p).leaf;
            let place = (leaf, h as u32, a as u32);
            assert_eq!(*place_of.entry(bin).or_insert(place), place, "bin {bin}");
            assert_eq!(*bin_of.entry(place).or_insert(bin), bin, "{place:?}");
            assert!(bin < cache.bins());
            leaves.insert(leaf);
        }
    }
    assert!(leaves.len() as u32 > cache.leaves() / 2, "{} of {} leaves seen", leaves.len(), cache.leaves());
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    for (p, same) in [([nan, inf, -inf], [-9.0, 9.0, -9.0]), ([f32::MAX, f32::MIN, nan], [9.0, -9.0, -9.0])] {
        assert_eq!(find(&cache, 0, p, [0.0, 0.0, 1.0]), find(&cache, 0, same, [0.0, 0.0, 1.0]));
    }
    assert!(find(&cache, 1, [0.0; 3], [nan; 3]) < cache.bins());
}

/// Vertices alike in all but their kind share no bin, each kind has a tree that grows alone. Killed by: kinds that are
/// masked, two kinds with one octree, roots that are not the first nodes.
#[test]
fn every_kind_has_an_octree_of_its_own() {
    let (mut blocks, mut rng) = (Blocks::leaves(60, 1), SplitMix(14));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    let kinds = VertexKind::ALL.len();
    assert_eq!(cache.leaves() as usize, kinds);
    for (grown, p) in (0..kinds).map(|k| (k, vertex(&mut rng).0)) {
        let bins: Vec<u32> = (0..kinds as u32).map(|k| find(&cache, k, p, [0.0, 0.0, 1.0])).collect();
        assert_eq!(bins.iter().collect::<HashSet<_>>().len(), kinds);
        let t = &mut shards[0];
        t.clear(cache.bins());
        (0..100).for_each(|_| assert!(t.log(bins[grown], [1.0; 3], 1.0)));
        cache.begin_merge(0.0);
        cache.absorb(t);
        cache.freeze(50.0);
        assert_eq!(cache.leaves() as usize, kinds + 7 * (grown + 1), "one leaf of one tree");
    }
}

/// 4e6 uniform directions. Moving a border of a slab by 0.005 of the height (1 % of a bin's area) gives a non-central
/// chi-square of 200, missed with a probability below 1e-7. Killed by: uneven slabs, quadrants about another axis.
#[test]
fn direction_bins_have_equal_area() {
    let (mut blocks, mut rng) = (Blocks::leaves(2, 1), SplitMix(2));
    let (cache, _) = blocks.carve(LO, HI);
    let mut observed = [0u64; 16];
    for _ in 0..500_000 {
        let d = Vec3x8::from_fn(|_| rng.direction().map(|x| x as f32));
        cache.find(kind(0), Vec3x8::ZERO, d, ALL()).to_array().iter().for_each(|b| observed[*b as usize] += 1);
    }
    let p = chi_square(&observed, &[250_000.0; 16], 5.0).p;
    assert!(p > sidak(FAMILY_ALPHA, 1), "p = {p}: {observed:?}");
    // Normals that are parallel to an axis, and those a little off, share a bin with no other axis.
    let axes: Vec<_> = (0..6)
        .map(|k| {
            let axis: [f32; 3] = std::array::from_fn(|a| if a == k / 2 { [1.0, -1.0][k % 2] } else { 0.0 });
            let bin = find(&cache, 0, [0.0; 3], axis);
            for _ in 0..100 {
                let near = axis.map(|x| x + rng.range(-0.05, 0.05) as f32);
                assert_eq!(find(&cache, 0, [0.0; 3], near), bin);
            }
            bin
        })
        .collect();
    assert_eq!(axes.iter().collect::<HashSet<_>>().len(), 6);
}

/// The jittered look-up is that of a position moved by `jitter - 0.5` of the leaf's edge, as the oracle moves it.
/// Killed by: moving by a whole edge, by the edge of another depth, jitter of one axis used for another.
#[test]
fn jitter_stays_within_half_a_leaf() {
    let (mut blocks, mut rng) = (Blocks::leaves(2000, 2), SplitMix(3));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    (0..5).for_each(|_| iterate(&mut cache, &mut shards, 60_000, 300.0, &mut rng));
    let oracle = Oracle::new(&saved(&cache));
    let (mut leaf_of, mut seen, mut moved_away) = (HashMap::new(), 0, 0);
    for _ in 0..100_000 {
        let ((p, d), u) = (vertex(&mut rng), [(); 3].map(|()| rng.f32()));
        let q = p.map(f64::from);
        let own = oracle.cell(1, q);
        let moved = oracle.clamp(std::array::from_fn(|a| q[a] + (f64::from(u[a]) - 0.5) * own.edge));
        if oracle.ambiguous(q) || oracle.ambiguous(moved) {
            continue;
        }
        let [p8, d8] = [p, d].map(|v| Vec3x8::splat(v[0], v[1], v[2]));
        let bin = cache.find_jittered(kind(1), p8, d8, u.map(F32x8::splat), ALL()).lane(2);
        let leaf = oracle.cell(1, moved).leaf;
        assert_eq!(*leaf_of.entry(bin / 16).or_insert(leaf), leaf);
        seen += 1;
        moved_away += u32::from(leaf != own.leaf);
        // half is no movement
        let still = cache.find_jittered(kind(1), p8, d8, [F32x8::splat(0.5); 3], ALL()).lane(2);
        assert_eq!(still, find(&cache, 1, p, d));
    }
    // each axis leaves the cell with probability 1/4
    let share = f64::from(moved_away) / f64::from(seen);
    assert!(seen > 30_000 && (share - 37.0 / 64.0).abs() < 0.02, "{share} of {seen}");
}

/// From the middle of a dark cell to the middle of a bright one: what is looked up, averaged over the jitter, goes up
/// in a straight line from cell to cell, also where one has half the edge of the other; without jitter it jumps by all
/// of the difference at the border. So cells are not visible as blocks. Killed by: no jitter or half of it, an edge
/// that is not that of the position's own cell.
#[test]
fn borders_of_cells_are_not_visible() {
    for (samples, edge) in [(1000, 2.0f32), (4000, 1.0)] {
        let (mut blocks, mut rng) = (Blocks::leaves(60, 1), SplitMix(12));
        let (mut cache, mut shards) = blocks.carve(LO, HI);
        // once, so that the border is halfway along x
        iterate(&mut cache, &mut shards, 4000, 500.0, &mut rng);
        let (border, up) = (LO[0] + 2.0, [0.0, 0.0, 1.0]);
        let t = &mut shards[0];
        t.clear(cache.bins());
        for [x, y, z] in (0..8u32).map(|i| [0, 1, 2].map(|a| (i >> a & 1) as f32)) {
            let bin = find(&cache, 0, [border - 1.0 + 2.0 * x, LO[1] + 1.0 + 2.0 * y, LO[2] + 1.0 + 2.0 * z], up);
            (0..if x > 0.0 { samples } else { 1000 }).for_each(|_| assert!(t.log(bin, [2.0 * x; 3], 1.0)));
        }
        cache.begin_merge(0.0);
        cache.absorb(t);
        // the bright cells are subdivided if they have many samples
        cache.freeze(3000.0);
        let mean = |bins: U32x8| cache.local(bins, ALL()).mean.x.to_array().iter().sum::<f32>() / 8.0;
        let at = |x: f32| Vec3x8::splat(x, LO[1] + 0.7, LO[2] + 1.1);
        let (kind, dir) = (kind(0), Vec3x8::splat(0.0, 0.0, 1.0));
        let mut smooth = |x: f32| {
            let draw = |k: u32| {
                let mut any = || F32x8::from_fn(|_| rng.f32());
                let u = [F32x8::from_fn(|i| (8 * k + i as u32) as f32 / 1024.0 + 0.0005), any(), any()];
                mean(cache.find_jittered(kind, at(x), dir, u, ALL()))
            };
            (0..128).map(draw).sum::<f32>() / 128.0
        };
        let places: Vec<f32> = (-31..=31).map(|k| (k as f32 + 0.5) / 32.0).filter(|x| *x < 0.5 * edge).collect();
        let found: Vec<f32> = places.iter().copied().map(|x| smooth(border + x)).collect();
        for (x, found) in places.iter().zip(&found) {
            // the box around the position has the edge of its own cell
            let own = if *x < 0.0 { 2.0 } else { edge };
            assert!((found - (1.0 + 2.0 * x / own)).abs() < 0.03, "{found} at {x}, edge {edge}");
        }
        let step = |of: &[f32]| of.windows(2).map(|w| w[1] - w[0]).fold(0.0, f32::max);
        let plain: Vec<f32> = places.iter().map(|x| mean(cache.find(kind, at(border + x), dir, ALL()))).collect();
        assert!(step(&found) < 0.05 * 2.0 && step(&plain) > 0.97 * 2.0, "{} and {}", step(&found), step(&plain));
    }
}

/// Sums of several shards and iterations, discounted, against f64. Killed by: a field left out or added to another, a
/// discount applied twice or to the new samples, `clear` that keeps something.
#[test]
fn sums_equal_an_oracle() {
    let (mut blocks, mut rng) = (Blocks::leaves(9, 3), SplitMix(4));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    let mut expected = vec![[0.0f64; FIELDS]; 32];
    for keep in [1.0, 0.5, 0.75] {
        expected.iter_mut().flatten().for_each(|x| *x *= keep);
        for t in &mut shards {
            t.clear(cache.bins());
            for _ in 0..5000 {
                let bin = (rng.bits() % 32) as usize;
                let [x, pair] = [(); 2].map(|()| [(); 3].map(|()| (10.0 * rng.f32()).powi(3)));
                let cost = 20.0 * rng.f32();
                assert!(t.log(bin as u32, x, cost) && t.log_pair(bin as u32, pair));
                assert!(t.log_shadow(bin as u32, x[0] < 3.0));
                t.log_nee(bin as u32, x, 0.25);
                let e = &mut expected[bin];
                e[14] += 0.25 * x.map(|x| f64::from(x) * f64::from(x)).iter().sum::<f64>();
                e[12] += 1.0;
                e[13] += if x[0] < 3.0 { 1.0 } else { 0.0 };
                e[0] += 1.0;
                e[1] += 1.0;
                e[2] += f64::from(cost);
                for c in 0..3 {
                    let x = f64::from(x[c]);
                    e[3 + c] += x;
                    e[6 + c] += x * x;
                    e[9 + c] += f64::from(pair[c]);
                }
            }
        }
        cache.begin_merge(keep);
        shards.iter().for_each(|t| cache.absorb(t));
    }
    let oracle = Oracle::new(&saved(&cache));
    for (found, expected) in oracle.leaves.iter().flatten().zip(&expected) {
        // Some 160 positive terms in a row: each addition and square rounds by 2^-24.
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() <= 250.0 * 2f64.powi(-24) * e, "{f} {e}");
        }
        assert_eq!(found[..2], expected[..2]);
    }
}

/// A bin takes [`BIN_LIMIT`] samples an iteration and no more; 16,384 such iterations, 1.07e9 samples, keep their mean
/// to 1e-12. The f32 sums of one iteration are within 2^-8, their rigorous bound; at 0.1 each they are off by far less.
/// Killed by: f32 session sums, another limit, a limit that looks at values.
#[test]
fn a_billion_samples_keep_their_mean() {
    let mut blocks = Blocks::leaves(2, 1);
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    let t = &mut shards[0];
    t.clear(cache.bins());
    let mut rng = SplitMix(5);
    let mut exact = 0.0;
    for _ in 0..BIN_LIMIT {
        let x = (4.0 * rng.f32()).powi(4);
        exact += f64::from(x);
        assert!(t.log(7, [0.1, x, 1.0], 3.0) && t.log_pair(7, [x; 3]));
    }
    assert!(!t.log(7, [1.0; 3], 1.0) && !t.log_pair(7, [1.0; 3]));
    assert!(t.log(8, [1.0; 3], 1.0) && t.log_pair(8, [1.0; 3]));
    t.log_nee(7, [1.0; 3], 1.0);
    assert!((0..BIN_LIMIT).all(|k| t.log_shadow(7, k % 2 == 0)) && !t.log_shadow(7, true) && t.log_shadow(8, true));
    cache.absorb(t);
    let once = Oracle::new(&saved(&cache)).leaves[0][7];
    assert_eq!(once[12..], [65_535.0, 32_768.0, 0.0], "no light sample of a full bin");
    assert_eq!(once[0], f64::from(BIN_LIMIT));
    assert!((once[3] / (0.1f64 * 65_535.0) - 1.0).abs() < 2f64.powi(-8), "{}", once[3] / 6553.5);
    assert!((once[4] / exact - 1.0).abs() < 1e-4, "{}", once[4] / exact);
    (1..16_384).for_each(|_| cache.absorb(t));
    let all = Oracle::new(&saved(&cache)).leaves[0][7];
    assert_eq!(all[..2], [16_384.0 * 65_535.0; 2]);
    for (a, o) in all.iter().zip(&once).take(14) {
        assert!((a / all[0] / (o / once[0]) - 1.0).abs() < 1e-12, "{a} {o}");
    }
    // What is not finite is not taken, what is too large or negative is cut off.
    t.clear(cache.bins());
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(!t.log(3, [0.0, x, 0.0], 1.0) && !t.log(3, [0.0; 3], x) && !t.log_pair(3, [x, 0.0, 0.0]));
    }
    assert!(!t.log(cache.bins(), [1.0; 3], 1.0) && !t.log(NO_BIN, [1.0; 3], 1.0) && !t.log_pair(NO_BIN, [1.0; 3]));
    for _ in 0..BIN_LIMIT {
        (0..9).for_each(|_| t.log_nee(3, [f32::MAX; 3], f32::MAX));
        assert!(t.log(3, [f32::MAX, -5.0, 2.0], f32::MAX) && t.log_pair(3, [f32::MAX; 3]));
    }
    cache.absorb(t);
    cache.freeze(f64::INFINITY);
    locals(&cache).for_each(|l| assert_sane(&l));
    let l = cache.local(U32x8::splat(3), ALL());
    let ratio = l.mean.lane(0).map(|x| x / MAX_VALUE);
    assert!(ratio[0] > 0.99 && ratio[1] < 1e-3, "{ratio:?}");
}

/// Children hold exactly an eighth of their parent each, down to the level where that is few enough. Killed by: new
/// leaves that start empty, a share of a quarter, subdividing once only.
#[test]
fn children_inherit_their_parents_sums() {
    let (mut blocks, mut rng) = (Blocks::leaves(420, 1), SplitMix(6));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    iterate(&mut cache, &mut shards, 6000, f64::INFINITY, &mut rng);
    assert_eq!((cache.leaves(), cache.nodes()), (6, 6));
    let before = Oracle::new(&saved(&cache));
    let means: Vec<_> = locals(&cache).collect();
    // 1000 a root: 125 a child, 16 a grandchild
    cache.freeze(100.0);
    assert_eq!((cache.leaves(), cache.nodes()), (384, 438));
    assert_eq!(cache.subdivisions_refused(), 0);
    let after = Oracle::new(&saved(&cache));
    for (i, leaf) in after.leaves.iter().enumerate() {
        for (b, p) in leaf.iter().zip(&before.leaves[i / 64]) {
            assert_eq!(*b, p.map(|x| x / 64.0));
        }
    }
    for (k, l) in locals(&cache).enumerate() {
        // the first leaves of each tree keep the numbers of their roots
        let m = &means[k % 8];
        if k < 8 {
            assert!(((l.mean.x - m.mean.x).abs() / m.mean.x).max_lane() < 0.5);
            assert!(((l.count - m.count / 64.0).abs()).max_lane() <= 8.01);
        }
        assert_sane(&l);
    }
}

/// Killed by: writing beyond the leaves, counting nothing, subdividing in the order of numbers instead of size.
#[test]
fn a_full_arena_refuses_and_counts() {
    let (mut blocks, mut rng) = (Blocks::leaves(60, 1), SplitMix(7));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    for _ in 0..4 {
        iterate(&mut cache, &mut shards, 40_000, 50.0, &mut rng);
    }
    let room = cache.size().leaves();
    assert!(room > 50 && cache.subdivisions_refused() > 0, "{room}");
    assert_eq!(cache.leaves(), room);
    let oracle = Oracle::new(&saved(&cache));
    assert_eq!((oracle.total(0), oracle.total(1)), (160_000.0, 160_000.0));
    let counts = oracle.leaves.iter().map(|l| l.iter().map(|b| b[0]).sum::<f64>());
    // Both trees got half of the samples, so no leaf keeps those of a whole root.
    assert!(counts.fold(0.0, f64::max) < 40_000.0);
    locals(&cache).for_each(|l| assert_sane(&l));
    let refused = cache.subdivisions_refused();
    cache.freeze(f64::INFINITY);
    cache.freeze(f64::NAN);
    assert_eq!(cache.subdivisions_refused(), refused);
}

/// A cell without bright samples is shrunk towards its surroundings, which have some; the more samples it has, the
/// less. Killed by: shrinking towards the leaf only.
#[test]
fn cells_shrink_towards_their_surroundings() {
    let (mut blocks, mut rng) = (Blocks::leaves(60, 1), SplitMix(11));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    iterate(&mut cache, &mut shards, 4000, 500.0, &mut rng);
    let corner = |p: [f32; 3]| find(&cache, 0, p, [0.0, 0.0, 1.0]);
    let (dark, bright) = (corner(LO), corner(HI));
    assert_ne!(dark, bright);
    let mut moments = Vec::new();
    for samples in [100, 10_000] {
        cache.begin_merge(0.0);
        let t = &mut shards[0];
        t.clear(cache.bins());
        for _ in 0..samples {
            t.log(dark, [0.0; 3], 1.0);
            t.log(bright, [10.0; 3], 1.0);
        }
        cache.absorb(t);
        cache.freeze(f64::INFINITY);
        moments.push(cache.local(U32x8::splat(dark), ALL()).moment.lane(0)[0]);
    }
    assert!(moments[0] > 0.0 && moments[1] > 0.0 && moments[1] < 0.01 * moments[0], "{moments:?}");
}

/// Square roots of visibilities against f64: directions with shadow rays, directions without that are shrunk towards
/// their leaf, a cell that is shrunk towards its surroundings, nothing known; shadow rays go to the leaf of their
/// vertex and to the bin of their own direction. Killed by: rounding down, a share instead of its root, the vertex's
/// bin, shrinking by all samples of a bin instead of its shadow rays, no memory of earlier iterations.
#[test]
fn visibilities_equal_an_oracle() {
    let (mut blocks, mut rng) = (Blocks::leaves(60, 1), SplitMix(13));
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    iterate(&mut cache, &mut shards, 4000, 500.0, &mut rng);
    cache.begin_merge(0.0);
    cache.freeze(f64::INFINITY);
    let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
    let roots = |cache: &Cache<'_>, p: [f32; 3], dir: [f32; 3]| {
        let towards = Vec3x8::splat(dir[0], dir[1], dir[2]);
        // whatever the vertex's own direction
        let bins = [up, down, [1.0, 0.0, 0.0]].map(|own| {
            let bin = U32x8::splat(find(cache, 0, p, own));
            assert_eq!(cache.bins_towards(bin, towards, Mask8::first(3)).to_array()[3..], [NO_BIN; 5]);
            cache.bins_towards(bin, towards, ALL())
        });
        assert!(bins.iter().all(|b| b.to_array() == bins[0].to_array()));
        cache.visibility_root(bins[0]).lane(7)
    };
    assert_eq!(roots(&cache, LO, up), 1.0);
    let mut log = |cache: &mut Cache<'_>, rays: u32, visible: u32| {
        let bin = U32x8::splat(find(cache, 0, LO, [1.0, 0.0, 0.0]));
        let bin = cache.bins_towards(bin, Vec3x8::splat(0.0, 0.0, 1.0), ALL()).lane(0);
        let t = &mut shards[0];
        t.clear(cache.bins());
        assert!((0..rays).all(|k| t.log_shadow(bin, k < visible)));
        assert!([cache.bins(), NO_BIN].into_iter().all(|none| !t.log_shadow(none, true)));
        cache.begin_merge(0.5);
        cache.absorb(t);
        cache.freeze(f64::INFINITY);
    };
    let rounded = |visible: f64, rays: f64| ((visible / rays).sqrt() * 255.0).ceil() / 255.0;
    let is = |found: f32, expected: f64| assert!((f64::from(found) - expected).abs() < 1e-6, "{found} for {expected}");
    // 4 samples of the surroundings, whose share is the same; then twice: of the leaf, and of the bin
    log(&mut cache, 400, 37);
    is(roots(&cache, LO, up), rounded(37.0, 400.0));
    is(roots(&cache, LO, down), rounded(37.0, 400.0));
    is(roots(&cache, HI, up), rounded(37.0, 400.0));
    // half of the old ones count
    log(&mut cache, 400, 0);
    is(roots(&cache, LO, up), rounded(18.5, 600.0));
    // none is known of other kinds
    let other = U32x8::splat(find(&cache, 1, LO, up));
    assert_eq!(cache.visibility_root(cache.bins_towards(other, Vec3x8::splat(0.0, 0.0, 1.0), ALL())).lane(0), 1.0);
    for none in [cache.bins(), NO_BIN] {
        assert_eq!(cache.visibility_root(U32x8::splat(none)).lane(0), 1.0);
    }
    // a second position: its share and that of the surroundings differ
    let bin = find(&cache, 0, HI, up);
    let t = &mut shards[0];
    t.clear(cache.bins());
    assert!((0..100).all(|_| t.log_shadow(bin, true)));
    cache.begin_merge(1.0);
    cache.absorb(t);
    cache.freeze(f64::INFINITY);
    let surroundings = 118.5 / 700.0;
    let leaf = |visible: f64, rays: f64| (visible + 4.0 * surroundings) / (rays + 4.0);
    let bin = |visible: f64, rays: f64, leaf: f64| rounded(visible + 4.0 * leaf, rays + 4.0);
    is(roots(&cache, HI, up), bin(100.0, 100.0, leaf(100.0, 100.0)));
    is(roots(&cache, HI, down), bin(0.0, 0.0, leaf(100.0, 100.0)));
    is(roots(&cache, LO, up), bin(18.5, 600.0, leaf(18.5, 600.0)));
}

/// Share of next event estimation in the squares: of a bin that is shrunk towards its leaf, of one without samples, at
/// most 1. Killed by: shares of counts, of one channel, squares that are shrunk otherwise than the others, a
/// probability that is left out or squared, squares that are not finite.
#[test]
fn nee_shares_are_of_all_squares() {
    let mut blocks = Blocks::leaves(2, 1);
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    let t = &mut shards[0];
    t.clear(cache.bins());
    for k in 0..1000 {
        // squares of 29 a sample; every second one uses next event estimation, divided by 1/2: 20 over all samples,
        // halved
        t.log(0, [2.0, 3.0, 4.0], 1.0);
        if k % 2 == 0 {
            t.log_nee(0, [2.0, 6.0, 0.0], 0.5);
        }
        t.log(1, [1.0, 0.0, 0.0], 1.0);
        t.log_nee(1, [0.0, 1.0, 2.0], 1.0);
    }
    [f32::NAN, f32::INFINITY].iter().for_each(|x| t.log_nee(0, [1.0, *x, 1.0], 1.0));
    [cache.bins(), NO_BIN].iter().for_each(|none| t.log_nee(*none, [1.0; 3], 1.0));
    cache.begin_merge(1.0);
    cache.absorb(t);
    cache.freeze(f64::INFINITY);
    let share = |bin: u32| f64::from(cache.local(U32x8::splat(bin), ALL()).nee_share.lane(3));
    // the bin, four samples of its leaf
    let expected = (10.0 * 1000.0 + 4.0 * 7.5) / (29.0 * 1000.0 + 4.0 * 15.0);
    assert!((share(0) - expected).abs() < 1e-6, "{} for {expected}", share(0));
    assert!((share(2) - 0.5).abs() < 1e-6, "a bin without samples has the share of its leaf: {}", share(2));
    assert_eq!(share(1), 1.0);
}

/// Bins are shrunk towards their leaf; those without samples say so; pairs take over the variance. Killed by: no
/// shrinkage, a count with samples of other bins, pair sums ignored, a moment below the mean's square.
#[test]
fn what_is_looked_up() {
    let mut blocks = Blocks::leaves(2, 1);
    let (mut cache, mut shards) = blocks.carve(LO, HI);
    let t = &mut shards[0];
    t.clear(cache.bins());
    // Bin 0: 0 and 2 in turns. Bin 1: always 3, pairs say 0.25. Nothing else in the first leaf, nothing in the second.
    for i in 0..4000u32 {
        t.log(0, [2.0 * (i % 2) as f32; 3], 5.0);
        t.log(1, [3.0; 3], 7.0);
        t.log_pair(1, [0.25; 3]);
    }
    cache.absorb(t);
    cache.freeze(f64::INFINITY);
    let l = cache.local(U32x8::new([0, 1, 2, 15, 16, 31, NO_BIN, 1]), Mask8::from_bits(0x7f));
    let near = |found: [f32; 3], expected: f32| found.iter().all(|x| (x - expected).abs() <= 0.02 * expected);
    for (lane, mean, moment, cost, count) in
        [(0, 1.0, 2.0, 5.0, 4000.0), (1, 3.0, 9.0, 7.0, 4000.0), (2, 2.0, 5.5, 6.0, 0.0), (3, 2.0, 5.5, 6.0, 0.0)]
    {
        let found = [l.mean.lane(lane), l.moment.lane(lane), l.variance.lane(lane)];
        assert!(near(found[0], mean) && near(found[1], moment), "{lane} {found:?}");
        assert!(near([l.cost.lane(lane); 3], cost) && l.count.lane(lane) == count);
    }
    // Bin 0 has no pairs of its own: four of its leaf's beside the sixteen that its spread counts for.
    assert!(near(l.variance.lane(0), (4.0 * 0.25 + 16.0) / 20.0), "{:?}", l.variance.lane(0));
    assert!(near(l.variance.lane(1), 0.25));
    for lane in 4..8 {
        assert_eq!((l.mean.lane(lane), l.moment.lane(lane), l.variance.lane(lane)), ([0.0; 3], [0.0; 3], [0.0; 3]));
        assert_eq!((l.cost.lane(lane), l.count.lane(lane)), (0.0, 0.0));
    }
}

/// Look-ups give what was logged, up to the stated rounding, and bins that are not in use are empty. Killed
/// by: fewer bits, rounding the other way, channels or moments that change places, whatever memory held.
#[test]
fn look_ups_round_as_stated() {
    let ulp = 2f64.powi(-7);
    for exponent in -12..=12 {
        let mut blocks = Blocks::leaves(2, 1);
        let (mut cache, mut shards) = blocks.carve(LO, HI);
        let mut rng = SplitMix((90 + exponent) as u64);
        let x = [(); 3].map(|()| (rng.range(1.0, 10.0) * 10f64.powi(exponent)) as f32);
        let pair = x.map(|x| x * x * 0.3);
        let t = &mut shards[0];
        t.clear(cache.bins());
        // so many that the surroundings, which are the same, and the spread, which is 0, do not count
        for _ in 0..60_000 {
            t.log(5, x, 3.0);
            t.log_pair(5, pair);
        }
        cache.absorb(t);
        cache.freeze(f64::INFINITY);
        let l = cache.local(U32x8::splat(5), Mask8::all_lanes());
        for c in 0..3 {
            let (x, pair) = (f64::from(x[c]), f64::from(pair[c]));
            let [mean, moment, variance] = [l.mean, l.moment, l.variance].map(|v| f64::from(v.lane(3)[c]));
            // sums of 60,000 floats
            let sums = 1e-3;
            let within = |found: f64, low: f64, high: f64| found >= low * (1.0 - sums) && found <= high * (1.0 + sums);
            assert!(within(mean, x * (1.0 - ulp), x), "{exponent}: mean {mean} of {x}");
            assert!(within(moment, x * x, x * x * (1.0 + ulp)), "{exponent}: moment {moment} of {}", x * x);
            assert!(within(variance, pair * (1.0 - ulp), pair), "{exponent}: variance {variance} of {pair}");
        }
        let beyond = cache.local(U32x8::splat(cache.bins()), Mask8::all_lanes());
        assert_eq!((beyond.mean.lane(0), beyond.cost.lane(0), beyond.count.lane(0)), ([0.0; 3], 0.0, 0.0));
    }
}

/// Absorbed in shard order, the bits do not depend on which shard worked first; in another order they may. Killed by:
/// sums shared between shards, state that survives `clear`.
#[test]
fn the_order_of_work_does_not_matter() {
    let run = |order: [usize; 4]| {
        let mut blocks = Blocks::leaves(30, 4);
        let (mut cache, mut shards) = blocks.carve(LO, HI);
        for round in 0..3 {
            for s in order {
                let mut rng = SplitMix(100 * round + s as u64);
                shards[s].clear(cache.bins());
                for _ in 0..3000 {
                    let (p, d) = vertex(&mut rng);
                    let bin = find(&cache, 0, p, d);
                    shards[s].log(bin, [(); 3].map(|()| rng.f32()), rng.f32());
                }
            }
            cache.begin_merge(0.9);
            shards.iter().for_each(|t| cache.absorb(t));
            cache.freeze(500.0);
        }
        saved(&cache)
    };
    let bytes = run([0, 1, 2, 3]);
    assert!(bytes.len() > 20_000);
    assert_eq!(bytes, run([3, 1, 0, 2]));
}

/// Killed by: bytes counted too low, the other trees or the training sides forgotten, a size that could be larger.
#[test]
fn memory_starts_at_32_kib() {
    for (bytes, shards, least) in [(32 << 10, 1, 6), (48 << 10, 2, 6), (64 << 10, 3, 11), (24 << 20, 8, 2700)] {
        let size = CacheSize::within(bytes, shards).unwrap();
        assert!(size.bytes(shards).unwrap() <= bytes && size.leaves() >= least);
        assert!(size.bytes(shards).unwrap() + 7 * (2448 + 832 * shards as usize) + 32 + 256 > bytes);
        let mut blocks = Blocks::new(size, shards as usize);
        let (mut cache, mut training) = blocks.carve(LO, HI);
        iterate(&mut cache, &mut training, 2000, 100.0, &mut SplitMix(8));
        assert!(cache.leaves() >= least.min(11) && cache.leaves() <= size.leaves());
    }
    assert!(CacheSize::within(18_000, 1).is_none() && CacheSize::within(21_000, 1).is_some());
    assert!(CacheSize::within(usize::MAX, u32::MAX).is_some());
    // Bounds that are no box still give a cache.
    for [lo, hi] in [[[0.0; 3]; 2], [[f32::NAN; 3]; 2], [[f32::MIN; 3], [f32::MAX; 3]], [[1e30; 3], [-1e30; 3]]] {
        let mut blocks = Blocks::leaves(30, 1);
        let (mut cache, mut training) = blocks.carve(lo, hi);
        iterate(&mut cache, &mut training, 2000, 100.0, &mut SplitMix(9));
        assert!(cache.leaves() > 9);
    }
}
