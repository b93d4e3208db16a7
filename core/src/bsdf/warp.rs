//! Maps from the unit square to the disk and the hemisphere. Every map accepts u = 0 and u = 1 - 2^-24.

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
