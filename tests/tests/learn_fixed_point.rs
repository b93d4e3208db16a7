//! The factors of EARS are those of least variance x cost: on the paper's two-dimensional example (section 4.1, figure
//! 2) against a numerical minimum, and in renders, where they converge.

use croupier::Settings;
use croupier::unstable::learn::Learning;
use croupier::unstable::rrs::{Learned8, Local8, MAX_FACTOR, MIN_FACTOR, Norm, Strategy, Vertices8};
use croupier::unstable::simd::{F32x8, U32x8, Vec3x8};
use croupier_tests::minimum::minimise;
use croupier_tests::runner::{Learned, Schedule, learning, settings};
use croupier_tests::scenes::{blob, cornell};
use croupier_tests::stats::{Mean, SplitMix};

/// I = integral of g(x) h(x, y): x falls into one of eight cells, where g is constant and a sample of h has known mean,
/// variance and cost. Colours are three integrals with one set of factors.
struct Example {
    probability: [f64; 8],
    g: [[f64; 3]; 8],
    mean: [[f64; 3]; 8],
    variance: [[f64; 3]; 8],
    cost: [f64; 8],
    error_weight: [f64; 3],
    /// Cost of a sample of x.
    prefix: f64,
}

impl Example {
    fn random(rng: &mut SplitMix, coloured: bool) -> Self {
        let mut log = |lo: f64, hi: f64| rng.range(lo.ln(), hi.ln()).exp();
        let mut rgb = |lo: f64, hi: f64| {
            let x = log(lo, hi);
            [(); 3].map(|()| if coloured { x * log(0.5, 2.0) } else { x })
        };
        let g = [(); 8].map(|()| rgb(0.1, 1.0));
        let mean = [(); 8].map(|()| rgb(0.1, 2.0));
        let variance = [(); 8].map(|()| rgb(0.01, 30.0));
        let error_weight = if coloured { rgb(0.5, 2.0) } else { [1.0; 3] };
        let weight = [(); 8].map(|()| log(0.2, 1.0));
        let sum: f64 = weight.iter().sum();
        let cost = [(); 8].map(|()| log(1.0, 8.0));
        Self { probability: weight.map(|w| w / sum), g, mean, variance, cost, error_weight, prefix: log(1.0, 3.0) }
    }

    /// Mean over the colours of g^2 x error weight x what.
    fn weighted(&self, k: usize, what: impl Fn(usize) -> f64) -> f64 {
        (0..3).map(|c| self.g[k][c].powi(2) * self.error_weight[c] * what(c)).sum::<f64>() / 3.0
    }

    /// Variance of the exact suffixes: eq. (17).
    fn between(&self) -> f64 {
        let whole = |c: usize| (0..8).map(|k| self.probability[k] * self.g[k][c] * self.mean[k][c]).sum::<f64>();
        let off = |k: usize, c: usize| (self.mean[k][c] - whole(c) / self.g[k][c]).powi(2);
        (0..8).map(|k| self.probability[k] * self.weighted(k, |c| off(k, c))).sum()
    }

    /// Variance of a sample: eqs. (18), (22), (26).
    fn variance(&self, s: &[f64]) -> f64 {
        let within: f64 = (0..8)
            .map(|k| {
                let square = self.weighted(k, |c| self.mean[k][c].powi(2));
                let v = self.weighted(k, |c| self.variance[k][c]);
                self.probability[k] * if s[k] > 1.0 { v / s[k] } else { (v + square) / s[k] - square }
            })
            .sum();
        self.between() + within
    }

    fn cost(&self, s: &[f64]) -> f64 {
        self.prefix + (0..8).map(|k| self.probability[k] * s[k] * self.cost[k]).sum::<f64>()
    }

    /// Factors of the strategy after `n` iterations with exact statistics.
    fn iterate(&self, strategy: &str, n: usize) -> Vec<f64> {
        let strategy = Strategy::parse(strategy).unwrap();
        let rgb = |f: &dyn Fn(usize, usize) -> f64| Vec3x8::from_fn(|k| [0, 1, 2].map(|c| f(k, c) as f32));
        let mut s = vec![1.0; 8];
        for _ in 0..n {
            let factors = strategy.factor(&Vertices8 {
                beta: rgb(&|k, c| self.g[k][c]),
                last_weight: Vec3x8::ONE,
                albedo: Vec3x8::ONE,
                albedo_product: F32x8::ONE,
                depth: U32x8::splat(1),
                shininess: F32x8::ZERO,
                learned: Learned8 {
                    error_weight: rgb(&|_, c| self.error_weight[c]),
                    norm: Norm::Mean,
                    cost_over_variance: F32x8::splat((self.cost(&s) / self.variance(&s)) as f32),
                    local: Local8 {
                        mean: rgb(&|k, c| self.mean[k][c]),
                        moment: rgb(&|k, c| self.variance[k][c] + self.mean[k][c].powi(2)),
                        variance: rgb(&|k, c| self.variance[k][c]),
                        cost: F32x8::from_fn(|k| self.cost[k] as f32),
                        nee_share: F32x8::ONE,
                        count: F32x8::splat(1e6),
                    },
                },
            });
            s = factors.to_array().map(f64::from).to_vec();
        }
        s
    }
}

/// Thirty examples, grey and coloured, for roulette alone and for roulette and splitting. Killed by: a cost or variance
/// upside down, a moment where the variance belongs, factors that are not squared roots, a norm taken before the sum.
#[test]
fn the_fixed_point_is_the_numerical_minimum() {
    let mut rng = SplitMix(42);
    let (mut killed, mut split, mut left) = (0, 0, 0);
    for example in 0..30 {
        let e = Example::random(&mut rng, example % 2 == 1);
        for (strategy, high) in [("ears:plain", f64::from(MAX_FACTOR)), ("ear:plain", 1.0)] {
            let s = e.iterate(strategy, 200);
            let objective = |s: &[f64]| e.variance(s) * e.cost(s);
            let best = minimise(objective, &[0.9; 8], [f64::from(MIN_FACTOR), high]);
            let (found, least) = (objective(&s), objective(&best));
            assert!(found <= least * 1.0005, "{strategy}, example {example}: {found}, but {least} is possible");
            assert!(least < objective(&[1.0; 8]));
            for (k, (a, b)) in s.iter().zip(&best).enumerate() {
                assert!((a / b - 1.0).abs() < 0.02, "{strategy}, example {example}, cell {k}: {a}, best is {b}");
                killed += usize::from(*b < 0.95);
                split += usize::from(*b > 1.05);
                left += usize::from((b - 1.0).abs() < 1e-3);
            }
        }
    }
    println!("{killed} factors below 1, {split} above, {left} left alone");
    assert!(killed > 100 && split > 50 && left > 20);
}

/// In renders, with iterations of equal length and decay 0, cost, variance and efficiency converge. Killed
/// by: statistics that drift because samples are logged with the factors of the iteration before, a picture's variance
/// that grows with the number of iterations.
#[test]
fn factors_converge_in_renders() {
    let scene = blob(&cornell([24, 24]));
    let s = settings(&scene, "ears:plain");
    let learning_ = Learning { decay: 0.0, cache_bytes: 1 << 20, subdivide_count: 4000.0, samples: 48, ..s.learning };
    let s = Settings { max_depth: 12, seed: 17, learning: learning_, ..s };
    let mut seen = Vec::new();
    learning(&scene, &s, &[48; 46], Schedule::InOrder(1 << 20), &mut |i, l: &mut dyn Learned| {
        if i > 0 {
            let p = l.statistics()[0];
            seen.push([p.cost, p.variance, p.cost * p.variance]);
        }
    });
    println!("{:?}\n{:?}", seen[0], seen[44]);
    for (k, what) in ["cost", "variance", "variance x cost"].into_iter().enumerate() {
        let over = |range: std::ops::Range<usize>| {
            let mut m = Mean::default();
            seen[range].iter().for_each(|x| m.add(x[k]));
            m
        };
        let (middle, late) = (over(15..30), over(30..45));
        let (d, error) = (late.mean() - middle.mean(), late.error().hypot(middle.error()));
        println!("{what}: {} and {}, {d} +- {error}", middle.mean(), late.mean());
        assert!(error < 0.02 * late.mean(), "{what}: too noisy");
        assert!(d.abs() < 3.5 * error + 0.003 * late.mean(), "{what} drifts: {d} +- {error}");
    }
}
