//! Memory: planes of the picture, which the passes change in place, and a window of rows with margins, which hold what
//! the planes held before. Both are read and written eight pixels at a time.

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

/// A row that a pass reads: planes of equal length, with margins.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    /// e (rgb) and its variance.
    pub(super) signal: [&'a [f32]; SIGNAL],
    /// Normal and albedo.
    pub(super) features: [&'a [f32]; 6],
    /// Largest change of the pixel by `despeckle`.
    pub(super) reach: &'a [f32],
}

/// Layout of the rows that a pass reads: planes with a margin on both sides.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Number of columns, rounded up to a multiple of 8.
    pub(super) padded: usize,
    /// Distance from one plane of a row to the next, values.
    pub(super) stride: usize,
}

/// Rows on either side of the current one that a pass can reach.
const REACHED_ROWS: usize = MARGIN;

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

    /// Number of rows that are there at once.
    fn kept(self) -> usize {
        self.rows.clamp(1, 2 * REACHED_ROWS + 1)
    }

    /// Number of values of the rows that are there at once.
    pub(super) fn window_len(self) -> usize {
        self.kept().saturating_mul(self.stride).saturating_mul(SIGNAL + FEATURES)
    }

    /// Range of row `y` in the window; empty if the picture has no such row.
    fn window_row(self, y: usize) -> core::ops::Range<usize> {
        let len = (SIGNAL + FEATURES) * self.stride;
        let at = y % self.kept() * len;
        if y < self.rows { at..at + len } else { 0..0 }
    }

    /// Row `y`; `None` if the picture has no such row.
    // once, not in each pass: for the size of modules and firmware
    #[inline(never)]
    pub(super) fn row(self, window: &[f32], y: usize) -> Option<Row<'_>> {
        const { assert!(SIGNAL == 4 && FEATURES == 6 + 1, "the planes that are taken one by one below") };
        let row = window.get(self.window_row(y))?;
        let mut planes = row.chunks_exact(self.stride.max(1));
        let mut next = || planes.next();
        let signal = [next()?, next()?, next()?, next()?];
        Some(Row { signal, features: [next()?, next()?, next()?, next()?, next()?, next()?], reach: next()? })
    }

    pub(super) fn row_mut(self, window: &mut [f32], y: usize) -> (&mut [f32], &mut [f32]) {
        let row = window.get_mut(self.window_row(y)).unwrap_or(&mut []);
        row.split_at_mut_checked(SIGNAL * self.stride).unwrap_or((&mut [], &mut []))
    }

    /// Index of the first pixel of a packet, and how many of its pixels are in the picture. `x` counts from the
    /// beginning of a plane.
    pub(super) fn pixels(self, x: usize, y: usize) -> (usize, usize) {
        let column = x - MARGIN;
        (y * self.columns + column, (self.columns - column).min(8))
    }
}

/// The first `lanes` of eight values from `at` of a plane without margins, 0 for others.
#[inline(always)]
pub(super) fn load_pixels(plane: &[f32], (at, lanes): (usize, usize)) -> F32x8 {
    match plane.get(at..).and_then(|p| p.first_chunk()) {
        Some(a) if lanes == 8 => F32x8::new(*a),
        _ => {
            let plane = plane.get(at..).unwrap_or(&[]);
            F32x8::from_fn(|i| if i < lanes { plane.get(i).copied().unwrap_or(0.0) } else { 0.0 })
        }
    }
}

/// Stores the first `lanes` values.
#[inline(always)]
pub(super) fn store_pixels(plane: &mut [f32], (at, lanes): (usize, usize), x: F32x8) {
    if let (Some(to), Some(from)) = (plane.get_mut(at..at + lanes), x.to_array().get(..lanes)) {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    }
}

/// Eight values from `at` of a plane, 0 where it has not as many.
#[inline(always)]
pub(super) fn load(plane: &[f32], at: usize) -> F32x8 {
    // of planes of equal length, one comparison for all
    match plane.get(at..at.saturating_add(8)).and_then(|p| p.first_chunk()) {
        Some(a) => F32x8::new(*a),
        None => F32x8::ZERO,
    }
}

/// Writes eight values from `at` of a row on, if there is room for all.
#[inline(always)]
pub(super) fn store(row: &mut [f32], at: usize, x: F32x8) {
    if let Some(a) = row.get_mut(at..).and_then(|r| r.first_chunk_mut()) {
        *a = x.to_array();
    }
}

/// Squared distance of the features (normal and albedo, scaled) of the pixels from `at` of a row to `own`; 1 separates.
#[inline(always)]
pub(super) fn feature_distance(row: &Row<'_>, at: usize, own: &[F32x8; 6]) -> F32x8 {
    let f = &row.features;
    let g = |c: usize| (load(f[c], at) - own[c]).sqr();
    ((g(0) + g(1)) + (g(2) + g(3))) + (g(4) + g(5))
}
