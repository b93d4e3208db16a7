//! Maps from the unit square to disks and spheres. Every map accepts u = 0 and u = 1 - 2^-24.

use core::f32::consts::{FRAC_1_PI, PI};
use croupier_simd::{F32x8, Vec3x8};

/// Uniform point on the unit disk, polar map: density 1/pi per unit area.
#[inline(always)]
pub fn disk(u: F32x8, v: F32x8) -> (F32x8, F32x8) {
    let r = u.safe_sqrt();
    let (s, c) = v.sin_cos_2pi();
    (r * c, r * s)
}

/// Direction around +z with density cos / pi per steradian. z = sqrt(1 - u) >= 2^-12 without cancellation, so that the
/// density is never 0 (NUMERICS SMP-7).
#[inline(always)]
pub fn cosine_hemisphere(u: F32x8, v: F32x8) -> Vec3x8 {
    let (x, y) = disk(u, v);
    Vec3x8::new(x, y, (1.0 - u).safe_sqrt())
}

/// Density of [`cosine_hemisphere`], 1/sr; 0 below the horizon.
#[inline(always)]
pub fn cosine_hemisphere_pdf(z: F32x8) -> F32x8 {
    F32x8::ZERO.max(z) * FRAC_1_PI
}

/// Uniform direction on the sphere: density [`UNIFORM_SPHERE_PDF`].
#[inline(always)]
pub fn uniform_sphere(u: F32x8, v: F32x8) -> Vec3x8 {
    // sin^2 = 1 - (1 - 2u)^2 without the cancellation
    let r = (u * (1.0 - u)).safe_sqrt() * 2.0;
    let (s, c) = v.sin_cos_2pi();
    Vec3x8::new(r * c, r * s, 1.0 - u * 2.0)
}

/// Density of [`uniform_sphere`], 1/sr.
pub const UNIFORM_SPHERE_PDF: f32 = FRAC_1_PI / 4.0;

/// Uniform direction within the cone of half angle theta around +z, `sin2` = sin^2 theta in [0, 1], theta <= pi/2:
/// density 1 / (2 pi [`one_minus_cos`]).
#[inline(always)]
pub fn uniform_cone(sin2: F32x8, u: F32x8, v: F32x8) -> Vec3x8 {
    let h = u * one_minus_cos(sin2);
    let r = (h * (2.0 - h)).safe_sqrt();
    let (s, c) = v.sin_cos_2pi();
    Vec3x8::new(r * c, r * s, 1.0 - h)
}

/// 1 - cos theta from sin^2 theta, theta <= pi/2, exact to a few roundings for the smallest cones (NUMERICS SMP-8).
#[inline(always)]
pub fn one_minus_cos(sin2: F32x8) -> F32x8 {
    sin2 / (1.0 + (1.0 - sin2).safe_sqrt())
}

/// Density of [`uniform_cone`] inside the cone, 1/sr; infinite for `sin2 = 0`.
#[inline(always)]
pub fn uniform_cone_pdf(sin2: F32x8) -> F32x8 {
    1.0 / (one_minus_cos(sin2) * (2.0 * PI))
}
