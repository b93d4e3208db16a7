//! Disk of uniform radiance, seen from its front; from its back only with [`SHAPE_TWO_SIDED`].
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `vector` | middle, world units | finite |
//! | `emission` | radiance | >= 0 |
//! | `params[0..3]` | unit normal of the front | |
//! | `params[3]` | radius, world units | `SHAPE_SIZE_RANGE` |
//! | `triangle` | flags | |
//!
//! From points nearer to the middle than [`NEAR`] radii directions are uniform in the solid angle of the square around
//! the disk, turned so that an edge faces the point, and those that miss the disk bring nothing (Gamito, "Solid Angle
//! Sampling of Disk and Cylinder Lights", EGSR 2016, draws again instead: a light sample has no random numbers for that).
//! So the density is bounded where one by area is not, and at least about 3/4 of the samples count. From other points, and
//! where the square has a solid angle below [`LEAST_SOLID_ANGLE`], points are uniform on the disk, with the density r^2 /
//! (A cos): there it varies less than a missed sample in four would.
//!
//! [`SHAPE_TWO_SIDED`]: crate::scene::blob::SHAPE_TWO_SIDED
//! [`LEAST_SOLID_ANGLE`]: super::rectangle::LEAST_SOLID_ANGLE

use super::emit::{Emission8, Numbers8, SceneSphere};
use super::rectangle::SphericalRectangle8;
use super::shape::{Sampled8, Shape, ShapeFields, area_density, shape_sample};
use super::{Chosen, LightModel, LightSample8, SceneExtent, luminance};
use crate::camera::concentric_disk;
use crate::geometry::OFFSET_BOUND;
use crate::scene::Scene;
use crate::scene::blob::Light;
use core::f64::consts::PI;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Distance from the middle, in radii, within which the solid angle of the square is sampled.
const NEAR: f32 = 1.25;

/// Disks of eight lanes.
pub(super) struct Disk {
    middle: Vec3x8,
    /// Unit normal of the front.
    normal: Vec3x8,
    radius: F32x8,
    two_sided: Mask8,
}

/// A disk as points see it.
struct Seen8 {
    /// Unit vectors in the disk's plane; the first leads away from the point.
    axes: [Vec3x8; 2],
    /// Middle: along both axes and the normal.
    middle: Vec3x8,
    square: SphericalRectangle8,
    /// Lanes that sample the square.
    by_square: Mask8,
}

impl Disk {
    #[inline(always)]
    fn seen_from(&self, p: Vec3x8) -> Seen8 {
        let to_middle = self.middle - p;
        let z = to_middle.dot(self.normal);
        let within = to_middle - self.normal * z;
        // on the axis any direction will do; near it the rounding along the normal must go
        let distance = within.length();
        let off_axis = distance.gt(self.radius * 1e-3);
        let outward = within.normalize();
        let outward = (outward - self.normal * outward.dot(self.normal)).normalize();
        let along = Vec3x8::select(off_axis, outward, Frame8::from_normal(self.normal).s);
        let across = self.normal.cross(along);
        let middle = Vec3x8::new(to_middle.dot(along), to_middle.dot(across), z);
        let square = SphericalRectangle8::new([middle.x, middle.y], [self.radius; 2], z.abs());
        let near = self.radius * NEAR;
        let by_square = to_middle.length_sqr().lt(near * near) & square.is_large();
        Seen8 { axes: [along, across], middle, square, by_square }
    }

    #[inline(always)]
    fn area(&self) -> F32x8 {
        self.radius * self.radius * core::f32::consts::PI
    }
}

impl Shape for Disk {
    #[inline(always)]
    fn read(of: &impl ShapeFields) -> Self {
        let [x, y, z, radius, ..] = of.params();
        // unit to 1e-3 only in the blob
        let normal = Vec3x8::new(x, y, z).normalize();
        Self { middle: of.vector(), normal, radius, two_sided: of.two_sided() }
    }

    #[inline(always)]
    fn meet(&self, p: Vec3x8, d: Vec3x8) -> F32x8 {
        let to_middle = self.middle - p;
        let towards = d.dot(self.normal);
        let t = to_middle.dot(self.normal) / towards;
        let front = towards.lt(F32x8::ZERO) | self.two_sided;
        let inside = (d * t - to_middle).length_sqr().le(self.radius * self.radius);
        (inside & front & t.gt(F32x8::ZERO)).select(t, F32x8::INFINITY)
    }

    #[inline(always)]
    fn density(&self, p: Vec3x8, t: F32x8) -> F32x8 {
        let seen = self.seen_from(p);
        let by_area = area_density(t, seen.middle.z.abs(), self.area());
        seen.by_square.select(F32x8::ONE / seen.square.solid_angle, by_area)
    }

    #[inline(always)]
    fn sample(&self, p: Vec3x8, u: [F32x8; 2]) -> Sampled8 {
        let Seen8 { axes: [along, across], middle, square, by_square } = self.seen_from(p);
        let [a, b] = square.sample(u);
        let [c, d] = concentric_disk(u).map(|x| x * self.radius);
        // in the disk's plane, from its middle
        let (x, y) = (by_square.select(a - middle.x, c), by_square.select(b - middle.y, d));
        let local = Vec3x8::new(middle.x + x, middle.y + y, middle.z);
        let distance = local.length();
        let by_area = area_density(distance, middle.z.abs(), self.area());
        let inside = (x * x + y * y).le(self.radius * self.radius);
        let bound = self.middle.abs().dot(self.normal.abs()) + self.radius;
        Sampled8 {
            wi: (along * local.x + across * local.y + self.normal * local.z) / distance,
            point: self.middle + along * x + across * y,
            normal: self.normal,
            point_error: bound * OFFSET_BOUND,
            pdf: by_square.select(F32x8::ONE / square.solid_angle, by_area),
            valid: (self.two_sided | middle.z.lt(F32x8::ZERO)).and_not(by_square.and_not(inside)),
        }
    }
}

impl LightModel for Disk {
    const DELTA: bool = false;

    #[inline(always)]
    fn sample(_: &Scene<'_>, light: &Chosen, p: Vec3x8, words: [U32x8; 3], _: Mask8) -> LightSample8 {
        shape_sample::<Self>(light, p, words)
    }

    /// Power of one Lambertian side, or of both.
    fn power(light: &Light, _: &SceneExtent) -> f64 {
        let [_, _, _, radius, ..] = light.params.map(f64::from);
        PI * PI * radius * radius * super::shape::sides(light) * luminance(light.emission)
    }

    #[inline(always)]
    fn emit(_: &Scene<'_>, light: &Chosen, _: &SceneSphere, n: &Numbers8, _: Mask8) -> Emission8 {
        let s = Self::read(light);
        let [x, y] = concentric_disk([n.words[0], n.words[1]].map(U32x8::to_unit));
        let on = Frame8::from_normal(s.normal).to_world(Vec3x8::new(x, y, F32x8::ZERO));
        Emission8::from_shape((s.middle + on * s.radius, s.normal), s.two_sided, light.emission, s.area(), n)
    }
}
