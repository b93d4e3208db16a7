//! The generalised selection estimator (Szecsi, Szirmay-Kalos and Kelemen 2003): a sum of terms estimated by one of them.
//!
//! ```text
//! sum a_k = E[a_K / p_K],   p_k = I_k / sum I
//! ```
//!
//! for every choice of importances I_k >= 0 that are positive where a_k is not 0. Roulette is the case of two terms, one
//! of them 0; reflection or refraction at an interface, or scattering or passing at a tentative collision in a medium
//! (`media::collision`), are others. Importances in proportion to the terms leave no variance.

use croupier_simd::{F32x8, Mask8, U32x8};

/// One term of several, a choice per lane.
#[derive(Clone, Copy, Debug)]
pub struct Selection8 {
    /// Number of the chosen term.
    pub choice: U32x8,
    /// Factor on the chosen term, 1 / probability; 0 outside `any`.
    pub scale: F32x8,
    /// Lanes in which a term was chosen: others have no importance above 0.
    pub any: Mask8,
}

impl Selection8 {
    /// Lanes that chose term `k`.
    #[inline(always)]
    pub fn chose(&self, k: u32) -> Mask8 {
        self.choice.eq(U32x8::splat(k)) & self.any
    }
}

/// Chooses a term by `importance` with one uniform number `u` in [0, 1) per lane.
///
/// Importances below 0 and NaN count as 0. A term of importance 0 is never chosen, and a term that is the only one is
/// chosen with scale 1 exactly, whatever the rounding of sums and products. Importances must be below 1e37, so that
/// their sum is finite.
#[inline(always)]
pub fn select<const N: usize>(importance: [F32x8; N], u: F32x8) -> Selection8 {
    let importance = importance.map(|x| F32x8::ZERO.max(x));
    let total = importance.iter().fold(F32x8::ZERO, |sum, x| sum + *x);
    let point = u * total;
    let (mut sum, mut chosen, mut choice) = (F32x8::ZERO, F32x8::ZERO, U32x8::splat(0));
    // the last term of positive importance that begins at or before the point: there is one even where `point` rounds
    // up to the total
    for (k, x) in (0..).zip(importance) {
        let begun = sum.le(point) & x.gt(F32x8::ZERO);
        choice = U32x8::select(begun, U32x8::splat(k), choice);
        chosen = begun.select(x, chosen);
        sum += x;
    }
    let any = chosen.gt(F32x8::ZERO);
    Selection8 { choice, scale: any.zero_unless(total / chosen), any }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: u32 = 1 << 16;
    const TERMS: [f64; 3] = [0.5, -3.0, 1.25];

    /// Frequencies over an even grid of numbers are the probabilities within one number, `scale` is their inverse, and
    /// the estimate of a sum is the sum. Killed by: a term that takes its neighbour's share, p in place of 1 / p.
    #[test]
    fn estimates_are_right_on_average() {
        for weights in [[1.0f32, 2.0, 5.0], [0.25, 0.0, 0.75], [1e-3, 1e3, 1e-3], [3e36, 1e36, 0.0], [0.0, 0.0, 1e-42]]
        {
            let total: f64 = weights.iter().copied().map(f64::from).sum();
            let mut count = [0u32; 3];
            let mut sum = 0.0;
            for k in 0..GRID / 8 {
                let u = F32x8::from_fn(|i| ((8 * k + i as u32) as f32 + 0.5) / GRID as f32);
                let s = select(weights.map(F32x8::splat), u);
                assert!(s.any.all());
                for i in 0..8 {
                    let choice = s.choice.lane(i) as usize;
                    count[choice] += 1;
                    let exact = total / f64::from(weights[choice]);
                    assert!((f64::from(s.scale.lane(i)) / exact - 1.0).abs() < 1e-6);
                    assert!(s.chose(choice as u32).lane(i) && !s.chose(3).lane(i));
                    // terms that are not in proportion to the importances
                    sum += TERMS[choice] * f64::from(s.scale.lane(i)) / f64::from(GRID);
                }
            }
            let want: f64 = (0..3).filter(|k| weights[*k] > 0.0).map(|k| TERMS[k]).sum();
            for k in 0..3 {
                let expected = f64::from(weights[k]) / total * f64::from(GRID);
                assert!((f64::from(count[k]) - expected).abs() <= 1.0, "{weights:?}: {count:?}");
                assert!(weights[k] > 0.0 || count[k] == 0);
            }
            if weights[0] > 0.01 {
                assert!((sum / want - 1.0).abs() < 1e-3, "{weights:?}: {sum} {want}");
            }
        }
    }

    /// Killed by: the largest number choosing behind the last term, a NaN that is chosen, 0 / 0 without importance.
    #[test]
    fn edges_choose_what_has_importance() {
        let largest = F32x8::splat(1.0 - 1.0 / 16_777_216.0);
        for only in [1.0f32, 1e-45, 1e-38, 0.1, 1e36] {
            for at in 0..3 {
                for u in [F32x8::ZERO, largest, F32x8::splat(1.0)] {
                    let x: [F32x8; 3] = core::array::from_fn(|k| F32x8::splat(if k == at { only } else { 0.0 }));
                    let s = select(x, u);
                    assert_eq!((s.choice.lane(2), s.scale.lane(2)), (at as u32, 1.0));
                }
            }
        }
        let bad = select([f32::NAN, -1.0, 0.0, -0.0].map(F32x8::splat), F32x8::splat(0.5));
        assert!(bad.any.none() && bad.chose(0).none() && bad.scale == F32x8::ZERO);
        let nan = select([F32x8::ONE, F32x8::ONE], F32x8::splat(f32::NAN));
        assert!(nan.any.none() && nan.scale == F32x8::ZERO);
    }
}
