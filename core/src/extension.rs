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
use crate::geometry::NO_INSTANCE;
use crate::rrs::Vertices8;
use crate::scene::Scene;
use crate::scene::blob::NONE;
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

    /// Is [`Self::points`] there? It goes before [`Self::rays`].
    const POINTS: bool = false;

    /// Is [`Self::reflectance`] there?
    const TEXTURES: bool = false;

    /// Is [`Self::factor`] there?
    const ROULETTE: bool = false;

    /// Rays of eight camera samples, in place of the camera's: of probes, sensors, texels. They begin in the media in which
    /// the scene's camera is. Samples without a ray count as camera rays too, so that steps stay bounded.
    fn rays(&self, _scene: &Scene<'_>, samples: &PixelSamples8) -> SourceRays8 {
        SourceRays8 { active: Mask8::NONE, ..SourceRays8::none(samples) }
    }

    /// Points of surfaces at which eight camera samples begin, in place of the camera's rays: texels of lightmaps. What a
    /// sample brings is the radiance that a white diffuse surface would reflect there, from its front, whatever the
    /// surface is made of: the irradiance over pi. Lights are sampled from the point as from any other, so that those that
    /// no ray meets count too; what the surface emits itself does not. They are in the media in which the scene's camera
    /// is. Every sample counts as a camera ray. The profile must have [`Effects::DIFFUSE`](crate::unstable::Effects::DIFFUSE).
    fn points(&self, _scene: &Scene<'_>, _samples: &PixelSamples8) -> SourcePoints8 {
        SourcePoints8::NONE
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

/// Points of surfaces at which eight camera samples begin.
#[derive(Clone, Copy, Debug)]
pub struct SourcePoints8 {
    /// Triangle indices.
    pub triangle: U32x8,
    /// Instances around the triangles, see [`Hit8::instance`](crate::geometry::Hit8::instance);
    /// [`NO_INSTANCE`] for those in the world itself.
    pub instance: [U32x8; 2],
    /// Barycentric weights of vertices b and c; vertex a has `1 - u - v`.
    pub weights: [F32x8; 2],
    /// What the radiance counts in the pixel's mean: 1 for irradiance over pi, pi for irradiance.
    pub scale: Vec3x8,
    /// Lanes with a point, among those of the samples; the others are black, as are lanes without a triangle and those
    /// whose numbers are not finite.
    pub active: Mask8,
}

impl SourcePoints8 {
    /// No points.
    pub const NONE: Self = Self {
        triangle: U32x8::splat(NONE),
        instance: NO_INSTANCE,
        weights: [F32x8::ZERO; 2],
        scale: Vec3x8::ZERO,
        active: Mask8::NONE,
    };
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
