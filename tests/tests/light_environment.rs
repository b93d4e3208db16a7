//! Environment maps and the constant environment against the f64 oracle.

use croupier::unstable::light::{PowerSelector, environment_pdf, environment_radiance};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::environment::{HERE, SCALE, cases, random_words};
use croupier_tests::hard::sampling::{Environments, environment};
use croupier_tests::hit::sample;
use croupier_tests::light_oracle::{Map, V, length, luminance, wide};
use croupier_tests::light_scene::{IDENTITY, LightScene};
use croupier_tests::stats::{SplitMix, chi_square_in_order};
use std::f64::consts::{PI, TAU};

/// Directions in map space, the hard ones first.
fn directions(rng: &mut SplitMix, n: usize) -> Vec<V> {
    let mut out = vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [-0.0, 0.0, 1.0]];
    for e in [1e-30, 1e-20, 1e-10, 1e-7, 1e-5, 1e-3] {
        for y in [1.0, -1.0] {
            out.extend([[e, y, 0.0], [-e, y, e], [0.0, y, -e], [-e, y, -e]]);
        }
        // Both sides of where the columns wrap (u = 0) and of the opposite meridian.
        out.extend([[e, 0.5, -0.8], [-e, 0.5, -0.8], [e, 0.5, 0.8], [-e, 0.5, 0.8]]);
    }
    while out.len() < n {
        out.push(rng.direction());
    }
    out.truncate(n / 8 * 8);
    out
}

/// 1e5 directions over seven maps. The place is a rounded f32 angle: the error is that times the slope of the map.
/// Killed by: z for -z, u without the 1/2 texel, rows at texel centres, v flipped, no wrap, the transposed rotation,
/// the scale left out.
#[test]
fn radiance_agrees_with_the_oracle() {
    let mut rng = SplitMix(32);
    for case in cases() {
        let [w, h] = case.map.cells().map(|n| n as f64);
        let mut worst = 0.0f64;
        for eight in directions(&mut rng, 14_400).chunks(8) {
            let d = Vec3x8::from_fn(|i| case.world(eight[i]));
            let d = d.normalize();
            let got = case.radiance(d);
            for i in 0..8 {
                let local = case.local(d.lane(i));
                let at = case.map.at(local);
                let sine = local[0].hypot(local[2]).max(1e-12);
                // Positions: 6e-7 rad and an ulp or two of the turn. A rotation rounds its result, which near a pole
                // leaves less of the azimuth; without one the poles are as accurate as the rest.
                let rounded = if case.to_local == IDENTITY { 0.0 } else { 2.5e-7 / sine };
                let place = 6e-7 * h / PI + (6e-7 + rounded) * w / TAU + 2e-7 * (w + h);
                let want = case.map.lookup(local).map(|c| c * f64::from(SCALE));
                // Beyond the cell's edge the neighbour's slope counts: the wider contrast of the whole map if need be.
                let near_edge = [at.x, 1.0 - at.x, at.y, 1.0 - at.y].iter().any(|x| *x < place);
                let contrast = match place {
                    p if p > 0.5 => (0..case.map.cells()[0]).map(|c| around(&case.map, c, at.row)).fold(0.0, f64::max),
                    _ if near_edge => around(&case.map, at.column, at.row),
                    _ => case.map.contrast(at),
                };
                for c in 0..3 {
                    let bound = f64::from(SCALE) * contrast * place.min(1.0) + 5e-7 * want[c];
                    let error = (f64::from(got.lane(i)[c]) - want[c]).abs();
                    worst = worst.max(error / bound.max(1e-30));
                    assert!(error <= bound, "{}: {:?}: {:?} for {want:?}", case.name, local, got.lane(i));
                }
            }
        }
        println!("{}: largest error {worst:.2} of the bound", case.name);
    }
}

/// Largest contrast of a cell and its neighbours.
fn around(map: &Map, column: usize, row: usize) -> f64 {
    let [w, h] = map.cells();
    let mut most = 0.0f64;
    for i in [w - 1, 0, 1] {
        for j in row.saturating_sub(1)..=(row + 1).min(h - 1) {
            let at = map.at(map.direction((column + i) % w, j, 0.5, 0.5));
            most = most.max(map.contrast(at));
        }
    }
    most
}

/// Integral of the density over the sphere: 2 x 2 Gauss points are exact for what is bilinear in a cell; against the
/// oracle's density at each of them. Killed by: a 1 / sin theta, the cell's solid angle from its middle, the share of
/// the solid angle replaced by the row's linear coordinate, not normalising by the corners' mean.
#[test]
fn density_is_normalised_and_agrees_with_the_oracle() {
    let gauss = [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()];
    for case in cases().iter().filter(|c| c.name != "fine") {
        let [w, _] = case.map.cells();
        let probability = case.map.probabilities();
        let mut integral = 0.0;
        for (k, probability) in probability.iter().copied().enumerate() {
            let (i, j) = (k % w, k / w);
            let [above, below] = case.map.cosines(j);
            let solid_angle = (above - below) * TAU / w as f64;
            let points = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(a, b)| (gauss[a], gauss[b]));
            let d = Vec3x8::from_fn(|l| {
                let (x, t) = points[l & 3];
                case.world(case.map.direction(i, j, x, t))
            });
            let pdf = case.pdf(d.normalize());
            for (l, (x, t)) in points.into_iter().enumerate() {
                let got = f64::from(pdf.lane(l)) / 0.75;
                integral += got * solid_angle / 4.0;
                let want = probability * if probability > 0.0 { case.map.inside(i, j, x, t) } else { 0.0 };
                let want = want / solid_angle;
                assert!((got - want).abs() <= 1e-4 * want + 1e-7, "{} cell {i}, {j}: {got} for {want}", case.name);
            }
        }
        println!("{}: integral {integral:.7}", case.name);
        assert!((integral - 1.0).abs() < 2e-5, "{}: {integral}", case.name);
    }
}

/// Random directions and the poles on the fine map (2048 x 1024): where differences of cosines would lose everything.
/// Killed by: cos a - cos b computed as a difference.
#[test]
fn density_is_accurate_near_the_poles_of_a_fine_map() {
    let cases = cases();
    let case = cases.iter().find(|c| c.name == "fine").unwrap();
    let [w, h] = case.map.cells();
    let tables = &case.owner.env_alias;
    let mut worst = 0.0f64;
    for j in [0, 1, 2, 5, 40, h / 2, h - 3, h - 2, h - 1] {
        for i in (0..w).step_by(97) {
            let places =
                [(0.5, 0.5), (0.3, 0.25), (0.7, 0.75), (0.5, 0.1), (0.2, 0.9), (0.9, 0.4), (0.4, 0.6), (0.6, 0.3)];
            let d = Vec3x8::from_fn(|l| case.world(case.map.direction(i, j, places[l].0, places[l].1)));
            let pdf = case.pdf(d.normalize());
            for (l, (x, t)) in places.into_iter().enumerate() {
                // sin form of the cell's solid angle: the oracle's difference of cosines is good to 1e-10 of it.
                let step = PI / h as f64;
                let solid_angle = 2.0 * ((j as f64 + 0.5) * step).sin() * (step / 2.0).sin() * TAU / w as f64;
                let cell = f64::from(tables[j].probability) * f64::from(tables[h + j * w + i].probability);
                let want = cell * case.map.inside(i, j, x, t) / solid_angle;
                let got = f64::from(pdf.lane(l)) / 0.75;
                if want == 0.0 {
                    assert_eq!(got, 0.0, "cell {i}, {j} is not above the mean");
                    continue;
                }
                worst = worst.max((got / want - 1.0).abs());
                // Rounded directions lie up to 1e-7 rad off: 3e-5 rows, and the corners differ by up to 30 to 1.
                assert!((got / want - 1.0).abs() < 2e-3, "cell {i}, {j} at {x}, {t}: {got} for {want}");
            }
        }
    }
    println!("largest relative error {worst:.1e}");
}

/// Samples over 3 x 3 parts of every cell against the oracle's probabilities. Killed by: sampling uniformly in a cell,
/// exchanging its corners, the wrong pole in `Band`, tables of another row.
#[test]
fn samples_follow_the_density() {
    for case in cases().iter().filter(|c| c.name != "fine") {
        let Environments { p, strays, total } = environment(case, 33, 80_000);
        assert!(strays <= total / 50_000, "{}: {strays} samples in cells that are never picked", case.name);
        println!("{}: {total} samples, p = {p:.3}", case.name);
        assert!(p > 1e-6, "{}: p = {p}", case.name);
        // Three quarters choose the environment, and every one of these gives a sample.
        assert!((total as f64 / 640_000.0 - 0.75).abs() < 0.003);
    }
}

/// What a sample states is what its direction gives: bit for bit. The estimate L / pdf of all cells that are picked is
/// right, also with a sun of one texel; with uniform directions as the other technique and MIS weights the estimate of
/// the whole is right. Killed by: stating the density of the place in the cell instead of the direction's, leaving out the
/// selection probability on one side, a density above 0 in cells that are never picked.
#[test]
fn samples_state_what_their_direction_gives() {
    let mut rng = SplitMix(34);
    for case in cases() {
        let [w, h] = case.map.cells();
        let (mut sum, mut sqr, n) = (0.0, 0.0, 160_000.0);
        let mut both = [0.0; 2];
        let uniform = 1.0 / (4.0 * PI);
        let heuristic = |own: f64, other: f64| own * own / (own * own + other * other);
        for _ in 0..20_000 {
            let s = case.draw(random_words(&mut rng));
            let d = Vec3x8::from_fn(|_| case.world(rng.direction())).normalize();
            let [pdf_d, radiance_d] = [case.pdf(d).to_array(), case.radiance(d).luminance().to_array()];
            for i in 0..8 {
                let mut x = f64::from(radiance_d[i]) / uniform * heuristic(uniform, f64::from(pdf_d[i]));
                if s.valid.lane(i) && s.infinite.lane(i) {
                    let p = f64::from(s.pdf.lane(i));
                    x += luminance(wide(s.radiance.lane(i))) / p * heuristic(p, uniform);
                }
                (both[0], both[1]) = (both[0] + x, both[1] + x * x);
            }
            let (pdf, radiance) = (case.pdf(s.wi), case.radiance(s.wi));
            for i in (s.valid & s.infinite).lanes() {
                assert_eq!(pdf.lane(i).to_bits(), s.pdf.lane(i).to_bits(), "{}", case.name);
                assert_eq!(radiance.lane(i), s.radiance.lane(i));
                assert!((length(wide(s.wi.lane(i))) - 1.0).abs() < 5e-7);
                assert!(!s.delta.lane(i));
                let x = luminance(wide(s.radiance.lane(i))) / f64::from(s.pdf.lane(i));
                (sum, sqr) = (sum + x, sqr + x * x);
            }
        }
        let tables = &case.owner.env_alias;
        let picked = |k: usize| tables[k / w].probability > 0.0 && tables[h + k].probability > 0.0;
        let (mut want, mut whole) = (0.0, 0.0);
        for k in 0..w * h {
            let integral = f64::from(SCALE) * quick_integral(&case.map, k % w, k / w);
            whole += integral;
            want += if picked(k) { integral } else { 0.0 };
        }
        let check = |what: &str, want: f64, sum: f64, sqr: f64, n: f64| {
            let mean = sum / n;
            let error = (sqr / n - mean * mean).max(0.0).sqrt() / n.sqrt();
            println!("{}, {what}: {mean:.5} +- {error:.5} for {want:.5}", case.name);
            assert!((mean - want).abs() < 5.0 * error + 1e-5 * want, "{}, {what}: {mean} for {want}", case.name);
            // a tail of cells that are picked rarely must not hide that
            assert!(error < 0.02 * want, "{}, {what}: +- {error}", case.name);
        };
        check("light samples", want, sum, sqr, n);
        check("both techniques", whole, both[0], both[1], n);
    }
}

/// Integral of the luminance over a cell by Simpson's rule in the polar angle.
fn quick_integral(map: &Map, i: usize, j: usize) -> f64 {
    let [w, h] = map.cells();
    let (n, step) = (if h < 20 { 64 } else { 4 }, PI / h as f64);
    let row = |j: usize| (luminance(map.texel(i, j)) + luminance(map.texel(i + 1, j))) / 2.0;
    (0..=n)
        .map(|k| {
            let (y, weight) =
                (f64::from(k) / f64::from(n), if k == 0 || k == n { 1.0 } else { f64::from(2 + k % 2 * 2) });
            (row(j) * (1.0 - y) + row(j + 1) * y) * ((j as f64 + y) * step).sin() * weight
        })
        .sum::<f64>()
        / f64::from(3 * n)
        * step
        * TAU
        / w as f64
}

/// Extreme random numbers. Killed by: 0 / 0 in `sample_linear`, an index one too large.
#[test]
fn extreme_random_numbers_are_safe() {
    let special =
        [0u32, 1, 0xff, 0x100, 0xffff, 0x1_0000, 0x7fff_ffff, 0x8000_0000, 0xffff_0000, 0xffff_ff00, u32::MAX];
    for case in cases() {
        for r in special {
            for c in special {
                for k in (0..special.len()).step_by(8) {
                    let last = U32x8::from_fn(|i| special[(k + i) % special.len()]);
                    let s = case.draw([U32x8::splat(u32::MAX), U32x8::splat(r), U32x8::splat(c), last]);
                    assert!(s.pdf.is_finite().all() && s.radiance.is_finite().all() && s.wi.is_finite().all());
                    assert!((s.wi.length() - 1.0).abs().lt(F32x8::splat(1e-6)).all());
                    for i in 0..8 {
                        assert_eq!(s.valid.lane(i), s.pdf.lane(i) > 0.0);
                    }
                }
            }
        }
        for v in [f32::NAN, f32::INFINITY, -1e38, 0.0, 1e-45] {
            for d in [Vec3x8::splat(v, v, v), Vec3x8::splat(v, 1.0, 0.0), Vec3x8::splat(0.0, v, 1.0)] {
                let _ = case.radiance(d);
                assert!(case.pdf(d).is_finite().all());
            }
        }
    }
}

/// A black map, with the tables that it gets and with a selector that insists. Killed by: dividing by the mean of a
/// black cell, uniform tables for a black map.
#[test]
fn a_black_map_is_never_sampled() {
    let owner = LightScene::default().map(vec![[0.0; 3]; 12], [4, 3], 1.0, IDENTITY).select_by(&[1.0]);
    assert!(owner.env_alias.is_empty());
    let unlit = LightScene::default().map(vec![[0.0; 3]; 12], [4, 3], 1.0, IDENTITY).finish();
    assert!(unlit.light_alias.is_empty());
    let mut rng = SplitMix(35);
    for owner in [owner, unlit] {
        let scene = owner.scene();
        let selector = PowerSelector(scene);
        for _ in 0..100 {
            let s = sample(&scene, &selector, HERE, HERE, random_words(&mut rng), Mask8::all_lanes());
            assert!(s.valid.none());
            let d = Vec3x8::from_fn(|_| rng.direction().map(|x| x as f32));
            let pdf = environment_pdf(&scene, &selector, HERE, HERE, d, Mask8::all_lanes());
            assert_eq!(pdf.to_array(), [0.0; 8]);
            assert_eq!(environment_radiance(&scene, d, Mask8::all_lanes()), Vec3x8::ZERO);
        }
    }
}

/// Uniform over the sphere: 12 bands of equal area x 12 sectors; density 1 / 4 pi. Killed by: a hemisphere, uniform
/// polar angle, 1 / 2 pi.
#[test]
fn the_constant_environment_is_a_uniform_sphere() {
    let owner = LightScene::default().constant([0.5, 1.0, 2.0]).finish();
    let scene = owner.scene();
    let selector = PowerSelector(scene);
    let mut rng = SplitMix(36);
    let mut counts = vec![0u64; 144];
    for _ in 0..40_000 {
        let s = sample(&scene, &selector, HERE, HERE, random_words(&mut rng), Mask8::all_lanes());
        assert!(s.valid.all() && s.infinite.all() && s.delta.none());
        assert_eq!(environment_pdf(&scene, &selector, HERE, HERE, s.wi, Mask8::all_lanes()), s.pdf);
        for i in 0..8 {
            assert!((f64::from(s.pdf.lane(i)) * 4.0 * PI - 1.0).abs() < 1e-6);
            assert_eq!(s.radiance.lane(i), [0.5, 1.0, 2.0]);
            let d = wide(s.wi.lane(i));
            assert!((length(d) - 1.0).abs() < 5e-7);
            let band = (((d[1] + 1.0) * 6.0) as usize).min(11);
            let sector = (((d[2].atan2(d[0]) / TAU).rem_euclid(1.0) * 12.0) as usize).min(11);
            counts[band * 12 + sector] += 1;
        }
    }
    let p = chi_square_in_order(&counts, &[320_000.0 / 144.0; 144]);
    println!("p = {p:.3}");
    assert!(p > 1e-6, "p = {p}");
    let some = environment_radiance(&scene, Vec3x8::splat(f32::NAN, 0.0, 0.0), Mask8::from_bits(2));
    assert_eq!((some.lane(0), some.lane(1)), ([0.0; 3], [0.5, 1.0, 2.0]));
}
