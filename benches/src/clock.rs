//! CPU time of threads: on a shared machine it says more than the clock on the wall.

use cpu_time::ThreadTime;
use std::time::Instant;

/// CPU seconds that the calling thread has used so far; `None` where the platform does not tell.
pub fn cpu_seconds() -> Option<f64> {
    ThreadTime::try_now().ok().map(|t| t.as_duration().as_secs_f64())
}

/// CPU time of this thread, or wall time where that is unknown.
#[derive(Clone, Copy, Debug)]
pub struct Clock(Instant, Option<f64>);

impl Clock {
    /// Starts now.
    pub fn start() -> Self {
        Self(Instant::now(), cpu_seconds())
    }

    /// Seconds since the start, to be asked from the thread that started it.
    pub fn seconds(&self) -> f64 {
        let cpu = self.1.zip(cpu_seconds()).map(|(a, b)| b - a).filter(|&s| s > 0.0);
        cpu.unwrap_or_else(|| self.0.elapsed().as_secs_f64())
    }
}
