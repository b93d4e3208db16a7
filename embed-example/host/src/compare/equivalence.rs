//! Test that a difference is small, and the normal distribution.

use serde::Serialize;
use std::f64::consts::{PI, SQRT_2};

/// Outcome of [`equivalence`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Equivalence {
    /// Whether the difference is shown to lie within the margin.
    pub equivalent: bool,
    /// The larger of the two one-sided p-values.
    pub p: f64,
    /// Confidence interval of level 1 - 2 alpha; equivalent means that it lies within (-delta, delta).
    pub interval: [f64; 2],
}

/// Two one-sided tests (TOST, Schuirmann 1987) that a true difference lies in (-`delta`, `delta`), at error rate
/// `alpha` (0 to 0.5, both excluded), for a normal `mean_difference` of known standard error `se`.
///
/// Unlike a test for difference, this one fails when there is too little data. NaN anywhere is "not equivalent".
pub fn equivalence(mean_difference: f64, se: f64, delta: f64, alpha: f64) -> Equivalence {
    let [above, below] = [mean_difference + delta, delta - mean_difference].map(|d| match d / se {
        // No noise and exactly on the margin.
        z if z.is_nan() => 1.0,
        z => normal_cdf(-z),
    });
    let p = above.max(below);
    let half = normal_quantile(1.0 - alpha) * se;
    Equivalence { equivalent: p < alpha, p, interval: [mean_difference - half, mean_difference + half] }
}

/// Distribution function of the standard normal distribution; relative error below 1e-13 for x > -37.
pub fn normal_cdf(x: f64) -> f64 {
    if x.is_nan() {
        return f64::NAN;
    }
    let tail = upper_tail(x.abs());
    if x < 0.0 { tail } else { 1.0 - tail }
}

/// Probability beyond x >= 0: the Maclaurin series of the integral (Abramowitz & Stegun 26.2.11) below 3, Laplace's
/// continued fraction (26.2.14) above.
fn upper_tail(x: f64) -> f64 {
    let density = (-0.5 * x * x).exp() / (SQRT_2 * PI.sqrt());
    if x < 3.0 {
        let (mut term, mut sum, mut k) = (x, x, 1.0);
        while term > 1e-17 * sum {
            k += 2.0;
            term *= x * x / k;
            sum += term;
        }
        0.5 - density * sum
    } else {
        // 120 terms from the far end: converged to the last bit at x = 3, far sooner above.
        let fraction = (1..=120).rev().fold(x, |f, k| x + f64::from(k) / f);
        density / fraction
    }
}

/// The x below which a standard normal variable lies with probability `p`; infinite at 0 and 1, NaN outside.
pub fn normal_quantile(p: f64) -> f64 {
    if !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if p > 0.5 {
        return -normal_quantile(1.0 - p);
    }
    if p == 0.0 {
        return f64::NEG_INFINITY;
    }
    // Bisection needs no second formula; f64 ends before 39 standard deviations, 64 halvings are its precision.
    let (mut low, mut high) = (-39.0, 0.0);
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if normal_cdf(middle) < p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}
