//! The figures of the benchmarks, against cases worked out by hand.

use croupier_benches::stats::*;

/// Ranks of the 95 % interval from tables of the sign test. Killed by: an interval one rank wider or narrower, the
/// upper middle value in place of the mean of both.
#[test]
fn intervals_of_the_median_are_those_of_the_sign_test() {
    for (n, low, high) in [(1, 1, 1), (3, 1, 3), (5, 1, 5), (6, 1, 6), (8, 1, 8), (9, 2, 8), (12, 3, 10), (30, 10, 21)]
    {
        let values: Vec<f64> = (1..=n).rev().map(f64::from).collect();
        let expected = Median { median: 0.5 * f64::from(n + 1), low: f64::from(low), high: f64::from(high) };
        assert_eq!(Median::of(&values), Some(expected), "{n} values");
    }
    assert_eq!(Median::of(&[]), None);
    assert_eq!(Median::of(&[1.0, f64::NAN]), None);
    assert_eq!(Median::of(&[1.0, f64::INFINITY, 2.0]).map(|m| m.median), Some(2.0));
    for (n, expected) in [(1, 0.0), (3, 0.75), (8, 1.0 - 2.0 / 256.0), (9, 1.0 - 20.0 / 512.0)] {
        assert!((coverage(n) - expected).abs() < 1e-12, "{n}: {}", coverage(n));
    }
}

/// Of a mean, the jackknife gives its standard error exactly; quantiles of t from tables. Killed by: the wrong factor
/// of the squares, the normal quantile in place of Student's, an expansion with a wrong term.
#[test]
fn the_jackknife_of_a_mean_is_its_standard_error() {
    for (n, t) in [(3, 4.303), (4, 3.182), (6, 2.571), (11, 2.228), (31, 2.042)] {
        let values: Vec<f64> = (0..n).map(|i| f64::from(i * i % 7)).collect();
        let (count, sum) = (f64::from(n), values.iter().sum::<f64>());
        let without: Vec<f64> = values.iter().map(|x| (sum - x) / (count - 1.0)).collect();
        let squares = values.iter().map(|x| (x - sum / count).powi(2)).sum::<f64>();
        let expected = t * (squares / (count - 1.0) / count).sqrt();
        let found = jackknife(&without).unwrap();
        assert!((found / expected - 1.0).abs() < if n < 6 { 0.04 } else { 0.002 }, "{n}: {found}, {expected}");
    }
    assert_eq!(jackknife(&[1.0, 2.0]), None);
    assert_eq!(jackknife(&[1.0, 2.0, f64::NAN]), None);
}

/// Error 2 / t. Killed by: interpolation without logarithms, the last crossing for the first, the error of the last point
/// for all times after it.
#[test]
fn times_are_interpolated_in_logarithms() {
    let curve: Vec<(f64, f64)> = [1.0, 2.0, 8.0, 9.0, 20.0].map(|t| (t, 2.0 / t)).to_vec();
    let firefly: Vec<(f64, f64)> = curve.iter().map(|&(t, e)| (t, if t == 9.0 { 5.0 } else { e })).collect();
    for curve in [&curve, &firefly] {
        assert!(time_to(curve, 0.5).is_some_and(|t| (t - 4.0).abs() < 1e-12));
        assert_eq!(time_to(curve, 0.25), Some(8.0));
        assert_eq!(time_to(curve, 3.0), Some(1.0));
        assert_eq!(time_to(curve, 0.09), None);
    }
    for (time, error) in [(1.0, Some(2.0)), (4.0, Some(0.5)), (20.0, Some(0.1)), (20.5, Some(2.0 / 20.5))] {
        let found = error_at(&curve, time);
        assert!(found.zip(error).is_some_and(|(a, b)| (a / b - 1.0f64).abs() < 1e-12), "{time}: {found:?}");
    }
    assert_eq!([0.9, 30.0].map(|t| error_at(&curve, t)), [None; 2]);
    assert_eq!(time_to(&[], 1.0), None);
    assert_eq!(time_to(&[(1.0, f64::INFINITY), (2.0, 0.1)], 0.5), Some(2.0));
}

/// Killed by: the arithmetic mean; digits after the point in place of significant ones.
#[test]
fn means_and_digits() {
    assert!((geometric_mean(&[0.5, 8.0]) - 2.0).abs() < 1e-12);
    assert_eq!([0.001234, 0.5, 12.345, 1234.0, 0.0].map(digits), ["0.00123", "0.500", "12.3", "1234", "0"]);
}
