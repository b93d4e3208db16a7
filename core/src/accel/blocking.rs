//! Which triangles end a search for any hit.

use core::cell::Cell;

/// Decides for candidate hits of rays that look for any.
pub(super) trait Blocking: Copy {
    /// Every triangle blocks: there is nothing to ask.
    const ALL: bool;

    /// Whether `triangle` ends the rays `lanes`, which all hit it.
    fn blocks(self, triangle: u32, lanes: u32) -> bool;
}

/// Every triangle blocks.
#[derive(Clone, Copy)]
pub(super) struct Everything;

impl Blocking for Everything {
    const ALL: bool = true;

    #[inline(always)]
    fn blocks(self, _: u32, _: u32) -> bool {
        true
    }
}

/// The caller says which triangles block; the others are counted.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    /// Does the triangle of this index block?
    pub blocks: &'a dyn Fn(u32) -> bool,
    /// Triangles that did not, by lane.
    pub passed: &'a [Cell<u32>; 8],
}

impl Blocking for Asked<'_> {
    const ALL: bool = false;

    #[inline(never)]
    fn blocks(self, triangle: u32, lanes: u32) -> bool {
        let blocks = (self.blocks)(triangle);
        for (i, passed) in self.passed.iter().enumerate() {
            passed.set(passed.get().saturating_add(lanes >> i & u32::from(!blocks)));
        }
        blocks
    }
}
