//! Parallel light with the spread of a distant disk, such as the sun: shadows have soft edges.
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `vector` | unit direction towards the disk's middle, world space | |
//! | `emission` | irradiance on a surface that faces the middle | >= 0 |
//! | `params[0]` | 1 - cos of the disk's angular radius | above 0, at most 1 |
//!
//! Directions are uniform over the disk's solid angle. Light samples alone find it, as they do a directional light: rays
//! that leave the scene towards it see what is behind. So smooth surfaces have no image of it, and nothing focuses it
//! into single bright samples.

use super::{Chosen, LightModel, LightSample8, SceneExtent, luminance};
use crate::camera::concentric_disk;
use crate::scene::Scene;
use crate::scene::blob::Light;
use core::f64::consts::PI;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Disk at infinity.
pub(super) struct Sun;

impl LightModel for Sun {
    const DELTA: bool = true;

    #[inline(always)]
    fn sample(_: &Scene<'_>, light: &Chosen, _: Vec3x8, words: [U32x8; 3], _: Mask8) -> LightSample8 {
        let [width, ..] = light.params;
        let [x, y] = concentric_disk([words[0], words[1]].map(U32x8::to_unit));
        // A point of the unit disk goes to the cap of the sphere with the same share of the area: 1 - cos t = width r^2.
        let below = (x * x + y * y) * width;
        let across = (width * (F32x8::splat(2.0) - below)).sqrt();
        let local = Vec3x8::new(x * across, y * across, F32x8::ONE - below);
        LightSample8 {
            wi: Frame8::from_normal(light.vector).to_world(local),
            // the mean cosine to the middle
            radiance: light.emission / (F32x8::ONE - width * 0.5),
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
