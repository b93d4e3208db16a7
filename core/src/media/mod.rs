//! STUB
#![allow(missing_docs, clippy::allow_attributes, dead_code)]
use crate::rng::Key8;
use crate::scene::{Effects, Scene};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};
pub struct Segment8 {
    pub o: Vec3x8,
    pub d: Vec3x8,
    pub tmax: F32x8,
}
pub struct Flight8 {
    pub collided: Mask8,
    pub passed: Mask8,
    pub unfinished: Mask8,
    pub t: F32x8,
    pub weight: Vec3x8,
    pub albedo: Vec3x8,
    pub emitted: Vec3x8,
    pub steps: u32,
    pub roulettes: u32,
}
pub fn fly(_e: Effects, _s: &Scene<'_>, _m: U32x8, seg: &Segment8, _b: Vec3x8, _k: Key8, active: Mask8) -> Flight8 {
    Flight8 {
        collided: Mask8::NONE,
        passed: active,
        unfinished: Mask8::NONE,
        t: seg.tmax,
        weight: Vec3x8::ONE,
        albedo: Vec3x8::ZERO,
        emitted: Vec3x8::ZERO,
        steps: 0,
        roulettes: 0,
    }
}
pub struct Passage8 {
    pub transmittance: Vec3x8,
    pub steps: u32,
    pub roulettes: u32,
}
pub fn transmittance(_e: Effects, _s: &Scene<'_>, _m: U32x8, _seg: &Segment8, _k: Key8, _a: Mask8) -> Passage8 {
    Passage8 { transmittance: Vec3x8::ONE, steps: 0, roulettes: 0 }
}
