//! The octahedral map between the unit sphere and the unit square that keeps ratios of areas (Clarberg, "Fast
//! Equal-Area Mapping of the (Hemi)Sphere using SIMD", 2008): the upper hemisphere fills the inner diamond, the lower
//! one the corners. With r the distance from a pole (1 - r^2 = |z|) and phi the azimuth in its quadrant, a point of a
//! quadrant's triangle has the coordinates r (1 - 2 phi / pi) and r 2 phi / pi.

use core::f32::consts::FRAC_2_PI;
use croupier_simd::{F32x8, U32x8, Vec3x8};

/// Number of steps of a stored coordinate.
const STEPS: f32 = 65_536.0;
/// Largest float below [`STEPS`].
const LAST: f32 = 65_535.996;

/// Coordinates in [0, 1] of eight unit vectors.
#[inline(always)]
pub fn to_square(d: Vec3x8) -> [F32x8; 2] {
    let a = d.abs();
    // 1 - |z| without its cancellation at the poles
    let r = ((d.x * d.x + d.y * d.y) / (a.z + 1.0)).sqrt();
    let v = a.y.atan2(a.x) * FRAC_2_PI * r;
    let u = r - v;
    let below = d.z.lt(F32x8::ZERO);
    let (u, v) = (below.select(1.0 - v, u), below.select(1.0 - u, v));
    [u.copysign(d.x), v.copysign(d.y)].map(|x| (x + 1.0) * 0.5)
}

/// Unit vectors at eight points of the unit square.
#[inline(always)]
pub fn from_square([x, y]: [F32x8; 2]) -> Vec3x8 {
    let (u, v) = (x * 2.0 - 1.0, y * 2.0 - 1.0);
    let (a, b) = (u.abs(), v.abs());
    let height = 1.0 - (a + b);
    let r = 1.0 - height.abs();
    let quarter = r.gt(F32x8::ZERO).zero_unless((b - a) / r.max(F32x8::splat(f32::MIN_POSITIVE)));
    // in turns, an eighth of one in the middle of a quadrant
    let (s, c) = ((quarter + 1.0) * 0.125).sin_cos_2pi();
    let radius = r * (2.0 - r * r).safe_sqrt();
    let z = (1.0 - r * r).copysign(height);
    Vec3x8::new(c.abs().copysign(u) * radius, s.abs().copysign(v) * radius, z)
}

/// Both coordinates of eight unit vectors in 16 bits each, the first below. NaN gives coordinate 0.
#[inline(always)]
pub fn quantised(d: Vec3x8) -> U32x8 {
    let [x, y] = to_square(d).map(|x| (x * STEPS).clamp(0.0, LAST).to_i32().to_u32());
    x | y << 16
}
