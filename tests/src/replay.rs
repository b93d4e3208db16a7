//! Recursive path tracer, one sample at a time, sums in f64: an oracle of the tracer's bookkeeping. Random numbers
//! follow from keys, so it traces the same samples; the ray, material and light functions are the core's own, tested
//! elsewhere. Independent are the weights of samples, their bins and their counted rays.
//!
//! For flat-shaded scenes of area lights without textures, lens and environment, and the absolute objective.

use crate::cache::Sums;
use crate::hit::{area_pdf, area_radiance, sample, surface_point};
use croupier::Scene;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::bsdf::{Bsdf, Eval8, Inputs8, Sample8, Visitor, dispatch};
use croupier::unstable::camera;
use croupier::unstable::cost::COST_SHADOW;
use croupier::unstable::geometry::{Ray8, offset, shadow_ray};
use croupier::unstable::learn::cache::{Cache, VertexKind, VertexKind8};
use croupier::unstable::light::{LightSample8, PowerSelector, power_heuristic};
use croupier::unstable::rng::Key8;
use croupier::unstable::scene::blob::{MATERIAL_TWO_SIDED, MaterialKind};
use croupier::unstable::simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Recursive render of a scene, and what it has counted so far.
pub struct Replay<'a, 's> {
    /// Scene to render.
    pub scene: Scene<'s>,
    /// Intersector of the scene.
    pub bvh: WideBvh<'s>,
    /// Cache that numbers the bins; no tree has been subdivided.
    pub cache: &'a Cache<'a>,
    /// Seed of the settings.
    pub seed: u64,
    /// Longest path of the settings.
    pub max_depth: u32,
    /// Size of the picture of the settings.
    pub size: [u32; 2],
    /// Number of samples per vertex.
    pub factor: u32,
    /// Sums of the bins.
    pub sums: Vec<Sums>,
    /// Number of rays of all kinds, and of samples of vertices.
    pub counted: [u64; 2],
}

/// Scattered ray or camera ray.
struct RayState {
    ray: Ray8,
    from: Vec3x8,
    normal: Vec3x8,
    pdf: F32x8,
    skip_mis: bool,
    key: Key8,
    depth: u32,
}

/// Path vertex.
struct PathVertex {
    p: Vec3x8,
    error: F32x8,
    ng: Vec3x8,
    ns: Vec3x8,
    wo: Vec3x8,
    inputs: Inputs8,
    kind: MaterialKind,
}

struct AlbedoOf<'a, 's>(&'a Scene<'s>, &'a PathVertex);

impl<'s> Visitor<'s> for AlbedoOf<'_, 's> {
    type Out = (Vec3x8, bool);

    fn visit<B: Bsdf<'s>>(self) -> Self::Out {
        let wo = Frame8::from_normal(self.1.ns).to_local(self.1.wo);
        (B::gather(self.0, &self.1.inputs, one()).albedo(wo), B::DELTA)
    }
}

struct Scatter<'a, 's>(&'a Scene<'s>, &'a PathVertex, Vec3x8, [F32x8; 3]);

impl<'s> Visitor<'s> for Scatter<'_, 's> {
    type Out = (Eval8, Sample8);

    fn visit<B: Bsdf<'s>>(self) -> Self::Out {
        let frame = Frame8::from_normal(self.1.ns);
        let wo = frame.to_local(self.1.wo);
        let b = B::gather(self.0, &self.1.inputs, one());
        let mut s = b.sample(wo, self.3);
        s.wi = frame.to_world(s.wi);
        (b.eval(wo, frame.to_local(self.2)), s)
    }
}

/// Mask of the only lane in use.
fn one() -> Mask8 {
    Mask8::first(1)
}

fn rgb(v: Vec3x8) -> [f64; 3] {
    v.lane(0).map(f64::from)
}

impl Replay<'_, '_> {
    /// Radiance of one camera sample, rgb.
    pub fn camera_sample(&mut self, [x, y]: [u32; 2], sample: u32) -> [f64; 3] {
        let key = Key8::camera(self.seed, U32x8::splat(y * self.size[0] + x), U32x8::splat(sample));
        let [u0, u1, ..] = key.uniforms(0);
        let lens = [F32x8::ZERO; 2];
        let (o, d) = camera::generate(
            self.scene.camera,
            self.size,
            F32x8::splat(x as f32) + u0,
            F32x8::splat(y as f32) + u1,
            lens,
        );
        self.trace(&RayState {
            ray: Ray8::unbounded(o, d),
            from: o,
            normal: Vec3x8::ZERO,
            pdf: F32x8::ONE,
            skip_mis: true,
            key: key.child(U32x8::splat(0)),
            depth: 1,
        })
        .0
    }

    /// Radiance along a ray, and its counted cost.
    fn trace(&mut self, f: &RayState) -> ([f64; 3], f64) {
        self.counted[0] += 1;
        let (hit, d) = (self.bvh.closest(&f.ray, one()), f.ray.d);
        if (hit.hit & one()).none() {
            return ([0.0; 3], 1.0);
        }
        let scene = self.scene;
        let point = surface_point(&scene, hit.triangle, hit.u, hit.v, one());
        let emitted = area_radiance(&scene, hit.triangle, d, point.ng, one());
        let other = area_pdf(&scene, &PowerSelector(scene), f.from, f.normal, hit.triangle, d, hit.t, one());
        let mis = if f.skip_mis { F32x8::ONE } else { power_heuristic(f.pdf, other) };
        let found = rgb(emitted * mis);
        let triangle = &scene.triangles[hit.triangle.lane(0) as usize];
        let material = &scene.materials[triangle.material as usize];
        let kind = MaterialKind::from_u32(material.kind).expect("a material");
        let cos = (-d).dot(point.ng).lane(0);
        let through = matches!(kind, MaterialKind::Dielectric);
        let turns = cos < 0.0 && material.flags & MATERIAL_TWO_SIDED != 0 && !through;
        if f.depth >= self.max_depth || !(cos > 0.0 || turns || through && cos < 0.0) {
            return (found, 1.0);
        }
        let [r, g, b] = material.reflectance;
        let vertex = PathVertex {
            p: point.p,
            error: point.error,
            ng: point.ng,
            ns: if turns { -point.ng } else { point.ng },
            wo: -d,
            inputs: Inputs8 { material: U32x8::splat(triangle.material), reflectance: Vec3x8::splat(r, g, b) },
            kind,
        };
        let (value, cost) = self.scatter(&vertex, f.key, f.depth);
        ([0, 1, 2].map(|c| found[c] + value[c]), 1.0 + cost)
    }

    /// Reflected radiance at a vertex, and its counted cost; logs the samples.
    fn scatter(&mut self, v: &PathVertex, key: Key8, depth: u32) -> ([f64; 3], f64) {
        let (albedo, delta) = dispatch(v.kind, AlbedoOf(&self.scene, v));
        let dir = match v.kind {
            MaterialKind::Diffuse => v.ns,
            MaterialKind::Dielectric => v.wo,
            _ => v.ns * (v.ns.dot(v.wo) * F32x8::splat(2.0)) - v.wo,
        };
        let kind = match (depth, v.kind) {
            (1, MaterialKind::Diffuse) => VertexKind::FirstDiffuse,
            (1, _) => VertexKind::FirstGlossy,
            (_, MaterialKind::Diffuse) => VertexKind::Diffuse,
            _ => VertexKind::Glossy,
        };
        let kind = VertexKind8::splat(kind);
        let bin = self.cache.find(kind, v.p, dir, one()).lane(0) as usize;
        let scale = rgb(albedo).map(|a| match a {
            _ if depth == 1 => 1.0,
            a if a < 1e-3 => 0.0,
            a => 1.0 / a,
        });
        let n = f64::from(self.factor);
        let (mut mean, mut square, mut rays) = ([0.0; 3], [0.0; 3], 0.0);
        for k in 0..self.factor {
            let (x, light, cost) = self.sample(v, key.child(U32x8::splat(k)), depth, delta);
            let logged = [0, 1, 2].map(|c| x[c] * scale[c]);
            for c in 0..3 {
                self.sums[bin][14] += (light[c] * scale[c]).powi(2);
                mean[c] += x[c] / n;
                square[c] += logged[c] * logged[c];
                self.sums[bin][3 + c] += logged[c];
                self.sums[bin][6 + c] += logged[c] * logged[c];
            }
            self.sums[bin][0] += 1.0;
            self.sums[bin][2] += cost;
            self.counted[1] += 1;
            rays += cost;
        }
        self.sums[bin][1] += n - 1.0;
        for c in 0..3 {
            self.sums[bin][9 + c] += square[c] - n * (mean[c] * scale[c]).powi(2);
        }
        (mean, rays)
    }

    /// One sample of a vertex, next event estimation and a bounce: radiance, the part of next event estimation, counted
    /// cost.
    fn sample(&mut self, v: &PathVertex, key: Key8, depth: u32, delta: bool) -> ([f64; 3], [f64; 3], f64) {
        let scene = self.scene;
        let [a, b, c, _] = key.uniforms(0);
        let light = if delta {
            LightSample8::NONE
        } else {
            sample(&scene, &PowerSelector(scene), v.p, v.ng, key.words(1), one())
        };
        let (f, s) = dispatch(v.kind, Scatter(&scene, v, light.wi, [a, b, c]));
        let (mut x, mut cost) = ([0.0; 3], 0.0);
        let direct = f.f * light.radiance * (power_heuristic(light.pdf, f.pdf) / light.pdf);
        if light.valid.lane(0) && direct.any_positive().lane(0) {
            self.counted[0] += 1;
            cost += f64::from(COST_SHADOW);
            let ray = shadow_ray(v.p, v.ng, v.error, light.point, light.normal, light.point_error);
            if self.bvh.occluded(&ray, one()).none() {
                x = rgb(direct);
            }
        }
        let nee = x;
        if s.valid.lane(0) && s.weight.any_positive().lane(0) {
            let (radiance, rays) = self.trace(&RayState {
                ray: Ray8::unbounded(offset(v.p, v.ng, v.error, s.wi), s.wi),
                from: v.p,
                normal: v.ng,
                pdf: s.pdf,
                skip_mis: s.delta.lane(0),
                key: key.child(U32x8::splat(0)),
                depth: depth + 1,
            });
            let weight = rgb(s.weight);
            (0..3).for_each(|c| x[c] += weight[c] * radiance[c]);
            cost += rays;
        }
        (x, nee, cost)
    }
}
