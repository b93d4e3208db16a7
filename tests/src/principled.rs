//! Scalar f64 oracle of the principled material, from its published parts (glTF 2.0's extensions, Walter et al. 2007,
//! Estevez & Kulla 2017), written without looking at the vector code; albedos of layers are read from the baked tables,
//! which tests/tests/bsdf_principled.rs checks by quadrature of its own.

use crate::bsdf::{V, Value, combine, dot, fresnel_dielectric, ggx_d, ggx_g1, unit};
use crate::model::{Model, Straight, boxed};
use croupier::unstable::bsdf::principled::Surface8;
use croupier::unstable::bsdf::{Bsdf, Inputs8, Visitor, dispatch};
use croupier::unstable::scene::Scene;
use croupier::unstable::scene::blob::{
    EnergyRow, LayerRecord, MaterialKind, NONE, PRINCIPLED_ENERGY_ROWS, PRINCIPLED_ROWS, PrincipledRecord,
    ReflectionRow, TableRecord,
};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{self, Material, Principled, SceneDescription};
use std::f64::consts::{FRAC_1_PI, PI};

/// A principled material: the description, and the scene that it was baked into.
pub struct Layered {
    /// Parameters, as the words of a vertex hold them.
    pub p: Principled,
    /// Both sides alike.
    pub two_sided: bool,
    scene: Scene<'static>,
    record: PrincipledRecord,
    rows: [ReflectionRow; PRINCIPLED_ROWS],
    energy: Option<[EnergyRow; PRINCIPLED_ENERGY_ROWS]>,
}

fn nearest(x: f32, levels: f64) -> f32 {
    ((f64::from(x) * levels).round() / levels) as f32
}

impl Layered {
    /// Bakes the material; what a vertex holds in few bits is rounded first.
    pub fn new(p: Principled, two_sided: bool) -> Self {
        let p = Principled {
            base_color: p.base_color.map(|c| nearest(c.sqrt(), 65535.0).powi(2)),
            roughness: nearest(p.roughness, 65535.0),
            metalness: nearest(p.metalness, 2047.0),
            transmission: nearest(p.transmission, 2047.0),
            coat: nearest(p.coat, 1023.0),
            ..p
        };
        let mut s = SceneDescription::default();
        s.materials.push(Material::new("first", description::Model::Principled(Principled::default())));
        s.materials.push(Material { two_sided, ..Material::new("layered", description::Model::Principled(p)) });
        let bytes: &'static AlignedBytes =
            Box::leak(Box::new(bake(&s, &BakeOptions::default(), |_, _| {}).unwrap().bytes));
        let scene = Scene::from_bytes(bytes).unwrap();
        let record = PrincipledRecord::read::<1>(scene.tables, scene.materials[1].table).unwrap()[0];
        let rows = *ReflectionRow::read(scene.tables, record.reflection).unwrap();
        let energy = (record.energy != NONE).then(|| *EnergyRow::read(scene.tables, record.energy).unwrap());
        Self { p, two_sided, scene, record, rows, energy }
    }

    /// The words of a vertex.
    fn packed(&self) -> Vec3x8 {
        let [r, g, b] = self.p.base_color;
        Surface8 {
            base: Vec3x8::splat(r, g, b),
            roughness: F32x8::splat(self.p.roughness),
            metalness: F32x8::splat(self.p.metalness),
            transmission: F32x8::splat(self.p.transmission),
            coat: F32x8::splat(self.p.coat),
        }
        .pack()
    }

    /// The scene with the material, and what a kernel gathers its parameters by.
    pub fn inputs(&self) -> (Scene<'static>, Inputs8) {
        (self.scene, Inputs8 { material: U32x8::splat(1), reflectance: self.packed() })
    }

    /// The kernel under test in all lanes; samples leave out what passes straight on.
    pub fn model(&self) -> Box<dyn Model> {
        struct Boxed<'a>(&'a Layered);
        impl Visitor<'static> for Boxed<'_> {
            type Out = Box<dyn Model>;
            fn visit<B: Bsdf<'static>>(self) -> Box<dyn Model> {
                let (scene, inputs) = self.0.inputs();
                boxed(B::gather(&scene, &inputs, Mask8::all_lanes()), Straight::Apart)
            }
        }
        dispatch(MaterialKind::Principled, Boxed(self))
    }

    /// Relative index of what is transmitted.
    pub fn eta(&self) -> f64 {
        f64::from(self.record.eta)
    }

    /// Does light that passes enter a solid?
    pub fn solid(&self) -> bool {
        self.p.transmission > 0.0 && self.p.metalness < 1.0 && !self.p.thin_walled
    }

    /// Width of the base's facets.
    pub fn alpha(&self) -> f64 {
        let least = if self.solid() { 1.01e-5 / (self.eta() - 1.0).abs() } else { 0.0 };
        f64::from(self.p.roughness).powi(2).max(least).clamp(1e-4, 1.0)
    }

    fn layer(l: &LayerRecord, mu: f64) -> f64 {
        let (i, t) = column(mu);
        f64::from(l.albedo[i]) * (1.0 - t) + f64::from(l.albedo[i + 1]) * t
    }

    /// The numbers of the table of reflection.
    fn reflection(&self, mu: f64) -> [f64; 3] {
        let ((i, t), y) = (column(mu), f64::from(self.p.roughness) * (PRINCIPLED_ROWS - 1) as f64);
        let j = (y as usize).min(PRINCIPLED_ROWS - 2);
        let s = y - j as f64;
        std::array::from_fn(|k| {
            let at = |j: usize, i: usize| f64::from(self.rows[j].columns[i][k]);
            (at(j, i) * (1.0 - t) + at(j, i + 1) * t) * (1.0 - s)
                + (at(j + 1, i) * (1.0 - t) + at(j + 1, i + 1) * t) * s
        })
    }

    fn energy(&self, mu: f64, inside: bool) -> f64 {
        let Some(rows) = &self.energy else { return 1.0 };
        let ((i, t), y) = (column(mu), f64::from(self.p.roughness) * (PRINCIPLED_ENERGY_ROWS - 1) as f64);
        let j = (y as usize).min(PRINCIPLED_ENERGY_ROWS - 2);
        let s = y - j as f64;
        let at = |j: usize, i: usize| f64::from(rows[j].sides[usize::from(inside)][i]);
        (at(j, i) * (1.0 - t) + at(j, i + 1) * t) * (1.0 - s) + (at(j + 1, i) * (1.0 - t) + at(j + 1, i + 1) * t) * s
    }

    /// Reflectances of the dielectric at normal and at grazing incidence.
    fn f0_f90(&self) -> (V, f64) {
        let ior = f64::from(self.p.ior);
        let f0 = ((1.0 - ior) / (1.0 + ior)).powi(2);
        let specular = f64::from(self.p.specular);
        (self.p.specular_color.map(|c| (f0 * f64::from(c)).min(1.0) * specular), specular)
    }

    /// What passes the sheen, what the coat reflects, what passes both, what passes the specular interface as well.
    fn transmitted(&self, mu: f64) -> [f64; 4] {
        let strongest = self.p.sheen_color.iter().fold(0.0f32, |a, b| a.max(*b));
        let sheen = 1.0 - f64::from(strongest) * Self::layer(&self.record.sheen_layer, mu);
        let coat = f64::from(self.p.coat) * Self::layer(&self.record.coat_layer, mu);
        let (f0, f90) = self.f0_f90();
        let [a, b, _] = self.reflection(mu);
        let specular = (1.0 - f0.iter().fold(0.0, |x: f64, y| x.max(*y)) * a - f90 * b).max(0.0);
        [sheen, coat, sheen * (1.0 - coat), sheen * (1.0 - coat) * specular]
    }

    /// Cosine-weighted mean of what passes to the base, by the rule of the baked nodes.
    fn mean_transmitted(&self) -> f64 {
        // Gauss-Legendre with four points on [0, 1], from the closed form of its nodes
        let (inner, outer) = ((3.0 - 2.0 * 1.2f64.sqrt()) / 7.0, (3.0 + 2.0 * 1.2f64.sqrt()) / 7.0);
        let (wi, wo) = ((18.0 + 30f64.sqrt()) / 72.0, (18.0 - 30f64.sqrt()) / 72.0);
        let nodes = [(0.5 - outer.sqrt() / 2.0, wo), (0.5 - inner.sqrt() / 2.0, wi)];
        let nodes = [nodes[0], nodes[1], (1.0 - nodes[1].0, wi), (1.0 - nodes[0].0, wo)];
        let (f0, f90) = self.f0_f90();
        let f0 = f0.iter().fold(0.0, |x: f64, y| x.max(*y));
        let strongest = f64::from(self.p.sheen_color.iter().fold(0.0f32, |a, b| a.max(*b)));
        let y = f64::from(self.p.roughness) * (PRINCIPLED_ROWS - 1) as f64;
        let j = (y as usize).min(PRINCIPLED_ROWS - 2);
        let s = y - j as f64;
        (0..4)
            .map(|k| {
                let at = |j: usize, which: usize| f64::from(self.rows[j].nodes[k][which]);
                let [a, b] = [0, 1].map(|w| at(j, w) * (1.0 - s) + at(j + 1, w) * s);
                let coat = 1.0 - f64::from(self.p.coat) * f64::from(self.record.coat_layer.nodes[k]);
                let sheen = 1.0 - strongest * f64::from(self.record.sheen_layer.nodes[k]);
                nodes[k].1 * (1.0 - f0 * a - f90 * b).max(0.0) * coat * sheen
            })
            .sum::<f64>()
            .max(1e-3)
    }

    /// Value and density of the mixture.
    pub fn eval(&self, wo: V, wi: V) -> Value {
        let p = &self.p;
        let inside = wo[2] < 0.0;
        let up = |w: V| if inside { [w[0], w[1], -w[2]] } else { w };
        let (wo, wi) = (up(wo), up(wi));
        if wo[2] <= 0.0 || wi[2] == 0.0 {
            return Value::default();
        }
        let shown = !inside || self.two_sided || p.thin_walled;
        let (metal, passes) = (f64::from(p.metalness), f64::from(p.transmission));
        let base = p.base_color.map(f64::from);
        let (dielectric, alpha) = (1.0 - metal, self.alpha());
        let (solid, thin) = if p.thin_walled { (0.0, dielectric * passes) } else { (dielectric * passes, 0.0) };
        let (specular, diffuse) = (dielectric - solid, dielectric * (1.0 - passes));
        let (f0, f90) = self.f0_f90();
        let [sheen_o, coat_o, over_o, all_o] = self.transmitted(wo[2]);
        let [sheen_i, _, over_i, all_i] = self.transmitted(wi[2].abs());
        let [a, b, s_o] = self.reflection(wo[2]);
        let s_i = self.reflection(wi[2].abs())[2];
        let mean = |c: V| (c[0] + c[1] + c[2]) / 3.0;
        let outer = if inside { 1.0 } else { over_o };

        // probabilities
        let strongest = p.sheen_color.iter().fold(0.0f32, |a, b| a.max(*b));
        let sheen_colour = p.sheen_color.map(f64::from);
        let p_diffuse = mean(base) * diffuse * all_o;
        let p_sheen = if strongest > 0.0 { mean(sheen_colour) * (1.0 - sheen_o) / f64::from(strongest) } else { 0.0 };
        let p_coat = coat_o * sheen_o;
        let p_glossy = over_o * (metal * (mean(base) * (1.0 - b) + b) + specular * (mean(f0) * a + f90 * b));
        let p_thin = mean(base) * thin * all_o;
        let seen = if shown { 1.0 } else { 0.0 };
        let p_solid = solid * outer;
        let total = seen * (p_diffuse + p_sheen + p_coat + p_glossy + p_thin) + p_solid;
        if total == 0.0 {
            return Value::default();
        }
        let chance = |x: f64| seen * x / total;

        let mirrored = [wi[0], wi[1], wi[2].abs()];
        let facets = |alpha: f64| {
            let h = unit(combine(wo, 1.0, mirrored, 1.0));
            let c = dot(wo, h);
            let g = ggx_g1(wo, h, alpha) * ggx_g1(mirrored, h, alpha);
            let d = ggx_d(h, alpha);
            // value of a white mirror times the cosine, density, (1 - c)^5
            (d * g / (4.0 * wo[2]), ggx_g1(wo, h, alpha) * d / (4.0 * wo[2]), (1.0 - c).powi(5))
        };
        let (white, visible, w5) = facets(alpha);
        let m = s_o * s_i;
        let mut out = Value::default();
        if shown && wi[2] > 0.0 {
            for c in 0..3 {
                let conductor = base[c] + (1.0 - base[c]) * w5;
                let conductor = conductor / (1.0 - conductor * (1.0 - 1.0 / m));
                let schlick = f0[c] + (f90 - f0[c]) * w5;
                out.f[c] += (metal * conductor + specular * schlick) * white * over_o.min(over_i);
                out.f[c] += diffuse * base[c] * all_o * all_i / self.mean_transmitted() * wi[2] * FRAC_1_PI;
            }
            out.pdf += chance(p_glossy) * visible + chance(p_diffuse) * wi[2] * FRAC_1_PI;
            let (white, visible, w5) = facets(f64::from(self.record.coat_alpha));
            let coat = f64::from(p.coat) * (0.04 + 0.96 * w5) * white * sheen_o.min(sheen_i);
            out.f = out.f.map(|f| f + coat);
            out.pdf += chance(p_coat) * visible + chance(p_sheen) / (2.0 * PI);
            let fibres = fibres(f64::from(self.record.sheen_alpha), wo, wi);
            out.f = std::array::from_fn(|c| out.f[c] + sheen_colour[c] * fibres * wi[2]);
        }
        if shown && wi[2] < 0.0 {
            out.f = base.map(|c| c * thin * m * white * all_o.min(all_i));
            out.pdf += chance(p_thin) * visible;
        }
        if solid > 0.0 {
            let glass = self.interface(wo, wi, inside);
            let reflects = wi[2] > 0.0;
            let layers = match (reflects, inside) {
                (true, false) => over_o.min(over_i),
                (false, false) => over_o,
                (_, true) => 1.0,
            };
            let scale = solid * layers / self.energy(wo[2], inside);
            let colour = if reflects { [1.0; 3] } else { base };
            out.f = std::array::from_fn(|c| out.f[c] + colour[c] * glass.f[0] * scale);
            out.pdf += p_solid / total * glass.pdf;
        }
        out
    }

    /// GGX interface of Walter et al. 2007; wo above, the medium there having the index of its side.
    fn interface(&self, wo: V, wi: V, inside: bool) -> Value {
        let (no, ni) = if inside { (self.eta(), 1.0) } else { (1.0, self.eta()) };
        let (alpha, reflects) = (self.alpha(), wi[2] > 0.0);
        let h = unit(combine(wo, no, wi, if reflects { no } else { ni }));
        let h = if h[2] < 0.0 { h.map(|x| -x) } else { h };
        let (oh, ih) = (dot(wo, h), dot(wi, h));
        if oh <= 0.0 || (ih > 0.0) != reflects {
            return Value::default();
        }
        let f = fresnel_dielectric(oh, no, ni);
        let (d, g_o, g_i) = (ggx_d(h, alpha), ggx_g1(wo, h, alpha), ggx_g1(wi, h, alpha));
        let visible = g_o * oh * d / wo[2];
        if reflects {
            return Value { f: [f * d * g_o * g_i / (4.0 * wo[2]); 3], pdf: f * visible / (4.0 * oh) };
        }
        let denominator = (ni * ih + no * oh).powi(2);
        let value = (ih * oh / wo[2]).abs() * no * no * (1.0 - f) * g_o * g_i * d / denominator;
        Value { f: [value; 3], pdf: (1.0 - f) * visible * ni * ni * ih.abs() / denominator }
    }
}

/// Column and weight of the next one at a cosine.
fn column(mu: f64) -> (usize, f64) {
    let x = mu.sqrt() * 31.0;
    let i = (x as usize).min(30);
    (i, x - i as f64)
}

/// BRDF of white fibres.
pub fn fibres(alpha: f64, wo: V, wi: V) -> f64 {
    let h = unit(combine(wo, 1.0, wi, 1.0));
    let sine = (1.0 - h[2] * h[2]).max(0.0).sqrt();
    let d = (2.0 + 1.0 / alpha) * sine.powf(1.0 / alpha) / (2.0 * PI);
    let t = (1.0 - alpha) * (1.0 - alpha);
    // the published pairs: roughness 0 and 1
    let [a, b, c, d_, e] =
        [[25.3245, 21.5473], [3.32435, 3.82987], [0.16801, 0.19823], [-1.27393, -1.97760], [-4.85967, -4.32054]]
            .map(|[zero, one]| t * zero + (1.0 - t) * one);
    let l = |x: f64| a / (1.0 + b * x.powf(c)) + d_ * x + e;
    let lambda = |mu: f64| if mu < 0.5 { l(mu).exp() } else { (2.0 * l(0.5) - l(1.0 - mu)).exp() };
    d / ((1.0 + lambda(wo[2]) + lambda(wi[2])) * 4.0 * wo[2] * wi[2])
}
