//! Energy that a scattering model gives back under light from everywhere: by its samples, and by the oracle.

use crate::bsdf::{Case, V, combine, lane, splat};
use crate::quadrature::jittered;
use croupier::unstable::scene::blob::MaterialKind;
use croupier::unstable::simd::{F32x8, Mask8};

/// Points that fill the cube evenly (Halton 1960): radical inverses of the number in the bases 2, 3, 5.
fn even(n: usize) -> [f32; 3] {
    [2, 3, 5].map(|base| {
        let (mut n, mut scale, mut x) = (n + 1, 1.0, 0.0);
        while n > 0 {
            scale /= base as f64;
            x += scale * (n % base) as f64;
            n /= base;
        }
        (x as f32).min(1.0 - 1.0 / 16_777_216.0)
    })
}

/// Mean weight over evenly spread numbers, energy factor eta^2 included on transmission.
pub fn mean_weight(case: &Case, wo: V, packets: usize) -> V {
    let model = case.model(Mask8::all_lanes());
    let mut sum = [0.0; 3];
    for n in 0..packets {
        let u: [[f32; 3]; 8] = std::array::from_fn(|l| even(n * 8 + l));
        let s = model.sample(splat(wo), std::array::from_fn(|k| F32x8::from_fn(|l| u[l][k])));
        for l in 0..8 {
            let wi = lane(s.wi, l);
            let scale = if s.valid.lane(l) && wi[2] * wo[2] < 0.0 && case.kind != MaterialKind::ThinDielectric {
                (case.index(wi) / case.index(wo)).powi(2)
            } else {
                1.0
            };
            sum = combine(sum, 1.0, lane(s.weight, l), scale / (8 * packets) as f64);
        }
    }
    sum
}

/// Reflected and transmitted energy of a rough interface by quadrature.
pub fn energy(case: &Case, wo: V, n: usize) -> f64 {
    let mut sum = 0.0;
    for (_, [s, t]) in jittered(n, n) {
        let (m, dm) = case.facet(s, t);
        for reflect in [true, false] {
            let Some((wi, d)) = case.through_facet(wo, m, reflect) else { continue };
            let scale = (case.index(wi) / case.index(wo)).powi(2);
            sum += case.microfacets(wo, wi).f[0] * d * dm * scale / (n * n) as f64;
        }
    }
    sum
}
