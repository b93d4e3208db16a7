//! Factors, their rounding and their bounds.

use croupier::unstable::rrs::{COMB_ONE, Learned8, Local8, MAX_FACTOR, MIN_FACTOR, Norm, Strategy, Vertices8, comb};
use croupier::unstable::simd::{F32x8, U32x8, Vec3x8};
use croupier_tests::hard::comb::{exact, sums};
use croupier_tests::stats::SplitMix;

/// Killed by: rounding in f32, `u` drawn per lane from the same word, dividing by n.
#[test]
fn the_comb_is_exact_on_average() {
    let cases: [[f32; 8]; 4] = [
        [0.05, 0.5, 1.0, 1.0 - f32::EPSILON, 1.0 + f32::EPSILON, 2.0, 7.0, 19.0],
        [19.5, 20.0, 0.05, 0.05, 0.05, 0.0, 0.0, 3.3],
        [0.0; 8],
        [0.7, 3.3, 0.25, 0.125, 1.75, 12.5, 0.3, 0.9],
    ];
    for s in cases {
        let (sums, _) = sums(s, 16);
        for (sum, s) in sums.into_iter().zip(s) {
            let mean = sum as f64 / 65536.0;
            // the grid's own discretisation
            assert!((mean - f64::from(s)).abs() <= 2.0 / 65536.0, "{mean} for {s}");
        }
    }
    // on the grid to the last sample
    exact(1, 64, 14).assert_none("counts of the comb");
}

/// Killed by: a comb whose lanes are rounded up independently.
#[test]
fn the_total_never_exceeds_the_sum_by_one() {
    let mut word = 1u32;
    for _ in 0..200_000 {
        let mut next = || {
            word = word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            word
        };
        let s: [f32; 8] = std::array::from_fn(|_| MIN_FACTOR + (next() >> 8) as f32 / 16_777_216.0 * 19.9);
        let exact: f64 = s.iter().map(|&x| (f64::from(x) * COMB_ONE).floor() / COMB_ONE).sum();
        let total: u32 = comb(F32x8::new(s), next()).iter().sum();
        assert!((f64::from(total) - exact).abs() < 1.0, "{total} for {exact}");
    }
}

/// A factor of 1 always gives exactly one sample, whatever the other lanes do.
#[test]
fn one_stays_one() {
    for u in [0, 1, 0x7fff_ffff, 0x8000_0000, u32::MAX] {
        assert_eq!(comb(F32x8::ONE, u), [1; 8]);
        let n = comb(F32x8::new([0.05, 1.0, 19.5, 1.0, 0.3, 1.0, 0.0, 1.0]), u);
        assert_eq!([n[1], n[3], n[5], n[7]], [1; 4]);
    }
}

fn vertices(beta: f32, albedo: f32, depth: u32) -> Vertices8 {
    Vertices8 {
        beta: Vec3x8::splat(beta, 0.5 * beta, 0.0),
        last_weight: Vec3x8::splat(beta, beta, beta),
        albedo: Vec3x8::splat(albedo, albedo, albedo),
        albedo_product: F32x8::splat(0.5),
        depth: U32x8::splat(depth),
        shininess: F32x8::ZERO,
        learned: Learned8::NONE,
    }
}

fn factor(strategy: &str, beta: f32, albedo: f32, depth: u32) -> f32 {
    Strategy::parse(strategy).unwrap().factor(&vertices(beta, albedo, depth)).lane(3)
}

/// Each strategy's rule, by hand.
#[test]
fn strategies_follow_their_rules() {
    assert_eq!(factor("none", 0.01, 0.5, 9), 1.0);
    assert_eq!(factor("threshold:0.1", 0.2, 0.5, 1), 1.0);
    assert_eq!(factor("threshold:0.1", 0.05, 0.5, 1), 0.0);
    assert_eq!(factor("contribution", 0.25, 0.5, 1), 0.25);
    assert_eq!(factor("contribution", 4.0, 0.5, 1), 1.0);
    assert_eq!(factor("throughput", 0.25, 0.5, 1), 0.25);
    assert_eq!(factor("throughput", 4.0, 0.5, 1), 0.95);
    assert_eq!(factor("throughput", 0.001, 0.5, 1), 0.05);
    assert_eq!(factor("throughput:mean", 0.5, 0.5, 1), 0.25);
    assert!((factor("throughput:luminance", 0.5, 0.5, 1) - 0.285_125).abs() < 1e-5);
    assert_eq!(factor("throughput:max:0.1:0.5:3", 0.25, 0.5, 2), 1.0);
    assert_eq!(factor("throughput:max:0.1:0.5:3", 0.75, 0.5, 3), 0.5);
    assert_eq!(factor("albedo", 0.25, 0.5, 1), 0.5);
    assert_eq!(factor("albedo:product", 0.25, 0.5, 1), 0.25);
    assert_eq!(factor("classic", 0.5, 0.5, 4), 1.0);
    assert_eq!(factor("classic", 0.5, 0.5, 5), 0.25);
    assert_eq!(factor("classic:2", 8.0, 0.5, 2), 1.0);
    assert_eq!(factor("fixed:3.3", 0.5, 0.5, 1), 3.3);
}

/// "Go with the winners": throughput x albedo x sqrt(VR + VV / (shininess + 1)^2). Killed by: a variance in place of
/// its root, the shininess unsquared, a factor held to 1.
#[test]
fn winners_follow_their_rule() {
    let winners = |options: &str, beta: f32, shininess: f32| {
        let v = Vertices8 { shininess: F32x8::splat(shininess), ..vertices(beta, 0.5, 1) };
        Strategy::parse(&format!("winners{options}")).unwrap().factor(&v).lane(0)
    };
    // a diffuse surface: sqrt(1 + 3) = 2
    assert_eq!(winners("", 0.5, 0.0), 0.5);
    assert_eq!(winners("", 2.0, 0.0), 2.0);
    // (1 + 1)^2 = 4: sqrt(1 + 3 / 4)
    assert!((winners("", 1.0, 1.0) - 0.5 * 1.75f32.sqrt()).abs() < 1e-6);
    // a mirror reflects one direction: only the reflected light varies
    assert!((winners("", 1.0, 1e4) - 0.5).abs() < 1e-6);
    assert_eq!(winners(":4:0", 1.0, 7.0), 1.0);
    assert_eq!(winners(":0:16", 1.0, 1.0), 1.0);
}

/// Killed by: a relative rule without the root of the error weight, one that looks at the wrong option.
#[test]
fn relative_classic_is_over_the_pixel() {
    // the pixel is 1/4: error weight 16
    let learned = Learned8 { error_weight: Vec3x8::splat(16.0, 4.0, 1.0), ..Learned8::NONE };
    let at = |text: &str, beta: f32, depth: u32| {
        let v = Vertices8 { learned, ..vertices(beta, 0.5, depth) };
        Strategy::parse(text).unwrap().factor(&v).lane(0)
    };
    assert_eq!(at("classic:5:relative", 0.25, 5), 0.5);
    assert_eq!(at("classic:5:relative", 0.25, 4), 1.0);
    assert_eq!(at("classic:5:relative", 8.0, 5), 1.0);
    assert_eq!(at("classic:5", 0.25, 5), 0.125);
    assert_eq!(at("classic:2:relative", 0.125, 2), 0.25);
}

/// A vertex of weight 1 whose bin has been learned so well that nothing is blended in.
fn learned(mean: f32, moment: f32, variance: f32, cost: f32) -> Vertices8 {
    let grey = |x: f32| Vec3x8::splat(x, x, x);
    let learned = Learned8 {
        error_weight: Vec3x8::ONE,
        norm: Norm::Mean,
        cost_over_variance: F32x8::ONE,
        local: Local8 {
            mean: grey(mean),
            moment: grey(moment),
            variance: grey(variance),
            cost: F32x8::splat(cost),
            nee_share: F32x8::ONE,
            count: F32x8::splat(1e12),
        },
    };
    Vertices8 { beta: grey(1.0), albedo: grey(0.5), learned, ..vertices(1.0, 0.5, 1) }
}

fn with(strategy: &str, v: &Vertices8) -> f32 {
    Strategy::parse(strategy).unwrap().factor(v).lane(6)
}

/// Eq. 27: roulette by the moment if that says so; splitting by the variance if both say so; else neither. Killed by:
/// splitting by the moment, roulette by the variance, a NaN or infinity that becomes the largest factor (NUMERICS
/// RRS-3, RRS-4).
#[test]
fn moment_and_variance_decide_together() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    // factors are the roots of these
    for (moment, variance, ears, ear) in [
        (0.25, 0.25, 0.5, 0.5),
        (0.25, 4.0, 0.5, 0.5),
        (0.25, 0.0, 0.5, 0.5),
        (1.0, 0.25, 1.0, 1.0),
        (1.0, 4.0, 1.0, 1.0),
        (4.0, 0.25, 1.0, 1.0),
        (4.0, 1.0, 1.0, 1.0),
        (4.0, 2.25, 1.5, 1.0),
        (4.0, 4.0, 2.0, 1.0),
        (4.0, 0.0, 1.0, 1.0),
        (1e9, 1e8, MAX_FACTOR, 1.0),
        (0.0, 0.0, MIN_FACTOR, MIN_FACTOR),
        (1e-9, 1e-9, MIN_FACTOR, MIN_FACTOR),
        // not decidable: neither roulette nor splitting
        (nan, nan, 1.0, 1.0),
        (inf, inf, 1.0, 1.0),
        (inf, 0.25, 1.0, 1.0),
        (inf, nan, 1.0, 1.0),
        (4.0, nan, 1.0, 1.0),
        (4.0, inf, 1.0, 1.0),
        (0.25, nan, 0.5, 0.5),
        (0.25, inf, 0.5, 0.5),
    ] {
        let v = learned(0.5, moment, variance, 1.0);
        assert_eq!(with("ears:plain", &v), ears, "ears, moment {moment}, variance {variance}");
        assert_eq!(with("ear:plain", &v), ear, "ear, moment {moment}, variance {variance}");
        if !moment.is_finite() && !variance.is_finite() {
            assert_eq!([with("ears", &v), with("ear", &v)], [1.0; 2], "moment {moment}, variance {variance}");
        }
        if moment.is_finite() && variance.is_finite() {
            let s = with("bolin-meyer:plain", &v);
            assert_eq!(s, ears, "bolin-meyer, moment {moment}, variance {variance}");
        }
    }
}

/// `ears` splits into the number of samples that minimises V / k + price x k, by search: k + 1 from s^2 = k (k + 1) on.
/// Killed by: factors that are rounded to the nearest or down, whole numbers for roulette or for the paper's rule.
#[test]
fn splits_are_whole_numbers_of_samples() {
    let squares = (1..=19).flat_map(|k| [0.99, 1.01].map(|x| x * (k * (k + 1)) as f32));
    for square in squares.chain([1.0, 1.5, 3.0, 4.0, 5.0, 100.0]) {
        let v = learned(0.5, square, square, 1.0);
        let costs = |k: &u8| f64::from(square) / f64::from(*k) + f64::from(*k);
        let best = (1..=20u8).min_by(|a, b| costs(a).total_cmp(&costs(b))).unwrap();
        assert_eq!(with("ears", &v), f32::from(best), "a factor whose square is {square}");
        let papers = with("ears:plain", &v) / square.sqrt().min(MAX_FACTOR);
        assert!((papers - 1.0).abs() < 1e-6, "the paper's, of {square}: {papers} times its root");
    }
    let s = with("ears", &learned(0.25, 0.25, 0.25, 1.0));
    assert!((s - 0.5).abs() < 1e-3, "roulette stays what it is: {s}");
}

/// Eq. 32: s = sqrt(norm(beta^2 x error weight x moment) x C / V / c). Killed by: a weight unsquared, the cost upside
/// down, an error weight per colour that is averaged first.
#[test]
fn factors_are_the_most_efficient_ones() {
    let base = learned(0.5, 0.25, 0.25, 1.0);
    let change = |f: &dyn Fn(&mut Vertices8)| {
        let mut v = base;
        f(&mut v);
        with("ears:plain", &v)
    };
    assert_eq!(change(&|_| ()), 0.5);
    assert_eq!(change(&|v| v.beta = v.beta * 0.5), 0.25);
    assert_eq!(change(&|v| v.learned.local.cost = F32x8::splat(4.0)), 0.25);
    assert_eq!(change(&|v| v.learned.cost_over_variance = F32x8::splat(4.0)), 1.0);
    assert_eq!(change(&|v| v.learned.error_weight = v.learned.error_weight * 4.0), 1.0);
    // (1 + 4 x 2 + 0) / 3 of a moment of 0.25
    let colours = |v: &mut Vertices8| {
        v.beta = Vec3x8::splat(1.0, 2.0, 0.0);
        v.learned.error_weight = Vec3x8::splat(1.0, 2.0, 5.0);
    };
    assert!((change(&colours) - 0.75f32.sqrt()).abs() < 1e-6);
    let by = |norm: Norm| {
        change(&|v| {
            colours(v);
            v.learned.norm = norm;
        })
    };
    assert!((by(Norm::Max) - 2f32.sqrt()).abs() < 1e-6);
    assert!((by(Norm::Luminance) - (0.25 * (0.2126f32 + 8.0 * 0.7152)).sqrt()).abs() < 1e-4);
}

/// Nothing known is `classic`, much known is the rule itself. Killed by: an empty bin that terminates paths (STA-5),
/// ignorance of the picture taken for a picture without variance, confidence that shrinks with the samples.
#[test]
fn ignorance_is_classic() {
    for strategy in ["ear", "ears", "ear:plain", "ears:plain", "bolin-meyer", "bolin-meyer:plain"] {
        for depth in [1, 5, 9] {
            let classic = factor("classic", 0.25, 0.5, depth);
            let with = |f: &dyn Fn(&mut Learned8)| {
                let mut l = learned(0.5, 1e-6, 1e-6, 1.0).learned;
                f(&mut l);
                with(strategy, &Vertices8 { learned: l, ..vertices(0.25, 0.5, depth) })
            };
            assert_eq!(with(&|l| l.local.count = F32x8::ZERO), classic, "{strategy}: an empty bin");
            assert_eq!(with(&|l| l.cost_over_variance = F32x8::ZERO), classic, "{strategy}: no picture");
            assert!(with(&|_| ()) < 0.06, "{strategy} knows that nothing is there");
        }
    }
    for strategy in ["adrr", "adrrs"] {
        let mut empty = learned(0.5, 1.0, 1.0, 1.0).learned;
        empty.local.count = F32x8::ZERO;
        let v = Vertices8 { learned: empty, ..vertices(0.25, 0.5, 6) };
        assert_eq!(with(strategy, &v), factor("classic", 0.25, 0.5, 6));
    }
    // in between: neither classic's 1 nor the rule's 0.05, and nearer to the rule with more samples
    let at = |count: f32| {
        let mut v = learned(1e-3, 1e-6, 1e-6, 1.0);
        v.learned.local.count = F32x8::splat(count);
        with("ears", &v)
    };
    let few = [1.0, 10.0, 100.0, 1e4].map(at);
    assert!(few[0] < 1.0 && few.is_sorted_by(|a, b| a > b) && few[3] > 0.05, "{few:?}");
}

/// However little is expected, paths that survive roulette have a throughput of 10 at most; paths that had more before
/// are not split for it. Killed by: a limit that is left out, that forgets the albedo, that raises factors above 1.
#[test]
fn roulette_does_not_raise_throughput_above_ten() {
    for strategy in ["ear", "ears", "bolin-meyer"] {
        for (beta, albedo, expected) in [(0.5, 0.5, MIN_FACTOR), (4.0, 0.5, 0.2), (16.0, 0.5, 0.8), (400.0, 0.5, 1.0)] {
            let v = learned(0.0, 1e-20, 1e-20, 1.0);
            let grey = |x: f32| Vec3x8::splat(x, x, x);
            let s = with(strategy, &Vertices8 { beta: grey(beta), albedo: grey(albedo), ..v });
            assert!((s / expected - 1.0).abs() < 1e-3, "{strategy}, throughput {beta}: {s} for {expected}");
        }
    }
}

/// Probabilities of next event estimation and its shadow rays are those of eq. 32 for their contribution and the cost
/// of a shadow ray, against f64. Killed by: a share or visibility that is squared or left out, weights that are not,
/// the cost of whole samples.
#[test]
fn nee_probabilities_are_the_most_efficient_ones() {
    let mut rng = SplitMix(3);
    let (mut kept, mut sure, mut least) = (0, 0, 0);
    for _ in 0..2000 {
        let mut random = |lo: f64, hi: f64| rng.range(lo.ln(), hi.ln()).exp() as f32;
        let rgb = |x: [f32; 3]| Vec3x8::splat(x[0], x[1], x[2]);
        let (beta, moment, error_weight) = (
            [(); 3].map(|()| random(1e-1, 2.0)),
            [(); 3].map(|()| random(1e-2, 1.0)),
            [(); 3].map(|()| random(1e-1, 10.0)),
        );
        let (share, ratio) = (random(1e-3, 1.0), random(1e-2, 10.0));
        let mut l = learned(0.1, 1.0, 1.0, 7.0).learned;
        (l.local.moment, l.error_weight) = (rgb(moment), rgb(error_weight));
        (l.local.nee_share, l.cost_over_variance) = (F32x8::splat(share), F32x8::splat(ratio));
        let chance = |square: &dyn Fn(usize) -> f64, factor: f64| {
            let mean = (0..3).map(|c| square(c) * f64::from(error_weight[c])).sum::<f64>() / 3.0;
            (mean * factor * f64::from(ratio) / 0.5).sqrt()
        };
        let square = |x: f32| f64::from(x) * f64::from(x);
        let expected = chance(&|c| square(beta[c]) * f64::from(moment[c]), f64::from(share)).clamp(0.05, 1.0);
        let drawn = f64::from(l.nee_probability(rgb(beta), Vec3x8::ZERO).lane(2));
        assert!((drawn / expected - 1.0).abs() < 1e-4, "drawn with {drawn} for {expected}");
        let expected = (chance(&|c| square(beta[c]), 1.0) * f64::from(share)).clamp(0.05, 1.0);
        let traced = f64::from(l.shadow_ray_probability(rgb(beta), F32x8::splat(share)).lane(5));
        assert!((traced / expected - 1.0).abs() < 1e-4, "traced with {traced} for {expected}");
        kept += u32::from(drawn > 0.06 && drawn < 0.99);
        sure += u32::from(drawn == 1.0);
        least += u32::from(drawn < 0.051);
    }
    assert!(kept > 500 && sure > 20 && least > 500, "{kept} {sure} {least}");
}

/// Where nothing is known all samples use next event estimation and trace its rays; few samples have little weight;
/// small contributions still keep the throughput below 10. Killed by: an empty bin that skips light samples, a limit
/// left out, a NaN that becomes the smallest probability.
#[test]
fn nee_is_used_where_nothing_is_known() {
    let grey = |x: f32| Vec3x8::splat(x, x, x);
    let with = |beta: f32, f: &dyn Fn(&mut Learned8)| {
        let mut l = learned(0.5, 1e-6, 1e-6, 1.0).learned;
        f(&mut l);
        l.nee_probability(grey(beta), grey(0.5)).lane(1)
    };
    assert_eq!(with(0.5, &|_| ()), MIN_FACTOR);
    assert_eq!(with(0.5, &|l| l.local.count = F32x8::ZERO), 1.0);
    assert_eq!(with(0.5, &|l| l.cost_over_variance = F32x8::ZERO), 1.0);
    for bad in [f32::NAN, f32::INFINITY] {
        assert_eq!(with(0.5, &|l| l.local.nee_share = F32x8::splat(bad)), 1.0);
        assert_eq!(with(0.5, &|l| l.local.moment = grey(bad)), 1.0);
    }
    let half = with(0.5, &|l| l.local.count = F32x8::splat(256.0));
    assert!((half - 0.5).abs() < 0.01, "{half}");
    for (beta, expected) in [(4.0, 0.2), (16.0, 0.8), (400.0, 1.0)] {
        assert!((with(beta, &|_| ()) - expected).abs() < 1e-5, "throughput {beta}");
    }
    let unknown = Learned8::NONE.shadow_ray_probability(grey(1e-9), F32x8::ONE).lane(0);
    let broken = Learned8 { cost_over_variance: F32x8::ONE, ..Learned8::NONE }
        .shadow_ray_probability(grey(f32::NAN), F32x8::ONE)
        .lane(0);
    assert_eq!([unknown, broken], [1.0; 2]);
}

/// Expected contributions are brought into [1/3, 5/3] of the pixel. Killed by: a factor that aims at the middle of the
/// window, a pixel that multiplies.
#[test]
fn factors_in_the_window_are_one() {
    for (mean, error_weight, adrrs, adrr) in [
        (1.0, 1.0, 1.0, 1.0),
        (0.34, 1.0, 1.0, 1.0),
        (1.66, 1.0, 1.0, 1.0),
        (1.0 / 6.0, 1.0, 0.5, 0.5),
        (10.0 / 3.0, 1.0, 2.0, 1.0),
        (1.0 / 12.0, 4.0, 0.5, 0.5),
        (5.0 / 3.0, 4.0, 2.0, 1.0),
        (1e6, 1.0, MAX_FACTOR, 1.0),
        (0.0, 1.0, MIN_FACTOR, MIN_FACTOR),
    ] {
        let mut v = learned(mean, mean * mean, 0.0, 1.0);
        v.learned.error_weight = Vec3x8::splat(error_weight, error_weight, error_weight);
        let close = |a: f32, b: f32| (a - b).abs() < 1e-5 * b;
        let (s, r) = (with("adrrs", &v), with("adrr", &v));
        assert!(close(s, adrrs) && close(r, adrr), "mean {mean}, error_weight {error_weight}: {s} and {r}");
    }
}

/// Killed by: `clamp` before the finiteness test (`NaN.min(20)` is 20), no floor (NUMERICS RRS-3, RRS-5), a factor that is
/// not finite and splits.
#[test]
fn factors_stay_in_their_bounds() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0, 1e30, f32::MIN_POSITIVE] {
        for (name, _) in Strategy::TABLE {
            let text = if *name == "fixed" { "fixed:2" } else { name };
            for depth in [1, 9] {
                let s = factor(text, bad, bad, depth);
                let low = if *name == "threshold" { 0.0 } else { MIN_FACTOR };
                assert!((low..=MAX_FACTOR).contains(&s), "{name} gives {s} for {bad}");
            }
        }
    }
    for strategy in ["albedo", "classic"] {
        assert_eq!(factor(strategy, f32::NAN, f32::NAN, 9), 1.0, "{strategy}");
    }
}

#[test]
fn unknown_strategies_and_options_are_named() {
    let message = |t: &str| Strategy::parse(t).unwrap_err().to_string();
    assert!(message("roulette").contains("known are none, threshold"));
    for bad in [
        "fixed",
        "fixed:0.01",
        "fixed:21",
        "fixed:x",
        "throughput:foo",
        "throughput:max:0.5:0.1",
        "classic:0",
        "none:1",
        "throughput:max:0.1:0.5:3:4",
        "threshold:-1",
        "threshold:NaN",
        "albedo:x",
        "classic:5:absolute",
        "classic:x:relative",
        "winners:-1",
        "winners:1:x",
        "winners:1:1:1",
        "ears:fancy",
        "ear:x",
        "adrr:1",
        "adrrs:1",
        "bolin-meyer:1",
    ] {
        let name = bad.split(':').next().unwrap();
        assert!(message(bad).contains(&format!("`{name}`")), "{bad}: {}", message(bad));
    }
}
