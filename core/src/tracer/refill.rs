//! Stage `refill`: eight samples of waiting vertices of one class or, while there is room for what they may lead to,
//! eight camera samples.

use super::book::Bookkeeping;
use super::camera_rays::{CameraCursor, camera_rays};
use super::class::{PacketClass, Queue};
use super::job::Job;
use super::path::Path8;
use super::ray_state::RayState8;
use super::ring::{RESERVE, Ring};
use super::vertex::PathVertex8;
use crate::rng::Key8;
use crate::world::World;
use croupier_simd::{Mask8, U32x8};

/// Samples of waiting vertices, all of one class.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Samples8 {
    /// The vertices that they are drawn at.
    pub vertex: PathVertex8,
    /// Lanes with a sample.
    pub active: Mask8,
    /// Lanes whose path may have another segment.
    pub continues: Mask8,
    /// Kernel that they need.
    pub class: PacketClass,
    /// Do they draw light samples?
    pub with_nee: bool,
    /// Whose samples these are: the vertices' roots and depths, ledger records of their own.
    pub path: Path8,
    /// Random keys.
    pub key: Key8,
}

/// What a packet is filled with.
#[expect(clippy::large_enum_variant, reason = "taken apart at once by its only caller")]
pub(crate) enum Refill {
    /// Samples of waiting vertices.
    Samples(Samples8),
    /// Camera rays.
    Camera(RayState8),
    /// No lane this time; there may be some next time.
    Empty,
    /// Nothing, and nothing will come.
    Done,
}

/// The next packet of shard `index`.
#[inline(always)]
pub(crate) fn refill<W: World>(
    world: &W,
    job: &Job,
    index: u32,
    cursor: &mut CameraCursor,
    ring: &mut Ring<'_>,
    book: &mut Bookkeeping<'_>,
) -> Refill {
    let room = ring.free() >= 2 * RESERVE && !cursor.is_finished();
    match ring.fullest() {
        Some((fullest, pending)) if pending >= 8 || !room => {
            samples(world.max_depth(), fullest, ring, book).map_or(Refill::Empty, Refill::Samples)
        }
        _ if room => camera_rays(world, job, index, cursor, book).map_or(Refill::Empty, Refill::Camera),
        _ => Refill::Done,
    }
}

/// Samples of the fullest queue, or of the next from which a sample fits; booked on their roots and ledger records: a
/// lane each, less the vertex if it is drained.
fn samples(max_depth: u32, fullest: Queue, ring: &mut Ring<'_>, book: &mut Bookkeeping<'_>) -> Option<Samples8> {
    let mut queues = core::iter::once(fullest).chain(Queue::all());
    let batch = queues.find_map(|q| ring.take(q, |v, lanes, drained| book.draw(v, lanes, drained)))?;
    let v = batch.vertex;
    let active = Mask8::first(batch.lanes);
    book.counters.scatter.count(batch.lanes as u32);
    book.counters.vertex_samples += batch.lanes as u64;
    Some(Samples8 {
        active,
        continues: active & v.path.depth.lt(U32x8::splat(max_depth)),
        class: batch.class,
        with_nee: batch.with_nee,
        path: Path8 { record: book.open_samples(v.path.record, batch.lanes, batch.with_nee), ..v.path },
        key: v.key.sample(batch.sample),
        vertex: v,
    })
}
