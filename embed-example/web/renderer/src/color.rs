//! From values of pixels to bytes of a canvas, eight pixels at a time.

use croupier::unstable::simd::F32x8;

/// Linear value where the curve for highlights leaves the straight line; from there an exponential reaches white at
/// infinity with a continuous slope. The curve of `croupier render`.
const SHOULDER: f32 = 0.7;

/// Largest and, as 1 over it, smallest factor on the scale.
const LARGEST: f32 = 20.0;

/// Stops of the scale at equal distances, sRGB: `RdBu` of ColorBrewer with its centre made white.
const STOPS: [[u8; 3]; 9] = [
    [103, 0, 31],
    [178, 24, 43],
    [214, 96, 77],
    [244, 165, 130],
    [255, 255, 255],
    [146, 197, 222],
    [67, 147, 195],
    [33, 102, 172],
    [5, 48, 97],
];

/// Opaque grey of pixels that no path has a vertex in.
const NO_VALUE: [u8; 4] = [48, 50, 54, 255];

/// The value `channel` of up to eight pixels; 0 beyond the last.
fn gather(pixels: &[[f32; 4]], channel: usize) -> F32x8 {
    F32x8::from_fn(|k| pixels.get(k).and_then(|p| p.get(channel)).copied().unwrap_or(0.0))
}

/// Linear values as sRGB, 0 to 255.
fn encode(x: F32x8) -> F32x8 {
    // comparisons with NaN are false
    let x = x.gt(F32x8::ZERO).select(x, F32x8::ZERO);
    let room = 1.0 - SHOULDER;
    let above = F32x8::ONE - ((x - SHOULDER) * (-1.0 / room)).exp() * room;
    let x = x.gt(F32x8::splat(SHOULDER)).select(above, x);
    // IEC 61966-2-1
    let power = x.powf(F32x8::splat(1.0 / 2.4)) * 1.055 - 0.055;
    x.le(F32x8::splat(0.003_130_8)).select(x * 12.92, power) * 255.0
}

/// See [`crate::tone_map`].
pub(crate) fn tone_map(from: &[[f32; 4]], gain: f32, out: &mut [[u8; 4]]) {
    for (from, out) in from.chunks(8).zip(out.chunks_mut(8)) {
        let [r, g, b] = [0, 1, 2].map(|c| (encode(gather(from, c) * gain) + 0.5).to_array());
        let alpha = from.iter().map(|p| if p[3] > 0.0 { 255 } else { 0 });
        for ((((to, r), g), b), a) in out.iter_mut().zip(r).zip(g).zip(b).zip(alpha) {
            *to = [r as u8, g as u8, b as u8, a];
        }
    }
}

/// See [`crate::false_colors`].
pub(crate) fn false_colors(from: &[[f32; 4]], out: &mut [[u8; 4]]) {
    let last = (STOPS.len() - 1) as f32;
    for (from, out) in from.chunks(8).zip(out.chunks_mut(8)) {
        // 1 is in the middle of the logarithmic scale
        let end = F32x8::splat(LARGEST).ln();
        let place = (gather(from, 0).ln() / end + 1.0) * (last / 2.0);
        for ((to, pixel), place) in out.iter_mut().zip(from).zip(place.clamp(0.0, last).to_array()) {
            *to = if pixel[3] > 0.0 && pixel[0] > 0.0 { stop(place) } else { NO_VALUE };
        }
    }
}

/// The colour at a place of the scale, 0 to 8.
fn stop(place: f32) -> [u8; 4] {
    let i = (place as usize).min(STOPS.len() - 2);
    let t = place - i as f32;
    let [Some(a), Some(b)] = [STOPS.get(i), STOPS.get(i + 1)] else { return NO_VALUE };
    let [r, g, b] = core::array::from_fn(|c| {
        let (a, b) = (f32::from(a[c]), f32::from(b[c]));
        (a + (b - a) * t + 0.5) as u8
    });
    [r, g, b, 255]
}

/// See [`crate::average`].
pub(crate) fn average(into: &mut [[f32; 4]], from: &[[f32; 4]]) {
    for (a, b) in into.iter_mut().zip(from) {
        let samples = a[3] + b[3];
        if b[3] > 0.0 {
            let share = b[3] / samples;
            (0..3).for_each(|c| a[c] += (b[c] - a[c]) * share);
            a[3] = samples;
        }
    }
}
