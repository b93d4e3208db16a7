//! Stage `trace`: closest hits.

use super::book::Bookkeeping;
use super::packets::RayState8;
use crate::accel::Intersector;
use crate::cost::COST_BOUNCE;
use crate::geometry::Hit8;
use crate::world::World;

/// What the rays of a packet hit.
#[inline(always)]
pub(crate) fn trace<W: World>(world: &W, book: &mut Bookkeeping<'_>, rays: &RayState8) -> Hit8 {
    let n = rays.active.count();
    book.counters.trace.count(n);
    // camera rays are counted where they begin; a packet holds rays of one kind
    if rays.path.depth.lane(rays.active.lanes().next().unwrap_or(0)) > 1 {
        book.counters.scatter_rays += u64::from(n);
    }
    book.charge(rays.active, &rays.path, COST_BOUNCE);
    let mut hit = world.intersector().closest(&rays.ray, rays.active);
    // a host's intersector may answer for lanes that it was not asked about
    hit.hit &= rays.active;
    hit
}
