//! Sums of one pixel: of an iteration, of all of them, and of its auxiliary values.

use bytemuck::{Pod, Zeroable};

/// Sums over the camera samples that one shard drew for a pixel in one iteration.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PixelSums {
    /// Sum of radiance, linear Rec. 709.
    pub sum: [f64; 3],
    /// Sum of squared radiance.
    pub sum_sqr: [f64; 3],
    /// Number of camera samples.
    pub samples: u64,
    /// Number of rays traced for them, of all kinds.
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

    /// Mean and its squared standard error per channel, for two independent samples at least.
    pub(super) fn mean_and_variance(&self) -> [[f64; 2]; 3] {
        let n = self.samples as f64;
        core::array::from_fn(|c| {
            let m = self.sum[c] / n;
            [m, ((self.sum_sqr[c] - m * self.sum[c]) / (n * (n - 1.0))).max(0.0)]
        })
    }
}

/// Weighted sums over the camera samples of one pixel. All samples of the pixel in an iteration have the same weight
/// `w`: 1, less where adaptive sampling took more.
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
    /// Number of camera samples.
    pub samples: u64,
    /// Number of rays traced for them, of all kinds.
    pub rays: u64,
}

/// Sums of auxiliary values of one pixel.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct PixelAov {
    /// Sum of albedos of the first hit, seen from the camera, as roulette uses them: reflected and transmitted, 1 for
    /// clear glass.
    pub albedo: [f64; 3],
    /// Sum of shading normals of the first hit, world space.
    pub normal: [f64; 3],
    /// Sum of distances to the first hit, world units.
    pub depth: f64,
    /// Number of camera samples that hit a surface.
    pub hits: f64,
    /// Sum of roulette factors at vertices of depth 1, 2, 3 and above.
    pub factor: [f64; 4],
    /// Number of those vertices.
    pub vertices: [f64; 4],
    /// Number of paths: camera samples and samples that splitting added.
    pub paths: f64,
}

impl PixelStats {
    pub(super) fn merge(&mut self, o: &PixelSums, w: f64) {
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

    /// Squared standard error of the mean per channel, for independent samples. With roulette or splitting that is an
    /// upper bound: one comb rounds a packet, and the roundings of its samples cancel (standard errors of up to twice
    /// the true ones were measured). One sample has no measurable variance: its square is used.
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
    pub(super) fn merge(&mut self, o: &Self) {
        let (a, b): (&mut [f64; 17], &[f64; 17]) = (bytemuck::cast_mut(self), bytemuck::cast_ref(o));
        for (a, b) in a.iter_mut().zip(b) {
            *a += *b;
        }
    }
}
