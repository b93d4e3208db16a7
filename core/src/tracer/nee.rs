//! Next event estimation: a light sample per lane, its weight against the BSDF sample that could have found it, and
//! roulette for its shadow ray.

use super::book::Bookkeeping;
use super::packets::{Contribution8, Samples8, ShadowRays8};
use crate::bsdf::Eval8;
use crate::geometry::{self, Ray8};
use crate::learn::cache::NO_BIN;
use crate::light::{self, LightSample8, LightSelector, Reference8, power_heuristic};
use crate::world::World;
use croupier_simd::{F32x8, U32x8, Vec3x8};

/// One light sample per lane; `None` where next event estimation does not apply to the packet.
#[inline(always)]
pub(crate) fn sample_lights<W: World>(world: &W, samples: &Samples8) -> Option<LightSample8> {
    if !samples.with_nee || samples.class.is_delta() || samples.continues.none() || world.scene().lights.is_empty() {
        return None;
    }
    Some(one_per_lane(world, samples))
}

#[inline(never)]
fn one_per_lane<W: World>(world: &W, samples: &Samples8) -> LightSample8 {
    let v = &samples.vertex;
    let at = Reference8 { p: v.p, n: v.ng, time: samples.time };
    let (scene, words) = (world.scene(), samples.key.light(world.sampler()));
    if W::LIGHT_TREES {
        light::sample_at(W::EFFECTS, scene, world.lights(), &at, words, samples.continues)
    } else {
        light::sample_at(W::EFFECTS, scene, &world.lights().without_tree(), &at, words, samples.continues)
    }
}

/// The shadow rays of a packet's light samples, whose BSDF is `f`. With `roulette` they survive by what they would
/// bring. `None` if no lane has one.
#[inline(always)]
pub(crate) fn shadow_rays<W: World>(
    world: &W,
    book: &mut Bookkeeping<'_>,
    samples: &Samples8,
    l: &LightSample8,
    f: &Eval8,
    roulette: bool,
) -> Option<ShadowRays8> {
    let v = &samples.vertex;
    book.counters.distances_clamped += u64::from((samples.continues & l.clamped).count());
    let weight = l.delta.select(F32x8::ONE, power_heuristic(l.pdf, f.pdf)) / (l.pdf * v.nee_probability);
    let radiance = v.beta * f.f * l.radiance * weight;
    let mut found = Contribution8 { pixel: radiance, local: f.f * l.radiance * weight };
    let mut active = samples.continues & l.valid & (radiance.any_positive() | !radiance.is_finite());
    let mut towards = U32x8::splat(NO_BIN);
    if roulette && active.any() {
        let learned = world.learned();
        towards = learned.bins_towards(v.bin, l.wi, active);
        let root = learned.visibility_root(towards);
        let p = learned.image8(v.error_weight).shadow_ray_probability(found.pixel, root);
        let on = active & (samples.key.shadow_roulette().lt(p) | p.ge(F32x8::ONE));
        book.counters.shadow_rays_terminated += u64::from(active.count() - on.count());
        found.pixel = found.pixel / p;
        found.local = found.local / p;
        active = on;
    }
    active.any().then(|| ShadowRays8 { active, ray: towards_light(samples, l), path: samples.path, found, towards })
}

/// Rays from the vertices to the light samples.
#[inline(always)]
fn towards_light(samples: &Samples8, l: &LightSample8) -> Ray8 {
    let v = &samples.vertex;
    let finite = geometry::shadow_ray(v.p, v.ng, v.error, l.point, l.normal, l.point_error);
    let far_o = geometry::offset(v.p, v.ng, v.error, l.wi);
    Ray8 {
        o: Vec3x8::select(l.infinite, far_o, finite.o),
        d: Vec3x8::select(l.infinite, l.wi, finite.d),
        tmin: F32x8::ZERO,
        tmax: l.infinite.select(F32x8::INFINITY, finite.tmax),
        time: samples.time,
    }
}
