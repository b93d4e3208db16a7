//! What a shard keeps between packets.

use super::book::{BookRecord, Bookkeeping};
use super::camera_rays::{CameraCursor, CursorRecord};
use super::job::Job;
use super::ring::{Ring, RingRecord};
use super::roulette::CombNumbers;
use crate::memory::{Carver, Measure, MemoryError};
use crate::world::{Iteration, World};
use bytemuck::{Pod, Zeroable};

/// All that changes while a shard works.
#[derive(Debug)]
pub(crate) struct State<'m> {
    /// Where the shard is in its camera samples.
    pub cursor: CameraCursor,
    /// Vertices that wait for their samples.
    pub ring: Ring<'m>,
    /// Radiance and cost of what is in flight, sums of what is finished.
    pub book: Bookkeeping<'m>,
    /// Numbers of the combs.
    pub comb: CombNumbers,
}

/// What a shard's state holds besides its slabs and sums.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct StateRecord {
    cursor: CursorRecord,
    ring: RingRecord,
    book: BookRecord,
    /// Numbers drawn for the combs.
    drawn: u64,
}

impl<'m> State<'m> {
    /// Bytes of a shard with so many pixels; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(m: Measure, job: &Job, pixels: usize) -> Measure {
        Bookkeeping::measure(Ring::measure(m, job.settings.ring as usize), job, pixels)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, job: &Job, pixels: usize) -> Result<Self, MemoryError> {
        Ok(Self {
            cursor: CameraCursor::finished(),
            ring: Ring::carve(c, job.settings.ring as usize)?,
            book: Bookkeeping::carve(c, job, pixels)?,
            comb: CombNumbers::new(0, 0, 0),
        })
    }

    /// All but slabs and sums, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> StateRecord {
        StateRecord {
            cursor: self.cursor.suspend(),
            ring: self.ring.suspend(),
            book: self.book.suspend(),
            drawn: self.comb.suspend(),
        }
    }

    /// Goes on in `iteration` as shard `index` with the slabs and sums that the memory holds; `None` if the record is
    /// not that of such a state.
    pub(crate) fn resume(&mut self, job: &Job, index: u32, iteration: Iteration, r: &StateRecord) -> Option<()> {
        self.cursor = CameraCursor::resume(&job.tiles, index, &r.cursor)?;
        self.ring.resume(&r.ring)?;
        self.book.resume(&r.book)?;
        self.comb = CombNumbers::new(job.settings.seed, iteration.number, index).resume(r.drawn);
        Some(())
    }

    /// Empties everything.
    pub(crate) fn reset(&mut self) {
        self.cursor = CameraCursor::finished();
        self.ring.reset();
        self.book.reset();
    }

    /// Joins an iteration as shard `index`; what one that was given up has left is forgotten.
    pub(crate) fn begin<W: World>(&mut self, world: &W, job: &Job, index: u32) {
        let iteration = world.iteration();
        self.ring.reset();
        self.book.begin(world.learned());
        self.cursor = CameraCursor::new(&job.tiles, index, iteration.samples);
        self.comb = CombNumbers::new(job.settings.seed, iteration.number, index);
    }
}
