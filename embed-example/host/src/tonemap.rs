//! Tone mapping: from linear radiance to 8-bit sRGB.

use crate::image::Rgb;

/// Curve that brings values above the display's range into it, per channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Curve {
    /// Clamp to [0, 1]: exact up to white. Used by comparisons.
    Clamp,
    /// Exact up to [`SHOULDER`], then an exponential that reaches white at infinity, with a continuous slope: midtones
    /// are as with [`Curve::Clamp`], highlights keep some contrast. Used by `croupier render`.
    #[default]
    Shoulder,
}

/// Linear value where [`Curve::Shoulder`] leaves the straight line.
pub const SHOULDER: f32 = 0.7;

impl Curve {
    /// Linear display value in [0, 1]; NaN gives 0.
    pub fn apply(self, x: f32) -> f32 {
        if x.is_nan() || x <= 0.0 {
            return 0.0;
        }
        match self {
            Self::Clamp => x.min(1.0),
            Self::Shoulder if x <= SHOULDER => x,
            Self::Shoulder => 1.0 - (1.0 - SHOULDER) * (-(x - SHOULDER) / (1.0 - SHOULDER)).exp(),
        }
    }
}

/// Linear display values in [0, 1]: each value times 2^`exposure`, then bent by `curve`.
pub fn expose(image: &Rgb, exposure: f32, curve: Curve) -> Vec<[f32; 3]> {
    let gain = exposure.exp2();
    image.pixels.iter().map(|p| p.map(|x| curve.apply(x * gain))).collect()
}

/// The sRGB transfer function (IEC 61966-2-1): linear [0, 1] to encoded [0, 1].
pub fn srgb(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// [`expose`]d, [`srgb`]-encoded and rounded to 8 bits.
pub fn tonemap(image: &Rgb, exposure: f32, curve: Curve) -> Vec<[u8; 3]> {
    let encode = |x: f32| (srgb(x) * 255.0).round() as u8;
    expose(image, exposure, curve).into_iter().map(|p| p.map(encode)).collect()
}
