//! The surfaces of hits: triangles of the scene, or what a host's intersector brings.

use crate::accel::Intersector;
use crate::geometry::{Hit8, NO_INSTANCE, OwnHits8, Ray8, SurfaceHit8, SurfacePoint8};
use crate::scene::{Effects, Scene};
use crate::world::World;
use croupier_simd::U32x8;

/// Does the scene place triangles in instances?
#[inline(always)]
pub(crate) fn places<W: World>(scene: &Scene<'_>) -> bool {
    W::EFFECTS.contains(Effects::INSTANCES) && scene.effects.contains(Effects::INSTANCES)
}

/// The surfaces that `rays` hit, their points, and what is known of those of the host's own, if there are any.
#[inline(always)]
pub(crate) fn surfaces<W: World>(
    world: &W,
    rays: &Ray8,
    hit: &mut Hit8,
) -> (SurfaceHit8, SurfacePoint8, Option<OwnHits8>) {
    surfaces_of(world.scene(), world.intersector(), places::<W>(world.scene()), rays, hit)
}

/// [`surfaces`] of a scene that has instances if `places`.
#[inline(always)]
pub(super) fn surfaces_of<I: Intersector>(
    scene: &Scene<'_>,
    intersector: &I,
    places: bool,
    rays: &Ray8,
    traced: &mut Hit8,
) -> (SurfaceHit8, SurfacePoint8, Option<OwnHits8>) {
    if !I::SURFACES {
        let mut hit = SurfaceHit8::gather(scene, traced);
        let point = if places { hit.place(scene, rays.time) } else { hit.point() };
        return (hit, point, None);
    }
    let own = traced.own();
    let found = if own.any() { Some(intersector.surface(rays, traced, own)) } else { None };
    // instances of own surfaces are the host's
    traced.instance = [0, 1].map(|k| U32x8::select(own, NO_INSTANCE[k], traced.instance[k]));
    let mut hit = SurfaceHit8::gather(scene, traced);
    let mut point = if places { hit.place(scene, rays.time) } else { hit.point() };
    let found = found.map(|surface| OwnHits8::new(own, surface, &mut hit, &mut point));
    (hit, point, found)
}
