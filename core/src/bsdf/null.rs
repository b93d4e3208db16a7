//! Index-matched boundary: light passes unchanged. No parameters.

use super::{Bsdf, Eval8, Inputs8, Sample8};
use crate::scene::Scene;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Index-matched boundary.
#[derive(Clone, Copy, Debug)]
pub struct Null;

impl Bsdf<'_> for Null {
    const DELTA: bool = true;

    #[inline(always)]
    fn gather(_: &Scene<'_>, _: &Inputs8, _: Mask8) -> Self {
        Self
    }

    #[inline(always)]
    fn eval(&self, _: Vec3x8, _: Vec3x8) -> Eval8 {
        Eval8::ZERO
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, _: [F32x8; 3]) -> Sample8 {
        Sample8::delta(-wo, Vec3x8::ONE, wo.is_finite())
    }

    /// 1.
    #[inline(always)]
    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        Vec3x8::ONE
    }
}
