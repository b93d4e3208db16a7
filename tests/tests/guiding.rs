//! Path guiding changes efficiency only: equivalence tests (TOST) against renders without it, whatever its trees hold;
//! the same bits for any schedule; cache and guide saved, loaded and merged as one.
//!
//! As in `learn_unbiased.rs`: equal is a difference within 0.3 % of the mean with 95 % confidence from both sides,
//! standard errors are asserted to be below 0.09 %. A bias of 0.3 % passes with a probability of 5 %, one of 0.45 %
//! with less than 1e-4. The scene with caustics has 1 % in place of 0.3 %, and three times the rest, fog 0.6 %, and twice
//! the rest; where guides mislead in fog it is 1 % as well.

use croupier::unstable::Sampler;
use croupier::unstable::learn::Guiding;
use croupier::unstable::learn::cache::CacheError;
use croupier::unstable::learn::guiding::{Guide, GuideLog, GuideSize};
use croupier::{Scene, Settings};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::SceneDescription;
use croupier_tests::media_scene::{add_medium_box, homogeneous};
use croupier_tests::runner::{Image, Learned, Schedule, doubling, learning, scheduled, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::{SplitMix, equivalent};

/// Half-width of what counts as equal, relative to the mean.
const DELTA: f64 = 0.003;
/// The same where caustics are found by chance alone, and in fog by guides that mislead.
const CAUSTICS: f64 = 0.01;
/// The same in fog, where free paths are the noise.
const FOG: f64 = 0.006;
/// Standard error that renders aim at, over that width.
const TARGET: f64 = 0.2;
/// Factor of the width that renders aim at if their pilot, which has fewer iterations, has less noise in each sample.
const PILOTED: f64 = 0.6;
const IN_ORDER: Schedule = Schedule::InOrder(1 << 20);

/// Small trees, in several shards, that learn from every sample.
fn guided(scene: &[u8], strategy: &str, max_depth: u32) -> Settings {
    let mut s = Settings { max_depth, shards: 3, seed: 2, ..settings(scene, strategy) };
    s.learning.cache_bytes = 1 << 20;
    (s.learning.guiding, s.learning.guide_bytes, s.learning.samples) = (Guiding::On, 1 << 20, 64);
    s
}

fn plain(s: &Settings) -> Settings {
    let mut s = Settings { seed: 1, ..*s };
    s.learning.guiding = Guiding::Off;
    s
}

/// As many samples as [`TARGET`] takes, by a pilot with another seed.
fn run(scene: &[u8], s: &Settings, before: &mut dyn FnMut(usize, &mut dyn Learned)) -> Image {
    run_to(DELTA, scene, s, before)
}

fn run_to(delta: f64, scene: &[u8], s: &Settings, before: &mut dyn FnMut(usize, &mut dyn Learned)) -> Image {
    let pilot = learning(scene, &Settings { seed: s.seed + 100, ..*s }, &doubling(504), IN_ORDER, before);
    let spp = 504.0 * (pilot.error_of_mean() / pilot.mean() / (TARGET * delta)).powi(2);
    learning(scene, s, &doubling((spp as u32).clamp(504, 160_000)), IN_ORDER, before)
}

#[track_caller]
fn assert_equivalent(what: &str, a: &Image, b: &Image) {
    assert_within(DELTA, what, a, b);
}

#[track_caller]
fn assert_within(delta: f64, what: &str, a: &Image, b: &Image) {
    assert_eq!(a.counters.non_finite, 0);
    let (d, error) = ((a.mean() - b.mean()) / b.mean(), a.error_of_mean().hypot(b.error_of_mean()) / b.mean());
    println!("{what}: {:+.4} % +- {:.4} %", 100.0 * d, 100.0 * error);
    assert!(error < 0.3 * delta, "{what}: the standard error of {error} is too large for the test");
    assert!(equivalent(d, error, delta, 0.05), "{what}: differs by {d} +- {error}");
}

/// A guide of this scene whose trees hold directions at random, in every leaf `hot` of them with all of the light,
/// which promises that most samples are best guided; saved.
fn adversarial(scene: &[u8], s: &Settings, hot: u32, rng: &mut SplitMix) -> Vec<u8> {
    let scene = Scene::from_bytes(scene).expect("a valid scene");
    let size = GuideSize::within(s.learning.guide_bytes, s.shards).expect("a size");
    let mut shared = AlignedBytes::zeroed(Guide::layout(size).expect("a layout").size);
    let mut own = AlignedBytes::zeroed(GuideLog::layout(size).expect("a layout").size);
    let bounds = [scene.info.bounds_min, scene.info.bounds_max];
    let mut guide = Guide::new(size, bounds, shared.as_mut()).expect("a guide");
    let mut log = GuideLog::new(size, own.as_mut()).expect("a log");
    for _ in 0..4 {
        log.clear();
        for leaf in 0..guide.leaves() {
            for _ in 0..hot {
                let point = rng.word();
                (0..300).for_each(|_| {
                    log.add(leaf, 190, point, 1.0, 0.1);
                });
            }
        }
        guide.learn(0.0, std::iter::once(&log));
    }
    let mut bytes = vec![0; guide.saved_len()];
    guide.save(&mut bytes).expect("room for the guide");
    bytes
}

/// Strategies with and without statistics of their own. Killed by: a density that is not the mixture's in one of the
/// three places (scattering, light samples, emitters that are met), delta lobes that are not divided by what is left
/// to them, the light sample counted into what the bounce gave, throughputs of albedos used as weights.
#[test]
fn guided_renders_agree_with_others() {
    for (what, scene, delta) in [("cornell", cornell([12, 12]), DELTA), ("caustics", mirror_and_glass(), CAUSTICS)] {
        let scene = blob(&scene);
        let reference = run_to(delta, &scene, &plain(&guided(&scene, "none", 6)), &mut |_, _| ());
        for strategy in ["none", "classic:2", "albedo", "ears"] {
            let s = guided(&scene, strategy, 6);
            let s = Settings { shadow_roulette: strategy == "ears", ..s };
            let mut most = 0.0f64;
            let image = run_to(delta, &scene, &s, &mut |_, l| most = most.max(l.guide().expect("a guide").1));
            println!("{what}, {strategy}: at most {most:.3} of the samples were guided");
            assert_within(delta, &format!("{what}, {strategy}"), &image, &reference);
        }
    }
}

/// A box half full of fog that scatters forwards, or back where `g` is negative, and walls that reflect nothing: light
/// comes from vertices in the fog alone.
fn fog(g: f32) -> SceneDescription {
    let mut s = cornell([12, 12]);
    (0..3).for_each(|wall| s.materials[wall].model = grey(0.0));
    add_medium_box(&mut s, homogeneous([0.05, 0.1, 0.2], [1.0, 1.2, 1.5], g), [-0.9; 3], [0.9, 0.2, 0.9]);
    s
}

/// Phase functions and the guide are one mixture. Killed by: samples in media that are not learned from; a density that
/// is not the mixture's, of light samples or of emitters that are met; an albedo that counts twice.
#[test]
fn guided_media_agree_with_others() {
    for g in [0.6, -0.3] {
        let scene = blob(&fog(g));
        let reference = run_to(FOG, &scene, &plain(&guided(&scene, "none", 4)), &mut |_, _| ());
        for strategy in ["none", "ears"] {
            let s = Settings { shadow_roulette: strategy == "ears", ..guided(&scene, strategy, 4) };
            let mut most = 0.0f64;
            let learned = run_to(FOG, &scene, &s, &mut |_, l| most = most.max(l.guide().expect("a guide").1));
            assert!(most > 0.01, "at most {most} of the samples were guided");
            assert_within(FOG, &format!("{strategy}, g = {g}, learned"), &learned, &reference);
            let (mut rng, mut least) = (SplitMix(5), 1.0f64);
            let misled = run_to(CAUSTICS, &scene, &s, &mut |_, l| {
                l.load_guide(&adversarial(&scene, &s, 8, &mut rng)).expect("a guide of this scene");
                least = least.min(l.guide().expect("a guide").1);
            });
            assert!(least > 0.6, "only {least} of the samples were guided");
            assert_within(CAUSTICS, &format!("{strategy}, g = {g}, misled"), &misled, &reference);
        }
    }
}

/// Narrow phase functions are left alone: their pictures have the mean of those without guiding, bit by bit, and no
/// others have. Killed by: no limit, a sign that counts, a guide in media that learns and is not sampled.
#[test]
fn narrow_phase_functions_are_not_guided() {
    for (g, expected) in [(0.79, true), (0.81, false), (-0.81, false)] {
        let scene = blob(&fog(g));
        let (s, mut known) = (guided(&scene, "none", 4), false);
        let image = learning(&scene, &s, &doubling(248), IN_ORDER, &mut |_, l| {
            known |= l.guide().expect("a guide").1 > 0.0;
        });
        let off = scheduled(&scene, &Settings { seed: s.seed, ..plain(&s) }, &doubling(248), IN_ORDER);
        assert_eq!([known, image.mean().to_bits() != off.mean().to_bits()], [expected; 2], "g = {g}");
    }
}

/// Guiding of some blocks of pixels, and of no others, by adversarial guides. Killed by: a choice of pixels that goes with
/// what they find, weights of samples that are not guided by a mixture's density.
#[test]
fn watched_guides_do_not_bias() {
    let scene = blob(&cornell([32, 32]));
    let reference = run(&scene, &plain(&guided(&scene, "none", 5)), &mut |_, _| ());
    for strategy in ["classic", "ears"] {
        let mut s = guided(&scene, strategy, 5);
        s.learning.guiding = Guiding::Auto;
        let (mut rng, mut least) = (SplitMix(11), f64::INFINITY);
        let image = run(&scene, &s, &mut |i, l| {
            let u = l.guide_use().expect("a guide that is watched");
            assert!(!u.enabled, "{strategy}, iteration {i}: {u:?}");
            least = least.min(u.gain.map_or(f64::INFINITY, |g| g.gain));
            l.load_guide(&adversarial(&scene, &s, 3, &mut rng)).expect("a guide of this scene");
        });
        assert!(least < 0.95, "{strategy}: adversarial guides promise {least}");
        assert_equivalent(&format!("{strategy}, watched"), &image, &reference);
    }
}

/// At first, until three iterations have shown no gain, the guide of a small picture learns from all pixels, not only from
/// those that it guides: logs of few entries count what they are offered. Killed by: pixels outside of the trial that are
/// not learned from.
#[test]
fn all_pixels_are_learned_from_at_first() {
    let scene = blob(&cornell([32, 32]));
    let offered = |guiding| {
        let mut s = guided(&scene, "ears", 4);
        (s.learning.guiding, s.learning.guide_bytes) = (guiding, 24 << 10);
        let mut thinned = 0;
        learning(&scene, &s, &[8, 1], IN_ORDER, &mut |_, l| thinned = l.guide().expect("a guide").2);
        thinned as f64
    };
    // of these at most half are guided to find out
    let (some, all) = (offered(Guiding::Auto), offered(Guiding::On));
    assert!(all > 10_000.0 && (some / all - 1.0).abs() < 0.05, "{some} directions, not {all}");
}

/// Once some iterations have shown no gain, one of the shards trains the guide, another one in each iteration, until
/// statistics are loaded; logs of few entries count what they are offered. Killed by: shards that all train, or none; doubts
/// that outlive the guide; turns that depend on steps.
#[test]
fn shards_take_turns_where_guiding_does_not_pay() {
    let scene = blob(&cornell([64, 64]));
    let mut s = Settings { shards: 8, ..guided(&scene, "ears", 4) };
    (s.learning.guiding, s.learning.guide_bytes) = (Guiding::Auto, 64 << 10);
    let offered = |schedule| {
        let mut all = vec![];
        let image = learning(&scene, &s, &[16; 11], schedule, &mut |i, l| {
            assert!(!l.guide_use().expect("a guide that is watched").enabled);
            all.push(l.guide().expect("a guide").2 as f64);
            if i == 9 {
                let saved = l.saved_statistics().expect("statistics");
                l.load_statistics(&saved).expect("statistics of this scene");
            }
        });
        // from 0 again when a guide is loaded
        let offered: Vec<_> = (1..11).map(|i| all[i] - if i == 10 { 0.0 } else { all[i - 1] }).collect();
        (image.bits(), offered)
    };
    let (bits, some) = offered(IN_ORDER);
    let all = some[0];
    assert!(all > 50_000.0 && some[9] > 0.7 * all, "{some:?}");
    // fewer while the guide is known to do harm
    assert!(some[3..9].iter().all(|n| n / all < 0.2), "{some:?}");
    assert!(some[3..9].iter().any(|n| n / all > 0.07), "{some:?}");
    assert!(offered(Schedule::Threads(3, 64)) == (bits, some), "other bits");
}

/// Without a cache nothing but the guide learns: shards without a turn open no records, of which a small ledger counts those
/// that it has no room for. Killed by: records that nobody reads.
#[test]
fn shards_without_a_turn_open_no_records_without_a_cache() {
    let scene = blob(&cornell([32, 32]));
    let mut s = Settings { shards: 8, ..guided(&scene, "classic", 4) };
    (s.learning.guiding, s.learning.ledger) = (Guiding::Auto, 16);
    let mut full = vec![];
    learning(&scene, &s, &[8; 18], IN_ORDER, &mut |_, l| full.push(l.counters().ledger_full));
    let of = |i: usize| full[i + 1] - full[i];
    // in doubt after twelve iterations at most
    assert!(of(0) > 1000 && (12..17).map(of).sum::<u64>() < 5 * of(0) / 4, "{full:?}");
}

/// Where light comes through glass the guide is enabled, and the mean stays, even after a guide that misled at first: then
/// shards take turns until it pays. Killed by: a gain that no guide reaches, a decision that goes with the samples of the
/// iteration that it is for, a gain in doubt that stays in doubt.
#[test]
fn guides_that_pay_are_enabled() {
    let scene = blob(&mirror_and_glass());
    let size = [32, 32];
    let reference = run_to(CAUSTICS, &scene, &Settings { size, ..plain(&guided(&scene, "none", 6)) }, &mut |_, _| ());
    let mut s = Settings { size, ..guided(&scene, "ears", 6) };
    (s.shadow_roulette, s.learning.guiding) = (true, Guiding::Auto);
    for (misled, what) in [(false, "ears, guided where it pays"), (true, "ears, misled at first")] {
        let (mut enabled, mut least, mut last) = (0, f64::INFINITY, None);
        // what the mean needs is too few to find out: with some seeds it takes more than 4,000 samples per pixel
        let image = learning(&scene, &s, &doubling(16_000), IN_ORDER, &mut |i, l| {
            last = l.guide_use();
            enabled += u32::from(last.is_some_and(|u| u.enabled));
            assert!(!misled || i > 4 || enabled == 0, "{what}, iteration {i}: {last:?}");
            least = least.min(last.and_then(|u| u.gain).map_or(f64::INFINITY, |g| g.gain));
            if misled && i < 4 {
                l.load_guide(&adversarial(&scene, &s, 3, &mut SplitMix(11))).expect("a guide of this scene");
            }
        });
        println!("{what}: all pixels guided in {enabled} iterations, {last:?}");
        assert!(enabled >= 5, "{what}: {last:?}");
        assert!(!misled || least < 0.95, "{what}: misleading guides promise {least}");
        assert_within(CAUSTICS, what, &image, &reference);
    }
}

/// Sobol' points, whose hashed lanes draw other blocks of numbers, and those of adaptive pictures, of which none go on.
/// Killed by: leaves that go with the light sample's numbers, a light sample that is weighted against the BSDF where its
/// bounce is weighted against the mixture.
#[test]
fn guided_renders_with_sobol_points_agree_with_others() {
    let scene = blob(&cornell([12, 12]));
    let reference = run(&scene, &plain(&guided(&scene, "none", 6)), &mut |_, _| ());
    for adaptive in [false, true] {
        let s = Settings { sampler: Sampler::Sobol, adaptive, ..guided(&scene, "ears", 6) };
        let mut rng = SplitMix(7);
        let image = run_to(PILOTED * DELTA, &scene, &s, &mut |_, l| {
            l.load_guide(&adversarial(&scene, &s, 2, &mut rng)).expect("a guide of this scene");
        });
        assert_equivalent(&format!("Sobol' points, adaptive {adaptive}"), &image, &reference);
    }
}

/// Killed by: directions of probability 0 where light comes from, densities of cells that are not sampled.
#[test]
fn adversarial_guides_do_not_bias() {
    let scene = blob(&cornell([12, 12]));
    let reference = run(&scene, &plain(&guided(&scene, "none", 5)), &mut |_, _| ());
    for (strategy, hot) in [("classic", 1), ("ears", 5)] {
        let s = guided(&scene, strategy, 5);
        let mut rng = SplitMix(u64::from(hot));
        let mut least = 1.0f64;
        let image = run(&scene, &s, &mut |_, l| {
            l.load_guide(&adversarial(&scene, &s, hot, &mut rng)).expect("a guide of this scene");
            least = least.min(l.guide().expect("a guide").1);
        });
        assert!(least > 0.6, "only {least} of the samples were guided");
        assert_equivalent(&format!("{strategy}, {hot} hot cells"), &image, &reference);
    }
}

/// Trees of another picture, kept for good or learned on; logs of 64 directions. Killed by: a log that keeps what came
/// first with the weight of all, statistics that change within an iteration.
#[test]
fn stale_guides_and_tiny_logs_do_not_bias() {
    let scene = blob(&cornell([12, 12]));
    let reference = run(&scene, &plain(&guided(&scene, "none", 5)), &mut |_, _| ());
    let s = guided(&scene, "ears", 5);
    let mut old = vec![];
    let emptier = Settings { max_depth: 3, seed: 9, ..s };
    learning(&scene, &emptier, &doubling(248), IN_ORDER, &mut |_, l| old = l.guide().expect("a guide").0);
    let stale = run(&scene, &s, &mut |_, l| l.load_guide(&old).expect("a guide of this scene"));
    assert_equivalent("stale", &stale, &reference);
    let mut tiny = s;
    tiny.learning.guide_bytes = 24 << 10;
    let mut thinned = 0;
    let image = run(&scene, &tiny, &mut |_, l| thinned = thinned.max(l.guide().expect("a guide").2));
    assert!(thinned > 10_000, "{thinned} directions found no room");
    assert_equivalent("24 KiB", &image, &reference);
}

/// What other renders have learned, of the same scene and of one that is emptier, is added again and again. Killed by: a
/// merged leaf whose density is not that of what is drawn from it, sums that are added without what they are out of.
#[test]
fn merged_statistics_do_not_bias() {
    let scene = blob(&cornell([12, 12]));
    let reference = run(&scene, &plain(&guided(&scene, "none", 5)), &mut |_, _| ());
    let s = guided(&scene, "ears", 5);
    let [same, emptier] = [s, Settings { max_depth: 2, ..s }].map(|s| taught(&scene, &Settings { seed: 9, ..s }));
    let mut least = 1.0f64;
    let image = run(&scene, &s, &mut |i, l| {
        l.merge_statistics(if i % 2 == 0 { &same } else { &emptier }).expect("statistics of this scene");
        least = least.min(l.guide().expect("a guide").1);
    });
    assert!(least > 0.1, "only {least} of the samples were guided");
    assert_equivalent("merged", &image, &reference);
}

/// Killed by: logs replayed in the order in which shards finish, combs or keys that depend on steps, a guide that is
/// read while it changes.
#[test]
fn schedules_do_not_change_a_bit() {
    for (strategy, guiding, side) in
        [("classic", Guiding::On, 24), ("ears", Guiding::On, 24), ("ears", Guiding::Auto, 64)]
    {
        let scene = blob(&cornell([side, side]));
        let mut s = guided(&scene, strategy, 8);
        s.learning.guiding = guiding;
        let start = adversarial(&scene, &s, 2, &mut SplitMix(13));
        let bits = |schedule| {
            let (mut guides, mut compared) = (vec![], guiding == Guiding::On);
            let image = learning(&scene, &s, &[4, 8, 16, 32], schedule, &mut |i, l| {
                if i == 0 {
                    l.load_guide(&start).expect("a guide of this scene");
                }
                guides.push(l.guide());
                compared |= l.guide_use().is_some_and(|u| u.gain.is_some());
            });
            assert!(compared, "{strategy}: too few samples were guided");
            (image.bits(), guides)
        };
        let expected = bits(IN_ORDER);
        assert!(expected.1.iter().flatten().any(|g| g.1 > 0.6), "{strategy}: little was guided");
        for schedule in
            [Schedule::Reversed(100), Schedule::InTurn(17), Schedule::Shuffled(3, 500), Schedule::Threads(3, 64)]
        {
            assert!(bits(schedule) == expected, "{strategy}, {schedule:?}: other bits");
        }
        let off = scheduled(&scene, &Settings { seed: s.seed, ..plain(&s) }, &[4, 8, 16, 32], IN_ORDER);
        assert!(off.bits() != expected.0, "{strategy}: guiding changes nothing");
    }
}

fn learns(scene: &[u8], strategy: &str, guiding: Guiding) -> Settings {
    let mut s = Settings { max_depth: 5, shards: 2, ..settings(scene, strategy) };
    (s.learning.cache_bytes, s.learning.guide_bytes) = (1 << 20, 1 << 20);
    (s.learning.guiding, s.learning.samples) = (guiding, 64);
    s
}

/// What is learned in some iterations.
fn taught(scene: &[u8], s: &Settings) -> Vec<u8> {
    let mut bytes = Vec::new();
    learning(scene, s, &[16, 64, 64, 1], IN_ORDER, &mut |_, l| bytes = l.saved_statistics().expect("statistics"));
    bytes
}

/// Calls `f` with a session that has learned in one iteration.
fn with_session(scene: &[u8], s: &Settings, f: &mut dyn FnMut(&mut dyn Learned)) {
    learning(scene, s, &[4, 1], IN_ORDER, &mut |i, l| {
        if i == 1 {
            f(l);
        }
    });
}

/// Cache and guide come back as they were, whichever of them there is on both sides. Killed by: a guide that is not saved
/// or not loaded, a part taken for the other, bytes of a part that is missing.
#[test]
fn cache_and_guide_come_back_together() {
    let scene = blob(&cornell([16, 16]));
    let (both, cache_alone) = (learns(&scene, "ears", Guiding::On), learns(&scene, "ears", Guiding::Off));
    let guide_alone = learns(&scene, "classic", Guiding::On);
    let [of_both, of_cache, of_guide] = [both, cache_alone, guide_alone].map(|s| taught(&scene, &s));
    with_session(&scene, &both, &mut |l| {
        assert!(l.saved_statistics() != Some(of_both.clone()));
        l.load_statistics(&of_both).unwrap();
        assert!(l.saved_statistics() == Some(of_both.clone()));
        let [cache, guide] = [l.saved().unwrap(), l.guide().unwrap().0];
        assert!([&cache[..], &guide].concat() == of_both && guide.len() > 2000, "{} bytes", guide.len());
        l.load_statistics(&of_cache).unwrap();
        assert!(l.saved() == Some(of_cache.clone()) && l.guide().unwrap().0 == guide, "the guide is as before");
        l.load_statistics(&of_guide).unwrap();
        assert!(l.saved() == Some(of_cache.clone()) && l.guide().unwrap().0 == of_guide, "the cache is as before");
        l.merge_statistics(&of_both).unwrap();
        let merged = l.guide().unwrap().0;
        assert!(merged.len() >= guide.len().max(of_guide.len()) && l.saved() != Some(of_cache.clone()));
        assert!(merged != guide && merged != of_guide && l.saved() != Some(cache), "added, not replaced");
    });
    with_session(&scene, &cache_alone, &mut |l| {
        l.load_statistics(&of_both).unwrap();
        assert!(l.saved().unwrap()[..] == of_both[..l.saved().unwrap().len()]);
        assert_eq!(l.load_statistics(&of_guide), Err(CacheError::Absent));
    });
    with_session(&scene, &guide_alone, &mut |l| {
        l.load_statistics(&of_both).unwrap();
        assert!(of_both.ends_with(&l.guide().unwrap().0));
        assert_eq!(l.load_statistics(&of_cache), Err(CacheError::Absent));
    });
    with_session(&scene, &learns(&scene, "classic", Guiding::Off), &mut |l| {
        assert_eq!((l.saved_statistics(), l.load_statistics(&of_both)), (None, Err(CacheError::Absent)));
    });
}

/// Bytes that are damaged anywhere change nothing. Killed by: a cache that is loaded before the guide is checked, bytes
/// behind the last part.
#[test]
fn damaged_statistics_change_nothing() {
    let scene = blob(&cornell([16, 16]));
    let s = learns(&scene, "ears", Guiding::On);
    let bytes = taught(&scene, &s);
    with_session(&scene, &s, &mut |l| {
        let before = l.saved_statistics();
        let (cache, guide) = bytes.split_at(bytes.len() - guide_len(&scene, &s, &bytes));
        let swapped = [guide, cache].concat();
        let (twice, longer) = ([cache, cache].concat(), [&bytes[..], &[0; 8]].concat());
        let mut bad: Vec<Vec<u8>> = vec![swapped, twice, longer, vec![], b"CRPGUIDE".to_vec(), vec![7; 100]];
        for at in (0..bytes.len()).step_by(bytes.len() / 50).chain([cache.len(), cache.len() + 70]) {
            let mut flipped = bytes.clone();
            flipped[at] ^= 0x40;
            bad.push(flipped);
            // a cache alone is whole
            if at != cache.len() {
                bad.push(bytes[..at].to_vec());
            }
        }
        for bad in &bad {
            assert!(l.load_statistics(bad).is_err() && l.merge_statistics(bad).is_err(), "{} bytes", bad.len());
        }
        assert_eq!(l.load_statistics(&[7; 100]), Err(CacheError::Magic(0x0707_0707_0707_0707)));
        assert_eq!(l.load_statistics(b"CRP"), Err(CacheError::Length { needed: 64, given: 3 }));
        let mut newer = bytes.clone();
        newer[cache.len() + 16] = 9;
        let e = l.load_statistics(&newer).unwrap_err();
        assert!(e.to_string().ends_with("version 9, only 3 is known"), "{e}");
        assert!(l.saved_statistics() == before);
    });
}

/// Length of the guide in saved bytes.
fn guide_len(scene: &[u8], s: &Settings, bytes: &[u8]) -> usize {
    let mut len = 0;
    with_session(scene, s, &mut |l| {
        l.load_statistics(bytes).unwrap();
        len = l.guide().unwrap().0.len();
    });
    len
}

/// A guide that has too little room for a saved one takes what fits, and is not refused. Killed by: a guide that stays
/// empty.
#[test]
fn small_guides_take_what_fits() {
    let scene = blob(&cornell([16, 16]));
    let s = learns(&scene, "ears", Guiding::On);
    let bytes = taught(&scene, &s);
    let whole = guide_len(&scene, &s, &bytes);
    let mut small = s;
    small.learning.guide_bytes = 10 << 10;
    with_session(&scene, &small, &mut |l| {
        l.load_statistics(&bytes).unwrap();
        // an empty one has 464 bytes
        let guide = l.guide().unwrap().0.len();
        assert!(1000 < guide && guide < 10 << 10 && 10 << 10 < whole, "{guide} of {whole} bytes");
    });
}
