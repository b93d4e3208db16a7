//! Passes over the neighbours of each pixel.

use super::grid::{Grid, NOWHERE, Row, TINY, feature_distance, load, store_pixels};
use super::work::Work;
use croupier_simd::F32x8;

/// Weights of the taps: the product of (1 2 1)/4 in both directions.
const KERNEL: [[f32; 3]; 3] = [[0.0625, 0.125, 0.0625], [0.125, 0.25, 0.125], [0.0625, 0.125, 0.0625]];

/// Smooths row `y` of one level: taps `step` apart, 1 <= step <= `MARGIN`. `factor2`: squared standard errors of a
/// difference at which two pixels stop belonging together.
pub(super) fn smooth_row(grid: Grid, step: usize, factor2: f32, y: usize, work: &mut Work<'_>) {
    let inverse = F32x8::ONE / factor2;
    // Above the first row `y + d * step - step` wraps to a row that is not there.
    let rows: [Option<Row<'_>>; 3] = [0, 1, 2].map(|d| grid.row(work.window, (y + d * step).wrapping_sub(step)));
    let Some(own) = rows[1] else { return };
    for x in grid.packets() {
        let [r, g, b, variance] = own.signal.map(|p| load(p, x));
        let (e, f) = ([r, g, b], own.features.map(|p| load(p, x)));
        let mut change = [F32x8::ZERO; 3];
        let center = KERNEL[1][1];
        let (mut total, mut total_variance) = (F32x8::splat(center), variance * (center * center));
        for ((dy, kernel), row) in KERNEL.iter().enumerate().zip(&rows) {
            let Some(row) = row else { continue };
            for (dx, &kernel) in kernel.iter().enumerate() {
                let q = x + dx * step - step;
                // The pixel itself changes nothing: it is in `total` already.
                if dx == 1 && dy == 1 {
                    continue;
                }
                let [r, g, b, variance_q] = row.signal.map(|p| load(p, q));
                let d = [r - e[0], g - e[1], b - e[2]];
                let unlike = feature_distance(row, q, &f);
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
    let rows: [Option<Row<'_>>; 3] = [0, 1, 2].map(|d| grid.row(work.window, (y + d).wrapping_sub(1)));
    let Some(own) = rows[1] else { return };
    for x in grid.packets() {
        let reach = load(own.reach, x);
        let [r, g, b, _] = own.signal.map(|p| load(p, x));
        let e = [r, g, b];
        let (mut low, mut high) = ([F32x8::INFINITY; 3], [-F32x8::INFINITY; 3]);
        for (d, row) in rows.iter().enumerate() {
            let Some(row) = row else { continue };
            for q in (x - 1..x + 2).filter(|&q| d != 1 || q != x) {
                let there = load(row.features[0], q).lt(F32x8::splat(0.5 * NOWHERE));
                for c in 0..3 {
                    let value = load(row.signal[c], q);
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
