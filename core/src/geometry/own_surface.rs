//! Surfaces that a host's intersector brings, beside the scene's triangles.

use super::{Hit8, OFFSET_BOUND, SurfaceHit8, SurfacePoint8};
use crate::scene::blob::NONE;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// First number by which [`Hit8::triangle`] names a surface of the host's own; no scene has that many triangles. The numbers
/// from here to [`NONE`], exclusive, are the host's to give.
pub const FIRST_OWN_SURFACE: u32 = 1 << 31;

/// Eight points on surfaces of the host's own.
#[derive(Clone, Copy, Debug)]
pub struct OwnSurface8 {
    /// Points, world space.
    pub p: Vec3x8,
    /// Geometric unit normals, on the side that is the front.
    pub ng: Vec3x8,
    /// How far `p` may be from the surface along `ng`, world units. Rays leave from `p` moved along `ng` by this and by
    /// [`OFFSET_BOUND`]` |p| . |ng|`, to the side on which they go on: rays from there must not hit the
    /// surface where they began.
    pub error: F32x8,
    /// Shading normals, world space, of any length; 0 where `ng` serves. Those behind the surface are turned to its front.
    pub ns: Vec3x8,
    /// Texture coordinates, v upwards.
    pub uv: [F32x8; 2],
    /// Directions in which the first texture coordinate grows, for normal maps; v grows along `ns x tangent`. 0: any.
    pub tangent: Vec3x8,
    /// Material indices. Materials of the scene, whether or not triangles have them; what does not exist is black.
    pub material: U32x8,
    /// Indices of objects in [`Aov::Object`](crate::unstable::film::Aov), [`NONE`] where there is none.
    pub object: U32x8,
}

impl OwnSurface8 {
    /// Points without shading normals, texture coordinates and objects.
    pub fn new(p: Vec3x8, ng: Vec3x8, error: F32x8, material: U32x8) -> Self {
        let (none, zero) = (U32x8::splat(NONE), F32x8::ZERO);
        Self { p, ng, error, ns: Vec3x8::ZERO, uv: [zero; 2], tangent: Vec3x8::ZERO, material, object: none }
    }
}

/// The lanes of hits that are on surfaces of the host's own, and what is known of these.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OwnHits8 {
    /// Lanes.
    pub lanes: Mask8,
    /// Their surfaces, with unit normals `ng`.
    pub surface: OwnSurface8,
}

impl Hit8 {
    /// Lanes that hit a surface of the host's own.
    pub(crate) fn own(&self) -> Mask8 {
        let named = self.triangle.lt(U32x8::splat(FIRST_OWN_SURFACE)) | self.triangle.eq(U32x8::splat(NONE));
        self.hit.and_not(named)
    }
}

impl OwnHits8 {
    /// Puts the surfaces in the lanes of `lanes` in the places of triangles that do not exist.
    pub(crate) fn new(lanes: Mask8, s: OwnSurface8, hit: &mut SurfaceHit8, point: &mut SurfacePoint8) -> Self {
        let ng = unit_or(s.ng, Vec3x8::splat(0.0, 0.0, 1.0));
        // a NaN becomes 0
        let error = F32x8::ZERO.max(s.error) + s.p.abs().dot(ng.abs()) * OFFSET_BOUND;
        point.p = Vec3x8::select(lanes, s.p, point.p);
        point.ng = Vec3x8::select(lanes, ng, point.ng);
        point.error = lanes.select(error, point.error);
        for i in lanes.lanes() {
            (hit.material[i], hit.light[i]) = (s.material.lane(i), NONE);
        }
        Self { lanes, surface: OwnSurface8 { ng, ..s } }
    }

    /// Shading normals, `ns` those of the other lanes.
    pub(crate) fn normals(&self, ns: Vec3x8) -> Vec3x8 {
        let s = &self.surface;
        let own = unit_or(s.ns, s.ng);
        let own = Vec3x8::select(own.dot(s.ng).lt(F32x8::ZERO), -own, own);
        Vec3x8::select(self.lanes, own, ns)
    }

    /// Texture coordinates, `uv` those of the other lanes.
    pub(crate) fn coordinates(&self, uv: [F32x8; 2]) -> [F32x8; 2] {
        [0, 1].map(|c| self.lanes.select(self.surface.uv[c], uv[c]))
    }
}

/// Unit vectors; `other` where they have no direction.
fn unit_or(v: Vec3x8, other: Vec3x8) -> Vec3x8 {
    let size = v.abs().max_component();
    let scaled = v / size;
    let unit = scaled / scaled.length();
    Vec3x8::select(size.gt(F32x8::ZERO) & unit.is_finite(), unit, other)
}
