//! The walk of segments through the bricks of majorants of grids: a digital differential analyser (Amanatides and Woo
//! 1987) over eight lanes.
//!
//! *Origin.* The walk counts distance s from where the segment enters the box, not from its origin: positions along it
//! are then as accurate as the box is wide, however far away the origin lies. The brick that the walk is in and the
//! brick that a position lies in differ by roundings, about 2^-22 of the number of bricks; majorants hold for one cell
//! around their brick, of which interpolation needs half (NUMERICS MED-5).
//!
//! *Progress.* The next plane of each axis is computed from the integer index of the brick. An index moves by one at
//! each crossing, so that a walk takes no more steps than the grid has bricks along its three edges, whatever the
//! distances round to; planes of one axis are in order because rounding is monotone.
//!
//! *Parallel axes.* A component below 1e-18 of the direction meets no plane: the walk stays in its layer of bricks.

use super::density::Grids8;
use super::segment::Span8;
use crate::scene::Scene;
use crate::scene::blob::BRICK;
use croupier_simd::{F32x8, I32x8, Mask8, U32x8, Vec3x8};

/// Components below this meet no plane; the largest component of a unit vector is above 1/2.
const PARALLEL: f32 = 1e-18;

/// One axis of the walk; positions in bricks.
#[derive(Clone, Copy, Debug)]
struct Axis8 {
    /// Position where the segment enters the box.
    start: F32x8,
    /// Bricks per unit length.
    rate: F32x8,
    /// Its inverse; 0 for parallel lanes.
    inverse: F32x8,
    /// Lanes that meet planes of this axis.
    crosses: Mask8,
    /// Current brick.
    brick: I32x8,
    /// Number of bricks.
    count: I32x8,
    /// +1 or -1.
    step: I32x8,
    /// 1 for lanes that go up: the next plane is that above the brick.
    ahead: I32x8,
    /// Distance of the next plane.
    plane: F32x8,
}

impl Axis8 {
    /// Distance of the plane at which the lanes leave their brick.
    #[inline(always)]
    fn next_plane(&self) -> F32x8 {
        let distance = ((self.brick + self.ahead).to_f32() - self.start) * self.inverse;
        self.crosses.select(F32x8::ZERO.max(distance), F32x8::INFINITY)
    }

    /// Moves the lanes on by one brick; those still in the grid.
    #[inline(always)]
    fn advance(&mut self, lanes: Mask8) -> Mask8 {
        self.brick = I32x8::select(lanes, self.brick + self.step, self.brick);
        self.plane = self.next_plane();
        let below = self.brick.lt(I32x8::splat(0));
        self.brick.lt(self.count).and_not(below)
    }
}

/// Walks of eight segments through the bricks of their grids.
#[derive(Clone, Copy, Debug)]
pub struct BrickWalk8 {
    axes: [Axis8; 3],
    first: U32x8,
    /// Distance at which the segment enters the box.
    pub begin: F32x8,
    /// Distance from there to where it leaves the box or ends.
    pub length: F32x8,
    /// Lanes whose segment has a part in the box.
    pub inside: Mask8,
}

impl BrickWalk8 {
    /// Walks at the beginning of the part of `path` in the boxes of `grids`.
    #[inline(always)]
    pub fn new(grids: &Grids8, path: &Span8, active: Mask8) -> Self {
        let per_cell = 1.0 / BRICK as f32;
        let o = (path.o - grids.min) * grids.scale * per_cell;
        let rate = path.d * grids.scale * per_cell;
        let size = grids.size * per_cell;
        // slabs
        let slab = |o: F32x8, d: F32x8, rate: F32x8, size: F32x8| {
            let crosses = d.abs().gt(F32x8::splat(PARALLEL));
            let inverse = crosses.zero_unless(F32x8::ONE / rate);
            let (a, b) = (-o * inverse, (size - o) * inverse);
            let within = o.ge(F32x8::ZERO) & o.le(size);
            let usable = crosses & inverse.is_finite();
            let near = usable.select(a.min(b), F32x8::splat(f32::NEG_INFINITY));
            let far = usable.select(a.max(b), F32x8::INFINITY);
            (near, far, usable, inverse, usable | within.and_not(crosses))
        };
        let sx = slab(o.x, path.d.x, rate.x, size.x);
        let sy = slab(o.y, path.d.y, rate.y, size.y);
        let sz = slab(o.z, path.d.z, rate.z, size.z);
        let begin = F32x8::ZERO.max(sx.0.max(sy.0).max(sz.0));
        let end = sx.1.min(sy.1).min(sz.1).min(path.length);
        let inside = active & sx.4 & sy.4 & sz.4 & begin.lt(end) & (end - begin).is_finite();
        let axis = |o: F32x8, rate: F32x8, size: F32x8, crosses: Mask8, inverse: F32x8, cells: &[u32; 8]| {
            let start = F32x8::ZERO.max(o + begin * rate).min(size);
            let count = I32x8::from_fn(|i| cells[i & 7].div_ceil(BRICK) as i32);
            let last = count - I32x8::splat(1);
            let brick = start.floor().to_i32();
            let brick = I32x8::select(brick.lt(last), brick, last);
            let up = rate.gt(F32x8::ZERO);
            let step = I32x8::select(up, I32x8::splat(1), I32x8::splat(-1));
            let ahead = I32x8::select(up, I32x8::splat(1), I32x8::splat(0));
            let axis = Axis8 { start, rate, inverse, crosses, brick, count, step, ahead, plane: F32x8::INFINITY };
            Axis8 { plane: axis.next_plane(), ..axis }
        };
        Self {
            axes: [
                axis(o.x, rate.x, size.x, sx.2, sx.3, &grids.cells[0]),
                axis(o.y, rate.y, size.y, sy.2, sy.3, &grids.cells[1]),
                axis(o.z, rate.z, size.z, sz.2, sz.3, &grids.cells[2]),
            ],
            first: U32x8::new(grids.first_majorant),
            begin: inside.zero_unless(begin),
            length: inside.zero_unless(end - begin),
            inside,
        }
    }

    /// Position in cells at distance `s` from the entry.
    #[inline(always)]
    pub fn position(&self, s: F32x8) -> Vec3x8 {
        let at = |a: &Axis8| (a.start + s * a.rate) * BRICK as f32;
        let [x, y, z] = &self.axes;
        Vec3x8::new(at(x), at(y), at(z))
    }

    /// Majorant of the current brick; 0 outside `lanes`.
    #[inline(always)]
    pub fn majorant(&self, scene: &Scene<'_>, lanes: Mask8) -> F32x8 {
        let [x, y, z] = &self.axes;
        let (nx, ny) = (x.count.to_u32(), y.count.to_u32());
        let index = (self.first + (z.brick.to_u32() * ny + y.brick.to_u32()) * nx + x.brick.to_u32()).to_array();
        let bits = lanes.bits();
        F32x8::from_fn(|i| {
            let found = if bits >> i & 1 == 1 { scene.majorants.get(index[i & 7] as usize) } else { None };
            found.copied().unwrap_or(0.0)
        })
    }

    /// Distance from the entry at which the lanes leave their brick, at most [`Self::length`].
    #[inline(always)]
    pub fn exit(&self) -> F32x8 {
        let [x, y, z] = &self.axes;
        x.plane.min(y.plane).min(z.plane).min(self.length)
    }

    /// Moves `lanes` to the next brick; returns those of them that are still in the grid.
    #[inline(always)]
    pub fn advance(&mut self, lanes: Mask8) -> Mask8 {
        let [x, y, z] = &mut self.axes;
        let in_x = x.plane.le(y.plane) & x.plane.le(z.plane);
        let in_y = y.plane.le(z.plane).and_not(in_x);
        let in_z = !(in_x | in_y);
        x.advance(lanes & in_x) & y.advance(lanes & in_y) & z.advance(lanes & in_z) & lanes
    }
}
