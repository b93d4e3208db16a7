//! Learning does not bias: equivalence tests (TOST) of strategies that learn, of their settings and of arbitrary
//! statistics, against renders without roulette and against known radiance.
//!
//! As in `unbiased.rs`: equal is a difference within 0.2 % of the mean with 95 % confidence from both sides, standard
//! errors are asserted to be below 0.06 %. A bias of 0.2 % passes with a probability of 5 %, one of 0.3 % with less
//! than 1e-4. Here the iterations of a render are not independent; where that may matter the error comes from renders
//! with different seeds.

use croupier::unstable::film::{PixelAov, PixelStats};
use croupier::unstable::learn::{ControlVariate, Learning, Objective, PixelEstimator};
use croupier::unstable::rrs::Norm;
use croupier::{Settings, Strategy};
use croupier_host::builtin;
use croupier_host::description::*;
use croupier_tests::runner::{Image, Learned, Schedule, doubling, learning, poison, render, scheduled, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::{Mean, SplitMix, equivalent};

/// Half-width of what counts as equal, relative to the mean.
const DELTA: f64 = 0.002;

/// Standard error that renders aim at, relative to the mean.
const TARGET: f64 = 0.00045;

const IN_ORDER: Schedule = Schedule::InOrder(1 << 20);

/// A mean and its standard error.
#[derive(Clone, Copy, Debug)]
struct Known {
    mean: f64,
    error: f64,
}

impl Known {
    fn of(image: &Image) -> Self {
        assert_eq!(image.counters.non_finite, 0);
        Self { mean: image.mean(), error: image.error_of_mean() }
    }

    fn over(means: impl Iterator<Item = f64>) -> Self {
        let mut m = Mean::default();
        means.for_each(|x| m.add(x));
        Self { mean: m.mean(), error: m.error() }
    }
}

#[track_caller]
fn assert_equivalent(what: &str, a: Known, b: Known) {
    let (d, error) = ((a.mean - b.mean) / b.mean, a.error.hypot(b.error) / b.mean);
    println!("{what}: {:+.4} % +- {:.4} %", 100.0 * d, 100.0 * error);
    assert!(error < 0.0006, "{what}: the standard error of {error} is too large for the test");
    assert!(equivalent(d, error, DELTA, 0.05), "{what}: differs by {d} +- {error}");
}

/// Statistics of a size that suits small pictures.
fn learns(scene: &[u8], strategy: &str, max_depth: u32) -> Settings {
    let s = settings(scene, strategy);
    let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 2000.0, ..s.learning };
    Settings { max_depth, learning, ..s }
}

/// As many samples as [`TARGET`] takes, by a pilot with another seed.
fn run(scene: &[u8], s: &Settings) -> Image {
    let pilot = scheduled(scene, &Settings { seed: s.seed + 100, ..*s }, &doubling(504), IN_ORDER);
    let spp = 504.0 * (pilot.error_of_mean() / pilot.mean() / TARGET).powi(2);
    scheduled(scene, s, &doubling((spp as u32).clamp(504, 60_000)), IN_ORDER)
}

/// Every strategy but the biased one, with the options that matter.
fn strategies() -> Vec<String> {
    let options: &[(&str, &[&str])] = &[
        ("throughput", &["", ":luminance", ":mean:0.1:3:2"]),
        ("albedo", &["", ":product"]),
        ("classic", &["", ":1", ":5:relative", ":1:relative"]),
        ("winners", &["", ":0.3:1"]),
        ("bolin-meyer", &["", ":plain"]),
        ("ear", &["", ":plain"]),
        ("ears", &["", ":plain"]),
        ("fixed", &[":0.7", ":1.5"]),
    ];
    let of = |name: &'static str| options.iter().find(|o| o.0 == name).map_or(&[""][..], |o| o.1);
    let names = Strategy::TABLE.iter().map(|t| t.0).filter(|n| *n != "threshold");
    names.flat_map(|n| of(n).iter().map(move |o| format!("{n}{o}"))).collect()
}

/// In a closed box that glows radiance is L / (1 - rho) everywhere; paths never find a way out, so every factor counts.
/// Killed by: weights over n, a sample counted into the pixel twice, iterations of unequal weight that are not divided
/// by it.
#[test]
fn closed_boxes_have_their_radiance() {
    let scene = blob(&glowing_box(0.5, 1.0, [8, 8]));
    for strategy in strategies() {
        // what is cut off is known; splitting everywhere needs a short end
        let depth = match strategy.as_str() {
            "fixed:1.5" => 7,
            // the factors of its paths fall faster than their light: the variance grows with every segment
            "albedo:product" => 4,
            // splits more and more while that makes the pixel's own spread, which is 0, the only error
            "bolin-meyer" | "bolin-meyer:plain" => 3,
            _ => 24,
        };
        let s = Settings { adaptive: strategy == "ears", ..learns(&scene, &strategy, depth) };
        let image = run(&scene, &s);
        let expected = 2.0 * (1.0 - 0.5f64.powi(depth as i32));
        assert_equivalent(&strategy, Known::of(&image), Known { mean: expected, error: 0.0 });
    }
}

/// Killed by: factors that depend on the sample's own future, statistics that change within an iteration.
#[test]
fn strategies_that_learn_agree_with_none() {
    let scene = blob(&cornell([16, 16]));
    let none = Known::of(&render(&scene, &Settings { seed: 1, ..learns(&scene, "none", 40) }, 9000));
    for strategy in [
        "classic:5:relative",
        "classic:1:relative",
        "winners",
        "bolin-meyer",
        "adrr",
        "adrrs",
        "ear",
        "ear:plain",
        "ears",
        "ears:plain",
    ] {
        let s = Settings { seed: 2, ..learns(&scene, strategy, 40) };
        assert_equivalent(strategy, Known::of(&run(&scene, &s)), none);
    }
}

/// All materials under a smooth environment, for strategies that key statistics by material and direction. Killed by: a
/// value that is scaled by the albedo and not scaled back in the pixel, a class of vertices whose record is closed
/// twice.
#[test]
fn strategies_that_learn_agree_on_all_materials() {
    let scene = blob(&soft(everything([16, 12])));
    let none = Known::of(&render(&scene, &Settings { seed: 3, ..learns(&scene, "none", 9) }, 6000));
    for strategy in ["adrrs", "ear", "ears", "ears:plain", "winners"] {
        let s = Settings { seed: 4, ..learns(&scene, strategy, 9) };
        assert_equivalent(strategy, Known::of(&run(&scene, &s)), none);
    }
}

/// A floor under a point light, between two mirrors or panes of glass that show nothing but a dim environment: all
/// vertices of depth 2 are on a surface whose lobes are deltas, and paths end at depth 3. Learned roulette terminates
/// most of them; the mean stays. Killed by: delta surfaces with a factor of 1 always, termination there without a
/// weight.
#[test]
fn mirrors_and_glass_play_learned_roulette() {
    let mirror = Model::Mirror { reflectance: Reflectance::Constant([1.0; 3]) };
    for (what, model) in [("mirror", mirror), ("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 })] {
        let mut s = in_white_environment(camera([0.0, 0.6, 0.8], [0.0; 3], 5.0, [16, 16]));
        s.environment = Some(Environment::Constant { radiance: [0.03; 3] });
        let [floor, side] = [grey(0.8), model].map(|m| s.add_material(what, m));
        add_quad(&mut s, "floor", floor, facing_y(0.3, 0.0, 1.0));
        for x in [-0.5f32, 0.5] {
            let z = 1.0f32.copysign(x);
            add_quad(&mut s, "side", side, [[x, -0.3, -z], [x, -0.3, z], [x, 0.3, z], [x, 0.3, -z]]);
        }
        // the lower one contributes nothing: noise beside which the sides do not matter
        for (y, intensity) in [(1.0, 1.0), (-1.0, 0.25)] {
            s.emitters.push(Emitter::Point { position: [0.0, y, 0.0], intensity: [intensity; 3] });
        }
        let scene = blob(&s);
        let none = Known::of(&render(&scene, &Settings { seed: 15, ..learns(&scene, "none", 3) }, 14_000));
        for strategy in ["adrrs", "ears"] {
            let s = Settings { seed: 17, aovs: true.into(), ..learns(&scene, strategy, 3) };
            let image = scheduled(&scene, &s, &doubling(7000), IN_ORDER);
            let sum = |of: fn(&PixelAov) -> f64| image.aovs.iter().map(of).sum::<f64>();
            let vertices = sum(|a| a.vertices[1]);
            let [first, delta] = [sum(|a| a.factor[0]) / sum(|a| a.vertices[0]), sum(|a| a.factor[1]) / vertices];
            let killed = image.counters.paths_terminated as f64 / vertices;
            println!(
                "{what}, {strategy}: factors {first:.3} and {delta:.3}, {killed:.3} of the second vertices killed"
            );
            assert!(first > 0.95 && delta < 0.5 && killed > 0.5, "{what}, {strategy}: {first}, {delta}, {killed}");
            assert_equivalent(&format!("{what}, {strategy}"), Known::of(&image), none);
        }
    }
}

/// Without small lights, whose reflections would take hours to average, and without the lens.
fn soft(mut s: SceneDescription) -> SceneDescription {
    s.camera.lens = None;
    s.emitters.clear();
    s.environment = Some(builtin::sky());
    s
}

/// Every choice there is. Killed by: an adaptive pixel whose weight follows its own noise, shadow roulette that divides
/// one of two sums, a control variate that is added without what was rounded away, a bound that lowers n and not s.
#[test]
fn choices_do_not_bias() {
    let scene = blob(&cornell([16, 16]));
    let none = Known::of(&render(&scene, &Settings { seed: 5, ..learns(&scene, "none", 6) }, 30_000));
    let check = |what: &str, strategy: &str, change: &dyn Fn(&mut Settings)| {
        let mut s = Settings { seed: 6, ..learns(&scene, strategy, 6) };
        change(&mut s);
        let image = run(&scene, &s);
        assert_equivalent(&format!("{strategy}, {what}"), Known::of(&image), none);
        image.counters
    };
    let c = check("ring of 16", "ears:plain", &|s| s.ring = 16);
    assert!(c.splits_limited_by_ring > 0);
    let c = check("ledger of 4", "ears", &|s| s.learning.ledger = 4);
    assert!(c.ledger_full > c.samples_logged, "{c:?}");
    check("cache of 32 KiB", "ears", &|s| s.learning.cache_bytes = 32 << 10);
    check("no split budget", "ears:plain", &|s| s.split_budget = 0);
    check("everything small", "ears", &|s| {
        (s.ring, s.learning.ledger, s.learning.cache_bytes, s.learning.pixel_estimator) =
            (16, 4, 20 << 10, PixelEstimator::Blocks);
        (s.adaptive, s.shadow_roulette, s.control_variate) = (true, true, ControlVariate::Cached);
    });
    check("adaptive", "ears", &|s| s.adaptive = true);
    check("adaptive", "none", &|s| s.adaptive = true);
    let c = check("shadow roulette", "ears", &|s| s.shadow_roulette = true);
    assert!(c.shadow_rays_terminated > c.shadow_rays / 50 && c.light_samples_skipped > 5000, "{c:?}");
    check("shadow roulette", "classic", &|s| s.shadow_roulette = true);
    let c = check("shadow roulette", "bolin-meyer", &|s| s.shadow_roulette = true);
    assert!(c.light_samples_skipped > 1000, "{c:?}");
    check("cached control_variate", "ears", &|s| s.control_variate = ControlVariate::Cached);
    check("cached control_variate", "ear:plain", &|s| s.control_variate = ControlVariate::Cached);
    check("control_variate of 0.3", "fixed:0.7", &|s| s.control_variate = ControlVariate::Number(0.3));
    check("control_variate of -0.2", "ears", &|s| s.control_variate = ControlVariate::Number(-0.2));
    check("absolute error", "ears", &|s| s.learning.objective = Objective::Absolute);
    check("blocks", "ears:plain", &|s| s.learning.pixel_estimator = PixelEstimator::Blocks);
    for norm in [Norm::Max, Norm::Luminance] {
        check(&format!("{norm:?}"), "ears:plain", &|s| s.learning.norm = norm);
    }
    check("nothing carried", "ears", &|s| s.learning.decay = 0.0);
    check("all carried", "ears", &|s| s.learning.decay = 1.0);
}

/// Renders of a few samples in several iterations, many of them with different seeds: what depends on an iteration's
/// own noise shows here and not in long renders. Killed by: adaptive counts from the samples that they weigh.
#[test]
fn short_renders_are_unbiased() {
    let scene = blob(&cornell([16, 16]));
    let none = Known::of(&render(&scene, &Settings { seed: 7, ..learns(&scene, "none", 6) }, 12_000));
    for (what, adaptive) in [("ears", false), ("ears, adaptive", true)] {
        let one = |seed: u64| {
            let s = Settings { seed, adaptive, shadow_roulette: adaptive, ..learns(&scene, "ears:plain", 6) };
            let learning = Learning { cache_bytes: 32 << 10, ..s.learning };
            scheduled(&scene, &Settings { learning, ..s }, &[1, 1, 2, 4], IN_ORDER).mean()
        };
        assert_equivalent(what, Known::over((1000..2000).map(one)), none);
    }
}

/// Sixteen pixels with caustics: an iteration that finds one is brighter and noisier than the others. The picture is
/// the mean of the iterations by weight; it must not differ from their mean by number. Killed by: an iteration that is
/// weighted by its own variance (0.9 % too dark here), an adaptive pixel whose later samples have more weight than
/// those that caused them.
#[test]
fn weights_of_iterations_do_not_follow_their_light() {
    let scene = blob(&mirror_and_glass());
    // adaptive counts differ between squares of 8x8 pixels: four of them, and fewer samples
    for (adaptive, size, iterations) in [(false, [4, 4], [4u32, 4, 8, 16]), (true, [16, 16], [2, 2, 2, 4])] {
        let mut difference = Mean::default();
        let mut mean = Mean::default();
        for seed in 0..4000 {
            let mut s = Settings { seed, adaptive, size, ..learns(&scene, "ears", 8) };
            s.learning.cache_bytes = 32 << 10;
            let mut films: Vec<Vec<PixelStats>> = Vec::new();
            let all = [&iterations[..], &[0]].concat();
            let image = learning(&scene, &s, &all, IN_ORDER, &mut |_, l: &mut dyn Learned| films.push(l.pixels()));
            // sums over an iteration, free of its weight
            let brightness = |i: usize| {
                let pixels = films[i].iter().zip(&films[i + 1]);
                let one = |(p, q): (&PixelStats, &PixelStats)| {
                    (0..3).map(|c| q.sum[c] - p.sum[c]).sum::<f64>() / (q.weight - p.weight)
                };
                pixels.map(one).sum::<f64>() / (3 * films[i].len()) as f64
            };
            let samples = f64::from(iterations.iter().sum::<u32>());
            let by_number =
                (0..iterations.len()).map(|i| f64::from(iterations[i]) / samples * brightness(i)).sum::<f64>();
            difference.add(image.mean() - by_number);
            mean.add(by_number);
        }
        let (d, error) = (difference.mean() / mean.mean(), difference.error() / mean.mean());
        println!("adaptive {adaptive}: {:+.4} % +- {:.4} %", 100.0 * d, 100.0 * error);
        assert!(error < 0.0006 && equivalent(d, error, DELTA, 0.05), "adaptive {adaptive}: {d} +- {error}");
    }
}

/// Renders of four samples whose statistics are replaced by random ones before the second iteration, and again before
/// the third: factors of any size next to each other. Killed by: any use of what was learned but as a factor or a
/// control variate.
#[test]
fn random_statistics_do_not_bias() {
    let scene = blob(&cornell([16, 16]));
    let none = Known::of(&render(&scene, &Settings { seed: 8, ..learns(&scene, "none", 3) }, 60_000));
    for (strategy, control_variate, renders) in [
        ("ears:plain", ControlVariate::Off, 900),
        ("ears", ControlVariate::Cached, 1000),
        ("ear:plain", ControlVariate::Off, 1500),
        ("adrrs", ControlVariate::Cached, 1700),
    ] {
        let (mut spread, mut count) = ([0u64; 2], 0);
        let one = |seed: u64| {
            let mut s = Settings { seed, control_variate, ..learns(&scene, strategy, 3) };
            s.learning.cache_bytes = 32 << 10;
            let mut rng = SplitMix(seed);
            let image = learning(&scene, &s, &[1, 1, 2], IN_ORDER, &mut |i, l: &mut dyn Learned| {
                if i > 0 {
                    poison(l, &mut rng);
                }
            });
            let c = image.counters;
            spread[0] += c.splits;
            spread[1] += c.paths_terminated;
            count += c.camera_samples;
            image.mean()
        };
        let known = Known::over((0..renders).map(one));
        println!("{strategy}: {} splits, {} kills of {count}", spread[0], spread[1]);
        assert!(spread[1] > count / 20 && (strategy.starts_with("ear:") || spread[0] > count / 10));
        assert_equivalent(&format!("{strategy} with random statistics"), known, none);
    }
}

/// Random roulette of next event estimation alone, by visibilities and shares: the other factors stay 1. Killed by: a
/// light sample or its shadow ray that is divided by another probability than it had, or by none, a probability of 0.
#[test]
fn random_nee_roulette_does_not_bias() {
    let scene = blob(&cornell([16, 16]));
    let none = Known::of(&render(&scene, &Settings { seed: 8, ..learns(&scene, "none", 3) }, 60_000));
    let (mut samples, mut light_samples_skipped, mut rays, mut kills) = (0, 0, 0, 0);
    let one = |seed: u64| {
        let mut s = Settings { seed, shadow_roulette: true, ..learns(&scene, "ears", 3) };
        (s.learning.cache_bytes, s.learning.factors) = (32 << 10, [1.0, 1.0]);
        let mut rng = SplitMix(seed);
        let image = learning(&scene, &s, &[1, 3, 4], IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if i > 0 {
                poison(l, &mut rng);
            }
        });
        rays += image.counters.shadow_rays;
        kills += image.counters.shadow_rays_terminated;
        samples += image.counters.vertex_samples;
        light_samples_skipped += image.counters.light_samples_skipped;
        image.mean()
    };
    let known = Known::over((0..18_000).map(one));
    println!("{light_samples_skipped} of {samples} light samples spared, {rays} shadow rays, {kills} spared");
    assert!(kills > rays / 4 && light_samples_skipped > samples / 10);
    assert_equivalent("random roulette of light samples", known, none);
}

/// A random estimate of the pixels from the host. Killed by: an estimate that gets into the film.
#[test]
fn random_estimates_do_not_bias() {
    let scene = blob(&cornell([16, 16]));
    let none = Known::of(&render(&scene, &Settings { seed: 9, ..learns(&scene, "none", 5) }, 9000));
    for adaptive in [false, true] {
        let s = Settings { seed: 10, adaptive, shadow_roulette: true, ..learns(&scene, "ears:plain", 5) };
        let mut rng = SplitMix(11);
        let image = learning(&scene, &s, &doubling(9000), IN_ORDER, &mut |i, l: &mut dyn Learned| {
            let bad = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e30];
            let bad = if i == 1 { &bad[..] } else { &[] };
            let mut value = |i: usize| bad.get(i).copied().unwrap_or_else(|| rng.range(-2.5, 0.0).exp() as f32);
            let rgb: Vec<[f32; 3]> = (0..256).map(|i| [(); 3].map(|()| value(i))).collect();
            l.give(&rgb).unwrap();
        });
        assert_equivalent(&format!("random estimates, adaptive {adaptive}"), Known::of(&image), none);
    }
}

/// A cache saved in the middle of one render goes on in another. Killed by: loaded statistics that count as samples.
#[test]
fn loaded_statistics_do_not_bias() {
    let scene = blob(&cornell([16, 16]));
    let none = Known::of(&render(&scene, &Settings { seed: 12, ..learns(&scene, "none", 6) }, 30_000));
    let s = Settings { seed: 13, shadow_roulette: true, ..learns(&scene, "ears", 6) };
    let mut bytes = None;
    learning(&scene, &s, &[32, 32, 1], IN_ORDER, &mut |_, l: &mut dyn Learned| bytes = l.saved());
    let bytes = bytes.unwrap();
    let image =
        learning(&scene, &Settings { seed: 14, ..s }, &doubling(6000), IN_ORDER, &mut |i, l: &mut dyn Learned| {
            if i % 2 == 0 {
                l.load(&bytes).unwrap();
            }
        });
    assert_equivalent("a loaded cache", Known::of(&image), none);
}
