//! Principled material: the subset of OpenPBR that glTF 2.0 has. From the outside: sheen, coat, then a mix of metal and
//! dielectric; the dielectric is a specular interface over a mix of a diffuse base and transmission.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `table` | record of the parameters; shares and colours | `REFLECTANCE_RANGE` |
//!
//! Layers are mixed by albedo: what lies below a layer of albedo E is scaled by T = 1 - E. With M the metalness, t the
//! transmission, k the coat, S the largest channel of the sheen's colour, rho the base colour:
//!
//! | lobe | value `f cos` | scaled by |
//! |---|---|---|
//! | sheen | `sheen.rs` | |
//! | coat, index 1.5 | k times GGX, Schlick's F from 0.04 | min of T_sheen at wo and wi |
//! | metal | M times GGX, Schlick's F from rho, compensated as conductors are | min of L = T_sheen T_coat |
//! | specular | (1 - M), of solids (1 - M) (1 - t), times GGX with `F = f0 + (f90 - f0) (1 - c)^5` | min of L |
//! | diffuse | (1 - M) (1 - t) rho cos / pi | `T(wo) T(wi) / mean of T`, T = L T_specular |
//! | thin transmission | (1 - M) t rho times the compensated GGX reflection, wi mirrored to the other side | min of L T_specular |
//! | solid transmission | (1 - M) t times a GGX interface, rho on what it transmits, over its energy (Turquin 2019) | min of L, or L(wo) for what passes; 1 from inside |
//!
//! - The minimum is reciprocal and never gives more than T(wo); it loses what T(wi) is below T(wo), which is nothing for
//!   narrow lobes. The diffuse base is scaled by the product instead, with the cosine-weighted mean of T by a quadrature
//!   of four nodes ([`NODES`]): its albedo is exactly rho T(wo), so that a white base loses nothing. E of the specular
//!   interface is that of single scattering: what its facets lose enters the base.
//! - All lobes but solid transmission at high roughness are reciprocal: Turquin's factor depends on wo alone, as that of
//!   the rough dielectric does (`bsdf::compensation`).
//! - Lobes are chosen by their albedos, the sheen's direction uniform, the diffuse one by the cosine, all others by visible
//!   normals; value and density are those of the mixture. No lobe is a delta lobe: widths are at least `ALPHA_RANGE`'s.
//! - From behind, solids show the inside of their interface; everything else scatters as from the front if the material is
//!   two-sided (sheets always are), and is black if not.
//!
//! What textures say comes in the three words of the reflectance ([`Surface8`]).

mod sheen;
mod surface;
mod tables;

pub use surface::{Surface8, Textured8, textured};
pub use tables::NODES;

use super::fresnel::{self, Index8};
use super::ggx::{Ggx8, MIN_COS, mirrored_at};
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Materials8, Sample8, flip, lobes, warp};
use crate::scene::Scene;
use crate::scene::blob::{
    ALPHA_RANGE, LayerRecord, MATERIAL_TWO_SIDED, Material, NONE, PRINCIPLED_COLUMNS, PRINCIPLED_NODES,
    PRINCIPLED_TEXTURES, PRINCIPLED_THIN, PrincipledRecord, TableRecord, TextureRecord,
};
use core::f32::consts::{FRAC_1_PI, TAU};
use croupier_simd::{F32x8, Mask8, Vec3x8};
use sheen::Fibres8;
use tables::{Cell8, Energies, NO_REFLECTIONS, Reflection8, Rows8};

/// Reflectance of the coat at normal incidence.
const COAT_F0: f32 = 0.04;
/// Narrowest product of width and contrast of solid transmission that a half vector can be rebuilt for: see
/// `roughdielectric.rs`.
const MIN_WIDTH: f32 = 1e-5;
/// Smallest mean of T that the diffuse base is divided by.
const MIN_MEAN: f32 = 1e-3;

/// Record of lanes without one: black.
const IDLE_RECORD: &PrincipledRecord = &PrincipledRecord {
    metalness: 0.0,
    roughness: 1.0,
    transmission: 0.0,
    coat: 0.0,
    opacity: 1.0,
    f90: 0.0,
    f0: [0.0; 3],
    sheen_color: [0.0; 3],
    coat_alpha: 1.0,
    sheen_alpha: 1.0,
    eta: 1.5,
    normal_scale: 1.0,
    flags: 0,
    reflection: NONE,
    energy: NONE,
    textures: [TextureRecord::NONE; PRINCIPLED_TEXTURES],
    coat_layer: LayerRecord { albedo: [0.0; PRINCIPLED_COLUMNS], nodes: [0.0; PRINCIPLED_NODES] },
    sheen_layer: LayerRecord { albedo: [0.0; PRINCIPLED_COLUMNS], nodes: [0.0; PRINCIPLED_NODES] },
};

/// Principled material.
#[derive(Clone, Copy, Debug)]
pub struct Principled<'s> {
    base: Vec3x8,
    roughness: F32x8,
    /// Shares of the lobes below the coat.
    metal: F32x8,
    specular: F32x8,
    diffuse: F32x8,
    thin: F32x8,
    solid: F32x8,
    coat: F32x8,
    ggx: Ggx8,
    coat_ggx: Ggx8,
    f0: Vec3x8,
    f90: F32x8,
    index: Index8,
    sheen_color: Vec3x8,
    /// S, the largest channel of the colour.
    sheen: F32x8,
    fibres: Fibres8,
    /// Lanes whose back looks like their front.
    two_sided: Mask8,
    /// 1 / mean of T.
    inverse_mean: F32x8,
    rows: Rows8<'s>,
    records: [&'s PrincipledRecord; 8],
    energies: [Option<&'s Energies>; 8],
}

/// What layers do in one direction.
#[derive(Clone, Copy, Debug)]
struct Layers8 {
    /// Place of the cosine in the tables.
    cosine: Cell8,
    /// T_sheen.
    below_sheen: F32x8,
    /// E of the coat.
    coat: F32x8,
    /// L.
    below_coat: F32x8,
    /// GGX reflection of the base.
    reflection: Reflection8,
    /// L T_specular.
    below_all: F32x8,
}

/// Probabilities of the lobes.
#[derive(Clone, Copy, Debug)]
struct Shares8 {
    diffuse: F32x8,
    sheen: F32x8,
    coat: F32x8,
    /// Metal and specular.
    reflection: F32x8,
    thin: F32x8,
    solid: F32x8,
}

/// Half vectors of any length, with the cosines of wo to them: of reflection off the base (wi mirrored to the side of wo),
/// of refraction, of reflection off the coat.
#[derive(Clone, Copy, Debug)]
struct Halves8 {
    base: (Vec3x8, F32x8),
    bent: Vec3x8,
    coat: (Vec3x8, F32x8),
}

/// (1 - c)^5.
#[inline(always)]
fn grazing(c: F32x8) -> F32x8 {
    let x = (1.0 - c).max(F32x8::ZERO);
    let x2 = x * x;
    x2 * x2 * x
}

/// `w` brought above the surface.
#[inline(always)]
fn above(w: Vec3x8) -> Vec3x8 {
    Vec3x8::new(w.x, w.y, w.z.abs())
}

impl Principled<'_> {
    #[inline(always)]
    fn layers(&self, mu: F32x8) -> Layers8 {
        let cosine = Cell8::cosine(mu);
        let mut below_sheen = F32x8::ONE;
        if self.sheen.gt(F32x8::ZERO).any() {
            below_sheen = 1.0 - self.sheen * tables::layer(&self.records.map(|r| &r.sheen_layer), cosine);
        }
        let mut coat = F32x8::ZERO;
        if self.coat.gt(F32x8::ZERO).any() {
            coat = self.coat * tables::layer(&self.records.map(|r| &r.coat_layer), cosine);
        }
        let below_coat = below_sheen * (1.0 - coat);
        let reflection = self.rows.reflection(cosine);
        let specular = self.f0.max_component() * reflection.normal + self.f90 * reflection.grazing;
        let below_all = below_coat * (1.0 - specular).max(F32x8::ZERO);
        Layers8 { cosine, below_sheen, coat, below_coat, reflection, below_all }
    }

    /// Mean of T over the cosine-weighted hemisphere.
    #[inline(always)]
    fn mean_below(&self) -> F32x8 {
        let f0 = self.f0.max_component();
        let mut sum = F32x8::ZERO;
        for (k, (_, weight)) in NODES.into_iter().enumerate() {
            let node = |layer: fn(&PrincipledRecord) -> &LayerRecord| {
                F32x8::from_fn(|l| layer(self.records[l]).nodes.get(k).copied().unwrap_or(0.0))
            };
            let [normal, grazing] = self.rows.node(k);
            let t = (1.0 - f0 * normal - self.f90 * grazing).max(F32x8::ZERO);
            let t = t * (1.0 - self.coat * node(|r| &r.coat_layer)) * (1.0 - self.sheen * node(|r| &r.sheen_layer));
            sum += t * weight;
        }
        sum.max(F32x8::splat(MIN_MEAN))
    }

    /// Albedos of the lobes seen from a direction with these layers, by lobe, before normalisation; `mu` is its cosine.
    #[inline(always)]
    fn albedos(&self, to: &Layers8, mu: F32x8, below: Mask8) -> [Vec3x8; 6] {
        let (normal, grazing) = (to.reflection.normal, to.reflection.grazing);
        let metal = self.base * (1.0 - grazing) + Vec3x8::grey(grazing);
        let specular = self.f0 * normal + Vec3x8::grey(self.f90 * grazing);
        let fresnel = fresnel::dielectric(mu, self.index.seen_from(below)).reflectance;
        let interface = self.base * (1.0 - fresnel) + Vec3x8::grey(fresnel);
        let outer = below.select(F32x8::ONE, to.below_coat);
        [
            self.base * (self.diffuse * to.below_all),
            self.sheen_color * ((1.0 - to.below_sheen) / self.sheen.max(F32x8::splat(f32::MIN_POSITIVE))),
            Vec3x8::grey(to.coat * to.below_sheen),
            (metal * self.metal + specular * self.specular) * to.below_coat,
            self.base * (self.thin * to.below_all),
            interface * (self.solid * outer),
        ]
    }

    /// Probabilities of the lobes: their albedos over the sum.
    #[inline(always)]
    fn shares(&self, to: &Layers8, mu: F32x8, below: Mask8) -> Shares8 {
        let shown = self.two_sided | !below;
        let [diffuse, sheen, coat, reflection, thin, _] =
            self.albedos(to, mu, below).map(|a| shown.zero_unless(a.mean()));
        // what is absorbed on the way through must not starve the reflection
        let solid = self.solid * below.select(F32x8::ONE, to.below_coat);
        let sum = diffuse + sheen + coat + reflection + thin + solid;
        let scale = sum.gt(F32x8::ZERO).zero_unless(1.0 / sum.max(F32x8::splat(f32::MIN_POSITIVE)));
        Shares8 {
            diffuse: diffuse * scale,
            sheen: sheen * scale,
            coat: coat * scale,
            reflection: reflection * scale,
            thin: thin * scale,
            solid: solid * scale,
        }
    }

    /// The half vector of a refraction wo -> wi, turned to the side of wo (as in `roughdielectric.rs`).
    #[inline(always)]
    fn bent(index: &Index8, wo: Vec3x8, wi: Vec3x8) -> Vec3x8 {
        let bent = (wo + wi) + wi * (index.k / (index.eta + 1.0));
        Vec3x8::select(index.k.gt(F32x8::ZERO), -bent, bent)
    }

    /// Value and density with the half vectors `halves`; wo above the surface, `below` where both were turned.
    fn mixture(&self, wo: Vec3x8, wi: Vec3x8, halves: &Halves8, to: &Layers8, shares: &Shares8, below: Mask8) -> Eval8 {
        let shown = self.two_sided | !below;
        let reflect = wi.z.gt(F32x8::ZERO);
        let wr = above(wi);
        let ti = self.layers(wr.z);
        let min_below_coat = to.below_coat.min(ti.below_coat);

        let (h, c) = halves.base;
        let r = self.ggx.reflection_at(wo, wr, h, c);
        let w5 = grazing(r.cos);
        let m = to.reflection.s * ti.reflection.s;
        let lobe = r.g1 * r.pdf;
        let metal = self.base * (1.0 - w5) + Vec3x8::grey(w5);
        let metal = metal.map(|f| f * m / (m * (1.0 - f) + f));
        let specular = self.f0 * (1.0 - w5) + Vec3x8::grey(self.f90 * w5);
        let glossy = (metal * self.metal + specular * self.specular) * (lobe * min_below_coat);
        let cosine = wr.z * FRAC_1_PI;
        let diffuse = self.base * (self.diffuse * to.below_all * ti.below_all * self.inverse_mean * cosine);
        let mut f = glossy + diffuse;
        let mut pdf = shares.reflection * r.pdf + shares.diffuse * cosine;
        if self.coat.gt(F32x8::ZERO).any() {
            let (h, c) = halves.coat;
            let r = self.coat_ggx.reflection_at(wo, wr, h, c);
            let fresnel = grazing(r.cos) * (1.0 - COAT_F0) + COAT_F0;
            f += Vec3x8::grey(self.coat * fresnel * r.g1 * r.pdf * to.below_sheen.min(ti.below_sheen));
            pdf += shares.coat * r.pdf;
        }
        if self.sheen.gt(F32x8::ZERO).any() {
            f += self.sheen_color * self.fibres.eval(wo, wr);
            pdf += shares.sheen * (1.0 / TAU);
        }
        let mut out = Eval8 { f, pdf }.zero_unless(reflect & shown);
        if self.thin.gt(F32x8::ZERO).any() {
            let f = self.base * (self.thin * m.min(F32x8::splat(4.0)) * lobe * to.below_all.min(ti.below_all));
            let through = Eval8 { f, pdf: shares.thin * r.pdf }.zero_unless(shown & wi.z.lt(F32x8::ZERO));
            out = Eval8 { f: out.f + through.f, pdf: out.pdf + through.pdf };
        }
        if self.solid.gt(F32x8::ZERO).any() {
            let solid = self.interface(wo, wi, halves, to, &ti, below);
            out = Eval8 { f: out.f + solid.f * self.solid, pdf: out.pdf + solid.pdf * shares.solid };
        }
        out.zero_unless(wo.z.gt(F32x8::ZERO))
    }

    /// The GGX interface of solids, scaled by the layers above it: Walter et al. 2007, equations 20 and 21, in the forms of
    /// `roughdielectric.rs`.
    #[inline(never)]
    fn interface(&self, wo: Vec3x8, wi: Vec3x8, halves: &Halves8, to: &Layers8, ti: &Layers8, below: Mask8) -> Eval8 {
        let index = self.index.seen_from(below);
        let reflect = wi.z.gt(F32x8::ZERO);
        let h = Vec3x8::select(reflect, halves.base.0, halves.bent);
        let length = h.length();
        let c = reflect.select(halves.base.1, wo.dot(h) / length);
        let cos_t = -(wi.dot(h) / length);
        let (d, denominator) = (self.ggx.d(h), self.ggx.denominator(wo));
        let e = index.eta * cos_t;
        let visible = c * d * 2.0 / denominator;
        let refracted =
            fresnel::transmittance(c, cos_t, index.eta) * visible * (index.eta * e) * ((c + e) / index.k).sqr();
        let reflected = fresnel::dielectric(c, index).reflectance * d / (denominator * 2.0);
        let pdf = reflect.select(reflected, refracted);
        let outer = reflect.select(to.below_coat.min(ti.below_coat), to.below_coat);
        let outer = below.select(F32x8::ONE, outer);
        let scale = reflect.select(F32x8::ONE, index.inverse * index.inverse) * outer * self.ggx.g1(wi)
            / tables::energy(&self.energies, self.roughness, to.cosine, below);
        let colour = Vec3x8::select(reflect, Vec3x8::ONE, self.base);
        let transmits = wi.z.lt(F32x8::ZERO) & h.z.gt(F32x8::ZERO) & cos_t.gt(F32x8::ZERO);
        let valid = c.gt(F32x8::splat(MIN_COS)) & (reflect | transmits);
        Eval8 { f: colour * (pdf * scale), pdf }.zero_unless(valid)
    }
}

impl<'s> Bsdf<'s> for Principled<'s> {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::TRANSMISSION).with(Lobes::DIFFUSE).with(Lobes::GLOSSY);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Mirror;
    const FOLDED: bool = true;

    #[inline(always)]
    fn gather(scene: &Scene<'s>, inputs: &Inputs8, active: Mask8) -> Self {
        let m = Materials8::new(scene, inputs, active);
        let one = |l: usize| scene.principled(m.0[l]).unwrap_or(IDLE_RECORD);
        let records = [one(0), one(1), one(2), one(3), one(4), one(5), one(6), one(7)];
        let get = |f: fn(&PrincipledRecord) -> f32| F32x8::from_fn(|l| f(records[l]));
        let s = Surface8::unpack(inputs.reflectance.zero_unless(active));
        let thin_walled =
            Mask8::from_bits((0..8).fold(0, |bits, l| bits | u32::from(records[l].flags & PRINCIPLED_THIN != 0) << l));
        let two_sided =
            Mask8::from_bits((0..8).fold(0, |bits, l| bits | u32::from(m.0[l].flags & MATERIAL_TWO_SIDED != 0) << l));
        let dielectric = 1.0 - s.metalness;
        let transmits = dielectric * s.transmission;
        let solid = thin_walled.select(F32x8::ZERO, transmits);
        let (eta, sheen_color) = (get(|r| r.eta), Vec3x8::from_fn(|l| records[l].sheen_color));
        let narrowest = solid.gt(F32x8::ZERO).zero_unless(MIN_WIDTH / (eta - 1.0).abs()) * 1.01;
        let alpha = s.roughness.sqr().max(narrowest).clamp(ALPHA_RANGE[0], ALPHA_RANGE[1]);
        let tables = records.map(|r| TableRecord::read(scene.tables, r.reflection).unwrap_or(NO_REFLECTIONS));
        let mut out = Self {
            base: s.base,
            roughness: s.roughness,
            metal: s.metalness,
            specular: dielectric - solid,
            diffuse: dielectric - transmits,
            thin: thin_walled.zero_unless(transmits),
            solid,
            coat: s.coat,
            ggx: Ggx8::new(alpha),
            coat_ggx: Ggx8::new(get(|r| r.coat_alpha)),
            f0: Vec3x8::from_fn(|l| records[l].f0),
            f90: get(|r| r.f90),
            index: Index8::new(eta),
            sheen_color,
            sheen: sheen_color.max_component(),
            fibres: Fibres8::new(get(|r| r.sheen_alpha)),
            two_sided: two_sided | thin_walled,
            inverse_mean: F32x8::ONE,
            rows: Rows8::new(tables, s.roughness),
            records,
            energies: [None; 8],
        };
        out.inverse_mean = 1.0 / out.mean_below();
        if solid.gt(F32x8::ZERO).any() {
            out.energies = records.map(|r| TableRecord::read(scene.tables, r.energy));
        }
        out
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let below = wo.z.lt(F32x8::ZERO);
        let (wo, wi) = (flip(wo, below), flip(wi, below));
        let half = wo + above(wi);
        let cos = half.length() * 0.5;
        let bent = Self::bent(&self.index.seen_from(below), wo, wi);
        let to = self.layers(wo.z);
        let shares = self.shares(&to, wo.z, below);
        self.mixture(wo, wi, &Halves8 { base: (half, cos), bent, coat: (half, cos) }, &to, &shares, below)
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [u, v, lobe]: [F32x8; 3]) -> Sample8 {
        let below = wo.z.lt(F32x8::ZERO);
        let wo = flip(wo, below);
        let to = self.layers(wo.z);
        let shares = self.shares(&to, wo.z, below);
        let index = self.index.seen_from(below);

        // the lobes, one after the other, with the sums of their probabilities as ends
        let to_sheen = shares.diffuse;
        let to_coat = to_sheen + shares.sheen;
        let to_reflection = to_coat + shares.coat;
        let to_thin = to_reflection + shares.reflection;
        let to_solid = to_thin + shares.thin;
        let is_diffuse = lobe.lt(to_sheen);
        let is_sheen = lobe.lt(to_coat).and_not(is_diffuse);
        let by_facet = !lobe.lt(to_coat);
        let is_coat = by_facet & lobe.lt(to_reflection);
        let is_thin = lobe.lt(to_solid).and_not(lobe.lt(to_thin)) & shares.thin.gt(F32x8::ZERO);
        let is_solid = !lobe.lt(to_solid) & shares.solid.gt(F32x8::ZERO);

        let ggx = Ggx8::new(is_coat.select(self.coat_ggx.alpha(), self.ggx.alpha()));
        let n = ggx.sample_visible(wo, u, v);
        let c = wo.dot(n);
        let interface = fresnel::dielectric(c, index);
        let refract = is_solid & (lobe - to_solid).ge(shares.solid * interface.reflectance);
        let mirrored = mirrored_at(wo, n, c);
        let refracted = -(wo * index.inverse) - n * (index.k * index.inverse / (c + index.eta * interface.cos_t));
        // whether the direction is on the side that its lobe scatters to
        let leaves = refract.select(-refracted.z, by_facet.select(mirrored.z, F32x8::ONE)).gt(F32x8::ZERO);
        let through = flip(mirrored, is_thin);
        let sine = (1.0 - u * u).safe_sqrt();
        let (sin, cos) = v.sin_cos_2pi();
        let uniform = Vec3x8::new(cos * sine, sin * sine, u);
        let wi = Vec3x8::select(is_diffuse, warp::cosine_hemisphere(u, v), Vec3x8::select(refract, refracted, through));
        let wi = Vec3x8::select(is_sheen, uniform, wi);

        // the normals that were sampled are better than half vectors rebuilt from rounded directions
        let half = wo + above(wi);
        let rebuilt = (half, half.length() * 0.5);
        let is_base = by_facet.and_not(is_coat);
        let either = |mask: Mask8| (Vec3x8::select(mask, n, rebuilt.0), mask.select(c, rebuilt.1));
        let halves = Halves8 {
            base: either(is_base.and_not(refract)),
            bent: Vec3x8::select(refract, n, Self::bent(&index, wo, wi)),
            coat: either(is_coat),
        };
        let e = self.mixture(wo, wi, &halves, &to, &shares, below);
        let valid = wo.z.gt(F32x8::ZERO) & leaves & e.pdf.gt(F32x8::ZERO);
        Sample8 { wi: flip(wi, below), weight: e.f / e.pdf, pdf: e.pdf, delta: Mask8::NONE, valid }.masked()
    }

    #[inline(always)]
    fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
        let below = wo.z.lt(F32x8::ZERO);
        let mu = wo.z.abs();
        let to = self.layers(mu);
        let [diffuse, sheen, coat, reflection, thin, solid] = self.albedos(&to, mu, below);
        let opaque = (diffuse + sheen + coat + reflection + thin).zero_unless(self.two_sided | !below);
        (opaque + solid).map(|c| c.clamp(0.0, 1.0)).zero_unless(mu.gt(F32x8::ZERO))
    }

    /// That of the GGX width if metal or transmission prevail, which the baker tells by the material's `alpha`; 0 else.
    fn shininess(material: &Material) -> f32 {
        lobes::phong_exponent(material.alpha)
    }
}
