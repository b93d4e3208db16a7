//! One shard's side of the cache: sums of the current iteration.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::bins::{BinRecord, ShadowRecord};
use super::size::CacheSize;
use crate::memory::{Carver, Layout, Measure, MemoryError};

/// Sums of one shard in the current iteration, a record for every bin that there is room for.
#[derive(Debug)]
pub struct Training<'m> {
    records: &'m mut [BinRecord],
    shadows: &'m mut [ShadowRecord],
    used: usize,
    /// Number of bins in use that hold sums of this iteration.
    clear: usize,
}

/// Bins that [`Training::clear_some`] clears.
const BINS_AT_ONCE: usize = 32;

impl<'m> Training<'m> {
    /// Size and alignment of the block that [`Self::new`] needs; `None` if it cannot be addressed.
    pub fn layout(size: CacheSize) -> Option<Layout> {
        Self::measure(Measure::new(), size).layout()
    }

    /// Training side in a block of its own, without bins until [`Self::clear`].
    pub fn new(size: CacheSize, block: &'m mut [u8]) -> Result<Self, MemoryError> {
        let given = block.len();
        let layout = Self::layout(size).ok_or(MemoryError::TooSmall { needed: usize::MAX, given })?;
        Self::carve(&mut Carver::new(block, layout)?, size)
    }

    pub(crate) fn measure(m: Measure, size: CacheSize) -> Measure {
        m.add::<BinRecord>(size.bins()).add::<ShadowRecord>(size.bins())
    }

    pub(crate) fn carve(c: &mut Carver<'m>, size: CacheSize) -> Result<Self, MemoryError> {
        Ok(Self { records: c.take_unset(size.bins())?, shadows: c.take_unset(size.bins())?, used: 0, clear: 0 })
    }

    /// Bins in use, and those that hold sums of this iteration, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> [u64; 2] {
        [self.used, self.clear].map(|n| n as u64)
    }

    /// Goes on with the sums that the memory holds; `None` if there are not so many bins.
    pub(crate) fn resume(&mut self, bins: [u64; 2]) -> Option<()> {
        let [used, clear] = bins.map(|n| usize::try_from(n).ok().filter(|&n| n <= self.records.len()));
        (self.used, self.clear) = (used?, clear?);
        Some(())
    }

    /// Forgets all sums and takes samples of bins below `used_bins` ([`super::Cache::bins`]).
    pub fn clear(&mut self, used_bins: u32) {
        self.begin(used_bins);
        while !self.clear_some() {}
    }

    /// As [`Self::clear`], but the sums are to be forgotten by [`Self::clear_some`] first.
    pub(crate) fn begin(&mut self, used_bins: u32) {
        self.used = (used_bins as usize).min(self.records.len());
        self.clear = 0;
    }

    /// Forgets some of the sums; `true` when all are forgotten.
    pub(crate) fn clear_some(&mut self) -> bool {
        let (from, to) = (self.clear, (self.clear + BINS_AT_ONCE).min(self.used));
        self.records.get_mut(from..to).unwrap_or(&mut []).fill(bytemuck::Zeroable::zeroed());
        self.shadows.get_mut(from..to).unwrap_or(&mut []).fill(bytemuck::Zeroable::zeroed());
        self.clear = to;
        self.is_clear()
    }

    /// Are all sums those of this iteration?
    pub(crate) fn is_clear(&self) -> bool {
        self.clear >= self.used
    }

    /// Bytes of a bin in [`Self::sums`].
    pub(crate) const BIN_BYTES: usize = size_of::<BinRecord>() + size_of::<ShadowRecord>();

    /// Number of bins in use.
    pub(crate) fn used(&self) -> usize {
        self.used
    }

    /// Bytes of [`Self::sums`] of so many bins.
    pub(crate) fn lengths(bins: usize) -> [usize; 2] {
        [bins * size_of::<BinRecord>(), bins * size_of::<ShadowRecord>()]
    }

    /// Sums of the bins in use, and their shadow rays, as bytes.
    pub(crate) fn sums(&self) -> [&[u8]; 2] {
        [bytemuck::cast_slice(self.records()), bytemuck::cast_slice(self.shadows())]
    }

    /// The first bin in the bytes of [`Self::sums`] with numbers that no samples have.
    pub(crate) fn unsound(records: &[u8], shadows: &[u8]) -> Option<usize> {
        let record = |b: &[u8]| !bytemuck::pod_read_unaligned::<BinRecord>(b).is_sound();
        let shadow = |b: &[u8]| !bytemuck::pod_read_unaligned::<ShadowRecord>(b).is_sound();
        let first = records.chunks_exact(size_of::<BinRecord>()).position(record);
        first.or_else(|| shadows.chunks_exact(size_of::<ShadowRecord>()).position(shadow))
    }

    /// Takes the bytes of [`Self::sums`] of as many bins as are in use.
    pub(crate) fn load(&mut self, [records, shadows]: [&[u8]; 2]) {
        let copy = |to: &mut [u8], from: &[u8]| to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        copy(bytemuck::cast_slice_mut(self.used_mut()), records);
        copy(bytemuck::cast_slice_mut(self.shadows_mut()), shadows);
        self.clear = self.used;
    }

    /// Adds a sample. Negative values count as 0, values above [`MAX_VALUE`](super::MAX_VALUE) as that.
    ///
    /// `false` if it was not taken: the bin does not exist, a number is not finite, or the bin has
    /// [`BIN_LIMIT`](super::BIN_LIMIT) samples of this iteration. A full bin keeps the first ones, so it represents the
    /// tiles that the shard begins with: factors, and so the noise, are a little off then, but no picture is biased.
    /// [`crate::Counters::samples_refused`] counts them.
    #[inline]
    pub fn log(&mut self, bin: u32, x: [f32; 3], cost: f32) -> bool {
        let finite = x.iter().all(|x| x.is_finite()) && cost.is_finite();
        finite && self.used_mut().get_mut(bin as usize).is_some_and(|r| r.add(x, cost))
    }

    /// Adds half the squared difference of two samples of one vertex, per channel. Of two samples that both used next
    /// event estimation, or both did not, it is an unbiased estimate of their variance. Limits as in [`Self::log`].
    #[inline]
    pub fn log_pair(&mut self, bin: u32, half_squared_difference: [f32; 3]) -> bool {
        let finite = half_squared_difference.iter().all(|x| x.is_finite());
        finite && self.used_mut().get_mut(bin as usize).is_some_and(|r| r.add_pair(half_squared_difference))
    }

    /// Adds the contribution of next event estimation to a sample of `bin`, divided by the probability that it is used;
    /// limits as in [`Self::log`]. The square has that probability as its weight, so that the sum is the one of samples
    /// that all use it and are not divided.
    #[inline]
    pub fn log_nee(&mut self, bin: u32, x: [f32; 3], nee_probability: f32) {
        let finite = x.iter().all(|x| x.is_finite()) && nee_probability.is_finite();
        if let Some(r) = self.used_mut().get_mut(bin as usize).filter(|_| finite) {
            r.add_nee(x, nee_probability);
        }
    }

    /// Adds a shadow ray from a vertex in the leaf of `bin` towards the bin's directions
    /// ([`super::Cache::bins_towards`]), and whether it was unoccluded. `false` if it was not taken: the bin does not
    /// exist or has [`BIN_LIMIT`](super::BIN_LIMIT) of this iteration, the first ones;
    /// [`crate::Counters::shadows_refused`] counts them.
    #[inline]
    pub fn log_shadow(&mut self, bin: u32, visible: bool) -> bool {
        self.shadows_mut().get_mut(bin as usize).is_some_and(|s| s.add(visible))
    }

    pub(super) fn records(&self) -> &[BinRecord] {
        self.records.get(..self.used).unwrap_or(&[])
    }

    pub(super) fn shadows(&self) -> &[ShadowRecord] {
        self.shadows.get(..self.used).unwrap_or(&[])
    }

    #[inline]
    fn shadows_mut(&mut self) -> &mut [ShadowRecord] {
        self.shadows.get_mut(..self.used).unwrap_or(&mut [])
    }

    #[inline]
    fn used_mut(&mut self) -> &mut [BinRecord] {
        self.records.get_mut(..self.used).unwrap_or(&mut [])
    }
}
