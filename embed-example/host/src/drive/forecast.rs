//! Prediction of when a render reaches an error, from the iterations so far.
//!
//! The picture after N samples per pixel with relMSE e has N e of noise per sample. If all iterations are alike it gets
//! to the error E at N e / E samples. Where something is learned the latest iterations cost more or less, and are less
//! noisy, than the first: the variance v and the seconds c of a sample are those of the last two iterations, and the
//! number m of samples to come solves (N² e + m v) / (N + m)² = E.

use super::result::IterationRecord;
use serde::Serialize;

/// Predicted duration of a whole render.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Seconds from the start to the end, those that have passed included.
    pub seconds: f64,
    /// 95 % interval of it, from the interval of the error estimate, from how much the seconds of a sample differ
    /// between iterations, and from [`UNKNOWN`]. What no sample has found yet is not in it.
    pub interval: [f64; 2],
}

/// Relative standard deviation of the seconds to come for reasons that the iterations so far do not tell: the last one is
/// finished whole, statistics improve.
pub const UNKNOWN: f64 = 0.1;

/// Samples per pixel from which on there is a forecast: below, the error estimate knows too little.
const FEWEST: f64 = 4.0;

/// Forecast of the render that stops at the relMSE `target` after these iterations. `learns`: what a sample costs and how
/// noisy it is changes from iteration to iteration. `None` while nothing can be said.
///
/// ```
/// assert!(croupier_host::drive::forecast(0.01, false, &[]).is_none());
/// ```
pub fn forecast(target: f64, learns: bool, iterations: &[IterationRecord]) -> Option<Forecast> {
    let last = iterations.last()?;
    let samples = |part: &[IterationRecord]| part.iter().map(|i| f64::from(i.work.samples)).sum::<f64>();
    let seconds = |part: &[IterationRecord]| part.iter().map(|i| i.work.seconds).sum::<f64>();
    let (n, passed, e) = (samples(iterations), seconds(iterations), last.error);
    if n < FEWEST || !(e.rel_mse > 0.0 && target > 0.0) {
        return None;
    }
    if e.rel_mse <= target {
        return Some(Forecast { seconds: passed, interval: [passed; 2] });
    }
    let (before, recent) = iterations.split_at(iterations.len().saturating_sub(2));
    let (per_sample, noise) = if learns {
        let known = samples(before);
        let error = before.last().map_or(0.0, |i| i.error.rel_mse);
        let noise = (n * n * e.rel_mse - known * known * error) / samples(recent);
        // of two noisy numbers: not beyond what an iteration may change
        (seconds(recent) / samples(recent), noise.clamp(0.25 * n * e.rel_mse, 2.0 * n * e.rel_mse))
    } else {
        (passed / n, n * e.rel_mse)
    };
    // target (n + m)^2 - m noise - n^2 e = 0
    let half = n - 0.5 * noise / target;
    let to_come = (half * half + n * n * (e.rel_mse / target - 1.0)).sqrt() - half;
    let rest = to_come * per_sample;
    // the picture's own end is judged by an estimate that contains the samples so far
    let unseen = (to_come / (n + to_come)).sqrt();
    let of_error = (e.high - e.low) / (2.0 * 1.96 * e.rel_mse) * unseen * (n + to_come) / to_come.max(1.0);
    let of_cost = spread(recent, per_sample);
    let deviation = (of_error * of_error + of_cost * of_cost + UNKNOWN * UNKNOWN).sqrt();
    let at = |z: f64| passed + rest * (z * deviation).exp();
    let found = Forecast { seconds: at(0.0), interval: [at(-1.96), at(1.96)] };
    found.interval.iter().all(|s| s.is_finite()).then_some(found)
}

/// Relative standard deviation of the seconds of a sample over iterations.
fn spread(iterations: &[IterationRecord], mean: f64) -> f64 {
    let of = |i: &IterationRecord| i.work.seconds / f64::from(i.work.samples.max(1)) / mean - 1.0;
    let sum: f64 = iterations.iter().map(|i| of(i) * of(i)).sum();
    if mean > 0.0 { (sum / iterations.len().max(1) as f64).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use croupier::unstable::schedule::Work;
    use croupier::{Counters, ErrorEstimate};

    /// An iteration, and the error of the picture after it with an interval of 10 % to either side.
    fn iteration(samples: u32, seconds: f64, rel_mse: f64) -> IterationRecord {
        IterationRecord {
            work: Work { samples, rays: 1, seconds },
            counters: Counters::default(),
            tracing: seconds,
            merging: 0.0,
            estimating: 0.0,
            learning: 0.0,
            picture: None,
            cache: None,
            error: ErrorEstimate { rel_mse, low: 0.9 * rel_mse, high: 1.1 * rel_mse, ..ErrorEstimate::default() },
        }
    }

    /// Killed by: an error that falls as 1 / sqrt(work), seconds that have passed left out, an interval that does not
    /// hold its middle.
    #[test]
    fn alike_iterations_go_on_as_they_were() {
        let all = [iteration(1, 0.5, 0.16), iteration(1, 0.5, 0.08), iteration(2, 1.0, 0.04)];
        for learns in [false, true] {
            let f = forecast(0.01, learns, &all).unwrap();
            assert!((f.seconds - 8.0).abs() < 1e-9, "{f:?}");
            assert!(f.interval[0] < 8.0 && f.interval[1] > 8.0 && f.interval[0] > 2.0, "{f:?}");
        }
        assert!(forecast(0.01, false, &all[..2]).is_none(), "too few samples");
        let done = forecast(0.05, false, &all).unwrap();
        assert_eq!((done.seconds, done.interval), (2.0, [2.0; 2]));
    }

    /// After learning a sample takes twice as long and has a quarter of the noise. Killed by: means over all iterations.
    #[test]
    fn what_was_learned_counts() {
        let noise = [1.0, 1.0, 0.25, 0.25];
        let (mut n, mut sum) = (0.0, 0.0);
        let all: Vec<_> = [2u32, 2, 4, 8]
            .into_iter()
            .zip(noise)
            .map(|(samples, v)| {
                n += f64::from(samples);
                sum += f64::from(samples) * v;
                iteration(samples, f64::from(samples) * if v < 1.0 { 0.2 } else { 0.1 }, sum / (n * n))
            })
            .collect();
        let f = forecast(0.001, true, &all).unwrap();
        let samples: f64 = (f.seconds - 2.8) / 0.2;
        let error = (7.0 + 0.25 * samples) / (16.0 + samples) / (16.0 + samples);
        assert!((error - 0.001).abs() < 1e-9, "{error} after {samples} more");
        let plain = forecast(0.001, false, &all).unwrap();
        assert!(plain.seconds > 1.4 * f.seconds, "{plain:?} {f:?}");
    }

    /// Killed by: an interval that ignores the estimate's own.
    #[test]
    fn a_surer_estimate_is_a_surer_forecast() {
        let mut all = vec![iteration(4, 1.0, 0.04), iteration(4, 1.0, 0.02)];
        let width = |all: &[IterationRecord]| {
            let [low, high] = forecast(0.01, false, all).unwrap().interval;
            high - low
        };
        let sure = width(&all);
        (all[1].error.low, all[1].error.high) = (0.01, 0.03);
        assert!(width(&all) > 2.0 * sure);
    }
}
