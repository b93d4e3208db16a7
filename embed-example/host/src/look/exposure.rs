//! Exposure from a picture.

use crate::image::Rgb;
use croupier::unstable::light::luminance;

/// Luminance that the geometric mean of the picture is brought to.
const KEY: f64 = 0.32;
/// Luminance that the brightest but a few pixels may reach.
const BRIGHT: f64 = 0.92;
/// Share of the pixels that are darker or brighter than those looked at.
const TRIM: f64 = 0.05;

/// Exposure in stops that suits a picture: the geometric mean of its luminance, without the darkest and the brightest
/// 5 %, becomes 0.32, less where the brightest 5 % would then begin above 0.92. Black pixels do not count; a black picture has 0.
pub fn auto(image: &Rgb) -> f32 {
    let found = image.pixels.iter().map(|p| luminance(*p)).filter(|l| *l > 0.0 && l.is_finite());
    let mut found: Vec<f64> = found.collect();
    found.sort_by(f64::total_cmp);
    let trimmed = (found.len() as f64 * TRIM) as usize;
    let Some(kept) = found.get(trimmed..found.len() - trimmed).filter(|k| !k.is_empty()) else { return 0.0 };
    let mean = kept.iter().map(|l| l.ln()).sum::<f64>() / kept.len() as f64;
    let bright = kept.last().copied().unwrap_or(1.0);
    let gain = (KEY / mean.exp()).min(BRIGHT / bright);
    (gain.log2() as f32).clamp(-100.0, 100.0)
}
