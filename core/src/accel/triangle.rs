//! The watertight ray-triangle test of Woop, Benthin and Wald, JCGT 2(1) 2013.
//!
//! ```text
//! p  = vertex - o                       for a, b, c, axes permuted so that |d.z| is largest
//! x' = p.x - d.x/d.z p.z,  y' alike     the ray becomes the z axis
//! U  = c.x' b.y' - c.y' b.x'            V, W cyclic; hit if no two have opposite signs
//! t  = (U a.z + V b.z + W c.z) / (U + V + W) / d.z
//! ```
//!
//! 1. Both triangles of an edge compute the same x', y' for its vertices and then `fl(pq) - fl(rs)` or exactly its
//!    negative: no ray passes between them. A fused product would round one side only and leak (NUMERICS TRI-1), hence
//!    plain `*` and `-` here in every arithmetic.
//! 2. The same lanes serve one ray against eight triangles and eight rays against one triangle: the two ways of
//!    traversal agree in every bit.
//! 3. Where vertices lie on both sides of the origin along the ray, t near 0 may have the wrong sign: a needle that a
//!    ray has just left can be hit again. If t is within its error bound of 0 (pbrt-v4's bound for this test, section
//!    6.8.8) the side of the plane decides, in f64. This rejects hits of the own surface without opening gaps: a
//!    triangle that lies in front is never rejected.
//! 4. The same at the other end of a shadow ray: a needle of an emitter (1000 : 1 and thinner) may seem to stand before
//!    its own sample. If t is within its error bound of the limit, the plane decides as well. Closest hits need no such
//!    care: nothing ends just before their limit.

use super::setup::Setup;
use croupier_simd::{F32x8, Mask8};

/// Three vertices, axes permuted.
pub(super) type Vertices = [[F32x8; 3]; 3];

/// Unit roundoff of f32.
const U: f32 = 1.0 / 16_777_216.0;

/// Hits that pass the edges and the interval.
pub(super) struct Candidates {
    /// Lanes.
    pub mask: Mask8,
    /// Ray parameter.
    pub t: F32x8,
    /// Weight of vertex b.
    pub u: F32x8,
    /// Weight of vertex c.
    pub v: F32x8,
}

/// Constants of a ray (or of eight) that the test reads, axes permuted.
pub(super) struct Line<'a> {
    pub o: [F32x8; 3],
    pub shear: [F32x8; 3],
    pub tmin: F32x8,
    /// Rays that the constants come from; read in doubtful cases only.
    pub setup: &'a Setup,
    /// Permutation of the axes.
    pub axes: [usize; 3],
    /// Lane of `setup` that all lanes hold; `None` for eight rays.
    pub lane: Option<usize>,
}

/// Lanes with `tmin < t <= limit` inside the triangle; `ANY`: for rays that end at `limit`, others treat it as the
/// closest hit so far. Degenerate triangles (no area seen along the ray) are missed. `EARLY`: returns as soon as no
/// lane is left; else only doubtful hits are a branch.
#[inline(always)]
pub(super) fn intersect<const ANY: bool, const EARLY: bool>(
    p: &Vertices,
    r: &Line<'_>,
    limit: F32x8,
) -> Option<Candidates> {
    let shear = |p: &[F32x8; 3]| {
        let z = p[2] - r.o[2];
        [(p[0] - r.o[0]) - r.shear[0] * z, (p[1] - r.o[1]) - r.shear[1] * z, z]
    };
    let (a, b, c) = (shear(&p[0]), shear(&p[1]), shear(&p[2]));
    let edge = |p: &[F32x8; 3], q: &[F32x8; 3]| p[0] * q[1] - p[1] * q[0];
    let (u, v, w) = (edge(&c, &b), edge(&a, &c), edge(&b, &a));
    let zero = F32x8::ZERO;
    // both sides hold where all three are 0 (no area seen, unused slots): exclusive or drops those
    let inside = u.min(v).min(w).ge(zero) ^ u.max(v).max(w).le(zero);
    if EARLY && inside.none() {
        return None;
    }
    let scale = F32x8::ONE / (u + v + w);
    // NaN from garbage fails here
    let t = (u * a[2] + v * b[2] + w * c[2]) * scale * r.shear[2];
    let mut mask = inside & t.gt(r.tmin) & t.le(limit);
    if EARLY && mask.none() {
        return None;
    }
    let behind = (a[2] * r.shear[2]).min(b[2] * r.shear[2]).min(c[2] * r.shear[2]).lt(zero);
    if (mask & behind).any() {
        let doubt = mask & behind & t.le(error(&a, &b, &c, [u, v, w], scale, r.shear[2]));
        if doubt.any() {
            // a copy: a reference to the original would keep it in memory on the hot path
            let p = *p;
            mask = mask.and_not(not_ahead(&p, r.setup, r.axes, r.lane, doubt));
            if mask.none() {
                return None;
            }
        }
    }
    if ANY {
        let last = (a[2] * r.shear[2]).max(b[2] * r.shear[2]).max(c[2] * r.shear[2]);
        let doubt = mask & last.ge(limit);
        if doubt.any() {
            let doubt = doubt & t.ge(limit - error(&a, &b, &c, [u, v, w], scale, r.shear[2]));
            if doubt.any() {
                let p = *p;
                mask = mask.and_not(beyond(&p, r.setup, r.axes, r.lane, limit, doubt));
                if mask.none() {
                    return None;
                }
            }
        }
    }
    Some(Candidates { mask, t, u: v * scale, v: w * scale })
}

/// Bound of the absolute error of t (pbrt-v4, section 6.8.8).
#[inline(always)]
fn error(a: &[F32x8; 3], b: &[F32x8; 3], c: &[F32x8; 3], e: [F32x8; 3], scale: F32x8, inv_d: F32x8) -> F32x8 {
    let max = |x: F32x8, y: F32x8, z: F32x8| x.abs().max(y.abs()).max(z.abs());
    let (x, y, z) = (max(a[0], b[0], c[0]), max(a[1], b[1], c[1]), max(a[2], b[2], c[2]));
    let e = max(e[0], e[1], e[2]);
    let dz = z * (3.0 * U);
    let (dx, dy) = ((x + z) * (5.0 * U), (y + z) * (5.0 * U));
    let de = (x * y * (2.0 * U) + dy * x + dx * y) * 2.0;
    (e * z * (3.0 * U) + de * z + dz * e) * 3.0 * (scale * inv_d).abs()
}

/// Lanes of `doubt` whose triangle's plane is not ahead of the origin, decided in f64: differences of floats, and
/// products of those with 2^-53 relative error, against heights that are at least some 2^-24 of the coordinates.
#[cold]
#[inline(never)]
fn not_ahead(p: &Vertices, s: &Setup, axes: [usize; 3], lane: Option<usize>, doubt: Mask8) -> Mask8 {
    let ahead = |i: usize| {
        let (height, slope) = plane(p, s, axes, lane, i);
        (height > 0.0 && slope > 0.0) || (height < 0.0 && slope < 0.0)
    };
    Mask8::from_bits(doubt.lanes().filter(|i| !ahead(*i)).fold(0, |bits, i| bits | 1 << i))
}

/// Lanes of `doubt` whose triangle's plane is not met up to `limit`, decided like [`not_ahead`].
#[cold]
#[inline(never)]
fn beyond(p: &Vertices, s: &Setup, axes: [usize; 3], lane: Option<usize>, limit: F32x8, doubt: Mask8) -> Mask8 {
    let met = |i: usize| {
        let (height, slope) = plane(p, s, axes, lane, i);
        let reach = slope * f64::from(limit.lane(i));
        (slope > 0.0 && height <= reach) || (slope < 0.0 && height >= reach)
    };
    Mask8::from_bits(doubt.lanes().filter(|i| !met(*i)).fold(0, |bits, i| bits | 1 << i))
}

/// Distance of the plane of the triangle in lane `i` from the origin, and component of the direction towards it, both
/// times twice the area. From the two shorter edges and the vertex between them: with the long edges of a needle of
/// 1e8 : 1 even `f64` loses the side on which an origin is.
fn plane(p: &Vertices, s: &Setup, axes: [usize; 3], lane: Option<usize>, i: usize) -> (f64, f64) {
    let at = |v: &[F32x8; 3]| v.map(|x| f64::from(x.lane(i)));
    let from = |rays: &[[f32; 8]; 3]| axes.map(|k| f64::from(rays[k.min(2)][lane.unwrap_or(i) & 7]));
    let sub = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let (a, b, c) = (at(&p[0]), at(&p[1]), at(&p[2]));
    let (ab, bc, ca) = (sub(b, a), sub(c, b), sub(a, c));
    let (x, y, z) = (dot(ab, ab), dot(bc, bc), dot(ca, ca));
    let (v, e, f) = if x >= y && x >= z {
        (c, bc, ca)
    } else if y >= z {
        (a, ca, ab)
    } else {
        (b, ab, bc)
    };
    let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    (dot(sub(v, from(&s.o)), n), dot(from(&s.d), n))
}
