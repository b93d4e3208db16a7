//! Room for leaves, from which the bytes of both sides of the cache follow.

use super::bins::BINS;
use super::kind::ROOTS;
use super::tree::MAX_LEAVES;

/// Capacity of a cache: nodes and leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheSize {
    pub(super) subdivisions: u32,
}

impl CacheSize {
    /// Capacity of the roots alone: trees that never grow.
    pub const SMALLEST: Self = Self { subdivisions: 0 };

    /// Largest number of subdivisions: more leaves would have no numbers.
    pub(super) const MAX_SUBDIVISIONS: u32 = (MAX_LEAVES - ROOTS) / 7;

    /// Number of leaves, of all octrees.
    pub fn leaves(self) -> u32 {
        ROOTS + 7 * self.subdivisions
    }

    pub(crate) fn bins(self) -> usize {
        self.leaves() as usize * BINS
    }
}
