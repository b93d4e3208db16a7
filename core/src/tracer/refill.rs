//! Stage `refill`: eight samples of waiting vertices of one class or, while there is room for what they may lead to,
//! eight camera samples.

use super::book::Bookkeeping;
use super::camera_rays::CameraCursor;
use super::class::{PacketClass, Queue};
use super::packets::Samples8;
use super::path::Path8;
use super::ring::{RESERVE, Ring, Taken8};
use super::shading::moves;
use super::vertex::PathVertex8;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8};

/// What a packet is filled with.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Refill {
    /// Samples of waiting vertices.
    Samples(Taken8),
    /// Rays on their way.
    Straight(Taken8),
    /// Camera samples.
    Camera,
    /// Nothing, and nothing will come.
    Done,
}

/// Decides what the next packet is filled with, and takes samples out of the ring: those of the fullest queue, or of
/// the next from which one fits. They are booked on their roots and ledger records: a lane each, less the vertex if it
/// is drained.
#[inline(always)]
pub(crate) fn refill(cursor: &CameraCursor, ring: &mut Ring<'_>, book: &mut Bookkeeping<'_>) -> Refill {
    let room = ring.free() >= 2 * RESERVE && !cursor.is_finished();
    match ring.fullest() {
        Some((fullest, pending)) if pending >= 8 || !room => {
            let mut take = |q| ring.take(q, |v, lanes, drained| book.draw(v, lanes, drained));
            match take(fullest).or_else(|| Queue::all().find_map(take)) {
                Some(taken) if taken.queue.class() == PacketClass::STRAIGHT => Refill::Straight(taken),
                Some(taken) => Refill::Samples(taken),
                None => Refill::Done,
            }
        }
        _ if room => Refill::Camera,
        _ => Refill::Done,
    }
}

/// A packet of the samples that were just taken.
#[inline(always)]
pub(crate) fn samples<W: World>(world: &W, ring: &Ring<'_>, book: &mut Bookkeeping<'_>, taken: &Taken8) -> Samples8 {
    let vertex = PathVertex8::from_records(ring.records(taken));
    let active = Mask8::first(taken.lanes);
    let (class, with_nee) = (taken.queue.class(), taken.queue.with_nee());
    book.counters.scatter.count(taken.lanes as u32);
    book.counters.vertex_samples += taken.lanes as u64;
    let guided =
        if W::GUIDING && !world.learned().guides() { book.roots.guided(vertex.path.root, active) } else { active };
    let record = book.open_samples::<W>(vertex.path.record, taken.lanes, with_nee);
    Samples8 {
        active,
        guided,
        continues: active & vertex.path.depth.lt(U32x8::splat(world.max_depth())),
        class,
        with_nee,
        path: Path8 { record, ..vertex.path },
        key: vertex.key.sample(world.sampler(), taken.sample),
        time: if moves::<W>(world.scene()) { book.roots.times(vertex.path.root, active) } else { F32x8::ZERO },
        vertex,
    }
}
