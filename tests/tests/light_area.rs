//! Area, point and directional lights.

use croupier::unstable::light::{LightSample8, PowerSelector, power_heuristic};
use croupier::unstable::scene::blob::LightKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::hit::{area_pdf, area_radiance, sample};
use croupier_tests::light_oracle as oracle;
use croupier_tests::light_oracle::{cross, dot, length, sub, unit, wide};
use croupier_tests::light_scene::LightScene;
use croupier_tests::stats::{SplitMix, chi_square_in_order};

const UP: Vec3x8 = Vec3x8::splat(0.0, 1.0, 0.0);

fn words(rng: &mut SplitMix) -> [U32x8; 4] {
    std::array::from_fn(|_| U32x8::from_fn(|_| rng.word()))
}

fn draw(owner: &LightScene, p: Vec3x8, rng: &mut SplitMix) -> LightSample8 {
    let scene = owner.scene();
    sample(&scene, &PowerSelector(scene), p, UP, words(rng), Mask8::all_lanes())
}

fn random_triangle(rng: &mut SplitMix, size: f64) -> [[f32; 3]; 3] {
    let centre: [f64; 3] = std::array::from_fn(|_| rng.range(-2.0, 2.0));
    std::array::from_fn(|_| std::array::from_fn(|k| (centre[k] + rng.range(-size, size)) as f32))
}

/// A light of one triangle among others: follow the sampled direction to the triangle in f64 and ask for the density
/// there. Killed by: the density without cos, with |cos|, with the wrong light's area or selection probability.
#[test]
fn a_ray_that_finds_the_light_gets_the_sampler_density() {
    let mut rng = SplitMix(20);
    let (mut worst, mut compared) = (0.0f64, 0u32);
    for round in 0..400 {
        let size = 10f64.powf(rng.range(-2.0, 1.0));
        let mut owner = LightScene::default();
        let triangles: Vec<_> = (0..5).map(|_| random_triangle(&mut rng, size)).collect();
        for (k, t) in triangles.iter().enumerate() {
            owner = owner.triangle(*t, (k != 2).then_some([1.0 + k as f32, 2.0, 0.5]));
        }
        let owner = owner.finish();
        let scene = owner.scene();
        let selector = PowerSelector(scene);
        for _ in 0..20 {
            let spread = 10f64.powf(rng.range(-1.0, 2.0));
            let p = Vec3x8::from_fn(|_| std::array::from_fn(|_| rng.range(-spread, spread) as f32));
            let s = draw(&owner, p, &mut rng);
            for i in s.valid.lanes() {
                // Which triangle: the one that the sampled point lies on.
                let point = wide(s.point.lane(i));
                let hit = (0..5).min_by(|a, b| {
                    let off = |k: usize| {
                        let [a, b, c] = triangles[k].map(wide);
                        dot(sub(point, a), unit(cross(sub(b, a), sub(c, a)))).abs()
                            + 1e9 * f64::from(u8::from(s.normal.lane(i) != normal(triangles[k])))
                    };
                    off(*a).total_cmp(&off(*b))
                });
                let k = hit.unwrap();
                let (o, d) = (wide(p.lane(i)), wide(s.wi.lane(i)));
                let [a, b, c] = triangles[k].map(wide);
                let cos = -dot(d, unit(cross(sub(b, a), sub(c, a))));
                let r = length(sub(point, o));
                if cos < 5e-3 || r < 1e-3 * length(o) {
                    continue;
                }
                let t = oracle::plane_distance(triangles[k], o, unit(d)) as f32;
                let pdf = area_pdf(
                    &scene,
                    &selector,
                    p,
                    UP,
                    U32x8::splat(k as u32),
                    s.wi,
                    F32x8::splat(t),
                    Mask8::from_bits(1 << i),
                );
                let ratio = f64::from(pdf.lane(i)) / f64::from(s.pdf.lane(i));
                worst = worst.max((ratio - 1.0).abs());
                compared += 1;
                assert!((ratio - 1.0).abs() < 1e-4, "round {round}: {ratio}, cos {cos}, r {r}");
                // Closed form in f64.
                let light = if k < 2 { k } else { k - 1 };
                let selected = f64::from(owner.light_alias[light].probability);
                let want = selected * r * r / (oracle::area(triangles[k]) * cos);
                assert!((f64::from(s.pdf.lane(i)) / want - 1.0).abs() < 2e-4);
                let front = area_radiance(
                    &scene,
                    U32x8::splat(k as u32),
                    s.wi,
                    Vec3x8::from_fn(|_| normal(triangles[k])),
                    Mask8::from_bits(1 << i),
                );
                assert_eq!(front.lane(i), s.radiance.lane(i));
                assert_eq!(front.lane(i), [1.0 + k as f32, 2.0, 0.5]);
                assert_eq!(front.lane(i + 1), [0.0; 3]);
            }
        }
    }
    println!("{compared} compared, largest deviation of the ratio {worst:.1e}");
    assert!(compared > 20_000);
}

/// As the core computes it, to tell triangles apart.
fn normal(t: [[f32; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = t.map(|v| Vec3x8::splat(v[0], v[1], v[2]));
    (b - a).cross(c - a).normalize().lane(0)
}

/// The mean of 1 / pdf is the solid angle. Killed by: any error of the density that does not average out; points not
/// uniform on the triangle.
#[test]
fn inverse_density_integrates_to_the_solid_angle() {
    let mut rng = SplitMix(21);
    for round in 0..12 {
        let t = random_triangle(&mut rng, 1.5);
        let owner = LightScene::default().triangle(t, Some([1.0; 3])).finish();
        let [a, b, c] = t.map(wide);
        let n = unit(cross(sub(b, a), sub(c, a)));
        let p: [f32; 3] =
            std::array::from_fn(|k| ((a[k] + b[k] + c[k]) / 3.0 + 2.0 * n[k] + rng.range(-0.7, 0.7)) as f32);
        let (mut sum, mut sqr, count) = (0.0, 0.0, 160_000.0);
        for _ in 0..count as usize / 8 {
            let s = draw(&owner, Vec3x8::splat(p[0], p[1], p[2]), &mut rng);
            for i in s.valid.lanes() {
                let x = 1.0 / f64::from(s.pdf.lane(i));
                (sum, sqr) = (sum + x, sqr + x * x);
            }
        }
        let mean = sum / count;
        let error = ((sqr / count - mean * mean) / count).sqrt();
        let want = oracle::solid_angle(t, p);
        assert!((mean - want).abs() < 5.0 * error + 2e-6 * want, "round {round}: {mean} +- {error} for {want}");
    }
}

/// Sub-triangles of a 4-fold subdivision (twice) get equal shares. Killed by: barycentrics (u, v (1 - u)) without the
/// square root, or the wrong fold.
#[test]
fn points_are_uniform_on_the_triangle() {
    let owner =
        LightScene::default().triangle([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], Some([1.0; 3])).finish();
    let mut rng = SplitMix(22);
    let n = 8usize;
    let mut counts = vec![0u64; n * n];
    for _ in 0..50_000 {
        let s = draw(&owner, Vec3x8::splat(0.2, 0.3, 4.0), &mut rng);
        assert!(s.valid.all());
        for i in 0..8 {
            let [x, y, _] = wide(s.point.lane(i));
            let (i, j) = ((x * n as f64) as usize, (y * n as f64) as usize);
            let upper = (x * n as f64).fract() + (y * n as f64).fract() > 1.0;
            // Cell (i, j): its lower half at (i, j); upper halves, which need i + j < n - 1, in the mirrored cells.
            let (i, j) = if upper { (n - 1 - i, n - 1 - j) } else { (i, j) };
            counts[i.min(n - 1) * n + j.min(n - 1)] += 1;
        }
    }
    let p = chi_square_in_order(&counts, &vec![400_000.0 / (n * n) as f64; n * n]);
    println!("p = {p:.3}");
    assert!(p > 1e-6, "p = {p}");
}

/// Seen edge-on both the sampler and the density give up, at the same cosine. Killed by: light from the back, cos ->
/// |cos|, `ng` ignored, MIN_COS dropped.
#[test]
fn the_back_is_dark() {
    let t = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let owner = LightScene::default().triangle(t, Some([1.0; 3])).finish();
    let scene = owner.scene();
    let mut rng = SplitMix(23);
    assert!(draw(&owner, Vec3x8::splat(0.2, 0.2, -1.0), &mut rng).valid.none());
    assert!(draw(&owner, Vec3x8::splat(0.2, 0.2, 1.0), &mut rng).valid.all());
    let (zero, all) = (U32x8::splat(0), Mask8::all_lanes());
    let at = Vec3x8::splat(0.2, 0.2, 1.0);
    for (z, lit) in [(1.0f32, false), (-1.0, true), (0.0, false)] {
        let dir = Vec3x8::splat(0.0, (1.0 - z * z).sqrt(), z);
        let ng = Vec3x8::splat(0.0, 0.0, 1.0);
        assert_eq!(area_radiance(&scene, zero, dir, ng, all).lane(3) == [1.0; 3], lit);
        let pdf = area_pdf(&scene, &PowerSelector(scene), at, UP, zero, dir, F32x8::ONE, all);
        assert_eq!(pdf.lane(3) > 0.0, lit);
    }
    // A squared distance that has lost bits is no density.
    for (t, seen) in [(1e-20f32, false), (1.2e-19, true)] {
        let down = Vec3x8::splat(0.0, 0.0, -1.0);
        let pdf = area_pdf(&scene, &PowerSelector(scene), at, UP, zero, down, F32x8::splat(t), all);
        assert_eq!(pdf.lane(3) > 0.0, seen, "t {t}");
    }
    for (cos, seen) in [(9e-7f32, false), (1.1e-6, true)] {
        let pdf = area_pdf(&scene, &PowerSelector(scene), at, UP, zero, Vec3x8::splat(0.0, 1.0, -cos), F32x8::ONE, all);
        assert_eq!(pdf.lane(3) > 0.0, seen, "cos {cos}");
        let from = Vec3x8::splat(0.3, -1e6, 1e6 * cos);
        assert_eq!(draw(&owner, from, &mut rng).valid.all(), seen, "cos {cos}");
    }
}

/// Distances from 0 to 1e20, edge-on views, degenerate triangles: nothing infinite, nothing NaN, and both sides agree
/// that there is no sample. Killed by: dropping the finite test, MIN_COS or the underflow test in one of the two.
#[test]
fn extreme_geometry_gives_no_bad_numbers() {
    let triangles = [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 0.0], [1e-12, 0.0, 0.0], [0.0, 1e-12, 0.0]],
        [[0.0, 0.0, 0.0], [1e12, 0.0, 0.0], [0.0, 1e12, 0.0]],
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        [[0.0; 3]; 3],
        [[1.0, 1.0, 1.0], [1.000_000_1, 1.0, 1.0], [1.0, 1.0, 2.0]],
    ];
    let mut rng = SplitMix(24);
    for t in triangles {
        let owner = LightScene::default().triangle(t, Some([1.0; 3])).select_by(&[1.0]);
        let scene = owner.scene();
        for r in [0.0f32, 1e-30, 1e-20, 1e-18, 1e-10, 1e-6, 1.0, 1e6, 1e15, 1e18, 1e19, 1e20, 1e38] {
            for dir in [[0.0f32, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.0, 1e-9], [1.0, 1.0, 1e-30]] {
                let p = Vec3x8::splat(dir[0] * r, dir[1] * r, dir[2] * r);
                let s = draw(&owner, p, &mut rng);
                assert!(s.pdf.is_finite().all() && s.pdf.ge(F32x8::ZERO).all());
                assert_eq!(s.valid.bits(), s.pdf.gt(F32x8::ZERO).bits());
                assert!((s.wi.is_finite() & (s.wi.length() - 1.0).abs().lt(F32x8::splat(1e-6)) | !s.valid).all());
                let back = Vec3x8::splat(-dir[0], -dir[1], -dir[2]);
                for d in [back, back.normalize(), Vec3x8::splat(f32::NAN, 0.0, 0.0)] {
                    let all = Mask8::all_lanes();
                    let index = U32x8::splat(0);
                    let pdf = area_pdf(&scene, &PowerSelector(scene), p, UP, index, d, F32x8::splat(r), all);
                    assert!(pdf.is_finite().all() && pdf.ge(F32x8::ZERO).all(), "{t:?} {r} {dir:?}: {pdf:?}");
                }
            }
        }
    }
}

/// NUMERICS OFF-1's bound in f64. Killed by: 32 u -> u, normal without absolute values.
#[test]
fn point_error_is_the_stated_bound() {
    let t = [[1000.0f32, 1e-7, -3.0], [1001.0, 0.5, -3.5], [1000.0, 1.0, -2.0]];
    let owner = LightScene::default().triangle(t, Some([1.0; 3])).finish();
    let [a, b, c] = t.map(wide);
    let n = unit(cross(sub(b, a), sub(c, a)));
    let mut rng = SplitMix(25);
    let p: [f32; 3] = std::array::from_fn(|k| (a[k] + 2.0 * n[k]) as f32);
    let s = draw(&owner, Vec3x8::splat(p[0], p[1], p[2]), &mut rng);
    assert!(s.valid.all());
    for i in 0..8 {
        let q = wide(s.point.lane(i));
        let whole = length(cross(sub(b, a), sub(c, a)));
        let weight = |x, y| dot(cross(sub(x, q), sub(y, q)), n) / whole;
        let projected = |v: [f64; 3]| (0..3).map(|k| (v[k] * n[k]).abs()).sum::<f64>();
        let sum = weight(b, c) * projected(a) + weight(c, a) * projected(b) + weight(a, b) * projected(c);
        let want = 32.0 * sum / f64::from(1u32 << 24);
        assert!((f64::from(s.point_error.lane(i)) / want - 1.0).abs() < 1e-3);
        let off = dot(sub(q, a), n).abs();
        assert!(off < want, "{off} off the plane, bound {want}");
    }
}

/// Killed by: r instead of r^2, 4 pi in the irradiance, the direction away from the light, missing flags, squared
/// distances without a least one.
#[test]
fn delta_lights_have_their_closed_forms() {
    let owner = LightScene::default()
        .delta(LightKind::Point, [1.0, 2.0, 3.0], [8.0, 4.0, 2.0])
        .delta(LightKind::Directional, [0.6, 0.0, -0.8], [0.5, 0.25, 1.0])
        .select_by(&[1.0, 3.0]);
    let mut rng = SplitMix(26);
    let mut seen = [0; 2];
    for _ in 0..1000 {
        let p = Vec3x8::from_fn(|_| std::array::from_fn(|_| rng.range(-9.0, 9.0) as f32));
        let s = draw(&owner, p, &mut rng);
        assert!(s.valid.all() && s.delta.all());
        for i in 0..8 {
            let d = sub([1.0, 2.0, 3.0], wide(p.lane(i)));
            if s.infinite.lane(i) {
                seen[1] += 1;
                assert_eq!(s.wi.lane(i), [0.6, 0.0, -0.8]);
                assert_eq!(s.radiance.lane(i), [0.5, 0.25, 1.0]);
                assert_eq!(s.pdf.lane(i), 0.75);
            } else {
                seen[0] += 1;
                assert!(length(sub(wide(s.wi.lane(i)), unit(d))) < 3e-7);
                for (got, intensity) in wide(s.radiance.lane(i)).into_iter().zip([8.0, 4.0, 2.0]) {
                    assert!((got * dot(d, d) / intensity - 1.0).abs() < 2e-6);
                }
                assert_eq!(s.point.lane(i), [1.0, 2.0, 3.0]);
                assert_eq!(s.pdf.lane(i), 0.25);
            }
        }
    }
    assert!(chi_square_in_order(&seen, &[2000.0, 6000.0]) > 1e-6);
    // At the light itself no direction; nearby a clamped irradiance; far away none.
    for (offset, valid) in [(0.0, false), (1e-25, true), (1e-11, true), (1e6, true), (1e25, false)] {
        let owner = LightScene::default().delta(LightKind::Point, [0.0; 3], [1.0; 3]).finish();
        let s = draw(&owner, Vec3x8::splat(offset, 0.0, 0.0), &mut rng);
        assert_eq!(s.valid.all(), valid, "{offset}");
        assert_eq!([s.clamped.any(), s.clamped.all()], [offset < 1e-10; 2], "{offset}");
        assert!(s.radiance.is_finite().all() && s.pdf.is_finite().all());
        assert!(
            !valid || offset > 1e-10 || s.radiance.x.eq(1.0 / F32x8::splat(1e-20)).all(),
            "{offset}: {:?}",
            s.radiance.x
        );
    }
}

/// Lanes outside the mask may hold anything and change nothing. Killed by: gathering with unmasked indices.
#[test]
fn garbage_lanes_are_harmless() {
    let t = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let owner = LightScene::default()
        .triangle(t, Some([1.0; 3]))
        .delta(LightKind::Point, [0.0, 0.0, 2.0], [1.0; 3])
        .constant([0.5; 3])
        .finish();
    let scene = owner.scene();
    let selector = PowerSelector(scene);
    let mut rng = SplitMix(27);
    for bits in 0..256 {
        let mask = Mask8::from_bits(bits);
        let w = words(&mut rng);
        let good = Vec3x8::splat(0.3, 0.1, 1.0);
        let bad = Vec3x8::splat(f32::NAN, f32::INFINITY, -1e38);
        let mixed = Vec3x8::select(mask, good, bad);
        let clean = sample(&scene, &selector, good, UP, w, Mask8::all_lanes());
        let s = sample(&scene, &selector, mixed, mixed, w, mask);
        assert_eq!(s.valid.bits(), clean.valid.bits() & bits);
        let index = U32x8::select(mask, U32x8::splat(0), U32x8::splat(u32::MAX - 3));
        let down = Vec3x8::select(mask, Vec3x8::splat(0.0, 0.0, -1.0), bad);
        let pdf = area_pdf(&scene, &selector, mixed, mixed, index, down, mixed.z, mask);
        let radiance = area_radiance(&scene, index, down, Vec3x8::splat(0.0, 0.0, 1.0), mask);
        for i in 0..8 {
            if mask.lane(i) {
                assert_eq!(s.wi.lane(i), clean.wi.lane(i));
                assert_eq!(s.pdf.lane(i), clean.pdf.lane(i));
                assert!(pdf.lane(i) > 0.0 && radiance.lane(i) == [1.0; 3]);
            } else {
                assert_eq!((s.pdf.lane(i), s.radiance.lane(i)), (0.0, [0.0; 3]));
                assert_eq!((pdf.lane(i), radiance.lane(i)), (0.0, [0.0; 3]));
            }
        }
    }
}

/// Special values squared: in [0, 1], and the two weights sum to 1. Killed by: squaring before dividing.
#[test]
fn power_heuristic_is_a_partition() {
    let special = [0.0f32, 1e-45, 1e-38, 1e-30, 1e-23, 1e-10, 0.5, 1.0, 3.0, 1e10, 1.8e19, 1e30, f32::MAX];
    for f in special {
        for g in special {
            let w = |a, b| power_heuristic(F32x8::splat(a), F32x8::splat(b)).lane(5);
            let (a, b) = (w(f, g), w(g, f));
            assert!((0.0..=1.0).contains(&a));
            if f > 0.0 || g > 0.0 {
                assert!((a + b - 1.0).abs() <= 2e-7, "{f} {g}: {a} {b}");
                let want = f64::from(f).powi(2) / (f64::from(f).powi(2) + f64::from(g).powi(2));
                // Subnormal ratios carry few bits, and their squares none.
                assert!((f64::from(a) - want).abs() < 3e-7, "{f} {g}: {a} for {want}");
            } else {
                assert_eq!(a, 0.0);
            }
        }
    }
    for bad in [f32::NAN, -1.0] {
        assert_eq!(power_heuristic(F32x8::splat(bad), F32x8::ONE).lane(0), 0.0);
        assert_eq!(power_heuristic(F32x8::ONE, F32x8::splat(f32::NAN)).lane(0), 0.0);
    }
}
