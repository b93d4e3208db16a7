//! Delta tracking and ratio tracking through density grids, with a majorant per brick.
//!
//! ```text
//! tau = exponential
//! loop:                                         delta tracking (Woodcock et al. 1965)
//!     rate = majorant of the brick * sigma      sigma: largest extinction of the channels that are left
//!     if tau / rate is beyond the brick:
//!         tau -= rate * way to its end; enter the next brick or pass
//!     else:
//!         s += tau / rate; choose scattering or going on (collision.rs); tau = exponential
//! ```
//!
//! Ratio tracking (Novak et al. 2014) is the same walk, with the factor 1 - sigma_t density / majorant in place of the
//! choice. The two share their walk in [`Tracker8`].
//!
//! *Bounds.* Neither loop depends on s growing (NUMERICS MED-3): each counts its steps. A flight stops after
//! [`MAX_FLIGHT_STEPS`] and is gone on with later, which is exact: the exponential distribution has no memory. Where a
//! lane has hardly moved in that time, 2^-10 of its way through the box, it survives with probability 1/2 and twice the
//! weight: at an optical thickness (of majorants) of 65,000 and more, with null collisions almost only. Transmittances
//! play roulette as they get small, and every 64 steps, so that the bound of [`MAX_TRANSMITTANCE_STEPS`] is not met:
//! lanes that advance by 2^-5 of their way in each 64 are through after half of it, others survive with probability 1/2
//! each time. Should it be met, the result is 0, and is counted.

use super::coefficients::Media8;
use super::collision::{Weights8, albedo};
use super::density::Grids8;
use super::majorants::BrickWalk8;
use super::segment::{Flight8, Passage8, Segment8, Span8};
use crate::sampler::{MAX_FLIGHT_STEPS, MAX_TRANSMITTANCE_STEPS, Numbers8};
use crate::scene::Scene;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Part of the way through the box that a flight makes in all its steps, or it plays roulette.
const LEAST_FLIGHT: f32 = 1.0 / 1024.0;
/// Steps of a transmittance between two roulettes.
const ROULETTE_STEPS: u32 = 64;
/// Part of the way that a transmittance makes between two, or it survives with probability 1/2 at most.
const LEAST_TRANSMITTANCE: f32 = 1.0 / 32.0;
/// Transmittances below this play roulette at once.
const SMALL: f32 = 1.0 / 64.0;
/// Least probability to survive.
const MIN_SURVIVAL: f32 = 1.0 / 16.0;

/// Optical depth of a flight, -ln((x + 1/2) 2^-32) of a random word x: at most 22.87, and 0 with probability 3e-8, where
/// the argument rounds to 1 (NUMERICS MED-1). Mean and mean square differ from 1 and 2 by less than 1e-7.
#[inline(always)]
pub(super) fn optical_depth(word: U32x8) -> F32x8 {
    F32x8::ZERO.max(-fine_unit(word).ln())
}

/// (x + 1/2) 2^-32 of a random word, rounded: above 0, at most 1.
#[inline(always)]
fn fine_unit(word: U32x8) -> F32x8 {
    let low = (word & U32x8::splat(0xff)).to_i32().to_f32() + 0.5;
    word.to_unit() + low * (1.0 / 4_294_967_296.0)
}

/// Number of a random word for a choice: finer than 2^-24 where it is small, below 1.
#[inline(always)]
pub(super) fn choice(word: U32x8) -> F32x8 {
    fine_unit(word).min(F32x8::splat(1.0 - 1.0 / 16_777_216.0))
}

/// Walks from tentative collision to tentative collision.
struct Tracker8<'a, 's> {
    scene: &'a Scene<'s>,
    grids: Grids8,
    walk: BrickWalk8,
    /// Distance from the entry into the box.
    s: F32x8,
    /// Optical depth left to the next tentative collision.
    tau: F32x8,
    /// Lanes that need a new one.
    fresh: Mask8,
    /// Majorant of the current brick.
    majorant: F32x8,
    /// Lanes on their way.
    live: Mask8,
    /// Lanes that came through.
    passed: Mask8,
    steps: u32,
}

impl<'a, 's> Tracker8<'a, 's> {
    #[inline(always)]
    fn new(scene: &'a Scene<'s>, medium: U32x8, path: &Span8, active: Mask8) -> Self {
        let grids = Grids8::gather(scene, medium, active);
        let walk = BrickWalk8::new(&grids, path, active);
        let live = walk.inside;
        let majorant = walk.majorant(scene, live);
        let (s, tau) = (F32x8::ZERO, F32x8::ZERO);
        Self { scene, grids, walk, s, tau, fresh: live, majorant, live, passed: active.and_not(live), steps: 0 }
    }

    /// One step of every lane on its way: to the next tentative collision or to the end of the brick. Returns the lanes
    /// that collide, and the density there over the majorant.
    #[inline(always)]
    fn step(&mut self, word: U32x8, sigma: F32x8) -> (Mask8, F32x8) {
        self.steps += self.live.count();
        if self.fresh.any() {
            self.tau = self.fresh.select(optical_depth(word), self.tau);
        }
        let rate = self.majorant * sigma;
        let exit = self.walk.exit();
        // 0 / 0 collides nowhere (NUMERICS MED-2)
        let event = self.s + self.tau / rate;
        let collides = self.live & event.lt(exit);
        let crosses = self.live.and_not(collides);
        if crosses.any() {
            self.tau = crosses.select(F32x8::ZERO.max(self.tau - (exit - self.s) * rate), self.tau);
            let ends = crosses & exit.ge(self.walk.length);
            let on = self.walk.advance(crosses.and_not(ends));
            self.majorant = on.select(self.walk.majorant(self.scene, on), self.majorant);
            let through = crosses.and_not(on);
            self.passed |= through;
            self.live = self.live.and_not(through);
        }
        self.s = collides.select(event, crosses.select(exit, self.s));
        self.fresh = collides;
        if collides.none() {
            return (collides, F32x8::ZERO);
        }
        let density = self.grids.at(self.scene, self.walk.position(self.s), collides);
        // the margin of majorants keeps this below 1; were it not so, the density counts as the majorant (MED-5)
        (collides, collides.zero_unless(density.min(self.majorant) / self.majorant))
    }
}

/// [`super::fly`] through grids.
#[inline(never)]
pub(super) fn fly(
    scene: &Scene<'_>,
    media: &Media8,
    medium: U32x8,
    segment: &Segment8,
    beta: Vec3x8,
    Numbers8 { sampler, key }: Numbers8,
    active: Mask8,
) -> Flight8 {
    let path = Span8::new(segment, active);
    let mut weights = Weights8::new(media, beta);
    let usable = path.usable & weights.alive();
    let mut tracker = Tracker8::new(scene, medium, &path, usable);
    let mut collided = Mask8::NONE;
    for pair in 0..MAX_FLIGHT_STEPS / 2 {
        if tracker.live.none() {
            break;
        }
        for [depth, pick] in key.flight_steps(sampler, pair) {
            let (collides, fraction) = tracker.step(depth, weights.sigma);
            if collides.any() {
                let scatters = weights.collide(media, fraction, choice(pick), collides);
                collided |= scatters;
                tracker.live = tracker.live.and_not(scatters) & weights.alive();
            }
        }
    }
    let t = path.parameter(tracker.walk.begin + tracker.s).min(segment.tmax);
    let mut unfinished = tracker.live;
    let mut roulettes = 0;
    if unfinished.any() {
        let moved = segment.o + segment.d * t;
        let moved = !(moved.x.eq(segment.o.x) & moved.y.eq(segment.o.y) & moved.z.eq(segment.o.z));
        let stalled = unfinished.and_not(moved & tracker.s.ge(tracker.walk.length * LEAST_FLIGHT));
        if stalled.any() {
            roulettes = stalled.count();
            unfinished = unfinished.and_not(stalled & key.flight_roulette().ge(F32x8::splat(0.5)));
            weights.weight = Vec3x8::select(stalled, weights.weight * 2.0, weights.weight);
        }
    }
    let passed = tracker.passed;
    Flight8 {
        collided,
        passed,
        unfinished,
        t: passed.select(F32x8::ZERO.max(segment.tmax), (collided | unfinished).zero_unless(t)),
        weight: weights.weight.zero_unless(collided | passed | unfinished),
        albedo: albedo(media).zero_unless(collided),
        emitted: weights.emitted.zero_unless(usable),
        steps: tracker.steps,
        roulettes,
    }
}

/// [`super::transmittance`] through grids.
#[inline(never)]
pub(super) fn transmittance(
    scene: &Scene<'_>,
    media: &Media8,
    medium: U32x8,
    segment: &Segment8,
    Numbers8 { sampler, key }: Numbers8,
    active: Mask8,
) -> Passage8 {
    let path = Span8::new(segment, active);
    let mut tracker = Tracker8::new(scene, medium, &path, path.usable);
    let mut t = Vec3x8::ONE;
    let mut sigma = media.largest(t);
    let (mut roulettes, mut last) = (0, F32x8::ZERO);
    for four in 0..MAX_TRANSMITTANCE_STEPS / 4 {
        if tracker.live.none() {
            break;
        }
        for (word, k) in key.transmittance_steps(sampler, four).into_iter().zip(0..) {
            let (collides, fraction) = tracker.step(word, sigma);
            if collides.any() {
                let scale = fraction / sigma;
                let pass = media.sigma_t.map(|x| F32x8::ZERO.max(1.0 - x * scale));
                t = Vec3x8::select(collides, t * pass, t);
                sigma = collides.select(media.largest(t), sigma);
                tracker.live &= t.any_positive();
            }
            let step = 4 * four + k;
            let round = step % ROULETTE_STEPS == ROULETTE_STEPS - 1;
            let due = if round { tracker.live } else { Mask8::NONE };
            let plays = due | (tracker.live & collides & t.max_component().lt(F32x8::splat(SMALL)));
            if plays.any() {
                let stalled = due.and_not((tracker.s - last).ge(tracker.walk.length * LEAST_TRANSMITTANCE));
                let survival = t.max_component().clamp(MIN_SURVIVAL, 1.0);
                let survival = stalled.select(survival.min(F32x8::splat(0.5)), survival);
                roulettes += (due & survival.lt(F32x8::ONE)).count();
                let dies = plays.and_not(key.transmittance_roulette(step).lt(survival));
                t = Vec3x8::select(plays, t / survival, t);
                tracker.live = tracker.live.and_not(dies);
                last = due.select(tracker.s, last);
            }
        }
    }
    roulettes += tracker.live.count();
    Passage8 { transmittance: t.zero_unless(tracker.passed), steps: tracker.steps, roulettes }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One word in each of 2^22 strata, at random places: mean 1 and mean square 2 within 3e-6, every depth finite and
    /// not negative. Killed by: words of 24 bits (the mean is low by 1e-6, the largest depth 16.6), u in place of 1 - u at
    /// 0, where the logarithm is infinite.
    #[test]
    fn optical_depths_have_the_moments_of_the_exponential() {
        let (mut mean, mut square, mut hash) = (0.0f64, 0.0f64, 1u32);
        const STRATA: u32 = 1 << 22;
        for k in 0..STRATA / 8 {
            let word = U32x8::from_fn(|i| {
                hash = hash.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (8 * k + i as u32) << 10 | hash >> 22
            });
            for tau in optical_depth(word).to_array() {
                assert!((0.0..22.9).contains(&tau));
                mean += f64::from(tau) / f64::from(STRATA);
                square += f64::from(tau) * f64::from(tau) / f64::from(STRATA);
            }
        }
        assert!((mean - 1.0).abs() < 3e-6 && (square - 2.0).abs() < 3e-6 * 8.0, "{mean} {square}");
        let ends = optical_depth(U32x8::new([0, 1, !0, !0 - 127, 1 << 31, 255, 256, 3]));
        assert!((ends.lane(0) - 22.873_856).abs() < 2e-6, "{}", ends.lane(0));
        assert_eq!(ends.lane(2).to_bits(), 0);
        assert!(choice(U32x8::splat(!0)).lane(0) < 1.0);
    }
}
