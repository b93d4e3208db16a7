//! Rays that leave lights, for light paths. Power is emitted in proportion to what [`super::sample_of`] finds:
//! lights that it leaves out (black, too far, of a kind outside the profile) emit nothing, and of environment maps that is
//! what lies below their mean. Spheres emit nothing to their inside.

use crate::camera::concentric_disk;
use crate::geometry;
use crate::scene::Scene;
use core::f32::consts::{PI, TAU};
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Eight rays that leave lights.
#[derive(Clone, Copy, Debug)]
pub struct Emission8 {
    /// Origins, world space: off the surfaces of lights, for lights at infinity on a disk behind the scene.
    pub o: Vec3x8,
    /// Unit directions.
    pub d: Vec3x8,
    /// Power that each carries: the expected power through any surface is the sum over the rays that cross it, over their
    /// number.
    pub power: Vec3x8,
    /// Lanes whose light is at infinity.
    pub infinite: Mask8,
    /// Lanes whose light no scattered ray can hit.
    pub delta: Mask8,
    /// Lanes with a ray.
    pub valid: Mask8,
}

/// What a light's rays are sampled with.
pub(super) struct Numbers8 {
    /// Words of the place, as for a light sample.
    pub words: [U32x8; 3],
    /// Numbers in [0, 1) of the direction; for lights at infinity of the place on their disk.
    pub u: [F32x8; 2],
    /// Number in [0, 1) of the side.
    pub side: F32x8,
}

/// A sphere around the scene.
pub(super) struct SceneSphere {
    centre: Vec3x8,
    radius: f32,
}

impl SceneSphere {
    pub(super) fn new(scene: &Scene<'_>) -> Self {
        let corner = |[x, y, z]: [f32; 3]| Vec3x8::splat(x, y, z);
        let (lo, hi) = (corner(scene.info.bounds_min), corner(scene.info.bounds_max));
        Self { centre: (lo + hi) * 0.5, radius: ((hi - lo) * 0.5).length().lane(0) }
    }

    /// Its centre, world space.
    pub(super) fn centre(&self) -> Vec3x8 {
        self.centre
    }
}

impl Emission8 {
    /// No ray in any lane.
    pub(super) const NONE: Self = Self {
        o: Vec3x8::ZERO,
        d: Vec3x8::ZERO,
        power: Vec3x8::ZERO,
        infinite: Mask8::NONE,
        delta: Mask8::NONE,
        valid: Mask8::NONE,
    };

    /// Takes over the lanes of `mask` from `other`, of a light that is `delta` or not.
    #[inline(always)]
    pub(super) fn merge(&mut self, mask: Mask8, other: &Self, delta: bool) {
        self.o = Vec3x8::select(mask, other.o, self.o);
        self.d = Vec3x8::select(mask, other.d, self.d);
        self.power = Vec3x8::select(mask, other.power, self.power);
        self.infinite = (mask & other.infinite) | self.infinite.and_not(mask);
        self.delta = (mask & Mask8::splat(delta)) | self.delta.and_not(mask);
        self.valid = (mask & other.valid) | self.valid.and_not(mask);
    }

    /// Of a light at infinity, which brings so much power through each unit of area from the directions `wi`: from the disk
    /// that faces them and covers the scene.
    #[inline(always)]
    pub(super) fn from_infinity(
        wi: Vec3x8,
        per_area: Vec3x8,
        valid: Mask8,
        sphere: &SceneSphere,
        n: &Numbers8,
    ) -> Self {
        let [a, b] = concentric_disk(n.u);
        let across = Frame8::from_normal(wi).to_world(Vec3x8::new(a, b, F32x8::ONE));
        Self {
            o: sphere.centre + across * sphere.radius,
            d: -wi,
            power: per_area * (PI * sphere.radius * sphere.radius),
            infinite: Mask8::all_lanes(),
            delta: Mask8::NONE,
            valid,
        }
    }

    /// From a point that is uniform on a surface of so much area, into the hemisphere around its normal, by the cosine.
    #[inline(always)]
    pub(super) fn from_surface(
        (point, normal, error): (Vec3x8, Vec3x8, F32x8),
        radiance: Vec3x8,
        area: F32x8,
        n: &Numbers8,
    ) -> Self {
        let [a, b] = concentric_disk(n.u);
        let up = (1.0 - a * a - b * b).safe_sqrt();
        let d = Frame8::from_normal(normal).to_world(Vec3x8::new(a, b, up));
        Self {
            o: geometry::offset(point, normal, error, d),
            d,
            power: radiance * (area * PI),
            infinite: Mask8::NONE,
            delta: Mask8::NONE,
            valid: Mask8::all_lanes(),
        }
    }

    /// From a point that is uniform on a shape that hides nothing: of those with two sides, from either.
    #[inline(always)]
    pub(super) fn from_shape(
        (point, normal): (Vec3x8, Vec3x8),
        two_sided: Mask8,
        radiance: Vec3x8,
        area: F32x8,
        n: &Numbers8,
    ) -> Self {
        let back = two_sided & n.side.lt(F32x8::splat(0.5));
        let normal = Vec3x8::select(back, -normal, normal);
        Self::from_surface((point, normal, F32x8::ZERO), radiance, two_sided.select(area * 2.0, area), n)
    }

    /// From a point, uniform within a cone of 1 - cos up to `width` around `axis`.
    #[inline(always)]
    pub(super) fn from_point(point: Vec3x8, axis: Vec3x8, width: F32x8, intensity: Vec3x8, n: &Numbers8) -> Self {
        let below = width * n.u[0];
        let across = (below * (2.0 - below)).safe_sqrt();
        let (sin, cos) = n.u[1].sin_cos_2pi();
        let d = Frame8::from_normal(axis).to_world(Vec3x8::new(cos * across, sin * across, 1.0 - below));
        Self { o: point, d, power: intensity * (width * TAU), valid: Mask8::all_lanes(), ..Self::NONE }
    }
}
