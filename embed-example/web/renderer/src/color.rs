//! From values of pixels to bytes of a canvas, by tables that are made for each picture.

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

/// Linear values as sRGB, 0 to 255.
fn encode(x: F32x8) -> F32x8 {
    let room = 1.0 - SHOULDER;
    let above = F32x8::ONE - ((x - SHOULDER) * (-1.0 / room)).exp() * room;
    let x = x.gt(F32x8::splat(SHOULDER)).select(above, x);
    // IEC 61966-2-1
    let power = x.powf(F32x8::splat(1.0 / 2.4)) * 1.055 - 0.055;
    x.le(F32x8::splat(0.003_130_8)).select(x * 12.92, power) * 255.0
}

/// Entries of the table of encoded values, by the square root of the linear value: steps of less than a third of a byte.
const ENTRIES: usize = 4096;
/// Linear value of the last entry, which is white.
const WHITE: f32 = 8.0;

fn encoded() -> [u8; ENTRIES] {
    let mut table = [0; ENTRIES];
    for (entries, first) in table.chunks_mut(8).zip((0u16..).step_by(8)) {
        let root = F32x8::from_fn(|k| f32::from(first) + k as f32) / (ENTRIES - 1) as f32;
        let bytes = (encode(root * root * WHITE) + 0.5).to_array();
        entries.iter_mut().zip(bytes).for_each(|(to, byte)| *to = byte as u8);
    }
    table
}

/// See [`crate::tone_map`].
pub(crate) fn tone_map(from: &[[f32; 4]], gain: f32, out: &mut [[u8; 4]]) {
    let table = encoded();
    let scale = gain / WHITE;
    for (from, out) in from.chunks(2).zip(out.chunks_mut(2)) {
        let values = from.as_flattened();
        let x = F32x8::from_fn(|k| values.get(k).copied().unwrap_or(0.0)) * scale;
        // comparisons with NaN are false
        let x = x.gt(F32x8::ZERO).select(x, F32x8::ZERO).min(F32x8::ONE);
        let places = (x.sqrt() * (ENTRIES - 1) as f32 + 0.5).to_array();
        for ((to, from), places) in out.iter_mut().zip(from).zip(places.chunks(4)) {
            let byte = |c: usize| places.get(c).and_then(|x| table.get(*x as usize)).copied().unwrap_or(0);
            *to = [byte(0), byte(1), byte(2), if from[3] > 0.0 { 255 } else { 0 }];
        }
    }
}

/// The upper half of the bits of a positive float grows with it, in steps of less than 1 %.
fn upper_half(x: f32) -> usize {
    (x.to_bits() >> 16) as usize
}

/// Upper halves from that of the smallest factor to that of the largest.
const HALVES: usize = 1110;

/// See [`crate::false_colors`].
pub(crate) fn false_colors(from: &[[f32; 4]], out: &mut [[u8; 4]]) {
    let (first, last) = (upper_half(1.0 / LARGEST), (STOPS.len() - 1) as f32);
    let mut table = [NO_VALUE; HALVES];
    let end = F32x8::splat(LARGEST).ln();
    for (entries, half) in table.chunks_mut(8).zip((first..).step_by(8)) {
        let factors = F32x8::from_fn(|k| f32::from_bits(((half + k) as u32) << 16 | 0x8000));
        // 1 is in the middle of the logarithmic scale
        let places = ((factors.ln() / end + 1.0) * (last / 2.0)).clamp(0.0, last).to_array();
        entries.iter_mut().zip(places).for_each(|(to, place)| *to = stop(place));
    }
    for (to, pixel) in out.iter_mut().zip(from) {
        let has_value = pixel[3] > 0.0 && pixel[0] > 0.0;
        let entry = upper_half(pixel[0]).saturating_sub(first).min(HALVES - 1);
        *to = table.get(entry).copied().filter(|_| has_value).unwrap_or(NO_VALUE);
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
