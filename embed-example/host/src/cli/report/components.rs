//! Scattering models, lights and media, eight lanes at a time: how long an operation takes, and whether what is sampled
//! is what is evaluated. Names, materials and lights are those of the microbenchmarks, which compare the same
//! operations with the f64 twins of the tests ([`Twins`]).

use super::effort::Effort;
use super::kernels::ARITHMETIC;
use super::ledger::{Component, Spread};
use super::sums::quantile;
use super::timing::nanoseconds;
use super::twins::Twins;
use croupier::unstable::Numbers8;
use croupier::unstable::bsdf::{Bsdf, HenyeyGreenstein, Inputs8, Visitor, dispatch};
use croupier::unstable::light::{PowerSelector, ShapeRays8, environment_pdf, meet_shapes, sample_of};
use croupier::unstable::media::{Segment8, fly, transmittance};
use croupier::unstable::rng::Key8;
use croupier::unstable::scene::blob::MaterialKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::{INSTRUCTION_SET, Scene};
use croupier_host::bake::{BakeError, BakeOptions, Baked, bake};
use croupier_host::builtin;
use croupier_host::description::*;
use std::error::Error;

/// Packets that are timed.
const TIMED: usize = 128;
/// Packets of which samples are compared with values.
const COMPARED: u32 = 4096;

/// An operation with its time, and what is known of it besides; `kernel` is its name among the microbenchmarks.
fn component(twins: &Twins, kernel: [&str; 2], operation: &str, ns: Spread) -> Component {
    let [group, name] = kernel;
    Component {
        group: match group.split(' ').next() {
            Some("bsdf") => "scattering",
            Some("light") => "lights",
            _ => "media",
        }
        .into(),
        name: name.into(),
        operation: operation.into(),
        arithmetic: ARITHMETIC.into(),
        instruction_set: INSTRUCTION_SET.into(),
        ns,
        instructions: twins.instructions(group, name),
        against_eval: None,
        against_twin: twins.errors(group, name),
    }
}

/// Words of dimension block `n`, the same in every run.
fn words(n: u32) -> [U32x8; 4] {
    let lanes = U32x8::from_fn(|i| i as u32);
    Key8 { lo: lanes, hi: U32x8::splat(0x51ed_270b) }.words(n)
}

fn uniforms(n: u32) -> [F32x8; 3] {
    let [a, b, c, _] = words(n).map(U32x8::to_unit);
    [a, b, c]
}

/// Directions above the surface, uniform in solid angle.
fn upwards(n: u32) -> Vec3x8 {
    let [u, v, _] = uniforms(n);
    let (sin, cos) = v.sin_cos_2pi();
    let z = u * 0.98 + 0.01;
    let r = (F32x8::ONE - z.sqr()).safe_sqrt();
    Vec3x8 { x: r * cos, y: r * sin, z }
}

/// Times and comparisons of one model.
struct Measured<'a, 's> {
    scene: &'a Scene<'s>,
    material: u32,
    name: &'a str,
    repeats: usize,
    twins: &'a Twins,
}

impl<'s> Visitor<'s> for Measured<'_, 's> {
    type Out = Vec<Component>;

    fn visit<B: Bsdf<'s>>(self) -> Vec<Component> {
        let grey = Vec3x8::splat(0.5, 0.5, 0.5);
        let inputs = Inputs8 { material: U32x8::splat(self.material), reflectance: grey };
        let model = B::gather(self.scene, &inputs, Mask8::all_lanes());
        let views: Vec<_> = (0..TIMED as u32).map(|n| (upwards(2 * n), uniforms(2 * n + 1))).collect();
        let pairs: Vec<_> = views.iter().map(|(wo, u)| (*wo, model.sample(*wo, *u).wi)).collect();
        let row = |operation: &str, ns| component(self.twins, [&format!("bsdf {operation}"), self.name], operation, ns);
        let gather = |i: Inputs8| B::gather(self.scene, &i, Mask8::all_lanes());
        let mut rows = vec![
            row("sample", nanoseconds(&views, self.repeats, |(wo, u)| model.sample(wo, u))),
            row("gather", nanoseconds(&[inputs; 16], self.repeats, gather)),
            row("albedo", nanoseconds(&views, self.repeats, |(wo, _)| model.albedo(wo))),
        ];
        if !B::DELTA {
            rows.insert(1, row("eval", nanoseconds(&pairs, self.repeats, |(wo, wi)| model.eval(wo, wi))));
            rows.insert(2, row("pdf", nanoseconds(&pairs, self.repeats, |(wo, wi)| model.eval(wo, wi).pdf)));
            rows[0].against_eval = against_eval(&model);
        }
        rows
    }
}

/// Relative difference of weight x density of samples from the value that `eval` gives: the largest and the median,
/// over lanes of a density that f32 can tell.
fn against_eval<'s>(model: &impl Bsdf<'s>) -> Option<[f64; 2]> {
    let mut found = Vec::new();
    for n in 0..COMPARED {
        let wo = upwards(2 * n);
        let s = model.sample(wo, uniforms(2 * n + 1));
        let e = model.eval(wo, s.wi);
        for i in (s.valid.and_not(s.delta)).lanes() {
            let pdf = f64::from(s.pdf.lane(i));
            let (weight, value) = (f64::from(s.weight.y.lane(i)) * pdf, f64::from(e.f.y.lane(i)));
            if (1e-3..1e6).contains(&pdf) && value > 1e-6 {
                found.push((weight - value).abs() / value);
            }
        }
    }
    (!found.is_empty()).then(|| [quantile(&found, 1.0), quantile(&found, 0.5)])
}

/// One material of every model.
fn models() -> Vec<(&'static str, Model, bool)> {
    let reflectance = Reflectance::Constant([0.8, 0.5, 0.2]);
    let (eta, k, alpha) = ([0.143, 0.375, 1.442], [3.983, 2.386, 1.603], 0.3);
    let layer = Principled { base_color: [0.8, 0.5, 0.2], roughness: 0.5, ..Principled::default() };
    let all = Principled { coat: 1.0, metalness: 0.5, transmission: 0.5, ..layer };
    let (int_ior, ext_ior) = (1.5, 1.0);
    vec![
        ("diffuse", Model::Diffuse { reflectance }, false),
        ("mirror", Model::Mirror { reflectance }, false),
        ("conductor", Model::Conductor { eta, k, reflectance }, false),
        ("roughconductor", Model::RoughConductor { eta, k, reflectance, alpha }, false),
        ("roughconductor, compensated", Model::RoughConductor { eta, k, reflectance, alpha }, true),
        ("dielectric", Model::Dielectric { int_ior, ext_ior }, false),
        ("roughdielectric", Model::RoughDielectric { int_ior, ext_ior, alpha }, false),
        ("roughdielectric, compensated", Model::RoughDielectric { int_ior, ext_ior, alpha }, true),
        ("thindielectric", Model::ThinDielectric { int_ior, ext_ior }, false),
        ("plastic", Model::Plastic { reflectance, int_ior, ext_ior }, false),
        ("roughplastic", Model::RoughPlastic { reflectance, int_ior, ext_ior, alpha }, false),
        ("roughplastic, compensated", Model::RoughPlastic { reflectance, int_ior, ext_ior, alpha }, true),
        ("principled", Model::Principled(layer), false),
        ("principled, all layers", Model::Principled(all), false),
    ]
}

fn baked(scene: &SceneDescription) -> Result<Baked, BakeError> {
    bake(scene, &BakeOptions::default(), |_, _| {})
}

/// A square on the floor, so that there is something to see, and its material.
fn floor(scene: &mut SceneDescription, material: u32) {
    let corners = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    let corners = corners.map(|position| Vertex { position, ..Vertex::default() });
    scene.add_mesh("floor", material, &corners, &[[0, 1, 2], [0, 2, 3]], false);
}

fn scattering(effort: &Effort, twins: &Twins) -> Result<Vec<Component>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for (name, model, compensated) in models() {
        let mut scene = SceneDescription::default();
        let material = scene.add_material(name, model);
        scene.materials[material as usize].compensated = compensated;
        floor(&mut scene, material);
        let baked = baked(&scene)?;
        let scene = Scene::from_bytes(&baked.bytes)?;
        let kind: MaterialKind = model.kind();
        rows.extend(dispatch(kind, Measured { scene: &scene, material, name, repeats: effort.repeats, twins }));
    }
    let fog = Medium { name: "fog".into(), sigma_s: [1.0; 3], g: 0.6, ..Medium::default() };
    let baked = baked(&cube(fog))?;
    let scene = Scene::from_bytes(&baked.bytes)?;
    let phase = Measured { scene: &scene, material: 0, name: "henyey-greenstein", repeats: effort.repeats, twins };
    rows.extend(phase.visit::<HenyeyGreenstein>());
    Ok(rows)
}

/// Scenes with one light each.
fn lights() -> Vec<(&'static str, SceneDescription)> {
    let up = [0.0, 3.0, 0.0];
    let down = [0.0, -1.0, 0.0];
    let radiance = [5.0; 3];
    let shape = |shape| Emitter::Shape(ShapeLight { shape, position: up, radiance, two_sided: false, visible: true });
    let edges = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let emitters = [
        ("point", Emitter::Point { position: up, intensity: radiance }),
        (
            "spot",
            Emitter::Spot { position: up, direction: down, intensity: radiance, inner_deg: 20.0, outer_deg: 80.0 },
        ),
        ("directional", Emitter::Directional { direction: down, irradiance: radiance }),
        ("sun", Emitter::Sun { direction: down, irradiance: radiance, angle_deg: 0.53 }),
        ("sphere", shape(LightShape::Sphere { radius: 0.7 })),
        ("disk", shape(LightShape::Disk { direction: down, radius: 0.8 })),
        ("rectangle", shape(LightShape::Rectangle { edges })),
    ];
    let scene = |emitter: Option<Emitter>| {
        let mut scene = SceneDescription::default();
        let grey = scene.add_material("grey", Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) });
        floor(&mut scene, grey);
        scene.emitters.extend(emitter);
        scene
    };
    let mut scenes: Vec<_> = emitters.into_iter().map(|(name, e)| (name, scene(Some(e)))).collect();
    scenes.push(("area", builtin::cornell_blocks()));
    scenes.push((
        "constant environment",
        SceneDescription { environment: Some(Environment::Constant { radiance }), ..scene(None) },
    ));
    scenes.push(("environment map", SceneDescription { environment: Some(builtin::sky()), ..scene(None) }));
    scenes
}

fn light_samples(effort: &Effort, twins: &Twins) -> Result<Vec<Component>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for (name, scene) in lights() {
        let baked = baked(&scene)?;
        let scene = Scene::from_bytes(&baked.bytes)?;
        let effects = croupier::unstable::Effects(u32::MAX);
        let up = Vec3x8::splat(0.0, 1.0, 0.0);
        let points: Vec<_> = (0..TIMED as u32)
            .map(|n| {
                let [x, y, z] = uniforms(2 * n);
                (Vec3x8 { x: x - 0.5, y: y * 0.5, z: z - 0.5 }, words(2 * n + 1))
            })
            .collect();
        let selector = PowerSelector(scene);
        let sample = |(p, words)| sample_of(effects, &scene, &selector, p, up, words, Mask8::all_lanes());
        rows.push(component(twins, ["light sample", name], "sample", nanoseconds(&points, effort.repeats, sample)));
        let towards: Vec<_> = points.iter().map(|point| (point.0, sample(*point).wi)).collect();
        let all = Mask8::all_lanes();
        let pdf = match name {
            "sphere" | "rectangle" | "disk" => nanoseconds(&towards, effort.repeats, |(p, d)| {
                let (after, upto) = (F32x8::ZERO, F32x8::INFINITY);
                let rays = ShapeRays8 { p, d, after, upto, camera: Mask8::NONE, mask: all };
                let mut found = F32x8::ZERO;
                meet_shapes(&scene, &selector, &rays, up, all, |lanes, _, pdf| found = lanes.select(pdf, found));
                found
            }),
            "constant environment" | "environment map" => {
                nanoseconds(&towards, effort.repeats, |(p, wi)| environment_pdf(&scene, &selector, p, up, wi, all))
            }
            // what a ray cannot meet by chance, and triangles, whose density is part of the hit
            _ => continue,
        };
        rows.push(component(twins, ["light pdf", name], "pdf", pdf));
    }
    Ok(rows)
}

/// A cube of a medium.
fn cube(medium: Medium) -> SceneDescription {
    let mut scene = SceneDescription::default();
    let boundary = scene.add_material("boundary", Model::Null);
    scene.materials[boundary as usize].medium = Some(0);
    scene.media.push(medium);
    let corner = |i: u32| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -1.0 } else { 1.0 });
    let vertices: Vec<_> = (0..8).map(|i| Vertex { position: corner(i), ..Vertex::default() }).collect();
    // pairs of triangles, counter-clockwise from outside
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let faces: Vec<[u32; 3]> = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    scene.add_mesh("cube", boundary, &vertices, &faces, false);
    scene.emitters.push(Emitter::Point { position: [0.0, 3.0, 0.0], intensity: [1.0; 3] });
    scene
}

fn media(effort: &Effort, twins: &Twins) -> Result<Vec<Component>, Box<dyn Error>> {
    let fog = Medium { name: "fog".into(), sigma_a: [0.1; 3], sigma_s: [0.9, 1.0, 1.1], ..Medium::default() };
    let values = (0..16 * 16 * 16).map(|i| (i * 37 % 101) as f32 / 101.0).collect();
    let density = Density::Grid { cells: [16; 3], bounds: [[-1.0; 3], [1.0; 3]], values };
    let cloud = Medium { sigma_s: [4.0; 3], density, ..fog.clone() };
    let mut rows = Vec::new();
    for (name, medium) in [("homogeneous", fog), ("grid", cloud)] {
        let baked = baked(&cube(medium))?;
        let scene = Scene::from_bytes(&baked.bytes)?;
        let (effects, which) = (croupier::unstable::Effects(u32::MAX), U32x8::splat(0));
        let segments: Vec<_> = (0..TIMED as u32)
            .map(|n| {
                let [x, y, z] = uniforms(2 * n).map(|u| u * 1.8 - 0.9);
                let segment = Segment8 { o: Vec3x8 { x, y, z }, d: upwards(2 * n + 1), tmax: F32x8::splat(1.0) };
                let [lo, hi, ..] = words(7 + n);
                (segment, Key8 { lo, hi })
            })
            .collect();
        let all = Mask8::all_lanes();
        let beta = Vec3x8::splat(1.0, 1.0, 1.0);
        let row = |operation: &str, ns| component(twins, [&format!("medium {operation}"), name], operation, ns);
        let flight = nanoseconds(&segments, effort.repeats, |(s, key)| {
            fly(effects, &scene, which, &s, beta, Numbers8::hashed(key), all)
        });
        rows.push(row("flight", flight));
        let passed = nanoseconds(&segments, effort.repeats, |(s, key)| {
            transmittance(effects, &scene, which, &s, Numbers8::hashed(key), all)
        });
        rows.push(row("transmittance", passed));
    }
    Ok(rows)
}

/// All of them.
pub(super) fn measure(effort: &Effort, twins: &Twins) -> Result<Vec<Component>, Box<dyn Error>> {
    Ok([scattering(effort, twins)?, light_samples(effort, twins)?, media(effort, twins)?].concat())
}
