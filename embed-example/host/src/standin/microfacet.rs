//! Stand-in: zeros.
pub struct RoughPlasticTable {
    pub transmittance: [f32; 64],
    pub r: f32,
}

pub fn rough_plastic(_alpha: f64, _eta: f64) -> RoughPlasticTable {
    RoughPlasticTable { transmittance: [0.9; 64], r: 0.59 }
}

pub fn diffuse_fresnel_inside(_eta: f64) -> f32 {
    0.5963
}
