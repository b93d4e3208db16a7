//! Tables that plastics need at bake time, by quadrature in f64: the core's, with the functions of the standard
//! library.

pub use croupier::unstable::compose::RoughPlasticTable;

use crate::math::Std;
use croupier::unstable::compose;

/// Table of a GGX coat of width `alpha` in (0, 10] and relative index `eta` = int_ior / ext_ior > 0.
pub fn rough_plastic(alpha: f64, eta: f64) -> RoughPlasticTable {
    compose::rough_plastic::<Std>(alpha, eta)
}

/// Diffuse Fresnel reflectance of the smooth interface from inside, `eta` = int_ior / ext_ior: the mean of F over
/// cosine-weighted directions; 0.5963 for 1.5. Error below 1e-6 for |eta - 1| > 1e-3.
pub fn diffuse_fresnel_inside(eta: f64) -> f32 {
    compose::diffuse_fresnel_inside::<Std>(eta)
}

/// A microfacet that is seen from some direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet {
    /// Cosine between view and facet normal, above 0.
    pub(crate) cos: f64,
    facet: compose::Facet,
}

impl Facet {
    /// Cosine z of the reflected direction, and z + q where G1 = 2 z / (z + q); `None` if it leaves through the
    /// surface.
    pub(crate) fn reflected(&self) -> Option<(f64, f64)> {
        self.facet.reflected::<Std>()
    }
}

/// Calls `f` with the normals visible at cosine `mu` and their weights, 1 in all.
pub(crate) fn visible(rule: &[(f64, f64)], alpha: f64, mu: f64, mut f: impl FnMut(Facet, f64)) {
    compose::visible::<Std>(rule, alpha, mu, |facet, weight| f(Facet { cos: facet.cos, facet }, weight));
}

/// Nodes and weights of Gauss-Legendre quadrature on [0, 1].
pub(crate) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n).map(|i| compose::gauss_legendre::<Std>(n, i)).collect()
}
