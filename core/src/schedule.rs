//! Samples of the next iteration: planning for hosts with a clock and without. The core reads none; they pass what they
//! have measured.
//!
//! Iterations grow with the work that is done, so that statistics are renewed often at first and seldom later (EARS,
//! SIGGRAPH 2022, section 5). For strategies that learn, work is counted in rays: when they begin to split, a camera
//! sample may cost twenty times as much as the one before. The first iteration has one sample per pixel, so that there is
//! a picture as soon as there can be one.

use crate::film::ErrorEstimate;

/// Most samples per pixel of an iteration.
pub const LARGEST_ITERATION: u32 = 64;

/// Samples per pixel from which on an error estimate ends a render.
const FEWEST_JUDGED: u32 = 4;

/// Stop condition of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Samples per pixel, >= 1.
    Spp(u32),
    /// Seconds of rendering, > 0, by the host's clock. No iteration begins that would pass them at the speed so far; one
    /// that has begun is finished, and the first one, a sample per pixel, is rendered in any case. The image then depends
    /// on the machine.
    Seconds(f64),
    /// Rays of all kinds, >= 1. As with seconds, no iteration begins that would pass them at the cost so far.
    Rays(u64),
    /// Estimated relMSE of the whole image, > 0, checked after every iteration from 4 samples per pixel on.
    Error(f64),
}

/// Work of one iteration, or of all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Camera samples per pixel.
    pub samples: u32,
    /// Rays of all kinds ([`Counters::rays`](crate::Counters::rays)).
    pub rays: u64,
    /// Seconds by the host's clock; anything if the target is none in seconds.
    pub seconds: f64,
}

/// Samples per pixel of the next iteration, 0 when the target is reached. `learns`: the cost of a sample may change
/// from iteration to iteration, and that of the `last` one counts; else the mean cost does. `error`: that of the picture;
/// `None` before the first iteration has ended.
///
/// The next iteration is meant to take no more than `all` before it together, and no more than what is left, but at
/// least one sample. With a target in samples it depends on counts alone, never on the clock, so that the picture is a
/// pure function of its inputs.
pub fn next_iteration(target: Target, learns: bool, all: &Work, last: &Work, error: Option<ErrorEstimate>) -> u32 {
    if all.samples == 0 {
        return 1;
    }
    let recent = if learns { last } else { all };
    let samples = f64::from(recent.samples.max(1));
    let rays_per_sample = (recent.rays.max(1)) as f64 / samples;
    let grow = if learns { all.rays as f64 / rays_per_sample + 0.5 } else { f64::from(all.samples) };
    // casts round towards 0, and a NaN becomes 0
    let grow = (grow as u32).clamp(1, LARGEST_ITERATION);
    // only whole ones that fit
    let fit = |left: f64, cost: f64| ((left / cost.max(1e-12)) as u32).min(grow);
    match target {
        Target::Spp(n) => grow.min(n.saturating_sub(all.samples)),
        Target::Seconds(s) => fit(s - all.seconds, recent.seconds / samples),
        Target::Rays(n) => fit(n as f64 - all.rays as f64, rays_per_sample),
        Target::Error(e) => match error {
            None => 1,
            Some(x) if x.rel_mse <= e && all.samples >= FEWEST_JUDGED => 0,
            Some(x) => {
                let needed = all.rays as f64 / rays_per_sample * (x.rel_mse / e.max(1e-30) - 1.0);
                let whole = needed as u32;
                whole.saturating_add(u32::from(needed > f64::from(whole))).clamp(1, grow)
            }
        },
    }
}
