//! The surfaces of hits: triangles of the scene, or what a host's intersector brings.

use crate::accel::Intersector;
use crate::geometry::{Hit8, NO_INSTANCE, OwnHits8, Ray8, SurfaceHit8, SurfacePoint8};
use crate::scene::{Effects, Scene};
use crate::world::World;
use croupier_simd::{F32x8, U32x8};

/// Does the scene place triangles in instances?
#[inline(always)]
pub(crate) fn places<W: World>(scene: &Scene<'_>) -> bool {
    W::EFFECTS.contains(Effects::INSTANCES) && scene.effects.contains(Effects::INSTANCES)
}

/// Texture coordinates of hits.
#[inline(always)]
pub(super) fn coordinates(scene: &Scene<'_>, hit: &SurfaceHit8, own: Option<&OwnHits8>) -> [F32x8; 2] {
    let [wa, wb, wc] = hit.weights();
    let of = |k: usize| hit.coordinates(scene, k);
    let ([au, av], [bu, bv], [cu, cv]) = (of(0), of(1), of(2));
    let at = [au * wa + bu * wb + cu * wc, av * wa + bv * wb + cv * wc];
    own.map_or(at, |own| own.coordinates(at))
}

/// What is known of the surfaces of the host's own that `rays` hit, if there are any; `hit` and `point` get their places
/// and materials. Parts are handed in, not returned: kernels without such surfaces copy nothing.
#[inline(always)]
pub(crate) fn own_surfaces<I: Intersector>(
    intersector: &I,
    rays: &Ray8,
    traced: &mut Hit8,
    hit: &mut SurfaceHit8,
    point: &mut SurfacePoint8,
) -> Option<OwnHits8> {
    if !I::SURFACES {
        return None;
    }
    let own = traced.own();
    if own.none() {
        return None;
    }
    let surface = intersector.surface(rays, traced, own);
    // instances of own surfaces are the host's
    traced.instance = [0, 1].map(|k| U32x8::select(own, NO_INSTANCE[k], traced.instance[k]));
    hit.instance = traced.instance;
    Some(OwnHits8::new(own, surface, hit, point))
}
