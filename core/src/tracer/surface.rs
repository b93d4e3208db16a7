//! Stage `surface`: what was hit, what it emits, and the vertex that it becomes.

use super::flight::RayState8;
use super::ledger::NO_BIN;
use super::roulette::Arrival8;
use super::settle::Found8;
use super::shard::Shard;
use super::vertex::Vertex8;
use crate::accel::{self, Hit8, Intersector};
use crate::bsdf::{self, Bsdf, Inputs8, Visitor};
use crate::light::{self, LightSelector, power_heuristic};
use crate::profile::Profile;
use crate::scene::blob::{MATERIAL_TWO_SIDED, MaterialKind, NONE, TRIANGLE_SMOOTH};
use crate::scene::{Effects, Scene};
use crate::session::Session;
use crate::settings::MAX_PATH_LENGTH;
use crate::texture;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

impl Shard<'_> {
    /// Lanes that left the scene.
    pub(super) fn escape<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        f: &RayState8,
        escaped: Mask8,
    ) {
        let scene = session.scene();
        let sky = Effects::ENVIRONMENT.with(Effects::CONSTANT);
        if P::EFFECTS.intersects(sky) && scene.environment.is_some() {
            let radiance = light::environment_radiance(scene, f.ray.d, escaped);
            let pdf = light::environment_pdf(scene, session.selector(), f.from, f.normal, f.ray.d, escaped);
            let weight = f.alone.select(F32x8::ONE, power_heuristic(f.pdf, pdf));
            let found = Found8 { pixel: f.beta * radiance * weight, local: f.weight * radiance * weight };
            self.gather(escaped, f.root, f.ledger, &found);
        }
        self.close_lanes(escaped, f.root, f.ledger, f.depth);
    }

    /// Lanes that hit a triangle.
    pub(super) fn arrive<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        f: &RayState8,
        hit: &Hit8,
    ) {
        let scene = session.scene();
        let mask = hit.hit;
        self.counters.surface.count(mask.count());
        let point = accel::surface_point(scene, hit.triangle, hit.u, hit.v, mask);
        let wo = -f.ray.d;
        if P::EFFECTS.contains(Effects::AREA_LIGHTS) {
            self.emission(session, f, hit, point.ng);
        }
        let ends = U32x8::splat(session.max_depth());
        if self.job.settings.max_depth > MAX_PATH_LENGTH {
            self.counters.max_length_reached += u64::from(mask.and_not(f.depth.lt(ends)).count());
        }
        let first = mask & f.depth.eq(U32x8::splat(1));
        let mut going = mask & f.depth.lt(ends);
        let wants_aov = !self.aovs.is_empty() && first.any();
        if going.none() && !wants_aov {
            return self.close_lanes(mask, f.root, f.ledger, f.depth);
        }
        let s = shade::<P>(scene, hit, wo, point.ng);
        let mut vertex = Vertex8 {
            p: point.p,
            error: point.error,
            ng: point.ng,
            ns: s.ns,
            wo,
            beta: f.beta,
            reflectance: s.reflectance,
            material: s.material,
            root: f.root,
            key: f.key,
            depth: f.depth,
            albedo_product: f.albedo_product,
            ledger: f.ledger,
            samples: U32x8::splat(0),
            drawn: F32x8::ONE,
            bin: U32x8::splat(NO_BIN),
            error_weight: f.error_weight,
        };
        going &= s.scatters;
        let lanes_if = |wanted: bool, lanes: Mask8| if wanted { lanes } else { Mask8::NONE };
        let needs_albedo = self.job.settings.strategy.needs_albedo();
        let wanted = lanes_if(wants_aov, first & s.scatters) | lanes_if(needs_albedo, going);
        let albedo = albedo::<P>(scene, &vertex, &s.kind, wanted);
        if wants_aov {
            self.record_first_hit(first, f, hit, s.ns, albedo);
        }
        self.close_lanes(mask.and_not(going), f.root, f.ledger, f.depth);
        if going.none() {
            return;
        }
        let albedo = if needs_albedo { albedo } else { Vec3x8::ZERO };
        let arrival = Arrival8 { vertex: &mut vertex, weight: f.weight, kind: s.kind, albedo, active: going };
        self.roulette(session, arrival);
    }

    /// Emission of hit area lights, weighted against the light sample that could have found them.
    fn emission<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        f: &RayState8,
        hit: &Hit8,
        ng: Vec3x8,
    ) {
        let scene = session.scene();
        let triangle = hit.triangle.to_array();
        let mut bits = 0;
        for i in hit.hit.lanes() {
            let emits = scene.triangles.get(triangle[i] as usize).is_some_and(|t| t.light != NONE);
            bits |= u32::from(emits) << i;
        }
        let mask = Mask8::from_bits(bits);
        if mask.none() {
            return;
        }
        let radiance = light::area_radiance(scene, hit.triangle, f.ray.d, ng, mask);
        let sampled = mask.and_not(f.alone);
        let weight = if sampled.any() {
            let pdf =
                light::area_pdf(scene, session.selector(), f.from, f.normal, hit.triangle, f.ray.d, hit.t, sampled);
            f.alone.select(F32x8::ONE, power_heuristic(f.pdf, pdf))
        } else {
            F32x8::ONE
        };
        let found = Found8 { pixel: f.beta * radiance * weight, local: f.weight * radiance * weight };
        self.gather(mask, f.root, f.ledger, &found);
    }

    fn record_first_hit(&mut self, first: Mask8, f: &RayState8, hit: &Hit8, normal: Vec3x8, albedo: Vec3x8) {
        let root = f.root.to_array();
        // a host's intersector may answer anything
        let good = first & hit.t.is_finite() & normal.is_finite() & albedo.is_finite();
        for i in first.and_not(good).lanes() {
            self.count_non_finite(root[i]);
        }
        for i in good.lanes() {
            let pixel = self.roots.get(root[i]).target.pixel as usize;
            let Some(aov) = self.aovs.get_mut(pixel) else { continue };
            let (albedo, normal) = (albedo.lane(i), normal.lane(i));
            for c in 0..3 {
                aov.albedo[c] += f64::from(albedo[c]);
                aov.normal[c] += f64::from(normal[c]);
            }
            aov.depth += f64::from(hit.t.lane(i));
            aov.hits += 1.0;
        }
    }
}

struct AlbedoOf<'a, 's> {
    scene: &'a Scene<'s>,
    vertex: &'a Vertex8,
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

/// Albedos of vertices of any classes, 0 in other lanes.
fn albedo<P: Profile>(scene: &Scene<'_>, vertex: &Vertex8, kinds: &[u32; 8], active: Mask8) -> Vec3x8 {
    let mut out = Vec3x8::ZERO;
    let mut left = active.bits();
    while left != 0 {
        let kind = kinds[left.trailing_zeros() as usize & 7];
        let bits = active.lanes().filter(|&i| kinds[i] == kind).fold(0, |m, i| m | 1 << i);
        left &= !bits;
        let mask = Mask8::from_bits(bits);
        let of = MaterialKind::from_u32(kind)
            .and_then(|k| bsdf::dispatch_in(P::EFFECTS, k, AlbedoOf { scene, vertex, mask }));
        out = Vec3x8::select(mask, of.unwrap_or(Vec3x8::ONE), out);
    }
    out
}

/// Shading data of eight hits.
struct Shading8 {
    material: U32x8,
    kind: [u32; 8],
    reflectance: Vec3x8,
    /// Shading normal, turned towards `wo` on two-sided materials.
    ns: Vec3x8,
    /// Lanes whose front (or either side, if transmissive) faces `wo`.
    scatters: Mask8,
}

/// Materials, shading normals and textures of the hit lanes.
#[inline(never)]
fn shade<P: Profile>(scene: &Scene<'_>, hit: &Hit8, wo: Vec3x8, ng: Vec3x8) -> Shading8 {
    let index = hit.triangle.to_array();
    let (mut material, mut kind, mut textures) = ([0u32; 8], [0u32; 8], [NONE; 8]);
    let (mut smooth, mut two_sided, mut through, mut textured) = (0u32, 0u32, 0u32, 0u32);
    let mut reflectance = [[0.0f32; 3]; 8];
    let mut corners = [[0u32; 3]; 8];
    for i in hit.hit.lanes() {
        let Some(t) = scene.triangles.get(index[i] as usize) else { continue };
        let Some(m) = scene.materials.get(t.material as usize) else { continue };
        material[i] = t.material;
        kind[i] = m.kind;
        reflectance[i] = m.reflectance;
        corners[i] = t.vertex;
        textures[i] = m.texture;
        smooth |= u32::from(t.flags & TRIANGLE_SMOOTH != 0) << i;
        two_sided |= u32::from(m.flags & MATERIAL_TWO_SIDED != 0) << i;
        through |= (bsdf::transmissive_kinds() >> m.kind & 1) << i;
        textured |= u32::from(m.texture != NONE) << i;
    }
    let mut reflectance = Vec3x8::from_fn(|i| reflectance[i]);
    let w = 1.0 - hit.u - hit.v;
    let mut ns = ng;
    if P::EFFECTS.contains(Effects::SMOOTH_NORMALS) && smooth != 0 {
        let n = |k: usize| Vec3x8::from_fn(|i| scene.vertices.get(corners[i][k] as usize).map_or([0.0; 3], |v| v.n));
        let sum = n(0) * w + n(1) * hit.u + n(2) * hit.v;
        let len = sum.length();
        // opposite normals may cancel: then the triangle's own serves (NUMERICS FRM-3)
        let ok = Mask8::from_bits(smooth) & len.gt(F32x8::splat(1e-6));
        ns = Vec3x8::select(ok, sum / len, ng);
    }
    if P::EFFECTS.contains(Effects::TEXTURES) && textured != 0 {
        let uv = |k: usize, c: usize| {
            F32x8::from_fn(|i| scene.vertices.get(corners[i][k] as usize).map_or(0.0, |v| v.uv[c]))
        };
        let at = |c: usize| uv(0, c) * w + uv(1, c) * hit.u + uv(2, c) * hit.v;
        let mask = Mask8::from_bits(textured);
        let texel = texture::lookup(scene, U32x8::new(textures), [at(0), at(1)], mask);
        reflectance = Vec3x8::select(mask, texel, reflectance);
    }
    let cos = wo.dot(ns);
    let behind = cos.lt(F32x8::ZERO);
    let transmissive = Mask8::from_bits(through);
    let turn = behind & Mask8::from_bits(two_sided).and_not(transmissive);
    let ns = Vec3x8::select(turn, -ns, ns);
    let scatters = (cos.gt(F32x8::ZERO) | turn | (transmissive & behind)) & hit.hit;
    Shading8 { material: U32x8::new(material), kind, reflectance, ns, scatters }
}
