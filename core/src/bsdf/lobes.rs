//! Facts of a model, known without running it.

use crate::bits::bit_set;

/// A set of lobes, one bit each, as pbrt's `BxDFFlags`: on which side of the surface the model scatters, and how wide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lobes(pub u32);

bit_set!(Lobes);

impl Lobes {
    /// Scatters to the side of `wo`.
    pub const REFLECTION: Self = Self(1);
    /// Scatters to the other side.
    pub const TRANSMISSION: Self = Self(2);
    /// Scatters to the whole hemisphere.
    pub const DIFFUSE: Self = Self(4);
    /// Scatters around one direction.
    pub const GLOSSY: Self = Self(8);
    /// Delta lobes: scatters to single directions, at least in some lanes.
    pub const SPECULAR: Self = Self(16);

    /// Lets light pass straight on ([`super::Bsdf::straight`]).
    pub const STRAIGHT: Self = Self(32);

    /// Whether there are delta lobes only: light samples are of no use then.
    pub const fn delta_only(self) -> bool {
        !self.intersects(Self::DIFFUSE.with(Self::GLOSSY))
    }
}

/// Direction that keys the learned statistics of a model: the one on which the radiance that it scatters depends most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CacheDirection {
    /// Shading normal: what a diffuse surface reflects depends on where it faces.
    Normal,
    /// Viewing direction mirrored at the shading normal: what a glossy surface reflects comes from around there.
    Mirror,
    /// Viewing direction: what light passes shows what is behind it.
    View,
}

/// Code facts of a material kind.
#[derive(Clone, Copy, Debug)]
pub struct ModelFacts {
    /// [`Bsdf::LOBES`](super::Bsdf::LOBES).
    pub lobes: Lobes,
    /// [`Bsdf::CACHE_DIRECTION`](super::Bsdf::CACHE_DIRECTION).
    pub cache_direction: CacheDirection,
}

/// Phong exponent of a perfect mirror.
pub const MIRROR_SHININESS: f32 = 1e4;

/// Phong exponent that corresponds to the GGX width `alpha`: 2 / alpha^2 - 2, from 0 to [`MIRROR_SHININESS`].
pub(super) fn phong_exponent(alpha: f32) -> f32 {
    (2.0 / (alpha * alpha) - 2.0).clamp(0.0, MIRROR_SHININESS)
}
