//! One unit of parallel work: exclusively owned, bounded, deterministic.

use super::camera_rays::CameraCursor;
use super::job::Job;
use super::pipeline::turn;
use super::state::State;
use crate::counters::Counters;
use crate::film::{PixelAov, PixelSums};
use crate::learn::cache::Training;
use crate::memory::{Carver, Layout, Measure, MemoryError};
use crate::settings::Settings;
use crate::tiles::TILE_PIXELS;
use crate::world::{Identity, World};
use core::fmt;

/// How much a step may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Rays of all kinds, and as many steps through media as cost the same ([`Counters::work`]); exceeded by less than one
    /// packet (16 rays, unless they pass surfaces or media).
    pub rays: u64,
}

/// What to do after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepResult {
    /// Step again.
    More,
    /// This shard has finished the iteration.
    Done,
}

/// Why a shard cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardError {
    /// The plan has fewer shards.
    Index {
        /// Asked for.
        index: u32,
        /// In the plan.
        shards: u32,
    },
    /// The block does not fit.
    Memory(MemoryError),
}

impl fmt::Display for ShardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index { index, shards } => write!(f, "shard {index} of a plan with {shards} shards"),
            Self::Memory(e) => write!(f, "shard: {e}"),
        }
    }
}

impl core::error::Error for ShardError {}

/// All state of one unit of work, in the caller's block. It works for one session: another one of the same scene and
/// plan needs shards of its own, unless it is to continue with equal iterations.
#[derive(Debug)]
pub struct Shard<'m> {
    pub(super) job: Job,
    index: u32,
    /// What the books belong to; iteration 0 is none.
    joined: Identity,
    pub(super) state: State<'m>,
}

impl<'m> Shard<'m> {
    /// Bytes of a shard; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(job: &Job) -> Measure {
        State::measure(job)
    }

    /// Carves shard `index` out of a block of `layout`.
    pub(crate) fn carve(job: &Job, layout: Layout, index: u32, block: &'m mut [u8]) -> Result<Self, ShardError> {
        let s = &job.settings;
        if index >= s.shards {
            return Err(ShardError::Index { index, shards: s.shards });
        }
        let memory = ShardError::Memory;
        let mut c = Carver::new(block, layout).map_err(memory)?;
        Ok(Self { job: *job, index, joined: Identity::default(), state: State::carve(&mut c, job).map_err(memory)? })
    }

    /// Number of the shard in the plan.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// Counts of the current iteration.
    pub fn counters(&self) -> &Counters {
        &self.state.book.counters
    }

    /// Starts no further camera samples in the iteration of its last step; stepping on to [`StepResult::Done`] finishes
    /// those in flight, so that what was rendered stays unbiased. A shard that has not stepped in this iteration yet
    /// joins it with a step of 0 rays first.
    pub fn stop(&mut self) {
        self.state.cursor = CameraCursor::finished();
    }

    /// Works until the budget is used or the iteration is finished. Many small steps and one big step give the same
    /// bits. `world` is the session.
    pub fn step<W: World>(&mut self, world: &W, budget: Budget) -> StepResult {
        if self.joined != world.identity() {
            self.begin(world);
        }
        let start = self.state.book.counters.work();
        while self.state.book.counters.work() - start < budget.rays {
            if !turn(world, &self.job, self.index, &mut self.state) {
                return StepResult::Done;
            }
        }
        StepResult::More
    }

    /// Joins the iteration of `world`.
    pub(crate) fn begin<W: World>(&mut self, world: &W) {
        self.joined = world.identity();
        self.state.begin(world, &self.job, self.index);
    }

    /// Settings that the shard was made for.
    pub(crate) fn settings(&self) -> &Settings {
        &self.job.settings
    }

    /// What the shard has learned in this iteration.
    pub(crate) fn training(&self) -> Option<&Training<'m>> {
        self.state.book.training.as_ref()
    }

    /// Has the shard finished this iteration of this scene?
    pub(crate) fn is_done(&self, identity: Identity) -> bool {
        self.joined == identity && self.state.cursor.is_finished() && self.state.ring.waiting() == 0
    }

    /// Calls `f(film index, sums, auxiliary sums)` for each pixel of the shard.
    pub(crate) fn for_each_pixel(&self, mut f: impl FnMut(usize, &PixelSums, Option<&PixelAov>)) {
        let tiles = &self.job.tiles;
        let mut next = tiles.next_of(self.index, 0);
        let mut slot = 0;
        while let Some(tile) = next {
            let start = tiles.start(tile);
            for k in 0..TILE_PIXELS {
                if let (Some(p), Some(stats)) = (tiles.pixel(start, k), self.state.book.pixels.get(slot)) {
                    f(tiles.film_index(p), stats, self.state.book.aovs.get(slot));
                }
                slot += 1;
            }
            next = tiles.next_of(self.index, tile + 1);
        }
    }
}
