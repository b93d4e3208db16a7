//! From scratch memory to the result: mean corrected, color multiplied by albedo.

use super::grid::{FEATURES, Grid, MARGIN, REACH, SIGNAL, TINY, load};
use super::noisy::Noisy;
use super::pixels::NoisyPixels8;
use croupier_simd::F32x8;

/// Squared relative standard error (of `REACH`) above which a pixel takes part in the correction of the mean.
const NOISY: f32 = 1e-2;
/// Bounds of the correction, relative to the noisy pixels' radiance.
const CORRECTION: (f64, f64) = (-0.5, 1.0);

/// Eight pixels of the filtered picture.
struct Filtered {
    e: [F32x8; 3],
    /// 0 where the pixel was exact, about 1 where it was noisy.
    noisy: F32x8,
}

impl Filtered {
    #[inline(always)]
    fn read(grid: Grid, signal: &[f32], features: &[f32], x: usize, y: usize) -> Self {
        let row = grid.row(signal, SIGNAL, y);
        let e: [F32x8; 3] = core::array::from_fn(|c| load(row, c * grid.stride + x));
        // Not the filtered variance: the filter spreads it into exact pixels.
        let reach2 = load(grid.row(features, FEATURES, y), REACH * grid.stride + x).sqr();
        let square = e[0].sqr() + e[1].sqr() + e[2].sqr();
        Self { e, noisy: reach2 / (reach2 + square * NOISY + TINY) }
    }
}

/// Writes the result. Per channel, the radiance that the picture lost is added to its noisy pixels in proportion to
/// theirs; exact pixels, emitters above all, take no part.
pub(super) fn finish(noisy: &Noisy<'_>, grid: Grid, signal: &[f32], features: &[f32], out: [&mut [f32]; 3]) {
    let (mut lost, mut takers) = ([0.0f64; 3], [0.0f64; 3]);
    for y in 0..grid.rows {
        let (mut row_lost, mut row_takers) = ([F32x8::ZERO; 3], [F32x8::ZERO; 3]);
        for x in grid.packets() {
            let (p, f) = (NoisyPixels8::read(noisy, grid, x - MARGIN, y), Filtered::read(grid, signal, features, x, y));
            for c in 0..3 {
                // Unchanged pixels differ by exactly 0: the sum over emitters does not lose the rest in rounding.
                row_lost[c] += p.present.zero_unless((p.e[c] - f.e[c]) * p.divisor[c]);
                row_takers[c] += p.present.zero_unless(f.e[c] * p.divisor[c] * f.noisy);
            }
        }
        for c in 0..3 {
            lost[c] += f64::from(row_lost[c].sum());
            takers[c] += f64::from(row_takers[c].sum());
        }
    }
    let gain: [f32; 3] = core::array::from_fn(|c| {
        if takers[c] > 0.0 { (lost[c] / takers[c]).clamp(CORRECTION.0, CORRECTION.1) as f32 } else { 0.0 }
    });
    let mut out = out;
    for y in 0..grid.rows {
        for x in grid.packets() {
            let column = x - MARGIN;
            let (p, f) = (NoisyPixels8::read(noisy, grid, column, y), Filtered::read(grid, signal, features, x, y));
            for (c, plane) in out.iter_mut().enumerate() {
                let color = f.e[c] * p.divisor[c] * (1.0 + f.noisy * gain[c]);
                let lanes = (grid.columns - column).min(8);
                let at = y * grid.columns + column;
                if let (Some(to), Some(from)) = (plane.get_mut(at..at + lanes), color.to_array().get(..lanes)) {
                    to.copy_from_slice(from);
                }
            }
        }
    }
}
