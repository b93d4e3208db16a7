//! Parts of the tracer that a host replaces: ray sources, textures, factors of roulette, a scattering model.

use croupier::unstable::accel::WideBvh;
use croupier::unstable::bsdf::{self, Bsdf, CacheDirection, Eval8, Inputs8, Lobes, NoBsdf, Sample8};
use croupier::unstable::extension::{Extension, PixelSamples8, SourcePoints8, SourceRays8, TextureSamples8};
use croupier::unstable::profile::Full;
use croupier::unstable::rrs::Vertices8;
use croupier::unstable::scene::blob::Material;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::unstable::{camera, film::PixelStats, light::TreeSelector};
use croupier::{Budget, Plan, Scene, Session, SessionError, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{self, Emitter, Model, Principled, Reflectance, SceneDescription};
use croupier_tests::runner::settings;
use croupier_tests::scenes::{add_quad, blob, camera as look, cornell, facing_y, grey, in_white_environment};
use std::cell::Cell;
use std::f32::consts::PI;
use std::rc::Rc;

/// Renders iterations of `spp` samples with an extension.
fn render<X: Extension>(bytes: &[u8], s: &Settings, iterations: &[u32], extension: X) -> Vec<PixelStats> {
    let scene = Scene::from_bytes(bytes).unwrap();
    let plan = Plan::new(s).unwrap();
    let [mut shared, mut block] = [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
    type Own<'s, 'm, X> = Session<'s, 'm, Full, WideBvh<'s>, TreeSelector<'s>, X>;
    let mut session: Own<'_, '_, X> =
        Session::builder(scene).profile().extension(extension).build(&plan, shared.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
    for &spp in iterations {
        session.begin_iteration(spp);
        while shard.step(&session, Budget { rays: 1 << 20 }) == StepResult::More {}
        session.end_iteration([&shard]).unwrap();
    }
    assert_eq!(session.counters().non_finite, 0);
    session.film().pixels().collect()
}

fn bits(pixels: &[PixelStats]) -> &[u8] {
    bytemuck::cast_slice(pixels)
}

/// Mean over pixels and channels, and its standard error.
fn mean(pixels: &[PixelStats]) -> [f64; 2] {
    let n = (3 * pixels.len()) as f64;
    let variance = pixels.iter().map(|p| p.variance_of_mean().map(f64::sqrt).iter().sum::<f64>().powi(2)).sum::<f64>();
    [pixels.iter().flat_map(|p| p.mean()).sum::<f64>() / n, variance.sqrt() / n]
}

#[track_caller]
fn assert_same_mean(a: &[PixelStats], b: &[PixelStats], power: f64) {
    let ([a, ea], [b, eb]) = (mean(a), mean(b));
    let noise = ea.hypot(eb);
    assert!(noise < power * a, "{noise} of {a}: the test could not tell");
    assert!((a - b).abs() < 4.0 * noise, "{a} and {b} +- {noise}");
}

/// The scene's camera, computed by the host.
struct OwnCamera;

impl Extension for OwnCamera {
    type Bsdf = NoBsdf;
    const RAYS: bool = true;

    fn rays(&self, scene: &Scene<'_>, s: &PixelSamples8) -> SourceRays8 {
        let [x, y] = s.position;
        let (origin, direction) = camera::generate(scene.camera, s.size, x, y, s.u);
        SourceRays8 { origin, direction, weight: Vec3x8::ONE, active: s.active }
    }
}

/// Killed by: samples that are handed over in other lanes, a weight that is not 1, a sample that is counted twice.
#[test]
fn rays_of_the_host_are_rays_of_the_camera() {
    let bytes = blob(&cornell([20, 12]));
    for strategy in ["classic", "ears"] {
        let s = settings(&bytes, strategy);
        let [own, built_in] = [render(&bytes, &s, &[4, 4], OwnCamera), render(&bytes, &s, &[4, 4], ())];
        assert!(bits(&own) == bits(&built_in), "{strategy}");
    }
}

/// No rays but those of the last row, and how often it was asked.
struct LastRow(Rc<Cell<u64>>);

impl Extension for LastRow {
    type Bsdf = NoBsdf;
    const RAYS: bool = true;

    fn rays(&self, scene: &Scene<'_>, s: &PixelSamples8) -> SourceRays8 {
        self.0.set(self.0.get() + 1);
        SourceRays8 { active: s.active & U32x8::splat(s.size[1] - 2).lt(s.row), ..OwnCamera.rays(scene, s) }
    }
}

/// Samples without rays take of the budget as well: a step through an empty picture ends. Killed by: a budget of rays
/// alone.
#[test]
fn steps_without_rays_are_bounded() {
    let bytes = blob(&cornell([64, 64]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = settings(&bytes, "classic");
    let plan = Plan::new(&s).unwrap();
    let [mut shared, mut block] = [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
    let packets = Rc::new(Cell::new(0));
    let mut session =
        Session::builder(scene).extension(LastRow(packets.clone())).build(&plan, shared.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
    session.begin_iteration(4);
    let (mut asked, mut steps) = (0, 0);
    let mut left = StepResult::More;
    while left == StepResult::More {
        left = shard.step(&session, Budget { rays: 40 });
        let now = packets.get();
        assert!(now - asked <= 40, "{} packets in a step", now - asked);
        (asked, steps) = (now, steps + 1);
    }
    assert!(asked >= 64 * 64 * 4 / 8 && steps > 100, "{asked} {steps}");
    session.end_iteration([&shard]).unwrap();
    assert!(session.film().pixels().all(|p| p.samples == 4));
}

/// Texels of a lightmap of the floor: irradiance over pi. The left half has no surface.
struct Lightmap;

impl Extension for Lightmap {
    type Bsdf = NoBsdf;
    const RAYS: bool = true;

    fn rays(&self, _: &Scene<'_>, s: &PixelSamples8) -> SourceRays8 {
        let [w, h] = s.size.map(|n| n as f32);
        let (x, z) = (s.position[0] * (2.0 / w) - 1.0, s.position[1] * (2.0 / h) - 1.0);
        let [dx, dz] = camera::concentric_disk(s.u);
        let dy = (F32x8::ONE - dx * dx - dz * dz).max(F32x8::ZERO).sqrt();
        SourceRays8 {
            origin: Vec3x8::new(x, F32x8::splat(1e-3), z),
            direction: Vec3x8::new(dx, dy, dz),
            weight: Vec3x8::ONE,
            active: s.active & U32x8::splat(s.size[0] / 2 - 1).lt(s.column),
        }
    }
}

/// A floor under a constant sky of radiance 1 with a ceiling above: texels far from it see the whole sky. Killed by:
/// a sample without a ray that is not counted (its pixel would be brighter), or leaves a root open (the render would
/// not end), a weight that is left out.
#[test]
fn lightmaps_are_pictures_of_texels() {
    let mut scene = in_white_environment(look([0.0, 3.0, 4.0], [0.0; 3], 40.0, [16, 8]));
    let floor = scene.add_material("floor", grey(0.0));
    add_quad(&mut scene, "floor", floor, facing_y(2.0, 0.0, 1.0));
    let bytes = blob(&scene);
    for strategy in ["classic", "fixed:2.5", "ears"] {
        let pixels = render(&bytes, &settings(&bytes, strategy), &[2, 30], Lightmap);
        for (i, p) in pixels.iter().enumerate() {
            let expected = if i % 16 >= 8 { 1.0 } else { 0.0 };
            assert_eq!(p.samples, 32);
            for x in p.mean() {
                assert!((x - expected).abs() < 1e-6, "{strategy}: pixel {i} has {x}");
            }
        }
    }
}

/// Points of a floor's two triangles by column and row; some columns have numbers that cannot be used.
struct Points;

impl Extension for Points {
    type Bsdf = NoBsdf;
    const POINTS: bool = true;

    fn points(&self, _: &Scene<'_>, s: &PixelSamples8) -> SourcePoints8 {
        let [w, h] = s.size.map(|n| n as f32);
        let (x, z) = (s.position[0] * (1.0 / w), s.position[1] * (1.0 / h));
        let lower = x.gt(z);
        let nan = F32x8::splat(f32::NAN);
        let is = |column: u32| s.column.eq(U32x8::splat(column));
        let triangle = is(4).select(F32x8::from_bits(U32x8::splat(2)), F32x8::ZERO).to_bits();
        let triangle = U32x8::select(lower | is(4), triangle, U32x8::splat(1));
        let [u, v] = [lower.select(x - z, x), lower.select(z, z - x)];
        SourcePoints8 {
            triangle,
            weights: [is(5).select(nan, u), v],
            scale: Vec3x8::splat(PI, PI, PI),
            active: s.active.and_not(is(6)),
            ..SourcePoints8::NONE
        }
    }
}

/// The floor is black, and a light that no ray meets shines on it: the samples bring its irradiance all the same. Killed
/// by: a vertex with the surface's own reflectance, points of other triangles or lanes, a sample without a point that is
/// not counted, or leaves a root open (the render would not end), an emitter that counts at its own texels.
#[test]
fn points_bring_the_irradiance() {
    let mut scene = SceneDescription { camera: look([0.0, 3.0, 4.0], [0.0; 3], 40.0, [8, 8]), ..Default::default() };
    let floor = scene.add_material("floor", grey(0.0));
    add_quad(&mut scene, "floor", floor, facing_y(1.0, 0.0, 1.0));
    scene.emitters.push(Emitter::Area { material: floor, radiance: [5.0; 3] });
    scene.emitters.push(Emitter::Point { position: [0.5, 1.0, 0.25], intensity: [1.0, 2.0, 3.0] });
    let bytes = blob(&scene);
    for strategy in ["classic", "fixed:2.5", "ears"] {
        let pixels = render(&bytes, &settings(&bytes, strategy), &[4, 60], Points);
        for (i, p) in pixels.iter().enumerate() {
            let (column, row) = (i % 8, i / 8);
            assert_eq!(p.samples, 64);
            // the mean over the pixel, by the midpoint rule; a pixel's first column and row are at x = -1, z = 1
            let n = 16;
            let at = |c: usize, k: usize| (c as f64 + (k as f64 + 0.5) / n as f64) / 4.0 - 1.0;
            let irradiance = |(x, z): (f64, f64)| (1.0 + (x - 0.5).powi(2) + (-z - 0.25).powi(2)).powf(-1.5);
            let sum: f64 = (0..n * n).map(|k| irradiance((at(column, k % n), at(row, k / n)))).sum();
            let mean = if (4..7).contains(&column) { 0.0 } else { sum / (n * n) as f64 };
            for (c, (x, variance)) in p.mean().into_iter().zip(p.variance_of_mean()).enumerate() {
                let expected = mean * (c + 1) as f64;
                // the choice between two lights is the noise
                assert!(
                    (x - expected).abs() <= 5.5 * variance.sqrt() + 1e-6 * expected,
                    "{strategy}: {i} has {x}, {expected}"
                );
                assert!(variance.sqrt() <= 0.3 * expected);
            }
        }
    }
}

/// Stripes by coordinate; what is 2 is clamped to 1.
struct Stripes([f32; 3]);

impl Extension for Stripes {
    type Bsdf = NoBsdf;
    const TEXTURES: bool = true;

    fn reflectance(&self, at: &TextureSamples8, reflectance: Vec3x8) -> Vec3x8 {
        let of_first = at.active & at.material.eq(U32x8::splat(0));
        Vec3x8::select(of_first, Vec3x8::splat(self.0[0], self.0[1], self.0[2]), reflectance)
    }
}

/// Killed by: reflectance that is not handed on, that of other materials changed, no clamp, base colours of principled
/// materials that are left out.
#[test]
fn textures_of_the_host_are_reflectances() {
    let diffuse = |rgb| Model::Diffuse { reflectance: Reflectance::Constant(rgb) };
    let layered = |rgb| Model::Principled(Principled { base_color: rgb, coat: 0.5, ..Principled::default() });
    let models: [&dyn Fn([f32; 3]) -> Model; 2] = [&diffuse, &layered];
    for model in models {
        let mut scene = cornell([20, 12]);
        scene.materials[0].model = model([0.75; 3]);
        let bytes = blob(&scene);
        let s = settings(&bytes, "ears");
        let own = render(&bytes, &s, &[4, 4], Stripes([0.25, 0.5, 2.0]));
        scene.materials[0].model = model([0.25, 0.5, 1.0]);
        let painted = blob(&scene);
        assert!(bits(&own) == bits(&render(&painted, &s, &[4, 4], ())));
        assert!(bits(&own) != bits(&render(&bytes, &s, &[4, 4], ())), "the material is not seen");
    }
}

/// A factor that follows no rule, now and then not finite.
struct Wild;

impl Extension for Wild {
    type Bsdf = NoBsdf;
    const ROULETTE: bool = true;

    fn factor(&self, v: &Vertices8, built_in: F32x8) -> F32x8 {
        let red = v.beta.x * 7.0;
        let wild = red - F32x8::from_fn(|i| red.lane(i).floor());
        v.depth.eq(U32x8::splat(3)).select(built_in, 0.3 + 2.0 * wild)
    }
}

/// Whatever the factor, the mean stays. Killed by: a factor that weighs samples and is not the one that rounds them.
#[test]
fn factors_of_the_host_leave_the_mean() {
    let bytes = blob(&cornell([16, 16]));
    let s = Settings { max_depth: 8, ..settings(&bytes, "classic") };
    let wild = render(&bytes, &s, &[300], Wild);
    let plain = render(&bytes, &Settings { seed: 9, ..s }, &[300], ());
    assert_same_mean(&plain, &wild, 0.012);
    assert!(bits(&wild) != bits(&render(&bytes, &s, &[300], ())), "the factors are not asked for");
}

/// A Lambertian model written by a host.
#[derive(Clone, Copy)]
struct Chalk {
    rho: Vec3x8,
}

impl<'s> Bsdf<'s> for Chalk {
    const LOBES: Lobes = Lobes::DIFFUSE;
    const CACHE_DIRECTION: CacheDirection = CacheDirection::Normal;

    fn gather(_: &Scene<'s>, inputs: &Inputs8, _: Mask8) -> Self {
        Self { rho: inputs.reflectance }
    }

    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
        let both = wo.z.gt(F32x8::ZERO) & wi.z.gt(F32x8::ZERO);
        let pdf = both.zero_unless(wi.z * std::f32::consts::FRAC_1_PI);
        Eval8 { f: self.rho * pdf, pdf }
    }

    fn sample(&self, wo: Vec3x8, u: [F32x8; 3]) -> Sample8 {
        let wi = bsdf::warp::cosine_hemisphere(u[0], u[1]);
        let pdf = wi.z * std::f32::consts::FRAC_1_PI;
        let valid = wo.z.gt(F32x8::ZERO) & pdf.gt(F32x8::ZERO);
        Sample8 { wi, weight: self.rho.zero_unless(valid), pdf, delta: Mask8::NONE, valid }
    }

    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        self.rho
    }

    fn shininess(_: &Material) -> f32 {
        0.0
    }
}

struct WithChalk;

impl Extension for WithChalk {
    type Bsdf = Chalk;
    const BSDF: bool = true;
}

/// Every diffuse surface made of chalk looks as before; without the model the scene is refused. Killed by: another model
/// that is called, a missing light sample or MIS weight, a scene that is rendered black without a word.
#[test]
fn scattering_models_of_the_host_scatter() {
    let mut scene: SceneDescription = cornell([16, 16]);
    // its own model sees both sides
    scene.materials.iter_mut().for_each(|m| m.two_sided = false);
    let plain = blob(&scene);
    for m in &mut scene.materials {
        if let Model::Diffuse { reflectance } = m.model {
            m.model = Model::Own { reflectance, alpha: 0.5 };
        }
    }
    let chalk = blob(&scene);
    for strategy in ["classic", "ears", "fixed:1.5"] {
        let s = Settings { max_depth: 8, ..settings(&plain, strategy) };
        let a = render(&plain, &s, &[100, 200], ());
        let b = render(&chalk, &Settings { seed: 3, ..s }, &[100, 200], WithChalk);
        assert_same_mean(&a, &b, 0.004);
    }
    let opened = Scene::from_bytes(&chalk).unwrap();
    let plan = Plan::new(&settings(&chalk, "classic")).unwrap();
    let mut block = AlignedBytes::zeroed(plan.session().size);
    let error = Session::new(opened, &plan, block.as_mut()).expect_err("no kernel");
    assert!(matches!(error, SessionError::Profile { .. }));
    assert!(error.to_string().ends_with(" own"), "{error}");
    let _ = description::Material::new("own", Model::Own { reflectance: Reflectance::Constant([0.5; 3]), alpha: 0.1 });
}
