//! Stage `shading`: the vertices that hits become, with material, shading normal and texture.

use super::class::PHASE_KIND;
use super::media_set::{MediaSet8, media_behind};
use super::packets::RayState8;
use super::relief::{own_reflectance, relief};
use super::surfaces::{coordinates, places};
use super::vertex::PathVertex8;
use crate::accel::Intersector;
use crate::bsdf::{self, Bsdf, Inputs8, Lobes, Visitor};
use crate::extension::Extension;
use crate::geometry::{self, OwnHits8, SurfaceHit8, SurfacePoint8};
use crate::learn::cache::NO_BIN;
use crate::scene::blob::{LAYERED_KINDS, MATERIAL_CUTOUT, MATERIAL_TWO_SIDED, Material, MaterialKind, NONE};
use crate::scene::{Effects, Scene, gather};
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
    /// [`MaterialKind`] per lane, or [`PHASE_KIND`](super::class::PHASE_KIND).
    pub kind: [u32; 8],
    /// Share of light that passes the surface straight on ([`Bsdf::straight`], alpha, or all of it where a medium of
    /// higher priority hides the surface).
    pub straight: F32x8,
    /// Weight of the bounce that led here.
    pub weight: Vec3x8,
    /// Albedos seen from `wo`; 0 unless the strategy needs them.
    pub albedo: Vec3x8,
}

impl Arrival8 {
    /// Lanes whose vertex is in a medium, not on a surface.
    #[inline(always)]
    pub(crate) fn in_medium(&self) -> Mask8 {
        U32x8::new(self.kind).eq(U32x8::splat(PHASE_KIND))
    }
}

/// The vertices at the points of hits.
#[inline(always)]
pub(crate) fn shade<W: World>(
    world: &W,
    rays: &RayState8,
    hit: &SurfaceHit8,
    point: &SurfacePoint8,
    own: Option<&OwnHits8>,
) -> Arrival8 {
    let wo = -rays.ray.d;
    let m = Materials8::gather(world, hit, own, wo, point.ng, rays.media);
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
            media: rays.media,
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
        straight: m.straight,
        weight: rays.weight,
        albedo: Vec3x8::ZERO,
    }
}

/// What lanes without a material read.
const NO_MATERIAL: &Material = &Material::new(MaterialKind::LAMBERTIAN);

/// What materials make of eight hits.
struct Materials8 {
    kind: [u32; 8],
    reflectance: Vec3x8,
    /// Shading normals, turned towards `wo` on two-sided materials.
    ns: Vec3x8,
    /// Lanes whose front (or either side, if transmissive) faces `wo`.
    scatters: Mask8,
    /// See [`Arrival8::straight`].
    straight: F32x8,
}

impl Materials8 {
    /// Materials, shading normals and textures of the hit lanes.
    #[inline(never)]
    fn gather<W: World>(
        world: &W,
        hit: &SurfaceHit8,
        own: Option<&OwnHits8>,
        wo: Vec3x8,
        ng: Vec3x8,
        media: MediaSet8,
    ) -> Self {
        let own = if W::Intersector::SURFACES { own } else { None };
        let scene = world.scene();
        // lanes outside the mask have material 0
        let [[kind, flags, textures, _, red, green, blue, _], _] = gather(scene.materials, hit.material, NO_MATERIAL);
        let [kind, flags, textures] = [kind, flags, textures].map(F32x8::to_bits);
        let kind = U32x8::select(hit.mask, kind, U32x8::splat(0)).to_array();
        let flagged = |bit: u32| hit.mask.and_not((flags & U32x8::splat(bit)).eq(U32x8::splat(0)));
        let textured = hit.mask.and_not(textures.eq(U32x8::splat(NONE)));
        let mut reflectance = Vec3x8::new(red, green, blue).zero_unless(hit.mask);
        let mut straight = F32x8::ZERO;
        let mut ns = interpolated_normals::<W>(scene, hit, ng);
        if let Some(own) = own {
            ns = own.normals(ns);
        }
        if W::EFFECTS.contains(Effects::TEXTURES) && textured.any() {
            let at = coordinates(scene, hit, own);
            let texel = texture::lookup(scene, textures, at, textured);
            reflectance = Vec3x8::select(textured, texel, reflectance);
            let cutout = textured & flagged(MATERIAL_CUTOUT);
            if W::EFFECTS.contains(Effects::ALPHA) && cutout.any() {
                straight = cutout.zero_unless(1.0 - texture::alpha(scene, textures, at, cutout));
            }
        }
        if W::Extension::TEXTURES {
            let plain = hit.mask.and_not(bsdf::lanes_of(LAYERED_KINDS, &kind));
            reflectance = own_reflectance(world, hit, own, plain, reflectance);
        }
        if W::EFFECTS.contains(Effects::PRINCIPLED) && scene.effects.contains(Effects::PRINCIPLED) {
            let layered = hit.mask & bsdf::lanes_of(LAYERED_KINDS, &kind);
            if layered.any() {
                let r = relief(world, hit, own, wo, ng, ns, layered);
                reflectance = Vec3x8::select(layered, r.packed, reflectance);
                straight = layered.select(1.0 - r.opacity, straight);
                ns = Vec3x8::select(layered, r.ns, ns);
            }
        }
        let cos = wo.dot(ns);
        let behind = cos.lt(F32x8::ZERO);
        let transmissive = bsdf::lanes_of(bsdf::transmissive_kinds(), &kind);
        let turn = behind & flagged(MATERIAL_TWO_SIDED).and_not(transmissive);
        let ns = Vec3x8::select(turn, -ns, ns);
        let scatters = (cos.gt(F32x8::ZERO) | turn | (transmissive & behind)) & hit.mask;
        if W::EFFECTS.intersects(Effects::STRAIGHT) && may_pass::<W>(scene) {
            let by_model = hit.mask & bsdf::lanes_of(bsdf::straight_kinds(), &kind);
            let material = U32x8::new(hit.material);
            let of = |mask| StraightOf { scene, material, reflectance, ns, wo, mask };
            let share = each_kind::<W, _>(by_model, &kind, of).x;
            // through the holes, and through the rest
            straight = by_model.select(straight + (1.0 - straight) * share, straight);
            if W::EFFECTS.contains(Effects::MEDIA) && media.inside().any() {
                let hidden = hit.mask & media.hides(&media_behind(scene, &hit.material));
                straight = hidden.select(F32x8::ONE, straight);
            }
        }
        Self { kind, reflectance, ns, scatters, straight }
    }
}

/// Unit shading normals, as vertices have them; `ng` are the normals by winding.
#[inline(always)]
pub(super) fn interpolated_normals<W: World>(scene: &Scene<'_>, hit: &SurfaceHit8, ng: Vec3x8) -> Vec3x8 {
    if !W::EFFECTS.contains(Effects::SMOOTH_NORMALS) || hit.smooth.none() {
        return ng;
    }
    let [wa, wb, wc] = hit.weights();
    let n = |k: usize| hit.normals(scene, k);
    let mut sum = n(0) * wa + n(1) * wb + n(2) * wc;
    if places::<W>(scene) {
        sum = geometry::place_normals(scene, hit.instance, hit.time, sum, hit.placed());
    }
    let len = sum.length();
    // opposite normals may cancel: then the triangle's own serves (NUMERICS FRM-3)
    let ok = hit.smooth & len.gt(F32x8::splat(1e-6));
    Vec3x8::select(ok, sum / len, ng)
}

/// Does the scene hold anything that light may pass straight on?
#[inline(always)]
pub(crate) fn may_pass<W: World>(scene: &Scene<'_>) -> bool {
    W::EFFECTS.intersects(Effects::STRAIGHT) && scene.effects.intersects(Effects::STRAIGHT)
}

/// Does anything move while the shutter is open?
#[inline(always)]
pub(crate) fn moves<W: World>(scene: &Scene<'_>) -> bool {
    W::EFFECTS.contains(Effects::MOTION) && scene.effects.contains(Effects::MOTION)
}

/// Share of the light from the directions `wo` that passes the surfaces of `hit` straight on, within `media`; `ng` are
/// their normals by winding.
pub(crate) fn straight_share<W: World>(
    world: &W,
    hit: &SurfaceHit8,
    own: Option<&OwnHits8>,
    wo: Vec3x8,
    ng: Vec3x8,
    media: MediaSet8,
) -> F32x8 {
    hit.mask.zero_unless(Materials8::gather(world, hit, own, wo, ng, media).straight)
}

/// The kernel of one material kind that says what passes straight on.
struct StraightOf<'a, 's> {
    scene: &'a Scene<'s>,
    material: U32x8,
    reflectance: Vec3x8,
    ns: Vec3x8,
    wo: Vec3x8,
    mask: Mask8,
}

impl<'s> Visitor<'s> for StraightOf<'_, 's> {
    type Out = Vec3x8;

    #[inline(never)]
    fn visit<B: Bsdf<'s>>(self) -> Vec3x8 {
        if !B::LOBES.contains(Lobes::STRAIGHT) {
            return Vec3x8::ZERO;
        }
        let inputs = Inputs8 { material: self.material, reflectance: self.reflectance };
        let wo = Frame8::from_normal(self.ns).to_local(self.wo);
        let share = B::gather(self.scene, &inputs, self.mask).straight(wo);
        Vec3x8::new(share, share, share)
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
    let phase = if W::EFFECTS.contains(Effects::MEDIA) { active & a.in_medium() } else { Mask8::NONE };
    let surface = active.and_not(phase);
    let of = each_kind::<W, _>(surface, &a.kind, |mask| AlbedoOf { scene, vertex, mask });
    Vec3x8::select(phase, vertex.reflectance, of)
}

/// Calls `v` with the model of a kind, or the host's own; `None` for kinds outside the profile.
#[inline(always)]
pub(super) fn dispatch<'s, W: World, V: Visitor<'s>>(kind: MaterialKind, v: V) -> Option<V::Out> {
    let own = W::Extension::BSDF;
    bsdf::dispatch_with::<<W::Extension as Extension>::Bsdf, V>(W::EFFECTS, own, kind, v)
}

/// What `kernel`, called with the lanes of one kind, says for its model in the lanes of `active`; 1 for kinds outside the
/// profile, 0 in other lanes.
#[inline(always)]
fn each_kind<'s, W: World, V: Visitor<'s, Out = Vec3x8>>(
    active: Mask8,
    kinds: &[u32; 8],
    kernel: impl Fn(Mask8) -> V,
) -> Vec3x8 {
    let mut out = Vec3x8::ZERO;
    let mut left = active.bits();
    while left != 0 {
        let kind = kinds[left.trailing_zeros() as usize & 7];
        let bits = active.lanes().filter(|&i| kinds[i] == kind).fold(0, |m, i| m | 1 << i);
        left &= !bits;
        let mask = Mask8::from_bits(bits);
        let of = MaterialKind::from_u32(kind).and_then(|k| dispatch::<W, _>(k, kernel(mask)));
        out = Vec3x8::select(mask, of.unwrap_or(Vec3x8::ONE), out);
    }
    out
}
