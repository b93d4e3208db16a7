//! Rounding of a packet's factors to sample counts by systematic resampling (Carpenter, Clifford and Fearnhead 1999),
//! here called a *comb*: teeth at distance 1, shifted by one random number, over the prefix sums of the factors. A
//! vertex gets as many samples as teeth fall into its interval.
//!
//! ```text
//! C_i = s_0 + ... + s_i,   n_i = floor(C_i + u) - floor(C_{i-1} + u),   u uniform in [0, 1)
//! ```
//!
//! E\[n_i\] = s_i, with less variance than independent rounding: the total is within 1 of the sum of the factors, so
//! that a packet scaled to its free slots cannot overflow. The counts of one packet are not independent of each other.
//! In 32.32 fixed point every factor in [2^-8, 2^24) is exact, hence so is the expectation over the 2^32 values of `u`;
//! a factor of 1 always gives 1 (NUMERICS RRS-2).

use croupier_simd::F32x8;

/// The number 1 in the 32.32 fixed point of the comb.
pub const COMB_ONE: f64 = 4_294_967_296.0;

/// Sample counts for factors `s` (finite, 0 <= s < 2^24) and `u` = 2^32 times a uniform number.
#[inline(always)]
pub fn comb(s: F32x8, u: u32) -> [u32; 8] {
    let mut c = u64::from(u);
    s.to_array().map(|s| {
        let before = c >> 32;
        c += (f64::from(s) * COMB_ONE) as u64;
        ((c >> 32) - before) as u32
    })
}
