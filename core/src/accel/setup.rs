//! Per-ray constants of the traversal, computed for eight rays at once.
//!
//! *Slabs.* A ray meets the plane `x = b` at `(b - o) / d`, computed as `(o' - b) * -(1/d)` where `o'` is the origin
//! moved by `e = 2^-21 (|o| + S)` so that the box looks larger: against the direction for the far planes, along it for
//! the near ones; S is the largest |coordinate| of the tree. Three roundings (difference, reciprocal, product) are each
//! at most `u |b - o| / |d|` with `u = 2^-24`, the rounding of `o'` at most `u (|o| + e)`: together below
//! `4u (|o| + S) / |d|`, half of `e / |d|`. The other half covers the rounding of the triangle test, which moves a
//! triangle's outline sideways by a few `u` of its distance. So a box that holds a triangle is never missed by a ray
//! that hits the triangle (NUMERICS BOX-1 to BOX-4). Components below `1e-18` of the largest act as if they were that
//! large: with `e > 0` a ray inside a face stays inside.
//!
//! *Monotone.* Each step is a monotone function of the plane, rounding included. So a child is never entered earlier
//! than its parent, and the interval test of a packet never rejects what one of its rays accepts: which leaves a ray
//! visits depends on that ray alone.

use crate::geometry::Ray8;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// `[f(0), f(1), f(2)]`; `array::map` would go through memory.
#[inline(always)]
pub(super) fn each<T>(f: impl Fn(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}

/// Constants of eight rays, `[axis][lane]`.
pub(super) struct Setup {
    /// Origins.
    pub o: [[f32; 8]; 3],
    /// Directions.
    pub d: [[f32; 8]; 3],
    /// Origins moved for near planes.
    pub near: [[f32; 8]; 3],
    /// Origins moved for far planes.
    pub far: [[f32; 8]; 3],
    /// Negative inverse directions, `-1/d`.
    pub ninv: [[f32; 8]; 3],
    /// Shear constants `d[kx]/d[kz]`, `d[ky]/d[kz]`, `1/d[kz]` with the axes of [`Setup::axes`].
    pub shear: [[f32; 8]; 3],
    /// Smallest parameter: `max(tmin, 0)`.
    pub tmin: [f32; 8],
    /// Largest float below `tmax`: inside the traversal limits are inclusive.
    pub limit: [f32; 8],
    /// Lanes with a negative direction, per axis.
    pub negative: [u32; 3],
    /// Lanes whose major axis is x, y.
    pub major: [u32; 2],
    /// Lanes to trace.
    pub valid: u32,
}

impl Setup {
    /// Constants of eight rays; `extent` is the largest |coordinate| of the tree, or more.
    #[inline(always)]
    pub(super) fn new(rays: &Ray8, active: Mask8, extent: F32x8) -> Self {
        let a = rays.d.abs();
        let m = a.max_component();
        let tmin = F32x8::ZERO.max(rays.tmin);
        let valid = active & rays.o.is_finite() & rays.d.is_finite() & m.gt(F32x8::ZERO) & tmin.lt(rays.tmax);
        // `max` drops a NaN on its right side only: the sums below may be NaN in invalid lanes, never in others
        let slow = (m * 1e-18).max(F32x8::splat(1e-37));
        let inv = |d: F32x8, a: F32x8| (F32x8::ONE / a.max(slow)).copysign(d);
        let inv = Vec3x8::new(inv(rays.d.x, a.x), inv(rays.d.y, a.y), inv(rays.d.z, a.z));
        let pad = |o: F32x8, inv: F32x8| ((o.abs() + extent) * (0.5 / 1_048_576.0)).copysign(inv);
        let e = Vec3x8::new(pad(rays.o.x, inv.x), pad(rays.o.y, inv.y), pad(rays.o.z, inv.z));
        let x = a.x.ge(a.y) & a.x.ge(a.z);
        let y = a.y.ge(a.z).and_not(x);
        let pick = |p: F32x8, q: F32x8, r: F32x8| x.select(p, y.select(q, r));
        let d = rays.d;
        let dz = pick(d.x, d.y, d.z);
        let arrays = |v: Vec3x8| [v.x.to_array(), v.y.to_array(), v.z.to_array()];
        Self {
            o: arrays(rays.o),
            d: arrays(d),
            near: arrays(rays.o + e),
            far: arrays(rays.o - e),
            ninv: arrays(-inv),
            shear: [
                (pick(d.y, d.z, d.x) / dz).to_array(),
                (pick(d.z, d.x, d.y) / dz).to_array(),
                (F32x8::ONE / dz).to_array(),
            ],
            tmin: tmin.to_array(),
            limit: below(rays.tmax).to_array(),
            negative: [
                inv.x.is_sign_negative().bits(),
                inv.y.is_sign_negative().bits(),
                inv.z.is_sign_negative().bits(),
            ],
            major: [x.bits(), y.bits()],
            valid: valid.bits(),
        }
    }

    /// Axes of lane `i`, cyclic so that the shear keeps orientation; the last is the major one. From a table: the
    /// next ray's axes cannot be predicted from this one's.
    #[inline(always)]
    pub(super) fn axes(&self, i: usize) -> [usize; 3] {
        const TABLE: [[usize; 3]; 4] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 1, 2]];
        // `min` shows the compiler that they index three rows
        TABLE[(self.major[0] >> i & 1 | (self.major[1] >> i & 1) << 1) as usize].map(|k| k.min(2))
    }

    /// Rows of a node that hold the near planes of lane `i`; the far ones are at `3 - x`, `5 - y`, `7 - z`.
    #[inline(always)]
    pub(super) fn rows(&self, i: usize) -> [usize; 3] {
        each(|k| k + 3 * (self.negative[k] >> i & 1) as usize)
    }

    /// Lanes among `of` with the octant and the major axis of lane `i`.
    #[inline(always)]
    pub(super) fn alike(&self, i: usize, of: u32) -> u32 {
        let same = |bits: u32| bits ^ (bits >> i & 1).wrapping_sub(1);
        let octant = same(self.negative[0]) & same(self.negative[1]) & same(self.negative[2]);
        of & octant & same(self.major[0]) & same(self.major[1])
    }
}

/// Largest float below a positive `x`.
#[inline(always)]
fn below(x: F32x8) -> F32x8 {
    F32x8::from_bits(x.to_bits() - croupier_simd::U32x8::splat(1))
}
