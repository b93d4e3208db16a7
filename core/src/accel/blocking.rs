//! Which triangles end a search for any hit.

/// Decides for candidate hits of rays that look for any.
pub(super) trait Blocking {
    /// Every triangle blocks: there is nothing to ask.
    const ALL: bool;

    /// Whether `triangle` ends the rays `lanes`, which all hit it.
    fn blocks(&mut self, triangle: u32, lanes: u32) -> bool;
}

/// Every triangle blocks.
pub(super) struct Everything;

impl Blocking for Everything {
    const ALL: bool = true;

    #[inline(always)]
    fn blocks(&mut self, _: u32, _: u32) -> bool {
        true
    }
}

/// The caller says which triangles block; the others are counted.
pub(super) struct Asked<'a> {
    /// Does the triangle of this index block?
    pub blocks: &'a dyn Fn(u32) -> bool,
    /// Triangles that did not, by lane.
    pub passed: [u32; 8],
}

impl Blocking for Asked<'_> {
    const ALL: bool = false;

    #[inline(never)]
    fn blocks(&mut self, triangle: u32, lanes: u32) -> bool {
        let blocks = (self.blocks)(triangle);
        for (i, passed) in self.passed.iter_mut().enumerate() {
            *passed = passed.saturating_add(lanes >> i & u32::from(!blocks));
        }
        blocks
    }
}
