//! Medians over seeds, and error over time.

use std::fmt;

/// A median with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Median {
    /// The middle value, or the mean of the two.
    pub median: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Median {
    /// Of independent values, with the narrowest pair of order statistics, equally far from both ends, that holds the
    /// true median with at least 95 %; of fewer than six values none does, and it is their range ([`coverage`]). This
    /// holds for every distribution, and errors of renders have long tails. `None` of nothing, or if a value is NaN.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.iter().any(|x| x.is_nan()) {
            return None;
        }
        let mut v = values.to_vec();
        v.sort_by(f64::total_cmp);
        let (n, k) = (v.len(), left_out(v.len()));
        let (&low, &high) = (v.get(k)?, v.get(n - 1 - k)?);
        Some(Self { median: 0.5 * (v[(n - 1) / 2] + v[n / 2]), low, high })
    }
}

impl fmt::Display for Median {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { median, low, high } = *self;
        write!(f, "{} [{}, {}]", digits(median), digits(low), digits(high))
    }
}

/// Chance that the interval of [`Median`] of `n` values holds the true median.
pub fn coverage(n: usize) -> f64 {
    1.0 - 2.0 * lower_tail(n, left_out(n))
}

/// Order statistics outside the interval, on each side: the most that leave 95 % inside.
fn left_out(n: usize) -> usize {
    (0..n / 2).take_while(|&k| lower_tail(n, k) <= 0.025).last().unwrap_or(0)
}

/// Chance that at most `k` of `n` values lie below the true median: a fair coin's.
fn lower_tail(n: usize, k: usize) -> f64 {
    let (mut term, mut sum) = (0.5f64.powi(n as i32), 0.0);
    for i in 0..=k {
        sum += term;
        term *= (n - i) as f64 / (i + 1) as f64;
    }
    sum
}

/// Geometric mean; NaN of nothing.
pub fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|x| x.ln()).sum::<f64>() / values.len() as f64).exp()
}

/// Half the width of the 95 % interval of a figure, from the figures with each of the seeds left out in turn (the
/// jackknife, with Student's t for as few as there are). `None` of fewer than three, or if one is not finite.
pub fn jackknife(without: &[f64]) -> Option<f64> {
    let n = without.len() as f64;
    if without.len() < 3 || without.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let mean = without.iter().sum::<f64>() / n;
    let squares = without.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    Some(student(n - 1.0) * ((n - 1.0) / n * squares).sqrt())
}

/// What 97.5 % of Student's distribution are below, within 4 % of it from two degrees of freedom on: the normal
/// quantile and its expansion (Abramowitz and Stegun 26.7.5).
fn student(degrees: f64) -> f64 {
    const TERMS: [f64; 4] = [1.96, 2.372, 2.823, 2.556];
    TERMS.iter().rev().fold(0.0, |sum, term| sum / degrees + term)
}

/// When an error first comes down to `level`, from points (time, error) in the order of time: a line in logarithms
/// between the two points around it. A curve that starts below gives its first time; one that ends above, `None`.
pub fn time_to(curve: &[(f64, f64)], level: f64) -> Option<f64> {
    let i = curve.iter().position(|&(_, e)| e <= level)?;
    let (t, e) = curve[i];
    let Some(&(t0, e0)) = i.checked_sub(1).and_then(|i| curve.get(i)) else { return Some(t) };
    if !e0.is_finite() || e <= 0.0 {
        return Some(t);
    }
    Some(t0 * (t / t0).powf((e0 / level).ln() / (e0 / e).ln()))
}

/// Part of a time by which a curve may end before it.
const SHORT: f64 = 0.05;

/// The error at a time, from points (time, error) in the order of time: a line in logarithms between the two points around
/// it. `None` before the first, and more than 5 % after the last; until then the error falls as 1 / time.
pub fn error_at(curve: &[(f64, f64)], time: f64) -> Option<f64> {
    let Some(i) = curve.iter().position(|&(t, _)| t >= time) else {
        let &(t, e) = curve.last()?;
        return (t >= (1.0 - SHORT) * time).then(|| e * t / time);
    };
    let (t, e) = curve[i];
    if t == time {
        return Some(e);
    }
    let (t0, e0) = curve[i.checked_sub(1)?];
    Some(e0 * (e / e0).powf((time / t0).ln() / (t / t0).ln()))
}

/// Three significant digits.
pub fn digits(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let decimals = (2.0 - x.abs().log10().floor()).max(0.0);
    format!("{x:.*}", decimals as usize)
}
