//! What a shard keeps between packets.

use super::book::Bookkeeping;
use super::camera_rays::CameraCursor;
use super::job::Job;
use super::ring::Ring;
use super::roulette::CombNumbers;
use crate::memory::{Carver, Measure, MemoryError};
use crate::world::World;

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

impl<'m> State<'m> {
    /// Bytes of a shard with so many pixels; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(job: &Job, pixels: usize) -> Measure {
        Bookkeeping::measure(Ring::measure(Measure::new(), job.settings.ring as usize), job, pixels)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, job: &Job, pixels: usize) -> Result<Self, MemoryError> {
        Ok(Self {
            cursor: CameraCursor::finished(),
            ring: Ring::carve(c, job.settings.ring as usize)?,
            book: Bookkeeping::carve(c, job, pixels)?,
            comb: CombNumbers::new(0, 0, 0),
        })
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
