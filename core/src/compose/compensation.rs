//! Tables that compensated rough materials need, by quadrature in f64. What they are for is said in
//! `bsdf/compensation.rs`.

use super::math::Math;
use super::microfacet::{RoughPlasticTable, fresnel, gauss_legendre, visible};
use crate::scene::blob::{COMPENSATION_ENTRIES, TRANSMITTANCE_ENTRIES};

/// Quadrature points per dimension for reflection.
const POINTS: usize = 96;

/// Quadrature points per dimension for dielectrics, whose integrand has a crease where total reflection begins.
const DIELECTRIC_POINTS: usize = 160;

/// Cosine over alpha that stands for 0, where visible normals have no limit that quadrature could use.
const GRAZING: f64 = 1e-9;

/// Energy that a white conductor scatters from the cosine of each row to that of each column: what
/// [`compensated_conductor`] works on.
pub type EnergyMatrix = [[f64; COMPENSATION_ENTRIES]; COMPENSATION_ENTRIES];

/// Nodes and weights of Gauss-Legendre quadrature.
fn rule<M: Math, const N: usize>() -> [(f64, f64); N] {
    core::array::from_fn(|i| gauss_legendre::<M>(N, i))
}

/// Position of the cosine `mu` in tables of compensation, 0 to 1.
fn coordinate(alpha: f64, mu: f64) -> f64 {
    0.5 * mu * (1.0 + (1.0 + alpha) / (mu + alpha))
}

/// Cosine at each entry.
fn cosines<M: Math>(alpha: f64) -> [f64; COMPENSATION_ENTRIES] {
    core::array::from_fn(|i| {
        // x(mu) = x is mu^2 + b mu = 2 alpha x, in the form whose root does not cancel
        let x = i as f64 / (COMPENSATION_ENTRIES - 1) as f64;
        let (b, c) = (1.0 + 2.0 * alpha - 2.0 * x, 2.0 * alpha * x);
        let root = M::sqrt(b * b + 4.0 * c);
        let mu = if b > 0.0 { 2.0 * c / (b + root) } else { 0.5 * (root - b) };
        mu.clamp(GRAZING * alpha, 1.0)
    })
}

/// `table` at the cosine `mu`, interpolated as the kernels do.
fn lookup(table: &[f64; COMPENSATION_ENTRIES], alpha: f64, mu: f64) -> f64 {
    let (i, t) = cell(alpha, mu);
    let at = |i: usize| table.get(i).copied().unwrap_or(0.0);
    at(i) + t * (at(i + 1) - at(i))
}

/// First entry and weight of the second at the cosine `mu`.
fn cell(alpha: f64, mu: f64) -> (usize, f64) {
    let x = coordinate(alpha, mu) * (COMPENSATION_ENTRIES - 1) as f64;
    let i = (x as usize).min(COMPENSATION_ENTRIES - 2);
    (i, x - i as f64)
}

/// The factors s of a conductor of GGX width `alpha`: `s(mu)` times the energy that a white one scatters, each
/// direction weighted with its own s, is 1 at every entry. By the iteration s <- sqrt(s / (K s)) from s = 1, which
/// halves the distance in every step because K, that energy as a matrix, is positive. K is made in `energy`.
pub fn compensated_conductor<M: Math>(alpha: f64, energy: &mut EnergyMatrix) -> [f64; COMPENSATION_ENTRIES] {
    let rule = rule::<M, POINTS>();
    for (row, mu) in energy.iter_mut().zip(cosines::<M>(alpha)) {
        *row = [0.0; COMPENSATION_ENTRIES];
        visible::<M>(&rule, alpha, mu, |facet, weight| {
            if let Some((z, denominator)) = facet.reflected::<M>() {
                let ((i, t), g1) = (cell(alpha, z), 2.0 * z / denominator);
                if let Some([first, second]) = row.get_mut(i..i + 2) {
                    *first += weight * g1 * (1.0 - t);
                    *second += weight * g1 * t;
                }
            }
        });
    }
    balanced::<M, COMPENSATION_ENTRIES>(energy)
}

/// The factors s with `s x (energy s) = 1`, by the iteration of [`compensated_conductor`].
pub fn balanced<M: Math, const N: usize>(energy: &[[f64; N]]) -> [f64; N] {
    let mut s = [1.0; N];
    for _ in 0..60 {
        let before = s;
        for (s, row) in s.iter_mut().zip(energy) {
            let energy: f64 = row.iter().zip(&before).map(|(k, s)| k * s).sum();
            *s = M::sqrt(*s / energy);
        }
    }
    s
}

/// Energy that a rough dielectric of width `alpha` scatters to both sides, seen from outside and from inside.
pub fn compensated_dielectric<M: Math>(alpha: f64, eta: f64) -> [[f64; COMPENSATION_ENTRIES]; 2] {
    let rule = rule::<M, DIELECTRIC_POINTS>();
    [eta, 1.0 / eta].map(|eta| cosines::<M>(alpha).map(|mu| interface_energy::<M>(&rule, alpha, eta, mu)))
}

/// Energy that the side of a rough dielectric from which the relative index is `eta` scatters at the cosine `mu`.
pub fn interface_energy<M: Math>(rule: &[(f64, f64)], alpha: f64, eta: f64, mu: f64) -> f64 {
    let mut sum = 0.0;
    visible::<M>(rule, alpha, mu, |facet, weight| {
        let (f, cos_t) = fresnel::<M>(facet.cos, eta);
        let g1 = |leaves: Option<(f64, f64)>| leaves.map_or(0.0, |(z, denominator)| 2.0 * z / denominator);
        sum += weight * (f * g1(facet.reflected::<M>()) + (1.0 - f) * g1(facet.refracted::<M>(eta, cos_t)));
    });
    sum
}

/// Table of a compensated coat of width `alpha` and relative index `eta`, with its factors `s` of
/// [`compensated_conductor`]: T is what its reflection leaves, and R = 1 - (cosine-weighted mean of T) / eta^2, so that
/// a white base loses nothing.
pub fn compensated_plastic<M: Math>(alpha: f64, eta: f64, s: &[f64; COMPENSATION_ENTRIES]) -> RoughPlasticTable {
    let rule = rule::<M, POINTS>();
    let last = (TRANSMITTANCE_ENTRIES - 1) as f64;
    let transmittance: [f64; TRANSMITTANCE_ENTRIES] = core::array::from_fn(|i| {
        let mu = (i as f64 / last).max(GRAZING * alpha);
        let outgoing = lookup(s, alpha, mu);
        let mut reflected = 0.0;
        visible::<M>(&rule, alpha, mu, |facet, weight| {
            let f = fresnel::<M>(facet.cos, eta).0;
            if let Some((z, denominator)) = facet.reflected::<M>() {
                let m = outgoing * lookup(s, alpha, z);
                reflected += weight * 2.0 * z / denominator * f * m / (f + m * (1.0 - f));
            }
        });
        (1.0 - reflected).max(0.0)
    });
    // twice the integral of mu T, of a piecewise linear T exactly
    let pairs = transmittance.iter().zip(transmittance.iter().skip(1)).enumerate();
    let mean: f64 =
        pairs.map(|(i, (a, b))| (a * (3 * i + 1) as f64 + b * (3 * i + 2) as f64) / (3.0 * last * last)).sum();
    RoughPlasticTable { transmittance: transmittance.map(|t| t as f32), r: (1.0 - mean / (eta * eta)) as f32 }
}
