//! Renders on one thread, watched: error against a reference and core-seconds after every iteration.

use super::ledger::{Point, Run};
use super::timing::cpu_seconds;
use croupier::{Film, Scene, Settings};
use croupier_host::compare::RELMSE_EPSILON;
use croupier_host::drive::{DriveError, Options, Rendered, drive_scene};
use croupier_host::render::{Observer, Progress, Target};
use std::sync::{Mutex, PoisonError};

/// A scene whose pictures are measured.
pub(super) struct Subject<'s> {
    pub(super) name: String,
    pub(super) scene: Scene<'s>,
    /// Size and depth of the pictures; the default strategy.
    pub(super) settings: Settings,
}

/// Two independent pictures of a scene, rgb in f64: the product of the differences from both is without the noise of
/// either on average.
#[derive(Clone, Debug, Default)]
pub(super) struct Reference {
    halves: [Vec<f64>; 2],
    /// 1 / (mean² + 0.01), of both together.
    weight: Vec<f64>,
}

impl Reference {
    pub(super) fn new(halves: [Vec<f64>; 2]) -> Self {
        let of = |(a, b): (&f64, &f64)| 1.0 / ((0.5 * (a + b)).powi(2) + RELMSE_EPSILON);
        let weight = halves[0].iter().zip(&halves[1]).map(of).collect();
        Self { halves, weight }
    }

    /// relMSE of one half, by the difference of both.
    pub(super) fn error(&self) -> f64 {
        let [a, b] = &self.halves;
        let sum: f64 = a.iter().zip(b).zip(&self.weight).map(|((a, b), w)| 0.5 * (a - b) * (a - b) * w).sum();
        sum / self.weight.len().max(1) as f64
    }

    /// Mean over pixels and channels of the product of the relative differences of two pictures from the reference.
    /// Of one picture twice: relMSE, on average without the reference's noise. Of two independent ones: the squared
    /// bias, on average.
    pub(super) fn product(&self, x: &[f64], y: &[f64]) -> f64 {
        let [a, b] = &self.halves;
        let differences = x.iter().zip(y).zip(a.iter().zip(b)).map(|((x, y), (a, b))| (x - a) * (y - b));
        let sum: f64 = differences.zip(&self.weight).map(|(d, w)| d * w).sum();
        sum / self.weight.len().max(1) as f64
    }

    /// relMSE of a picture.
    pub(super) fn rel_mse(&self, x: &[f64]) -> f64 {
        self.product(x, x)
    }
}

/// A picture as numbers.
pub(super) fn values(film: &Film<'_>) -> Vec<f64> {
    film.pixels().flat_map(|p| p.mean()).collect()
}

/// A finished render.
pub(super) struct Watched {
    pub(super) rendered: Rendered,
    pub(super) points: Vec<Point>,
}

impl Watched {
    pub(super) fn core_seconds(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.core_seconds)
    }

    pub(super) fn rel_mse(&self) -> f64 {
        self.points.last().map_or(f64::NAN, |p| p.rel_mse)
    }

    pub(super) fn picture(&self) -> Vec<f64> {
        self.rendered.pixels.iter().flat_map(|p| p.mean()).collect()
    }

    pub(super) fn run(&self) -> Run {
        Run { seed: 0, points: self.points.clone() }
    }
}

/// Renders with one thread; targets in seconds count core-seconds.
pub(super) fn render(
    subject: &Subject<'_>,
    settings: Settings,
    seed: u64,
    target: Target,
    reference: Option<&Reference>,
) -> Result<Watched, DriveError> {
    let settings = Settings { seed, ..settings };
    let options = Options { threads: 1, ..Options::new(settings, target) };
    let watch = Watch { reference, start: cpu_seconds(), state: Mutex::default() };
    let rendered = drive_scene(subject.scene, &options, &watch)?;
    let points = watch.state.into_inner().unwrap_or_else(PoisonError::into_inner).points;
    Ok(Watched { rendered, points })
}

struct Watch<'a> {
    reference: Option<&'a Reference>,
    /// CPU time of the calling thread at the start.
    start: Option<f64>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// CPU time of the thread that traces, which lives as long as the render.
    tracer: f64,
    /// CPU time of the calling thread that went into measuring errors.
    paused: f64,
    points: Vec<Point>,
}

impl Observer for Watch<'_> {
    fn progress(&self, _: &Progress) {
        if let Some(now) = cpu_seconds() {
            self.state.lock().unwrap_or_else(PoisonError::into_inner).tracer = now;
        }
    }

    fn stop(&self) -> bool {
        false
    }

    fn iteration(&self, film: &Film<'_>, seconds: f64) {
        let core_seconds = self.seconds().unwrap_or(seconds);
        let before = cpu_seconds();
        let pixels = film.pixels().len().max(1) as f64;
        let sum = |f: fn(croupier::unstable::film::PixelStats) -> u64| film.pixels().map(f).sum::<u64>();
        let point = Point {
            core_seconds,
            spp: sum(|p| p.samples) as f64 / pixels,
            rays: sum(|p| p.rays),
            rel_mse: self.reference.map_or(0.0, |r| r.rel_mse(&values(film))),
        };
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.points.push(point);
        state.paused += before.zip(cpu_seconds()).map_or(0.0, |(a, b)| b - a);
    }

    fn seconds(&self) -> Option<f64> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let caller = self.start.zip(cpu_seconds()).map(|(start, now)| now - start - state.paused);
        caller.map(|caller| caller + state.tracer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Halves that are off by noise of opposite or equal signs. Killed by: a square in place of the product, a weight
    /// of one half.
    #[test]
    fn noise_of_the_reference_does_not_count() {
        let n = 4096usize;
        let sign = |i: usize, bit: usize| if i >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let half = |bit| (0..n).map(|i| 1.0 + 0.1 * sign(i, bit)).collect::<Vec<f64>>();
        let reference = Reference::new([half(0), half(1)]);
        let picture: Vec<f64> = (0..n).map(|i| 1.05 + 0.2 * sign(i, 2)).collect();
        let other: Vec<f64> = (0..n).map(|i| 1.05 + 0.2 * sign(i, 3)).collect();
        // relative to about 1.01 (of 1.0, 1.1 and 0.9 squared)
        let weight = (1.0 / 1.22 + 2.0 / 1.01 + 1.0 / 0.82) / 4.0;
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-2, "{a} {b}");
        close(reference.error(), 0.01 / 1.01);
        // products of signs vanish, but for those with the weights
        assert!((reference.rel_mse(&picture) / (0.0425 * weight) - 1.0).abs() < 0.1);
        assert!(reference.product(&picture, &other) < 0.2 * reference.rel_mse(&picture));
    }
}
