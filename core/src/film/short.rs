//! Non-negative numbers in 32 bits with the range of `f64`: its exponent and 21 bits of its fraction.
//!
//! The format of sums of squares: `f32` overflows at squares of 1.8e19, and 22 significant bits are far more than a
//! variance is known to. An addend below 2^-22 of the sum is lost, so sums of equal addends stall after some 4 million.

/// Nearest short number; 0 for negative numbers and NaN.
#[inline(always)]
pub(super) fn short(x: f64) -> u32 {
    // one instruction each, where `f64::max` and `f64::min` would ask which of the two is a NaN
    let x = if x > 0.0 { x } else { 0.0 };
    // the largest finite number stays finite
    let x = if x < LARGEST { x } else { LARGEST };
    ((x.to_bits() + (1 << 30)) >> 31) as u32
}

/// Largest number that is not rounded to infinity.
const LARGEST: f64 = f64::from_bits(0x7fef_ffff_8000_0000);

/// The number that is stored.
#[inline(always)]
pub(super) fn long(x: u32) -> f64 {
    f64::from_bits(u64::from(x) << 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: bits that are shifted by another number, rounding towards 0, an overflow to infinity.
    #[test]
    fn numbers_keep_22_bits() {
        for x in [1.0, 1.5, 0.1, 1e-300, 1e300, 3e38, 7.25e-12] {
            assert!((long(short(x)) / x - 1.0).abs() <= 2.4e-7, "{x}");
            assert_eq!(short(long(short(x))), short(x));
        }
        assert_eq!((short(0.0), short(-1.0), short(f64::NAN), long(0)), (0, 0, 0, 0.0));
        assert!(long(short(f64::MAX)).is_finite() && long(short(f64::INFINITY)).is_finite());
    }
}
