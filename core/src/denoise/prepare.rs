//! From the noisy picture to planes: absent pixels filled, color divided by albedo, variance made robust; and from planes
//! to the window of rows.

use super::grid::{
    FEATURES, Grid, MARGIN, NOWHERE, REACH, Row, SIGNAL, feature_distance, load, load_pixels, store, store_pixels,
};
use super::noisy::NoisySource;
use super::pixels::NoisyPixels8;
use super::work::Work;
use croupier_simd::{F32x8, Mask8};

/// Variance of a pixel that is still to be filled.
const ABSENT: f32 = -1.0;

/// Weight of the squared distance of two normals; a weighted distance of 1 separates. Chosen like `MEMBERSHIP`.
const NORMAL_WEIGHT: f32 = 3.5;
/// Weight of the squared distance of two albedos. Chosen like `MEMBERSHIP`.
const ALBEDO_WEIGHT: f32 = 3.0;
/// Largest change of a pixel towards its neighbours, standard errors.
const DESPECKLE: f32 = 3.0;

/// Fills row `y` of the planes from the noisy picture; `true` if a pixel of it is absent.
pub(super) fn prepare_row<S: NoisySource>(noisy: &S, grid: Grid, y: usize, work: &mut Work<'_>) -> bool {
    let mut absent = false;
    for x in grid.packets() {
        let to = grid.pixels(x, y);
        let inside = Mask8::first(to.1);
        let p = NoisyPixels8::read(noisy, grid, x - MARGIN, y);
        let missing = inside.and_not(p.present);
        absent |= missing.any();
        store_pixels(work.variance, to, missing.select(F32x8::splat(ABSENT), p.variance));
        for (plane, e) in work.e.iter_mut().zip(p.e) {
            store_pixels(plane, to, e);
        }
    }
    absent
}

/// Gives an absent pixel the mean of those around it that are present or filled.
fn fill_pixel(grid: Grid, x: usize, y: usize, work: &mut Work<'_>) {
    let at = y * grid.columns + x;
    let present = |work: &Work<'_>, at: usize| work.variance.get(at).copied().filter(|v| *v >= 0.0);
    if present(work, at).is_some() {
        return;
    }
    let (mut sum, mut count) = ([0.0f32; SIGNAL], 0.0f32);
    for v in y.saturating_sub(1)..(y + 2).min(grid.rows) {
        for u in x.saturating_sub(1)..(x + 2).min(grid.columns) {
            let at = v * grid.columns + u;
            if let Some(variance) = present(work, at) {
                count += 1.0;
                sum[3] += variance;
                for (sum, plane) in sum.iter_mut().zip(work.e.iter()) {
                    *sum += plane.get(at).copied().unwrap_or(0.0);
                }
            }
        }
    }
    if count > 0.0 {
        let [r, g, b] = work.e.each_mut().map(|p| &mut **p);
        for (plane, sum) in [r, g, b, &mut *work.variance].into_iter().zip(sum) {
            if let Some(p) = plane.get_mut(at) {
                *p = sum / count;
            }
        }
    }
}

/// Fills the absent pixels of row `y`, from left to right or back. In two sweeps what is not reached from above and left
/// is reached from below and right. Without any pixel the picture is black.
pub(super) fn fill_row(grid: Grid, y: usize, back: bool, work: &mut Work<'_>) {
    for i in 0..grid.columns {
        fill_pixel(grid, if back { grid.columns - 1 - i } else { i }, y, work);
    }
}

/// Copies row `y` of the planes to the window, with its features.
pub(super) fn load_row<S: NoisySource>(noisy: &S, grid: Grid, y: usize, work: &mut Work<'_>) {
    let s = grid.stride;
    let (normal_scale, albedo_scale) = (F32x8::splat(NORMAL_WEIGHT).sqrt(), F32x8::splat(ALBEDO_WEIGHT).sqrt());
    let (signal, features) = grid.row_mut(work.window, y);
    if signal.is_empty() {
        return;
    }
    for (block, planes) in [(&mut *signal, SIGNAL), (&mut *features, FEATURES)] {
        for plane in block.chunks_exact_mut(s.max(1)).take(planes) {
            for margin in [0..MARGIN, MARGIN + grid.padded..s] {
                plane.get_mut(margin).unwrap_or(&mut []).fill(0.0);
            }
        }
    }
    for margin in [0..MARGIN, MARGIN + grid.padded..s] {
        features.get_mut(margin).unwrap_or(&mut []).fill(NOWHERE);
    }
    for x in grid.packets() {
        let from = grid.pixels(x, y);
        let inside = Mask8::first(from.1);
        for (c, plane) in work.e.iter().enumerate() {
            store(signal, c * s + x, load_pixels(plane, from));
        }
        store(signal, 3 * s + x, load_pixels(work.variance, from));
        store(features, REACH * s + x, load_pixels(work.reach, from));
        let (albedo, normal) = noisy.features(from.0);
        for c in 0..3 {
            // A NaN becomes -1: any normal serves, as it affects its own pixel only.
            let n = normal[c].clamp(-1.0, 1.0) * normal_scale;
            let outside = if c == 0 { NOWHERE } else { 0.0 };
            store(features, c * s + x, inside.select(n, F32x8::splat(outside)));
            store(features, (3 + c) * s + x, albedo[c].clamp(0.0, 1.0) * albedo_scale);
        }
    }
}

/// Computes the larger of a pixel's variance and the mean variance around it, among pixels with similar features. With
/// few samples, many pixels have missed the light and have no variance of their own; their neighbours have some.
pub(super) fn smooth_variance_row(grid: Grid, y: usize, work: &mut Work<'_>) {
    let rows: [Option<Row<'_>>; 3] = [0, 1, 2].map(|d| grid.row(work.window, (y + d).wrapping_sub(1)));
    let Some(own_row) = rows[1] else { return };
    for x in grid.packets() {
        let f = own_row.features.map(|p| load(p, x));
        // Where a whole picture is absent the variance is still negative.
        let own = F32x8::ZERO.max(load(own_row.signal[3], x));
        let (mut sum, mut total) = (own * 4.0, F32x8::splat(4.0));
        for (d, row) in rows.iter().enumerate() {
            let Some(row) = row else { continue };
            for q in (x - 1..x + 2).filter(|&q| d != 1 || q != x) {
                let unlike = feature_distance(row, q, &f);
                let w = F32x8::ZERO.max(1.0 - unlike) * if d == 1 || q == x { 2.0 } else { 1.0 };
                sum += w * F32x8::ZERO.max(load(row.signal[3], q));
                total += w;
            }
        }
        let variance = own.max(sum / total);
        let to = grid.pixels(x, y);
        store_pixels(work.variance, to, variance);
        store_pixels(work.reach, to, variance.sqrt() * DESPECKLE);
    }
}
