//! Path guiding changes efficiency only: equivalence tests (TOST) against renders without it, whatever its trees hold;
//! the same bits for any schedule.
//!
//! As in `learn_unbiased.rs`: equal is a difference within 0.3 % of the mean with 95 % confidence from both sides,
//! standard errors are asserted to be below 0.09 %. A bias of 0.3 % passes with a probability of 5 %, one of 0.45 %
//! with less than 1e-4. The scene with caustics has 1 % in place of 0.3 %, and three times the rest.

use croupier::unstable::Sampler;
use croupier::unstable::learn::Guiding;
use croupier::unstable::learn::guiding::{Guide, GuideLog, GuideSize};
use croupier::{Scene, Settings};
use croupier_host::blob::AlignedBytes;
use croupier_tests::runner::{Image, Learned, Schedule, doubling, learning, scheduled, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::{SplitMix, equivalent};

/// Half-width of what counts as equal, relative to the mean.
const DELTA: f64 = 0.003;
/// The same where caustics are found by chance alone.
const CAUSTICS: f64 = 0.01;
/// Standard error that renders aim at, over that width.
const TARGET: f64 = 0.2;
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

/// Guiding of some blocks of pixels, and of no others unless it pays there, by adversarial guides. Killed by: a choice of
/// pixels that goes with what they find, weights of samples that are not guided by a mixture's density.
#[test]
fn watched_guides_do_not_bias() {
    let scene = blob(&cornell([32, 32]));
    let reference = run(&scene, &plain(&guided(&scene, "none", 5)), &mut |_, _| ());
    for strategy in ["classic", "ears"] {
        let mut s = guided(&scene, strategy, 5);
        s.learning.guiding = Guiding::Auto;
        let (mut rng, mut least) = (SplitMix(11), f64::INFINITY);
        let image = run(&scene, &s, &mut |_, l| {
            let u = l.guide_use().expect("a guide that is watched");
            assert!(!u.enabled, "{strategy}: {u:?}");
            least = least.min(u.gain.map_or(f64::INFINITY, |g| g.gain));
            l.load_guide(&adversarial(&scene, &s, 3, &mut rng)).expect("a guide of this scene");
        });
        assert!(least < 0.95, "{strategy}: adversarial guides promise {least}");
        assert_equivalent(&format!("{strategy}, watched"), &image, &reference);
    }
}

/// Where light comes through glass the guide is enabled, and the mean stays. Killed by: a gain that no guide reaches, a
/// decision that goes with the samples of the iteration that it is for.
#[test]
fn guides_that_pay_are_enabled() {
    let scene = blob(&mirror_and_glass());
    let size = [32, 32];
    let reference = run_to(CAUSTICS, &scene, &Settings { size, ..plain(&guided(&scene, "none", 6)) }, &mut |_, _| ());
    let mut s = Settings { size, ..guided(&scene, "ears", 6) };
    (s.shadow_roulette, s.learning.guiding) = (true, Guiding::Auto);
    let (mut enabled, mut last) = (0, None);
    // what the mean needs is too few to find out: with some seeds it takes more than 4,000 samples per pixel
    let image = learning(&scene, &s, &doubling(16_000), IN_ORDER, &mut |_, l| {
        last = l.guide_use();
        enabled += u32::from(last.is_some_and(|u| u.enabled));
    });
    println!("enabled after {enabled} iterations, {last:?}");
    assert!(enabled >= 5, "{last:?}");
    assert_within(CAUSTICS, "ears, guided where it pays", &image, &reference);
}

/// Sobol' points, whose hashed lanes draw other blocks of numbers. Killed by: leaves that go with the light sample's
/// numbers.
#[test]
fn guided_renders_with_sobol_points_agree_with_others() {
    let scene = blob(&cornell([12, 12]));
    let reference = run(&scene, &plain(&guided(&scene, "none", 6)), &mut |_, _| ());
    let s = Settings { sampler: Sampler::Sobol, ..guided(&scene, "ears", 6) };
    let mut rng = SplitMix(7);
    let image = run(&scene, &s, &mut |_, l| {
        l.load_guide(&adversarial(&scene, &s, 2, &mut rng)).expect("a guide of this scene");
    });
    assert_equivalent("Sobol' points", &image, &reference);
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
