//! Flights through media and what passes.

use super::{Kernels, Outcome, PACKETS, close, leak, mean_lanes};
use croupier::unstable::Numbers8;
use croupier::unstable::media::{Segment8, fly, transmittance};
use croupier::unstable::scene::Effects;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier_tests::media_flights::{key, random_grid, segments, thickness};
use croupier_tests::media_oracle::{MediaScene, V, homogeneous};
use croupier_tests::stats::Mean;

const ALL: Effects = Effects(u32::MAX);
const SIGMA_A: [f32; 3] = [0.1, 0.2, 0.3];
const SIGMA_S: [f32; 3] = [0.5, 0.4, 0.3];

pub(super) fn add(k: &mut Kernels) -> Outcome {
    let medium = homogeneous(SIGMA_A, SIGMA_S, [0.0; 3]);
    let even = leak(MediaScene::default().with(medium));
    let lines: Vec<(V, V, f64)> = (1..9).map(|n| ([0.0; 3], [0.0, 0.6, 0.8], f64::from(n) * 0.4)).collect();
    let sigma = f64::from(SIGMA_A[0] + SIGMA_S[0]);
    rows(k, "homogeneous", even, &lines, |(_, _, end)| end * sigma)?;
    let grid = leak(random_grid(medium, 5));
    // those that meet it
    let through = segments();
    let through = through.into_iter().filter(|s| thickness(grid, 0, *s) > 0.0).collect::<Vec<_>>();
    let through: Vec<_> = (0..8).map(|i| through[i % through.len()]).collect();
    rows(k, "grid", grid, &through, |s| thickness(grid, 0, s) * sigma)
}

/// Rows of medium 0 along eight lines; `tau` is the optical depth of the first channel.
fn rows(
    k: &mut Kernels,
    name: &'static str,
    owner: &'static MediaScene,
    lines: &[(V, V, f64)],
    tau: impl Fn((V, V, f64)) -> f64,
) -> Outcome {
    let scene = owner.scene();
    let of = |v: V| v.map(|x| x as f32);
    let segment = Segment8 {
        o: Vec3x8::from_fn(|i| of(lines[i].0)),
        d: Vec3x8::from_fn(|i| of(lines[i].1)),
        tmax: F32x8::from_fn(|i| lines[i].2 as f32),
    };
    let flight = move |n: u32| {
        fly(ALL, &scene, U32x8::splat(0), &segment, Vec3x8::ONE, Numbers8::hashed(key(6, n)), Mask8::all_lanes())
    };
    let passing = move |n: u32| {
        transmittance(ALL, &scene, U32x8::splat(0), &segment, Numbers8::hashed(key(7, n)), Mask8::all_lanes())
            .transmittance
    };
    let (mut flown, mut passed) = ([Mean::default(); 8], [Mean::default(); 8]);
    for n in 0..2048 {
        let (f, t) = (flight(n), passing(n));
        for i in 0..8 {
            passed[i].add(f64::from(t.lane(i)[0]));
            if name == "homogeneous" {
                k.note(("medium transmittance", name), f64::from(t.lane(i)[0]), (-tau(lines[i])).exp());
            }
            // a flight that goes on elsewhere has neither passed nor collided: only whole ones are told apart
            flown[i].add(if f.passed.lane(i) { f64::from(f.weight.lane(i)[0]) } else { 0.0 });
        }
    }
    for (i, line) in lines.iter().enumerate() {
        let want = (-tau(*line)).exp();
        let passes = passed[i];
        if name != "homogeneous" {
            k.note_mean(("medium transmittance", name), passes.mean(), passes.error(), want);
        }
        close(format_args!("{name}: transmittance of line {i}"), passes.mean(), want, 5.0 * passes.error() + 1e-6)?;
        if name == "homogeneous" {
            let flies = flown[i];
            k.note_mean(("medium flight", name), flies.mean(), flies.error(), want);
            close(format_args!("{name}: flights along line {i}"), flies.mean(), want, 5.0 * flies.error() + 1e-6)?;
        }
    }
    let numbers: Vec<u32> = (0..PACKETS as u32).collect();
    let lanes = numbers.iter().map(|n| {
        let f = flight(*n);
        (f.collided | f.passed).count() as usize
    });
    k.packets(("medium flight", name), mean_lanes(lanes), numbers.clone(), move |n| flight(*n));
    k.packets(("medium transmittance", name), 8.0, numbers, move |n| passing(*n));
    Ok(())
}
