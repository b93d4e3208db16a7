//! A small scene made by hand, and a world and a shard over it: for unit tests of single stages.

extern crate std;

use crate::accel::Intersector;
use crate::geometry::{Hit8, Ray8};
use crate::learn::{LearnedScalars, LearnedState};
use crate::light::PowerSelector;
use crate::memory::{BLOCK_ALIGN, Carver, Measure};
use crate::plan::Plan;
use crate::sampler::Sampler;
use crate::scene::blob::*;
use crate::scene::{Effects, Records, Scene};
use crate::settings::Settings;
use crate::tracer::Shard;
use crate::world::sealed::Sealed;
use crate::world::{Iteration, World};
use bytemuck::Zeroable;
use croupier_simd::{F32x8, Mask8, U32x8};
use std::vec::Vec;

/// Triangles of [`scene`]: two of the floor, the emitter, the mirror.
pub(crate) const TRIANGLES: usize = 4;
/// Reflectance of the floor.
pub(crate) const FLOOR: [f32; 3] = [0.5, 0.25, 0.75];
/// Radiance of the emitter.
pub(crate) const EMISSION: [f32; 3] = [4.0, 8.0, 2.0];
/// Radiance of the environment.
pub(crate) const ENVIRONMENT: [f32; 3] = [0.25, 0.5, 1.0];

/// A diffuse floor at z = 0 of two triangles over the unit square, facing up, the second with (equal) vertex normals;
/// an emitter at z = 1 over half of it, facing down; a mirror at x = 2, facing the floor; a constant environment. Both
/// lights are chosen with probability 1/2.
pub(crate) fn scene<R>(f: impl FnOnce(&Scene<'_>) -> R) -> R {
    let vertex = |p: [f32; 3], n: [f32; 3]| Vertex { p, n, uv: [0.0; 2] };
    let up = [0.0, 0.0, 1.0];
    let vertices = [
        vertex([0.0, 0.0, 0.0], up),
        vertex([1.0, 0.0, 0.0], up),
        vertex([0.0, 1.0, 0.0], up),
        vertex([1.0, 1.0, 0.0], up),
        vertex([0.0, 0.0, 1.0], up),
        vertex([0.0, 1.0, 1.0], up),
        vertex([1.0, 0.0, 1.0], up),
        vertex([2.0, 0.0, 0.0], up),
        vertex([2.0, 0.0, 1.0], up),
        vertex([2.0, 1.0, 0.0], up),
    ];
    let triangle = |vertex, material, light, flags| Triangle { vertex, material, light, flags };
    let triangles = [
        triangle([0, 1, 2], 0, NONE, 0),
        triangle([1, 3, 2], 0, NONE, TRIANGLE_SMOOTH),
        triangle([4, 5, 6], 1, 0, 0),
        triangle([7, 8, 9], 2, NONE, 0),
    ];
    let material = |kind: MaterialKind, reflectance| Material {
        kind: kind as u32,
        texture: NONE,
        table: NONE,
        reflectance,
        medium: NONE,
        ..Zeroable::zeroed()
    };
    let materials = [
        material(MaterialKind::Diffuse, FLOOR),
        material(MaterialKind::Diffuse, [0.0; 3]),
        material(MaterialKind::Mirror, [0.5; 3]),
    ];
    let area = LightKind::Area as u32;
    let lights = [
        Light { kind: area, triangle: 2, area: 0.5, emission: EMISSION, ..Zeroable::zeroed() },
        Light { kind: LightKind::Environment as u32, triangle: NONE, emission: ENVIRONMENT, ..Zeroable::zeroed() },
    ];
    let alias = [0, 1].map(|alias| Alias { threshold: u32::MAX, alias, probability: 0.5 });
    let environment =
        Environment { kind: EnvironmentKind::Constant as u32, light: 1, radiance: ENVIRONMENT, ..Zeroable::zeroed() };
    let camera = Camera {
        kind: 0,
        origin: [0.25, 0.25, 0.5],
        forward: [0.0, 0.0, -1.0],
        right: [0.125, 0.0, 0.0],
        down: [0.0, -0.125, 0.0],
        lens_radius: 0.0,
        focus_distance: 1.0,
        size: [16, 16],
    };
    let info = SceneInfo { bounds_min: [0.0; 3], bounds_max: [2.0, 1.0, 1.0], max_depth: 5, dropped_triangles: 0 };
    f(&Scene::assume_valid(Records {
        info: &info,
        nodes: &[],
        leaves: &[],
        triangles: &triangles,
        vertices: &vertices,
        materials: &materials,
        textures: &[],
        texels: &[],
        tables: &[],
        lights: &lights,
        light_alias: &alias,
        light_nodes: &[],
        light_trails: &[],
        environment: Some(&environment),
        env_texels: &[],
        env_alias: &[],
        camera: &camera,
        media: &[],
        densities: &[],
        majorants: &[],
        objects: &[],
        instances: &[],
        names: &[],
        // nothing that light may pass
        effects: Effects(!Effects::STRAIGHT.0),
        highlight: 0.0,
        hash: 1,
    }))
}

/// Every triangle against every ray, in f64.
#[derive(Clone, Copy)]
pub(crate) struct BruteForce<'a>(&'a Scene<'a>);

impl BruteForce<'_> {
    fn nearest(&self, o: [f32; 3], d: [f32; 3], tmin: f32, tmax: f32) -> Option<(f32, u32, f32, f32)> {
        let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let (o, d) = (o.map(f64::from), d.map(f64::from));
        let mut best = None;
        for (i, t) in (0..).zip(self.0.triangles) {
            let [a, b, c] = t.vertex.map(|v| self.0.vertices[v as usize].p.map(f64::from));
            let (e, f, s) = (sub(b, a), sub(c, a), sub(o, a));
            let (p, q) = (cross(d, f), cross(s, e));
            let det = dot(e, p);
            let (u, v, t) = (dot(s, p) / det, dot(d, q) / det, dot(f, q) / det);
            let limit = best.map_or(f64::from(tmax), |(t, ..): (f32, _, _, _)| f64::from(t));
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > f64::from(tmin) && t < limit {
                best = Some((t as f32, i, u as f32, v as f32));
            }
        }
        best
    }
}

impl Intersector for BruteForce<'_> {
    fn closest(&self, r: &Ray8, active: Mask8) -> Hit8 {
        let mut hits = [None; 8];
        for i in active.lanes() {
            hits[i] = self.nearest(r.o.lane(i), r.d.lane(i), r.tmin.lane(i), r.tmax.lane(i));
        }
        Hit8 {
            hit: Mask8::from_bits((0..8).fold(0, |m, i| m | u32::from(hits[i].is_some()) << i)),
            t: F32x8::from_fn(|i| hits[i].map_or(r.tmax.lane(i), |h| h.0)),
            triangle: U32x8::from_fn(|i| hits[i].map_or(NONE, |h| h.1)),
            u: F32x8::from_fn(|i| hits[i].map_or(0.0, |h| h.2)),
            v: F32x8::from_fn(|i| hits[i].map_or(0.0, |h| h.3)),
            instance: crate::geometry::NO_INSTANCE,
        }
    }

    fn occluded(&self, r: &Ray8, active: Mask8) -> Mask8 {
        self.closest(r, active).hit
    }
}

/// A world of all kernels over [`scene`].
#[derive(Clone, Copy)]
pub(crate) struct TestWorld<'a> {
    scene: &'a Scene<'a>,
    intersector: BruteForce<'a>,
    lights: PowerSelector<'a>,
    learned: &'a LearnedState<'a>,
    iteration: Iteration,
    sampler: Sampler,
    max_depth: u32,
}

impl Sealed for TestWorld<'_> {}

impl<'a> World for TestWorld<'a> {
    const EFFECTS: Effects = Effects(u32::MAX);
    const GUIDING: bool = false;
    const LIGHT_TREES: bool = true;
    type Intersector = BruteForce<'a>;
    type Lights = PowerSelector<'a>;
    type Extension = ();
    type Unguided<'w>
        = Self
    where
        Self: 'w;

    fn unguided(&self) -> Self {
        *self
    }

    fn scene(&self) -> &Scene<'_> {
        self.scene
    }

    fn intersector(&self) -> &BruteForce<'a> {
        &self.intersector
    }

    fn lights(&self) -> &PowerSelector<'a> {
        &self.lights
    }

    fn extension(&self) -> &() {
        &()
    }

    fn learned(&self) -> &LearnedState<'_> {
        self.learned
    }

    fn iteration(&self) -> Iteration {
        self.iteration
    }

    fn sampler(&self) -> Sampler {
        self.sampler
    }

    fn epoch(&self) -> u64 {
        0
    }

    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn camera_media(&self) -> u32 {
        0
    }
}

/// Memory of `size` bytes, aligned as blocks are, from an offset on.
pub(crate) fn block(size: usize) -> (Vec<u8>, usize) {
    let block = std::vec![0xA5; size + BLOCK_ALIGN];
    let offset = block.as_ptr().align_offset(BLOCK_ALIGN);
    (block, offset)
}

/// Calls `f` with a world over [`scene`] and a shard that has joined its first iteration of 4 samples per pixel;
/// `change` may change the settings, which are those of the scene with auxiliary values.
pub(crate) fn world<R>(change: impl FnOnce(&mut Settings), f: impl FnOnce(&TestWorld<'_>, &mut Shard<'_>) -> R) -> R {
    scene(|scene| {
        let sampler = Sampler::Hashed; // each lane has its own numbers, whatever its pixel and sample
        let mut settings = Settings { aovs: true.into(), sampler, ..Settings::for_scene(scene) };
        change(&mut settings);
        let plan = Plan::new(&settings).expect("a plan");
        let needs = settings.needs(plan.job.cache);
        let layout = LearnedState::measure(Measure::new(), &needs).layout().expect("a layout");
        let (mut shared, at) = block(layout.size);
        let mut carver = Carver::new(&mut shared[at..], layout).expect("memory");
        let scalars = LearnedScalars::new([scene.info.bounds_min, scene.info.bounds_max]);
        let mut learned = LearnedState::carve(&mut carver, &needs, &scalars).expect("memory");
        learned.forget();
        learned.begin(4);
        let world = TestWorld {
            scene,
            intersector: BruteForce(scene),
            lights: PowerSelector(*scene),
            learned: &learned,
            iteration: Iteration { number: 1, first_sample: 0, samples: 4 },
            sampler: settings.sampler,
            max_depth: settings.max_depth,
        };
        let (mut own, at) = block(plan.shard().size);
        let mut shard = Shard::new(&plan, 0, &mut own[at..]).expect("a shard");
        shard.begin(&world);
        f(&world, &mut shard)
    })
}
