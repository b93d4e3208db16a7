//! Points on principled surfaces: what their textures say, and their shading normals.
//!
//! A normal map's normal is relative to the frame of the interpolated normal and the direction in which the texture
//! coordinate u grows on the triangle. Then normals are turned, as little as possible, until they face `wo` on the side
//! of the surface that it is on, at a cosine of 0.1 at least or that of the surface itself: what a viewer sees of a
//! relief faces him. So no hit is black because of its normal. What the directions that are scattered need is in
//! `bsdf/folded.rs`.

use super::surfaces::coordinates;
use crate::accel::Intersector;
use crate::bsdf::principled::{self, Textured8};
use crate::extension::{Extension, TextureSamples8};
use crate::geometry::{OwnHits8, SurfaceHit8};
use crate::scene::Effects;
use crate::world::World;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Cosine to `wo` that normals are turned to.
const FACING: f32 = 0.1;

/// Points on principled surfaces.
pub(super) struct Relief8 {
    /// What [`Surface8::pack`](principled::Surface8::pack) makes of the parameters.
    pub packed: Vec3x8,
    /// Share of light that meets the surface.
    pub opacity: F32x8,
    /// Shading normals, on the side of the surface's front.
    pub ns: Vec3x8,
}

/// The points in the lanes of `active` with the interpolated normals `ns` and the normals by winding `ng`.
#[inline(never)]
pub(super) fn relief<W: World>(
    world: &W,
    hit: &SurfaceHit8,
    own: Option<&OwnHits8>,
    wo: Vec3x8,
    ng: Vec3x8,
    ns: Vec3x8,
    active: Mask8,
) -> Relief8 {
    let scene = world.scene();
    let own = if W::Intersector::SURFACES { own } else { None };
    let textures = W::EFFECTS.contains(Effects::TEXTURES) && scene.effects.contains(Effects::TEXTURES);
    let normal_maps = W::EFFECTS.contains(Effects::NORMAL_MAPS) && scene.effects.contains(Effects::NORMAL_MAPS);
    let [wa, wb, wc] = hit.weights();
    let corner = |k: usize| {
        let [u, v] = hit.coordinates(scene, k);
        Vec3x8::new(u, v, F32x8::ZERO)
    };
    let uvs = if textures { [corner(0), corner(1), corner(2)] } else { [Vec3x8::ZERO; 3] };
    let uv = uvs[0] * wa + uvs[1] * wb + uvs[2] * wc;
    let at = own.map_or([uv.x, uv.y], |own| own.coordinates([uv.x, uv.y]));
    let mut t = principled::textured(scene, &hit.material, at, active, [textures, normal_maps]);
    if W::Extension::TEXTURES {
        t.surface.base = own_reflectance(world, hit, own, active, t.surface.base);
    }
    // the winding says where the front is
    let mut ns = Vec3x8::select(ns.dot(ng).lt(F32x8::ZERO), -ns, ns);
    let mapped = active & t.mapped & (t.normal.x.abs() + t.normal.y.abs()).gt(F32x8::ZERO);
    if mapped.any() {
        ns = Vec3x8::select(mapped, from_map(hit, own, uvs, ns, &t), ns);
    }
    Relief8 { packed: t.surface.pack(), opacity: t.opacity, ns: facing(wo, ng, ns) }
}

/// Normals of the maps in world space.
#[inline(always)]
fn from_map(hit: &SurfaceHit8, own: Option<&OwnHits8>, uvs: [Vec3x8; 3], ns: Vec3x8, t: &Textured8) -> Vec3x8 {
    let [a, b, c] = hit.corners;
    let (edge1, edge2) = (b - a, c - a);
    let (uv1, uv2) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let mut sign = F32x8::ONE.copysign(uv1.x * uv2.y - uv1.y * uv2.x);
    let mut along_u = (edge1 * uv2.y - edge2 * uv1.y) * sign;
    if let Some(own) = own {
        along_u = Vec3x8::select(own.lanes, own.surface.tangent, along_u);
        sign = own.lanes.select(F32x8::ONE, sign);
    }
    let tangent = along_u.normalize();
    let tangent = tangent - ns * ns.dot(tangent);
    let length = tangent.length();
    // coordinates that do not vary give any frame
    let known = length.gt(F32x8::splat(1e-4));
    let tangent = Vec3x8::select(known, tangent / length, Frame8::from_normal(ns).s);
    let bitangent = ns.cross(tangent) * sign;
    let n = tangent * t.normal.x + bitangent * t.normal.y + ns * t.normal.z;
    let n = n.normalize();
    Vec3x8::select(n.is_finite(), n, ns)
}

/// `ns`, turned until it faces `wo`.
#[inline(always)]
fn facing(wo: Vec3x8, ng: Vec3x8, ns: Vec3x8) -> Vec3x8 {
    let cos = wo.dot(ng);
    let w = Vec3x8::select(cos.lt(F32x8::ZERO), -wo, wo);
    let least = cos.abs().min(F32x8::splat(FACING));
    let seen = w.dot(ns);
    let away = seen.lt(least);
    if away.none() {
        return ns;
    }
    let across = ns - w * seen;
    let length = across.length();
    let turned = w * least + across * ((1.0 - least * least).safe_sqrt() / length);
    let turned = Vec3x8::select(length.gt(F32x8::splat(1e-4)), turned, ng);
    Vec3x8::select(away, turned, ns)
}

/// Reflectances that the host's extension makes of those of materials and texture files, in the lanes of `active`.
pub(super) fn own_reflectance<W: World>(
    world: &W,
    hit: &SurfaceHit8,
    own: Option<&OwnHits8>,
    active: Mask8,
    reflectance: Vec3x8,
) -> Vec3x8 {
    let uv = coordinates(world.scene(), hit, own);
    let point = hit.point().p;
    let point = own.map_or(point, |own| Vec3x8::select(own.lanes, own.surface.p, point));
    let samples = TextureSamples8 { material: U32x8::new(hit.material), uv, point, active };
    let own = world.extension().reflectance(&samples, reflectance);
    // a NaN becomes 0
    let clamp = |x: F32x8| F32x8::ZERO.max(x).min(F32x8::ONE);
    Vec3x8::select(active, Vec3x8::new(clamp(own.x), clamp(own.y), clamp(own.z)), reflectance)
}
