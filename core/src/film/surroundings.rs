//! What relMSE divides by, estimated: the squared expectation of a pixel, from its samples and from the pixels around it.
//!
//! The pixel's own mean will not do. A firefly raises mean and variance together and hides its own error (states 0.2 of it
//! in a pool lit through water); a pixel that has found its light once of many times has a variance as large as its squared
//! mean, so that next to nothing is left to divide by (390 times the error at the edges of small lights). So a pixel takes
//! what others say, as far as it does not know better: those of the window of 5x5 pixels around it, and the window in
//! turn what its block says, one of 16 to 31 pixels a side into which the picture is cut:
//!
//! ```text
//! mu = b + u (l - b)         l, b: means of the others in the window and in the block
//! u = c_b / (c_b + max(noise of the others in window, in block) / pixels of the window)
//! e = mu + w (m - mu)        m, v: mean of the pixel and its variance
//! w = max(c_l / (c_l + max(v, noise in the window)), 1 - k v / (m - mu)^2)
//! D = max(e^2 - Var e, 0) + 0.01        with 0.9 of the pixel's own part of Var e
//! ```
//!
//! Noise is the mean of the others' variances, c the variance among them beyond it: where there is contrast, pixels are
//! what their samples say (Lee, "Digital image enhancement and noise filtering by use of local statistics", 1980).
//! Blocks alone stated half the error where a bright window lies in them, which lends its contrast to all their pixels;
//! windows alone state three times the error where most pixels have found nothing yet. The second term of w keeps
//! pixels that stand out beyond their own noise (the positive part of James and Stein, "Estimation with quadratic
//! loss", 1961). The others in the block are those of other parity in column or row: the pixel is in none of the sums,
//! and nothing is subtracted (NUMERICS STA-4). k = 1 is the estimate; k = [`DOUBT`](super::others::DOUBT) says how much
//! depends on this choice, which widens the interval.
//!
//! At edges 1 / D is less than its mean over what the pixel may be; [`super::contrast`] says how much less it may be. The
//! estimate is halfway in the logarithm, and the interval holds both ends.
//!
//! What a pixel's own noise makes of its denominator widens the interval too: where q = v / D is large, at the edges of
//! lamps, in caustics, D is hardly known. Each pixel adds q^2 / (q + [`UNSURE`]), all of q where it is large, next to
//! nothing where it is small, and [`UNSURE_SHARE`] of the sum counts. Both numbers were found with the benchmark
//! `intervals`.
//!
//! By the same D each pixel tells what it would add if one of its n samples had shown a highlight of radiance L that none
//! has: (L - m)^2 / (n^2 D), which [`ErrorEstimate::highlight`](super::ErrorEstimate::highlight) sums up.

use super::contrast::{LARGEST, LONGEST, Line, PADDED, REACH, eight};
use super::error::larger;
use super::independence::class;
use super::others::{Others, denominators};
use super::pixel::PixelStats;
use core::ops::Range;
use croupier_simd::F32x8;

/// Pixels a side of the smallest block.
pub(super) const SIDE: u32 = LONGEST.div_ceil(2) as u32;
/// Rows of the window.
const ROWS: usize = 2 * REACH as usize + 1;
/// Columns of a block with those that its windows reach: the block's own from `REACH` on.
const COLUMNS: usize = PADDED + 2 * REACH as usize;
/// Relative squared error of a pixel of which half is unsure.
const UNSURE: f32 = 0.25;
/// Part of what is unsure by which an interval is widened to both sides.
pub(super) const UNSURE_SHARE: f64 = 0.5;

/// Values by column, those of [`Seen`].
type Columns = [f64; COLUMNS];

/// Row of pixels: mean of each and its variance, by channel, and its class. Columns outside the picture are 0.
#[derive(Clone, Copy)]
struct Seen {
    mean: [Columns; 3],
    variance: [Columns; 3],
    classes: [u8; COLUMNS],
}

impl Seen {
    const NOTHING: Self = Self { mean: [[0.0; COLUMNS]; 3], variance: [[0.0; COLUMNS]; 3], classes: [0; COLUMNS] };

    /// Sets `columns` of row `row` of the picture, from place `at` on.
    // once, not for blocks and windows apart: for the size of modules and firmware
    #[inline(never)]
    fn set(&mut self, at: usize, columns: Range<u32>, row: u32, pixel: &impl Fn(u32, u32) -> PixelStats) {
        for (i, column) in columns.enumerate() {
            let at = at + i;
            let Some(class_at) = self.classes.get_mut(at) else { return };
            let p = pixel(column, row);
            let (mean, variance) = (p.mean(), p.variance_of_mean());
            for c in 0..3 {
                self.mean[c][at] = mean[c];
                self.variance[c][at] = variance[c];
            }
            *class_at = class(&p) as u8;
        }
    }
}

/// Columns in groups of four: compilers make vector instructions of loops over an array of four.
fn fours(columns: &Columns) -> &[[f64; 4]] {
    columns.as_chunks().0
}

fn fours_mut(columns: &mut Columns) -> &mut [[f64; 4]] {
    columns.as_chunks_mut().0
}

/// Adds means and variances of four columns to the sums of means, squared means and variances.
#[inline(always)]
fn add_four(means: &[f64; 4], variances: &[f64; 4], [mean, square, variance]: [&mut [f64; 4]; 3]) {
    for i in 0..4 {
        mean[i] += means[i];
        square[i] += means[i] * means[i];
        variance[i] += variances[i];
    }
}

/// Sums over the pixels of some rows in a channel, by column.
#[derive(Clone, Copy)]
struct Sums {
    mean: Columns,
    /// Of squared means.
    square: Columns,
    /// Of variances of means.
    variance: Columns,
}

impl Sums {
    const NOTHING: Self = Self { mean: [0.0; COLUMNS], square: [0.0; COLUMNS], variance: [0.0; COLUMNS] };

    /// Adds `columns` columns of a row.
    // once, not unrolled over rows: for the size of modules and firmware
    #[inline(never)]
    fn add(&mut self, means: &Columns, variances: &Columns, columns: usize) {
        let row = fours(means).iter().zip(fours(variances));
        let Self { mean, square, variance } = self;
        let sums = fours_mut(mean).iter_mut().zip(fours_mut(square)).zip(fours_mut(variance));
        for ((m, v), ((mean, square), variance)) in row.zip(sums).take(columns.div_ceil(4)) {
            add_four(m, v, [mean, square, variance]);
        }
    }
}

/// Relative squared errors of a pixel, means over channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PixelError {
    /// Variance over the denominator.
    pub error: f32,
    /// The same with the other k.
    pub other: f32,
    /// How far it is from D to D' of [`super::contrast`].
    pub contrast: f32,
    /// What of it is unsure because of the pixel's own noise.
    pub unsure: f32,
    /// What one more of its n samples would add if it were a highlight of radiance L: (L - m)^2 / (n^2 D), 0 where the mean m
    /// is above L.
    pub highlight: f32,
    /// Class of the pixel by the spread of its samples.
    pub class: usize,
}

/// Row of a block: what is known of its pixels before their contrast is.
#[derive(Clone, Copy)]
struct Row {
    /// Variances over D, and over that with the other k, by channel and pixel.
    errors: [[[f32; PADDED]; 2]; 3],
    /// (L - m)^2 / D, sums over the channels.
    highlights: [f32; PADDED],
    classes: [u8; PADDED],
    line: Line,
}

impl Row {
    const EMPTY: Self =
        Self { errors: [[[0.0; PADDED]; 2]; 3], highlights: [0.0; PADDED], classes: [0; PADDED], line: Line::EMPTY };

    /// Computes channel `c` of the row's first `columns` pixels. `own` is the row's values; `others` and `all` are the sums
    /// by column over the other rows of the windows and over all of their rows; `pixels` is the number of other pixels in
    /// each window; `block` is what the block says of even and of odd columns, counted from its first; `highlight` is L.
    #[inline(always)]
    fn set(
        &mut self,
        (c, columns, highlight): (usize, usize, f32),
        own: &Seen,
        [others, all]: [&Sums; 2],
        pixels: &Columns,
        block: &[Others; 2],
    ) {
        const CENTER: usize = REACH as usize;
        let [to, to_other] = &mut self.errors[c];
        let (line, line_left) = self.line.channel_mut(c);
        let (means, variances) = (&own.mean[c], &own.variance[c]);
        for i in 0..columns.min(PADDED) {
            // the pixel's own column without it, and those beside
            let sum = |o: &Columns, a: &Columns| o[i + CENTER] + ((a[i] + a[i + 1]) + (a[i + 3] + a[i + 4]));
            let window = Others::of(
                pixels[i],
                [sum(&others.mean, &all.mean), sum(&others.square, &all.square), sum(&others.variance, &all.variance)],
            );
            let block = if i & 1 == 0 { &block[0] } else { &block[1] };
            let (m, v) = (means[i + CENTER], variances[i + CENTER]);
            let (d, other, left) = denominators([m, v], &window, block);
            // without an error there is nothing to divide
            let error = |d: f64| {
                let q = v / d;
                let q = if q < LARGEST { q } else { LARGEST };
                if v > 0.0 { q as f32 } else { 0.0 }
            };
            (to[i], to_other[i]) = (error(d), error(other));
            (line[i], line_left[i]) = (if d < LARGEST { d } else { LARGEST } as f32, left as f32);
            let above = larger(f64::from(highlight) - m, 0.0);
            self.highlights[i] += (above * above / d) as f32;
        }
    }

    /// Shows the errors of `columns` pixels, of whose mean a sample is this part.
    fn show<'a>(
        &self,
        (columns, part): (usize, f32),
        window: impl Iterator<Item = &'a Line> + Clone,
        mut show: impl FnMut(PixelError),
    ) {
        let rises: [[f32; PADDED]; 3] = core::array::from_fn(|c| self.line.root_of_rise(c, columns, window.clone()));
        let third = F32x8::splat(1.0 / 3.0);
        for from in (0..columns).step_by(8) {
            let mut sums = [F32x8::ZERO; 4];
            for ([errors, others], rise) in self.errors.iter().zip(&rises) {
                let (q, other, rise) = (eight(errors, from), eight(others, from), eight(rise, from));
                let error = q * rise;
                let unsure = error * (error / (error + UNSURE));
                for (sum, x) in sums.iter_mut().zip([error, other * rise, (error * rise - q).abs(), unsure]) {
                    *sum += x * third;
                }
            }
            let [error, other, contrast, unsure] = sums.map(F32x8::to_array);
            let highlight = (eight(&self.highlights, from) * third * (part * part)).to_array();
            let classes: [u8; 8] = self.classes.get(from..).and_then(|c| c.first_chunk()).copied().unwrap_or_default();
            for i in 0..(columns - from).min(8) {
                show(PixelError {
                    error: error[i],
                    other: other[i],
                    contrast: contrast[i],
                    unsure: unsure[i],
                    highlight: highlight[i],
                    class: classes[i].into(),
                });
            }
        }
    }
}

/// Columns or rows `from..to` of a block, within `0..size` of the picture.
#[derive(Clone, Copy)]
pub(super) struct Span {
    pub from: u32,
    pub to: u32,
    pub size: u32,
}

impl Span {
    fn is_inside(self, at: u32) -> bool {
        (self.from..self.to).contains(&at)
    }

    /// The same with those that windows reach.
    fn reach(self) -> Range<u32> {
        self.from.saturating_sub(REACH)..self.to.saturating_add(REACH).min(self.size)
    }
}

/// What the others of a block say: by parity of the row, channel, and parity of the column from the block's first on.
type OfBlock = [[[Others; 2]; 3]; 2];

/// Sums over the pixels of the block of the other parity in column or row.
fn of_block([x, y]: [Span; 2], pixel: &impl Fn(u32, u32) -> PixelStats) -> OfBlock {
    // by parity of the row and channel, of every fourth column: two each of both parities
    let mut sums = [[[[0.0f64; 4]; 3]; 3]; 2];
    let mut counts = [[0.0f64; 4]; 2];
    let mut seen = const { Seen::NOTHING };
    let columns = (x.to - x.from) as usize;
    for row in y.from..y.to {
        seen.set(0, x.from..x.to, row, pixel);
        let parity = (row & 1) as usize;
        counts[parity][0] += columns.div_ceil(2) as f64;
        counts[parity][1] += (columns / 2) as f64;
        let channels = seen.mean.iter().zip(&seen.variance).zip(&mut sums[parity]);
        for ((means, variances), [mean, square, variance]) in channels {
            // columns behind the block's are 0
            for (m, v) in fours(means).iter().zip(fours(variances)).take(columns.div_ceil(4)) {
                add_four(m, v, [mean, square, variance]);
            }
        }
    }
    let mut out = OfBlock::default();
    for (i, out) in out.as_flattened_mut().as_flattened_mut().iter_mut().enumerate() {
        // flattened, the row's parity changes every 6 entries, the channel every 2, the column's parity with each
        let (odd_row, c, odd_column) = (i >= 6, i / 2 % 3, i & 1 == 1);
        let others = |own: &[f64; 4], other: &[f64; 4]| {
            let same_row = if odd_column { own[0] + own[2] } else { own[1] + own[3] };
            other.iter().sum::<f64>() + same_row
        };
        let [own, other] = if odd_row { [1, 0] } else { [0, 1] };
        let ([mean, square, variance], [m, s, v]) = (&sums[own][c], &sums[other][c]);
        let pixels = others(&counts[own], &counts[other]);
        *out = Others::of(pixels, [others(mean, m), others(square, s), others(variance, v)]);
    }
    out
}

/// Shows the relative squared errors of the pixels of a block, row by row. `pixel` gives those at a column and row of the
/// picture; it is asked for each pixel twice, and for those that windows reach.
pub(super) fn relative_errors(
    [x, y]: [Span; 2],
    highlight: f32,
    pixel: impl Fn(u32, u32) -> PixelStats,
    mut show: impl FnMut(PixelError),
) {
    let block = of_block([x, y], &pixel);
    let columns = (x.to - x.from) as usize;
    // the same in all pixels, but where an iteration was stopped early
    let weight = pixel(x.from, y.from).weight;
    let part = if weight > 0.0 { (1.0 / weight) as f32 } else { 0.0 };
    let reached = columns + 2 * REACH as usize;
    // the first column that windows reach is at 0 if the picture has it
    let first = (x.reach().start + REACH - x.from) as usize;
    // columns of the window around each
    let widths: Columns = core::array::from_fn(|i| {
        let column = x.from + i as u32;
        f64::from(Span { from: column, to: column + 1, size: x.size }.reach().len() as u32)
    });
    // the rows of the windows, each where the one before the first was
    let mut seen = const { [Seen::NOTHING; ROWS] };
    let mut known = const { [Row::EMPTY; ROWS] };
    let mut next = y.from;
    for row in y.reach().start..y.to.saturating_add(REACH) {
        if row < y.size {
            seen[row as usize % ROWS].set(first, x.reach(), row, &pixel);
        }
        let middle = row.wrapping_sub(REACH);
        if !y.is_inside(middle) {
            continue;
        }
        let rows = Span { from: middle, to: middle + 1, size: y.size }.reach();
        let own = &seen[middle as usize % ROWS];
        let into = &mut known[middle as usize % ROWS];
        into.highlights = [0.0; PADDED];
        for (at, classes) in into.classes.iter_mut().zip(own.classes.iter().skip(REACH as usize)) {
            *at = *classes;
        }
        let pixels = widths.map(|width| width * f64::from(rows.len() as u32) - 1.0);
        for (c, block) in block[(middle & 1) as usize].iter().enumerate() {
            let mut others = Sums::NOTHING;
            let beside = rows.clone().filter(|r| *r != middle);
            beside.for_each(|r| {
                let row = &seen[r as usize % ROWS];
                others.add(&row.mean[c], &row.variance[c], reached);
            });
            let mut all = others;
            all.add(&own.mean[c], &own.variance[c], reached);
            into.set((c, columns, highlight), own, [&others, &all], &pixels, block);
        }
        into.line.take_logarithms(columns);
        // rows of which all others in the window are known
        let complete = if middle + 1 == y.to { y.to } else { (middle + 1).saturating_sub(REACH) };
        while next < complete {
            let window = next.saturating_sub(REACH).max(y.from)..(next + REACH + 1).min(y.to);
            let lines = window.map(|r| &known[r as usize % ROWS].line);
            known[next as usize % ROWS].show((columns, part), lines, &mut show);
            next += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// A pixel after `n` samples with this mean and variance of the mean, in all channels.
    fn pixel(n: u64, mean: f64, variance: f64) -> PixelStats {
        let w = n as f64;
        let spread = variance * (w * w - w);
        PixelStats {
            sum: [mean * w; 3],
            spread: [spread; 3],
            weight: w,
            weight_sqr: w,
            samples: n,
            ..PixelStats::default()
        }
    }

    /// Means of error, other error and what is unsure over rows of 16 pixels, a block of 16 x 16 if there are as many.
    fn errors(pixels: &[PixelStats]) -> [f64; 3] {
        let n = pixels.len() as u32;
        let spans = [n.min(16), n.div_ceil(16)].map(|size| Span { from: 0, to: size, size });
        let mut sum = [0.0; 3];
        let one = |x: u32, y: u32| pixels.get((y * 16 + x) as usize).copied().unwrap_or_default();
        relative_errors(spans, 0.0, one, |e| {
            for (sum, x) in sum.iter_mut().zip([e.error, e.other, e.unsure]) {
                *sum += f64::from(x)
            }
        });
        sum.map(|x| x / pixels.len() as f64)
    }

    /// Uniform numbers in [0, 1).
    fn random(seed: u32) -> impl FnMut() -> f64 {
        let mut x = seed;
        move || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(x >> 8) / 16_777_216.0
        }
    }

    /// Pixels each of `n` samples that are `1 / p` with probability p: of mean 1 and variance (1 / p - 1) / n.
    fn rare(n: u64, p: f64, seed: u32) -> Vec<PixelStats> {
        let mut random = random(seed);
        let one = |hits: f64| {
            let (n, mean) = (n as f64, hits / (n as f64 * p));
            let square = hits / (n * p * p);
            (mean, (square - mean * mean) / (n - 1.0))
        };
        (0..256)
            .map(|_| one((0..n).filter(|_| random() < p).count() as f64))
            .map(|(mean, variance)| pixel(n, mean, variance))
            .collect()
    }

    /// Where each pixel has found the light once or never, the block tells what to divide by: on average over 60 pictures
    /// the error is the true one within 25 %. Killed by: the pixel's own mean as the denominator (0.01 of the truth here),
    /// a mean of the others that the pixel is part of.
    #[test]
    fn rare_light_does_not_hide_its_error() {
        for (n, p) in [(8, 0.05), (32, 0.01), (64, 0.05)] {
            let truth = (1.0 / p - 1.0) / n as f64 / 1.01;
            let found = (0..60).map(|seed| errors(&rare(n, p, seed * 77 + 1))[0]).sum::<f64>() / 60.0;
            assert!((found / truth - 1.0).abs() < 0.25, "{n} samples, {p}: {found} of {truth}");
        }
    }

    /// Bright pixels in the dark whose mean is far above their noise count by their own mean. Killed by: denominators of
    /// the surroundings alone (10^4 times the truth).
    #[test]
    fn what_stands_out_counts_by_itself() {
        let mut pixels = [pixel(16, 1e-3, 1e-8); 256].to_vec();
        pixels[100] = pixel(16, 100.0, 100.0);
        let [error, other, _] = errors(&pixels);
        let truth = 0.01 / 256.0;
        assert!((error / truth - 1.0).abs() < 0.1 && (other / truth - 1.0).abs() < 0.2, "{error} {other} {truth}");
    }

    /// In a block of two halves, one of 10 and one of 0.1, pixels of both count by their own. Killed by: a contrast
    /// that is not seen, noise that is not taken off it.
    #[test]
    fn contrast_keeps_pixels_apart() {
        let pixels: Vec<_> =
            (0..256).map(|i| if i % 16 < 8 { pixel(64, 10.0, 0.01) } else { pixel(64, 0.1, 1e-4) }).collect();
        let truth = 0.5 * (0.01 / 100.01 + 1e-4 / 0.02);
        let [error, ..] = errors(&pixels);
        assert!((error / truth - 1.0).abs() < 0.05, "{error} {truth}");
    }

    /// A bright window in the block does not lend its contrast to dark pixels with rare light. Killed by: blocks
    /// alone, windows that hold their own pixel, all of a pixel's variance taken off (3 times the truth).
    #[test]
    fn bright_windows_do_not_hide_rare_light() {
        let truth = 0.75 * (1.0 / 0.05 - 1.0) / 32.0 / 1.01;
        let found = |seed: u32| {
            let mut pixels = rare(32, 0.05, seed * 77 + 1);
            (0..256).filter(|i| i % 16 < 4).for_each(|i| pixels[i] = pixel(32, 100.0, 1e-6));
            errors(&pixels)[0]
        };
        let found = (0..60).map(found).sum::<f64>() / 60.0;
        // at the edge of the window pixels count by their own
        assert!((0.8..2.0).contains(&(found / truth)), "{found} of {truth}");
    }

    /// What is unsure is all of the error where pixels are noise, and a small part of it where they are not. Killed by: a
    /// pixel's error that counts by its variance, not by its relative one.
    #[test]
    fn noisy_pixels_are_unsure() {
        let [error, _, unsure] = errors(&rare(8, 0.01, 5));
        assert!(unsure > 0.9 * error, "{unsure} of {error}");
        for scale in [1.0, 1e-6, 1e6] {
            let [error, _, unsure] = errors(&[pixel(64, 10.0, scale)].repeat(256));
            let q = scale / 100.01;
            // noise that is larger than the mean leaves less than its square to divide by
            let least = q / (q + f64::from(UNSURE)) - 1e-3;
            assert!(unsure / error > least && (q > 1.0 || unsure / error < least + 2e-3), "{unsure} of {error}");
        }
    }

    /// Number of values, their mean, the variance among them beyond their noise, and the mean of their variances.
    fn of_others(values: impl Iterator<Item = [f64; 2]>) -> [f64; 4] {
        let [n, mean, square, noise] =
            values.fold([0.0; 4], |s, [m, v]| [s[0] + 1.0, s[1] + m, s[2] + m * m, s[3] + v]);
        let [mean, square, noise] = [mean, square, noise].map(|x| x / n);
        [n, mean, (square - mean * mean - noise).max(0.0), noise]
    }

    /// Every pixel of blocks of odd and even sides, at each edge of the picture and at none, against the formulas at the
    /// head of this file, of one pixel at a time. Killed by: columns that are placed as in the first block, windows of 25
    /// pixels at the picture's edge, contrast with rows of the block before, channels or classes of other pixels.
    #[test]
    fn blocks_anywhere_follow_the_formulas() {
        let mut random = random(9);
        let size = [51, 50];
        let pixels: Vec<PixelStats> = (0..size[0] * size[1])
            .map(|i| {
                let bright = if i % 51 / 7 % 2 == i / 51 / 9 % 2 { 10.0 } else { 0.2 };
                let mut one =
                    || pixel(16, bright * (0.5 + random()), bright * bright * random() * [0.01, 2.0][i as usize % 2]);
                let channels = [one(), one(), one()];
                let of = |value: fn(&PixelStats) -> [f64; 3]| [0, 1, 2].map(|c| value(&channels[c])[c]);
                PixelStats { sum: of(|p| p.sum), spread: of(|p| p.spread), ..channels[0] }
            })
            .collect();
        let at = |x: u32, y: u32| pixels[(y * size[0] + x) as usize];
        let edges = [[0, 17, 34, 51], [0, 16, 33, 50]];
        for (column, row) in (0..9).map(|i| (i % 3, i / 3)) {
            let span = |k: usize, i: usize| Span { from: edges[k][i], to: edges[k][i + 1], size: size[k] };
            let [x, y] = [span(0, column), span(1, row)];
            let mut found = Vec::new();
            relative_errors([x, y], 12.0, at, |e| found.push(e));
            let inside: Vec<_> = (y.from..y.to).flat_map(|j| (x.from..x.to).map(move |i| (i, j))).collect();
            // D, D with the other k, and t
            let denominators = |c: usize, (i, j): (u32, u32)| {
                let of = |(i, j): (u32, u32)| [at(i, j).mean()[c], at(i, j).variance_of_mean()[c]];
                let near = |a: u32, n: u32| a.saturating_sub(2)..(a + 3).min(n);
                let window = near(j, size[1]).flat_map(|j| near(i, size[0]).map(move |i| (i, j)));
                let window = of_others(window.filter(|p| *p != (i, j)).map(of));
                let others = inside.iter().filter(|p| (p.0 + i) % 2 == 1 || (p.1 + j) % 2 == 1);
                let block = of_others(others.map(|p| of(*p)));
                let share = |a: f64, b: f64| if a > 0.0 { a / (a + b) } else { 0.0 };
                let u = share(block[2], window[3].max(block[3]) / window[0]);
                let mu = block[1] + u * (window[1] - block[1]);
                let [m, v] = of((i, j));
                let with = |k: f64| {
                    let w = share(window[2], v.max(window[3])).max(1.0 - k * v / (m - mu).powi(2));
                    let of_mu = u * u * window[3] / window[0] + (1.0 - u).powi(2) * block[3] / block[0];
                    let variance = 0.9 * w * w * v + (1.0 - w).powi(2) * of_mu;
                    (((mu + w * (m - mu)).powi(2) - variance).max(0.0) + 0.01, (1.0 - w) * u * u)
                };
                [with(1.0).0, with(4.0).0, with(1.0).1]
            };
            let known = [0, 1, 2].map(|c| inside.iter().map(|p| denominators(c, *p)).collect::<Vec<_>>());
            for (n, ((i, j), found)) in inside.iter().zip(&found).enumerate() {
                let mut sums = [0.0; 5];
                for (c, known) in known.iter().enumerate() {
                    let [d, other, t] = known[n];
                    let near = |p: &(u32, u32)| p != &(*i, *j) && p.0.abs_diff(*i) < 3 && p.1.abs_diff(*j) < 3;
                    let logs = inside.iter().zip(known).filter(|(p, _)| near(p)).map(|(_, d)| d[0].ln());
                    let (count, sum) = logs.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x));
                    let root = (0.5 * (t * (d.ln() - sum / count)).clamp(-1.6, 1.6)).exp();
                    let v = at(*i, *j).variance_of_mean()[c];
                    let error = v / d * root;
                    let above = (12.0 - at(*i, *j).mean()[c]).max(0.0) / 16.0;
                    let doubt = (error * root - v / d).abs();
                    let values = [error, v / other * root, doubt, error * error / (error + 0.25), above * above / d];
                    sums.iter_mut().zip(values).for_each(|(sum, x)| *sum += x / 3.0);
                }
                let values = [found.error, found.other, found.contrast, found.unsure, found.highlight].map(f64::from);
                let same = |a: f64, b: f64| (a - b).abs() < 1e-4 * b + 1e-5 * sums[0];
                assert!(values.iter().zip(sums).all(|(a, b)| same(*a, b)), "{i} {j}: {found:?}, not {sums:?}");
                assert_eq!(found.class, class(&at(*i, *j)));
            }
            assert_eq!(found.len(), inside.len());
        }
    }

    /// Nothing that is finite makes an error that is not: pixels alone, black, huge, of one sample. Killed by: a division
    /// by nothing.
    #[test]
    fn errors_are_finite() {
        for p in
            [pixel(4, 0.0, 0.0), pixel(4, 1e30, 1e60), pixel(1, 5.0, 0.0), pixel(4, 1e-30, 1e-62), pixel(0, 0.0, 0.0)]
        {
            for n in [1, 2, 256] {
                let all = errors(&[p].repeat(n));
                assert!(all.iter().all(|e| e.is_finite() && *e >= 0.0), "{p:?} {n}");
            }
        }
        let [a, ..] = errors(&[pixel(4, 2.0, 0.1)]);
        assert!((a - 0.1 / (4.0 - 0.09 + 0.01)).abs() < 1e-8);
    }
}
