//! Statistics for tests: tail probabilities, chi-square, equivalence, and a small random number generator.
//!
//! Tests split one false-alarm probability over all their comparisons ([`sidak`]) and use fixed seeds.

use std::f64::consts::PI;

/// False-alarm probability of one test function, before it is split over its comparisons.
pub const FAMILY_ALPHA: f64 = 1e-6;

/// SplitMix64 (Steele et al. 2014): for test inputs, unrelated to the generator under test.
#[derive(Clone, Debug)]
pub struct SplitMix(pub u64);

impl SplitMix {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 32 random bits.
    pub fn word(&mut self) -> u32 {
        (self.bits() >> 32) as u32
    }

    /// Uniform in [0, 1) on the grid of 2^-53.
    pub fn f64(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [0, 1) on the grid of 2^-24, as the core's numbers are.
    pub fn f32(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Uniform in `lo..hi`.
    pub fn range(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.f64()
    }

    /// Uniform unit vector.
    pub fn direction(&mut self) -> [f64; 3] {
        let (z, phi) = (self.range(-1.0, 1.0), self.range(0.0, 2.0 * PI));
        let r = (1.0 - z * z).sqrt();
        [r * phi.cos(), r * phi.sin(), z]
    }
}

/// Per-comparison false-alarm probability so that `m` independent ones have `alpha` together.
pub fn sidak(alpha: f64, m: usize) -> f64 {
    -((-alpha).ln_1p() / m as f64).exp_m1()
}

/// ln Gamma(x), x > 0 (Lanczos, g = 7, n = 9; relative error 1e-14).
pub fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 8] = [
        676.5203681218851,
        -1259.1392167224028,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507343278686905,
        -0.13857109526572012,
        9.984_369_578_019_572e-6,
        1.5056327351493116e-7,
    ];
    if x < 0.5 {
        return (PI / (PI * x).sin()).ln() - ln_gamma(1.0 - x);
    }
    let x = x - 1.0;
    let sum = C.iter().enumerate().fold(0.999_999_999_999_809_9, |s, (i, c)| s + c / (x + i as f64 + 1.0));
    let t = x + 7.5;
    0.5 * (2.0 * PI).ln() + (x + 0.5) * t.ln() - t + sum.ln()
}

/// Regularised upper incomplete gamma function Q(a, x), a > 0, x >= 0: series below a + 1, continued fraction above
/// (Abramowitz & Stegun 6.5.29, 6.5.31).
pub fn gamma_q(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    let tiny = 1e-300;
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1.0 / tiny, 1.0 / b);
    let mut h = d;
    for i in 1..100_000 {
        let an = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (an * d + b + tiny);
        c = b + an / c + tiny;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * h
}

/// P(X > x) for chi-square with `dof` degrees of freedom.
pub fn chi_square_tail(x: f64, dof: usize) -> f64 {
    gamma_q(dof as f64 / 2.0, x / 2.0)
}

/// P(Z > z) for the standard normal.
pub fn normal_tail(z: f64) -> f64 {
    let t = gamma_q(0.5, z * z / 2.0) / 2.0;
    if z >= 0.0 { t } else { 1.0 - t }
}

/// z with P(Z > z) = p, 0 < p < 1.
pub fn normal_quantile_upper(p: f64) -> f64 {
    let (mut lo, mut hi) = (-40.0, 40.0);
    for _ in 0..100 {
        let mid = 0.5 * (lo + hi);
        if normal_tail(mid) > p {
            lo = mid;
        } else {
            hi = mid;
        }
    }
    0.5 * (lo + hi)
}

/// Result of a chi-square test.
#[derive(Clone, Copy, Debug)]
pub struct ChiSquare {
    /// Sum of (observed - expected)^2 / expected.
    pub statistic: f64,
    /// Cells after pooling, minus one.
    pub dof: usize,
    /// P of a statistic this large.
    pub p: f64,
}

/// Compares counts with expected counts of the same total. Cells expected to hold fewer than `pool_below` are pooled
/// into one. `p` is 0 if a cell expected to stay empty is not, or if the pooled cell alone is impossible.
pub fn chi_square(observed: &[u64], expected: &[f64], pool_below: f64) -> ChiSquare {
    chi_square_within(observed, expected, &vec![0.0; expected.len()], pool_below)
}

/// As [`chi_square`], with expected counts that are known within `uncertainty` only, as those from quadrature are: its
/// squares add to the variances of the cells. Those of pooled cells add up.
pub fn chi_square_within(observed: &[u64], expected: &[f64], uncertainty: &[f64], pool_below: f64) -> ChiSquare {
    assert_eq!([observed.len(), uncertainty.len()], [expected.len(); 2]);
    let (mut statistic, mut cells) = (0.0, 0usize);
    let (mut pool_o, mut pool_e, mut pool_u) = (0.0, 0.0, 0.0);
    let mut add = |o: f64, e: f64, u: f64| {
        statistic += (o - e) * (o - e) / (e + u * u);
        cells += 1;
    };
    let mut impossible = false;
    for ((&o, &e), &u) in observed.iter().zip(expected).zip(uncertainty) {
        if e >= pool_below {
            add(o as f64, e, u);
        } else {
            impossible |= e <= 0.0 && o > 0;
            pool_o += o as f64;
            pool_e += e;
            pool_u += u;
        }
    }
    if pool_e >= pool_below {
        add(pool_o, pool_e, pool_u);
    } else {
        // too few to join the sum: Poisson tail P(X >= o) against 1e-12
        impossible |= pool_o > 0.0 && 1.0 - gamma_q(pool_o, (pool_e + pool_u).max(1e-300)) < 1e-12;
    }
    let dof = cells.saturating_sub(1);
    let p = match (impossible, dof) {
        (true, _) => 0.0,
        (false, 0) => 1.0,
        (false, _) => chi_square_tail(statistic, dof),
    };
    ChiSquare { statistic, dof, p }
}

/// P of counts this far from expected ones. Cells are pooled with those that follow until each expects at least 5:
/// where most expect few and neighbours are alike, that tells more than [`chi_square`]'s one pool.
///
/// # Panics
/// If a cell that expects nothing has a count, or the sums differ by more than 1e-3 of the total.
pub fn chi_square_in_order(observed: &[u64], expected: &[f64]) -> f64 {
    assert_eq!(observed.len(), expected.len());
    let (total, sum) = (observed.iter().sum::<u64>() as f64, expected.iter().sum::<f64>());
    assert!((total - sum).abs() <= 1e-3 * total, "{total} samples, {sum} expected");
    let (mut statistic, mut cells, mut o, mut e) = (0.0, 0usize, 0.0, 0.0);
    for (count, want) in observed.iter().zip(expected) {
        assert!(*want > 0.0 || *count == 0, "{count} samples where none can be");
        (o, e) = (o + *count as f64, e + want);
        if e >= 5.0 {
            statistic += (o - e) * (o - e) / e;
            (o, e, cells) = (0.0, 0.0, cells + 1);
        }
    }
    let rest = if e > 0.0 { (o - e) * (o - e) / e.max(1.0) } else { 0.0 };
    chi_square_tail(statistic + rest, cells.max(2) - 1)
}

/// Mean and standard error of the mean.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mean {
    n: f64,
    sum: f64,
    squares: f64,
    shift: f64,
}

impl Mean {
    /// Adds one sample.
    pub fn add(&mut self, x: f64) {
        if self.n == 0.0 {
            self.shift = x;
        }
        self.n += 1.0;
        self.sum += x - self.shift;
        self.squares += (x - self.shift) * (x - self.shift);
    }

    /// Of the samples so far.
    pub fn mean(&self) -> f64 {
        self.shift + self.sum / self.n
    }

    /// Standard error of [`Self::mean`].
    pub fn error(&self) -> f64 {
        let m = self.sum / self.n;
        ((self.squares / self.n - m * m).max(0.0) / (self.n - 1.0)).sqrt()
    }
}

/// Two one-sided tests: is the true difference within +-`delta`, with false-alarm probability `alpha`? A difference
/// that is merely not significant does not pass.
pub fn equivalent(difference: f64, standard_error: f64, delta: f64, alpha: f64) -> bool {
    difference.abs() + normal_quantile_upper(alpha) * standard_error < delta
}
