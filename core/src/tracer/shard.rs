//! One unit of parallel work: exclusively owned, bounded, deterministic.

use super::job::Job;
use super::ledger::Ledger;
use super::refill::Cursor;
use super::root::Roots;
use super::vertex::{Pool, RESERVE};
use super::{ledger_capacity, pixel_slots, roots_capacity};
use crate::accel::Intersector;
use crate::counters::Counters;
use crate::film::{PixelAov, PixelSums};
use crate::learn::cache::Training;
use crate::light::LightSelector;
use crate::memory::{Carver, Layout, Measure, MemoryError};
use crate::profile::Profile;
use crate::session::{Iteration, Session};
use crate::settings::Settings;
use crate::tiles::TILE_PIXELS;
use core::fmt;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// How much a step may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Rays of all kinds; exceeded by less than one packet (16 rays).
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
    pub(crate) index: u32,
    /// Scene and iteration that the accumulators belong to; iteration 0 is none.
    joined: (u64, Iteration),
    pub(super) cursor: Cursor,
    pub(super) pool: Pool<'m>,
    pub(super) roots: Roots<'m>,
    pub(super) ledger: Ledger<'m>,
    pub(crate) training: Option<Training<'m>>,
    pub(super) pixels: &'m mut [PixelSums],
    pub(super) aovs: &'m mut [PixelAov],
    /// Error of a sample beyond which it is an outlier to the statistics.
    pub(super) outlier: f32,
    /// Numbers of the combs.
    comb: Pcg32,
    pub(super) counters: Counters,
}

impl<'m> Shard<'m> {
    /// Bytes of a shard; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(job: &Job) -> Measure {
        let (settings, pixels) = (&job.settings, pixel_slots(&job.tiles));
        let m = Pool::measure(Measure::new(), settings.ring as usize);
        let m = Roots::measure(m, roots_capacity(settings));
        let m = Ledger::measure(m, ledger_capacity(settings));
        let m = job.cache.map_or(m, |size| Training::measure(m, size));
        m.add::<PixelSums>(pixels).add::<PixelAov>(if settings.aovs { pixels } else { 0 })
    }

    /// Carves shard `index` out of a block of `layout`.
    pub(crate) fn carve(job: &Job, layout: Layout, index: u32, block: &'m mut [u8]) -> Result<Self, ShardError> {
        let s = &job.settings;
        if index >= s.shards {
            return Err(ShardError::Index { index, shards: s.shards });
        }
        let memory = ShardError::Memory;
        let mut c = Carver::new(block, layout).map_err(memory)?;
        let pixels = pixel_slots(&job.tiles);
        Ok(Self {
            job: *job,
            index,
            joined: (0, Iteration::default()),
            cursor: Cursor::finished(),
            pool: Pool::carve(&mut c, s.ring as usize).map_err(memory)?,
            roots: Roots::carve(&mut c, roots_capacity(s)).map_err(memory)?,
            ledger: Ledger::carve(&mut c, ledger_capacity(s)).map_err(memory)?,
            training: job.cache.map(|size| Training::carve(&mut c, size)).transpose().map_err(memory)?,
            pixels: c.take(pixels).map_err(memory)?,
            aovs: c.take(if s.aovs { pixels } else { 0 }).map_err(memory)?,
            outlier: f32::INFINITY,
            comb: Pcg32::seed_from_u64(0),
            counters: Counters::default(),
        })
    }

    /// Its number in the plan.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// Counts of the current iteration.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Starts no further camera samples in the iteration of its last step; stepping on to [`StepResult::Done`] finishes
    /// those in flight, so that what was rendered stays unbiased. A shard that has not stepped in this iteration yet
    /// joins it with a step of 0 rays first.
    pub fn stop(&mut self) {
        self.cursor = Cursor::finished();
    }

    /// Works until the budget is used or the iteration is finished. Many small steps and one big step give the same
    /// bits.
    pub fn step<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        budget: Budget,
    ) -> StepResult {
        if self.joined != session.identity() {
            self.begin(session);
        }
        let start = self.counters.rays();
        while self.counters.rays() - start < budget.rays {
            if !self.turn(session) {
                return StepResult::Done;
            }
        }
        StepResult::More
    }

    fn begin<P: Profile, I: Intersector, L: LightSelector>(&mut self, session: &Session<'_, '_, P, I, L>) {
        let iteration = session.iteration();
        self.joined = session.identity();
        // what an iteration that was given up has left
        self.pool.reset();
        self.roots.reset();
        self.ledger.reset();
        self.cursor = Cursor::new(&self.job.tiles, self.index, iteration.samples);
        self.counters = Counters::default();
        self.pixels.fill(PixelSums::default());
        self.outlier = session.learned().outlier();
        if let Some(t) = &mut self.training {
            t.clear(session.learned().used_bins());
        }
        self.aovs.fill(PixelAov::default());
        let seed = self.job.settings.seed
            ^ (iteration.number << 20 | u64::from(self.index)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.comb = Pcg32::seed_from_u64(seed);
    }

    /// One packet through all stages; `false` when nothing is left.
    fn turn<P: Profile, I: Intersector, L: LightSelector>(&mut self, session: &Session<'_, '_, P, I, L>) -> bool {
        let (_, pending) = self.pool.fullest();
        let room = self.pool.free() >= 2 * RESERVE && !self.cursor.is_finished();
        let flight = if pending >= 8 || pending > 0 && !room {
            self.scatter(session)
        } else if room {
            self.camera_rays(session)
        } else {
            return false;
        };
        if let Some(f) = flight {
            self.advance(session, &f);
        }
        // after what arrived was stored, before the next packet is taken
        let waiting = self.job.settings.ring as usize - self.pool.free();
        self.counters.ring_peak = self.counters.ring_peak.max(waiting as u64);
        true
    }

    /// 32 random bits for a packet's comb.
    pub(super) fn comb_bits(&mut self) -> u32 {
        self.comb.next_u32()
    }

    /// What it was made for.
    pub(crate) fn settings(&self) -> &Settings {
        &self.job.settings
    }

    /// Has it finished this iteration of this scene?
    pub(crate) fn is_done(&self, identity: (u64, Iteration)) -> bool {
        self.joined == identity && self.cursor.is_finished() && self.pool.fullest().1 == 0
    }

    /// Calls `f(film index, sums, auxiliary sums)` for each of its pixels.
    pub(crate) fn for_each_pixel(&self, mut f: impl FnMut(usize, &PixelSums, Option<&PixelAov>)) {
        let tiles = &self.job.tiles;
        let mut next = tiles.next_of(self.index, 0);
        let mut slot = 0;
        while let Some(tile) = next {
            for k in 0..TILE_PIXELS {
                if let (Some(p), Some(stats)) = (tiles.pixel(tile, k), self.pixels.get(slot)) {
                    f(tiles.film_index(p), stats, self.aovs.get(slot));
                }
                slot += 1;
            }
            next = tiles.next_of(self.index, tile + 1);
        }
    }
}
