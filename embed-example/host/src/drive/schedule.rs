//! Samples of the next iteration.
//!
//! Iterations grow with the work that is done, so that statistics are renewed often at first and seldom later (EARS,
//! SIGGRAPH 2022, section 5). For strategies that learn, work is counted in rays: when they begin to split, a camera
//! sample may cost twenty times as much as the one before.

use super::target::Target;
use croupier::ErrorEstimate;

/// Most samples per pixel of an iteration.
pub const LARGEST_ITERATION: u32 = 64;

/// Samples per pixel from which on an error estimate ends a render.
const FEWEST_JUDGED: u32 = 4;

/// Work of one iteration, or of all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Camera samples per pixel.
    pub samples: u32,
    /// Rays of all kinds.
    pub rays: u64,
    /// Seconds, on the wall or by [`Observer::seconds`](super::Observer::seconds).
    pub seconds: f64,
}

/// Samples per pixel of the next iteration, 0 when the target is reached. `learns`: the cost of a sample may change
/// from iteration to iteration, and that of the `last` one counts; else the mean cost does.
///
/// The next iteration is meant to take no more than `all` before it together, and no more than what is left, but at
/// least one sample. With a target in samples it depends on counts alone, never on the clock, so that the picture is a
/// pure function of its inputs.
pub fn next(target: Target, learns: bool, all: &Work, last: &Work, error: Option<ErrorEstimate>) -> u32 {
    if all.samples == 0 {
        return 1;
    }
    let recent = if learns { last } else { all };
    let samples = f64::from(recent.samples.max(1));
    let rays_per_sample = (recent.rays.max(1)) as f64 / samples;
    let grow = if learns { (all.rays as f64 / rays_per_sample).round() } else { f64::from(all.samples) };
    let grow = grow.clamp(1.0, f64::from(LARGEST_ITERATION));
    // only whole ones that fit
    let fit = |left: f64, cost: f64| (left / cost.max(1e-12)).floor().clamp(0.0, grow) as u32;
    match target {
        Target::Spp(n) => (grow as u32).min(n.saturating_sub(all.samples)),
        Target::Seconds(s) => fit(s - all.seconds, recent.seconds / samples),
        Target::Rays(n) => fit(n as f64 - all.rays as f64, rays_per_sample),
        Target::Error(e) => match error {
            None => 1,
            Some(x) if x.rel_mse <= e && all.samples >= FEWEST_JUDGED => 0,
            Some(x) => {
                let needed = all.rays as f64 / rays_per_sample * (x.rel_mse / e.max(1e-30) - 1.0);
                needed.ceil().clamp(1.0, grow) as u32
            }
        },
    }
}
