//! From the caller's planes to scratch memory: absent pixels filled, color divided by albedo, variance made robust.

use super::{
    ALBEDO_FLOOR, ALBEDO_WEIGHT, COLOR_LIMIT, DESPECKLE, FEATURES, Grid, MARGIN, NORMAL_WEIGHT, NOWHERE, Noisy, REACH,
    SIGNAL, load, store,
};
use croupier_simd::{F32x8, Mask8};

/// Variance of a pixel that is still to be filled.
const ABSENT: f32 = -1.0;

/// Eight neighbouring pixels of a row as the filter sees them.
pub(super) struct Pixels {
    /// Which are in the picture and finite.
    pub present: Mask8,
    /// Color divided by albedo; 0 unless present.
    pub e: [F32x8; 3],
    /// Variance of `e`, summed over rgb; 0 unless present.
    pub variance: F32x8,
    /// The albedo that it is divided by.
    pub divisor: [F32x8; 3],
    albedo: [F32x8; 3],
}

impl Pixels {
    /// Pixels `x`, `x + 1`, ... of row `y`. The same bits whenever it is called.
    #[inline(always)]
    pub(super) fn read(noisy: &Noisy<'_>, grid: Grid, x: usize, y: usize) -> Self {
        let at = y * grid.columns + x;
        let mut present = Mask8::first(grid.columns.saturating_sub(x));
        let albedo: [F32x8; 3] = core::array::from_fn(|c| gather(noisy.albedo[c], at, 1.0).clamp(0.0, 1.0));
        let divisor = albedo.map(|a| a.max(F32x8::splat(ALBEDO_FLOOR)));
        let color: [F32x8; 3] = core::array::from_fn(|c| gather(noisy.color[c], at, 0.0));
        let square: [F32x8; 3] = core::array::from_fn(|c| gather(noisy.variance[c], at, 0.0));
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
        Self { present, e, variance: present.zero_unless(variance), divisor, albedo }
    }
}

/// Eight values from `at`, `default` where there are none.
#[inline(always)]
fn gather(plane: &[f32], at: usize, default: f32) -> F32x8 {
    match plane.get(at..).and_then(|p| p.first_chunk()) {
        Some(a) => F32x8::new(*a),
        None => F32x8::from_fn(|i| plane.get(at + i).copied().unwrap_or(default)),
    }
}

/// Fills `signal` and `features`; `other` is the block that the first level will write.
pub(super) fn prepare(noisy: &Noisy<'_>, grid: Grid, signal: &mut [f32], other: &mut [f32], features: &mut [f32]) {
    let s = grid.stride;
    let (normal_scale, albedo_scale) = (F32x8::splat(NORMAL_WEIGHT).sqrt(), F32x8::splat(ALBEDO_WEIGHT).sqrt());
    let mut absent = false;
    for y in 0..grid.rows {
        for (block, planes) in [(&mut *signal, SIGNAL), (&mut *other, SIGNAL), (&mut *features, FEATURES)] {
            for plane in grid.row_mut(block, planes, y).chunks_exact_mut(s) {
                plane[..MARGIN].fill(0.0);
                plane[MARGIN + grid.padded..].fill(0.0);
            }
        }
        let e_row = grid.row_mut(signal, SIGNAL, y);
        let v_row = grid.row_mut(other, SIGNAL, y);
        let f_row = grid.row_mut(features, FEATURES, y);
        for margin in [0..MARGIN, MARGIN + grid.padded..s] {
            f_row.get_mut(margin).unwrap_or(&mut []).fill(NOWHERE);
        }
        for x in grid.packets() {
            let column = x - MARGIN;
            let inside = Mask8::first(grid.columns - column);
            let p = Pixels::read(noisy, grid, column, y);
            let missing = inside.and_not(p.present);
            absent |= missing.any();
            store(v_row, 3 * s + x, missing.select(F32x8::splat(ABSENT), p.variance));
            for c in 0..3 {
                store(e_row, c * s + x, p.e[c]);
                let n = gather(noisy.normal[c], y * grid.columns + column, 0.0);
                // A NaN becomes -1: some normal, which only its own pixel is judged by.
                let n = n.clamp(-1.0, 1.0) * normal_scale;
                let outside = if c == 0 { NOWHERE } else { 0.0 };
                store(f_row, c * s + x, inside.select(n, F32x8::splat(outside)));
                store(f_row, (3 + c) * s + x, p.albedo[c] * albedo_scale);
            }
        }
    }
    if absent {
        fill(grid, signal, other);
    }
    smooth_variance(grid, other, signal, features);
}

/// Gives absent pixels the mean of those around them that are present or filled, in two sweeps: whatever is not reached
/// from above and left is reached from below and right. Without any pixel the picture is black.
fn fill(grid: Grid, signal: &mut [f32], other: &mut [f32]) {
    let pixels = grid.columns * grid.rows;
    for i in (0..pixels).chain((0..pixels).rev()) {
        let (x, y) = (i % grid.columns, i / grid.columns);
        let at = |x: usize, plane: usize| plane * grid.stride + MARGIN + x;
        let value = |block: &[f32], x, y, plane| grid.row(block, SIGNAL, y).get(at(x, plane)).copied().unwrap_or(0.0);
        if value(other, x, y, 3) >= 0.0 {
            continue;
        }
        let (mut sum, mut count) = ([0.0f32; SIGNAL], 0.0f32);
        for v in y.saturating_sub(1)..(y + 2).min(grid.rows) {
            for u in x.saturating_sub(1)..(x + 2).min(grid.columns) {
                let variance = value(other, u, v, 3);
                if variance >= 0.0 {
                    count += 1.0;
                    sum[3] += variance;
                    for (c, sum) in sum.iter_mut().take(3).enumerate() {
                        *sum += value(signal, u, v, c);
                    }
                }
            }
        }
        if count > 0.0 {
            for (c, sum) in sum.into_iter().enumerate() {
                let block = if c == 3 { &mut *other } else { &mut *signal };
                if let Some(x) = grid.row_mut(block, SIGNAL, y).get_mut(at(x, c)) {
                    *x = sum / count;
                }
            }
        }
    }
}

/// The larger of a pixel's variance and the mean variance around it, among pixels with like features. Of few samples
/// many have seen none of the light and know of no error; their neighbours do.
fn smooth_variance(grid: Grid, from: &[f32], to: &mut [f32], features: &mut [f32]) {
    let s = grid.stride;
    for y in 0..grid.rows {
        for x in grid.packets() {
            let f: [F32x8; 6] = core::array::from_fn(|c| load(grid.row(features, FEATURES, y), c * s + x));
            // Where a whole picture is absent the variance is still negative.
            let own = F32x8::ZERO.max(load(grid.row(from, SIGNAL, y), 3 * s + x));
            let (mut sum, mut total) = (own * 4.0, F32x8::splat(4.0));
            for d in 0..3 {
                let row = (y + d).wrapping_sub(1);
                let (v_row, f_row) = (grid.row(from, SIGNAL, row), grid.row(features, FEATURES, row));
                if v_row.is_empty() {
                    continue;
                }
                for q in (x - 1..x + 2).filter(|&q| d != 1 || q != x) {
                    let g: [F32x8; 6] = core::array::from_fn(|c| (load(f_row, c * s + q) - f[c]).sqr());
                    let unlike = ((g[0] + g[1]) + (g[2] + g[3])) + (g[4] + g[5]);
                    let w = F32x8::ZERO.max(1.0 - unlike) * if d == 1 || q == x { 2.0 } else { 1.0 };
                    sum += w * F32x8::ZERO.max(load(v_row, 3 * s + q));
                    total += w;
                }
            }
            let variance = own.max(sum / total);
            store(grid.row_mut(to, SIGNAL, y), 3 * s + x, variance);
            store(grid.row_mut(features, FEATURES, y), REACH * s + x, variance.sqrt() * DESPECKLE);
        }
    }
}
