//! How many samples the next iteration takes, for programs with a clock and without.

use crate::fault::{Fault, answer, croupier_message, promised};
use crate::memory::{Versioned, output, read_struct, write_struct, zeroed};
use crate::session::{croupier_session, session_at};
use crate::status::croupier_status::{self, *};
use bytemuck::{Pod, Zeroable};
use croupier::unstable::schedule::{Target, Work};
use croupier_target::*;

/// What ends a render; the amount is a parameter of croupier_session_next_samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum croupier_target {
    /// Samples per pixel. The picture does not depend on the machine.
    CROUPIER_TARGET_SAMPLES = 0,
    /// Seconds by the program's clock. No iteration begins that would pass them at the speed so far; one that has begun
    /// is meant to be finished, and the first one, a sample per pixel, is rendered in any case.
    CROUPIER_TARGET_SECONDS = 1,
    /// Rays of all kinds: no iteration begins that would pass them at the cost so far.
    CROUPIER_TARGET_RAYS = 2,
    /// Estimated relMSE of the picture, from 4 samples per pixel on.
    CROUPIER_TARGET_ERROR = 3,
}

/// Work of a render, which croupier_session_next_samples remembers here between its calls. It begins anew with a picture.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_work {
    /// sizeof(croupier_work), set by the program.
    pub struct_size: u32,
    /// Camera samples per pixel.
    pub samples: u32,
    /// Rays of all kinds.
    pub rays: u64,
    /// Seconds by the program's clock.
    pub seconds: f64,
    /// Camera samples per pixel of the last iteration.
    pub last_samples: u32,
    /// 0.
    pub reserved: u32,
    /// Rays of all kinds of the last iteration.
    pub last_rays: u64,
    /// Seconds of the last iteration.
    pub last_seconds: f64,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_work {
    const FIRST: u32 = 48;
    const NAME: &'static str = "work";

    fn empty() -> Self {
        zeroed()
    }
}

/// The target of a kind and an amount.
fn target(kind: u32, amount: f64) -> Result<Target, Fault> {
    if !(amount > 0.0 && amount < f64::INFINITY) {
        return Err(Fault::new(CROUPIER_RANGE, "amount"));
    }
    // casts end at the largest numbers; less than a whole sample, or ray, is one
    match kind {
        _ if kind == CROUPIER_TARGET_SAMPLES as u32 => Ok(Target::Spp((amount as u32).max(1))),
        _ if kind == CROUPIER_TARGET_SECONDS as u32 => Ok(Target::Seconds(amount)),
        _ if kind == CROUPIER_TARGET_RAYS as u32 => Ok(Target::Rays((amount as u64).max(1))),
        _ if kind == CROUPIER_TARGET_ERROR as u32 => Ok(Target::Error(amount)),
        _ => Err(Fault::new(CROUPIER_RANGE, "target").at(kind.into())),
    }
}

/// Camera samples per pixel of the next iteration, for croupier_session_begin_iteration; 0 when the target is reached.
/// Iterations are short at first, so that a picture is soon there and statistics are renewed often, and longer later.
/// target is a croupier_target, amount how much of it. seconds is the time that the iterations of this picture have taken by
/// the program's clock, without pauses; not read unless the target is in seconds. work is what the call before has left
/// there. To be called between iterations. CROUPIER_RANGE for an amount that is not above 0 or not finite, seconds that are
/// below 0 or not finite, or another target.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_next_samples(
    session: *const croupier_session,
    target: u32,
    amount: f64,
    seconds: f64,
    work: *mut croupier_work,
    samples: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let state = data.state()?;
        let mut to = promised!(output(samples, "samples"))?;
        let before = promised!(read_struct(work))?;
        let target = self::target(target, amount)?;
        let seconds = if matches!(target, Target::Seconds(_)) { seconds } else { 0.0 };
        if !(0.0..f64::INFINITY).contains(&seconds) {
            return Err(Fault::new(CROUPIER_RANGE, "seconds"));
        }
        // of whole iterations, with adaptive sampling the mean of the pixels
        let counters = state.counters();
        let pixels = (state.film().pixels().len() as u64).max(1);
        let mean = counters.camera_samples.saturating_add(pixels >> 1).checked_div(pixels).unwrap_or(0);
        let all = Work { samples: mean.min(u32::MAX.into()) as u32, rays: counters.rays(), seconds };
        let before = if all.samples == 0 { croupier_work::empty() } else { before };
        let last = if all.samples == before.samples {
            Work { samples: before.last_samples, rays: before.last_rays, seconds: before.last_seconds }
        } else {
            Work {
                samples: all.samples.saturating_sub(before.samples),
                rays: all.rays.saturating_sub(before.rays),
                seconds: (seconds - before.seconds).max(0.0),
            }
        };
        to.set(state.samples_of_next(target, &all, &last));
        let work_now = croupier_work {
            samples: all.samples,
            rays: all.rays,
            seconds,
            last_samples: last.samples,
            last_rays: last.rays,
            last_seconds: last.seconds,
            ..croupier_work::empty()
        };
        promised!(write_struct(work, &work_now))
    })
}
