//! One unit of parallel work: exclusively owned, bounded, deterministic.

use super::camera_rays::CameraCursor;
use super::job::Job;
use super::pipeline::turn;
use super::state::{State, StateRecord};
use crate::counters::Counters;
use crate::film::PixelSums;
use crate::learn::cache::Training;
use crate::learn::guiding::{GuideLog, Promise};
use crate::memory::{Carver, Measure, MemoryError};
use crate::tiles::TILE_PIXELS;
use crate::world::{Identity, World};
use bytemuck::{Pod, Zeroable};
use core::fmt;

/// How much a step may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Rays of all kinds, and as many steps through media as cost the same ([`Counters::work`]); exceeded by less than one
    /// packet (16 rays, unless they pass surfaces or media; of light paths, with path guiding, up to 256). Camera samples
    /// for which an [`Extension`](crate::unstable::extension::Extension) has no ray count as if they had one.
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

/// Place in the pixels of a shard, tile by tile.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ShardCursor {
    /// The next tile is this one or a later one.
    tile: u32,
    /// Number of the next pixel in the shard.
    pixel: u32,
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
    /// The block does not hold a suspended shard of the plan with this index.
    NotSuspended {
        /// Asked for.
        index: u32,
    },
}

impl fmt::Display for ShardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index { index, shards } => write!(f, "shard {index} of a plan with {shards} shards"),
            Self::Memory(e) => write!(f, "shard: {e}"),
            Self::NotSuspended { index } => write!(f, "the block does not hold shard {index} of this plan, suspended"),
        }
    }
}

impl core::error::Error for ShardError {}

/// All state of one unit of work, in the caller's block. It works for one session: another one of the same scene and
/// plan needs shards of its own, unless it is to continue with equal iterations.
#[derive(Debug)]
pub struct Shard<'m> {
    pub(super) job: Job,
    record: &'m mut ShardRecord,
    index: u32,
    /// What the books belong to; iteration 0 is none.
    pub(super) joined: Identity,
    pub(super) state: State<'m>,
}

/// What a shard holds besides its slabs and sums, at the head of its block.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct ShardRecord {
    /// [`SUSPENDED`] if the rest counts.
    mark: u64,
    /// Hash of the settings.
    settings: u64,
    index: u64,
    joined: Identity,
    state: StateRecord,
}

/// Bytes of that.
pub(crate) const SHARD_RECORD_BYTES: usize = size_of::<ShardRecord>();

/// Mark of a block that holds a suspended shard.
const SUSPENDED: u64 = u64::from_le_bytes(*b"SHARD  1");

impl<'m> Shard<'m> {
    /// Bytes of a shard with so many pixels; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(job: &Job, pixels: usize) -> Measure {
        State::measure(Measure::new().add::<ShardRecord>(1), job, pixels)
    }

    /// Carves shard `index` out of a block. No memory of pixels is touched.
    pub(crate) fn carve(job: &Job, index: u32, block: &'m mut [u8]) -> Result<Self, ShardError> {
        let s = &job.settings;
        if index >= s.shards {
            return Err(ShardError::Index { index, shards: s.shards });
        }
        let mut shard = Self::place(job, index, block).map_err(ShardError::Memory)?;
        shard.record.mark = 0;
        shard.state.reset();
        Ok(shard)
    }

    /// Slices of the block; what they hold stays as it is.
    fn place(job: &Job, index: u32, block: &'m mut [u8]) -> Result<Self, MemoryError> {
        let (pixels, given) = (job.tiles.pixels_of(index), block.len());
        let layout = Self::measure(job, pixels).layout().ok_or(MemoryError::TooSmall { needed: usize::MAX, given })?;
        let mut c = Carver::new(block, layout)?;
        Ok(Self {
            job: *job,
            record: c.take_one()?,
            index,
            joined: Identity::default(),
            state: State::carve(&mut c, job, pixels)?,
        })
    }

    /// Gives the block back, so that [`Self::resume`] can go on with it: a host that stores shards without their
    /// lifetime keeps the blocks. Takes a fixed, short time.
    pub fn suspend(self) {
        *self.record = ShardRecord {
            mark: SUSPENDED,
            settings: self.job.fingerprint,
            index: self.index.into(),
            joined: self.joined,
            state: self.state.suspend(),
        };
    }

    /// See [`Self::resume`].
    pub(crate) fn reopen(job: &Job, index: u32, block: &'m mut [u8]) -> Result<Self, ShardError> {
        let shards = job.settings.shards;
        if index >= shards {
            return Err(ShardError::Index { index, shards });
        }
        let mut shard = Self::place(job, index, block).map_err(ShardError::Memory)?;
        let r = *shard.record;
        let own = r.mark == SUSPENDED && r.settings == job.fingerprint && r.index == u64::from(index);
        own.then_some(())
            .and_then(|()| shard.state.resume(job, index, r.joined.iteration, &r.state))
            .ok_or(ShardError::NotSuspended { index })?;
        shard.record.mark = 0;
        shard.joined = r.joined;
        Ok(shard)
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
        self.state.light_packets = 0;
    }

    /// Works until the budget is used or the iteration is finished. Many small steps and one big step give the same
    /// bits. `world` is the session. The first step of an iteration joins it, with a pass over the links of the ring
    /// (4 bytes for each path in flight) that no budget counts; statistics of the one before are cleared within budgets.
    pub fn step<W: World>(&mut self, world: &W, budget: Budget) -> StepResult {
        if self.joined != world.identity() {
            self.begin(world);
        }
        let mut cleared = 0;
        while !self.state.book.is_clear() {
            if cleared == budget.rays {
                return StepResult::More;
            }
            self.state.book.clear_some();
            cleared += 1;
        }
        let rays = budget.rays - cleared;
        if W::GUIDING && world.learned().trains([self.index, self.job.settings.shards]) {
            self.trace(world, rays)
        } else {
            // sessions, views and profiles with path guiding and without share these kernels, so that they are compiled
            // once; they trace no light paths, and only a forged record can have any left here
            self.state.light_packets = 0;
            self.trace(&world.unguided(), rays)
        }
    }

    /// Traces so many rays, or to the end of the iteration.
    #[inline(always)]
    fn trace<W: World>(&mut self, world: &W, rays: u64) -> StepResult {
        let start = self.state.book.counters.work();
        while self.state.book.counters.work() - start < rays {
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

    /// Hash of the settings that the shard was made for, which tells plans.
    pub(crate) fn fingerprint(&self) -> u64 {
        self.job.fingerprint
    }

    /// What the shard has learned in this iteration.
    pub(crate) fn training(&self) -> Option<&Training<'m>> {
        self.state.book.training.as_ref()
    }

    /// The directions that path guiding learns from, of this iteration.
    pub(crate) fn guide_log(&self) -> Option<&GuideLog<'m>> {
        self.state.book.guide.log()
    }

    /// What path guiding promises in this iteration, if the settings leave open whether it pays.
    pub(crate) fn guide_promise(&self) -> Option<&Promise> {
        self.state.book.guide.promise.first()
    }

    /// Has the shard finished this iteration of this scene?
    pub(crate) fn is_done(&self, identity: Identity) -> bool {
        let State { cursor, ring, book, light_packets, .. } = &self.state;
        self.joined == identity && *light_packets == 0 && cursor.is_finished() && ring.waiting() == 0 && book.is_clear()
    }

    /// Is this the iteration of the shard's last step? `world` is the session.
    pub fn has_joined<W: World>(&self, world: &W) -> bool {
        self.joined == world.identity()
    }

    /// Calls `f(film index, mean radiance, samples)` for each pixel of the shard that has finished camera samples in the
    /// iteration of the shard's last step, which may be under way: for previews.
    ///
    /// The means are biased while samples of the pixel are in flight: those that take long (long paths, split paths)
    /// finish last, so a pixel of few samples shows the short ones. When the shard is done the means are unbiased. The
    /// picture as of the iterations before is in [`crate::SessionState::film`].
    pub fn for_each_pixel(&self, mut f: impl FnMut(usize, [f64; 3], u32)) {
        let mut at = ShardCursor::default();
        while !self
            .visit(&mut at, u64::MAX, |film, sums, _, _| {
                if sums.samples > 0 {
                    let n = f64::from(sums.samples);
                    f(film, sums.sum.map(|x| x / n), sums.samples);
                }
            })
            .1
        {}
    }

    /// Calls `f(film index, sums, rays, auxiliary sums)` for the pixels of the shard's next tiles, until they are
    /// `limit` at least; their number, and `true` after the last of them.
    pub(crate) fn visit(
        &self,
        at: &mut ShardCursor,
        limit: u64,
        mut f: impl FnMut(usize, &PixelSums, u32, &[f32]),
    ) -> (u64, bool) {
        let tiles = &self.job.tiles;
        let mut visited = 0;
        while let Some(tile) = tiles.next_of(self.index, at.tile) {
            if visited >= limit {
                return (visited, false);
            }
            let start = tiles.start(tile);
            for p in (0..TILE_PIXELS).filter_map(|slot| tiles.pixel(start, slot)) {
                let (sums, rays, aov) = self.state.book.pixel(at.pixel as usize);
                f(tiles.film_index(p), &sums, rays, aov);
                at.pixel = at.pixel.saturating_add(1);
                visited += 1;
            }
            at.tile = tile.saturating_add(1);
        }
        (visited, true)
    }
}
