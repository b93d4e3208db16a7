//! How much memory a render needs: sizes first, so that nothing is ever asked for again.

use crate::film::{DIGITS, Film};
use crate::learn::LearnedState;
use crate::memory::{Layout, Measure};
use crate::record::{SessionRecord, fingerprint};
use crate::settings::{Settings, SettingsError};
use crate::tiles::Tiles;
use crate::tracer::{Job, Shard, ShardError};

/// Sizes of the memory blocks of a render.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub(crate) job: Job,
    session: Layout,
    shard: Layout,
    fingerprint: u64,
}

impl Plan {
    /// Checks the settings and measures the blocks.
    ///
    /// # Errors
    /// The first setting that cannot be used.
    pub fn new(settings: &Settings) -> Result<Self, SettingsError> {
        let s = *settings;
        let cache = s.check()?;
        let session = Measure::new().add::<SessionRecord>(1);
        let session = Film::measure(session.add::<u32>(DIGITS), &s.film_layout());
        let session = LearnedState::measure(session, &s.needs(cache));
        let job = Job { settings: s, tiles: Tiles::new(s.size, s.shards), cache };
        Ok(Self {
            job,
            session: session.layout().ok_or(SettingsError::Memory)?,
            shard: Shard::measure(&job, job.tiles.most_pixels()).layout().ok_or(SettingsError::Memory)?,
            fingerprint: fingerprint(settings),
        })
    }

    /// Size and alignment of the session's block.
    pub fn session(&self) -> Layout {
        self.session
    }

    /// Size and alignment of a block for any of the shards. It is at most a few per cent larger than the largest of
    /// them needs; [`Self::shard_of`] is exact.
    pub fn shard(&self) -> Layout {
        self.shard
    }

    /// Size and alignment of the block of shard `index`, which depend on its pixels; those of a shard without pixels if
    /// there is no such shard.
    pub fn shard_of(&self, index: u32) -> Layout {
        Shard::measure(&self.job, self.job.tiles.pixels_of(index)).layout().unwrap_or(self.shard)
    }

    /// Hash of the settings, which tells blocks of other plans.
    pub(crate) fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Settings that the plan was made for.
    pub fn settings(&self) -> &Settings {
        &self.job.settings
    }
}

impl<'m> Shard<'m> {
    /// Carves shard `index` out of a block of at least [`Plan::shard_of`] bytes.
    ///
    /// # Errors
    /// An index beyond the plan's shards, or a block that does not fit.
    pub fn new(plan: &Plan, index: u32, block: &'m mut [u8]) -> Result<Self, ShardError> {
        Self::carve(&plan.job, index, block)
    }
}
