//! How far the samples of an iteration are from independent, seen from outside: iterations are independent, so the
//! squared difference of the picture before and an iteration is the sum of their true variances, whatever happens
//! within.

use super::error::relative_denominator;
use super::pixel::{PixelStats, PixelSums};
use super::sqrt::SqrtNewton;

/// Sums over the pixels of an iteration that is being merged: by how much it differs from the picture before, and by
/// how much it should if the samples of each were independent. Relative, as relMSE is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Differences {
    /// Squared differences of the means: variance of the picture before plus variance of the iteration.
    found: f64,
    /// Stated variance of the picture before, and of the iteration.
    stated: [f64; 2],
    /// Sums of found^2, stated^2 and found x stated, per pixel.
    squares: [f64; 3],
    /// Weight of the picture before, and of the iteration.
    weight: [f64; 2],
}

impl Differences {
    /// A pixel's samples so far, and those of the iteration, each with weight `w`.
    pub(super) fn add(&mut self, p: &PixelStats, o: &PixelSums, w: f64) {
        if p.samples < 2 || o.samples < 2 {
            return;
        }
        let (m, v) = (p.mean(), p.variance_of_mean());
        let (mut found, mut before, mut new) = (0.0, 0.0, 0.0);
        for (c, [mean, variance]) in o.mean_and_variance().into_iter().enumerate() {
            let denominator = relative_denominator(m[c], v[c]);
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
        self.weight[1] += w * o.samples as f64;
    }
}

/// True over stated variance of the picture, and the standard error of that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Independence {
    pub ratio: f64,
    pub noise: f64,
}

impl Independence {
    /// Samples count as independent.
    pub(super) const UNKNOWN: Self = Self { ratio: 1.0, noise: 0.0 };

    /// The ratio after an iteration: the picture before had variance r S, the iteration has what was found beyond that.
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
            // a long iteration after a short one: what was found is mostly of the short one, and says nothing of the
            // other
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
