//! How much more 1 / D may be than for the mean that is estimated of a pixel, where it knows little of itself.
//!
//! Around an edge a pixel is dark or bright, and its mean is estimated between the two: 1 / D of that is less than the mean of
//! 1 / D (Jensen's inequality), so that the error of fireflies in shadows was stated as half of what it is. The mean of 1 / D
//! over the window would be too much where the window's own noise makes its denominators differ; the geometric mean hardly
//! depends on it:
//!
//! ```text
//! ln D' = ln D + t (mean of ln D of the others in the window - ln D)        t = (1 - w) u^2
//! ```
//!
//! with at most a factor 5 between D and D': next to lamps a window holds anything. `t` is what the pixel leaves
//! to others, and of that what they know better than the block. In the scenes of the benchmark `intervals` the true error lies
//! between that of D and that of D' in nearly all pictures.

use croupier_simd::F32x8;

/// Columns, or rows, of the window on either side of a pixel.
pub(super) const REACH: u32 = 2;
/// Most columns, or rows, of a block.
pub(super) const LONGEST: usize = 31;
/// Most that the logarithms of the two denominators differ: a factor 5.
const MOST: f32 = 1.6;
/// Values of a row of a block, by column and channel, in whole packets.
const VALUES: usize = (3 * LONGEST).next_multiple_of(8);
/// Largest denominator: beyond it squares of radiances in f32 end.
const LARGEST: f64 = 1e30;

/// Of a row of a block, by column and channel.
#[derive(Clone, Copy)]
pub(super) struct Line {
    /// D, and its logarithm from [`Self::take_logarithms`] on.
    denominator: [f32; VALUES],
    /// t.
    left: [f32; VALUES],
}

fn map(values: &mut [f32; VALUES], f: impl Fn(F32x8) -> F32x8) {
    let (packets, _) = values.as_chunks_mut::<8>();
    packets.iter_mut().for_each(|p| *p = f(F32x8::new(*p)).to_array());
}

impl Line {
    pub(super) const EMPTY: Self = Self { denominator: [1.0; VALUES], left: [0.0; VALUES] };

    /// Sets D and t of a column.
    pub(super) fn set(&mut self, column: usize, denominator: [f64; 3], left: [f64; 3]) {
        let at = 3 * column..3 * column + 3;
        if let (Some(d), Some(t)) = (self.denominator.get_mut(at.clone()), self.left.get_mut(at)) {
            d.iter_mut().zip(denominator).for_each(|(d, x)| *d = x.min(LARGEST) as f32);
            t.iter_mut().zip(left).for_each(|(t, x)| *t = x as f32);
        }
    }

    /// Ends the row: all columns are set.
    pub(super) fn take_logarithms(&mut self) {
        map(&mut self.denominator, F32x8::ln);
    }

    /// Roots of D / D' of the row, of `columns` columns, by column and channel; `window` are the rows that it is seen with, it
    /// among them.
    pub(super) fn root_of_rise<'a>(&self, columns: usize, window: impl Iterator<Item = &'a Self>) -> [f32; VALUES] {
        let (mut sums, mut rows) = ([0.0; VALUES], 0);
        for line in window {
            sums.iter_mut().zip(line.denominator).for_each(|(s, x)| *s += x);
            rows += 1;
        }
        let mut half = [0.0; VALUES];
        for column in 0..columns {
            let reach = column.saturating_sub(REACH as usize)..(column + REACH as usize + 1).min(columns);
            let others = (rows * reach.len()).saturating_sub(1).max(1) as f32;
            for c in 0..3 {
                let at = (3 * column + c) % VALUES;
                let own = self.denominator[at];
                let all: f32 = reach.clone().map(|i| sums[(3 * i + c) % VALUES]).sum();
                half[at] = 0.5 * (self.left[at] * (own - (all - own) / others)).clamp(-MOST, MOST);
            }
        }
        map(&mut half, F32x8::exp);
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
            line.take_logarithms();
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
