//! Room for leaves, from which the bytes of both sides of the cache follow.

use super::bins::BINS;
use super::tree::{MAX_LEAVES, ROOTS};

/// How many nodes and leaves there is room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheSize {
    pub(super) subdivisions: u32,
}

impl CacheSize {
    /// Trees that never grow.
    pub const SMALLEST: Self = Self { subdivisions: 0 };

    /// Most subdivisions whose leaves have numbers.
    pub(super) const MAX_SUBDIVISIONS: u32 = (MAX_LEAVES - ROOTS) / 7;

    /// Leaves of all octrees.
    pub fn leaves(self) -> u32 {
        ROOTS + 7 * self.subdivisions
    }

    pub(super) fn bins(self) -> usize {
        self.leaves() as usize * BINS
    }
}
