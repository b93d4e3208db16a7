//! The end of an iteration: stage by stage, in pieces of any size, with the same bits.
//!
//! | stage | reads | changes |
//! |---|---|---|
//! | measure | pixels of all shards | variance and cost of the picture, against the estimate before |
//! | merge | pixels of all shards | film |
//! | refresh | film | estimate of the pixels: denoised row by row, or means of blocks |
//! | measure first | pixels of all shards | as `measure`, of the first iteration, against its own estimate |
//! | discount, absorb, freeze | training of all shards | statistics of the scene, their tree, what look-ups read |
//! | guide | logs of all shards | distributions of path guiding |
//! | densities | film, estimate | where adaptive sampling wants samples |
//! | error | film | estimated error of the picture |
//!
//! Work is counted in units of a ray of the tracer, some 300 instructions ([`Budget::rays`]).

use super::{Phase, SessionError, SessionState};
use crate::learn::LearnedState;
use crate::record::Finishing;
use crate::sampler::Sampler;
use crate::tracer::{Budget, Shard, ShardCursor, StepResult};
use core::iter::Fuse;

// the stages in order; `START` between iterations
const START: u32 = 0;
const MEASURE: u32 = 1;
const MERGE: u32 = 2;
const REFRESH: u32 = 3;
const MEASURE_FIRST: u32 = 4;
const DISCOUNT: u32 = 5;
const ABSORB: u32 = 6;
const FREEZE: u32 = 7;
const GUIDE: u32 = 8;
const DENSITIES: u32 = 9;
const ERROR: u32 = 10;
const DONE: u32 = 11;

/// Pixels whose errors are computed in the time of a ray.
const MEASURED_PER_RAY: u64 = 1;
/// Rays in the time of which a pixel is merged, with the standard auxiliary values.
const RAYS_PER_MERGED: u64 = 3;
/// Pixels of a denoised row in the time of a ray.
const DENOISED_PER_RAY: u64 = 1;
/// Pixels of a row in the time of a ray that the denoiser loads before a pass.
const LOADED_PER_RAY: u64 = 6;
/// Bins that are discounted in the time of a ray.
const DISCOUNTED_PER_RAY: u64 = 8;
/// Bins that are absorbed in the time of a ray.
const ABSORBED_PER_RAY: u64 = 4;
/// Directions that path guiding learns from in the time of a ray.
const REPLAYED_PER_RAY: u64 = 4;
/// Rays in the time of which the density of a tile is computed.
const RAYS_PER_DENSITY: u64 = 24;
/// Rays in the time of which a pixel's contribution to the error is computed, from the window around it.
const RAYS_PER_ESTIMATED: u64 = 4;
/// Rays in the time of which statistics are computed from complete sums; an entry is taken out of the heap of the largest
/// in that of one ray.
const RAYS_PER_ESTIMATE: u64 = 8;

/// Samples per pixel from which on it is known how far they are from independent ones.
const FEWEST_TOLD: u32 = 3;

/// Shards as callers give them.
pub(super) trait Shards<'a, 'b: 'a>: IntoIterator<Item = &'a Shard<'b>> + Clone {}

impl<'a, 'b: 'a, T: IntoIterator<Item = &'a Shard<'b>> + Clone> Shards<'a, 'b> for T {}

/// The shards one after the other: an iterator that stays where it is between two pieces, since most iterators reach an
/// item only by those before it.
struct Walk<'a, 'b, S: Shards<'a, 'b>> {
    shards: S,
    rest: Fuse<S::IntoIter>,
    /// Number of the first item of `rest`.
    next: u32,
    current: Option<(u32, &'a Shard<'b>)>,
}

impl<'a, 'b: 'a, S: Shards<'a, 'b>> Walk<'a, 'b, S> {
    fn new(shards: S) -> Self {
        let rest = shards.clone().into_iter().fuse();
        Self { shards, rest, next: 0, current: None }
    }

    /// Shard `number`, `None` behind the last.
    fn shard(&mut self, number: u32) -> Option<&'a Shard<'b>> {
        if let Some((_, shard)) = self.current.filter(|(current, _)| *current == number) {
            return Some(shard);
        }
        if number < self.next {
            *self = Self::new(self.shards.clone());
        }
        let found = self.rest.nth((number - self.next) as usize);
        self.next = if found.is_some() { number.saturating_add(1) } else { u32::MAX };
        self.current = found.map(|shard| (number, shard));
        found
    }
}

impl SessionState<'_> {
    /// Goes on with the end of an iteration: merges what the shards gathered, in shard order, learns of it, estimates the
    /// error. All shards must be there and have finished (or have been stopped and drained), and must be the same ones
    /// until [`StepResult::Done`]; then the next iteration can begin.
    ///
    /// The budget is in units of a ray of the tracer, some 300 instructions, where the rays of [`Shard::step`] take their
    /// shading along; many small calls and one big call give the same bits. It is exceeded by a few pixels, or by a piece
    /// of work that is larger than it: the largest are a row of the denoiser that loads 16 others, 4 units per column, and
    /// a block of pixels whose errors are computed, up to 31 x 31 pixels at four units each. Each call looks at all shards
    /// first, at some 20 instructions each, whatever the budget. A budget of 0 checks the shards and does nothing.
    ///
    /// While pixels are merged, the film has the iteration in some pixels and not in others. When all are,
    /// [`Film::variance_factors`](crate::Film::variance_factors), and with them
    /// [`Film::standard_error`](crate::Film::standard_error), include the iteration;
    /// [`Film::error_estimate`](crate::Film::error_estimate) does not before [`StepResult::Done`].
    /// [`Self::begin_iteration`] abandons what is left to do: pixels that have been merged keep the iteration, others do
    /// not.
    ///
    /// # Errors
    /// A shard that is missing, of another plan, or has not finished; the session is as before then.
    pub fn finish_iteration<'a, 'b: 'a>(
        &mut self,
        shards: impl IntoIterator<Item = &'a Shard<'b>> + Clone,
        budget: Budget,
    ) -> Result<StepResult, SessionError> {
        self.check(&shards)?;
        let mut shards = Walk::new(shards);
        let mut spent = 0;
        while spent < budget.rays {
            // rows are not divided
            if spent > 0 && self.finishing.stage == REFRESH && self.rays_of_row() > budget.rays - spent {
                break;
            }
            spent += self.finish_some(&mut shards, budget.rays - spent);
            if self.finishing.stage == DONE {
                self.finishing = Finishing::default();
                self.running = false;
                return Ok(StepResult::Done);
            }
        }
        Ok(StepResult::More)
    }

    /// [`Self::finish_iteration`] in one call.
    pub fn end_iteration<'a, 'b: 'a>(
        &mut self,
        shards: impl IntoIterator<Item = &'a Shard<'b>> + Clone,
    ) -> Result<(), SessionError> {
        self.end_iteration_in_phases(shards, |_| ())
    }

    /// [`Self::end_iteration`] for hosts with a clock: `passed` is called after each phase.
    pub fn end_iteration_in_phases<'a, 'b: 'a>(
        &mut self,
        shards: impl IntoIterator<Item = &'a Shard<'b>> + Clone,
        mut passed: impl FnMut(Phase),
    ) -> Result<(), SessionError> {
        loop {
            let before = self.finishing.stage;
            let done = self.finish_iteration(shards.clone(), Budget { rays: 1 << 14 })? == StepResult::Done;
            let now = if done { DONE } else { self.finishing.stage };
            for (end, phase) in [(MERGE, Phase::Merged), (MEASURE_FIRST, Phase::Estimated), (GUIDE, Phase::Learned)] {
                if before <= end && now > end {
                    passed(phase);
                }
            }
            if done {
                return Ok(());
            }
        }
    }

    /// What the next piece of [`Self::finish_iteration`] does, for measurements: the name of a stage.
    pub fn finishing_stage(&self) -> &'static str {
        match self.finishing.stage {
            START => "start",
            MEASURE => "measure",
            MERGE => "merge",
            REFRESH => "refresh",
            MEASURE_FIRST => "measure first",
            DISCOUNT => "discount",
            ABSORB => "absorb",
            FREEZE => "freeze",
            GUIDE => "guide",
            DENSITIES => "densities",
            ERROR => "error",
            _ => "done",
        }
    }

    /// Are these the shards of the iteration, all done?
    fn check<'a, 'b: 'a>(&self, shards: &impl Shards<'a, 'b>) -> Result<(), SessionError> {
        if !self.running {
            return Err(SessionError::NoIteration);
        }
        let (mut expected, identity) = (0, self.identity());
        for s in shards.clone() {
            if s.index() != expected {
                return Err(SessionError::Shards { expected });
            }
            // its sums would go to the wrong pixels
            if s.fingerprint() != self.plan.fingerprint() {
                return Err(SessionError::Plan { shard: s.index() });
            }
            if !s.is_done(identity) {
                return Err(SessionError::Unfinished { shard: s.index() });
            }
            expected += 1;
        }
        if expected != self.plan.settings().shards {
            return Err(SessionError::Shards { expected });
        }
        Ok(())
    }

    /// Goes to the next stage.
    fn next_stage(&mut self) {
        let f = &mut self.finishing;
        (f.stage, f.shard, f.at, f.cursor) = (f.stage + 1, 0, 0, ShardCursor::default());
    }

    /// A piece of the current stage, of about `rays` units at most; units done.
    fn finish_some<'a, 'b: 'a>(&mut self, shards: &mut Walk<'a, 'b, impl Shards<'a, 'b>>, rays: u64) -> u64 {
        match self.finishing.stage {
            START => {
                match shards.shard(self.finishing.shard) {
                    Some(s) => {
                        self.finishing.counters.merge(s.counters());
                        self.finishing.shard += 1;
                    }
                    None => {
                        self.film.begin_merge();
                        self.finishing.sums = LearnedState::begin_errors(self.film.len());
                        self.next_stage();
                    }
                }
                1
            }
            MEASURE => self.measure(shards, rays, false),
            MERGE => self.merge(shards, rays),
            REFRESH => {
                let work = self.rays_of_row();
                if self.learned.refresh_row(&self.film) {
                    self.finishing.sums = LearnedState::begin_errors(self.film.len());
                    self.next_stage();
                }
                work
            }
            MEASURE_FIRST => self.measure(shards, rays, true),
            DISCOUNT => {
                let limit = rays.saturating_mul(DISCOUNTED_PER_RAY) as usize;
                let (n, done) = self.learned.discount(self.finishing.at as usize, limit);
                self.finishing.at += n as u64;
                if done {
                    self.next_stage();
                }
                1 + n as u64 / DISCOUNTED_PER_RAY
            }
            ABSORB => self.absorb(shards, rays),
            FREEZE => {
                let (work, done) = self.learned.freeze_some();
                if done {
                    self.next_stage();
                    if !self.learned.begin_guide() {
                        self.next_stage();
                    }
                }
                work.max(1)
            }
            GUIDE => self.learn_guide(shards, rays),
            DENSITIES => {
                if self.learned.density_of_next(&self.film) {
                    self.finishing.sums = self.film.begin_errors();
                    self.next_stage();
                }
                RAYS_PER_DENSITY
            }
            ERROR => self.estimate_error(rays),
            _ => {
                self.finishing.stage = DONE;
                1
            }
        }
    }

    /// Units that the next row of the estimate takes.
    fn rays_of_row(&self) -> u64 {
        let columns = u64::from(self.film.size()[0]);
        1 + columns / DENOISED_PER_RAY + u64::from(self.learned.rows_to_load()) * columns / LOADED_PER_RAY
    }

    /// Measures the picture of the iteration; `first` if it is the first one, and the estimate its own.
    fn measure<'a, 'b: 'a>(&mut self, shards: &mut Walk<'a, 'b, impl Shards<'a, 'b>>, rays: u64, first: bool) -> u64 {
        if !self.learned.measures(first) {
            self.next_stage();
            return 1;
        }
        let Finishing { sums: errors, cursor, shard, counters, .. } = &mut self.finishing;
        let (learned, largest) = (&mut self.learned, &mut *self.largest);
        if let Some(s) = shards.shard(*shard) {
            let limit = rays.saturating_mul(MEASURED_PER_RAY);
            let (n, done) = s.visit(cursor, limit, |film, sums, _, _| {
                learned.show_error(film, sums, errors, largest);
            });
            if done {
                (*shard, *cursor) = (*shard + 1, ShardCursor::default());
            }
            return 1 + n / MEASURED_PER_RAY;
        }
        let (work, done) = learned.picture_measured(errors, largest, counters, rays);
        if done {
            self.next_stage();
        }
        work + RAYS_PER_ESTIMATE
    }

    /// Merges pixels into the film.
    fn merge<'a, 'b: 'a>(&mut self, shards: &mut Walk<'a, 'b, impl Shards<'a, 'b>>, rays: u64) -> u64 {
        let Finishing { cursor, shard, counters, .. } = &mut self.finishing;
        let (film, learned) = (&mut self.film, &self.learned);
        if let Some(s) = shards.shard(*shard) {
            let (n, done) = s.visit(cursor, rays.div_ceil(RAYS_PER_MERGED), |i, sums, rays, aov| {
                film.merge(i, sums, rays, aov, learned.weight_of(i));
            });
            if done {
                (*shard, *cursor) = (*shard + 1, ShardCursor::default());
            }
            return 1 + n * RAYS_PER_MERGED;
        }
        film.end_merge();
        self.counters.merge(counters);
        self.learned.begin_refresh();
        self.next_stage();
        1
    }

    /// Adds what the shards learned of the scene.
    fn absorb<'a, 'b: 'a>(&mut self, shards: &mut Walk<'a, 'b, impl Shards<'a, 'b>>, rays: u64) -> u64 {
        let f = &mut self.finishing;
        let Some(s) = shards.shard(f.shard) else {
            self.learned.begin_freeze();
            self.next_stage();
            return 1;
        };
        let limit = rays.saturating_mul(ABSORBED_PER_RAY) as usize;
        let (n, done) = s.training().map_or((0, true), |t| self.learned.absorb(t, f.at as usize, limit));
        f.advance(n, done);
        1 + n as u64 / ABSORBED_PER_RAY
    }

    /// Variance of the picture over that of independent samples, as of the iteration before; `None` while unknown.
    fn independence(&self) -> Option<f64> {
        match self.plan.settings().sampler {
            // no point of a sequence is lost by guiding
            Sampler::Hashed => Some(1.0),
            Sampler::Sobol => {
                // not those of other parts of the picture, nor of this iteration
                let own = (self.film.pixel(0).samples as u32).saturating_sub(self.iteration.samples);
                self.film.independence().filter(|_| own >= FEWEST_TOLD)
            }
        }
    }

    /// Learns the distributions of path guiding from the logs of the shards.
    fn learn_guide<'a, 'b: 'a>(&mut self, shards: &mut Walk<'a, 'b, impl Shards<'a, 'b>>, rays: u64) -> u64 {
        if !self.learned.guide_wants_logs() {
            let independence = self.independence();
            let (work, done) = self.learned.learn_guide(independence);
            if done {
                self.next_stage();
            }
            return work.max(1);
        }
        let f = &mut self.finishing;
        let Some(s) = shards.shard(f.shard) else {
            (f.shard, f.at) = (0, 0);
            self.learned.end_replay();
            return 1;
        };
        if let Some(promise) = s.guide_promise().filter(|_| f.at == 0 && self.learned.is_first_replay()) {
            self.learned.add_promise(promise);
        }
        let limit = rays.saturating_mul(REPLAYED_PER_RAY) as usize;
        let samples = self.iteration.samples;
        let (n, done) = s.guide_log().map_or((0, true), |log| self.learned.replay(log, f.at as usize, limit, samples));
        f.advance(n, done);
        1 + n as u64 / REPLAYED_PER_RAY
    }

    /// Estimates the error of the film.
    fn estimate_error(&mut self, rays: u64) -> u64 {
        let Finishing { sums, at, .. } = &mut self.finishing;
        if *at < self.film.blocks() {
            let limit = (rays / RAYS_PER_ESTIMATED).clamp(1, 1 << 30) as usize;
            let [blocks, n] = self.film.show_errors(*at, limit, sums, self.largest, self.highlight);
            *at += blocks;
            return 1 + n * RAYS_PER_ESTIMATED;
        }
        let (work, done) = self.film.estimate_error(sums, self.largest, rays);
        if done {
            self.next_stage();
        }
        work + RAYS_PER_ESTIMATE
    }
}
