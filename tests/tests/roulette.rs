//! Factors, their rounding and their bounds.

use croupier::rrs::{COMB_ONE, Learned8, MAX_FACTOR, MIN_FACTOR, Strategy, Vertices8, comb};
use croupier::simd::{F32x8, U32x8, Vec3x8};

/// Mean of n over all u on a grid of `m` equally spaced values that includes 0: exact for a comb in fixed point whose
/// prefix sums are multiples of 2^32 / m.
fn comb_means(s: [f32; 8], m: u64) -> [f64; 8] {
    let mut sum = [0u64; 8];
    for k in 0..m {
        let u = (k * ((1u64 << 32) / m)) as u32;
        for (t, n) in sum.iter_mut().zip(comb(F32x8::new(s), u)) {
            *t += u64::from(n);
        }
    }
    sum.map(|t| t as f64 / m as f64)
}

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
        let means = comb_means(s, 1 << 16);
        for (mean, s) in means.into_iter().zip(s) {
            // the grid's own discretisation
            assert!((mean - f64::from(s)).abs() <= 2.0 / 65536.0, "{mean} for {s}");
        }
    }
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

/// Killed by: `clamp` before the finiteness test (`NaN.min(20)` is 20), no floor (NUMERICS RRS-3, RRS-5).
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
    ] {
        let name = bad.split(':').next().unwrap();
        assert!(message(bad).contains(&format!("`{name}`")), "{bad}: {}", message(bad));
    }
}
