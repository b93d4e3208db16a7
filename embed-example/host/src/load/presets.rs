//! Media by name.
//!
//! Jensen, Marschner, Levoy, Hanrahan 2001, "A Practical Model for Subsurface Light Transport", figure 5: absorption and
//! *reduced* scattering coefficients per millimetre, measured at red, green and blue. Reduced coefficients
//! sigma_s (1 - g) describe any phase function of mean cosine g in deep multiple scattering (similarity relation), so
//! that g is not measured; with g = 0 the coefficients stand as they are.

/// Named medium.
pub(super) struct Preset {
    pub name: &'static str,
    /// Absorption per millimetre.
    sigma_a: [f64; 3],
    /// Reduced scattering per millimetre.
    reduced: [f64; 3],
}

/// Every preset: marble, whole milk and skim milk of the paper.
pub(super) const PRESETS: &[Preset] = &[
    Preset { name: "marble", sigma_a: [0.0021, 0.0041, 0.0071], reduced: [2.19, 2.62, 3.00] },
    Preset { name: "milk", sigma_a: [0.0011, 0.0024, 0.014], reduced: [2.55, 3.21, 3.77] },
    Preset { name: "skim milk", sigma_a: [0.0014, 0.0025, 0.0142], reduced: [0.70, 1.22, 1.90] },
];

impl Preset {
    /// Absorption and scattering coefficients of a phase function of mean cosine `g`, where one unit of length is
    /// `millimetres` long.
    pub(super) fn coefficients(&self, millimetres: f64, g: f64) -> [[f32; 3]; 2] {
        let per_unit = |x: f64| (x * millimetres) as f32;
        [self.sigma_a.map(per_unit), self.reduced.map(|s| per_unit(s / (1.0 - g)))]
    }
}
