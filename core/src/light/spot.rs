//! Point that shines into a cone, with the falloff of glTF's `KHR_lights_punctual`.
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `vector` | position, world units | finite |
//! | `emission` | intensity on the axis, power / sr | >= 0 |
//! | `params[0..3]` | unit axis, along which the light travels | |
//! | `params[3]` | 1 - cos of the outer half angle | above 0, at most 2 |
//! | `params[4]` | 1 - cos of the inner half angle | 0 to `params[3]` |
//!
//! With x = 1 - cos t for the angle t from the axis, the intensity is `emission * f^2`, `f = (outer - x) / (outer -
//! inner)` clamped to 0..=1. Cones are kept as 1 - cos because cosines of narrow ones are all near 1: x is half the
//! squared distance of the two unit vectors, which is precise there.

use super::emit::{Emission8, Numbers8, SceneSphere};
use super::{Chosen, LightModel, LightSample8, SceneExtent, luminance, point};
use crate::scene::Scene;
use crate::scene::blob::Light;
use core::f64::consts::TAU;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Point with a cone.
pub(super) struct Spot;

/// `f^2` of the module's formula for light that travels along the unit directions `d`.
#[inline(always)]
fn falloff(light: &Chosen, d: Vec3x8) -> F32x8 {
    let [x, y, z, outer, inner, _] = light.params;
    let x = (d - Vec3x8::new(x, y, z)).length_sqr() * 0.5;
    // inside of a cone without a soft edge this is infinite
    let f = ((outer - x) / (outer - inner)).min(F32x8::ONE);
    x.lt(outer).zero_unless(f * f)
}

impl LightModel for Spot {
    const DELTA: bool = true;

    /// The sample of a point light, dimmed by the angle; outside the cone it is black, so that no shadow ray is traced.
    #[inline(always)]
    fn sample(scene: &Scene<'_>, light: &Chosen, p: Vec3x8, words: [U32x8; 3], mask: Mask8) -> LightSample8 {
        let all_around = point::Point::sample(scene, light, p, words, mask);
        LightSample8 { radiance: all_around.radiance * falloff(light, -all_around.wi), ..all_around }
    }

    /// Power over all directions: the integral of 2 pi f^2 dx over x = 1 - cos t.
    fn power(light: &Light, _: &SceneExtent) -> f64 {
        let [_, _, _, outer, inner, _] = light.params.map(f64::from);
        TAU * (inner + (outer - inner) / 3.0) * luminance(light.emission)
    }

    #[inline(always)]
    fn emit(_: &Scene<'_>, light: &Chosen, _: &SceneSphere, n: &Numbers8, _: Mask8) -> Emission8 {
        let [x, y, z, outer, ..] = light.params;
        let e = Emission8::from_point(light.vector, Vec3x8::new(x, y, z), outer, light.emission, n);
        Emission8 { power: e.power * falloff(light, e.d), ..e }
    }
}
