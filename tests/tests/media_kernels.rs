//! Flights and transmittances in media against f64 oracles: closed forms, and quadrature of the density of grids.
//!
//! Every z-test allows 5 standard errors: one false alarm in 1.7e6 comparisons, of which there are a few hundred. With
//! 2^18 samples a test of a mean of 0.3 by a variable in 0..=1 sees errors of 1.5 % of it, five errors of 0.3 %.

use croupier::unstable::Numbers8;
use croupier::unstable::media::*;
use croupier::unstable::rng::Key8;
use croupier::unstable::scene::Effects;
use croupier::unstable::scene::blob::MAX_COEFFICIENT;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::media_flights::*;
use croupier_tests::media_oracle::*;
use croupier_tests::stats::{Mean, SplitMix};

const EVEN_ONLY: Effects = Effects::MEDIA;
const SAMPLES: u32 = 1 << 18;

/// Distances through a grey medium of extinction 2.5, direction of length 4: Kolmogorov-Smirnov at 1e-6, first and second
/// moment within 5 standard errors of 2^20 flights (0.5 % and 2.2 %). One step each.
/// Killed by: the length of the direction forgotten or squared; sigma_s in place of sigma_t; two keys alike.
#[test]
fn free_flights_are_exponential() {
    let scene = MediaScene::default().with(homogeneous([0.5; 3], [2.0; 3], [0.0; 3]));
    let s = segment([1.0, 2.0, 3.0], [0.0, 4.0, 0.0], f64::INFINITY);
    let n = 1 << 20;
    let (mut all, mut mean, mut square) = (vec![], Mean::default(), Mean::default());
    let work = flights(&scene.scene(), 0, &s, [1.0; 3], 1, n, |e| {
        assert!(e.collided && e.weight == [1.0; 3]);
        let tau = e.t * 4.0 * 2.5;
        all.push(tau);
        mean.add(tau);
        square.add(tau * tau);
    });
    assert_eq!(work.steps, u64::from(n));
    z_test("mean", &mean, n, 1.0);
    z_test("mean square", &square, n, 2.0);
    all.sort_by(f64::total_cmp);
    let far = |(i, tau): (usize, &f64)| {
        let cdf = -(-tau).exp_m1();
        (cdf - i as f64 / f64::from(n)).abs().max((cdf - (i + 1) as f64 / f64::from(n)).abs())
    };
    let d = all.iter().enumerate().map(far).fold(0.0, f64::max) * f64::from(n).sqrt();
    assert!(d < 2.7, "Kolmogorov-Smirnov: {d}");
}

/// Extinction from 1e-20 to 1e20 (beyond what scenes may have) over thickness 1: exp(-sigma) within 1e-5 relative down to
/// 2^-126, 0 below 2^-150; flights pass as often, and end in three steps at most.
/// Killed by: 0 x infinity along segments without an end; infinity / infinity; flights that wait for t to grow.
#[test]
fn homogeneous_media_over_all_exponents() {
    for power in -20..=20 {
        for mantissa in [1.0f32, 3.0] {
            let sigma = mantissa * 10f32.powi(power);
            let medium = homogeneous([sigma * 0.5, 0.0, 0.0], [sigma * 0.5, sigma, 0.0], [1.0; 3]);
            let scene = MediaScene::default().with(medium);
            let scene = scene.scene();
            let s = segment([0.0; 3], [0.0, 0.0, -0.5], 2.0);
            let got = transmittance(ALL, &scene, U32x8::splat(0), &s, Numbers8::hashed(key(5, 0)), Mask8::first(7));
            let want = (-f64::from(sigma)).exp();
            for c in 0..2 {
                let t = f64::from(got.transmittance.lane(3)[c]);
                assert!((t - want).abs() <= 1e-5 * want.max(1.2e-38), "sigma {sigma}: {t} for {want}");
            }
            assert_eq!((got.transmittance.lane(0)[2], got.transmittance.lane(7)), (1.0, [0.0; 3]));
            let mut means = Means::default();
            let work = flights(&scene, 0, &s, [1.0; 3], 6, 1 << 14, |e| means.add(e));
            means.check(&format!("sigma {sigma}"), 1 << 14, &medium, [f64::from(sigma), f64::from(sigma), 0.0]);
            assert!(work.steps <= 3 << 14 && work.roulettes == 0);
            let endless = Segment8 { tmax: F32x8::INFINITY, ..s };
            let got =
                transmittance(ALL, &scene, U32x8::splat(0), &endless, Numbers8::hashed(key(5, 0)), Mask8::all_lanes());
            assert_eq!(got.transmittance.lane(0), [0.0, 0.0, 1.0]);
        }
    }
}

/// Without scattering: closed forms of weight and emission, no random number, no step. Killed by: 1 - exp(-tau) of small
/// tau; emission per length in place of its integral; a lane that passes with nothing left.
#[test]
fn absorbing_media_are_analytic() {
    for tau in [1e-9, 1e-6, 1e-3, 0.1, 0.124, 0.126, 1.0, 20.0, 200.0] {
        let medium = homogeneous([tau as f32, 0.0, 2.0 * tau as f32], [0.0; 3], [2.0, 3.0, 0.5]);
        let scene = MediaScene::default().with(medium);
        let s = segment([1.0, 0.0, 0.0], [0.0, 2.0, 0.0], 0.5);
        let work = flights(&scene.scene(), 0, &s, [1.0, 2.0, 0.5], 3, 8, |e| {
            assert!(e.passed && e.t == 0.5);
            for (c, tau) in [(0, f64::from(tau as f32)), (2, 2.0 * f64::from(tau as f32))] {
                assert!((e.weight[c] - (-tau).exp()).abs() <= 1e-5 * (-tau).exp().max(1.2e-38));
                let emitted = f64::from(medium.emission[c]) * -(-tau).exp_m1();
                assert!((e.emitted[c] / emitted - 1.0).abs() < 5e-7, "{tau}: {} {emitted}", e.emitted[c]);
            }
            assert_eq!((e.weight[1], e.emitted[1]), (1.0, 0.0));
        });
        assert_eq!((work.steps, work.roulettes), (0, 0));
        let endless = segment([1.0, 0.0, 0.0], [0.0, 2.0, 0.0], f64::INFINITY);
        flights(&scene.scene(), 0, &endless, [1.0; 3], 3, 8, |e| {
            assert!(e.passed && e.weight == [0.0, 1.0, 0.0]);
            assert!((e.emitted[0] - 2.0).abs() < 1e-6 && (e.emitted[2] - 0.5).abs() < 1e-6);
        });
        // the only channel that passes is none of the path's
        flights(&scene.scene(), 0, &endless, [1.0, 0.0, 3.0], 3, 8, |e| {
            assert!(!e.passed && !e.collided && e.weight == [0.0; 3]);
            assert!((e.emitted[0] - 2.0).abs() < 1e-6);
        });
    }
}

/// Ratio tracking and delta tracking through a random grid, in both directions, against exp of the quadrature; scattering
/// and emission against their closed forms. No roulette by the bound of work.
/// Killed by: a brick that is skipped or entered twice; majorants of the neighbour; the optical depth not carried across
/// bricks; cell corners in place of centres; the length of the direction.
#[test]
fn grids_pass_what_quadrature_says() {
    let medium = homogeneous([0.4, 0.9, 0.1], [1.1, 0.6, 0.4], [1.0, 0.5, 3.0]);
    let all = random_grid(medium, 11);
    let scene = all.scene();
    for (n, (o, d, tmax)) in segments().into_iter().enumerate() {
        let last = end(tmax);
        let other_end: V = std::array::from_fn(|i| o[i] + last * d[i]);
        let back = (other_end, d.map(|x| -x), last);
        for (way, (o, d, tmax)) in [("forth", (o, d, tmax)), ("back", back)] {
            // what f32 makes of the segment is what it is
            let (o, d) = (o.map(|x| f64::from(x as f32)), d.map(|x| f64::from(x as f32)));
            let what = format!("segment {n} {way}");
            let length = thickness(&all, 0, (o, d, tmax));
            let tau: V = std::array::from_fn(|c| f64::from(medium.sigma_a[c] + medium.sigma_s[c]) * length);
            let s = segment(o, d, tmax);
            let (means, work) = mean_transmittance(&scene, 0, &s, 100 + n as u64, SAMPLES);
            (0..3).for_each(|c| z_test(&format!("{what}, ratio, {c}"), &means[c], SAMPLES, (-tau[c]).exp()));
            assert_eq!(work.roulettes, 0);
            let mut means = Means::default();
            let work = flights(&scene, 0, &s, [1.0; 3], 200 + n as u64, SAMPLES, |e| {
                assert!(!e.collided || e.t >= 0.0 && e.t <= tmax);
                means.add(e);
            });
            means.check(&what, SAMPLES, &medium, tau);
            assert_eq!(work.roulettes, 0);
            assert!(means.largest < 3.0001, "{what}: {}", means.largest);
            println!("{what}: tau {tau:.3?}, {:.1} steps a flight", work.steps as f64 / f64::from(SAMPLES));
        }
    }
}

/// A segment in two parts at any point passes what the whole passes, and what a flight does in the first part does not
/// depend on where the segment ends. Killed by: majorants of the whole segment; a part that begins a brick late.
#[test]
fn splitting_a_segment_changes_nothing() {
    let all = random_grid(homogeneous([0.2; 3], [0.9; 3], [0.0; 3]), 12);
    let scene = all.scene();
    let (o, d) = ([-2.0, 0.2, 1.5], [3.0, 1.4, 3.3]);
    let want = (-1.1f32 as f64 * thickness(&all, 0, (o, d, 1.2))).exp();
    for (k, at) in [0.05, 0.33, 0.5, 0.617, 0.8, 1.1].into_iter().enumerate() {
        let middle: V = std::array::from_fn(|i| o[i] + at * d[i]);
        let (first, second) = (segment(o, d, at), segment(middle, d, 1.2 - at));
        let (mut product, mut flown) = (Mean::default(), Mean::default());
        for packet in 0..SAMPLES / 8 {
            let (a, b) = (key(300 + k as u64, packet), key(400 + k as u64, packet));
            let of = |s: &Segment8, key| {
                transmittance(ALL, &scene, U32x8::splat(0), s, Numbers8::hashed(key), Mask8::all_lanes())
            };
            let both = of(&first, a).transmittance.x * of(&second, b).transmittance.x;
            let fly = |s: &Segment8, key| {
                fly(ALL, &scene, U32x8::splat(0), s, Vec3x8::ONE, Numbers8::hashed(key), Mask8::all_lanes())
            };
            let (f, g) = (fly(&first, a), fly(&second, b));
            assert!(f.unfinished.none() && g.unfinished.none());
            let passed = (f.passed & g.passed).zero_unless(f.weight.x * g.weight.x);
            let whole = fly(&segment(o, d, 1.2), a);
            // the same numbers lead to the same collisions until the first part ends
            for i in f.collided.lanes() {
                assert!(whole.collided.lane(i) && whole.t.lane(i) == f.t.lane(i));
            }
            (0..8).for_each(|i| product.add(f64::from(both.lane(i))));
            (0..8).for_each(|i| flown.add(f64::from(passed.lane(i))));
        }
        z_test(&format!("ratio, split at {at}"), &product, SAMPLES, want);
        z_test(&format!("delta, split at {at}"), &flown, SAMPLES, want);
    }
}

/// Media opaque in red: weights with the albedo stay below the sum of the path's channels over each of them, means per
/// channel are right, and red costs no steps once it is gone. Killed by: a choice by one channel (weights of 1e3), by the
/// sum without the path's weight, a majorant that keeps red.
#[test]
fn chromatic_media_have_bounded_weights() {
    let medium = homogeneous([0.0, 0.3, 0.1], [1000.0, 0.7, 0.2], [5.0, 1.0, 2.0]);
    let ones = vec![1.0; 5 * 7 * 9];
    let cube = [[0.0; 3], [1.0; 3]];
    let all = MediaScene::default().with(medium).with_grid(medium, cube, [5, 7, 9], &ones);
    let s = segment([0.5, 0.5, -1e-3], [0.0, 0.0, 1.0], 1.0);
    let tau: V = std::array::from_fn(|c| f64::from(medium.sigma_a[c] + medium.sigma_s[c]));
    for (m, beta) in [(0, [1.0; 3]), (0, [1.0, 1e-3, 0.0]), (0, [1e-3, 1.0, 20.0]), (1, [1.0; 3]), (1, [0.0, 3.0, 1.0])]
    {
        let mut means = Means::default();
        let mut largest = 0.0f64;
        let work = flights(&all.scene(), m, &s, beta, 30 + u64::from(m), SAMPLES, |e| {
            let mut sum = 0.0;
            for (c, beta_c) in beta.into_iter().enumerate() {
                let w = if e.collided { e.weight[c] * e.albedo[c] } else { e.weight[c] };
                sum += beta_c * w;
                assert!(beta_c > 0.0 || w == 0.0);
            }
            largest = largest.max(sum / beta.iter().sum::<f64>());
            means.add(e);
        });
        assert!(largest < 1.0001, "{beta:?}: sum of the weights {largest}");
        // of the grid, the part inside the box is 1 - 1e-3 long
        let shorter = if m == 1 { 1.0 - 1e-3 } else { 1.0 };
        for c in 0..3 {
            if beta[c] > 0.0 {
                let pass = (-tau[c] * shorter).exp();
                let (a, t) = (f64::from(medium.sigma_a[c]), tau[c]);
                z_test(&format!("{beta:?} passed {c}"), &means.passed[c], SAMPLES, pass);
                z_test(&format!("{beta:?} scattered {c}"), &means.scattered[c], SAMPLES, (1.0 - a / t) * (1.0 - pass));
                z_test(
                    &format!("{beta:?} emitted {c}"),
                    &means.emitted[c],
                    SAMPLES,
                    a / t * f64::from(medium.emission[c]) * (1.0 - pass),
                );
            }
        }
        if beta == [1.0; 3] {
            assert!(means.largest < 3.001, "{}", means.largest);
        }
        let steps = work.steps as f64 / f64::from(SAMPLES);
        println!("medium {m}, {beta:?}: {steps:.2} steps, largest weight {:.3}", means.largest);
        // red leaves by a scattering or after a few null collisions, the grid has at most 6 bricks on the way
        assert!(steps < if m == 1 { 12.0 } else { 2.5 } && work.roulettes == 0);
    }
}

/// Without absorption the sum of the path's weight over its channels is what it was, in every flight.
/// Killed by: importances without the path's weight, 1 / p of the other choice, a channel left out.
#[test]
fn albedo_one_conserves_every_weight() {
    let sigma = [2.0, 0.5, 5.0];
    let all = random_grid(homogeneous([0.0; 3], sigma, [0.0; 3]), 13).with(homogeneous([0.0; 3], sigma, [0.0; 3]));
    let beta = [0.5, 2.0, 1.0];
    for m in 0..2 {
        for (o, d, tmax) in segments() {
            flights(&all.scene(), m, &segment(o, d, tmax), beta, 40, 1 << 13, |e| {
                assert!(e.collided || e.passed);
                let sum: f64 = (0..3).map(|c| beta[c] * e.weight[c]).sum();
                assert!((sum / 3.5 - 1.0).abs() < 1e-5, "{e:?}");
            });
        }
    }
}

/// What a tentative collision absorbs is the same whatever is chosen there: of a white path the sum over the channels is
/// 3 - 2/3 after the first one, and never more after others.
/// Killed by: importances by sigma_t, which leave null collisions the whole and scatterings less.
#[test]
fn absorption_lowers_both_choices_alike() {
    let all = MediaScene::default().with(homogeneous([1.0, 1.0, 0.0], [2.0, 1.0, 0.5], [0.0; 3]));
    let s = segment([0.0; 3], [0.0, 1.0, 0.0], 0.4);
    let (mut after_one, mut later) = ([0; 2], 0);
    flights(&all.scene(), 0, &s, [1.0; 3], 41, 1 << 14, |e| {
        let sum: f64 = (0..3).map(|c| e.weight[c] * if e.collided { e.albedo[c] } else { 1.0 }).sum();
        match sum {
            x if (x - 7.0 / 3.0).abs() < 1e-5 => after_one[usize::from(e.passed)] += 1,
            x if (x - 3.0).abs() < 1e-5 => assert!(e.passed, "a scattering without absorption"),
            x => {
                assert!(x < 7.0 / 3.0);
                later += 1;
            }
        }
    });
    assert!(after_one.iter().all(|n| *n > 1000) && later > 100, "{after_one:?} {later}");
}

/// A thickness of majorants up to 1e9 with null collisions only: every call takes at most 64 steps a lane, paths end after a
/// bounded number of calls, and roulette is counted; transmittances stay bounded and end too.
/// Killed by: loops until t passes the end; no roulette at a standstill; one that is not counted, or does not double.
#[test]
fn work_is_bounded_at_any_thickness() {
    // one cell of the brick is dense, the segment passes at the other end of it
    let mut densities = [0.0f32; 64];
    densities[63] = 1.0;
    for sigma in [1e5f32, 1e9, MAX_COEFFICIENT] {
        let medium = homogeneous([0.0; 3], [sigma; 3], [0.0; 3]);
        let all = MediaScene::default().with_grid(medium, [[0.0; 3], [1.0; 3]], [4; 3], &densities);
        let scene = all.scene();
        let s = segment([-1.0, 0.1, 0.1], [1.0, 0.0, 0.0], f64::INFINITY);
        let work = flights(&scene, 0, &s, [1.0; 3], 50, 1 << 10, |_| {});
        assert!(work.roulettes >= 1 << 10, "{work:?}");
        assert!(work.calls < 40 << 7 && work.steps < 512 << 10, "{work:?}");
        let (_, work) = mean_transmittance(&scene, 0, &s, 51, 1 << 10);
        assert!(work.roulettes >= 1 << 10 && work.steps < 512 << 10, "{work:?}");
    }
    // one call at a standstill: half of the lanes are left, with twice the weight
    let all = MediaScene::default().with_grid(
        homogeneous([0.0; 3], [1e7; 3], [0.0; 3]),
        [[0.0; 3], [1.0; 3]],
        [4; 3],
        &densities,
    );
    let s = segment([-1.0, 0.1, 0.1], [1.0, 0.0, 0.0], f64::INFINITY);
    let (scene, mut left) = (all.scene(), Mean::default());
    for packet in 0..1 << 11 {
        let f =
            fly(ALL, &scene, U32x8::splat(0), &s, Vec3x8::ONE, Numbers8::hashed(key(55, packet)), Mask8::all_lanes());
        assert_eq!((f.steps, f.roulettes, f.collided.bits(), f.passed.bits()), (512, 8, 0, 0));
        for i in 0..8 {
            assert!(f.weight.lane(i) == if f.unfinished.lane(i) { [2.0; 3] } else { [0.0; 3] });
            assert!(!f.unfinished.lane(i) || (f.t.lane(i) - 1.0).abs() < 1e-4);
            left.add(f64::from(f.weight.lane(i)[1]));
        }
    }
    z_test("roulette of flights", &left, 1 << 14, 1.0);
    // at 1000 the way through is 1000 steps: more than a call, but progress, and no roulette
    let all = MediaScene::default().with_grid(
        homogeneous([0.0; 3], [1000.0; 3], [0.0; 3]),
        [[0.0; 3], [1.0; 3]],
        [4; 3],
        &densities,
    );
    let s = segment([-1.0, 0.1, 0.1], [1.0, 0.0, 0.0], f64::INFINITY);
    let work = flights(&all.scene(), 0, &s, [1.0; 3], 52, 1 << 10, |e| assert!(e.passed && e.weight == [1.0; 3]));
    assert!(work.roulettes == 0 && work.steps > 900 << 10);
    let (mean, work) = mean_transmittance(&all.scene(), 0, &s, 53, 1 << 10);
    assert!(mean[0].mean() == 1.0 && work.roulettes == 0);
    // roulette of transmittances: 1500 steps, in part not fast enough, are right on average
    let all = MediaScene::default().with_grid(
        homogeneous([0.0; 3], [1500.0; 3], [0.0; 3]),
        [[0.0; 3], [1.0; 3]],
        [4; 3],
        &densities,
    );
    let (mean, work) = mean_transmittance(&all.scene(), 0, &s, 54, 1 << 14);
    assert!(work.roulettes > 1 << 11, "{work:?}");
    z_test("roulette of transmittances", &mean[0], 1 << 14, 1.0);
}

/// Small transmittances: the mean of ratio tracking with roulette at tau = 8 in the most transparent channel is right.
/// Killed by: weights that are not divided by the probability to survive, a lane that dies and passes.
#[test]
fn roulette_of_transmittances_is_unbiased() {
    let mut rng = SplitMix(17);
    let densities: Vec<f32> = (0..CELLS.iter().product()).map(|_| 0.5 + 0.5 * rng.f32()).collect();
    let medium = homogeneous([3.0, 2.0, 9.0], [1.0, 0.5, 1.0], [0.0; 3]);
    let all = MediaScene::default().with_grid(medium, BOX, CELLS, &densities);
    let (o, d) = ([0.1, 1.0, 1.0], [0.1, 0.05, 1.0]);
    let length = thickness(&all, 0, (o, d, 10.0));
    let (means, work) = mean_transmittance(&all.scene(), 0, &segment(o, d, 10.0), 60, 1 << 20);
    for (c, mean) in means.iter().enumerate() {
        let tau = f64::from(medium.sigma_a[c] + medium.sigma_s[c]) * length;
        println!("tau {tau:.2}: {:.2e} +- {:.1e}", mean.mean(), mean.error());
        z_test(&format!("tau {tau}"), mean, 1 << 20, (-tau).exp());
    }
    assert_eq!(work.roulettes, 0);
}

/// Lanes do not know each other: a packet of different media, segments and masks gives each lane the bits that it has
/// alone, with and without grids compiled in; lanes that are not active are 0. NaN, infinities and media that do not
/// exist give finite results or 0. Killed by: a number drawn by the packet, a branch on any lane that changes others.
#[test]
fn lanes_are_independent_and_survive_anything() {
    let all = random_grid(homogeneous([0.4, 0.9, 0.1], [1.1, 0.6, 0.4], [1.0; 3]), 18)
        .with(homogeneous([0.1, 0.2, 0.3], [1.0, 2.0, 30.0], [1.0, 2.0, 3.0]))
        .with(homogeneous([0.1, 0.2, 0.0], [0.0; 3], [1.0; 3]));
    let scene = all.scene();
    let mut rng = SplitMix(19);
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-45, 0.0, -0.0, 1e30, -1e-30];
    for round in 0..3000 {
        let strange = round % 2 == 1;
        let mut number = |lo: f64, hi: f64, share: f64| {
            let x = rng.range(lo, hi) as f32;
            if strange && rng.f64() < share { odd[rng.word() as usize % odd.len()] } else { x }
        };
        let mut vector = |lo: f64, hi: f64| Vec3x8::from_fn(|_| std::array::from_fn(|_| number(lo, hi, 0.1)));
        let (o, d, beta) = (vector(0.0, 3.0), vector(-1.0, 1.0), vector(0.0, 2.0));
        let tmax = F32x8::from_fn(|_| number(0.1, 5.0, 0.3));
        let s = Segment8 { o, d, tmax };
        let medium = U32x8::from_fn(|_| rng.word() % if strange { 5 } else { 3 });
        let active = Mask8::from_bits(rng.word() & 0xff);
        let k = Key8::camera(round, U32x8::from_fn(|i| i as u32), U32x8::splat(3));
        let (f, t) = (
            fly(ALL, &scene, medium, &s, beta, Numbers8::hashed(k), active),
            transmittance(ALL, &scene, medium, &s, Numbers8::hashed(k), active),
        );
        assert!(f.weight.is_finite().all() && f.emitted.is_finite().all() && f.albedo.is_finite().all());
        assert!((f.collided | f.passed | f.unfinished).and_not(active).none());
        assert!((f.collided | f.unfinished).and_not(f.t.is_finite()).none());
        assert!(t.transmittance.is_finite().all() && f.steps <= 64 * 8 && t.steps <= 4096 * 8);
        for i in 0..8 {
            let one = Mask8::from_bits(1 << i);
            if !active.lane(i) {
                assert_eq!(
                    (f.weight.lane(i), f.emitted.lane(i), t.transmittance.lane(i)),
                    ([0.0; 3], [0.0; 3], [0.0; 3])
                );
                continue;
            }
            let bits = |f: &Flight8, t: &Passage8| {
                let masks = [f.collided, f.passed, f.unfinished].map(|m| m.lane(i));
                let colours = [f.weight, f.albedo, f.emitted, t.transmittance].map(|c| c.lane(i).map(f32::to_bits));
                (masks, colours, f.t.lane(i).to_bits())
            };
            let alone = (
                fly(ALL, &scene, medium, &s, beta, Numbers8::hashed(k), one),
                transmittance(ALL, &scene, medium, &s, Numbers8::hashed(k), one),
            );
            assert_eq!(bits(&f, &t), bits(&alone.0, &alone.1), "lane {i}");
            if medium.lane(i) != 0 {
                let even = fly(EVEN_ONLY, &scene, medium, &s, beta, Numbers8::hashed(k), one);
                let t = transmittance(EVEN_ONLY, &scene, medium, &s, Numbers8::hashed(k), one);
                assert_eq!(bits(&even, &t), bits(&alone.0, &alone.1), "lane {i}");
            }
        }
    }
}
