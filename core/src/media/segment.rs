//! Segments through media, and what became of them.

use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Segments `o + t d`, `0 <= t < tmax`. Directions have any length; `t` counts in lengths of `d`.
#[derive(Clone, Copy, Debug)]
pub struct Segment8 {
    /// Origins, world space.
    pub o: Vec3x8,
    /// Directions.
    pub d: Vec3x8,
    /// Ends; infinity is allowed.
    pub tmax: F32x8,
}

/// Flights along segments, see [`super::fly`]. Lanes that were asked for and are in none of the three masks have ended:
/// nothing is left to scatter or to pass.
#[derive(Clone, Copy, Debug)]
pub struct Flight8 {
    /// Lanes that scatter at `t`.
    pub collided: Mask8,
    /// Lanes that reached `tmax`.
    pub passed: Mask8,
    /// Lanes that took all their steps: the caller goes on from `t`, with another key.
    pub unfinished: Mask8,
    /// Parameter at which the flight stopped; 0 in lanes that have ended.
    pub t: F32x8,
    /// Factor on the path's weight, per channel; of collided lanes without the albedo. 0 in channels that were 0 before,
    /// and in lanes that have ended.
    pub weight: Vec3x8,
    /// Single-scattering albedo, collided lanes; else 0.
    pub albedo: Vec3x8,
    /// Radiance met on the way, times the factors gathered so far, without the path's weight.
    pub emitted: Vec3x8,
    /// Steps, summed over the lanes: tentative collisions and brick crossings.
    pub steps: u32,
    /// Lanes that played roulette because they hardly moved.
    pub roulettes: u32,
}

impl Flight8 {
    /// Lanes that have ended without anything.
    pub const ENDED: Self = Self {
        collided: Mask8::NONE,
        passed: Mask8::NONE,
        unfinished: Mask8::NONE,
        t: F32x8::ZERO,
        weight: Vec3x8::ZERO,
        albedo: Vec3x8::ZERO,
        emitted: Vec3x8::ZERO,
        steps: 0,
        roulettes: 0,
    };

    /// Both, where no lane has results in both.
    #[inline(always)]
    pub(super) fn or(self, other: Self) -> Self {
        Self {
            collided: self.collided | other.collided,
            passed: self.passed | other.passed,
            unfinished: self.unfinished | other.unfinished,
            t: self.t + other.t,
            weight: self.weight + other.weight,
            albedo: self.albedo + other.albedo,
            emitted: self.emitted + other.emitted,
            steps: self.steps + other.steps,
            roulettes: self.roulettes + other.roulettes,
        }
    }
}

/// What passes along segments, see [`super::transmittance`].
#[derive(Clone, Copy, Debug)]
pub struct Passage8 {
    /// Estimate of the transmittance per channel; 0 in lanes that were not asked for.
    pub transmittance: Vec3x8,
    /// Steps, summed over the lanes: tentative collisions and brick crossings.
    pub steps: u32,
    /// Lanes that played roulette because of their number of steps.
    pub roulettes: u32,
}

/// Segments by arc length.
#[derive(Clone, Copy, Debug)]
pub struct Span8 {
    /// Origins, world space.
    pub o: Vec3x8,
    /// Unit directions; 0 where the segment is a point.
    pub d: Vec3x8,
    /// Length of the given direction.
    pub unit: F32x8,
    /// Length of the segment; infinity is allowed.
    pub length: F32x8,
    /// Lanes with a segment: numbers, and finite except for the end.
    pub usable: Mask8,
}

impl Span8 {
    /// Segments of the lanes in `active`.
    #[inline(always)]
    pub fn new(segment: &Segment8, active: Mask8) -> Self {
        let largest = segment.d.abs().max_component();
        let scaled = segment.d / largest;
        let scale = scaled.length();
        let unit = scale * largest;
        let tmax = segment.tmax;
        let still = largest.eq(F32x8::ZERO);
        let finite = segment.o.is_finite() & segment.d.is_finite() & (still | unit.is_finite());
        let (d, unit) = ((scaled / scale).zero_unless(!still), still.select(F32x8::ZERO, unit));
        let length = still.select(F32x8::ZERO, F32x8::ZERO.max(tmax) * unit);
        Self { o: segment.o, d, unit, length, usable: active & finite & tmax.eq(tmax) }
    }

    /// Parameter of the point at distance `s`.
    #[inline(always)]
    pub fn parameter(&self, s: F32x8) -> F32x8 {
        self.unit.gt(F32x8::ZERO).zero_unless(s / self.unit)
    }
}
