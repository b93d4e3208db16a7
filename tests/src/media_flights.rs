//! Flights through media for tests: many of them, gone on with as the caller has to, their means, and grids and segments
//! to fly through.

use crate::media_oracle::{MediaScene, V};
use crate::stats::{Mean, SplitMix};
use croupier::Scene;
use croupier::unstable::Numbers8;
use croupier::unstable::media::{Segment8, fly, transmittance};
use croupier::unstable::rng::Key8;
use croupier::unstable::scene::Effects;
use croupier::unstable::scene::blob::Medium;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Every effect.
pub const ALL: Effects = Effects(u32::MAX);
/// Standard errors that a z-test allows.
pub const SIGMAS: f64 = 5.0;

/// Keys of a packet of flights.
pub fn key(seed: u64, packet: u32) -> Key8 {
    Key8::camera(seed, U32x8::splat(packet), U32x8::from_fn(|i| i as u32))
}

/// One vector in all lanes.
pub fn splat(v: V) -> Vec3x8 {
    Vec3x8::splat(v[0] as f32, v[1] as f32, v[2] as f32)
}

/// One segment in all lanes.
pub fn segment(o: V, d: V, tmax: f64) -> Segment8 {
    Segment8 { o: splat(o), d: splat(d), tmax: F32x8::splat(tmax as f32) }
}

/// Where a flight ended.
#[derive(Clone, Copy, Debug)]
pub struct End {
    /// Scattered at `t`.
    pub collided: bool,
    /// Reached the end.
    pub passed: bool,
    /// Parameter.
    pub t: f64,
    /// Factor on the weight, without the albedo.
    pub weight: V,
    /// Single-scattering albedo.
    pub albedo: V,
    /// Radiance met.
    pub emitted: V,
}

/// Sums over flights.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Lane-steps.
    pub steps: u64,
    /// Roulettes by the bound of work.
    pub roulettes: u64,
    /// Calls.
    pub calls: u64,
}

/// Flies `n` times through medium `m`, going on where a flight is not finished, as the caller has to.
pub fn flights(scene: &Scene<'_>, m: u32, s: &Segment8, beta: V, seed: u64, n: u32, mut f: impl FnMut(End)) -> Work {
    let mut work = Work::default();
    for packet in 0..n / 8 {
        let (mut now, mut active) = (*s, Mask8::all_lanes());
        let (mut before, mut weight, mut emitted) = (F32x8::ZERO, Vec3x8::ONE, Vec3x8::ZERO);
        let mut key = key(seed, packet);
        while active.any() {
            let flight = fly(ALL, scene, U32x8::splat(m), &now, splat(beta) * weight, Numbers8::hashed(key), active);
            work.steps += u64::from(flight.steps);
            work.roulettes += u64::from(flight.roulettes);
            work.calls += 1;
            assert!(flight.weight.is_finite().all() && flight.emitted.is_finite().all());
            assert!((flight.collided & flight.passed | flight.unfinished & (flight.collided | flight.passed)).none());
            emitted += flight.emitted * weight;
            for i in active.and_not(flight.unfinished).lanes() {
                let times = |a: Vec3x8, b: Vec3x8| (a * b).lane(i).map(f64::from);
                f(End {
                    collided: flight.collided.lane(i),
                    passed: flight.passed.lane(i),
                    t: f64::from(before.lane(i)) + f64::from(flight.t.lane(i)),
                    weight: times(flight.weight, weight),
                    albedo: flight.albedo.lane(i).map(f64::from),
                    emitted: emitted.lane(i).map(f64::from),
                });
            }
            active = flight.unfinished;
            weight = Vec3x8::select(active, weight * flight.weight, weight);
            now.o = Vec3x8::select(active, now.o + now.d * flight.t, now.o);
            now.tmax = active.select(now.tmax - flight.t, now.tmax);
            before = active.select(before + flight.t, before);
            key = key.child(U32x8::splat(1));
        }
    }
    work
}

/// Mean of `n` samples against its expectation. Where all samples are alike the error is that of rare events of size 1.
#[track_caller]
pub fn z_test(what: &str, mean: &Mean, n: u32, want: f64) {
    let rare = if mean.error() > 0.0 { 0.0 } else { (want.abs() / f64::from(n)).sqrt() };
    let error = mean.error().max(rare).max(1e-7 * want.abs()).max(1e-30);
    let z = (mean.mean() - want) / error;
    assert!(z.abs() < SIGMAS, "{what}: {} +- {:.1e}, expected {want}: {z:.1} sigma", mean.mean(), mean.error());
}

/// Means per channel of what flights do, tested against closed forms.
#[derive(Debug, Default)]
pub struct Means {
    /// Weights of those that passed.
    pub passed: [Mean; 3],
    /// Weights times albedo of those that scattered.
    pub scattered: [Mean; 3],
    /// Radiance met.
    pub emitted: [Mean; 3],
    /// Largest weight of all.
    pub largest: f64,
}

impl Means {
    /// Adds a flight.
    pub fn add(&mut self, e: End) {
        for c in 0..3 {
            let scattered = e.weight[c] * e.albedo[c];
            self.passed[c].add(if e.passed { e.weight[c] } else { 0.0 });
            self.scattered[c].add(if e.collided { scattered } else { 0.0 });
            self.emitted[c].add(e.emitted[c]);
            self.largest = self.largest.max(if e.passed { e.weight[c] } else { scattered });
        }
    }

    /// Tests the means of `n` flights, `tau` per channel over the segment.
    #[track_caller]
    pub fn check(&self, what: &str, n: u32, medium: &Medium, tau: V) {
        for (c, tau) in tau.into_iter().enumerate() {
            let [a, s, e] = [medium.sigma_a[c], medium.sigma_s[c], medium.emission[c]].map(f64::from);
            let pass = (-tau).exp();
            let share = |x: f64| if x > 0.0 { x / (a + s) * -(-tau).exp_m1() } else { 0.0 };
            z_test(&format!("{what}: passed, channel {c}"), &self.passed[c], n, pass);
            z_test(&format!("{what}: scattered, channel {c}"), &self.scattered[c], n, share(s));
            z_test(&format!("{what}: emitted, channel {c}"), &self.emitted[c], n, share(a) * e);
        }
    }
}

/// Cells of a random grid with holes and peaks.
pub const CELLS: [u32; 3] = [9, 6, 14];
/// Its box.
pub const BOX: [[f32; 3]; 2] = [[-1.0, 0.5, 2.0], [1.0, 2.0, 4.5]];

/// A random grid in [`BOX`].
pub fn random_grid(medium: Medium, seed: u64) -> MediaScene {
    let mut rng = SplitMix(seed);
    let value = |rng: &mut SplitMix| match rng.f64() {
        x if x < 0.3 => 0.0,
        x if x < 0.95 => rng.f32(),
        _ => 4.0 * rng.f32(),
    };
    let densities: Vec<f32> = (0..CELLS.iter().product()).map(|_| value(&mut rng)).collect();
    MediaScene::default().with_grid(medium, BOX, CELLS, &densities)
}

/// Segments through [`BOX`]: oblique, parallel to axes with zeros of both signs, along a face, from inside, missing it.
pub fn segments() -> Vec<(V, V, f64)> {
    vec![
        ([-2.0, 0.2, 1.5], [3.0, 1.4, 3.3], 2.0),
        ([0.1, 1.2, -3.0], [0.0, -0.0, 0.7], 20.0),
        ([5.0, 0.93, 3.1], [-1.0, 0.0, -0.0], f64::INFINITY),
        ([0.31, 9.0, 2.2], [-0.0, -2.5, 0.0], 100.0),
        ([-0.2, 1.1, 3.3], [0.3, 0.2, 0.6], f64::INFINITY),
        ([-0.2, 1.1, 3.3], [0.3, -0.2, 0.6], 0.9),
        ([-3.0, 2.0, 2.5], [1.0, 0.0, 0.1], 9.0),
        ([-3.0, 2.1, 2.5], [1.0, 0.0, 0.1], 9.0),
        ([-1000.0, -998.5, -997.0], [1.0, 1.0, 1.0], f64::INFINITY),
    ]
}

/// A finite end that is behind the box.
pub fn end(tmax: f64) -> f64 {
    if tmax.is_finite() { tmax } else { 1200.0 }
}

/// Thickness of a segment by quadrature, over the part in which the density is not 0.
pub fn thickness(scene: &MediaScene, m: usize, (o, d, tmax): (V, V, f64)) -> f64 {
    let (mut a, mut b) = (0.0f64, end(tmax));
    for k in 0..3 {
        if d[k] != 0.0 {
            let t = [0, 1]
                .map(|side| (f64::from([scene.media[m].bounds_min, scene.media[m].bounds_max][side][k]) - o[k]) / d[k]);
            (a, b) = (a.max(t[0].min(t[1])), b.min(t[0].max(t[1])));
        }
    }
    if a < b { scene.thickness(m, o, d, [a, b], 4000) } else { 0.0 }
}

/// Mean of the transmittance over `n` keys.
pub fn mean_transmittance(scene: &Scene<'_>, m: u32, s: &Segment8, seed: u64, n: u32) -> ([Mean; 3], Work) {
    let (mut means, mut work) = ([Mean::default(); 3], Work::default());
    for packet in 0..n / 8 {
        let got =
            transmittance(ALL, scene, U32x8::splat(m), s, Numbers8::hashed(key(seed, packet)), Mask8::all_lanes());
        work.steps += u64::from(got.steps);
        work.roulettes += u64::from(got.roulettes);
        for i in 0..8 {
            for (mean, t) in means.iter_mut().zip(got.transmittance.lane(i)) {
                mean.add(f64::from(t));
            }
        }
    }
    (means, work)
}
