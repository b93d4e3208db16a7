//! What a picture is made of: per pixel f64 sums, so that neither 1e9 samples nor one firefly spoils the mean
//! (NUMERICS FLM-1), and what can be said from them.

mod independence;

use bytemuck::{Pod, Zeroable};
use independence::{Differences, Independence};

/// Sums over the camera samples that one shard drew for a pixel in one iteration.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PixelSums {
    /// Radiance, linear Rec. 709.
    pub sum: [f64; 3],
    /// Squared radiance.
    pub sum_sqr: [f64; 3],
    /// Camera samples.
    pub samples: u64,
    /// Rays traced for them.
    pub rays: u64,
}

impl PixelSums {
    /// Adds one camera sample.
    pub(crate) fn add(&mut self, radiance: [f64; 3], rays: u32) {
        for (c, x) in radiance.into_iter().enumerate() {
            self.sum[c] += x;
            self.sum_sqr[c] += x * x;
        }
        self.samples += 1;
        self.rays += u64::from(rays);
    }

    /// Mean, and its squared standard error if its samples, two at least, are independent.
    fn mean_and_variance(&self) -> [[f64; 2]; 3] {
        let n = self.samples as f64;
        core::array::from_fn(|c| {
            let m = self.sum[c] / n;
            [m, ((self.sum_sqr[c] - m * self.sum[c]) / (n * (n - 1.0))).max(0.0)]
        })
    }
}

/// Weighted sums over the camera samples of one pixel. All samples of the pixel in an iteration have the same
/// weight `w`: 1, less where adaptive sampling took more.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct PixelStats {
    /// Sum of w x, x the radiance of a camera sample in linear Rec. 709.
    pub sum: [f64; 3],
    /// Sum of w^2 x^2.
    pub sum_sqr: [f64; 3],
    /// Sum of w^2 x.
    pub cross: [f64; 3],
    /// Sum of w.
    pub weight: f64,
    /// Sum of w^2.
    pub weight_sqr: f64,
    /// Camera samples.
    pub samples: u64,
    /// Rays traced for them.
    pub rays: u64,
}

/// Sums of auxiliary values of one pixel.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct PixelAov {
    /// Albedo of the first hit from the camera's side, as roulette takes it: reflected and transmitted, 1 for clear
    /// glass.
    pub albedo: [f64; 3],
    /// Shading normal of the first hit, world space.
    pub normal: [f64; 3],
    /// Distance to the first hit.
    pub depth: f64,
    /// Camera samples that hit something.
    pub hits: f64,
    /// Roulette factors at the vertices of depth 1, 2, 3 and above.
    pub factor: [f64; 4],
    /// How many vertices those are.
    pub vertices: [f64; 4],
    /// Paths: camera samples and what splitting added.
    pub paths: f64,
}

impl PixelStats {
    fn merge(&mut self, o: &PixelSums, w: f64) {
        for c in 0..3 {
            self.sum[c] += w * o.sum[c];
            self.sum_sqr[c] += w * w * o.sum_sqr[c];
            self.cross[c] += w * w * o.sum[c];
        }
        self.weight += w * o.samples as f64;
        self.weight_sqr += w * w * o.samples as f64;
        self.samples += o.samples;
        self.rays += o.rays;
    }

    /// Mean radiance; 0 before the first sample.
    pub fn mean(&self) -> [f64; 3] {
        let w = if self.samples == 0 { 1.0 } else { self.weight };
        self.sum.map(|s| s / w)
    }

    /// Squared standard error of the mean per channel, its samples taken as independent. With roulette or splitting
    /// that is an upper bound: one comb rounds a packet, and the roundings of its samples cancel (standard errors of up
    /// to twice the true ones were measured). One sample tells nothing of its error: its own square stands in.
    pub fn variance_of_mean(&self) -> [f64; 3] {
        let (w, w2, m) = (self.weight, self.weight_sqr, self.mean());
        // w^2 - w2 is w^2 (1 - 1 / n) for n samples of equal weight
        core::array::from_fn(|c| match self.samples {
            0 => 0.0,
            1 => m[c] * m[c],
            _ => ((self.sum_sqr[c] - 2.0 * m[c] * self.cross[c] + m[c] * m[c] * w2) / (w * w - w2)).max(0.0),
        })
    }
}

impl PixelAov {
    fn merge(&mut self, o: &Self) {
        let (a, b): (&mut [f64; 17], &[f64; 17]) = (bytemuck::cast_mut(self), bytemuck::cast_ref(o));
        for (a, b) in a.iter_mut().zip(b) {
            *a += *b;
        }
    }
}

/// The whole picture, row 0 at the top.
#[derive(Debug)]
pub struct Film<'m> {
    size: [u32; 2],
    pixels: &'m mut [PixelStats],
    aovs: &'m mut [PixelAov],
    differences: Differences,
    independence: Independence,
}

/// relMSE that the picture is estimated to have against its own expectation.
///
/// Camera samples of one iteration are not independent where roulette or splitting meets every path: one comb rounds
/// the samples of a packet together, which makes the picture better than its standard errors say. Iterations are
/// independent: how much the picture's pixels differ between them, over what their samples let expect, corrects the
/// estimate from the second iteration of two samples on. Before, it is that of an upper bound: in a diffuse box
/// `fixed:3.3` states 1.35 times the true relMSE, `classic:1` 2.3 times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorEstimate {
    /// Mean over pixels and channels of variance / (mean^2 + 0.01), without the worst 0.01 % of pixels, times
    /// `independence`.
    pub rel_mse: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// The same mean with every pixel.
    pub rel_mse_all: f64,
    /// Variance of the pixels over that of independent samples, as iterations show it; 1 while there are too few.
    pub independence: f64,
}

/// What relMSE adds to the squared mean in its denominator, so that black pixels do not decide it.
pub const REL_MSE_EPSILON: f64 = 1e-2;

impl<'m> Film<'m> {
    pub(crate) fn new(size: [u32; 2], pixels: &'m mut [PixelStats], aovs: &'m mut [PixelAov]) -> Self {
        Self { size, pixels, aovs, differences: Differences::default(), independence: Independence::UNKNOWN }
    }

    /// Columns and rows.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Pixels row by row.
    pub fn pixels(&self) -> &[PixelStats] {
        self.pixels
    }

    /// Auxiliary sums row by row; empty if the settings did not ask for them.
    pub fn aovs(&self) -> &[PixelAov] {
        self.aovs
    }

    /// Adds what an iteration drew for a pixel, each sample with weight `w`.
    pub(crate) fn merge(&mut self, pixel: usize, sums: &PixelSums, aov: Option<&PixelAov>, w: f64) {
        if let Some(p) = self.pixels.get_mut(pixel) {
            self.differences.add(p, sums, w);
            p.merge(sums, w);
        }
        if let (Some(a), Some(b)) = (self.aovs.get_mut(pixel), aov) {
            a.merge(b);
        }
    }

    /// All pixels of an iteration were merged.
    pub(crate) fn end_iteration(&mut self) {
        self.independence = self.independence.after(&core::mem::take(&mut self.differences));
    }

    /// Estimated error of the picture. The interval is the normal one over the pixels' contributions, which are
    /// independent; it is wide while few samples carry most of the error.
    pub fn error_estimate(&self) -> ErrorEstimate {
        let n = self.pixels.len();
        if n == 0 {
            return ErrorEstimate::default();
        }
        let t = trimmed(n / 10_000, |show| self.pixels.iter().for_each(|p| show(relative_error(p))));
        let m = t.count.max(1) as f64;
        let mean = t.sum / m;
        let Independence { ratio, noise } = self.independence;
        let spread = (t.sum_sqr / m - mean * mean).max(0.0) / m;
        let spread = (ratio * ratio * spread + noise * noise * mean * mean).sqrt_newton();
        ErrorEstimate {
            rel_mse: ratio * mean,
            low: (ratio * mean - 1.96 * spread).max(0.0),
            high: ratio * mean + 1.96 * spread,
            rel_mse_all: ratio * (t.sum + t.rest) / n as f64,
            independence: ratio,
        }
    }
}

/// Sums of values without the largest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Trimmed {
    /// Values that count.
    pub count: u64,
    /// Their sum.
    pub sum: f64,
    /// The sum of their squares.
    pub sum_sqr: f64,
    /// The sum of the others: two disjoint sums, nothing is ever subtracted (NUMERICS STA-4).
    pub rest: f64,
    /// The smallest of the others; infinite if there are none.
    pub limit: f32,
}

/// Sums of the non-negative values that `visit` shows without the `k` largest, in `f32`. Of equal ones at the limit as
/// many are left out as make `k`.
pub(crate) fn trimmed(k: usize, mut visit: impl FnMut(&mut dyn FnMut(f64))) -> Trimmed {
    let mut t = Trimmed { limit: f32::INFINITY, ..Trimmed::default() };
    let mut out = k;
    if k > 0 {
        t.limit = kth_largest(k, |show| visit(&mut |x| show(x as f32)));
        let limit = t.limit;
        visit(&mut |x| out = out.saturating_sub(usize::from(x as f32 > limit)));
    }
    visit(&mut |x| {
        let tied = x as f32 == t.limit && out > 0;
        out -= usize::from(tied);
        if x as f32 > t.limit || tied {
            t.rest += x;
        } else {
            t.count += 1;
            t.sum += x;
            t.sum_sqr += x * x;
        }
    });
    t
}

/// The `k`-th largest (k >= 1) of the non-negative values that `visit` shows, by radix selection on the float's bits:
/// four visits, no memory. 0 if there are fewer.
fn kth_largest(k: usize, mut visit: impl FnMut(&mut dyn FnMut(f32))) -> f32 {
    let (mut prefix, mut left) = (0u32, k);
    for shift in [24u32, 16, 8, 0] {
        let mut histogram = [0usize; 256];
        visit(&mut |x| {
            let bits = x.to_bits();
            if shift == 24 || bits >> (shift + 8) == prefix >> (shift + 8) {
                histogram[(bits >> shift & 0xff) as usize] += 1;
            }
        });
        for digit in (0..256usize).rev() {
            if left <= histogram[digit] {
                prefix |= (digit as u32) << shift;
                break;
            }
            left -= histogram[digit];
        }
    }
    f32::from_bits(prefix)
}

/// One pixel's share of relMSE: mean over channels of variance / (mean^2 + eps), the mean's square freed of its own
/// variance.
fn relative_error(p: &PixelStats) -> f64 {
    let (m, v) = (p.mean(), p.variance_of_mean());
    let share = |c: usize| v[c] / relative_denominator(m[c], v[c]);
    (share(0) + share(1) + share(2)) / 3.0
}

/// Of a mean and its variance.
fn relative_denominator(mean: f64, variance: f64) -> f64 {
    (mean * mean - variance).max(0.0) + REL_MSE_EPSILON
}

/// Square root where `core` has none: the same bits on every target.
pub(crate) trait SqrtNewton {
    fn sqrt_newton(self) -> f64;
}

impl SqrtNewton for f64 {
    /// Newton's iteration from an estimate by halving the exponent; within 1 ulp for normal numbers.
    fn sqrt_newton(self) -> f64 {
        if self <= 0.0 || !self.is_finite() {
            return if self > 0.0 { self } else { 0.0 };
        }
        let mut y = f64::from_bits((self.to_bits() >> 1) + 0x1ff8_0000_0000_0000);
        for _ in 0..5 {
            y = 0.5 * (y + self / y);
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::trimmed;

    /// Killed by: leaving out all that is equal to the limit, or none of it.
    #[test]
    fn the_largest_are_left_out_and_no_more() {
        let of = |k: usize, values: &[f64]| {
            let t = trimmed(k, |show| values.iter().for_each(|x| show(*x)));
            (t.count, t.sum, t.rest)
        };
        assert_eq!(of(0, &[1.0, 3.0, 2.0]), (3, 6.0, 0.0));
        assert_eq!(of(1, &[1.0, 3.0, 2.0]), (2, 3.0, 3.0));
        assert_eq!(of(2, &[3.0, 3.0, 3.0, 1.0]), (2, 4.0, 6.0));
        assert_eq!(of(3, &[9.0, 3.0, 3.0, 3.0, 1.0]), (2, 4.0, 15.0));
        assert_eq!(of(1, &[0.0; 4]), (3, 0.0, 0.0));
        assert_eq!(of(9, &[2.0, 1.0]), (0, 0.0, 3.0));
    }
}
