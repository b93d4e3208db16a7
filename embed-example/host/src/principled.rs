//! Tables that principled materials need at bake time, by quadrature in f64. What they are for is said in the core's
//! `bsdf/principled.rs`.

use crate::compensation;
use crate::microfacet::{self, Facet};
use croupier::unstable::bsdf::principled::NODES;
use croupier::unstable::scene::blob::{
    ALPHA_RANGE, COMPENSATION_RANGE, ENERGY_RANGE, EnergyRow, LayerRecord, PRINCIPLED_COLUMNS, PRINCIPLED_ENERGY_ROWS,
    PRINCIPLED_NODES, PRINCIPLED_ROWS, ReflectionRow,
};
use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Quadrature points per dimension.
const POINTS: usize = 64;

/// Cosine over alpha that stands for 0, where visible normals have no limit that quadrature could use.
const GRAZING: f64 = 1e-9;

/// GGX width of the row `i` of `rows`.
fn width(i: usize, rows: usize) -> f64 {
    (i as f64 / (rows - 1) as f64).powi(2).max(f64::from(ALPHA_RANGE[0]))
}

/// Cosine of a column.
fn cosine(column: usize) -> f64 {
    (column as f64 / (PRINCIPLED_COLUMNS - 1) as f64).powi(2)
}

/// First column and weight of the second at the cosine `mu`.
fn cell(mu: f64) -> (usize, f64) {
    let x = mu.sqrt() * (PRINCIPLED_COLUMNS - 1) as f64;
    let i = (x as usize).min(PRINCIPLED_COLUMNS - 2);
    (i, x - i as f64)
}

/// Calls `f` with the facets that reflect at the cosine `mu`, the cosine of the reflected direction and the energy.
fn reflected(rule: &[(f64, f64)], alpha: f64, mu: f64, mut f: impl FnMut(Facet, f64, f64)) {
    microfacet::visible(rule, alpha, mu.max(GRAZING * alpha), |facet, weight| {
        if let Some((z, denominator)) = facet.reflected() {
            f(facet, z, weight * 2.0 * z / denominator);
        }
    });
}

/// Single-scattering albedos of Schlick's `1 - (1 - c)^5` and of `(1 - c)^5` at the cosine `mu`.
fn schlick(rule: &[(f64, f64)], alpha: f64, mu: f64) -> [f64; 2] {
    let mut sums = [0.0; 2];
    reflected(rule, alpha, mu, |facet, _, energy| {
        let w = (1.0 - facet.cos).max(0.0).powi(5);
        sums[0] += energy * (1.0 - w);
        sums[1] += energy * w;
    });
    sums
}

fn share(x: f64) -> f32 {
    (x as f32).clamp(0.0, 1.0)
}

/// One row of the tables of GGX reflection. The factors s are those of [`compensation::conductor`] on these columns.
fn reflection_row(rule: &[(f64, f64)], alpha: f64) -> ReflectionRow {
    const N: usize = PRINCIPLED_COLUMNS;
    let mut energy = vec![[0.0; N]; N];
    for (column, row) in energy.iter_mut().enumerate() {
        reflected(rule, alpha, cosine(column), |_, z, e| {
            let (i, t) = cell(z);
            row[i] += e * (1.0 - t);
            row[i + 1] += e * t;
        });
    }
    let s: [f64; N] = compensation::balanced(&energy);
    let factor = |s: f64| (s as f32).clamp(COMPENSATION_RANGE[0], COMPENSATION_RANGE[1]);
    ReflectionRow {
        columns: std::array::from_fn(|i| {
            let [normal, grazing] = schlick(rule, alpha, cosine(i)).map(share);
            [normal, grazing, factor(s[i]), 0.0]
        }),
        nodes: NODES.map(|(squared, _)| schlick(rule, alpha, f64::from(squared).sqrt()).map(share)),
    }
}

/// The tables of GGX reflection that all principled materials share, computed once.
pub fn reflection() -> &'static [ReflectionRow; PRINCIPLED_ROWS] {
    static ROWS: OnceLock<[ReflectionRow; PRINCIPLED_ROWS]> = OnceLock::new();
    ROWS.get_or_init(|| {
        let rule = microfacet::gauss_legendre(POINTS);
        std::array::from_fn(|i| reflection_row(&rule, width(i, PRINCIPLED_ROWS)))
    })
}

/// Energy that a rough interface of relative index `eta` scatters to both sides. Tables are kept for the life of the process: a program that bakes again and again needs few of them.
pub fn energy(eta: f64) -> [EnergyRow; PRINCIPLED_ENERGY_ROWS] {
    type Known = HashMap<u64, Box<[EnergyRow; PRINCIPLED_ENERGY_ROWS]>>;
    static KNOWN: Mutex<Option<Known>> = Mutex::new(None);
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    **known.get_or_insert_default().entry(eta.to_bits()).or_insert_with(|| Box::new(energy_rows(eta)))
}

fn energy_rows(eta: f64) -> [EnergyRow; PRINCIPLED_ENERGY_ROWS] {
    let rule = microfacet::gauss_legendre(POINTS);
    std::array::from_fn(|i| {
        // as wide as the kernel makes it
        let least = 1.01e-5 / (eta - 1.0).abs();
        let alpha = width(i, PRINCIPLED_ENERGY_ROWS).max(least);
        let side = |eta: f64| {
            std::array::from_fn(|column| {
                let e = compensation::interface_energy(&rule, alpha, eta, cosine(column).max(GRAZING * alpha));
                (e as f32).clamp(ENERGY_RANGE[0], ENERGY_RANGE[1])
            })
        };
        EnergyRow { sides: [side(eta), side(1.0 / eta)] }
    })
}

/// A layer whose albedo at a cosine is `of`.
fn layer(of: impl Fn(f64) -> f64) -> LayerRecord {
    LayerRecord {
        albedo: std::array::from_fn(|i| share(of(cosine(i)))),
        nodes: NODES.map(|(squared, _)| share(of(f64::from(squared).sqrt()))),
    }
}

/// The coat of index 1.5 and GGX width `alpha`.
pub fn coat(alpha: f64) -> LayerRecord {
    let rule = microfacet::gauss_legendre(POINTS);
    layer(|mu| {
        let [normal, grazing] = schlick(&rule, alpha, mu);
        0.04 * normal + grazing
    })
}

/// Nothing.
pub const NO_LAYER: LayerRecord = LayerRecord { albedo: [0.0; PRINCIPLED_COLUMNS], nodes: [0.0; PRINCIPLED_NODES] };

/// Exponent of the masking of fibres (Estevez & Kulla 2017) at the cosine `mu`.
fn masking(alpha: f64, mu: f64) -> f64 {
    let t = (1.0 - alpha).powi(2);
    let mix = |rough: f64, smooth: f64| rough + t * (smooth - rough);
    let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
    let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
    let l = |x: f64| a / (1.0 + b * x.powf(c)) + d * x + e;
    if mu < 0.5 { l(mu).exp() } else { (2.0 * l(0.5) - l(1.0 - mu)).exp() }
}

/// Albedo of white fibres of width `alpha` at the cosine `mu`, not limited to 1.
pub fn sheen_albedo(alpha: f64, mu: f64) -> f64 {
    let rule = microfacet::gauss_legendre(POINTS);
    let mu = mu.max(1e-4);
    let wo = [(1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu];
    let mut sum = 0.0;
    for &(t, weight) in &rule {
        // more points where the light grazes
        let (z, dz) = (t * t, 2.0 * t);
        let sine = (1.0 - z * z).sqrt();
        for &(v, weight_v) in &rule {
            let (s, c) = (PI * v).sin_cos();
            let h = [wo[0] + sine * c, sine * s, wo[2] + z];
            let sin2 = (h[0] * h[0] + h[1] * h[1]) / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
            let d = (2.0 + 1.0 / alpha) * sin2.powf(0.5 / alpha) / (2.0 * PI);
            let f = d / (4.0 * mu * (1.0 + masking(alpha, mu) + masking(alpha, z)));
            sum += f * weight * dz * weight_v * 2.0 * PI;
        }
    }
    sum
}

/// Fibres of width `alpha`.
pub fn sheen(alpha: f64) -> LayerRecord {
    layer(|mu| sheen_albedo(alpha, mu))
}
