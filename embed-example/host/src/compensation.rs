//! Tables that compensated rough materials need at bake time: the core's, with the functions of the standard library.
//! What they are for is said in the core's `bsdf/compensation.rs`.

use crate::math::Std;
use crate::microfacet::RoughPlasticTable;
use croupier::unstable::compose;
use croupier::unstable::scene::blob::COMPENSATION_ENTRIES;

/// The factors s of a conductor of GGX width `alpha`.
pub fn conductor(alpha: f64) -> [f64; COMPENSATION_ENTRIES] {
    compose::compensated_conductor::<Std>(alpha, &mut [[0.0; COMPENSATION_ENTRIES]; COMPENSATION_ENTRIES])
}

/// The factors s with `s x (energy s) = 1`, by the iteration of [`conductor`].
pub(crate) fn balanced<const N: usize>(energy: &[[f64; N]]) -> [f64; N] {
    compose::balanced::<Std, N>(energy)
}

/// Energy that a rough dielectric of width `alpha` scatters to both sides, seen from outside and from inside.
pub fn dielectric(alpha: f64, eta: f64) -> [[f64; COMPENSATION_ENTRIES]; 2] {
    compose::compensated_dielectric::<Std>(alpha, eta)
}

/// Energy that the side of a rough dielectric from which the relative index is `eta` scatters at the cosine `mu`.
pub(crate) fn interface_energy(rule: &[(f64, f64)], alpha: f64, eta: f64, mu: f64) -> f64 {
    compose::interface_energy::<Std>(rule, alpha, eta, mu)
}

/// Table of a compensated coat of width `alpha` and relative index `eta`, with its factors `s` of [`conductor`].
pub fn rough_plastic(alpha: f64, eta: f64, s: &[f64; COMPENSATION_ENTRIES]) -> RoughPlasticTable {
    compose::compensated_plastic::<Std>(alpha, eta, s)
}
