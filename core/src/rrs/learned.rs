//! Learned statistics as strategies see them.

use crate::names::names;
use croupier_simd::{F32x8, LUMINANCE, Vec3x8};

/// Norm of a colour: how errors of the channels become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Norm {
    /// Largest of r, g, b.
    #[default]
    Max,
    /// Luminance of linear Rec. 709 ([`LUMINANCE`]).
    Luminance,
    /// Mean of r, g, b.
    Mean,
}

impl Norm {
    /// Norm of one colour in f64.
    pub(crate) fn of_color(self, [r, g, b]: [f64; 3]) -> f64 {
        match self {
            Self::Max => r.max(g).max(b),
            Self::Luminance => {
                let [x, y, z] = LUMINANCE;
                x * r + y * g + z * b
            }
            Self::Mean => (r + g + b) / 3.0,
        }
    }

    /// Norm of each lane.
    #[inline(always)]
    pub fn of(self, c: Vec3x8) -> F32x8 {
        match self {
            Self::Max => c.max_component(),
            Self::Luminance => c.luminance(),
            Self::Mean => c.mean(),
        }
    }

    pub(super) fn parse(text: &str) -> Option<Self> {
        if text.is_empty() { Some(Self::default()) } else { Self::from_name(text) }
    }
}

names!(Norm: Mean = "mean", Luminance = "luminance", Max = "max");

/// Domain of local statistics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// Cells of the scene and directions.
    Scene,
    /// Blocks of the picture and path lengths.
    Image,
}

/// Local statistics of the samples of eight vertices, one vertex per lane. All values are finite and none is negative.
#[derive(Clone, Copy, Debug)]
pub struct Local8 {
    /// Mean of one sample's reflected radiance, rgb (EARS, eq. 36).
    pub mean: Vec3x8,
    /// Mean square of one sample's reflected radiance, at least `mean^2` (eq. 35).
    pub moment: Vec3x8,
    /// Variance of one sample at a point, without the spread of the mean over the cell as far as pairs of samples of one vertex
    /// tell; at most `moment` (eq. 37).
    pub variance: Vec3x8,
    /// Mean counted cost of one sample ([`crate::cost::COST_BOUNCE`] and its like; eq. 38).
    pub cost: F32x8,
    /// Mean square of the contribution of next event estimation over `moment`, over all channels, at most 1.
    pub nee_share: F32x8,
    /// Confidence: samples behind these numbers, older ones discounted; 0 where nothing is known.
    pub count: F32x8,
}

impl Local8 {
    /// Statistics where nothing is known.
    pub const NONE: Self = Self {
        mean: Vec3x8::ZERO,
        moment: Vec3x8::ZERO,
        variance: Vec3x8::ZERO,
        cost: F32x8::ONE,
        nee_share: F32x8::ONE,
        count: F32x8::ZERO,
    };

    /// Confidence in [0, 1): half at `samples`.
    #[inline(always)]
    pub fn trust(&self, samples: f32) -> F32x8 {
        self.count / (self.count + F32x8::splat(samples))
    }
}

/// Statistics that were frozen before the iteration began, one vertex per lane: of the picture and of the vertex.
#[derive(Clone, Copy, Debug)]
pub struct Learned8 {
    /// Weight of a squared error of the pixel in the error of the picture, per channel: 1 / (I^2 + 0.01) for the
    /// relative objective with I the estimate of the pixel, 1 for the absolute one.
    pub error_weight: Vec3x8,
    /// Norm over the channels.
    pub norm: Norm,
    /// Mean cost of a camera sample over its mean weighted squared error (eqs. 33, 34); 0 while unknown.
    pub cost_over_variance: F32x8,
    /// Statistics of the vertex's samples, of reflected radiance.
    pub local: Local8,
}

impl Learned8 {
    /// Statistics where nothing is known; errors are absolute.
    pub const NONE: Self =
        Self { error_weight: Vec3x8::ONE, norm: Norm::Mean, cost_over_variance: F32x8::ZERO, local: Local8::NONE };

    /// Square of the most efficient factor (eq. 32) at prefix weight `beta`, for samples whose second moment or
    /// variance is `r`.
    #[inline(always)]
    pub fn efficient_square(&self, beta: Vec3x8, r: Vec3x8) -> F32x8 {
        let error = self.norm.of(beta * beta * self.error_weight * r);
        error * self.cost_over_variance / self.local.cost
    }

    /// Expected contribution of a vertex in units of its pixel, mean over the channels.
    #[inline(always)]
    pub fn contribution(&self, beta: Vec3x8) -> F32x8 {
        (beta * self.local.mean * self.root_error_weight()).mean()
    }

    /// Square root of the error weight, per channel: 1 over the pixel for the relative objective, 1 for the absolute.
    #[inline(always)]
    pub fn root_error_weight(&self) -> Vec3x8 {
        let i = self.error_weight;
        Vec3x8::new(i.x.sqrt(), i.y.sqrt(), i.z.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One colour and eight have the same norm, and white keeps its value. Killed by: weights of another table in one
    /// of the two, channels exchanged, weights that do not add up to 1.
    #[test]
    fn norms_of_one_and_of_eight_agree() {
        for norm in [Norm::Max, Norm::Luminance, Norm::Mean] {
            for c in [[1.0f32; 3], [0.7, 0.2, 0.1], [0.01, 8.0, 3.0], [0.0, 0.0, 5.0]] {
                let eight = f64::from(norm.of(Vec3x8::splat(c[0], c[1], c[2])).lane(3));
                let one = norm.of_color(c.map(f64::from));
                assert!((eight - one).abs() <= 3e-7 * one, "{norm:?} {c:?}: {eight} and {one}");
            }
            assert!((norm.of_color([1.0; 3]) - 1.0).abs() < 1e-6, "{norm:?}");
        }
    }
}
