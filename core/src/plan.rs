//! How much memory a render needs: sizes first, so that nothing is ever asked for again.

use crate::film::{AovLayout, Film, FilmSum, PixelSums};
use crate::learn::{LearnedState, PixelEstimator};
use crate::memory::{BLOCK_ALIGN, Carver, Layout, Measure, MemoryError};
use crate::record::{SessionRecord, fingerprint};
use crate::settings::{Settings, SettingsError};
use crate::tiles::Tiles;
use crate::tracer::{Job, Shard, ShardError, longest};

/// Stack that [`Shard::step`] and [`SessionState::finish_iteration`](crate::SessionState::finish_iteration) need at most,
/// with any profile and optimised code, bytes: tested by threads that have no more.
pub const STACK_BYTES: usize = 64 << 10;

/// Sizes of the memory blocks of a render.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub(crate) job: Job,
    session: Layout,
    shard: Layout,
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
        let session = Film::measure(session.add::<u32>(s.largest_len()), &s.film_layout());
        let session = LearnedState::measure(session, &s.needs(cache));
        let (tiles, guide) = (Tiles::new(s.size, s.shards), s.guide_size());
        let job = Job { settings: s, tiles, cache, guide, fingerprint: fingerprint(settings) };
        Ok(Self {
            job,
            session: session.layout().ok_or(SettingsError::Memory)?,
            shard: Shard::measure(&job, job.tiles.most_pixels()).layout().ok_or(SettingsError::Memory)?,
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

    /// Most bytes that [`Shard::save`] writes of shard `index`: a host allocates once for all iterations.
    pub fn saved_shard(&self, index: u32) -> usize {
        longest(&self.job, self.job.tiles.pixels_of(index))
    }

    /// Size and alignment of the block of a [`FilmSum`](crate::unstable::film::FilmSum), without a session; the largest that
    /// cannot be had if the settings are [`adaptive`](Settings::adaptive): films of weighted samples cannot be added.
    pub fn film_sum(&self) -> Layout {
        let none = Layout { size: usize::MAX, align: BLOCK_ALIGN };
        let layout = FilmSum::measure(&self.settings().film_layout()).layout();
        layout.filter(|_| !self.settings().adaptive).unwrap_or(none)
    }

    /// Bytes per pixel of the session's block and of the shards' blocks together, of what grows with the picture:
    ///
    /// | | session | shards |
    /// |---|---|---|
    /// | always | 48 | 48 |
    /// | per plane of [`Settings::aovs`] | 4 | 4 |
    /// | with [`Settings::adaptive`] or the AOV `cost` | 4 | 4 |
    /// | with [`Settings::adaptive`] | 48.1 | |
    /// | with an estimate of the pixels, denoised (strategies that learn, [`Settings::adaptive`]) | 20 | |
    ///
    /// So `classic` takes 96 without auxiliary values, `ears` 172 with albedo, normal and depth, and 260 with the
    /// standard set ([`AovSet::STANDARD`](crate::unstable::film::AovSet::STANDARD), 17 planes and the cost), which the
    /// program asks for. At 1920 x 1080 another 2 come to those of `ears` for the denoiser's window of rows, and 12 for
    /// the 24 MiB of statistics, which are the same for any picture.
    ///
    /// Not in these numbers are 28 bytes of the session for every 1,000 pixels with an estimate of the pixels, for every
    /// 10,000 without: those with most error, while an iteration ends. The rest does not grow with the number of pixels:
    /// statistics of the scene ([`Learning::cache_bytes`](crate::unstable::learn::Learning) in all), 2112 bytes a column for a
    /// denoised estimate, and in each shard 200 bytes per slot of [`Settings::ring`] and, if the strategy learns, 68 bytes
    /// per record of its ledger. [`Self::session`] and [`Self::shard_of`] are exact.
    /// [`STACK_BYTES`](crate::unstable::STACK_BYTES) of stack come to that.
    pub fn bytes_per_pixel(&self) -> [f64; 2] {
        let s = self.settings();
        let planes = AovLayout::new(s.aovs).planes as f64;
        let rays = if s.counts_rays() { 4.0 } else { 0.0 };
        let weights = if s.adaptive { 48.0 + 8.0 / 64.0 } else { 0.0 };
        let estimate = match s.needs(self.job.cache).pixels {
            Some(PixelEstimator::Denoised) => 20.0,
            Some(PixelEstimator::Blocks) => 12.0 / 64.0,
            None => 0.0,
        };
        let both = size_of::<PixelSums>() as f64 + 4.0 * planes + rays;
        [both + weights + estimate, both]
    }

    /// Hash of the settings, which tells blocks of other plans.
    pub(crate) fn fingerprint(&self) -> u64 {
        self.job.fingerprint
    }

    /// Settings that the plan was made for.
    pub fn settings(&self) -> &Settings {
        &self.job.settings
    }
}

impl<'m> FilmSum<'m> {
    /// An empty film in a block of at least [`Plan::film_sum`] bytes.
    ///
    /// # Errors
    /// A block that does not fit, and any block with [`Settings::adaptive`].
    pub fn new(plan: &Plan, block: &'m mut [u8]) -> Result<Self, MemoryError> {
        Self::carve(&mut Carver::new(block, plan.film_sum())?, &plan.settings().film_layout())
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

    /// Takes up the shard that [`Self::suspend`] has left in the block, which may have moved since; the plan must be equal
    /// to the one it was made with. Takes a fixed, short time.
    ///
    /// The bytes are checked as far as that takes no longer. If others have changed them since, the picture may be wrong;
    /// memory stays safe.
    ///
    /// # Errors
    /// A block that does not fit or holds no such shard, or one that was resumed and not suspended since.
    pub fn resume(plan: &Plan, index: u32, block: &'m mut [u8]) -> Result<Self, ShardError> {
        Self::reopen(&plan.job, index, block)
    }
}
