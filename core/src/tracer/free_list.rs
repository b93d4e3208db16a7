//! Which slots of a slab are free. The one given back last is taken first, so that few slots stay in the processor's
//! caches.

use crate::memory::{Carver, Measure, MemoryError};

/// Numbers of free slots.
#[derive(Debug)]
pub(crate) struct FreeList<'m> {
    slots: &'m mut [u32],
    len: usize,
}

impl<'m> FreeList<'m> {
    pub(crate) fn measure(m: Measure, capacity: usize) -> Measure {
        m.add::<u32>(capacity)
    }

    /// A list without free slots, until [`Self::reset`] or [`Self::resume`].
    pub(crate) fn carve(c: &mut Carver<'m>, capacity: usize) -> Result<Self, MemoryError> {
        Ok(Self { slots: c.take_unset(capacity)?, len: 0 })
    }

    /// How many are free, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> u64 {
        self.len as u64
    }

    /// Goes on with the slots that the memory holds; `None` if so many cannot be free.
    pub(crate) fn resume(&mut self, len: u64) -> Option<()> {
        self.len = usize::try_from(len).ok().filter(|&len| len <= self.slots.len())?;
        Some(())
    }

    /// All slots are free.
    pub(crate) fn reset(&mut self) {
        self.len = self.slots.len();
        self.slots.iter_mut().zip(0..).for_each(|(s, i)| *s = i);
    }

    /// How many are free.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// A free slot, which is not free any more.
    #[inline(always)]
    pub(crate) fn take(&mut self) -> Option<u32> {
        self.len = self.len.checked_sub(1)?;
        self.slots.get(self.len).copied()
    }

    /// Gives back a slot that was taken.
    #[inline(always)]
    pub(crate) fn give(&mut self, slot: u32) {
        if let Some(place) = self.slots.get_mut(self.len) {
            *place = slot;
            self.len += 1;
        }
    }
}
