//! Correlation of an iteration's samples, measured from outside. Iterations are independent, so the expected squared
//! difference between the picture before and an iteration is the sum of their true variances, however samples correlate
//! within.

use super::error::relative_denominator;
use super::pixel::{PixelStats, PixelSums};
use super::sqrt::SqrtNewton;
use bytemuck::{Pod, Zeroable};

/// Sums over the pixels of an iteration that is being merged: squared differences from the picture before, and those
/// expected if all samples were independent. Relative, with the denominator of relMSE.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Differences {
    /// Squared differences of the means: true variance of the picture before plus true variance of the iteration.
    found: f64,
    /// Variance of independent samples: of the picture before, and of the iteration.
    stated: [f64; 2],
    /// Sums over pixels of found^2, stated^2 and found x stated.
    squares: [f64; 3],
    /// Weights of the picture before and of the iteration.
    weight: [f64; 2],
}

impl Differences {
    /// Adds a pixel: its samples so far, and those of the iteration, each with weight `w`.
    pub(super) fn add(&mut self, p: &PixelStats, o: &PixelSums, w: f64) {
        if p.samples < 2 || o.samples < 2 {
            return;
        }
        let (m, v) = (p.mean(), p.variance_of_mean());
        let (mut found, mut before, mut new) = (0.0, 0.0, 0.0);
        let (a, b) = (p.weight, w * f64::from(o.samples));
        let (a, b) = (a / (a + b), b / (a + b));
        for (c, [mean, variance]) in o.mean_and_variance().into_iter().enumerate() {
            // of both together: the difference of two means does not depend on their weighted sum, but on each of them
            let denominator = relative_denominator(a * m[c] + b * mean, a * a * v[c] + b * b * variance);
            found += (mean - m[c]) * (mean - m[c]) / denominator;
            before += v[c] / denominator;
            new += variance / denominator;
        }
        self.found += found;
        self.stated[0] += before;
        self.stated[1] += new;
        let stated = before + new;
        for (sum, x) in self.squares.iter_mut().zip([found * found, stated * stated, found * stated]) {
            *sum += x;
        }
        self.weight[0] += p.weight;
        self.weight[1] += w * f64::from(o.samples);
    }
}

/// True variance of the picture over that of independent samples, and the standard error of this ratio.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Independence {
    pub ratio: f64,
    pub noise: f64,
}

impl Independence {
    /// Ratio before two iterations: samples are assumed to be independent.
    pub(super) const UNKNOWN: Self = Self { ratio: 1.0, noise: 0.0 };

    /// Ratio after an iteration: the picture before had variance r S, and the iteration has the rest of what was found.
    pub(super) fn after(self, d: &Differences) -> Self {
        let [s, t] = d.stated;
        if s + t <= 0.0 {
            return self;
        }
        let r = d.found / (s + t);
        let [a, b, ab] = d.squares;
        // variance of what was found, beyond what was expected
        let noise = (a - 2.0 * r * ab + r * r * b).max(0.0);
        let [x, y] = d.weight.map(|w| w * w);
        let next = if y > x {
            // a long iteration after a short one: the difference is mostly the short one's error and hardly depends on
            // the other
            Self { ratio: r, noise: noise.sqrt_newton() / (s + t) }
        } else {
            let stated = x * s + y * t;
            let old = (x - y) * s;
            let noise = (old * old * self.noise * self.noise + y * y * noise).sqrt_newton();
            Self { ratio: (old * self.ratio + y * d.found) / stated, noise: noise / stated }
        };
        if next.ratio > 0.0 && next.ratio.is_finite() && next.noise.is_finite() { next } else { self }
    }
}
