//! Sphere of uniform radiance, seen from outside; from inside only with [`SHAPE_TWO_SIDED`].
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `vector` | centre, world units | finite |
//! | `emission` | radiance | >= 0 |
//! | `params[0]` | radius, world units | `SHAPE_SIZE_RANGE` |
//! | `triangle` | flags | |
//!
//! From outside directions are uniform in the cone of the sphere (Wang 1992; Pharr, Jakob and Humphreys, "Physically Based
//! Rendering", 4th edition, 6.2.4), in 1 - cos, which is precise for tiny cones and for cones that are nearly a
//! hemisphere. With s = sin t / sin t_max for the angle t from the axis, s is the sine of the angle between ray and normal
//! where the ray meets the sphere, so that no difference of distances is needed. From inside they are uniform over all
//! directions.
//!
//! Points nearer to the sphere than some 1e-7 of its radius see a cone whose solid angle is rounded by up to 4e-4.
//!
//! [`SHAPE_TWO_SIDED`]: crate::scene::blob::SHAPE_TWO_SIDED

use super::emit::{Emission8, Numbers8, SceneSphere};
use super::shape::{Sampled8, Shape, ShapeFields, shape_sample};
use super::{Chosen, LightModel, LightSample8, SceneExtent, luminance};
use crate::geometry::OFFSET_BOUND;
use crate::scene::Scene;
use crate::scene::blob::Light;
use core::f32::consts::TAU;
use core::f64::consts::PI;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Spheres of eight lanes.
pub(super) struct Sphere {
    centre: Vec3x8,
    radius: F32x8,
    two_sided: Mask8,
}

impl Sphere {
    /// Vector to the centre, its squared length, lanes inside.
    #[inline(always)]
    fn seen_from(&self, p: Vec3x8) -> (Vec3x8, F32x8, Mask8) {
        let to_centre = self.centre - p;
        let distance_sqr = to_centre.length_sqr();
        (to_centre, distance_sqr, distance_sqr.le(self.radius * self.radius))
    }

    /// 1 - cos of the half angle of the cone around a sphere at this distance.
    #[inline(always)]
    fn cone(&self, distance_sqr: F32x8) -> F32x8 {
        let sin_sqr = self.radius * self.radius / distance_sqr;
        sin_sqr / (F32x8::ONE + (F32x8::ONE - sin_sqr).safe_sqrt())
    }
}

impl Shape for Sphere {
    #[inline(always)]
    fn read(of: &impl ShapeFields) -> Self {
        let [radius, ..] = of.params();
        Self { centre: of.vector(), radius, two_sided: of.two_sided() }
    }

    /// The nearer point from outside; a ray that leaves the sphere again does not meet its inside. Haines et al.,
    /// "Precision Improvements for Ray/Sphere Intersection" (Ray Tracing Gems, 2019): the distance of the centre from the
    /// ray as the length of a vector.
    #[inline(always)]
    fn meet(&self, p: Vec3x8, d: Vec3x8) -> F32x8 {
        let (to_centre, distance_sqr, inside) = self.seen_from(p);
        let along = to_centre.dot(d);
        let across = to_centre - d * along;
        let (radius_sqr, across_sqr) = (self.radius * self.radius, across.length_sqr());
        let half_chord = (radius_sqr - across_sqr).safe_sqrt();
        // the product of both parameters is that of the tangent, squared
        let near = (distance_sqr - radius_sqr) / (along + half_chord);
        let t = inside.select(along + half_chord, near);
        let seen = inside & self.two_sided | across_sqr.le(radius_sqr) & along.gt(F32x8::ZERO).and_not(inside);
        (seen & t.gt(F32x8::ZERO)).select(t, F32x8::INFINITY)
    }

    #[inline(always)]
    fn density(&self, p: Vec3x8, _: F32x8) -> F32x8 {
        let (_, distance_sqr, inside) = self.seen_from(p);
        let all_around = F32x8::splat(0.5 / TAU);
        inside.select(all_around, F32x8::ONE / (self.cone(distance_sqr) * TAU))
    }

    #[inline(always)]
    fn sample(&self, p: Vec3x8, [u, v]: [F32x8; 2]) -> Sampled8 {
        let (to_centre, distance_sqr, inside) = self.seen_from(p);
        let (sin_phi, cos_phi) = v.sin_cos_2pi();
        // at the centre any axis will do
        let axis = to_centre.normalize();
        let axis = Vec3x8::select(axis.is_finite(), axis, Vec3x8::splat(0.0, 0.0, 1.0));
        let frame = Frame8::from_normal(axis);
        let below = inside.select(u * 2.0, u * self.cone(distance_sqr));
        let (sin, cos) = ((below * (F32x8::splat(2.0) - below)).safe_sqrt(), F32x8::ONE - below);
        let wi = frame.to_world(Vec3x8::new(sin * cos_phi, sin * sin_phi, cos));
        // angle between ray and normal: sine s and cosine k, of the far point where the ray begins inside
        let s = (sin * distance_sqr.sqrt() / self.radius).min(F32x8::ONE);
        let k = ((F32x8::ONE - s) * (F32x8::ONE + s)).sqrt();
        let k = inside.select(-k, k);
        let (across, along) = (s * cos - k * sin, -(s * sin + k * cos));
        let normal = frame.to_world(Vec3x8::new(across * cos_phi, across * sin_phi, along));
        let bound = self.centre.abs().dot(normal.abs()) + self.radius;
        Sampled8 {
            wi,
            point: self.centre + normal * self.radius,
            normal,
            point_error: bound * OFFSET_BOUND,
            pdf: self.density(p, F32x8::ZERO),
            valid: self.two_sided | !inside,
        }
    }
}

impl LightModel for Sphere {
    const DELTA: bool = false;

    #[inline(always)]
    fn sample(_: &Scene<'_>, light: &Chosen, p: Vec3x8, words: [U32x8; 3], _: Mask8) -> LightSample8 {
        shape_sample::<Self>(light, p, words)
    }

    /// Power to the outside.
    fn power(light: &Light, _: &SceneExtent) -> f64 {
        let [radius, ..] = light.params.map(f64::from);
        4.0 * PI * PI * radius * radius * luminance(light.emission)
    }

    /// To the outside alone: rays to the inside would have to end where they leave the sphere again.
    #[inline(always)]
    fn emit(_: &Scene<'_>, light: &Chosen, _: &SceneSphere, n: &Numbers8, _: Mask8) -> Emission8 {
        let s = Self::read(light);
        let [below, turn, _] = n.words.map(U32x8::to_unit);
        let (below, (sin_phi, cos_phi)) = (below * 2.0, turn.sin_cos_2pi());
        let across = (below * (2.0 - below)).safe_sqrt();
        let normal = Vec3x8::new(across * cos_phi, across * sin_phi, 1.0 - below);
        let area = s.radius * s.radius * (2.0 * TAU);
        Emission8::from_shape((s.centre + normal * s.radius, normal), Mask8::NONE, light.emission, area, n)
    }
}
