//! Progress and observers of a render.

use super::Target;
use super::forecast::Forecast;
use croupier::Film;

/// Progress of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Mean samples per pixel so far.
    pub spp: f64,
    /// Rays so far.
    pub rays: u64,
    /// Wall-clock seconds so far.
    pub seconds: f64,
    /// Estimated relMSE of the picture after the last finished iteration ([`croupier::ErrorEstimate::rel_mse`]): the
    /// samples of the iteration under way are not in it. `None` while the first is under way. Where a pixel has a
    /// single sample, its square is used as its squared error, so that the estimate is far too large after an iteration
    /// of one sample.
    pub relmse_estimate: Option<f64>,
    /// When the render will end, by the iterations before the one under way: for [`Target::Error`], from 4 samples per
    /// pixel on.
    pub forecast: Option<Forecast>,
}

impl Progress {
    /// Seconds left until `target`, if work goes on at the speed so far and the squared error falls as 1 / work; by the
    /// forecast where there is one. `None` while nothing is known.
    pub fn seconds_left(&self, target: Target) -> Option<f64> {
        let by_part = |part: f64| self.seconds * (1.0 / part - 1.0);
        let left = match target {
            Target::Spp(n) => by_part(self.spp / f64::from(n)),
            Target::Seconds(s) => s - self.seconds,
            Target::Rays(n) => by_part(self.rays as f64 / n as f64),
            Target::Error(e) => match self.forecast {
                Some(end) => end.seconds - self.seconds,
                None => by_part(e / self.relmse_estimate?),
            },
        };
        left.is_finite().then(|| left.max(0.0))
    }

    /// 95 % interval of the seconds left, where there is a forecast: for [`Target::Error`].
    pub fn seconds_left_interval(&self, target: Target) -> Option<[f64; 2]> {
        let end = self.forecast.filter(|_| matches!(target, Target::Error(_)))?;
        Some(end.interval.map(|s| (s - self.seconds).max(0.0)))
    }
}

/// Observer of a render, who may end it. Called from the thread that called [`drive`](super::drive) and from its workers.
pub trait Observer: Sync {
    /// Called by each worker after each step: when a shard has traced some 65 000 rays or has finished its part of the
    /// iteration. Workers do not wait for each other, so that several may call at a time; each waits for its own call.
    fn progress(&self, progress: &Progress);
    /// True ends the render soon, and must stay true; what was rendered is still returned. Asked before each iteration
    /// but the first, and by each worker after each step that leaves its shard something to do: such a shard begins no
    /// further camera samples and finishes those under way. So a first iteration whose shards take a single step each
    /// is finished. Nothing else ends an iteration early, no [`Target`] either.
    fn stop(&self) -> bool;
    /// An iteration is finished: the picture so far and the wall-clock seconds it took. Called from the thread that
    /// called [`drive`](super::drive); the time spent in here does not count as rendering.
    fn iteration(&self, _film: &Film<'_>, _seconds: f64) {}
    /// Seconds of rendering so far, for [`Target::Seconds`]; `None` is time on the wall without that in
    /// [`Self::iteration`]. On a machine with other work a host may count CPU time instead. Asked between iterations,
    /// by the thread that called [`drive`](super::drive).
    fn seconds(&self) -> Option<f64> {
        None
    }
}

/// Observer that ignores progress and never stops a render.
#[derive(Clone, Copy, Debug)]
pub struct Unobserved;

impl Observer for Unobserved {
    fn progress(&self, _: &Progress) {}

    fn stop(&self) -> bool {
        false
    }
}
