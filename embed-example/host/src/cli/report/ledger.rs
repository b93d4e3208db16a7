//! The ledger: every number that a report shows. Measuring writes it, the page is made of it alone.

use serde::{Deserialize, Serialize};

/// Version of the layout below.
pub(super) const FORMAT: u32 = 1;

/// A whole report in numbers. Times are CPU seconds of the threads that worked, of one thread per render.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Ledger {
    /// [`FORMAT`] of the program that wrote it.
    pub(super) format: u32,
    pub(super) made: Made,
    pub(super) kernels: Vec<Kernel>,
    pub(super) components: Vec<Component>,
    pub(super) scenes: Vec<SceneRecord>,
}

/// Where and how it was measured.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Made {
    pub(super) date: String,
    /// Commit of the sources, and whether they differ from it.
    pub(super) commit: String,
    pub(super) command: String,
    pub(super) version: String,
    pub(super) machine: String,
    /// Processes that wanted a core in the minute before.
    pub(super) load: String,
    pub(super) instruction_set: String,
    pub(super) arithmetic: String,
    /// Name of the effort.
    pub(super) mode: String,
    /// Seconds that were stated before measuring, and those it took on the wall.
    pub(super) seconds_stated: f64,
    pub(super) seconds_taken: f64,
}

/// Median with the quarter below and above.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(super) struct Spread {
    pub(super) low: f64,
    pub(super) middle: f64,
    pub(super) high: f64,
}

/// One variant of an elementary function.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Kernel {
    pub(super) function: String,
    /// Who computes it: `croupier` and the arithmetic, or the platform.
    pub(super) variant: String,
    /// Instruction set of the build.
    pub(super) instruction_set: String,
    /// Arguments that were tried.
    pub(super) arguments: u64,
    /// All there are: the largest error is a bound.
    pub(super) exhaustive: bool,
    pub(super) max_ulp: f64,
    /// Arguments of the largest error.
    pub(super) worst: Vec<f32>,
    pub(super) mean_ulp: f64,
    /// Nanoseconds of eight lanes.
    pub(super) ns: Spread,
}

/// An operation of a scattering model, light or medium.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Component {
    pub(super) group: String,
    pub(super) name: String,
    pub(super) operation: String,
    /// Nanoseconds of eight lanes.
    pub(super) ns: Spread,
    /// Largest and median relative difference of weight x density of a sample from the value that `eval` gives for it.
    pub(super) against_eval: Option<[f64; 2]>,
    /// Largest error against the f64 twin: measured by the tests, joined from a ledger of theirs.
    pub(super) against_twin: Option<f64>,
}

/// Everything about one scene.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct SceneRecord {
    pub(super) name: String,
    pub(super) triangles: usize,
    pub(super) lights: usize,
    pub(super) size: [u32; 2],
    pub(super) max_depth: u32,
    /// Samples per pixel of each of the two halves of the reference.
    pub(super) reference_spp: f64,
    /// relMSE that a half of the reference has by their difference.
    pub(super) reference_error: f64,
    pub(super) curves: Vec<Curve>,
    pub(super) stated: Vec<Stated>,
    pub(super) forecasts: Vec<ForecastRun>,
    pub(super) knobs: Vec<Knob>,
    pub(super) depths: Vec<Depth>,
}

/// Renders of one variant of the settings.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Curve {
    pub(super) name: String,
    /// Its expectation is not the scene's: a strategy that cuts paths, or a smaller depth.
    pub(super) biased: bool,
    pub(super) runs: Vec<Run>,
    /// Squared relative bias against the reference; may be below 0 by chance.
    pub(super) bias: f64,
    /// Its standard error over the seeds, of three at least.
    pub(super) bias_error: Option<f64>,
}

/// A render: its error after every iteration.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Run {
    pub(super) seed: u64,
    pub(super) points: Vec<Point>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(super) struct Point {
    pub(super) core_seconds: f64,
    pub(super) spp: f64,
    pub(super) rays: u64,
    /// relMSE against the reference, without the reference's own noise on average: may be below 0.
    pub(super) rel_mse: f64,
}

/// What renders of one length stated of their own error.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Stated {
    pub(super) strategy: String,
    pub(super) spp: u32,
    pub(super) renders: Vec<StatedError>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
pub(super) struct StatedError {
    /// relMSE against the reference.
    pub(super) measured: f64,
    pub(super) estimate: f64,
    /// Upper end of the 95 % interval; it reaches as far below unless it would be negative.
    pub(super) high: f64,
}

/// A render to an error that was given, and what it predicted.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct ForecastRun {
    pub(super) strategy: String,
    pub(super) target: f64,
    /// Seconds of all iterations.
    pub(super) seconds: f64,
    /// Seconds passed, and the forecast made then.
    pub(super) made: Vec<(f64, ForecastRecord)>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
pub(super) struct ForecastRecord {
    pub(super) seconds: f64,
    pub(super) interval: [f64; 2],
}

/// A setting that was changed from the default, with the same samples per pixel and the same seeds.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Knob {
    pub(super) name: String,
    /// It changes the expectation of the picture.
    pub(super) biased: bool,
    /// Core-seconds and relMSE by seed: of the default, and of the change.
    pub(super) default: Vec<[f64; 2]>,
    pub(super) changed: Vec<[f64; 2]>,
}

/// Renders with one largest path length.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
pub(super) struct Depth {
    pub(super) max_depth: u32,
    /// Mean luminance of the picture.
    pub(super) luminance: f64,
    pub(super) core_seconds: f64,
    pub(super) rays: u64,
}
