//! How many samples the next iteration of a session takes.

use super::SessionState;
use crate::schedule::{Target, Work, next_iteration};

impl SessionState<'_> {
    /// Samples per pixel of the next iteration, for [`Self::begin_iteration`]; 0 when the target is reached. `all` is the
    /// work of the iterations so far and `last` that of the last one: rays are those of the counters, seconds what the host
    /// has measured. See [`next_iteration`](crate::unstable::schedule::next_iteration).
    ///
    /// ```
    /// use croupier::unstable::schedule::{Target, Work};
    /// use croupier::{Budget, SessionError, Shard, StepResult};
    ///
    /// /// Renders for so many seconds of a clock; the picture is there after its first sample.
    /// fn render(
    ///     session: &mut croupier::Session<'_, '_>,
    ///     shard: &mut Shard<'_>,
    ///     seconds: f64,
    ///     clock: impl Fn() -> f64,
    /// ) -> Result<(), SessionError> {
    ///     let (mut all, mut last) = (Work::default(), Work::default());
    ///     loop {
    ///         let samples = session.samples_of_next(Target::Seconds(seconds), &all, &last);
    ///         if samples == 0 {
    ///             return Ok(());
    ///         }
    ///         session.begin_iteration(samples);
    ///         while shard.step(&*session, Budget { rays: 10_000 }) == StepResult::More {}
    ///         session.end_iteration([&*shard])?;
    ///         let now = Work { samples: all.samples + samples, rays: session.counters().rays(), seconds: clock() };
    ///         last = Work { samples, rays: now.rays - all.rays, seconds: now.seconds - all.seconds };
    ///         all = now;
    ///     }
    /// }
    /// ```
    pub fn samples_of_next(&self, target: Target, all: &Work, last: &Work) -> u32 {
        let error = (all.samples > 0).then(|| self.film.error_estimate());
        next_iteration(target, self.plan.settings().learns(), all, last, error)
    }
}
