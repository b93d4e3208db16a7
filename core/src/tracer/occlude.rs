//! Stage `occlude`: shadow rays, any hit.

use super::book::Bookkeeping;
use super::packets::ShadowRays8;
use crate::accel::Intersector;
use crate::cost::COST_SHADOW;
use crate::world::World;
use croupier_simd::Mask8;

/// The lanes of a packet whose light sample nothing hides.
#[inline(always)]
pub(crate) fn occlude<W: World>(world: &W, book: &mut Bookkeeping<'_>, s: &ShadowRays8) -> Mask8 {
    book.counters.occlude.count(s.active.count());
    book.counters.shadow_rays += u64::from(s.active.count());
    book.charge(s.active, &s.path, COST_SHADOW);
    s.active.and_not(world.intersector().occluded(&s.ray, s.active))
}
