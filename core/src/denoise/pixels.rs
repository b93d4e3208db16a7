//! Eight pixels of the noisy picture: which are present, and their color divided by albedo.

use super::grid::Grid;
use super::noisy::{COLOR_LIMIT, Noisy, NoisySource};
use croupier_simd::{F32x8, Mask8};

/// Smallest divisor: below it radiance hardly depends on the surface's color.
const ALBEDO_FLOOR: f32 = 0.1;

/// Eight neighbouring pixels of a row, color divided by albedo.
pub(super) struct NoisyPixels8 {
    /// Pixels that are in the picture and finite.
    pub present: Mask8,
    /// Color divided by albedo; 0 unless present.
    pub e: [F32x8; 3],
    /// Variance of `e`, summed over rgb; 0 unless present.
    pub variance: F32x8,
    /// Albedo that `e` is divided by.
    pub divisor: [F32x8; 3],
}

impl NoisyPixels8 {
    /// Pixels `x`, `x + 1`, ... of row `y`. Every call gives the same bits.
    #[inline(always)]
    pub(super) fn read<S: NoisySource>(noisy: &S, grid: Grid, x: usize, y: usize) -> Self {
        let at = y * grid.columns + x;
        let mut present = Mask8::first(grid.columns.saturating_sub(x));
        let (albedo, _) = noisy.features(at);
        let divisor = albedo.map(|a| a.clamp(0.0, 1.0).max(F32x8::splat(ALBEDO_FLOOR)));
        let (color, square) = noisy.color(at);
        for c in 0..3 {
            // Comparisons with NaN are false.
            present &= color[c].abs().le(F32x8::splat(COLOR_LIMIT));
            present &= square[c].le(F32x8::splat(COLOR_LIMIT * COLOR_LIMIT));
        }
        let mut variance = F32x8::ZERO;
        let e = core::array::from_fn(|c| {
            let inverse = 1.0 / divisor[c];
            variance += F32x8::ZERO.max(square[c]) * inverse.sqr();
            present.zero_unless(color[c] * inverse)
        });
        Self { present, e, variance: present.zero_unless(variance), divisor }
    }
}

impl NoisySource for Noisy<'_> {
    #[inline(always)]
    fn color(&self, at: usize) -> ([F32x8; 3], [F32x8; 3]) {
        (self.color.map(|p| load_or(p, at, 0.0)), self.variance.map(|p| load_or(p, at, 0.0)))
    }

    #[inline(always)]
    fn features(&self, at: usize) -> ([F32x8; 3], [F32x8; 3]) {
        (self.albedo.map(|p| load_or(p, at, 1.0)), self.normal.map(|p| load_or(p, at, 0.0)))
    }
}

/// Eight values from `at`, `default` where there are none.
#[inline(always)]
fn load_or(plane: &[f32], at: usize, default: f32) -> F32x8 {
    match plane.get(at..).and_then(|p| p.first_chunk()) {
        Some(a) => F32x8::new(*a),
        None => F32x8::from_fn(|i| plane.get(at + i).copied().unwrap_or(default)),
    }
}
