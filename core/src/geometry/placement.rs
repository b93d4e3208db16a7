//! Triangles in instances: their corners in the world, and by how much rounding grows.
//!
//! *Error bound.* With u = 2^-24, `A` the linear part of an instance's map, `T` its translation, K its condition
//! ([`Instance::condition`]), r the largest |coordinate| of the corners from T: a corner `A a + T` is rounded by at most
//! `4 u (K r + |T|)`. A ray that leaves the triangle is taken back by the rounded inverse, which moves its origin by
//! at most `5.1 u K r`, and its direction d by `4.1 u K |d|`, across the triangle (an extent of up to 2 r) by `8.2 u K r`.
//! Normals are those of mapped edges, not of rounded corners: far from the world's origin a triangle may be smaller than the
//! steps of its coordinates, and has a normal all the same. They are tilted by some `8 u K` of the extent. All are below
//! `30 u (K r + |T|)`; [`OFFSET_BOUND`] has 32. An inner instance's bound goes through the outer map.

use super::OFFSET_BOUND;
use super::spawn::edge_normal;
use crate::scene::Scene;
use crate::scene::blob::{INSTANCE_HIDDEN, INSTANCE_MIRRORED, INSTANCE_MOVING, Instance, NONE};
use crate::scene::inverse;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Eight affine maps: `x p.x + y p.y + z p.z + t`.
#[derive(Clone, Copy, Debug)]
pub struct Map8 {
    /// First column of the linear part.
    pub x: Vec3x8,
    /// Second column.
    pub y: Vec3x8,
    /// Third column.
    pub z: Vec3x8,
    /// Translation.
    pub t: Vec3x8,
}

impl Map8 {
    /// The map of one instance at eight times.
    #[inline(always)]
    pub fn of(i: &Instance, time: F32x8) -> Self {
        let entry = |row: usize, column: usize| {
            let [a, b] = [0, 1].map(|key| i.to_world[key][row][column]);
            F32x8::splat(a) + F32x8::splat(b - a) * time
        };
        let column = |c: usize| Vec3x8::new(entry(0, c), entry(1, c), entry(2, c));
        Self { x: column(0), y: column(1), z: column(2), t: column(3) }
    }

    /// The maps of eight instances; the identity where there is none.
    #[inline(always)]
    fn gather(instances: &[Option<&Instance>; 8], time: F32x8) -> Self {
        const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let entry = |row: usize, column: usize| {
            let [a, b] =
                [0, 1].map(|key| F32x8::from_fn(|i| instances[i].map_or(&IDENTITY, |k| &k.to_world[key])[row][column]));
            a + (b - a) * time
        };
        let column = |c: usize| Vec3x8::new(entry(0, c), entry(1, c), entry(2, c));
        Self { x: column(0), y: column(1), z: column(2), t: column(3) }
    }

    /// Maps vectors: no translation.
    #[inline(always)]
    pub fn vector(&self, v: Vec3x8) -> Vec3x8 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// Maps with the absolute values of the linear part.
    #[inline(always)]
    fn abs_vector(&self, v: Vec3x8) -> Vec3x8 {
        self.x.abs() * v.x + self.y.abs() * v.y + self.z.abs() * v.z
    }

    /// Rows of the inverse linear part in lane `i`.
    fn inverse(&self, i: usize) -> [[f32; 3]; 3] {
        let [x, y, z] = [self.x, self.y, self.z].map(|c| c.lane(i));
        inverse([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])
    }

    /// The inverse of the linear part of `i` at eight times, by rows; and the translation.
    #[inline(always)]
    pub fn inverse_of(i: &Instance, time: F32x8) -> ([Vec3x8; 3], Vec3x8) {
        if i.flags & INSTANCE_MOVING == 0 {
            let [a, b, c] = i.inverse.map(|[x, y, z]| Vec3x8::splat(x, y, z));
            let [[.., tx], [.., ty], [.., tz]] = i.to_world[0];
            return ([a, b, c], Vec3x8::splat(tx, ty, tz));
        }
        let map = Self::of(i, time);
        let lanes: [[[f32; 3]; 3]; 8] = core::array::from_fn(|i| map.inverse(i));
        // `min`: the compiler does not know the numbers of the array where it compiles `map` as a function
        ([0, 1, 2].map(|row: usize| Vec3x8::from_fn(|i| lanes[i][row.min(2)])), map.t)
    }
}

/// Eight triangles in the world.
#[derive(Clone, Copy, Debug)]
pub struct Placed8 {
    /// Vertices a, b and c, world space; b and c have changed places in mirrored lanes.
    pub corners: [Vec3x8; 3],
    /// Geometric normals, as long as twice the area; 0 outside instances.
    pub normal: Vec3x8,
    /// What instances add to the error bound of points and of rays that leave them, by axis, world units.
    pub rounding: Vec3x8,
    /// Products of the conditions; 0 outside instances.
    pub condition: F32x8,
    /// Lanes that are mirrored.
    pub mirrored: Mask8,
    /// Lanes in a hidden instance.
    pub hidden: Mask8,
}

fn instance_of<'s>(scene: &Scene<'s>, index: U32x8, mask: Mask8) -> [Option<&'s Instance>; 8] {
    let index = U32x8::select(mask, index, U32x8::splat(NONE)).to_array();
    index.map(|i| scene.instances.get(i as usize))
}

/// Brings `corners` in the lanes of `mask` to the world through `instances` (see [`Hit8::instance`](super::Hit8::instance))
/// at `time`.
pub fn place(scene: &Scene<'_>, instances: [U32x8; 2], time: F32x8, corners: [Vec3x8; 3], mask: Mask8) -> Placed8 {
    let none = U32x8::splat(NONE);
    let [a, b, c] = corners;
    let mut edges = [b - a, c - b, a - c];
    let (mut corners, mut rounding, mut condition) = (corners, Vec3x8::ZERO, F32x8::ZERO);
    let (mut mirrored, mut hidden) = (0, 0);
    for index in [instances[1], instances[0]] {
        let lanes = mask.and_not(index.eq(none));
        if lanes.none() {
            continue;
        }
        let instance = instance_of(scene, index, lanes);
        let map = Map8::gather(&instance, time);
        let from_t = corners.map(|c| map.vector(c));
        let reach = from_t.iter().fold(F32x8::ZERO, |m, c| m.max(c.abs().max_component()));
        let k = F32x8::from_fn(|i| instance[i].map_or(0.0, |k| k.condition));
        let own = (map.t.abs() + Vec3x8::grey(k * reach)) * OFFSET_BOUND;
        rounding = Vec3x8::select(lanes, map.abs_vector(rounding) + own, rounding);
        condition = lanes.select(k * condition.max(F32x8::ONE), condition);
        corners = [0, 1, 2].map(|c| Vec3x8::select(lanes, from_t[c] + map.t, corners[c]));
        edges = edges.map(|e| Vec3x8::select(lanes, map.vector(e), e));
        for (i, k) in instance.iter().enumerate() {
            let flags = k.map_or(0, |k| k.flags);
            mirrored ^= u32::from(flags & INSTANCE_MIRRORED != 0) << i;
            hidden |= u32::from(flags & INSTANCE_HIDDEN != 0) << i;
        }
    }
    let (mirrored, hidden) = (Mask8::from_bits(mirrored), Mask8::from_bits(hidden));
    let [a, b, c] = corners;
    let corners = [a, Vec3x8::select(mirrored, c, b), Vec3x8::select(mirrored, b, c)];
    let [ab, bc, ca] = edges;
    let normal = edge_normal(ab, bc, ca);
    let normal = Vec3x8::select(mirrored, -normal, normal).zero_unless(condition.gt(F32x8::ZERO));
    Placed8 { corners, normal, rounding, condition, mirrored, hidden }
}

/// Normals in the world, of any length, from those in objects: the inverse transpose keeps them upright on what they stand
/// on, and on its front.
#[inline(never)]
pub fn place_normals(scene: &Scene<'_>, instances: [U32x8; 2], time: F32x8, normals: Vec3x8, mask: Mask8) -> Vec3x8 {
    let mut normals = normals;
    for index in [instances[1], instances[0]] {
        let lanes = mask.and_not(index.eq(U32x8::splat(NONE)));
        if lanes.none() {
            continue;
        }
        let instance = instance_of(scene, index, lanes);
        let moving = |i: usize| instance[i].is_some_and(|k| k.flags & INSTANCE_MOVING != 0);
        let map = if (0..8).any(moving) { Some(Map8::gather(&instance, time)) } else { None };
        let rows: [[[f32; 3]; 3]; 8] = core::array::from_fn(|i| match (instance[i], &map) {
            (Some(_), Some(map)) if moving(i) => map.inverse(i),
            (Some(k), _) => k.inverse,
            (None, _) => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        });
        let [x, y, z] = [0, 1, 2].map(|row| Vec3x8::from_fn(|i| rows[i][row]));
        normals = Vec3x8::select(lanes, x * normals.x + y * normals.y + z * normals.z, normals);
    }
    normals
}

/// Instances around the triangle of light `index` with this [`instance`](crate::scene::blob::Light::instance); [`NONE`]
/// where there is none.
pub fn instances_of_light(scene: &Scene<'_>, index: u32, instance: u32) -> [u32; 2] {
    let Some(outer) = instance.checked_sub(1) else { return [NONE; 2] };
    let inner = || {
        let i = scene.instances.get(outer as usize)?;
        let object = scene.objects.get(i.object as usize)?;
        let within = index.checked_sub(i.first_light).filter(|n| *n >= object.emitters)?;
        let first = object.first_instance as usize;
        let inner = scene.instances.get(first..first + object.instances as usize)?;
        let last = inner.partition_point(|k| k.first_light <= within).checked_sub(1)?;
        u32::try_from(first + last).ok()
    };
    [outer, inner().unwrap_or(NONE)]
}
