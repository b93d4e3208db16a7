//! Flights and transmittances through media, homogeneous ones in closed form where there is one.

use super::coefficients::Media8;
use super::collision::{Weights8, albedo};
use super::grid::{self, choice, optical_depth};
use super::segment::{Flight8, Passage8, Segment8, Span8};
use crate::sampler::Numbers8;
use crate::scene::{Effects, Scene};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Most tentative collisions of a flight through a homogeneous medium: a null collision takes the channel of the largest
/// extinction.
const CHANNELS: u32 = 3;

/// Flies along segments to the first scattering: delta tracking with local majorants, the choice at a tentative collision
/// made for all channels at once (`collision.rs`). `medium` is an index per lane, `beta` the path's weight.
///
/// A flight is one sample: E over flights of `weight` where they passed is the transmittance, of `emitted` the radiance
/// of the medium on the way, and of `weight * albedo` at `t` the density of scattering times the transmittance to there,
/// in each channel in which `beta` is not 0. `unfinished` lanes are part of that: the caller goes on from
/// `o + t d` with another key, and multiplies.
///
/// Draws blocks of the key that no other stage uses. `effects` must be a constant: without [`Effects::GRID_MEDIA`] no code
/// for grids is compiled in. Segments that are not numbers end with 0.
#[inline(always)]
pub fn fly(
    effects: Effects,
    scene: &Scene<'_>,
    medium: U32x8,
    segment: &Segment8,
    beta: Vec3x8,
    numbers: Numbers8,
    active: Mask8,
) -> Flight8 {
    let media = Media8::gather(scene, medium, active);
    if !effects.contains(Effects::GRID_MEDIA) {
        return fly_homogeneous(&media, segment, beta, numbers, active);
    }
    let even = active.and_not(media.grid);
    let mut flight = if even.any() { fly_homogeneous(&media, segment, beta, numbers, even) } else { Flight8::ENDED };
    if media.grid.any() {
        flight = flight.or(grid::fly(scene, &media, medium, segment, beta, numbers, media.grid));
    }
    flight
}

/// Share of the light that passes along segments, per channel: in closed form in homogeneous media, an estimate by ratio
/// tracking in grids, whose mean is the transmittance. `effects` and `numbers` as for [`fly`], the blocks drawn are others.
#[inline(always)]
pub fn transmittance(
    effects: Effects,
    scene: &Scene<'_>,
    medium: U32x8,
    segment: &Segment8,
    numbers: Numbers8,
    active: Mask8,
) -> Passage8 {
    let media = Media8::gather(scene, medium, active);
    let path = Span8::new(segment, active);
    let passes = optical_thickness(media.sigma_t, &path).map(|tau| (-tau).exp());
    if !effects.contains(Effects::GRID_MEDIA) {
        return Passage8 { transmittance: passes.zero_unless(path.usable), steps: 0, roulettes: 0 };
    }
    let passes = passes.zero_unless(path.usable.and_not(media.grid));
    if media.grid.none() {
        return Passage8 { transmittance: passes, steps: 0, roulettes: 0 };
    }
    let grids = grid::transmittance(scene, &media, medium, segment, numbers, media.grid);
    Passage8 { transmittance: passes + grids.transmittance, ..grids }
}

/// sigma times the length, 0 where sigma is 0, also along segments without an end (NUMERICS MED-2, MED-4).
#[inline(always)]
fn optical_thickness(sigma: Vec3x8, path: &Span8) -> Vec3x8 {
    sigma.map(|x| x.gt(F32x8::ZERO).zero_unless(x * path.length))
}

/// 1 - e^-x for x >= 0, within 3e-7 relative: a series where the difference would cancel.
#[inline(always)]
fn absorbed(x: F32x8) -> F32x8 {
    let series = x * (1.0 - x * 0.5 * (1.0 - x * (1.0 / 3.0) * (1.0 - x * 0.25 * (1.0 - x * 0.2))));
    x.lt(F32x8::splat(0.125)).select(series, 1.0 - (-x).exp())
}

/// [`fly`] through homogeneous media.
#[inline(always)]
fn fly_homogeneous(media: &Media8, segment: &Segment8, beta: Vec3x8, numbers: Numbers8, active: Mask8) -> Flight8 {
    let path = Span8::new(segment, active);
    let mut weights = Weights8::new(media, beta);
    let usable = path.usable & weights.alive();
    let scatters = media.sigma_s.any_positive();
    // nothing scatters: no choice is to be made
    let clear = usable.and_not(scatters);
    if clear.any() {
        let tau = optical_thickness(media.sigma_a, &path);
        let weight = weights.weight * tau.map(|x| (-x).exp());
        let emitted = weights.weight * media.emission * tau.map(absorbed);
        weights.weight = Vec3x8::select(clear, weight, weights.weight);
        weights.emitted = emitted.zero_unless(clear);
    }
    let mut passed = clear & weights.alive();
    let mut live = usable & scatters;
    let (mut collided, mut s, mut steps) = (Mask8::NONE, F32x8::ZERO, 0);
    for pair in 0..CHANNELS.div_ceil(2) {
        if live.none() {
            break;
        }
        for [depth, pick] in numbers.key.flight_steps(numbers.sampler, pair) {
            let event = s + optical_depth(depth) / weights.sigma;
            steps += live.count();
            // not so without extinction, where 0 / 0 may be (NUMERICS MED-2)
            let collides = live & event.lt(path.length);
            passed |= live.and_not(collides);
            s = collides.select(event, s);
            let now = weights.collide(media, F32x8::ONE, choice(pick), collides);
            collided |= now;
            live = collides.and_not(now) & weights.alive();
        }
    }
    let t = path.parameter(s).min(segment.tmax);
    Flight8 {
        collided,
        passed,
        unfinished: live,
        t: passed.select(F32x8::ZERO.max(segment.tmax), (collided | live).zero_unless(t)),
        weight: weights.weight.zero_unless(collided | passed | live),
        albedo: albedo(media).zero_unless(collided),
        emitted: weights.emitted.zero_unless(usable),
        steps,
        roulettes: 0,
    }
}
