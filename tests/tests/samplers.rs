//! The Sobol' sampler gives the pictures of hashed numbers, with less noise; its halves are independent.

use croupier::unstable::Sampler;
use croupier::unstable::profile::{Custom, Profile, WithoutSobol};
use croupier::unstable::{Effects, learn::ControlVariate};
use croupier::{Plan, Scene, Session, SessionError, Settings};
use croupier_tests::media_scene::misty;
use croupier_tests::runner::{Image, Schedule, memory, scheduled, settings};
use croupier_tests::scenes::{blob, cornell, everything, glowing_box};
use croupier_tests::stats::{Mean, equivalent};

/// Half-width of what counts as equal, relative to the mean.
const DELTA: f64 = 0.004;

fn renders(scene: &[u8], settings: &Settings, iterations: &[u32], seeds: std::ops::Range<u64>) -> Vec<Image> {
    let one = |seed| scheduled(scene, &Settings { seed, ..*settings }, iterations, Schedule::InOrder(1 << 20));
    seeds.map(one).collect()
}

/// Mean of the pictures' means, and its standard error from how they differ: samples of a pixel are not independent.
fn mean(images: &[Image]) -> (f64, f64) {
    let mut sum = Mean::default();
    images.iter().for_each(|i| sum.add(i.mean()));
    (sum.mean(), sum.error())
}

/// Variance of pixels between pictures.
fn variance(images: &[Image]) -> f64 {
    let n = images.len() as f64;
    let of = |i: usize, c: usize| {
        let mean = images.iter().map(|k| k.pixels[i].mean()[c]).sum::<f64>() / n;
        images.iter().map(|k| (k.pixels[i].mean()[c] - mean).powi(2)).sum::<f64>() / (n - 1.0)
    };
    (0..images[0].pixels.len()).flat_map(|i| (0..3).map(move |c| (i, c))).map(|(i, c)| of(i, c)).sum()
}

/// Equivalence (TOST) of the mean with that of hashed numbers without roulette: differences up to 0.4 % with 95 %
/// confidence from both sides, whose standard errors are below 0.12 %. Box, every material and light with a lens,
/// media; roulette, splitting with siblings, everything that is learned. Killed by: coordinates of one block that are
/// used twice, siblings that repeat a point (their mean stays, so that the test of variance below has them), a shuffle
/// that is no permutation, light chosen and placed by one coordinate, a flag that makes a bit of a random number
/// constant.
#[test]
fn the_mean_is_that_of_hashed_numbers() {
    for (name, scene, depth) in
        [("cornell", cornell([12, 12]), 5), ("everything", everything([16, 12]), 6), ("misty", misty([16, 12]), 5)]
    {
        let scene = blob(&scene);
        let base = Settings { max_depth: depth, ..settings(&scene, "none") };
        let (wanted, error) = mean(&renders(&scene, &base, &[512], 0..32));
        for (strategy, all, iterations) in [
            ("none", false, &[1, 3, 60, 64][..]),
            ("fixed:0.7", false, &[128]),
            ("fixed:2.3", false, &[32]),
            ("ears", true, &[1, 2, 5, 24, 32]),
        ] {
            let mut s = Settings { sampler: Sampler::Sobol, strategy: settings(&scene, strategy).strategy, ..base };
            s.learning.subdivide_count = 500.0;
            if all {
                (s.adaptive, s.shadow_roulette, s.control_variate) = (true, true, ControlVariate::Cached);
            }
            let (found, more) = mean(&renders(&scene, &s, iterations, 100..200));
            let (difference, error) = ((found - wanted) / wanted, error.hypot(more) / wanted);
            println!("{name}, {strategy}: {:+.3} % +- {:.3} %", 100.0 * difference, 100.0 * error);
            assert!(error < 0.0012, "{name}, {strategy}: the standard error of {error} is too large for the test");
            let equal = equivalent(difference, error, DELTA, 0.05);
            assert!(equal, "{name}, {strategy}: differs by {difference} +- {error}");
        }
    }
}

/// A closed box that glows: radiance 1 / (1 - 0.5) less what the last segments would have brought, whatever the pixel,
/// with roulette and splitting. Killed by: numbers in [0, 1] that never come near 1, a weight that is lost.
#[test]
fn a_glowing_box_has_its_radiance() {
    let scene = blob(&glowing_box(0.5, 1.0, [8, 8]));
    let base = Settings { max_depth: 9, sampler: Sampler::Sobol, ..settings(&scene, "none") };
    let expected: f64 = (0..9).map(|k| 0.5f64.powi(k)).sum();
    for strategy in ["none", "fixed:1.5", "fixed:0.8"] {
        let s = Settings { strategy: settings(&scene, strategy).strategy, ..base };
        let (found, error) = mean(&renders(&scene, &s, &[1, 64, 64], 0..24));
        assert!(
            (found - expected).abs() < 5.0 * error + 1e-5 * expected,
            "{strategy}: {found} +- {error}, not {expected}"
        );
    }
}

/// In a box 64 samples of one iteration have at most two thirds of the variance of hashed numbers, and one sample has
/// the same (within 15 %). Splitting: siblings do not repeat each other, so that 3 of them are better than one. Killed
/// by: a sequence that is not carried to the vertices, samples of a pixel that repeat a point, siblings that are
/// copies.
#[test]
fn variance_falls() {
    let scene = blob(&cornell([12, 12]));
    let of = |strategy: &str, sampler, n: u32, runs: u64| {
        let s = Settings { max_depth: 4, sampler, ..settings(&scene, strategy) };
        variance(&renders(&scene, &s, &[n], 0..runs))
    };
    let ratio =
        |strategy: &str, n, runs| of(strategy, Sampler::Sobol, n, runs) / of(strategy, Sampler::Hashed, n, runs);
    let (many, one) = (ratio("none", 64, 60), ratio("none", 1, 400));
    println!("variance over that of hashed numbers: {many} with 64 samples, {one} with one");
    assert!(many < 0.67, "64 samples: {many}");
    assert!((0.85..1.15).contains(&one), "one sample: {one}");
    let split = of("fixed:3", Sampler::Sobol, 16, 100) / of("none", Sampler::Sobol, 16, 100);
    assert!(split < 0.6, "3 siblings have {split} times the variance of one sample");
}

/// Kernels without the sampler refuse settings that call for it, and nothing else. Killed by: a profile that renders
/// hashed numbers without a word.
#[test]
fn profiles_without_it_refuse_it() {
    fn session<P: Profile>(bytes: &[u8], sampler: Sampler) -> Result<(), SessionError> {
        let scene = Scene::from_bytes(bytes).unwrap();
        let plan = Plan::new(&Settings { sampler, ..Settings::for_scene(&scene) }).unwrap();
        let mut block = memory(plan.session().size, 0);
        Session::builder(scene).profile::<P>().build(&plan, block.as_mut()).map(|_| ())
    }
    type Own = Custom<{ Effects(u32::MAX).0 }>;
    let bytes = blob(&cornell([4, 4]));
    let refused = SessionError::Sampler { missing: Sampler::Sobol };
    assert!(refused.to_string().contains("sobol"));
    assert_eq!(session::<WithoutSobol<Own>>(&bytes, Sampler::Sobol), Err(refused));
    for found in [
        session::<WithoutSobol<Own>>(&bytes, Sampler::Hashed),
        session::<Own>(&bytes, Sampler::Sobol),
        session::<croupier::unstable::profile::Full>(&bytes, Sampler::Sobol),
    ] {
        assert_eq!(found, Ok(()));
    }
}
