//! The whole turn of a packet, stage by stage.
//!
//! ```text
//!             +--> samples of waiting vertices --> nee, scatter --> occlude --+
//!  refill ----+--> camera rays -----------------------------------------------+--> trace --> medium --> emission --+
//!    ^        +--> waiting rays ----------------------------------------------+                 |                  |
//!    |                                                                                          |                  v
//!    +--------------------------------- waiting rays <------------------------------------------+------ pass <-- shading
//!    |                                                                                                    |
//!    +------------------------------------ settle <-- roulette <-- aov <----------------------------------+
//! ```
//!
//! Before the first camera samples of a guide that has learned nothing come packets of light paths, each from the lights to
//! its end (`light_paths.rs`).
//!
//! Camera samples of an extension that has points in place of rays (`points.rs`) join at `aov`.
//!
//! `medium` and `pass` are compiled in with effects that call for them. Waiting rays stopped in a medium, or passed what
//! they met (`passing.rs`). A collision in a medium is a vertex without a surface: it joins behind `pass`.
//!
//! Stages compute packets from packets and read nothing but the [`World`]; what outlives the packet goes to the books
//! ([`Bookkeeping`](super::book::Bookkeeping)) or, as waiting vertices, to the [`Ring`](super::ring::Ring).

use super::book::Beyond;
use super::camera_rays::camera_rays;
use super::emission;
use super::first_surfaces::first_surfaces;
use super::guide_notes::GuideNote8;
use super::job::Job;
use super::light_paths::trace_light_paths;
use super::medium::{Collision8, arrive_in_media, cross_media};
use super::nee::{sample_lights, shadow_rays};
use super::occlude::occlude;
use super::packets::RayKind;
use super::passing::{pass, straight_rays};
use super::points::begin_at_points;
use super::refill::{Refill, refill, samples};
use super::roulette::roulette;
use super::scatter::scatter;
use super::settle::settle;
use super::shading::{albedo, may_pass, moves, shade};
use super::state::State;
use super::surfaces::{own_surfaces, places};
use super::trace::trace;
use crate::extension::Extension;
use crate::geometry::SurfaceHit8;
use crate::scene::Effects;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// One packet of shard `index` through all stages; `false` when nothing is left.
pub(super) fn turn<W: World>(world: &W, job: &Job, index: u32, state: &mut State<'_>) -> bool {
    if W::GUIDING && state.light_packets > 0 {
        trace_light_paths(world, job, index, &mut state.book, &mut state.light_packets);
        return true;
    }
    let State { cursor, ring, book, comb, .. } = state;
    let settings = &job.settings;

    let filled = refill(cursor, ring, book);
    if W::Extension::POINTS && matches!(filled, Refill::Camera) {
        begin_at_points(world, job, index, state);
        return true;
    }
    let kind = match filled {
        Refill::Done => return false,
        Refill::Camera => RayKind::Camera,
        Refill::Straight(_) => RayKind::Straight,
        Refill::Samples(_) => RayKind::Scattered,
    };
    let mut rays = match filled {
        Refill::Done => return false,
        Refill::Camera => camera_rays(world, job, index, cursor, book),
        Refill::Straight(taken) if W::EFFECTS.intersects(Effects::STRAIGHT) => straight_rays(ring, &taken),
        Refill::Straight(_) => {
            debug_assert!(false, "nothing lets rays pass, and one waits");
            return true;
        }
        Refill::Samples(taken) => {
            let samples = samples(world, ring, book, &taken);
            let light = sample_lights(world, &samples);
            let mut note = GuideNote8::NONE;
            let scattered = scatter(world, &samples, light.as_ref().map(|l| l.wi), &mut note);
            if let Some(light) = &light {
                let roulette = settings.shadow_roulette;
                if let Some(mut shadow) = shadow_rays(world, book, &samples, light, &scattered.nee, roulette) {
                    let visible = occlude(world, book, &samples, &mut shadow);
                    book.learn_shadow_rays(&samples, &shadow, visible);
                    book.accumulate(visible, &shadow.path, &shadow.found, Beyond::ShadowRay);
                }
            }
            if W::GUIDING {
                book.note_directions(&note, &samples, light.as_ref(), scattered.nee.pdf);
            }
            book.break_lanes(scattered.broken, &samples.path);
            book.close_lanes::<W>(samples.active.and_not(scattered.rays.active), &samples.path);
            scattered.rays
        }
    };
    if rays.active.none() {
        return true;
    }
    if kind == RayKind::Straight && moves::<W>(world.scene()) {
        rays.ray.time = book.roots.times(rays.path.root, rays.active);
    }

    let mut traced = trace(world, book, &rays, kind);
    let inside = if W::EFFECTS.contains(Effects::MEDIA) { rays.active & rays.media.inside() } else { Mask8::NONE };
    // the profile once more: compilers for wasm do not compute lanes of constant masks
    let in_media = W::EFFECTS.contains(Effects::MEDIA) && inside.any();
    let mut light = F32x8::INFINITY;
    if emission::has_shapes::<W>(world.scene()) {
        let (clear, upto) = (rays.active.and_not(inside), rays.travelled + traced.hit.select(traced.t, rays.ray.tmax));
        let found = emission::shapes(world, &rays, upto, clear);
        book.accumulate_emission::<W>(clear, &rays.path, &found);
        if in_media {
            light = emission::nearest_shape(world, &rays, upto, inside);
        }
    }
    let collision =
        if in_media { cross_media(world, book, ring, &mut rays, &mut traced, light) } else { Collision8::NONE };
    let escaped = rays.active.and_not(traced.hit | collision.mask);
    if escaped.any() {
        if let Some(found) = emission::environment(world, &rays, escaped) {
            book.accumulate_emission::<W>(escaped, &rays.path, &found);
        }
        book.close_lanes::<W>(escaped, &rays.path);
    }
    if (traced.hit | collision.mask).none() {
        return true;
    }

    let mut hit = SurfaceHit8::gather(world.scene(), &traced);
    let mut point = if places::<W>(world.scene()) { hit.place(world.scene(), rays.ray.time) } else { hit.point() };
    let own = own_surfaces(world.intersector(), &rays.ray, &mut traced, &mut hit, &mut point);
    if W::EFFECTS.intersects(Effects::STRAIGHT) {
        hit.t += rays.travelled;
    }
    book.counters.surface.count(hit.mask.count());
    if let Some(found) = emission::area(world, &rays, &hit, point.ng) {
        book.accumulate_emission::<W>(hit.emitters(), &rays.path, &found);
    }

    // segments may end here, and camera samples are looked at all the same
    let met = hit.mask | collision.mask;
    let alive = met & rays.path.depth.lt(U32x8::splat(world.max_depth()));
    let first = met & rays.path.depth.eq(U32x8::splat(1));
    let wants_aovs = book.wants_first_hits() && first.any();
    let may_pass = may_pass::<W>(world.scene());
    if alive.none() && !wants_aovs && !may_pass {
        book.count_longest(settings, met);
        book.close_lanes::<W>(met, &rays.path);
        return true;
    }

    let mut arrival = shade(world, &rays, &hit, &point, own.as_ref());
    let mut met = met;
    if may_pass {
        let passed = pass(world, book, ring, &rays, &hit, &arrival);
        met = met.and_not(passed);
        arrival.active = arrival.active.and_not(passed);
    }
    book.count_longest(settings, met.and_not(alive));
    if W::EFFECTS.contains(Effects::MEDIA) && collision.mask.any() {
        arrive_in_media(&rays, &collision, &mut arrival);
    }
    let needs_albedo = settings.strategy.needs_albedo() || W::GUIDING && settings.guides();
    let first = first & met;
    let seen = if wants_aovs && book.wants_albedo() { first & arrival.active } else { Mask8::NONE };
    arrival.active &= alive;
    let albedo = albedo(world, &arrival, seen | if needs_albedo { arrival.active } else { Mask8::NONE });
    if wants_aovs {
        let t = if W::EFFECTS.contains(Effects::MEDIA) {
            collision.mask.select(collision.t + rays.travelled, hit.t)
        } else {
            hit.t
        };
        let good = book.record_first_hit(first, &rays.path, t, arrival.vertex.ns, albedo);
        if book.wants_surfaces() {
            let of_surfaces = good & hit.mask.and_not(collision.mask);
            let of = (&traced, &hit, own.as_ref());
            let found = first_surfaces(world, settings.size, of, of_surfaces, book.wants_motion());
            book.record_surfaces(good, &rays.path, &found);
        }
    }
    arrival.albedo = if needs_albedo { albedo } else { Vec3x8::ZERO };
    book.close_lanes::<W>(met.and_not(arrival.active), &rays.path);
    if arrival.active.none() {
        return true;
    }

    let decision = roulette(world, settings, book, comb, ring.free(), &mut arrival);
    settle::<W>(book, ring, &arrival, &decision);
    book.counters.ring_peak = book.counters.ring_peak.max(ring.waiting() as u64);
    true
}
