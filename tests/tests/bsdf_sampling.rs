//! Scattering models as a whole: samples follow their density, densities integrate to 1, energy is what quadrature of
//! the oracle says.

use croupier::unstable::scene::blob::MaterialKind;
use croupier::unstable::simd::{F32x8, Mask8};
use croupier_tests::bsdf::*;
use croupier_tests::furnace::{energy, mean_weight};
use croupier_tests::quadrature::jittered;
use croupier_tests::stats::*;
use std::f64::consts::TAU;

/// Cells in the two coordinates.
const CELLS: [usize; 2] = [12, 16];
/// Quadrature points per cell and coordinate.
const POINTS: usize = 32;
/// Samples per configuration.
const SAMPLES: usize = 1 << 20;

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

    fn probabilities(&self, wo: V) -> Vec<f64> {
        let mut p = vec![0.0; Self::COUNT];
        let (ns, nt) = (CELLS[0] * POINTS, CELLS[1] * POINTS);
        for ([i, j], [s, t]) in jittered(ns, nt) {
            let cell = i / POINTS * CELLS[1] + j / POINTS;
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
        // quadrature misses slivers of cells at the horizon
        p.iter_mut().for_each(|p| *p = p.max(1e-8));
        // and cannot tell a loss below 1e-5 from none
        p[Self::COUNT - 1] = (1.0 - p.iter().sum::<f64>()).max(1e-5);
        p
    }
}

fn configurations() -> Vec<(Case, V)> {
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

/// 2^20 samples of each configuration against cell probabilities from quadrature of the oracle's density; lost and
/// delta samples are a cell of their own, so that the total is tested as well. One false alarm in 1e6 runs of all.
/// Killed by: the visible-normal map without the stretch back; a lobe probability off by 1 %; weights cut at the
/// horizon in the density only.
#[test]
fn samples_follow_the_density() {
    let configurations = configurations();
    assert_every_kind(&configurations.iter().map(|(c, _)| c.kind).collect::<Vec<_>>(), has_density);
    let level = sidak(FAMILY_ALPHA, configurations.len());
    let mut smallest = 1.0f64;
    for (seed, (case, wo)) in configurations.iter().enumerate() {
        let by_facet = case.alpha() > 0.0;
        let cells = Cells { case, by_facet };
        let model = case.model(Mask8::all_lanes());
        let mut rng = SplitMix(1000 + seed as u64);
        let mut counts = vec![0u64; Cells::COUNT];
        for _ in 0..SAMPLES / 8 {
            let s = model.sample(splat(*wo), std::array::from_fn(|_| F32x8::from_fn(|_| rng.f32())));
            let scattered = s.valid.and_not(s.delta);
            counts[Cells::COUNT - 1] += u64::from(8 - scattered.count());
            for l in scattered.lanes() {
                counts[cells.index(*wo, lane(s.wi, l))] += 1;
            }
        }
        let expected: Vec<f64> = cells.probabilities(*wo).iter().map(|p| p * SAMPLES as f64).collect();
        let r = chi_square(&counts, &expected, 20.0);
        smallest = smallest.min(r.p);
        let angle = wo[2].acos().to_degrees();
        assert!(r.p > level, "{} at {angle:.2} degrees: {r:?}", case.name());
    }
    println!("{} configurations, smallest p {smallest:.1e}, level {level:.1e}", configurations.len());
}

/// The oracle's own density, without what leaves on the wrong side, plus what does, is 1: it is the density of visible
/// normals times a lobe probability.
/// Killed by: a wrong Jacobian in the oracle.
#[test]
fn oracle_densities_are_normalised() {
    for (case, wo) in configurations() {
        if case.alpha() == 0.0 {
            continue;
        }
        let n = 256;
        let mut sum = 0.0;
        for (_, [s, t]) in jittered(n, n) {
            let (m, dm) = case.facet(s, t);
            sum += ggx_g1(wo, m, case.alpha()) * (dot(wo, m) / wo[2]).max(0.0) * ggx_d(m, case.alpha()) * dm;
        }
        let visible = sum / (n * n) as f64;
        assert!((visible - 1.0).abs() < 2e-3, "{} {wo:?}: visible normals integrate to {visible}", case.name());
        let scattered = case.integral(wo, n).pdf;
        assert!(scattered < 1.0 + 1e-3 && scattered > 0.4, "{} {wo:?}: {scattered}", case.name());
    }
}

/// White furnace: the energy that samples carry is that of the oracle by quadrature and never above 1 + 1e-4; lossless
/// smooth models give 1.
/// Killed by: a dropped G1; 1 / eta^2 twice; cosine-weighting T once only.
#[test]
fn furnace() {
    use MaterialKind::*;
    let mut worst = 0.0f64;
    let mut tried = vec![];
    for case in cases() {
        for wo in views(case) {
            let o = unit(lane(splat(wo), 0));
            let grazing = o[2].abs() < 0.1;
            let got = mean_weight(case, o, if grazing { 16384 } else { 4096 });
            // compensation is tabulated
            let most = if case.is_compensated() { 1.0 + 5e-3 } else { 1.0 + 1e-4 };
            assert!(got.iter().all(|&x| x <= most), "{} {wo:?}: {got:?}", case.name());
            if matches!(case.kind, Dielectric | ThinDielectric | Null) {
                assert!((got[0] - 1.0).abs() < 1e-6, "{} {wo:?}: {got:?}", case.name());
                tried.push(case.kind);
                continue;
            }
            if case.kind == RoughDielectric && (case.eta() - 1.0).abs() < 0.05 {
                continue;
            }
            tried.push(case.kind);
            let mut want = case.lobes(o).iter().fold([0.0; 3], |a, l| combine(a, 1.0, l.weight, 1.0));
            // at grazing angles the half of the normals that is visible ends in a crease
            let points = if grazing { 500 } else { 160 };
            // radiance back to energy: transmission and reflection apart
            if case.kind == RoughDielectric {
                want = [energy(case, o, points); 3];
            } else {
                want = combine(want, 1.0, case.integral(o, points).f, 1.0);
            }
            for c in 0..3 {
                let error = (got[c] - want[c]).abs();
                worst = worst.max(error);
                assert!(error < 1.5e-3, "{} {wo:?}: {got:?} {want:?}", case.name());
            }
        }
    }
    assert_every_kind(&tried, |_| true);
    println!("furnace: largest difference {worst:.1e}");
}

/// The energy does not jump where the transmitted lobe becomes a delta lobe (NUMERICS REF-2), nor where alpha reaches
/// its floor (GGX-2). Killed by: weight 1 for G1 in the delta region; a smooth Fresnel there.
#[test]
fn switches_do_not_show() {
    let rough = |eta: f32, alpha: f32| Case::new(MaterialKind::RoughDielectric, [0.0; 3], [eta; 3], [0.0; 3], alpha);
    for (angle, below) in [(0.0, false), (60.0, false), (88.0, true), (89.9, false), (30.0, true)] {
        let w = at_angle(angle, 1.0);
        let wo = [w[0], w[1], if below { -w[2] } else { w[2] }];
        let pairs = [
            (rough(1.000_099_8, 0.5), rough(1.000_100_4, 0.5)),
            (rough(1.001, 0.009_999_5), rough(1.001, 0.009_999_6)),
            (rough(1.5, 0.5e-4), rough(1.5, 1.0001e-4)),
        ];
        for (a, b) in pairs {
            let (x, y) = (mean_weight(&a, wo, 4096), mean_weight(&b, wo, 4096));
            assert!((x[0] - y[0]).abs() < 1e-4, "{} {wo:?}: {x:?}; {}: {y:?}", a.name(), b.name());
        }
    }
    assert!(rough(1.000_099_8, 0.5).narrow() && !rough(1.000_100_4, 0.5).narrow());
    assert!(rough(1.001, 0.009_999_5).narrow() && !rough(1.001, 0.009_999_6).narrow());
}
