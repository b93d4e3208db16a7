//! Samples of surfaces, media and environments, counted in cells, against the probabilities of the cells in f64:
//! chi-square (NUMERICS GGX-4, MED-1, MED-8, SMP-5).

use super::Found;
use crate::bsdf::{Case, V, at_angle, lane, splat, unit};
use crate::environment::{Case as Map, random_words};
use crate::media_flights::{flights, segment};
use crate::media_oracle::{MediaScene, henyey_greenstein, homogeneous};
use crate::quadrature::{jittered, midpoint};
use crate::stats::{ChiSquare, SplitMix, chi_square, chi_square_in_order, chi_square_within};
use croupier::unstable::bsdf::{Bsdf, HenyeyGreenstein, Inputs8};
use croupier::unstable::scene::blob::MaterialKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use std::f64::consts::TAU;

/// Cells of a surface in the two coordinates.
const CELLS: [usize; 2] = [12, 16];
/// Probability of a cell that quadrature may miss, a sliver at the horizon.
const SLIVER: f64 = 1e-8;
/// A loss that quadrature cannot tell from none.
const LOSS: f64 = 1e-5;

impl Found {
    /// One test of `samples` samples as a part of a check whose tests fail below `level`. The figure is -log10 of p.
    pub fn of_p(p: f64, level: f64, samples: u64, what: impl FnOnce() -> String) -> Self {
        let mut found = Self { cases: samples, worst: -p.max(1e-300).log10(), ..Self::default() };
        found.fail(u64::from(p.is_nan() || p < level), || format!("{}: p = {p:e}", what()));
        found
    }
}

/// Coordinates of the upper hemisphere with the cosine density uniform.
fn cosine_coordinates(wi: V) -> (f64, f64) {
    let t = wi[1].atan2(wi[0]) / TAU;
    (wi[0] * wi[0] + wi[1] * wi[1], if t < 0.0 { t + 1.0 } else { t })
}

/// Cells of the directions of one configuration: half-vector coordinates for reflection and for transmission where the
/// case is narrow, or hemisphere coordinates; a last cell for "no sample".
struct Cells<'c> {
    case: &'c Case,
    by_facet: bool,
}

impl Cells<'_> {
    const COUNT: usize = 2 * CELLS[0] * CELLS[1] + 1;

    fn index(&self, wo: V, wi: V) -> usize {
        let (s, t, upper) = if self.by_facet {
            self.case.facet_coordinates(wo, wi)
        } else {
            let (s, t) = cosine_coordinates(wi);
            (s, t, true)
        };
        let cell = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
        (usize::from(!upper) * CELLS[0] + cell(s, CELLS[0])) * CELLS[1] + cell(t, CELLS[1])
    }

    /// By quadrature with `points` x `points` in each cell; the last cell has what is missing to 1.
    fn probabilities(&self, wo: V, points: usize) -> Vec<f64> {
        let mut p = vec![0.0; Self::COUNT];
        let (ns, nt) = (CELLS[0] * points, CELLS[1] * points);
        for ([i, j], [s, t]) in jittered(ns, nt) {
            let cell = i / points * CELLS[1] + j / points;
            if self.by_facet {
                let (m, dm) = self.case.facet(s, t);
                for reflect in [true, false] {
                    let Some((wi, d)) = self.case.through_facet(wo, m, reflect) else { continue };
                    let add = usize::from(!reflect) * CELLS[0] * CELLS[1];
                    p[cell + add] += self.case.eval(wo, wi).pdf * d * dm / (ns * nt) as f64;
                }
            } else {
                let wi = [s.sqrt() * (TAU * t).cos(), s.sqrt() * (TAU * t).sin(), (1.0 - s).sqrt()];
                // d wi = ds dt pi / cos
                p[cell] += self.case.eval(wo, wi).pdf * (TAU / 2.0) / wi[2] / (ns * nt) as f64;
            }
        }
        p[Self::COUNT - 1] = 1.0 - p.iter().sum::<f64>();
        p
    }
}

/// Surfaces and views that are sampled.
pub fn configurations() -> Vec<(Case, V)> {
    use MaterialKind::*;
    let (grey, gold, gold_k) = ([0.6, 0.5, 0.1], [0.143, 0.375, 1.442], [3.983, 2.386, 1.603]);
    let mut all = vec![];
    let mut add = |case: Case, angles: &[f64]| {
        for (k, &a) in angles.iter().enumerate() {
            all.push((case.clone(), unit(lane(splat(at_angle(a, 0.7 + k as f64)), 0))));
        }
    };
    add(Case::new(Diffuse, grey, [0.0; 3], [0.0; 3], 0.0), &[30.0]);
    for alpha in [1e-3, 0.02, 0.125, 0.5, 1.0] {
        add(Case::new(RoughConductor, grey, gold, gold_k, alpha), &[0.0, 30.0, 80.0, 89.0]);
    }
    add(Case::new(RoughConductor, grey, gold, gold_k, 0.1), &[89.99]);
    for (alpha, eta) in [(0.01, 1.5), (0.1, 1.5), (0.5, 1.5), (0.3, 1.0 / 1.5), (1.0, 2.4), (0.2, 1.05)] {
        add(Case::new(RoughDielectric, [0.0; 3], [eta; 3], [0.0; 3], alpha), &[0.0, 50.0, 85.0, 120.0, 150.0]);
    }
    for eta in [1.5, 1.0 / 1.5] {
        add(Case::new(Plastic, grey, [eta; 3], [0.0; 3], 0.0), &[20.0, 85.0]);
    }
    for (alpha, eta) in [(0.1, 1.5), (0.3, 1.5), (1.0, 1.5), (0.3, 2.4)] {
        add(Case::new(RoughPlastic, grey, [eta; 3], [0.0; 3], alpha), &[20.0, 60.0, 85.0]);
    }
    for alpha in [0.1, 0.6] {
        add(Case::new(RoughConductor, grey, gold, gold_k, alpha).compensated(), &[30.0, 85.0]);
        add(Case::new(RoughDielectric, [0.0; 3], [1.5; 3], [0.0; 3], alpha).compensated(), &[50.0, 120.0]);
        add(Case::new(RoughPlastic, grey, [1.5; 3], [0.0; 3], alpha).compensated(), &[20.0, 85.0]);
    }
    all
}

/// `samples` samples of a surface, seen from `wo`, against quadrature of the oracle's density with `points` x `points`
/// in each cell; what half as many give otherwise counts as uncertain. Lost and delta samples are a cell of their own,
/// so that the total is tested as well.
pub fn surface(case: &Case, wo: V, seed: u64, samples: u64, points: usize) -> ChiSquare {
    let cells = Cells { case, by_facet: case.alpha() > 0.0 };
    let model = case.model(Mask8::all_lanes());
    let mut rng = SplitMix(seed);
    let mut counts = vec![0u64; Cells::COUNT];
    let packets = samples.div_ceil(8);
    for _ in 0..packets {
        let s = model.sample(splat(wo), std::array::from_fn(|_| F32x8::from_fn(|_| rng.f32())));
        let scattered = s.valid.and_not(s.delta);
        counts[Cells::COUNT - 1] += u64::from(8 - scattered.count());
        for l in scattered.lanes() {
            counts[cells.index(wo, lane(s.wi, l))] += 1;
        }
    }
    let n = (8 * packets) as f64;
    let [fine, coarse] = [points, points / 2].map(|points| cells.probabilities(wo, points));
    let least = |i: usize| if i + 1 == Cells::COUNT { LOSS } else { SLIVER };
    let expected: Vec<f64> = fine.iter().enumerate().map(|(i, p)| n * p.max(least(i))).collect();
    let unsure = |(i, (p, q)): (usize, (&f64, &f64))| n * (p - q).abs().max(if *p < least(i) { least(i) } else { 0.0 });
    let uncertainty: Vec<f64> = fine.iter().zip(&coarse).enumerate().map(unsure).collect();
    chi_square_within(&counts, &expected, &uncertainty, 20.0)
}

/// Albedo of [`with_phase_function`].
pub const ALBEDO: [f32; 3] = [0.9, 0.5, 0.0];

/// Calls `f` with the phase function of mean cosine `g`.
pub fn with_phase_function<R>(g: f32, f: impl FnOnce(HenyeyGreenstein) -> R) -> R {
    let mut medium = homogeneous([0.0; 3], [1.0; 3], [0.0; 3]);
    medium.g = g;
    // the medium under test is not the first
    let scene = MediaScene::default().with(homogeneous([0.0; 3], [1.0; 3], [0.0; 3])).with(medium);
    let inputs = Inputs8 { material: U32x8::splat(1), reflectance: Vec3x8::splat(ALBEDO[0], ALBEDO[1], ALBEDO[2]) };
    f(HenyeyGreenstein::gather(&scene.scene(), &inputs, Mask8::all_lanes()))
}

/// Mean cosines of phase functions that are sampled.
pub const MEAN_COSINES: [f32; 8] = [-0.99, -0.6, -1e-7, 0.0, 0.1, 0.5, 0.8, 0.99];

/// `samples` samples of the phase function of mean cosine `g` in 24 x 16 cells of cosine and azimuth.
pub fn phase_function(g: f32, seed: u64, samples: u64) -> ChiSquare {
    const CELLS: [usize; 2] = [24, 16];
    let mut rng = SplitMix(seed);
    let mut counts = vec![0u64; CELLS[0] * CELLS[1]];
    let cell = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
    // even in the fourth root of 1 - cos towards the peak, so that narrow peaks have cells; 1 - cos as half the squared
    // distance of the directions, because cos has few digits there
    let peak = f64::from(-g.signum());
    let band = |wi: V| {
        let q = wi[0] * wi[0] + wi[1] * wi[1] + (wi[2] - peak).powi(2);
        cell((q / 4.0).powf(0.25), CELLS[0])
    };
    let packets = samples.div_ceil(8);
    with_phase_function(g, |model| {
        for _ in 0..packets {
            let s = model.sample(UPWARDS, std::array::from_fn(|_| F32x8::from_fn(|_| rng.f32())));
            for i in 0..8 {
                let wi = lane(s.wi, i);
                let phi = wi[1].atan2(wi[0]) / TAU;
                counts[band(wi) * CELLS[1] + cell(phi.rem_euclid(1.0), CELLS[1])] += 1;
            }
        }
    });
    let expected: Vec<f64> = (0..counts.len())
        .map(|c| {
            let edge = |k: usize| 2.0 * (k as f64 / CELLS[0] as f64).powi(4);
            let (a, b) = (edge(c / CELLS[1]), edge(c / CELLS[1] + 1));
            let at = |q: f64| henyey_greenstein(f64::from(g), f64::from(g.signum()) * (1.0 - q)) * TAU;
            midpoint(2000, a, b, at) / CELLS[1] as f64 * (8 * packets) as f64
        })
        .collect();
    chi_square(&counts, &expected, 20.0)
}

/// The direction +z, from which light is scattered.
pub const UPWARDS: Vec3x8 = Vec3x8::splat(0.0, 0.0, 1.0);

/// Distances of `n` flights through an even medium of extinction 2.5, in 64 cells of equal probability.
pub fn distances(seed: u64, n: u32) -> ChiSquare {
    const CELLS: usize = 64;
    let scene = MediaScene::default().with(homogeneous([0.5; 3], [2.0; 3], [0.0; 3]));
    let s = segment([1.0, 2.0, 3.0], [0.0, 4.0, 0.0], f64::INFINITY);
    let mut counts = vec![0u64; CELLS];
    flights(&scene.scene(), 0, &s, [1.0; 3], seed, n, |e| {
        let passed = -(-e.t * 4.0 * 2.5).exp_m1();
        counts[((passed * CELLS as f64) as usize).min(CELLS - 1)] += 1;
    });
    let total: u64 = counts.iter().sum();
    chi_square(&counts, &[total as f64 / CELLS as f64; CELLS], 20.0)
}

/// What [`environment`] finds.
#[derive(Clone, Copy, Debug)]
pub struct Environments {
    /// P of counts this far from the expected ones.
    pub p: f64,
    /// Samples in cells that are never picked.
    pub strays: u64,
    /// Samples of the environment.
    pub total: u64,
}

/// 8 `packets` samples of lights, those of the environment counted in 3 x 3 parts of every cell of its map.
///
/// # Panics
/// If they are far from the expected total.
pub fn environment(case: &Map, seed: u64, packets: u64) -> Environments {
    let parts = 3usize;
    let mut rng = SplitMix(seed);
    let [w, h] = case.map.cells();
    let mut counts = vec![0u64; w * h * parts * parts];
    let mut total = 0u64;
    for _ in 0..packets {
        let s = case.draw(random_words(&mut rng));
        for i in (s.valid & s.infinite).lanes() {
            let at = case.map.at(case.local(s.wi.lane(i)));
            let part = |x: f64| ((x * parts as f64) as usize).min(parts - 1);
            counts[((at.row * w + at.column) * parts + part(at.t)) * parts + part(at.x)] += 1;
            total += 1;
        }
    }
    let mut expected = vec![0.0; counts.len()];
    for (k, p) in case.map.probabilities().into_iter().enumerate().filter(|(_, p)| *p > 0.0) {
        for n in 0..parts * parts {
            // The middle of a part has the mean of what is bilinear.
            let [x, t] = [n % parts, n / parts].map(|m| (m as f64 + 0.5) / parts as f64);
            let share = case.map.inside(k % w, k / w, x, t) / (parts * parts) as f64;
            expected[k * parts * parts + n] = p * share * total as f64;
        }
    }
    // A direction on the edge of a cell may round across it, into a cell at or below the mean.
    let strays: u64 = counts.iter().zip(&expected).filter(|(_, e)| **e == 0.0).map(|(c, _)| c).sum();
    counts.iter_mut().zip(&expected).filter(|(_, e)| **e == 0.0).for_each(|(c, _)| *c = 0);
    Environments { p: chi_square_in_order(&counts, &expected), strays, total }
}
