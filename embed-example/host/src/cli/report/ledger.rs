//! The ledger: every number that a report shows. Measuring writes it, the page is made of it alone.

use serde::{Deserialize, Serialize};

/// Version of the layout below.
pub(super) const FORMAT: u32 = 2;

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

/// What tells whether a ledger can be read.
#[derive(Deserialize)]
pub(super) struct Format {
    pub(super) format: u32,
    pub(super) made: MadeBy,
}

/// Commit of the program.
#[derive(Deserialize)]
pub(super) struct MadeBy {
    pub(super) commit: String,
}

impl Ledger {
    /// Adds the functions and components of another build, and a setting for its arithmetic to the scenes that both
    /// have; whether there was any function or component that is not here.
    pub(super) fn join(&mut self, other: Self) -> bool {
        let known = |k: &Kernel| {
            let same = |o: &Kernel| (&o.variant, &o.instruction_set) == (&k.variant, &k.instruction_set);
            self.kernels.iter().any(|o| o.function == k.function && same(o))
        };
        let kernels: Vec<_> = other.kernels.into_iter().filter(|k| !known(k)).collect();
        let built = |c: &Component| (c.arithmetic.clone(), c.instruction_set.clone());
        let here: Vec<_> = self.components.iter().map(built).collect();
        let components: Vec<_> = other.components.into_iter().filter(|c| !here.contains(&built(c))).collect();
        let new = !kernels.is_empty() || !components.is_empty();
        self.kernels.extend(kernels);
        self.components.extend(components);
        if other.made.arithmetic != self.made.arithmetic {
            for scene in &mut self.scenes {
                let Some(same) = other.scenes.iter().find(|s| s.name == scene.name && s.size == scene.size) else {
                    continue;
                };
                scene.knobs.extend(Knob::of_arithmetic(&other.made.arithmetic, scene, same));
            }
        }
        new
    }
}

impl Knob {
    /// Another arithmetic as a setting: the default strategy's renders of two ledgers, as if both had stopped after the
    /// same samples.
    fn of_arithmetic(name: &str, here: &SceneRecord, there: &SceneRecord) -> Option<Self> {
        let name = format!("arithmetic {name}, measured apart");
        if here.knobs.iter().any(|k| k.name == name) {
            return None;
        }
        let default = |scene: &SceneRecord| -> Option<Vec<[f64; 2]>> {
            let runs = &scene.curves.iter().find(|c| c.name == DEFAULT)?.runs;
            let ends = runs.iter().filter_map(|r| r.points.last());
            // of one sample per pixel
            Some(ends.map(|p| [p.core_seconds / p.spp, p.rel_mse * p.spp]).collect())
        };
        Some(Self { name, biased: false, default: default(here)?, changed: default(there)? })
    }
}

/// The program's own strategy.
const DEFAULT: &str = "ears";

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
    /// Seconds that the whole report would take here.
    pub(super) seconds_of_all: f64,
    /// Where errors of components against f64 and counts of instructions are from: they are not measured here.
    pub(super) twins: String,
}

/// Median with the quarter below and above.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(super) struct Spread {
    pub(super) low: f64,
    pub(super) middle: f64,
    pub(super) high: f64,
}

impl Spread {
    /// Of a part of what was measured.
    pub(super) fn scaled(self, by: f64) -> Self {
        Self { low: self.low * by, middle: self.middle * by, high: self.high * by }
    }
}

/// One variant of an elementary function, of a geometric test or of a sum.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Kernel {
    pub(super) group: Group,
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
    /// Instructions of eight lanes, counted by callgrind.
    pub(super) instructions: Option<f64>,
    /// Of a geometric test: what was missed though it was met, of all that was met.
    pub(super) missed: Option<[u64; 2]>,
}

/// What kernels are compared with each other.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize)]
pub(super) enum Group {
    /// Elementary functions: errors in ULP of the result.
    #[default]
    Function,
    /// Tests of triangles and boxes, sums of the film: errors in ULP of the distance, of the mean.
    Primitive,
}

/// An operation of a scattering model, light or medium.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(super) struct Component {
    pub(super) group: String,
    pub(super) name: String,
    pub(super) operation: String,
    pub(super) arithmetic: String,
    pub(super) instruction_set: String,
    /// Nanoseconds of eight lanes.
    pub(super) ns: Spread,
    /// Instructions of eight lanes, counted by callgrind.
    pub(super) instructions: Option<f64>,
    /// Largest and median relative difference of weight x density of a sample from the value that `eval` gives for it.
    pub(super) against_eval: Option<[f64; 2]>,
    /// Errors against the f64 twin.
    pub(super) against_twin: Option<Twin>,
}

/// How far results are from those of an f64 twin, relative to these, or to 0.001 where they are smaller.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub(super) struct Twin {
    pub(super) max: f64,
    pub(super) mean: f64,
    /// Standard error, if means of random results were compared.
    pub(super) noise: Option<f64>,
    /// Results that were compared.
    pub(super) count: u64,
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
    /// Ends of the 95 % interval.
    pub(super) low: f64,
    pub(super) high: f64,
    /// The render gives the interval; otherwise a lower bound.
    pub(super) resolved: bool,
    /// The lower bound.
    #[serde(default)]
    pub(super) at_least: f64,
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
