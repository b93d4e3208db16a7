//! What hosts compute in place of the core: ray sources, textures, scattering models, factors of roulette. Extensions are
//! types that are compiled into the kernels; what they leave out is the built-in part and costs nothing.
//!
//! ```
//! use croupier::unstable::bsdf::NoBsdf;
//! use croupier::unstable::extension::{Extension, PixelSamples8, SourceRays8};
//! use croupier::unstable::simd::{F32x8, Mask8, Vec3x8};
//! use croupier::Scene;
//!
//! /// Looks down on the unit square from above: a height map's view of the world.
//! struct FromAbove;
//!
//! impl Extension for FromAbove {
//!     type Bsdf = NoBsdf;
//!     const RAYS: bool = true;
//!
//!     fn rays(&self, _: &Scene<'_>, s: &PixelSamples8) -> SourceRays8 {
//!         let [w, h] = s.size.map(|n| n as f32);
//!         let origin = Vec3x8::new(s.position[0] * (1.0 / w), F32x8::splat(10.0), s.position[1] * (1.0 / h));
//!         SourceRays8 { origin, direction: Vec3x8::splat(0.0, -1.0, 0.0), weight: Vec3x8::ONE, active: s.active }
//!     }
//! }
//! // Session::builder(scene).extension(FromAbove).build(&plan, block)
//! ```

use crate::bsdf::{Bsdf, NoBsdf};
use crate::rrs::Vertices8;
use crate::scene::Scene;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Parts of the tracer that a host replaces. `()` replaces nothing.
///
/// Everything here is a function of its arguments alone, lane by lane: pictures are the same for any number of threads
/// only then.
pub trait Extension {
    /// Scattering model of materials of kind `own` (`bsdf`'s module documentation has the contract); [`NoBsdf`] without one.
    /// What the tracer must know of the kind beforehand is that of [`NoBsdf`]: glossy, on both sides. `LOBES` and `straight`
    /// of a host's model are not asked.
    type Bsdf: for<'s> Bsdf<'s>;

    /// Is there a scattering model? Without it, scenes with materials of kind `own` are refused.
    const BSDF: bool = false;

    /// Is [`Self::rays`] there?
    const RAYS: bool = false;

    /// Is [`Self::reflectance`] there?
    const TEXTURES: bool = false;

    /// Is [`Self::factor`] there?
    const ROULETTE: bool = false;

    /// Rays of eight camera samples, in place of the camera's: of lightmap texels, probes, sensors. They begin in the
    /// media in which the scene's camera is.
    fn rays(&self, _scene: &Scene<'_>, samples: &PixelSamples8) -> SourceRays8 {
        SourceRays8 { active: Mask8::NONE, ..SourceRays8::none(samples) }
    }

    /// Reflectances of eight hits, of principled materials their base colours, `reflectance` as materials and texture files
    /// give them. Between 0 and 1 per channel; what is not is clamped.
    fn reflectance(&self, _at: &TextureSamples8, reflectance: Vec3x8) -> Vec3x8 {
        reflectance
    }

    /// Factors of roulette and splitting, `built_in` those of the strategy in the settings, which also decides what is
    /// learned. Any value keeps the picture unbiased: it is clamped to
    /// [`MIN_FACTOR`](crate::unstable::rrs::MIN_FACTOR) and [`MAX_FACTOR`](crate::unstable::rrs::MAX_FACTOR); 1 where it
    /// is not finite.
    fn factor(&self, _vertices: &Vertices8, built_in: F32x8) -> F32x8 {
        built_in
    }
}

impl Extension for () {
    type Bsdf = NoBsdf;
}

/// Eight camera samples of a picture.
#[derive(Clone, Copy, Debug)]
pub struct PixelSamples8 {
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// Columns of the pixels.
    pub column: U32x8,
    /// Rows of the pixels.
    pub row: U32x8,
    /// Points of the picture in pixels, x to the right and y down, uniform in each pixel's square.
    pub position: [F32x8; 2],
    /// Two further independent numbers in [0, 1).
    pub u: [F32x8; 2],
    /// Lanes with a sample.
    pub active: Mask8,
}

/// Rays of eight camera samples.
#[derive(Clone, Copy, Debug)]
pub struct SourceRays8 {
    /// Origins, world space.
    pub origin: Vec3x8,
    /// Unit directions.
    pub direction: Vec3x8,
    /// What the radiance that comes back along the ray counts in the pixel's mean: 1 for radiance, pi for irradiance
    /// from directions in proportion to the cosine.
    pub weight: Vec3x8,
    /// Lanes with a ray, among those of the samples; the others are black.
    pub active: Mask8,
}

impl SourceRays8 {
    /// No rays.
    fn none(samples: &PixelSamples8) -> Self {
        let direction = Vec3x8::splat(0.0, 0.0, 1.0);
        Self { origin: Vec3x8::ZERO, direction, weight: Vec3x8::ZERO, active: samples.active }
    }
}

/// Eight points on surfaces that want a reflectance.
#[derive(Clone, Copy, Debug)]
pub struct TextureSamples8 {
    /// Material indices.
    pub material: U32x8,
    /// Texture coordinates, v upwards.
    pub uv: [F32x8; 2],
    /// Points, world space.
    pub point: Vec3x8,
    /// Lanes with a point.
    pub active: Mask8,
}
