//! Square root in f64: `core` has none.

/// Square root with the same bits on every target.
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
