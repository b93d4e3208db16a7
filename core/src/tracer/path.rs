//! Which paths the lanes of a packet belong to.

use croupier_simd::U32x8;

/// Where eight lanes keep their books.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Path8 {
    /// Root slots: the camera samples that the lanes are part of.
    pub root: U32x8,
    /// Ledger records of the samples that the lanes are, or [`NO_RECORD`](super::ledger::NO_RECORD).
    pub record: U32x8,
    /// Path segments from the camera.
    pub depth: U32x8,
}

#[cfg(test)]
impl Path8 {
    /// Root, record and depth of one lane.
    pub(crate) fn lane(&self, i: usize) -> [u32; 3] {
        [self.root.lane(i), self.record.lane(i), self.depth.lane(i)]
    }
}
