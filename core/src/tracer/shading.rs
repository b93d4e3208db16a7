//! Stage `shading`: the vertices that hits become, with material, shading normal and texture.

use super::packets::RayState8;
use super::vertex::PathVertex8;
use crate::bsdf::{self, Bsdf, Inputs8, Visitor};
use crate::geometry::{SurfaceHit8, SurfacePoint8};
use crate::learn::cache::NO_BIN;
use crate::scene::blob::{MATERIAL_TWO_SIDED, MaterialKind, NONE};
use crate::scene::{Effects, Scene};
use crate::texture;
use crate::world::World;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Eight vertices at which paths have arrived.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival8 {
    /// The vertices, without samples yet.
    pub vertex: PathVertex8,
    /// Lanes whose path goes on; at first those whose front (or either side, if transmissive) faces `wo`.
    pub active: Mask8,
    /// [`MaterialKind`] per lane.
    pub kind: [u32; 8],
    /// Weight of the bounce that led here.
    pub weight: Vec3x8,
    /// Albedos seen from `wo`; 0 unless the strategy needs them.
    pub albedo: Vec3x8,
}

/// The vertices at the points of hits.
#[inline(always)]
pub(crate) fn shade<W: World>(world: &W, rays: &RayState8, hit: &SurfaceHit8, point: &SurfacePoint8) -> Arrival8 {
    let wo = -rays.ray.d;
    let m = Materials8::gather::<W>(world.scene(), hit, wo, point.ng);
    Arrival8 {
        vertex: PathVertex8 {
            p: point.p,
            error: point.error,
            ng: point.ng,
            ns: m.ns,
            wo,
            beta: rays.beta,
            reflectance: m.reflectance,
            material: U32x8::new(hit.material),
            path: rays.path,
            key: rays.key,
            albedo_product: rays.albedo_product,
            samples: U32x8::splat(0),
            nee_probability: F32x8::ONE,
            bin: U32x8::splat(NO_BIN),
            error_weight: rays.error_weight,
        },
        active: m.scatters,
        kind: m.kind,
        weight: rays.weight,
        albedo: Vec3x8::ZERO,
    }
}

/// What materials make of eight hits.
struct Materials8 {
    kind: [u32; 8],
    reflectance: Vec3x8,
    /// Shading normals, turned towards `wo` on two-sided materials.
    ns: Vec3x8,
    /// Lanes whose front (or either side, if transmissive) faces `wo`.
    scatters: Mask8,
}

impl Materials8 {
    /// Materials, shading normals and textures of the hit lanes.
    #[inline(never)]
    fn gather<W: World>(scene: &Scene<'_>, hit: &SurfaceHit8, wo: Vec3x8, ng: Vec3x8) -> Self {
        let (mut kind, mut textures) = ([0u32; 8], [NONE; 8]);
        let (mut two_sided, mut through, mut textured) = (0u32, 0u32, 0u32);
        let mut reflectance = [[0.0f32; 3]; 8];
        for i in hit.mask.lanes() {
            let Some(m) = scene.materials.get(hit.material[i] as usize) else { continue };
            kind[i] = m.kind;
            reflectance[i] = m.reflectance;
            textures[i] = m.texture;
            two_sided |= u32::from(m.flags & MATERIAL_TWO_SIDED != 0) << i;
            through |= (bsdf::transmissive_kinds() >> m.kind & 1) << i;
            textured |= u32::from(m.texture != NONE) << i;
        }
        let mut reflectance = Vec3x8::from_fn(|i| reflectance[i]);
        let [wa, wb, wc] = hit.weights();
        let mut ns = ng;
        if W::EFFECTS.contains(Effects::SMOOTH_NORMALS) && hit.smooth.any() {
            let n = |k: usize| hit.of_vertex(scene, k, |v| v.n);
            let sum = n(0) * wa + n(1) * wb + n(2) * wc;
            let len = sum.length();
            // opposite normals may cancel: then the triangle's own serves (NUMERICS FRM-3)
            let ok = hit.smooth & len.gt(F32x8::splat(1e-6));
            ns = Vec3x8::select(ok, sum / len, ng);
        }
        if W::EFFECTS.contains(Effects::TEXTURES) && textured != 0 {
            let uv = |k: usize| hit.of_vertex(scene, k, |v| [v.uv[0], v.uv[1], 0.0]);
            let at = uv(0) * wa + uv(1) * wb + uv(2) * wc;
            let mask = Mask8::from_bits(textured);
            let texel = texture::lookup(scene, U32x8::new(textures), [at.x, at.y], mask);
            reflectance = Vec3x8::select(mask, texel, reflectance);
        }
        let cos = wo.dot(ns);
        let behind = cos.lt(F32x8::ZERO);
        let transmissive = Mask8::from_bits(through);
        let turn = behind & Mask8::from_bits(two_sided).and_not(transmissive);
        let ns = Vec3x8::select(turn, -ns, ns);
        let scatters = (cos.gt(F32x8::ZERO) | turn | (transmissive & behind)) & hit.mask;
        Self { kind, reflectance, ns, scatters }
    }
}

/// The albedo kernel of one material kind.
struct AlbedoOf<'a, 's> {
    scene: &'a Scene<'s>,
    vertex: &'a PathVertex8,
    mask: Mask8,
}

impl<'s> Visitor<'s> for AlbedoOf<'_, 's> {
    type Out = Vec3x8;

    #[inline(never)]
    fn visit<B: Bsdf<'s>>(self) -> Vec3x8 {
        let v = self.vertex;
        let inputs = Inputs8 { material: v.material, reflectance: v.reflectance };
        let wo = Frame8::from_normal(v.ns).to_local(v.wo);
        B::gather(self.scene, &inputs, self.mask).albedo(wo)
    }
}

/// Albedos of the vertices in the lanes of `active`, of any kinds; 0 in other lanes.
pub(crate) fn albedo<W: World>(world: &W, a: &Arrival8, active: Mask8) -> Vec3x8 {
    let (scene, vertex) = (world.scene(), &a.vertex);
    let mut out = Vec3x8::ZERO;
    let mut left = active.bits();
    while left != 0 {
        let kind = a.kind[left.trailing_zeros() as usize & 7];
        let bits = active.lanes().filter(|&i| a.kind[i] == kind).fold(0, |m, i| m | 1 << i);
        left &= !bits;
        let mask = Mask8::from_bits(bits);
        let of = MaterialKind::from_u32(kind)
            .and_then(|k| bsdf::dispatch_in(W::EFFECTS, k, AlbedoOf { scene, vertex, mask }));
        out = Vec3x8::select(mask, of.unwrap_or(Vec3x8::ONE), out);
    }
    out
}
