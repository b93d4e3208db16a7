//! One render, watched: its error against the reference and its cost after every iteration.

use crate::clock::cpu_seconds;
use crate::stats::{error_at, time_to};
use crate::subject::Subject;
use crate::variant::Variant;
use croupier::unstable::film::PixelStats;
use croupier::{Film, Scene, Settings};
use croupier_host::compare::{CompareError, relmse};
use croupier_host::drive::{Options, drive_scene};
use croupier_host::image::Rgb;
use croupier_host::render::{Observer, Progress, Target};
use serde_json::{Value, json};
use std::error::Error;
use std::sync::{Mutex, PoisonError};

/// The picture after an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot {
    /// CPU time so far of the threads that render; wall time where the platform does not tell.
    pub core_seconds: f64,
    /// Wall time so far.
    pub wall_seconds: f64,
    /// Camera samples so far.
    pub samples: u64,
    /// Rays so far.
    pub rays: u64,
    /// relMSE without the worst 0.01 % of the pixels.
    pub error: f64,
    /// relMSE without the worst part of the pixels and without what the reference's noise adds in the others.
    pub robust: f64,
}

impl Snapshot {
    /// All figures.
    pub fn json(&self) -> Value {
        json!({
            "core_seconds": self.core_seconds, "wall_seconds": self.wall_seconds, "samples": self.samples,
            "rays": self.rays, "relmse": self.error, "relmse_robust": self.robust,
        })
    }
}

/// A finished render.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its seed.
    pub seed: u64,
    /// Pixels of the picture.
    pub pixels: usize,
    /// After each iteration.
    pub snapshots: Vec<Snapshot>,
    /// The last of them.
    pub end: Snapshot,
    /// The picture.
    pub picture: Rgb,
}

impl Run {
    /// Camera samples per pixel.
    pub fn spp(&self) -> f64 {
        self.end.samples as f64 / self.pixels as f64
    }

    /// Rays per camera sample.
    pub fn rays_per_sample(&self) -> f64 {
        self.end.rays as f64 / self.end.samples as f64
    }

    /// Core-seconds until the robust relMSE came down to `level`; `None` if it did not.
    pub fn seconds_to(&self, level: f64) -> Option<f64> {
        time_to(&self.curve(), level)
    }

    /// The robust relMSE after so many core-seconds; `None` before the first iteration, and after the last.
    pub fn error_after(&self, seconds: f64) -> Option<f64> {
        error_at(&self.curve(), seconds)
    }

    /// Core-seconds and robust relMSE after each iteration.
    fn curve(&self) -> Vec<(f64, f64)> {
        self.snapshots.iter().map(|s| (s.core_seconds, s.robust)).collect()
    }
}

/// Renders with one thread; the robust error leaves the part `outliers` of the pixels out.
pub fn render(
    subject: &Subject,
    variant: &Variant,
    seed: u64,
    target: Target,
    outliers: f64,
) -> Result<Run, Box<dyn Error>> {
    let scene = Scene::from_bytes(&subject.baked.bytes)?;
    let size = [subject.image.width as u32, subject.image.height as u32];
    let settings = Settings { size, seed, shards: 16, aovs: true.into(), ..Settings::for_scene(&scene) };
    let watch = Watch { subject, outliers, start: cpu_seconds(), state: Mutex::default() };
    let pixel_estimate = variant.truth().then_some(&*subject.image.pixels);
    let options = Options { threads: 1, pixel_estimate, ..Options::new(variant.apply(settings), target) };
    drive_scene(scene, &options, &watch)?;
    let state = watch.state.into_inner().unwrap_or_else(PoisonError::into_inner);
    let snapshots = state.snapshots.into_iter().collect::<Result<Vec<_>, _>>()?;
    let (end, picture) = snapshots.last().copied().zip(state.picture).ok_or("a render without an iteration")?;
    Ok(Run { seed, pixels: subject.image.pixels.len(), snapshots, end, picture })
}

/// Takes the snapshots.
struct Watch<'a> {
    subject: &'a Subject,
    outliers: f64,
    /// CPU time of the calling thread at the start.
    start: Option<f64>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// CPU time of the thread that traces: it lives as long as the render.
    tracer: Option<f64>,
    /// CPU time of the calling thread that went into snapshots.
    paused: f64,
    snapshots: Vec<Result<Snapshot, CompareError>>,
    /// The newest picture.
    picture: Option<Rgb>,
}

impl Watch<'_> {
    fn snapshot(
        &self,
        film: &Film<'_>,
        image: &Rgb,
        core_seconds: f64,
        wall_seconds: f64,
    ) -> Result<Snapshot, CompareError> {
        let sum = |f: fn(PixelStats) -> u64| film.pixels().map(f).sum::<u64>();
        Ok(Snapshot {
            core_seconds,
            wall_seconds,
            samples: sum(|p| p.samples),
            rays: sum(|p| p.rays),
            error: relmse(image, &self.subject.image, false)?.value,
            robust: self.subject.error_beyond_noise(image, self.outliers)?,
        })
    }
}

impl Observer for Watch<'_> {
    fn progress(&self, _: &Progress) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).tracer = cpu_seconds();
    }

    fn stop(&self) -> bool {
        false
    }

    fn iteration(&self, film: &Film<'_>, seconds: f64) {
        let cpu = self.seconds();
        let now = cpu_seconds();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let [width, height] = film.size().map(|s| s as usize);
        let pixels = film.pixels().map(|p| p.mean().map(|x| x as f32)).collect();
        let image = Rgb { width, height, pixels };
        let snapshot = self.snapshot(film, &image, cpu.unwrap_or(seconds), seconds);
        state.snapshots.push(snapshot);
        state.picture = Some(image);
        state.paused += cpu_seconds().zip(now).map_or(0.0, |(b, a)| b - a);
    }

    fn seconds(&self) -> Option<f64> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let caller = self.start.zip(cpu_seconds()).map(|(start, now)| now - start - state.paused);
        caller.map(|caller| caller + state.tracer.unwrap_or(0.0))
    }
}
