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
//! Noise is the mean of the others' variances, c the variance among them beyond it: where there is contrast, pixels are what
//! their samples say (Lee, "Digital image enhancement and noise filtering by use of local statistics", 1980). Blocks alone
//! stated half the error where a bright window lies in them, which lends its contrast to all their pixels; windows alone
//! state three times the error where most pixels have found nothing yet. The second term of w keeps pixels that stand out
//! beyond their own noise (the positive part of James and Stein, "Estimation with quadratic loss", 1961). The others in the
//! block are those of other parity in column or row: the pixel is in none of the sums, and nothing is subtracted
//! (NUMERICS STA-4). k = 1 is the estimate; k = [`DOUBT`] says how much depends on this choice, which widens the interval.
//!
//! At edges 1 / D is less than its mean over what the pixel may be; [`super::contrast`] says how much less it may be. The
//! estimate is halfway in the logarithm, and the interval holds both ends.
//!
//! What a pixel's own noise makes of its denominator widens the interval too: where q = v / D is large, at the edges of
//! lamps, in caustics, D is hardly known. Each pixel adds q^2 / (q + [`UNSURE`]), all of q where it is large, next to
//! nothing where it is small, and [`UNSURE_SHARE`] of the sum counts. Both numbers were found with the benchmark
//! `intervals`.

use super::contrast::{LARGEST, LONGEST, Line, REACH};
use super::error::{REL_MSE_EPSILON, TAKEN_OFF, relative_denominator};
use super::independence::class;
use super::pixel::PixelStats;

/// Pixels a side of the smallest block.
pub(super) const SIDE: u32 = LONGEST.div_ceil(2) as u32;
/// Rows of the window.
const ROWS: usize = 2 * REACH as usize + 1;
/// Most columns of a block with those that its windows reach.
const COLUMNS: usize = LONGEST + 2 * REACH as usize;
/// Fewer other pixels say nothing.
const ENOUGH: f64 = 8.0;
/// The other k.
const DOUBT: f64 = 4.0;
/// Relative squared error of a pixel of which half is unsure.
const UNSURE: f64 = 0.25;
/// Part of what is unsure by which an interval is widened to both sides.
pub(super) const UNSURE_SHARE: f64 = 0.5;

/// Mean of a pixel and its variance, by channel, and its class.
#[derive(Clone, Copy)]
struct Seen {
    mean: [f64; 3],
    variance: [f64; 3],
    class: usize,
}

impl Seen {
    /// Arrays of a constant are filled; of a value each field would be copied.
    const NOTHING: Self = Self { mean: [0.0; 3], variance: [0.0; 3], class: 0 };

    fn of(p: &PixelStats) -> Self {
        Self { mean: p.mean(), variance: p.variance_of_mean(), class: class(p) }
    }
}

/// Sums over some pixels, by channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    pixels: f64,
    mean: [f64; 3],
    /// Of squared means.
    square: [f64; 3],
    /// Of variances of means.
    variance: [f64; 3],
}

impl Sums {
    #[inline(always)]
    fn add(&mut self, p: &Seen) {
        self.pixels += 1.0;
        for c in 0..3 {
            self.mean[c] += p.mean[c];
            self.square[c] += p.mean[c] * p.mean[c];
            self.variance[c] += p.variance[c];
        }
    }

    #[inline(always)]
    fn join(&mut self, o: &Self) {
        self.pixels += o.pixels;
        for c in 0..3 {
            self.mean[c] += o.mean[c];
            self.square[c] += o.square[c];
            self.variance[c] += o.variance[c];
        }
    }
}

/// What other pixels say of one.
#[derive(Clone, Copy, Default)]
struct Others {
    pixels: f64,
    mean: [f64; 3],
    /// Variance among them beyond their noise.
    contrast: [f64; 3],
    /// Mean of their variances.
    noise: [f64; 3],
}

impl From<Sums> for Others {
    #[inline(always)]
    fn from(s: Sums) -> Self {
        let n = 1.0 / s.pixels.max(1.0);
        let (mean, noise) = (s.mean.map(|x| x * n), s.variance.map(|x| x * n));
        let contrast = core::array::from_fn(|c| (s.square[c] * n - mean[c] * mean[c] - noise[c]).max(0.0));
        Self { pixels: s.pixels, mean, contrast, noise }
    }
}

/// Relative squared errors of a pixel, means over channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PixelError {
    /// Variance over the denominator.
    pub error: f64,
    /// The same with the other k.
    pub other: f64,
    /// How far it is from D to D' of [`super::contrast`].
    pub contrast: f64,
    /// What of it is unsure because of the pixel's own noise.
    pub unsure: f64,
    /// Class of the pixel by the spread of its samples.
    pub class: usize,
}

/// Row of a block: what is known of its pixels before their contrast is.
#[derive(Clone, Copy)]
struct Row {
    /// Variances over D, and over that with the other k, by pixel and channel.
    errors: [[[f32; 2]; 3]; LONGEST],
    classes: [u8; LONGEST],
    line: Line,
}

impl Row {
    const EMPTY: Self = Self { errors: [[[0.0; 2]; 3]; LONGEST], classes: [0; LONGEST], line: Line::EMPTY };

    /// Sets a pixel.
    fn add(&mut self, column: usize, p: &Seen, window: &Others, block: &Others) {
        let (mut d, mut left) = ([1.0; 3], [0.0; 3]);
        self.classes[column % LONGEST] = p.class as u8;
        let errors = &mut self.errors[column % LONGEST];
        for c in 0..3 {
            let (m, v) = (p.mean[c], p.variance[c]);
            [d[c], left[c]] = denominator(c, [m, v], 1.0, window, block);
            // without an error there is nothing to divide
            errors[c] = if v > 0.0 {
                let other = denominator(c, [m, v], DOUBT, window, block)[0];
                [d[c], other].map(|d| (v / d).min(LARGEST) as f32)
            } else {
                [0.0; 2]
            };
        }
        self.line.set(column, d, left);
    }

    /// Shows the errors of `columns` pixels.
    fn show<'a>(&self, columns: usize, window: impl Iterator<Item = &'a Line>, mut show: impl FnMut(PixelError)) {
        let rise = self.line.root_of_rise(columns, window);
        let pixels = self.errors.iter().zip(self.classes).zip(rise.as_chunks::<3>().0);
        for ((errors, class), rise) in pixels.take(columns) {
            let mut sum = PixelError { class: class.into(), ..PixelError::default() };
            for (errors, rise) in errors.iter().zip(rise.map(f64::from)) {
                let [q, other] = errors.map(f64::from);
                let error = q * rise;
                sum.error += error / 3.0;
                sum.other += other * rise / 3.0;
                sum.contrast += (error * rise - q).abs() / 3.0;
                sum.unsure += error * (error / (error + UNSURE)) / 3.0;
            }
            show(sum);
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
    fn reach(self) -> core::ops::Range<u32> {
        self.from.saturating_sub(REACH)..self.to.saturating_add(REACH).min(self.size)
    }
}

/// Parity of column and row, 0 to 3.
fn parity(column: u32, row: u32) -> usize {
    (row & 1) as usize * 2 + (column & 1) as usize
}

/// Shows the relative squared errors of the pixels of a block, row by row. `pixel` gives those at a column and row of the
/// picture; it is asked for each pixel twice, and for those that windows reach.
pub(super) fn relative_errors(
    [x, y]: [Span; 2],
    pixel: impl Fn(u32, u32) -> PixelStats,
    mut show: impl FnMut(PixelError),
) {
    let mut sums = [Sums::default(); 4];
    for row in y.from..y.to {
        for column in x.from..x.to {
            sums[parity(column, row) & 3].add(&Seen::of(&pixel(column, row)));
        }
    }
    let block: [Others; 4] = core::array::from_fn(|own| {
        let mut all = Sums::default();
        sums.iter().enumerate().filter(|(class, _)| *class != own).for_each(|(_, s)| all.join(s));
        all.into()
    });
    // the rows of the windows, each where the one before the first was
    let mut seen = const { [[Seen::NOTHING; COLUMNS]; ROWS] };
    let mut known = const { [Row::EMPTY; ROWS] };
    let mut next = y.from;
    let left = x.reach().start;
    for row in y.reach().start..y.to.saturating_add(REACH) {
        if row < y.size {
            let line = &mut seen[row as usize % ROWS];
            line.iter_mut().zip(x.reach()).for_each(|(s, column)| *s = Seen::of(&pixel(column, row)));
        }
        let middle = row.wrapping_sub(REACH);
        if !y.is_inside(middle) {
            continue;
        }
        let rows = Span { from: middle, to: middle + 1, size: y.size }.reach();
        let column_of = |i: usize| {
            let mut s = Sums::default();
            rows.clone().filter_map(|r| seen[r as usize % ROWS].get(i)).for_each(|p| s.add(p));
            s
        };
        let mut columns = [Sums::default(); COLUMNS];
        columns.iter_mut().enumerate().take(x.reach().len()).for_each(|(i, s)| *s = column_of(i));
        let into = &mut known[middle as usize % ROWS];
        for (i, column) in (x.from..x.to).enumerate() {
            let at = (column - left) as usize % COLUMNS;
            let own = seen[middle as usize % ROWS][at];
            let mut window = Sums::default();
            rows.clone().filter(|r| *r != middle).for_each(|r| window.add(&seen[r as usize % ROWS][at]));
            let reach = Span { from: column, to: column + 1, size: x.size }.reach();
            for i in (reach.start - left) as usize..(reach.end - left) as usize {
                if i != at {
                    window.join(&columns[i % COLUMNS]);
                }
            }
            into.add(i % LONGEST, &own, &window.into(), &block[parity(column, middle) & 3]);
        }
        into.line.take_logarithms((x.to - x.from) as usize);
        // rows of which all others in the window are known
        let complete = if middle + 1 == y.to { y.to } else { (middle + 1).saturating_sub(REACH) };
        while next < complete {
            let window = next.saturating_sub(REACH).max(y.from)..(next + REACH + 1).min(y.to);
            let lines = window.map(|r| &known[r as usize % ROWS].line);
            known[next as usize % ROWS].show((x.to - x.from) as usize, lines, &mut show);
            next += 1;
        }
    }
}

/// D of a pixel of mean m and variance v, and what part of it the window tells: t of [`super::contrast`].
#[inline(always)]
fn denominator(c: usize, [m, v]: [f64; 2], k: f64, window: &Others, block: &Others) -> [f64; 2] {
    if block.pixels < ENOUGH || window.pixels < ENOUGH {
        return [relative_denominator(m, v), 0.0];
    }
    let (noise, contrast) = (window.noise[c], window.contrast[c]);
    let [unsure, surer] = [noise.max(block.noise[c]) / window.pixels, block.contrast[c]];
    let u = if surer > 0.0 { surer / (surer + unsure) } else { 0.0 };
    let mean = block.mean[c] + u * (window.mean[c] - block.mean[c]);
    let off = (m - mean) * (m - mean);
    // a pixel that has found nothing knows nothing: it is as noisy as the others
    let own = if v > 0.0 { v } else { noise };
    let stands_out = if off > k * own { 1.0 - k * own / off } else { 0.0 };
    let [surer, unsure] = [contrast, own.max(noise)];
    let w = if surer > 0.0 { surer / (surer + unsure) } else { 0.0 }.max(stands_out);
    let e = mean + w * (m - mean);
    let of_window = u * u * noise / window.pixels;
    let of_block = (1.0 - u) * (1.0 - u) * block.noise[c] / block.pixels;
    let variance = TAKEN_OFF * w * w * v + (1.0 - w) * (1.0 - w) * (of_window + of_block);
    [(e * e - variance).max(0.0) + REL_MSE_EPSILON, (1.0 - w) * u * u]
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
        PixelStats { sum: [mean * w; 3], spread: [spread; 3], weight: w, weight_sqr: w, samples: n, rays: 0 }
    }

    /// Means of error, other error and what is unsure over rows of 16 pixels, a block of 16 x 16 if there are as many.
    fn errors(pixels: &[PixelStats]) -> [f64; 3] {
        let n = pixels.len() as u32;
        let spans = [n.min(16), n.div_ceil(16)].map(|size| Span { from: 0, to: size, size });
        let mut sum = [0.0; 3];
        let one = |x: u32, y: u32| pixels.get((y * 16 + x) as usize).copied().unwrap_or_default();
        relative_errors(spans, one, |e| sum = [sum[0] + e.error, sum[1] + e.other, sum[2] + e.unsure]);
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
            let least = q / (q + UNSURE) - 1e-3;
            assert!(unsure / error > least && (q > 1.0 || unsure / error < least + 2e-3), "{unsure} of {error}");
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
