//! One record per camera sample in flight: what its whole tree of paths has gathered.

use super::free_list::FreeList;
use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};

/// A camera sample whose paths are not all finished.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Root {
    /// Radiance gathered so far; f64 because a split sample sums thousands of terms.
    pub radiance: [f64; 3],
    /// Pixel slot of the shard.
    pub pixel: u32,
    /// Waiting vertices and lanes in flight that belong to it.
    pub open: u32,
    /// Rays traced for it.
    pub rays: u32,
    /// Samples that its splits have added.
    pub splits: u32,
    /// Film index of the pixel.
    pub film: u32,
    /// What a squared error of this pixel's rgb counts in the error of the picture.
    pub importance: [f32; 3],
}

/// A fixed slab of roots.
#[derive(Debug)]
pub(crate) struct Roots<'m> {
    slots: &'m mut [Root],
    free: FreeList<'m>,
}

impl<'m> Roots<'m> {
    pub(crate) fn measure(m: Measure, capacity: usize) -> Measure {
        FreeList::measure(m.add::<Root>(capacity), capacity)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, capacity: usize) -> Result<Self, MemoryError> {
        let slots = c.take(capacity)?;
        Ok(Self { slots, free: FreeList::carve(c, capacity)? })
    }

    /// Forgets all that is open.
    pub(crate) fn reset(&mut self) {
        self.free.reset();
    }

    /// A new root with one open lane. `None` cannot happen while roots outnumber vertices by two packets.
    pub(crate) fn open(&mut self, pixel: u32, film: u32, importance: [f32; 3]) -> Option<u32> {
        let slot = self.free.take()?;
        self.slots[slot as usize] = Root { pixel, film, importance, open: 1, ..Zeroable::zeroed() };
        Some(slot)
    }

    pub(crate) fn get(&mut self, slot: u32) -> &mut Root {
        &mut self.slots[slot as usize]
    }

    /// Closes one vertex or lane; the finished root if it was the last.
    pub(crate) fn close(&mut self, slot: u32) -> Option<Root> {
        let root = &mut self.slots[slot as usize];
        root.open -= 1;
        if root.open > 0 {
            return None;
        }
        let done = *root;
        self.free.give(slot);
        Some(done)
    }
}
