//! Passes over the neighbours of each pixel.

use super::grid::{Grid, NOWHERE, REACH, TINY, feature_distance, load, store_pixels};
use super::work::Work;
use croupier_simd::F32x8;

/// Weights of the taps: the product of (1 2 1)/4 in both directions.
const KERNEL: [[f32; 3]; 3] = [[0.0625, 0.125, 0.0625], [0.125, 0.25, 0.125], [0.0625, 0.125, 0.0625]];

/// Smooths row `y` of one level: taps `step` apart, 1 <= step <= `MARGIN`. `factor2`: squared standard errors of a
/// difference at which two pixels stop belonging together.
pub(super) fn smooth_row(grid: Grid, step: usize, factor2: f32, y: usize, work: &mut Work<'_>) {
    let s = grid.stride;
    let inverse = F32x8::ONE / factor2;
    // Above the first row `y + d * step - step` wraps to a row that is not there.
    let rows: [(&[f32], &[f32]); 3] =
        core::array::from_fn(|d| grid.row(work.window, (y + d * step).wrapping_sub(step)));
    for x in grid.packets() {
        let (e_row, f_row) = rows[1];
        let e: [F32x8; 3] = core::array::from_fn(|c| load(e_row, c * s + x));
        let variance = load(e_row, 3 * s + x);
        let f: [F32x8; 6] = core::array::from_fn(|c| load(f_row, c * s + x));
        let mut change = [F32x8::ZERO; 3];
        let center = KERNEL[1][1];
        let (mut total, mut total_variance) = (F32x8::splat(center), variance * (center * center));
        for (kernel, (e_row, f_row)) in KERNEL.iter().zip(rows) {
            if e_row.is_empty() {
                continue;
            }
            for (dx, &kernel) in kernel.iter().enumerate() {
                let q = x + dx * step - step;
                // The pixel itself, in the middle row only, changes nothing: it is in `total` already.
                if dx == 1 && core::ptr::eq(e_row, rows[1].0) {
                    continue;
                }
                let d: [F32x8; 3] = core::array::from_fn(|c| load(e_row, c * s + q) - e[c]);
                let variance_q = load(e_row, 3 * s + q);
                let unlike = feature_distance(f_row, s, q, &f);
                let apart = (d[0].sqr() + d[1].sqr() + d[2].sqr()) * inverse / (variance + variance_q + TINY);
                let w = F32x8::ZERO.max(1.0 - apart - unlike).sqr() * kernel;
                for c in 0..3 {
                    change[c] += w * d[c];
                }
                total += w;
                total_variance += w.sqr() * variance_q;
            }
        }
        let (scale, to) = (1.0 / total, grid.pixels(x, y));
        for (c, plane) in work.e.iter_mut().enumerate() {
            store_pixels(plane, to, e[c] + change[c] * scale);
        }
        store_pixels(work.variance, to, total_variance * scale.sqr());
    }
}

/// Moves a pixel of row `y` that is beyond all its neighbours, in a channel, to the nearest of them, as far as its error allows.
/// Pixels that no neighbour resembled (mixed ones on outlines) have kept their noise until here.
pub(super) fn despeckle_row(grid: Grid, y: usize, work: &mut Work<'_>) {
    let s = grid.stride;
    let rows: [(&[f32], &[f32]); 3] = core::array::from_fn(|d| grid.row(work.window, (y + d).wrapping_sub(1)));
    for x in grid.packets() {
        let reach = load(rows[1].1, REACH * s + x);
        let e: [F32x8; 3] = core::array::from_fn(|c| load(rows[1].0, c * s + x));
        let (mut low, mut high) = ([F32x8::INFINITY; 3], [-F32x8::INFINITY; 3]);
        for (d, (e_row, f_row)) in rows.into_iter().enumerate() {
            if e_row.is_empty() {
                continue;
            }
            for q in (x - 1..x + 2).filter(|&q| d != 1 || q != x) {
                let there = load(f_row, q).lt(F32x8::splat(0.5 * NOWHERE));
                for c in 0..3 {
                    let value = load(e_row, c * s + q);
                    low[c] = there.select(low[c].min(value), low[c]);
                    high[c] = there.select(high[c].max(value), high[c]);
                }
            }
        }
        for (c, plane) in work.e.iter_mut().enumerate() {
            // Without any neighbour both bounds are infinite, in reverse order.
            let isolated = low[c].gt(high[c]);
            let bounded = e[c].max(low[c].min(e[c] + reach)).min(high[c].max(e[c] - reach));
            store_pixels(plane, grid.pixels(x, y), isolated.select(e[c], bounded));
        }
    }
}
