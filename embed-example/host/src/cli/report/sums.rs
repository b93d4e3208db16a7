//! Medians, quantiles and intervals of a few numbers.

use super::ledger::Spread;

/// Resamplings of an interval.
const RESAMPLED: usize = 2000;

/// The mean; 0 of nothing.
pub(super) fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

/// Quantile `q` in [0, 1] by linear interpolation; NaN of nothing.
pub(super) fn quantile(x: &[f64], q: f64) -> f64 {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = q * last as f64;
    let i = (at as usize).min(last);
    let next = sorted[(i + 1).min(last)];
    sorted[i] + (next - sorted[i]) * (at - i as f64)
}

/// Median and quarters.
pub(super) fn spread(x: &[f64]) -> Spread {
    Spread { low: quantile(x, 0.25), middle: quantile(x, 0.5), high: quantile(x, 0.75) }
}

/// 95 % interval of `f` over resamplings of `n` things with replacement (percentile bootstrap). `f` gets the numbers of
/// those that were drawn; what is not finite is left out.
pub(super) fn bootstrap(n: usize, f: impl Fn(&[usize]) -> f64) -> [f64; 2] {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut draw = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((u128::from(state >> 11) * n as u128) >> 53) as usize
    };
    let drawn = (0..RESAMPLED).map(|_| f(&(0..n).map(|_| draw()).collect::<Vec<_>>())).filter(|x| x.is_finite());
    let drawn: Vec<_> = drawn.collect();
    [quantile(&drawn, 0.025), quantile(&drawn, 0.975)]
}

/// 95 % interval of a share of which `k` of `n` were seen (Wilson 1927).
pub(super) fn share_interval(k: usize, n: usize) -> [f64; 2] {
    let (n, p, z) = (n.max(1) as f64, k as f64 / n.max(1) as f64, 1.96f64);
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

/// Geometric mean of what is above 0; NaN of nothing.
pub(super) fn geometric_mean(x: impl IntoIterator<Item = f64>) -> f64 {
    let logs: Vec<_> = x.into_iter().filter(|x| *x > 0.0).map(f64::ln).collect();
    if logs.is_empty() { f64::NAN } else { mean(&logs).exp() }
}

/// y at `x` of a line through points of rising x, both on logarithmic scales; `None` outside of them or where a
/// neighbour is not above 0.
pub(super) fn log_interpolate(points: &[(f64, f64)], x: f64) -> Option<f64> {
    let after = points.iter().position(|p| p.0 >= x)?;
    let (b, a) = (points[after], points[after.saturating_sub(1)]);
    if after == 0 {
        return (b.0 == x).then_some(b.1);
    }
    if a.1 <= 0.0 || b.1 <= 0.0 {
        return None;
    }
    let t = (x / a.0).ln() / (b.0 / a.0).ln();
    Some((a.1.ln() + t * (b.1 / a.1).ln()).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a quantile off by one, an interval that is one-sided, interpolation on linear scales.
    #[test]
    fn small_sums() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(spread(&[0.0, 1.0, 2.0, 3.0, 4.0]), Spread { low: 1.0, middle: 2.0, high: 3.0 });
        assert!(quantile(&[], 0.5).is_nan());
        let x: Vec<f64> = (0..100).map(f64::from).collect();
        let [low, high] = bootstrap(100, |drawn| mean(&drawn.iter().map(|i| x[*i]).collect::<Vec<_>>()));
        // standard error 2.9
        assert!((low - 43.8).abs() < 1.0 && (high - 55.2).abs() < 1.0, "{low} {high}");
        let [low, high] = share_interval(95, 100);
        assert!((low - 0.888).abs() < 1e-3 && (high - 0.978).abs() < 1e-3, "{low} {high}");
        assert!((geometric_mean([2.0, 8.0]) - 4.0).abs() < 1e-12);
        let line = [(1.0, 8.0), (4.0, 2.0)];
        assert!((log_interpolate(&line, 2.0).unwrap() - 4.0).abs() < 1e-12);
        assert_eq!((log_interpolate(&line, 0.5), log_interpolate(&line, 5.0)), (None, None));
    }
}
