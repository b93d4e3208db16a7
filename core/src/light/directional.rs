//! Parallel light from infinity.
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `vector` | unit direction towards the light, world space | |
//! | `emission` | irradiance on a facing surface | >= 0 |

use super::{Chosen, LightModel, LightSample8, SceneExtent, luminance};
use crate::scene::Scene;
use crate::scene::blob::Light;
use core::f64::consts::PI;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Parallel light.
pub(super) struct Directional;

impl LightModel for Directional {
    const DELTA: bool = true;

    #[inline(always)]
    fn sample(_: &Scene<'_>, light: &Chosen, _: Vec3x8, _: [U32x8; 3], _: Mask8) -> LightSample8 {
        LightSample8 {
            wi: light.vector,
            radiance: light.emission,
            pdf: F32x8::ONE,
            delta: Mask8::all_lanes(),
            infinite: Mask8::all_lanes(),
            valid: Mask8::all_lanes(),
            ..LightSample8::NONE
        }
    }

    /// Power through a disk of the scene's radius.
    fn power(light: &Light, scene: &SceneExtent) -> f64 {
        PI * scene.radius * scene.radius * luminance(light.emission)
    }
}
