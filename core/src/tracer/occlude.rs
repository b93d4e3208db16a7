//! Stage `occlude`: shadow rays. In scenes of opaque things any hit blocks; elsewhere rays walk from surface to surface
//! and gather a transmittance.

use super::book::Bookkeeping;
use super::crossing::across;
use super::packets::ShadowRays8;
use super::shading::{may_pass, straight_share};
use crate::accel::Intersector;
use crate::cost::COST_SHADOW;
use crate::geometry::{self, Hit8, Ray8, SurfaceHit8};
use crate::media::{self, Segment8};
use crate::scene::Effects;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Most surfaces that a shadow ray passes.
pub const MAX_PASSED: u32 = 1024;

/// The lanes of a packet to whose light sample light passes; what it brings is multiplied by the transmittance.
#[inline(always)]
pub(crate) fn occlude<W: World>(world: &W, book: &mut Bookkeeping<'_>, s: &mut ShadowRays8) -> Mask8 {
    if may_pass::<W>(world.scene()) {
        return walk(world, book, s);
    }
    count(book, s, s.active);
    s.active.and_not(world.intersector().occluded(&s.ray, s.active))
}

/// Counts and charges a ray in each lane of `mask`.
#[inline(always)]
fn count(book: &mut Bookkeeping<'_>, s: &ShadowRays8, mask: Mask8) {
    book.counters.occlude.count(mask.count());
    book.counters.shadow_rays += u64::from(mask.count());
    book.charge(mask, &s.path, COST_SHADOW);
}

/// Follows the rays through all that lets light pass straight on.
#[inline(never)]
fn walk<W: World>(world: &W, book: &mut Bookkeeping<'_>, s: &mut ShadowRays8) -> Mask8 {
    let scene = world.scene();
    let (mut active, mut arrived, mut transmittance) = (s.active, Mask8::NONE, Vec3x8::ONE);
    let (mut ray, mut media) = (s.ray, s.media);
    let target = ray.o + ray.d;
    let infinite = ray.tmax.eq(F32x8::INFINITY);
    for passed in 0..MAX_PASSED {
        count(book, s, active);
        let mut hit = world.intersector().closest(&ray, active);
        hit.hit &= active;
        let surface = SurfaceHit8::gather(scene, &hit);
        let point = surface.point();
        let share = if hit.hit.any() {
            straight_share::<W>(scene, &surface, -ray.d.normalize(), point.ng, media)
        } else {
            F32x8::ZERO
        };
        active = active.and_not(hit.hit & share.le(F32x8::ZERO));
        if W::EFFECTS.contains(Effects::MEDIA) {
            let inside = active & media.inside();
            if inside.any() {
                let segment = Segment8 { o: ray.o, d: ray.d, tmax: end(&hit, &ray) };
                let key = s.key.child(U32x8::splat(!passed));
                let through = media::transmittance(W::EFFECTS, scene, media.met(), &segment, key, inside);
                transmittance = Vec3x8::select(inside, transmittance * through.transmittance, transmittance);
                book.charge_medium(inside, &s.path, through.steps, through.roulettes);
            }
        }
        transmittance = Vec3x8::select(hit.hit, transmittance * share, transmittance);
        active &= transmittance.any_positive();
        arrived |= active.and_not(hit.hit);
        active &= hit.hit;
        if active.none() {
            break;
        }
        media = across(world, media, &surface, point.ng, ray.d, active);
        let o = geometry::offset(point.p, point.ng, point.error, ray.d);
        let d = Vec3x8::select(infinite, ray.d, target - o);
        // behind the light sample by the offset: nothing is left to pass
        let beyond = active & d.dot(ray.d).le(F32x8::ZERO);
        arrived |= beyond;
        active = active.and_not(beyond);
        ray = Ray8 { o, d, ..ray };
    }
    book.counters.passages_cut += u64::from(active.count());
    s.found.pixel = s.found.pixel * transmittance;
    s.found.local = s.found.local * transmittance;
    arrived
}

/// Where the segments end: at the hit, or at the light sample.
#[inline(always)]
fn end(hit: &Hit8, ray: &Ray8) -> F32x8 {
    hit.hit.select(hit.t, ray.tmax)
}
