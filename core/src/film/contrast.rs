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
/// Values of a row of a block, by column and channel, in whole packets.
const VALUES: usize = (3 * LONGEST).next_multiple_of(8);
/// Values of the columns that a window reaches on a side.
const BESIDE: usize = 3 * REACH as usize;
/// Largest denominator, and largest error: beyond it f32 ends soon.
pub(super) const LARGEST: f64 = 1e30;

/// Of a row of a block, by column and channel.
#[derive(Clone, Copy)]
pub(super) struct Line {
    /// D, and its logarithm from [`Self::take_logarithms`] on.
    denominator: [f32; VALUES],
    /// t.
    left: [f32; VALUES],
}

/// Packets that hold the values of `columns` columns.
fn packets(values: &mut [f32; VALUES], columns: usize) -> impl Iterator<Item = &mut [f32; 8]> {
    values.as_chunks_mut::<8>().0.iter_mut().take((3 * columns).div_ceil(8))
}

impl Line {
    pub(super) const EMPTY: Self = Self { denominator: [0.0; VALUES], left: [0.0; VALUES] };

    /// Sets D and t of a column.
    pub(super) fn set(&mut self, column: usize, denominator: [f64; 3], left: [f64; 3]) {
        let at = 3 * column..3 * column + 3;
        if let (Some(d), Some(t)) = (self.denominator.get_mut(at.clone()), self.left.get_mut(at)) {
            d.iter_mut().zip(denominator).for_each(|(d, x)| *d = x.min(LARGEST) as f32);
            t.iter_mut().zip(left).for_each(|(t, x)| *t = x as f32);
        }
    }

    /// Ends the row: all of its columns are set.
    pub(super) fn take_logarithms(&mut self, columns: usize) {
        packets(&mut self.denominator, columns).for_each(|p| *p = F32x8::new(*p).ln().to_array());
    }

    /// Roots of D / D' of the row, of `columns` columns, by column and channel; `window` are the rows that it is seen with,
    /// it among them.
    pub(super) fn root_of_rise<'a>(&self, columns: usize, window: impl Iterator<Item = &'a Self>) -> [f32; VALUES] {
        // columns beside the block are 0
        let (mut sums, mut rows) = ([0.0; VALUES + 2 * BESIDE], 0.0);
        for line in window {
            let columns = sums.iter_mut().skip(BESIDE).zip(line.denominator).take(3 * columns);
            columns.for_each(|(s, x)| *s += x);
            rows += 1.0;
        }
        let mut half = [0.0; VALUES];
        let windows = sums.windows(2 * BESIDE + 1);
        for (i, ((half, s), (own, left))) in
            half.iter_mut().zip(windows).zip(self.denominator.iter().zip(self.left)).take(3 * columns).enumerate()
        {
            // logarithms are within 70: taking the own one off loses nothing that matters
            let all: f32 = s.iter().step_by(3).sum();
            let column = i / 3;
            let from = column.saturating_sub(REACH as usize);
            let to = (column + REACH as usize + 1).min(columns);
            let others = (rows * (to - from) as f32 - 1.0).max(1.0);
            *half = 0.5 * (left * (own - (all - own) / others)).clamp(-MOST, MOST);
        }
        packets(&mut half, columns).for_each(|p| *p = F32x8::new(*p).exp().to_array());
        half
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
            (0..COLUMNS).for_each(|x| line.set(x, [value(row, x), 1e40, 1.0], [left(x), 1.0, 0.0]));
            line.take_logarithms(COLUMNS);
        }
        let found = lines[1].root_of_rise(COLUMNS, lines.iter());
        for column in 0..COLUMNS {
            let window = column.saturating_sub(2)..(column + 3).min(COLUMNS);
            let others = (0..3).flat_map(|r| window.clone().map(move |x| (r, x))).filter(|p| *p != (1, column));
            let logs: std::vec::Vec<_> = others.map(|(r, x)| value(r, x).ln()).collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            let truth = (left(column) * (value(1, column).ln() - mean)).clamp(-1.6, 1.6);
            let [rise, huge, settled] = [0, 1, 2].map(|c| f64::from(found[3 * column + c]));
            assert!((rise.ln() - 0.5 * truth).abs() < 1e-5, "{column}: {rise} of {truth}");
            assert!((huge - 1.0).abs() < 1e-5 && settled == 1.0);
        }
    }
}
