//! Scratch memory: rows of planes with margins, read and written eight pixels at a time.

use croupier_simd::F32x8;

/// Columns of margin on either side of a scratch row, a multiple of 8: no tap leaves the row.
pub(super) const MARGIN: usize = 16;
/// Number of values of a pixel that the levels change: e (rgb) and the variance of e, summed over rgb.
pub(super) const SIGNAL: usize = 4;
/// Number of values of a pixel that stay: normal, albedo, each scaled so that a distance of 1 separates, and [`REACH`].
pub(super) const FEATURES: usize = 7;
/// Plane of the features with the largest change of the pixel by `despeckle`.
pub(super) const REACH: usize = 6;
/// Normal, x, of pixels outside the picture: far from every normal inside.
pub(super) const NOWHERE: f32 = 1e9;

/// Squared radiance below all that matters: avoids 0 / 0.
pub(super) const TINY: f32 = 1e-20;

/// Layout of scratch memory: rows of planes, each plane with a margin on both sides.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Number of columns, rounded up to a multiple of 8.
    pub(super) padded: usize,
    /// Distance from one plane of a row to the next, values.
    pub(super) stride: usize,
}

impl Grid {
    pub(super) fn new(size: [u32; 2]) -> Self {
        let [columns, rows] = size.map(|n| n as usize);
        let padded = columns.saturating_add(7) & !7;
        Self { columns, rows, padded, stride: padded.saturating_add(2 * MARGIN) }
    }

    /// First lanes of the packets of a row, from the beginning of a plane.
    pub(super) fn packets(self) -> impl Iterator<Item = usize> {
        (MARGIN..MARGIN + self.padded).step_by(8)
    }

    /// Row `y` of a block with `planes` planes; empty if there is no such row.
    pub(super) fn row(self, block: &[f32], planes: usize, y: usize) -> &[f32] {
        let len = planes * self.stride;
        if y < self.rows { block.get(y * len..).and_then(|r| r.get(..len)).unwrap_or(&[]) } else { &[] }
    }

    pub(super) fn row_mut(self, block: &mut [f32], planes: usize, y: usize) -> &mut [f32] {
        let len = planes * self.stride;
        if y < self.rows { block.get_mut(y * len..).and_then(|r| r.get_mut(..len)).unwrap_or(&mut []) } else { &mut [] }
    }
}

/// Eight values from `at`; 0 if they are not all there.
#[inline(always)]
pub(super) fn load(row: &[f32], at: usize) -> F32x8 {
    match row.get(at..).and_then(|r| r.first_chunk()) {
        Some(a) => F32x8::new(*a),
        None => F32x8::ZERO,
    }
}

#[inline(always)]
pub(super) fn store(row: &mut [f32], at: usize, x: F32x8) {
    if let Some(a) = row.get_mut(at..).and_then(|r| r.first_chunk_mut()) {
        *a = x.to_array();
    }
}

/// Squared distance of the features (normal and albedo, scaled) of the pixels from `at` of a row to `own`; 1 separates.
#[inline(always)]
pub(super) fn feature_distance(row: &[f32], stride: usize, at: usize, own: &[F32x8; 6]) -> F32x8 {
    let g: [F32x8; 6] = core::array::from_fn(|c| (load(row, c * stride + at) - own[c]).sqr());
    ((g[0] + g[1]) + (g[2] + g[3])) + (g[4] + g[5])
}
