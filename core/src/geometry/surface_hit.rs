//! The triangles of eight hits. Whatever wants to know something of a hit surface asks here: each triangle record is
//! read once per hit.

use super::spawn::point_with_normal;
use super::{Hit8, SurfacePoint8, place, surface_point, triangle_normal};
use crate::scene::blob::{NONE, TRIANGLE_SMOOTH, Triangle, Vertex};
use crate::scene::{Scene, gather};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Eight hit triangles. Lanes outside `mask`, and those whose triangle does not exist, hold the zero triangle of
/// material 0, flat and without a light.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit8 {
    /// Lanes that hit.
    pub mask: Mask8,
    /// Ray parameter; in the tracer, distance from the last vertex.
    pub t: F32x8,
    /// Barycentric weight of vertex b.
    pub u: F32x8,
    /// Barycentric weight of vertex c; vertex a has `1 - u - v`.
    pub v: F32x8,
    /// Positions of vertices a, b and c, world space.
    pub corners: [Vec3x8; 3],
    /// Vertex indices.
    pub vertices: [[u32; 3]; 8],
    /// Material indices.
    pub material: [u32; 8],
    /// Light indices, [`NONE`] where the triangle does not emit.
    pub light: [u32; 8],
    /// Lanes that interpolate vertex normals.
    pub smooth: Mask8,
    /// Instances around the triangle, see [`Hit8::instance`].
    pub instance: [U32x8; 2],
    /// Geometric normals of triangles in instances, as long as twice the area; 0 for others.
    pub normal: Vec3x8,
    /// Time of the rays, once [`Self::place`] was told.
    pub time: F32x8,
}

/// What lanes without a triangle read.
const NO_TRIANGLE: &Triangle = &Triangle { vertex: [NONE; 3], material: 0, light: NONE, flags: 0 };

impl SurfaceHit8 {
    /// Reads the triangles of the hit lanes.
    #[inline(always)]
    pub fn gather(scene: &Scene<'_>, hit: &Hit8) -> Self {
        let mask = hit.hit;
        let triangle = triangles(scene, U32x8::select(mask, hit.triangle, U32x8::splat(NONE)));
        let vertices = triangle.map(|t| t.vertex);
        let smooth = (0..8).fold(0, |bits, i| bits | u32::from(triangle[i].flags & TRIANGLE_SMOOTH != 0) << i);
        Self {
            mask,
            t: hit.t,
            u: mask.zero_unless(hit.u),
            v: mask.zero_unless(hit.v),
            corners: positions(scene, &vertices),
            vertices,
            material: triangle.map(|t| t.material),
            light: triangle.map(|t| t.light),
            smooth: Mask8::from_bits(smooth),
            instance: hit.instance,
            normal: Vec3x8::ZERO,
            time: F32x8::ZERO,
        }
    }

    /// Lanes whose triangle is in an instance.
    #[inline(always)]
    pub fn placed(&self) -> Mask8 {
        self.mask.and_not(self.instance[0].eq(U32x8::splat(NONE)))
    }

    /// The hit points of triangles that may be in instances, `time` being that of the rays: corners come to the world, lights
    /// become those of the instances, and where an instance mirrors, vertices b and c change places, so that the front stays
    /// the front. Once for each hit, in place of [`Self::point`].
    #[inline(never)]
    pub fn place(&mut self, scene: &Scene<'_>, time: F32x8) -> SurfacePoint8 {
        let lanes = self.placed();
        self.time = time;
        if lanes.none() {
            return self.point();
        }
        let placed = place(scene, self.instance, time, self.corners, lanes);
        (self.corners, self.normal) = (placed.corners, placed.normal);
        (self.u, self.v) = (placed.mirrored.select(self.v, self.u), placed.mirrored.select(self.u, self.v));
        for i in placed.mirrored.lanes() {
            self.vertices[i].swap(1, 2);
        }
        for i in (lanes & self.emitters()).lanes() {
            for level in self.instance {
                let first = scene.instances.get(level.lane(i) as usize).map_or(0, |k| k.first_light);
                self.light[i] = self.light[i].wrapping_add(first);
            }
        }
        let [a, b, c] = self.corners;
        let normal = Vec3x8::select(lanes, placed.normal, triangle_normal(a, b, c));
        let point = point_with_normal(self.corners, normal, self.u, self.v);
        SurfacePoint8 { error: point.error + placed.rounding.dot(point.ng.abs()), ..point }
    }

    /// Lanes whose triangle emits.
    #[inline(always)]
    pub fn emitters(&self) -> Mask8 {
        self.mask.and_not(U32x8::new(self.light).eq(U32x8::splat(NONE)))
    }

    /// The hit points.
    #[inline(always)]
    pub fn point(&self) -> SurfacePoint8 {
        surface_point(self.corners, self.u, self.v)
    }

    /// Barycentric weights of vertices a, b and c.
    #[inline(always)]
    pub fn weights(&self) -> [F32x8; 3] {
        [F32x8::ONE - self.u - self.v, self.u, self.v]
    }

    /// Normals of vertex `k` (0 to 2) of each lane; 0 where there is no such vertex.
    #[inline(always)]
    pub fn normals(&self, scene: &Scene<'_>, k: usize) -> Vec3x8 {
        let [_, _, _, x, y, z, ..] = of_vertices(scene, &self.vertices, k);
        Vec3x8::new(x, y, z)
    }

    /// Texture coordinates of vertex `k` (0 to 2) of each lane; 0 where there is no such vertex.
    #[inline(always)]
    pub fn coordinates(&self, scene: &Scene<'_>, k: usize) -> [F32x8; 2] {
        let [.., u, v] = of_vertices(scene, &self.vertices, k);
        [u, v]
    }
}

/// The triangles of these indices.
#[inline(always)]
fn triangles<'s>(scene: &Scene<'s>, index: U32x8) -> [&'s Triangle; 8] {
    index.to_array().map(|i| scene.triangles.get(i as usize).unwrap_or(NO_TRIANGLE))
}

/// Positions of the corners of eight triangles as the blob has them, by index; 0 for those that do not exist.
#[inline(always)]
pub(crate) fn corners(scene: &Scene<'_>, triangle: U32x8) -> [Vec3x8; 3] {
    positions(scene, &triangles(scene, triangle).map(|t| t.vertex))
}

/// Positions of the vertices of eight triangles.
#[inline(always)]
fn positions(scene: &Scene<'_>, vertices: &[[u32; 3]; 8]) -> [Vec3x8; 3] {
    let corner = |k: usize| {
        let [x, y, z, ..] = of_vertices(scene, vertices, k);
        Vec3x8::new(x, y, z)
    };
    [corner(0), corner(1), corner(2)]
}

/// What lanes without a vertex read.
const NO_VERTEX: &Vertex = &Vertex { p: [0.0; 3], n: [0.0; 3], uv: [0.0; 2] };

/// Position, normal and texture coordinates of vertex `k` of each of these triangles.
#[inline(always)]
fn of_vertices(scene: &Scene<'_>, vertices: &[[u32; 3]; 8], k: usize) -> [F32x8; 8] {
    let v = |lane: usize| vertices[lane][k];
    let [row] = gather(scene.vertices, [v(0), v(1), v(2), v(3), v(4), v(5), v(6), v(7)], NO_VERTEX);
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{TRIANGLES, scene};

    /// Killed by: a corner or a lane swapped, a triangle that is read outside the mask, an index that is trusted.
    #[test]
    fn each_lane_has_its_own_triangle() {
        scene(|scene| {
            let triangle = U32x8::new([0, 1, 2, 3, NONE, 1000, 0, 1]);
            let (u, v) = (F32x8::splat(0.25), F32x8::splat(0.5));
            let instance = crate::geometry::NO_INSTANCE;
            let hit = Hit8 { hit: Mask8::from_bits(0b0111_1111), t: F32x8::ONE, triangle, u, v, instance };
            let s = SurfaceHit8::gather(scene, &hit);
            for i in 0..8 {
                let t = if i < 7 { scene.triangles.get(triangle.lane(i) as usize) } else { None };
                let Some(t) = t else {
                    assert_eq!((s.material[i], s.light[i], s.corners.map(|c| c.lane(i))), (0, NONE, [[0.0; 3]; 3]));
                    continue;
                };
                assert_eq!((s.vertices[i], s.material[i], s.light[i]), (t.vertex, t.material, t.light));
                let p = t.vertex.map(|v| scene.vertices[v as usize].p);
                assert_eq!(s.corners.map(|c| c.lane(i)), p);
                let at = [0, 1, 2].map(|c| 0.25 * p[0][c] + 0.25 * p[1][c] + 0.5 * p[2][c]);
                assert_eq!(s.point().p.lane(i), at);
                assert_eq!(s.emitters().lane(i), t.light != NONE);
            }
            assert!(TRIANGLES >= 4 && s.emitters().any() && s.smooth.any() && !s.smooth.all());
            assert_eq!(s.point().p.lane(7), [0.0; 3]);
        });
    }
}
