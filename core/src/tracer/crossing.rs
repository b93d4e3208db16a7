//! The media on the other side of surfaces.

use super::class::Kernel;
use super::media_set::{MediaSet8, media_behind};
use super::packets::Samples8;
use crate::geometry::SurfaceHit8;
use crate::scene::Effects;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// The media around rays that leave the vertices of `samples` in the directions `wi`.
#[inline(always)]
pub(crate) fn media_towards<W: World>(world: &W, samples: &Samples8, wi: Vec3x8) -> MediaSet8 {
    let (v, scene) = (&samples.vertex, world.scene());
    let surface = matches!(samples.class.kernel(), Kernel::Surface(_));
    if !W::EFFECTS.contains(Effects::MEDIA) {
        // a constant: the set is not kept
        return MediaSet8::NONE;
    }
    if !surface || scene.media.is_empty() {
        return v.media;
    }
    let inwards = wi.dot(v.ng).lt(F32x8::ZERO);
    v.media.across(&media_behind(scene, &v.material.to_array()), inwards, samples.active)
}

/// The media behind the surfaces of `hit`, which rays of directions `d` pass in the lanes of `passed`.
#[inline(always)]
pub(crate) fn across<W: World>(
    world: &W,
    media: MediaSet8,
    hit: &SurfaceHit8,
    ng: Vec3x8,
    d: Vec3x8,
    passed: Mask8,
) -> MediaSet8 {
    let scene = world.scene();
    if scene.media.is_empty() {
        return media;
    }
    media.across(&media_behind(scene, &hit.material), d.dot(ng).lt(F32x8::ZERO), passed)
}
