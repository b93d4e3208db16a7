//! From the caller's planes to scratch memory: absent pixels filled, color divided by albedo, variance made robust.

use super::grid::{FEATURES, Grid, MARGIN, NOWHERE, REACH, SIGNAL, feature_distance, load, store};
use super::noisy::Noisy;
use super::pixels::{NoisyPixels8, load_or};
use croupier_simd::{F32x8, Mask8};

/// Variance of a pixel that is still to be filled.
const ABSENT: f32 = -1.0;

/// Weight of the squared distance of two normals; a weighted distance of 1 separates. Chosen like `MEMBERSHIP`.
const NORMAL_WEIGHT: f32 = 3.5;
/// Weight of the squared distance of two albedos. Chosen like `MEMBERSHIP`.
const ALBEDO_WEIGHT: f32 = 3.0;
/// Largest change of a pixel towards its neighbours, standard errors.
const DESPECKLE: f32 = 3.0;

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
            let p = NoisyPixels8::read(noisy, grid, column, y);
            let missing = inside.and_not(p.present);
            absent |= missing.any();
            store(v_row, 3 * s + x, missing.select(F32x8::splat(ABSENT), p.variance));
            for c in 0..3 {
                store(e_row, c * s + x, p.e[c]);
                let n = load_or(noisy.normal[c], y * grid.columns + column, 0.0);
                // A NaN becomes -1: any normal serves, as it affects its own pixel only.
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

/// Gives absent pixels the mean of those around them that are present or filled, in two sweeps: what is not reached
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

/// Computes the larger of a pixel's variance and the mean variance around it, among pixels with similar features. With
/// few samples, many pixels have missed the light and have no variance of their own; their neighbours have some.
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
                    let unlike = feature_distance(f_row, s, q, &f);
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
