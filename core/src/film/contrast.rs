//! How far 1 / D may be from that of the mean that is estimated of a pixel, where it knows little of itself: mostly how
//! much more.
//!
//! Around an edge a pixel is dark or bright, and its mean is estimated between the two: 1 / D of that is less than the
//! mean of 1 / D (Jensen's inequality), which would state too small an error of fireflies in shadows. The mean of 1 / D over
//! the window would be too much where the window's own noise makes its denominators differ; the geometric mean depends on
//! it less:
//!
//! ```text
//! ln D' = ln D + t (mean of ln D of the others in the window - ln D)        t = (1 - w) u^2
//! ```
//!
//! with at most a factor 5 between D and D': next to lamps a window holds anything. `t` is what the pixel leaves
//! to others, and of that what the window knows better than the block; squared, as the window's contrast is not known
//! better than its mean. Windows end at the block. Neither D nor D' is right in all scenes, which is why the estimate takes
//! the middle; the benchmark `intervals` shows what that is worth.

use croupier_simd::F32x8;

/// Columns, or rows, of the window on either side of a pixel.
pub(super) const REACH: u32 = 2;
/// Most columns, or rows, of a block.
pub(super) const LONGEST: usize = 31;
/// Most that the logarithms of the two denominators differ: a factor 5.
const MOST: f32 = 1.6;
/// Columns of a block, in whole packets.
pub(super) const PADDED: usize = LONGEST.next_multiple_of(8);
/// Largest denominator, and largest error: beyond it f32 ends soon.
pub(super) const LARGEST: f64 = 1e30;

/// Of a row of a block, by channel and column.
#[derive(Clone, Copy)]
pub(super) struct Line {
    /// D, and its logarithm from [`Self::take_logarithms`] on.
    denominator: [[f32; PADDED]; 3],
    /// t.
    left: [[f32; PADDED]; 3],
}

/// Eight values from `at` of a row on, 0 if it has not as many.
#[inline(always)]
pub(super) fn eight(row: &[f32], at: usize) -> F32x8 {
    row.get(at..).and_then(|row| row.first_chunk()).map_or(F32x8::ZERO, |values| F32x8::new(*values))
}

impl Line {
    pub(super) const EMPTY: Self = Self { denominator: [[0.0; PADDED]; 3], left: [[0.0; PADDED]; 3] };

    /// D and t of channel `c`, at most [`LARGEST`], to be set.
    pub(super) fn channel_mut(&mut self, c: usize) -> (&mut [f32; PADDED], &mut [f32; PADDED]) {
        (&mut self.denominator[c % 3], &mut self.left[c % 3])
    }

    /// Ends the row, of `columns` columns, all of which are set: the values behind them are 0 from now on.
    pub(super) fn take_logarithms(&mut self, columns: usize) {
        for channel in &mut self.denominator {
            channel.iter_mut().skip(columns).for_each(|d| *d = 1.0);
            let packets = channel.as_chunks_mut::<8>().0.iter_mut().take(columns.div_ceil(8));
            packets.for_each(|p| *p = F32x8::new(*p).ln().to_array());
            channel.iter_mut().skip(columns).for_each(|d| *d = 0.0);
        }
    }

    /// Roots of D / D' of channel `c` of the row, of `columns` columns; `window` are the rows that it is seen with, it
    /// among them.
    // once, not unrolled over the channels
    #[inline(never)]
    pub(super) fn root_of_rise<'a>(
        &self,
        c: usize,
        columns: usize,
        window: impl Iterator<Item = &'a Self>,
    ) -> [f32; PADDED] {
        const BESIDE: usize = REACH as usize;
        // columns beside the block are 0
        let (mut sums, mut rows) = ([0.0; PADDED + 2 * BESIDE], 0.0);
        for line in window {
            let own = sums.get_mut(BESIDE..).unwrap_or_default().as_chunks_mut().0;
            for (s, x) in own.iter_mut().zip(line.denominator[c % 3].as_chunks().0) {
                *s = (F32x8::new(*s) + F32x8::new(*x)).to_array();
            }
            rows += 1.0;
        }
        let mut root = [1.0; PADDED];
        for (i, root) in root.as_chunks_mut::<8>().0.iter_mut().enumerate().take(columns.div_ceil(8)) {
            let from = 8 * i;
            let others = F32x8::from_fn(|lane| {
                let column = from + lane;
                let width = (column + BESIDE + 1).min(columns).saturating_sub(column.saturating_sub(BESIDE));
                (rows * width as f32 - 1.0).max(1.0)
            });
            // logarithms are within 70: taking the own one off loses nothing that matters
            let all = (eight(&sums, from) + eight(&sums, from + 1))
                + (eight(&sums, from + 2) + eight(&sums, from + 3))
                + eight(&sums, from + 4);
            let own = eight(&self.denominator[c % 3], from);
            let rise = eight(&self.left[c % 3], from) * (own - (all - own) / others);
            *root = (rise.clamp(-MOST, MOST) * 0.5).exp().to_array();
        }
        root
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    /// Against the formula in f64, on three rows of columns that are dark and bright by turns. Killed by: a mean that the
    /// pixel is part of, a rise of its whole logarithm, a bound on one side only.
    #[test]
    fn roots_are_those_of_the_geometric_mean() {
        const COLUMNS: usize = 7;
        let value =
            |row: usize, column: usize| if (row + column).is_multiple_of(3) { 0.02 } else { 0.5 + column as f64 };
        let left = |column: usize| column as f64 / 8.0;
        let mut lines = [Line::EMPTY; 3];
        for (row, line) in lines.iter_mut().enumerate() {
            for c in 0..3 {
                let (d, t) = line.channel_mut(c);
                for x in 0..COLUMNS {
                    d[x] = [value(row, x) as f32, 1e30, 1.0][c];
                    t[x] = [left(x) as f32, 1.0, 0.0][c];
                }
            }
            line.take_logarithms(COLUMNS);
        }
        let found = [0, 1, 2].map(|c| lines[1].root_of_rise(c, COLUMNS, lines.iter()));
        for column in 0..COLUMNS {
            let window = column.saturating_sub(2)..(column + 3).min(COLUMNS);
            let others = (0..3).flat_map(|r| window.clone().map(move |x| (r, x))).filter(|p| *p != (1, column));
            let logs: std::vec::Vec<_> = others.map(|(r, x)| value(r, x).ln()).collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            let truth = (left(column) * (value(1, column).ln() - mean)).clamp(-1.6, 1.6);
            let [rise, huge, settled] = found.map(|f| f64::from(f[column]));
            assert!((rise.ln() - 0.5 * truth).abs() < 1e-5, "{column}: {rise} of {truth}");
            assert!((huge - 1.0).abs() < 1e-5 && settled == 1.0);
        }
    }
}
