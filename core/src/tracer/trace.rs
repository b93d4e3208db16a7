//! Stage `trace`: closest hits.

use super::book::Bookkeeping;
use super::packets::{RayKind, RayState8};
use crate::cost::{COST_BOUNCE, COST_CAMERA, COST_STRAIGHT};
use crate::geometry::Hit8;
use crate::world::World;

/// What the rays of a packet hit.
#[inline(always)]
pub(crate) fn trace<W: World>(world: &W, book: &mut Bookkeeping<'_>, rays: &RayState8, kind: RayKind) -> Hit8 {
    let n = rays.active.count();
    book.counters.trace.count(n);
    let cost = match kind {
        // counted where they begin
        RayKind::Camera => COST_CAMERA,
        RayKind::Scattered => {
            book.counters.scatter_rays += u64::from(n);
            COST_BOUNCE
        }
        RayKind::Straight => {
            book.counters.straight_rays += u64::from(n);
            COST_STRAIGHT
        }
    };
    book.charge(rays.active, &rays.path, cost);
    let mut hit = world.closest(&rays.ray, rays.active);
    // a host's intersector may answer for lanes that it was not asked about
    hit.hit &= rays.active;
    hit
}
