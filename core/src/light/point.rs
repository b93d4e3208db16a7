//! Isotropic point light.
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `vector` | position, world units | finite |
//! | `emission` | intensity, power / sr | >= 0 |

use super::emit::{Emission8, Numbers8, SceneSphere};
use super::{Chosen, LightModel, LightSample8, SceneExtent, luminance};
use crate::scene::Scene;
use crate::scene::blob::Light;
use core::f64::consts::TAU;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Squared distances are not taken smaller than this (NUMERICS SOL-5).
const MIN_DISTANCE_SQR: f32 = 1e-20;

/// Isotropic point.
pub(super) struct Point;

impl LightModel for Point {
    const DELTA: bool = true;

    /// Sample with the irradiance I / r^2 on a surface facing the light. Nothing arrives at the point itself: no
    /// direction.
    #[inline(always)]
    fn sample(_: &Scene<'_>, light: &Chosen, p: Vec3x8, _: [U32x8; 3], _: Mask8) -> LightSample8 {
        let d = light.vector - p;
        let least = F32x8::splat(MIN_DISTANCE_SQR);
        let distance_sqr = d.length_sqr();
        let clamped = distance_sqr.lt(least);
        let distance_sqr = distance_sqr.max(least);
        let wi = d.normalize();
        LightSample8 {
            wi,
            point: light.vector,
            normal: -wi,
            radiance: light.emission / distance_sqr,
            pdf: F32x8::ONE,
            delta: Mask8::all_lanes(),
            valid: wi.is_finite(),
            clamped,
            ..LightSample8::NONE
        }
    }

    /// Power over all directions.
    fn power(light: &Light, _: &SceneExtent) -> f64 {
        2.0 * TAU * luminance(light.emission)
    }

    #[inline(always)]
    fn emit(_: &Scene<'_>, light: &Chosen, _: &SceneSphere, n: &Numbers8, _: Mask8) -> Emission8 {
        let (axis, all_around) = (Vec3x8::splat(0.0, 0.0, 1.0), F32x8::splat(2.0));
        Emission8::from_point(light.vector, axis, all_around, light.emission, n)
    }
}
