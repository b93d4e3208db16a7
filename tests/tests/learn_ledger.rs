//! Samples that the tracer logs equal those of a recursive oracle with the same random numbers, and a ledger that is
//! too small biases nothing.

use croupier::unstable::accel::WideBvh;
use croupier::unstable::learn::cache::{Cache, CacheSize, VertexKind};
use croupier::unstable::learn::{Learning, Objective, PixelEstimator};
use croupier::{Counters, Scene, Settings};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{Model, Reflectance, SceneDescription};
use croupier_tests::cache::{FIELDS, Oracle, Sums, overwrite};
use croupier_tests::replay::Replay;
use croupier_tests::runner::{Learned, Schedule, learning, scheduled, settings};
use croupier_tests::scenes::*;

const IN_ORDER: Schedule = Schedule::InOrder(1 << 20);

/// One leaf for every kind of vertices: bins stay what they are. Errors are absolute, so that values have the unit that
/// the oracle gives them.
fn whole_leaves(scene: &[u8], max_depth: u32) -> Settings {
    let s = settings(scene, "ears:plain");
    let learning = Learning {
        cache_bytes: 20_000,
        ledger: 1 << 14,
        pixel_estimator: PixelEstimator::Blocks,
        objective: Objective::Absolute,
        samples: u32::MAX,
        ..s.learning
    };
    Settings { max_depth, learning, ring: 1 << 14, split_budget: 1 << 20, ..s }
}

/// Sums of all bins.
fn bins(l: &dyn Learned) -> Vec<Sums> {
    Oracle::new(&l.saved().unwrap()).leaves.into_iter().flatten().collect()
}

/// One more iteration of `spp` samples by the tracer after `before`, and by the oracle: sums that were added, pixels.
struct Both {
    machine: Vec<Sums>,
    oracle: Vec<Sums>,
    /// Rays and samples of vertices, tracer and oracle.
    counted: [[u64; 2]; 2],
    /// Radiance of the pixels, tracer and oracle.
    pixels: Vec<[[f64; 3]; 2]>,
    pairs: f64,
    /// Were light samples learned from?
    lit: bool,
}

/// Statistics so large that every factor is the largest, 20.
const GREEDY: Sums = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1e12, 1e12, 1e12, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Renders `first` samples, then `second` ones with all factors 20; looks at the last of these iterations.
fn both(description: &SceneDescription, max_depth: u32, iterations: &[u32]) -> Both {
    let bytes = blob(description);
    let greedy = iterations.len() > 1;
    // next event estimation is learned if it plays roulette; the first iteration always uses it and traces all its rays
    let s = Settings { shadow_roulette: !greedy, ..whole_leaves(&bytes, max_depth) };
    let scene = Scene::from_bytes(&bytes).unwrap();
    let mut states = Vec::new();
    // the last "iteration" of no samples shows what the one before it left
    let iterations = [iterations, &[0]].concat();
    learning(&bytes, &s, &iterations, IN_ORDER, &mut |i, l: &mut dyn Learned| {
        states.push((bins(l), l.pixels(), l.counters()));
        if i == 1 && greedy {
            let mut bytes = l.saved().unwrap();
            overwrite(&mut bytes, || GREEDY);
            l.load(&bytes).unwrap();
        }
    });
    let (mut machine, new_pixels, new) = states.pop().unwrap();
    let (_, old_pixels, old) = states.pop().unwrap();
    assert_eq!(
        (new.ledger_full, new.samples_refused, new.splits_limited_by_ring, new.splits_limited_by_budget),
        (0, 0, 0, 0),
        "{new:?}"
    );

    let size = CacheSize::within(s.learning.cache_bytes, 1).unwrap();
    assert_eq!(size.leaves(), 6);
    let mut block = AlignedBytes::zeroed(Cache::layout(size).unwrap().size);
    let bounds = [scene.info.bounds_min, scene.info.bounds_max];
    let cache = Cache::new(size, bounds, s.learning.objective, block.as_mut()).unwrap();
    let mut replay = Replay {
        scene,
        bvh: WideBvh::new(&scene),
        cache: &cache,
        seed: s.seed,
        max_depth,
        size: s.size,
        factor: if greedy { 20 } else { 1 },
        sums: vec![[0.0; FIELDS]; 64],
        counted: [0; 2],
    };
    let (before, spp) = if greedy { (iterations[0], iterations[1]) } else { (0, iterations[0]) };
    let mut pixels = Vec::new();
    for (i, (p, q)) in new_pixels.iter().zip(&old_pixels).enumerate() {
        let weight = p.weight - q.weight;
        let found = [0, 1, 2].map(|c| (p.sum[c] - q.sum[c]) / weight);
        let at = [i as u32 % s.size[0], i as u32 / s.size[0]];
        let mut expected = [0.0; 3];
        for k in before..before + spp {
            let x = replay.camera_sample(at, k);
            (0..3).for_each(|c| expected[c] += x[c] / f64::from(spp));
        }
        pixels.push([found, expected]);
    }
    if greedy {
        // the decay is the same for all sums
        let carried = machine[0][0] - replay.sums[0][0];
        assert!((0.0..=1.0).contains(&carried), "{carried} of the old samples");
        for b in &mut machine {
            b.iter_mut().zip(GREEDY).for_each(|(x, old)| *x -= carried * old);
        }
    }
    let counted = [[new.rays() - old.rays(), new.vertex_samples - old.vertex_samples], replay.counted];
    let total = |sums: &[Sums]| sums.iter().map(|b| b[9] + b[10] + b[11]).sum::<f64>();
    let pairs = total(&machine) / total(&replay.sums);
    Both { machine, oracle: replay.sums, counted, pixels, pairs, lit: !greedy }
}

fn check(what: &str, b: &Both) {
    assert_eq!(b.counted[0], b.counted[1], "{what}: rays and samples");
    let samples: f64 = b.machine.iter().map(|s| s[0]).sum();
    assert!((samples - b.counted[0][1] as f64).abs() < 1e-6, "{what}: {samples} of {} samples logged", b.counted[0][1]);
    for (bin, (m, o)) in b.machine.iter().zip(&b.oracle).enumerate() {
        for field in 0..9 {
            // counts and pairs are whole numbers, costs whole halves
            let tolerance = if field < 3 { 1e-6 } else { 1e-3 + 2e-5 * o[field] };
            let off = (m[field] - o[field]).abs();
            assert!(off <= tolerance, "{what}: bin {bin}, field {field}: {} for {}", m[field], o[field]);
        }
        if b.lit {
            let (m, o) = (m[14], o[14]);
            assert!((m - o).abs() <= 1e-3 + 2e-5 * o, "{what}: bin {bin}, squares of light samples: {m} for {o}");
        }
    }
    for (i, [m, o]) in b.pixels.iter().enumerate() {
        for c in 0..3 {
            assert!((m[c] - o[c]).abs() <= 1e-4 * o[c], "{what}: pixel {i}, channel {c}: {} for {}", m[c], o[c]);
        }
    }
}

/// Without splitting. Killed by: a sample logged in the bin it arrives at instead of the one it leaves, values with the
/// weight of the path before them, emission without its MIS weight, the first camera ray charged to a sample.
#[test]
fn single_samples_are_logged_as_recursion_has_them() {
    for (name, scene) in [("emitter", box_with_emitter()), ("mirror and glass", mirror_and_glass())] {
        for max_depth in [2, 3, 5] {
            let b = both(&scene, max_depth, &[200]);
            let used = b.oracle.iter().filter(|s| s[0] > 0.0).count();
            println!("{name}, depth {max_depth}: {} samples in {used} bins", b.counted[0][1]);
            assert!(b.counted[0][1] > 3000 && used > if max_depth > 2 && name != "emitter" { 8 } else { 2 });
            check(&format!("{name}, depth {max_depth}"), &b);
        }
    }
}

/// With twenty samples at every vertex, nested. Killed by: an inner estimate over n or over nothing, samples of a split
/// vertex whose cost is counted once, a sum that is folded into the parent before it is complete.
#[test]
fn nested_splits_are_logged_as_recursion_has_them() {
    for (name, scene) in [("emitter", box_with_emitter()), ("mirror and glass", mirror_and_glass())] {
        for (max_depth, spp) in [(2, 12), (3, 8), (4, 1)] {
            let b = both(&scene, max_depth, &[4, spp]);
            println!(
                "{name}, depth {max_depth}: {} samples, pairs {:.4} of those in random order",
                b.counted[0][1], b.pairs
            );
            assert!(b.counted[0][1] > 3000);
            check(&format!("{name}, depth {max_depth}, split"), &b);
            assert!((b.pairs - 1.0).abs() < 0.15, "{name}, depth {max_depth}: pairs {}", b.pairs);
        }
    }
}

/// Two faces of a diffuse edge and a mirror beside it, all in one cell and seen in one picture: each has bins of its
/// own, with its own radiance, or with that over its pixels where errors are relative. Killed by: bins by the direction
/// of the viewer alone, a mirror among the diffuse surfaces, first vertices in other units.
#[test]
fn faces_and_materials_in_one_cell_stay_apart() {
    let mut s = in_white_environment(camera([0.0, 1.0, 1.0], [0.0; 3], 20.0, [16, 16]));
    let mirror = Model::Mirror { reflectance: Reflectance::Constant([0.5; 3]) };
    let [top, front, mirror] = [grey(0.8), grey(0.2), mirror].map(|m| s.add_material("face", m));
    let lying = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x + 1.0, 0.0, -1.0], [x, 0.0, -1.0]];
    add_quad(&mut s, "top", top, lying(-1.0));
    add_quad(&mut s, "mirror", mirror, lying(0.0));
    add_quad(&mut s, "front", front, [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]);
    let scene = blob(&s);
    // 8x8 pixels, which share an estimate, see one face; relative values are over sqrt(pixel^2 + 0.01)
    let cases = [(Objective::Absolute, [0.2, 0.8], [0.5]), (Objective::Relative, [0.8944, 0.9923], [0.9806])];
    for (objective, faces, shown) in cases {
        let mut s = whole_leaves(&scene, 2);
        (s.learning.objective, s.learning.decay) = (objective, 0.0);
        let mut found = Vec::new();
        learning(&scene, &s, &[16, 16, 0], IN_ORDER, &mut |_, l: &mut dyn Learned| found = bins(l));
        assert_eq!(found.len(), 96, "one leaf for each kind");
        let of = |kind: VertexKind| {
            let leaf = found[16 * kind as usize..][..16].iter().filter(|b| b[0] > 0.0);
            let mut means: Vec<f64> = leaf.map(|b| b[3] / b[0]).collect();
            means.sort_by(f64::total_cmp);
            means
        };
        let close = |found: &[f64], expected: &[f64]| {
            found.len() == expected.len() && found.iter().zip(expected).all(|(f, e)| (f / e - 1.0).abs() < 0.05)
        };
        let (diffuse, glossy) = (of(VertexKind::FirstDiffuse), of(VertexKind::FirstGlossy));
        assert!(close(&diffuse, &faces) && close(&glossy, &shown), "{objective}: {diffuse:?} and {glossy:?}");
        assert!(of(VertexKind::Diffuse).is_empty() && of(VertexKind::Glossy).is_empty(), "paths have one vertex");
    }
}

/// A ledger for a few samples: one iteration has the picture of a large one to the bit, what finds no record is
/// counted, and what is logged are complete samples: of no bin more than there are. Killed by: a path that ends with
/// its record, a sample that is logged without what its children would have added.
#[test]
fn a_full_ledger_changes_no_picture() {
    for scene in [blob(&box_with_emitter()), blob(&mirror_and_glass())] {
        for shards in [1, 3] {
            let mut s = Settings { shards, size: [16, 16], ..whole_leaves(&scene, 5) };
            s.learning.cache_bytes = 1 << 16;
            let run = |ledger: u32| {
                let mut s = s;
                s.learning.ledger = ledger;
                scheduled(&scene, &s, &[8], IN_ORDER)
            };
            let large = run(1 << 14);
            assert_eq!(large.counters.ledger_full, 0);
            assert_eq!(large.counters.samples_logged, large.counters.vertex_samples);
            for ledger in [1, 4, 16, 24] {
                let small = run(ledger);
                let c = small.counters;
                assert!(small.bits() == large.bits(), "a ledger of {ledger} changes the picture");
                assert!(c.ledger_full > 0, "a ledger of {ledger}: {c:?}");
                assert!(c.samples_logged < large.counters.samples_logged, "{ledger}: {c:?}");
                // a packet of camera samples takes eight records; with no more there is none for what follows
                assert!((c.samples_logged > 0) == (ledger > 8), "{ledger}: {c:?}");
            }
        }
    }
}

/// Roulette for next event estimation does not change the means of what is logged, within 1 %. Killed by: contributions
/// that are divided by one of their probabilities in the picture only.
#[test]
fn shadow_roulette_does_not_change_what_is_logged() {
    let scene = blob(&cornell([16, 16]));
    let mean = |shadow_roulette: bool| {
        let mut s = Settings { size: [16, 16], shadow_roulette, ..whole_leaves(&scene, 6) };
        (s.learning.decay, s.learning.factors) = (0.0, [1.0, 1.0]);
        let mut sums = [0.0; FIELDS];
        let image = learning(&scene, &s, &[16, 512, 0], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if i == 2 {
                bins(l).iter().for_each(|b| (0..FIELDS).for_each(|k| sums[k] += b[k]));
            }
        });
        (sums[3] / sums[0], image.counters)
    };
    let ((without, none), (with, c)) = (mean(false), mean(true));
    println!("{with} for {without}, {c:?}");
    assert!(none.shadow_rays_terminated == 0 && none.light_samples_skipped == 0);
    assert!(c.shadow_rays_terminated > c.shadow_rays / 10 && c.light_samples_skipped > c.vertex_samples / 10);
    assert!((with / without - 1.0).abs() < 0.01, "{with} for {without}");
}

/// Statistics of next event estimation are the same whether all samples use it or one of twenty, within 5 %: roulette
/// terminates a tenth of the shadow rays, which adds a little. Killed by: a probability that counts twice or not at
/// all.
#[test]
fn nee_statistics_do_not_depend_on_its_probability() {
    let scene = blob(&box_with_emitter());
    let mut s = Settings { size: [16, 16], shadow_roulette: true, ..whole_leaves(&scene, 3) };
    (s.learning.decay, s.learning.factors) = (0.0, [1.0, 1.0]);
    // squares per sample in the iteration of 2,048 samples, which all use it in the first one
    let squares = |iterations: &[u32]| {
        let (mut sums, mut counters) = ([0.0; FIELDS], Vec::new());
        learning(&scene, &s, iterations, IN_ORDER, &mut |i, l: &mut dyn Learned| {
            counters.push(l.counters());
            if i + 1 == iterations.len() {
                bins(l).iter().for_each(|b| (0..FIELDS).for_each(|k| sums[k] += b[k]));
            } else if i == 1 {
                let (mut known, mut bytes) = (bins(l).into_iter(), l.saved().unwrap());
                overwrite(&mut bytes, || {
                    let mut b = known.next().unwrap().map(|x| 1e6 * x);
                    b[14] *= 1e-9;
                    b
                });
                l.load(&bytes).unwrap();
            }
        });
        let [before, after] = [counters.len() - 2, counters.len() - 1].map(|k| counters[k]);
        let of = |f: fn(&Counters) -> u64| (f(&after) - f(&before)) as f64;
        let spared = [
            of(|c| c.light_samples_skipped) / of(|c| c.vertex_samples),
            of(|c| c.shadow_rays_terminated) / of(|c| c.shadow_rays),
        ];
        (sums[14] / sums[0], spared)
    };
    let (all, none) = squares(&[2048, 0]);
    let (few, spared) = squares(&[16, 2048, 0]);
    println!("{few} for {all}, {spared:?} spared");
    assert!(none == [0.0; 2] && spared[0] > 0.9 && spared[1] < 0.2);
    assert!((few / all - 1.0).abs() < 0.05);
}

/// Complete samples only: with a small ledger a bin's samples cost at least what any sample costs, and where paths have
/// one bounce left the means are those of a large one. Killed by: an incomplete sample that is logged all the same (too
/// cheap and too dark).
#[test]
fn only_complete_samples_are_logged() {
    let scene = blob(&box_with_emitter());
    let means = |ledger: u32, max_depth: u32| {
        let mut s = Settings { size: [16, 16], ..whole_leaves(&scene, max_depth) };
        s.learning.ledger = ledger;
        let mut sums = [0.0; FIELDS];
        learning(&scene, &s, &[64, 0], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if i == 1 {
                bins(l).iter().for_each(|b| (0..12).for_each(|k| sums[k] += b[k]));
            }
        });
        (sums[0], sums[2] / sums[0], sums[3] / sums[0])
    };
    // depth 2: a sample is a light ray and a bounce that ends; which of them finds a record is arbitrary
    let (all, cost, value) = means(1 << 14, 2);
    let (few, small_cost, small_value) = means(12, 2);
    println!("{few} of {all} samples: {small_cost} for {cost} rays, {small_value} for {value}");
    assert!(few < 0.9 * all && few > 1000.0);
    assert!((small_cost / cost - 1.0).abs() < 0.02 && (small_value / value - 1.0).abs() < 0.1);
}
