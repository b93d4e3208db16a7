//! Stage `occlude`: shadow rays. In scenes of opaque things any hit blocks; elsewhere rays walk from surface to surface
//! and multiply a transmittance.

use super::book::Bookkeeping;
use super::crossing::{across, media_towards};
use super::packets::{Samples8, ShadowRays8};
use super::shading::{may_pass, straight_share};
use super::surfaces::{own_surfaces, places};
use crate::bsdf;
use crate::cost::COST_SHADOW;
use crate::geometry::{self, Hit8, NO_INSTANCE, Ray8, SurfaceHit8};
use crate::media::{self, Segment8};
use crate::sampler::Numbers8;
use crate::scene::blob::{MATERIAL_CUTOUT, Material, NONE};
use crate::scene::{Effects, Scene};
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Most surfaces that a shadow ray passes.
pub const MAX_PASSED: u32 = 1024;

/// The lanes of a packet to whose light sample light passes; what it brings is multiplied by the transmittance.
#[inline(always)]
pub(crate) fn occlude<W: World>(
    world: &W,
    book: &mut Bookkeeping<'_>,
    samples: &Samples8,
    s: &mut ShadowRays8,
) -> Mask8 {
    if may_pass::<W>(world.scene()) {
        return walk(world, book, samples, s);
    }
    count(book, s, s.active);
    s.active.and_not(world.occluded(&s.ray, s.active))
}

/// Counts and charges a ray in each lane of `mask`.
#[inline(always)]
fn count(book: &mut Bookkeeping<'_>, s: &ShadowRays8, mask: Mask8) {
    book.counters.occlude.count(mask.count());
    book.counters.shadow_rays += u64::from(mask.count());
    book.charge(mask, &s.path, COST_SHADOW);
}

/// Does the triangle block light for sure? Others may let it pass straight on.
fn blocks(scene: &Scene<'_>, triangle: u32) -> bool {
    let material = scene.triangles.get(triangle as usize).and_then(|t| scene.materials.get(t.material as usize));
    // a boundary may lie hidden in a medium of higher priority
    let may_pass =
        |m: &Material| bsdf::straight_kinds() >> m.kind & 1 == 1 || m.flags & MATERIAL_CUTOUT != 0 || m.medium != NONE;
    !material.is_some_and(may_pass)
}

/// Shadow rays where some things let light pass straight on: a search for what blocks for sure, then a walk through the
/// rest.
#[inline(never)]
fn walk<W: World>(world: &W, book: &mut Bookkeeping<'_>, samples: &Samples8, s: &mut ShadowRays8) -> Mask8 {
    let scene = world.scene();
    let mut media = media_towards(world, samples, s.ray.d);
    count(book, s, s.active);
    let met = world.occluded_by(&s.ray, s.active, &|t| blocks(scene, t));
    let mut active = s.active.and_not(met.blocked);
    let (mut left, none) = (met.passed, U32x8::splat(0));
    let in_medium = if W::EFFECTS.contains(Effects::MEDIA) { media.inside() } else { Mask8::NONE };
    let mut arrived = active & left.eq(none).and_not(in_medium);
    active = active.and_not(arrived);
    if active.none() {
        return arrived;
    }
    let (mut ray, mut transmittance) = (s.ray, Vec3x8::ONE);
    let target = ray.o + ray.d;
    let infinite = ray.tmax.eq(F32x8::INFINITY);
    for passed in 0..MAX_PASSED {
        // what is left to pass is known: behind the last of it nothing needs to be traced
        let search = active.and_not(left.eq(none));
        let (u, v, instance) = (F32x8::ZERO, F32x8::ZERO, NO_INSTANCE);
        let mut hit = Hit8 { hit: Mask8::NONE, t: ray.tmax, triangle: none, u, v, instance };
        if search.any() {
            count(book, s, search);
            hit = world.closest(&ray, search);
            hit.hit &= search;
        }
        let mut surface = SurfaceHit8::gather(scene, &hit);
        let mut point = if places::<W>(scene) { surface.place(scene, ray.time) } else { surface.point() };
        let own = own_surfaces(world.intersector(), &ray, &mut hit, &mut surface, &mut point);
        if hit.hit.any() {
            let share = straight_share(world, &surface, own.as_ref(), -ray.d.normalize(), point.ng, media);
            transmittance = Vec3x8::select(hit.hit, transmittance * share, transmittance);
        }
        if W::EFFECTS.contains(Effects::MEDIA) {
            let inside = active & media.inside() & transmittance.any_positive();
            if inside.any() {
                let segment = Segment8 { o: ray.o, d: ray.d, tmax: hit.hit.select(hit.t, ray.tmax) };
                let sampler = world.sampler();
                let numbers = Numbers8 { sampler, key: samples.key.shadow_stretch(sampler, passed) };
                let through = media::transmittance(W::EFFECTS, scene, media.met(), &segment, numbers, inside);
                transmittance = Vec3x8::select(inside, transmittance * through.transmittance, transmittance);
                book.charge_medium(inside, &s.path, through.steps, through.roulettes);
            }
        }
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
        left = U32x8::select(left.eq(none), none, left - U32x8::splat(1));
    }
    book.counters.passages_cut += u64::from(active.count());
    s.found.pixel *= transmittance;
    s.found.local *= transmittance;
    arrived
}
