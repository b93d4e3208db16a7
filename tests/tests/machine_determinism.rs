//! The picture is a function of scene, settings, seed and shard count, to the bit: threads, step sizes and the order in
//! which shards are stepped do not matter, nor, in `reproducible` arithmetic, does the instruction set.

use croupier::Settings;
use croupier::unstable::Sampler;
use croupier::unstable::learn::{ControlVariate, Guiding};
use croupier::unstable::scene::blob::content_hash;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_tests::media_scene::misty;
use croupier_tests::runner::{Image, Learned, Schedule, learning, render, scheduled, settings};
use croupier_tests::scenes::{blob, cornell, everything};
use std::fmt::Write;
use std::path::Path;

/// Killed by: a comb seeded by the clock or shared by shards, a random number that depends on the order of packets, a
/// step that flushes a half-filled packet at the end of its budget, a merge in the order of completion.
#[test]
fn schedules_do_not_change_a_bit() {
    for (name, scene) in
        [("cornell", cornell([24, 20])), ("everything", everything([24, 20])), ("misty", misty([24, 20]))]
    {
        let scene = blob(&scene);
        for (strategy, sampler) in
            [("classic:2", Sampler::Hashed), ("fixed:3.3", Sampler::Hashed), ("fixed:3.3", Sampler::Sobol)]
        {
            let settings =
                Settings { shards: 5, aovs: true.into(), seed: 7, max_depth: 5, sampler, ..settings(&scene, strategy) };
            let iterations = [1, 3];
            let all = |schedule| scheduled(&scene, &settings, &iterations, schedule);
            let reference = all(Schedule::InOrder(1_000_000_000));
            assert!(reference.mean() > 0.05 && reference.counters.non_finite == 0);
            for schedule in [
                Schedule::InOrder(1),
                Schedule::InOrder(100),
                Schedule::Reversed(1 << 30),
                Schedule::InTurn(1),
                Schedule::InTurn(37),
                Schedule::Shuffled(3, 50),
                Schedule::Shuffled(4, 3000),
                Schedule::Threads(2, 1_000_000_000),
                Schedule::Threads(2, 64),
                Schedule::Threads(5, 1000),
            ] {
                let other = all(schedule);
                assert!(other.bits() == reference.bits(), "{name}, {strategy}, {schedule:?}: the picture differs");
                assert_eq!(other.counters, reference.counters, "{name}, {strategy}, {schedule:?}");
                assert_eq!(other.error, reference.error);
            }
        }
    }
}

/// What is learned, and everything that depends on it, is as indifferent to schedules as the rest. Killed by:
/// statistics that are absorbed in the order of completion, a cache that changes within an iteration, an estimate of
/// the picture summed per thread, adaptive counts that a shard makes for itself.
#[test]
fn schedules_do_not_change_what_is_learned() {
    for (name, scene) in
        [("cornell", cornell([24, 20])), ("everything", everything([24, 20])), ("misty", misty([56, 40]))]
    {
        let scene = blob(&scene);
        for all in [false, true] {
            // the paper's rule splits from the first statistics on
            let mut settings =
                Settings { shards: 5, aovs: true.into(), seed: 8, max_depth: 6, ..settings(&scene, "ears:plain") };
            settings.learning.subdivide_count = 500.0;
            // some samples find no record
            settings.learning.ledger = 64;
            if all {
                (settings.adaptive, settings.shadow_roulette, settings.control_variate) =
                    (true, true, ControlVariate::Cached);
            }
            let iterations = [2, 3, 4];
            let mut seen = Vec::new();
            let mut run = |schedule| {
                let mut learned = Vec::new();
                let image = learning(&scene, &settings, &iterations, schedule, &mut |_, l: &mut dyn Learned| {
                    learned.push((l.saved(), l.statistics()));
                });
                seen.push((schedule, image, learned));
            };
            run(Schedule::InOrder(1_000_000_000));
            run(Schedule::InOrder(1));
            run(Schedule::Reversed(100));
            run(Schedule::InTurn(37));
            run(Schedule::Shuffled(5, 500));
            run(Schedule::Threads(1, 4096));
            run(Schedule::Threads(2, 64));
            run(Schedule::Threads(5, 1000));
            let (_, reference, learned) = &seen[0];
            let c = reference.counters;
            assert!(c.samples_logged > 1000 && c.paths_terminated > 100 && c.splits > 100, "{c:?}");
            assert!(
                learned[2].1[0].variance > 0.0
                    && (!all
                        || c.shadow_rays_terminated > 100
                            && c.light_samples_skipped > if name == "misty" { 5 } else { 10 }),
                "{c:?}"
            );
            for (schedule, image, other) in &seen[1..] {
                let what = format!("{name}, everything on {all}, {schedule:?}");
                assert!(other == learned, "{what}: other statistics");
                assert!(image.bits() == reference.bits(), "{what}: another picture");
                assert_eq!(image.counters, reference.counters, "{what}");
            }
        }
    }
}

/// Same samples whether in one iteration or in many, or divided over other shards, as long as no comb decides anything.
/// Killed by: keys that contain the iteration or the shard, `first_sample` not carried on, a pixel index local to the
/// shard.
#[test]
fn samples_do_not_depend_on_iterations_or_shards() {
    for scene in [cornell([21, 10]), everything([21, 10]), misty([21, 10])] {
        let scene = blob(&scene);
        let one = Settings { max_depth: 6, aovs: true.into(), ..settings(&scene, "none") };
        let reference = render(&scene, &one, 12);
        let same = |other: &Image, what: &str| {
            for (i, (a, b)) in reference.pixels.iter().zip(&other.pixels).enumerate() {
                assert_eq!((a.samples, a.rays), (b.samples, b.rays), "{what}, pixel {i}");
                for (tolerance, x, y) in [(1e-13, a.sum, b.sum), (1e-5, a.spread, b.spread)] {
                    for (x, y) in x.iter().zip(y) {
                        assert!((x - y).abs() <= tolerance * x.abs() + 1e-12, "{what}, pixel {i}: {x} and {y}");
                    }
                }
            }
            assert_eq!(reference.counters.rays(), other.counters.rays());
        };
        let in_order = Schedule::InOrder(1 << 20);
        same(&scheduled(&scene, &one, &[1; 12], in_order), "12 iterations");
        same(&scheduled(&scene, &one, &[5, 0, 7], in_order), "iterations of 5, 0 and 7");
        same(&render(&scene, &Settings { shards: 6, ..one }, 12), "6 shards");
        same(&render(&scene, &Settings { ring: 16, ..one }, 12), "the smallest ring");
    }
}

/// As above with Sobol' points, whose iterations draw other numbers. Killed by: a pixel index local to the shard, a sample's
/// number that depends on the order of packets.
#[test]
fn sobol_samples_do_not_depend_on_shards() {
    for scene in [cornell([21, 10]), everything([21, 10]), misty([21, 10])] {
        let scene = blob(&scene);
        let one = Settings { max_depth: 6, sampler: Sampler::Sobol, ..settings(&scene, "none") };
        let all = |settings: &Settings| scheduled(&scene, settings, &[4, 8], Schedule::InOrder(1 << 20));
        let reference = all(&one);
        for other in [Settings { shards: 6, ..one }, Settings { ring: 16, ..one }] {
            let other = all(&other);
            for (i, (a, b)) in reference.pixels.iter().zip(&other.pixels).enumerate() {
                for (x, y) in a.sum.iter().zip(b.sum) {
                    assert!((x - y).abs() <= 1e-13 * x.abs() + 1e-12, "pixel {i}: {x} and {y}");
                }
            }
            assert_eq!(reference.counters.rays(), other.counters.rays());
        }
        let hashed = all(&Settings { sampler: Sampler::Hashed, ..one });
        assert!(hashed.bits() != reference.bits());
    }
}

/// Every pixel gets exactly its samples, whatever the size and the number of shards. Killed by: tiles owned by no shard
/// or by two, a cursor that skips the pixels beside an empty slot, roots lost when the ring is small.
#[test]
fn every_pixel_gets_its_samples() {
    let scene = blob(&cornell([8, 8]));
    let base = Settings { max_depth: 2, ..settings(&scene, "fixed:1.5") };
    for size in [[1, 1], [1, 9], [17, 1], [8, 8], [9, 17], [40, 3], [33, 31]] {
        for shards in [1, 2, 3, 7, 16, 100] {
            for ring in [16, 64] {
                let spp = 3;
                let image = render(&scene, &Settings { size, shards, ring, ..base }, spp);
                assert_eq!(image.pixels.len(), (size[0] * size[1]) as usize);
                let wrong = image.pixels.iter().position(|p| (p.samples, p.ahead) != (u64::from(spp), 1.0));
                assert_eq!(wrong, None, "{size:?}, {shards} shards, ring {ring}: a pixel without its samples");
                assert_eq!(image.counters.camera_samples, u64::from(spp * size[0] * size[1]));
            }
        }
    }
}

/// Killed by: a seed that is not used, or of which only the low word is.
#[test]
fn seeds_give_other_pictures() {
    let scene = blob(&cornell([8, 8]));
    let image = |seed| render(&scene, &Settings { seed, ..settings(&scene, "classic") }, 2).bits();
    let seeds = [0, 1, 1 << 32, 1 << 63, u64::MAX];
    let images = seeds.map(image);
    for i in 0..seeds.len() {
        for j in 0..i {
            assert!(images[i] != images[j], "seeds {} and {}", seeds[i], seeds[j]);
        }
    }
    assert!(image(1) == images[1]);
}

/// The host's driver gives the same bits for any number of threads. Killed by: merging in the order of completion.
#[test]
fn the_driver_does_not_depend_on_threads() {
    use croupier_host::drive::{Options, Unobserved, drive};
    use croupier_host::render::Target;
    let scene = blob(&everything([24, 16]));
    let settings = Settings { shards: 7, ..settings(&scene, "classic:2") };
    let hash = |threads| {
        let options = Options { threads, ..Options::new(settings, Target::Spp(5)) };
        let r = drive(&scene, &options, &Unobserved).unwrap();
        assert_eq!(r.spp, 5);
        (r.hash(), r.counters)
    };
    assert_eq!(hash(1), hash(2));
    assert_eq!(hash(1), hash(3));
}

/// One file of hashes for all builds: baseline x86-64, x86-64-v3 and every other target must agree. `BLESS=1` rewrites
/// it after a change that is meant to change pictures. Killed by: a fused multiply-add, an estimate instruction or a
/// reduction whose order depends on the instruction set.
#[test]
fn pictures_have_the_same_bits_on_every_target() {
    if !croupier::unstable::simd::REPRODUCIBLE {
        println!("skipped: `fast` arithmetic does not promise the same bits everywhere");
        return;
    }
    let mut box_of_the_program = builtin::cornell_box();
    box_of_the_program.camera.size = [48, 48];
    let mut text = String::from("# scene, strategy, hash of the sums of radiance; rewrite with BLESS=1\n");
    for (name, scene) in
        [("builtin", box_of_the_program), ("everything", everything([48, 36])), ("misty", misty([48, 36]))]
    {
        let scene = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap().bytes;
        let base =
            Settings { shards: 4, aovs: true.into(), max_depth: 12, split_budget: 64, ..settings(&scene, "none") };
        let mut add = |what: &str, settings: Settings, iterations: &[u32]| {
            let image = scheduled(&scene, &settings, iterations, Schedule::Threads(2, 4096));
            assert_eq!(image.counters.non_finite, 0);
            let sums: Vec<[f64; 3]> = image.pixels.iter().map(|p| p.sum).collect();
            writeln!(text, "{name} {what} {:016x}", content_hash(bytemuck::cast_slice(&sums))).unwrap();
        };
        for strategy in ["classic", "throughput", "fixed:3.3"] {
            add(strategy, Settings { strategy: settings(&scene, strategy).strategy, ..base }, &[1, 3]);
        }
        let mut learns = Settings { strategy: settings(&scene, "ears").strategy, ..base };
        learns.learning.subdivide_count = 1000.0;
        add("ears", learns, &[1, 2, 4]);
        add("ears+sobol", Settings { sampler: Sampler::Sobol, ..learns }, &[1, 2, 4]);
        let mut guided = Settings { sampler: Sampler::Sobol, ..learns };
        (guided.learning.guiding, guided.learning.guide_bytes) = (Guiding::On, 1 << 20);
        add("ears+sobol+guided", guided, &[1, 2, 4]);
        let all = Settings { adaptive: true, shadow_roulette: true, control_variate: ControlVariate::Cached, ..learns };
        add("ears+adaptive+shadow+constant", all, &[1, 2, 4]);
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("snapshots/hashes.txt");
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(text, committed, "pictures changed; if that is meant, run with BLESS=1 and review the file");
}
