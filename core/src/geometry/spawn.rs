//! Points on surfaces with error bounds, and the rays that leave them.

use super::Ray8;
use croupier_simd::{F32x8, Vec3x8};

/// Points on triangles, world space.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint8 {
    /// Position, from the barycentric weights (never `o + t d`: NUMERICS OFF-1).
    pub p: Vec3x8,
    /// Unit geometric normal, on the side from which the vertices run counter-clockwise.
    pub ng: Vec3x8,
    /// Bound of the rounding error of `p` along `ng`, world units.
    pub error: F32x8,
}

/// Bound of the rounding of a point on a triangle, relative to the absolute terms of its sum: 32 u, u = 2^-24 (NUMERICS
/// OFF-1). Vertices are exact, so weights, products and sums leave a few roundings of each term; 32 leaves room for the
/// rounding of the offset and of the triangle test.
pub const OFFSET_BOUND: f32 = 32.0 / 16_777_216.0;

/// The points with weights `1 - u - v`, `u`, `v` on triangles `[a, b, c]`. A triangle without area has the normal +z.
///
/// `error` is [`OFFSET_BOUND`]` sum |b_i p_i| . |ng|`.
#[inline]
pub fn surface_point([a, b, c]: [Vec3x8; 3], u: F32x8, v: F32x8) -> SurfacePoint8 {
    point_with_normal([a, b, c], triangle_normal(a, b, c), u, v)
}

/// [`surface_point`] with a normal of any length.
#[inline(always)]
pub(super) fn point_with_normal([a, b, c]: [Vec3x8; 3], n: Vec3x8, u: F32x8, v: F32x8) -> SurfacePoint8 {
    let w = F32x8::ONE - u - v;
    let (pa, pb, pc) = (a * w, b * u, c * v);
    let size = n.abs().max_component();
    // scaled before the length: edges of 1e-12 square to nothing; `max` also turns a NaN into the tiny value
    let tiny = F32x8::splat(1e-37);
    let n = n / tiny.max(size);
    let up = Vec3x8::splat(0.0, 0.0, 1.0);
    let ng = Vec3x8::select(size.gt(tiny) & size.is_finite(), n / n.length(), up);
    let sum = pa.abs() + pb.abs() + pc.abs();
    SurfacePoint8 { p: pa + pb + pc, ng, error: sum.dot(ng.abs()) * OFFSET_BOUND }
}

/// Geometric normal of `[a, b, c]`, as long as twice the area, from the two shorter edges: of a needle the two long ones
/// are nearly parallel, and the roundings of their cross product would tilt it. If all three are nearly parallel (an
/// obtuse needle) it may be tilted by some 2^-24 of length over width.
#[inline]
pub fn triangle_normal(a: Vec3x8, b: Vec3x8, c: Vec3x8) -> Vec3x8 {
    edge_normal(b - a, c - b, a - c)
}

/// [`triangle_normal`] from the three edges.
#[inline(always)]
pub(super) fn edge_normal(ab: Vec3x8, bc: Vec3x8, ca: Vec3x8) -> Vec3x8 {
    let (x, y, z) = (ab.length_sqr(), bc.length_sqr(), ca.length_sqr());
    let skip_ab = x.ge(y) & x.ge(z);
    let skip_bc = y.ge(z);
    let rest = Vec3x8::select(skip_bc, ca.cross(ab), ab.cross(bc));
    Vec3x8::select(skip_ab, bc.cross(ca), rest)
}

/// `p` moved along `ng` by `error` to the side that `d` points to. Rounding the sum moves it by at most `error / 32`.
#[inline]
pub fn offset(p: Vec3x8, ng: Vec3x8, error: F32x8, d: Vec3x8) -> Vec3x8 {
    p + ng * error.copysign(d.dot(ng))
}

/// The segments from `p` to `q`, both moved off their surfaces, as rays with `d = q' - p'` and `0 < t < 1`.
///
/// `q` moves by [`OFFSET_BOUND`]` |d| . |q_ng|` more than its own error: `d` and the t of the triangle test are rounded
/// relative to the distance, whatever the coordinates of `q`. An emitter in a plane through the origin has an error
/// of 0 and would occlude itself.
pub fn shadow_ray(p: Vec3x8, ng: Vec3x8, error: F32x8, q: Vec3x8, q_ng: Vec3x8, q_error: F32x8) -> Ray8 {
    let d = q - p;
    let o = offset(p, ng, error, d);
    let reach = d.abs().dot(q_ng.abs()) * OFFSET_BOUND;
    let d = offset(q, q_ng, q_error + reach, -d) - o;
    Ray8 { tmax: F32x8::ONE, ..Ray8::unbounded(o, d) }
}
