//! Every kind of light under one contract: what its samples add up to is the irradiance by an independent formula, and
//! they say of themselves what the table of kinds says. A kind without an example does not compile.

use croupier::unstable::light::{LightSample8, PowerSelector, emission_of};
use croupier::unstable::scene::Effects;
use croupier::unstable::scene::blob::{EnvironmentKind, LightKind};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::hit::sample;
use croupier_tests::light_oracle::{V, cross, dot, length, sub, unit, wide};
use croupier_tests::light_scene::{IDENTITY, LightScene};
use croupier_tests::stats::{Mean, SplitMix};
use std::f64::consts::PI;

const CORNERS: [[f32; 3]; 3] = [[1.0, 2.0, 0.5], [0.3, 1.5, 2.0], [-1.5, 2.5, 0.0]];
const RGB: [f32; 3] = [2.0, 1.0, 0.25];
/// Samples, eight at a time.
const PACKETS: usize = 1 << 14;

/// Adds an example of a kind to a scene; the irradiance that it gives a surface at the origin that faces +y, over its
/// emission.
fn example(kind: LightKind, s: LightScene) -> (LightScene, f64) {
    match kind {
        LightKind::Area => (s.triangle(CORNERS, Some(RGB)), triangle()),
        LightKind::Environment => (s.constant(RGB), PI),
        LightKind::Point => {
            let p = [0.5f32, 2.0, -1.0];
            let r = length(wide(p));
            (s.delta(kind, p, RGB), f64::from(p[1]) / r.powi(3))
        }
        LightKind::Sun => {
            // above the horizon as a whole: the mean of the cosine is that of the middle times (1 + cos t) / 2
            let s = s.delta(kind, [0.0, 0.8, 0.6], RGB);
            (s.disk(0.1), f64::from(0.8f32))
        }
        LightKind::Spot => {
            // the origin lies 20 degrees off the axis of a cone of 10 to 40 degrees
            let p = [0.5f32, 2.0, -1.0];
            let r = length(wide(p));
            let side = unit(cross(wide(p), [0.0, 1.0, 0.0]));
            let (sin, cos) = 20f64.to_radians().sin_cos();
            let axis: V = std::array::from_fn(|i| -wide(p)[i] / r * cos + side[i] * sin);
            let [inner, outer] = [10f64, 40.0].map(|t| t.to_radians().cos());
            let f = (cos - outer) / (inner - outer);
            let s = s.delta(kind, p, RGB);
            (s.cone(axis, [1.0 - outer, 1.0 - inner]), f * f * f64::from(p[1]) / r.powi(3))
        }
        LightKind::Sphere => {
            let (p, radius) = ([0.5f32, 2.0, -1.0], 1.2f32);
            let r = length(wide(p));
            let irradiance = PI * f64::from(radius).powi(2) * f64::from(p[1]) / r.powi(3);
            (s.shape(kind, p, &[radius], RGB), irradiance)
        }
        LightKind::Rectangle => {
            let s = s.shape(kind, [0.0, 2.0, 0.0], &[1.5, 0.0, 0.0, 0.0, 0.0, 1.0], RGB);
            // Howell, configuration factor of a plane element and a rectangle above its corner: four of them
            let [x, y] = [1.5f64 / 2.0, 1.0 / 2.0];
            let part = |a: f64, b: f64| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
            (s, 2.0 * (part(x, y) + part(y, x)))
        }
        LightKind::Disk => {
            let s = s.shape(kind, [0.0, 2.0, 0.0], &[0.0, -1.0, 0.0, 1.5], RGB);
            (s, PI * 1.5 * 1.5 / (1.5 * 1.5 + 4.0))
        }
        LightKind::Directional => (s.delta(kind, [0.0, 0.8, 0.6], RGB), f64::from(0.8f32)),
    }
}

/// The integral of cos cos' / r^2 over the triangle, by its midpoints.
fn triangle() -> f64 {
    let [a, b, c] = CORNERS.map(wide);
    let normal = cross(sub(b, a), sub(c, a));
    let n = 400;
    let mut sum = 0.0;
    for k in 0..n * n {
        let [s, t] = [k / n, k % n].map(|i| (f64::from(i) + 0.5) / f64::from(n));
        let p: V = std::array::from_fn(|i| a[i] * (1.0 - s) + s * (b[i] * (1.0 - t) + c[i] * t));
        let d = p.map(|x| x / length(p));
        // |normal| s ds dt is the area
        sum += (-dot(normal, d)).max(0.0) * s * d[1] / dot(p, p);
    }
    sum / f64::from(n * n)
}

/// Calls `see` with samples at the origin.
fn samples(s: &LightScene, seed: u64, mut see: impl FnMut(&LightSample8)) {
    let (scene, mut rng) = (s.scene(), SplitMix(seed));
    for _ in 0..PACKETS {
        let words = std::array::from_fn(|_| U32x8::from_fn(|_| rng.word()));
        let up = Vec3x8::splat(0.0, 1.0, 0.0);
        see(&sample(&scene, &PowerSelector(scene), Vec3x8::ZERO, up, words, Mask8::all_lanes()));
    }
}

/// Mean irradiance that samples give, with its standard error; over the emission.
fn irradiance(s: &LightScene, seed: u64) -> (f64, f64) {
    let mut mean = Mean::default();
    samples(s, seed, |l| {
        let estimate = l.valid.zero_unless(l.radiance.y * l.wi.y.max(F32x8::ZERO) / l.pdf) / RGB[1];
        estimate.to_array().into_iter().for_each(|x| mean.add(f64::from(x)));
    });
    (mean.mean(), mean.error())
}

#[track_caller]
fn assert_near(what: &str, (mean, error): (f64, f64), expected: f64) {
    assert!(error < 0.01 * expected, "{what}: a standard error of {error} sees nothing");
    let off = (mean - expected).abs();
    assert!(off <= 5.0 * error + 1e-5 * expected, "{what}: {mean} +- {error}, expected {expected}");
}

/// Killed by: a kind that is dispatched to another one's sampler, a density without cosine or distance, a selection
/// probability that is left out (all of them together).
#[test]
fn irradiance_is_the_formulas() {
    let (mut all, mut total) = (LightScene::default(), 0.0);
    for (seed, kind) in (0..).zip(LightKind::ALL) {
        let (alone, expected) = example(*kind, LightScene::default());
        assert_near(kind.name(), irradiance(&alone.finish(), seed), expected);
        all = example(*kind, all).0;
        total += expected;
    }
    assert_near("all kinds", irradiance(&all.finish(), 100), total);
}

/// Radius of the disk that receives what lights emit.
const RECEIVER: f32 = 0.25;

/// Mean irradiance of a disk around the origin that faces +y by rays that leave the lights, with its standard error; over
/// the emission.
fn received(s: &LightScene, seed: u64) -> (f64, f64) {
    let (scene, mut rng, mut mean) = (s.scene(), SplitMix(seed), Mean::default());
    let area = PI * f64::from(RECEIVER).powi(2);
    for _ in 0..8 * PACKETS {
        let words = std::array::from_fn(|_| std::array::from_fn(|_| U32x8::from_fn(|_| rng.word())));
        let e = emission_of(Effects(u32::MAX), &scene, &PowerSelector(scene), words, Mask8::all_lanes());
        let t = -e.o.y / e.d.y;
        let p = e.o + e.d * t;
        let inside = (p.x * p.x + p.z * p.z).le(F32x8::splat(RECEIVER * RECEIVER));
        let crosses = e.valid & inside & t.gt(F32x8::ZERO) & e.d.y.lt(F32x8::ZERO);
        let power = crosses.zero_unless(e.power.y / RGB[1]).to_array();
        power.into_iter().for_each(|x| mean.add(f64::from(x) / area));
    }
    (mean.mean(), mean.error())
}

/// The same by samples of the lights, from points all over the disk.
fn sampled(s: &LightScene, seed: u64) -> (f64, f64) {
    let (scene, mut rng, mut mean) = (s.scene(), SplitMix(seed), Mean::default());
    for _ in 0..PACKETS {
        let words = std::array::from_fn(|_| U32x8::from_fn(|_| rng.word()));
        let [r, turn] = [(); 2].map(|()| U32x8::from_fn(|_| rng.word()).to_unit());
        let (sin, cos) = turn.sin_cos_2pi();
        let r = r.sqrt() * RECEIVER;
        let (p, up) = (Vec3x8::new(r * cos, F32x8::ZERO, r * sin), Vec3x8::splat(0.0, 1.0, 0.0));
        let l = sample(&scene, &PowerSelector(scene), p, up, words, Mask8::all_lanes());
        let estimate = l.valid.zero_unless(l.radiance.y * l.wi.y.max(F32x8::ZERO) / l.pdf) / RGB[1];
        estimate.to_array().into_iter().for_each(|x| mean.add(f64::from(x)));
    }
    (mean.mean(), mean.error())
}

/// Lights emit what their samples say of them: the power through a disk, from either side of shapes with two. Killed by:
/// an area or a solid angle that is left out, a side that does not emit, a disk that does not cover the scene, directions
/// that are uniform in place of by the cosine, a selection probability that is left out.
#[test]
fn emitted_power_is_what_is_sampled() {
    let bounds = |s: LightScene| s.finish().within([[-3.0, -1.0, -3.0], [3.0, 4.0, 3.0]]);
    let mut scenes = vec![];
    for kind in LightKind::ALL {
        scenes.push((kind.name(), bounds(example(*kind, LightScene::default()).0)));
    }
    for kind in [LightKind::Sphere, LightKind::Rectangle, LightKind::Disk] {
        scenes.push(("two-sided", bounds(example(kind, LightScene::default()).0.two_sided())));
    }
    let all = LightKind::ALL.iter().fold(LightScene::default(), |s, kind| example(*kind, s).0);
    scenes.push(("all kinds", bounds(all)));
    for (seed, (what, s)) in (0..).zip(scenes) {
        let ((a, da), (b, db)) = (received(&s, 200 + seed), sampled(&s, 300 + seed));
        let error = da.hypot(db);
        assert!(error < 0.04 * b, "{what}: a standard error of {error} sees nothing of {b}");
        assert!((a - b).abs() < 4.5 * error, "{what}: {a} +- {da} received, {b} +- {db} sampled");
    }
}

/// A kind whose effect the profile lacks gives no sample; delta lights say so. Killed by: an effect of the wrong row,
/// `delta` that is not set.
#[test]
fn samples_agree_with_the_table() {
    for kind in LightKind::ALL {
        let scene = example(*kind, LightScene::default()).0.finish();
        let delta = Effects::of_light(*kind).intersects(Effects::DELTA_LIGHTS);
        let mut seen = 0;
        samples(&scene, 7, |l| {
            seen += l.valid.count();
            assert_eq!((l.delta & l.valid).count(), if delta { l.valid.count() } else { 0 }, "{}", kind.name());
        });
        assert!(seen > 1000, "{}", kind.name());
        let view = scene.scene();
        for (profile, wanted) in [(Effects::of_light(*kind), true), (Effects(!Effects::of_light(*kind).0), false)] {
            let words = [U32x8::splat(0x5555_5555); 4];
            let s = croupier::unstable::light::sample_of(
                profile,
                &view,
                &PowerSelector(view),
                Vec3x8::ZERO,
                Vec3x8::ZERO,
                words,
                Mask8::all_lanes(),
            );
            assert_eq!(s.valid.any(), wanted, "{}", kind.name());
        }
    }
}

/// Both kinds of environment light a surface alike where they hold the same. Killed by: a map that is sampled as a
/// constant, a scale that is left out.
#[test]
fn environments_agree() {
    for kind in EnvironmentKind::ALL {
        let s = LightScene::default();
        let s = match kind {
            EnvironmentKind::Constant => s.constant(RGB),
            EnvironmentKind::Map => s.map(vec![RGB.map(|x| x / 2.0); 16 * 9], [16, 9], 2.0, IDENTITY),
        };
        assert_near(kind.name(), irradiance(&s.finish(), 9), PI);
    }
}
