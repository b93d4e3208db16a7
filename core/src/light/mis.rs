//! Multiple importance sampling weights.

use croupier_simd::F32x8;

/// Power heuristic with exponent 2 (Veach 1997, eq. 9.12) for one sample of each of two techniques: the weight of a
/// sample whose own density is `own`, when the other technique has density `other` there.
///
/// Through the ratio, so that no square over- or underflows before it must (NUMERICS MIS-1). In [0, 1]; 0 for
/// `own <= 0` and for NaN, 1 for `other = 0`. Delta lobes and lights have no density: their weight is 1 by their mask.
#[inline(always)]
pub fn power_heuristic(own: F32x8, other: F32x8) -> F32x8 {
    let r = other / own;
    let w = F32x8::ONE / (F32x8::ONE + r * r);
    (own.gt(F32x8::ZERO) & w.ge(F32x8::ZERO)).zero_unless(w)
}
