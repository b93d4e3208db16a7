//! What a shard keeps between packets.

use super::book::{BookRecord, Bookkeeping};
use super::camera_rays::{CameraCursor, CursorRecord};
use super::job::Job;
use super::light_paths::packets_of;
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
    /// Packets of light paths that are left; they come before the camera samples.
    pub light_packets: u32,
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
    light_packets: u64,
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
            light_packets: 0,
        })
    }

    /// All but slabs and sums, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> StateRecord {
        StateRecord {
            cursor: self.cursor.suspend(),
            ring: self.ring.suspend(),
            book: self.book.suspend(),
            drawn: self.comb.suspend(),
            light_packets: self.light_packets.into(),
        }
    }

    /// Goes on in `iteration` as shard `index` with the slabs and sums that the memory holds; `None` if the record is
    /// not that of such a state.
    pub(crate) fn resume(&mut self, job: &Job, index: u32, iteration: Iteration, r: &StateRecord) -> Option<()> {
        self.cursor = CameraCursor::resume(&job.tiles, index, &r.cursor)?;
        self.ring.resume(&r.ring)?;
        self.book.resume(&r.book)?;
        self.comb = CombNumbers::new(job.settings.seed, iteration.number, index).resume(r.drawn);
        let most = if job.guide.is_some() { packets_of(&job.tiles, index) } else { 0 };
        self.light_packets = u32::try_from(r.light_packets).ok().filter(|left| *left <= most)?;
        Some(())
    }

    /// Empties everything.
    pub(crate) fn reset(&mut self) {
        self.cursor = CameraCursor::finished();
        self.ring.reset();
        self.book.reset();
        self.light_packets = 0;
    }

    /// Joins an iteration as shard `index`; what one that was given up has left is forgotten.
    pub(crate) fn begin<W: World>(&mut self, world: &W, job: &Job, index: u32) {
        let iteration = world.iteration();
        self.ring.reset();
        self.book.begin(world.learned());
        self.cursor = CameraCursor::new(&job.tiles, index, iteration.samples);
        self.comb = CombNumbers::new(job.settings.seed, iteration.number, index);
        let trained = W::GUIDING && iteration.first_sample == 0 && world.learned().wants_light_paths();
        self.light_packets = if trained { packets_of(&job.tiles, index) } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::world;
    use crate::world::World;
    use crate::{Budget, StepResult};

    /// A record of a shard without a guide has no light paths left. Killed by: a number that is believed, which no step
    /// would ever work off.
    #[test]
    fn forged_light_paths_are_refused() {
        world(
            |_| (),
            |world, shard| {
                let (job, record) = (shard.job, shard.state.suspend());
                let mut resumes = |light_packets| {
                    let forged = StateRecord { light_packets, ..record };
                    shard.state.resume(&job, 0, world.iteration(), &forged).is_some()
                };
                assert!(resumes(0) && !resumes(1) && !resumes(1 << 32));
            },
        );
    }

    /// A shard whose kernels trace no light paths is done without them. Killed by: a shard that waits for them for ever.
    #[test]
    fn forged_light_paths_are_left_out() {
        world(
            |_| (),
            |world, shard| {
                shard.state.light_packets = 7;
                while shard.step(world, Budget { rays: 1000 }) == StepResult::More {}
                assert!(shard.is_done(world.identity()));
            },
        );
    }
}
