//! Four doubles: sums in which what is looked for is the small difference of large numbers.

use core::ops::{Add, AddAssign, Div, Mul, Sub};
use wide::f64x4;

/// Four `f64` lanes. Arithmetic is IEEE double precision, lane by lane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(transparent)]
pub struct F64x4(f64x4);

impl F64x4 {
    /// All lanes 0.
    pub const ZERO: Self = Self::splat(0.0);

    /// All lanes equal to `x`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn splat(x: f64) -> Self {
        Self(f64x4::splat(x))
    }

    /// Lane `i` = `a[i]`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn new(a: [f64; 4]) -> Self {
        Self(f64x4::new(a))
    }

    /// Array of the lanes.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn to_array(self) -> [f64; 4] {
        self.0.to_array()
    }

    /// `x` where `self > o`, else `y`; a NaN in either of the compared gives `y`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn if_above(self, o: Self, x: Self, y: Self) -> Self {
        Self(self.0.simd_gt(o.0).bitselect(x.0, y.0))
    }

    /// Larger of both, `self < o ? o : self`: a NaN in either gives `self`, and so do two zeros of different sign.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn max(self, o: Self) -> Self {
        o.if_above(self, o, self)
    }

    /// Smaller of both, `o < self ? o : self`: a NaN in either gives `self`, and so do two zeros of different sign.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn min(self, o: Self) -> Self {
        self.if_above(o, o, self)
    }
}

macro_rules! op {
    ($($tr:ident $f:ident $op:tt),*) => {$(
        impl $tr for F64x4 {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $f(self, o: Self) -> Self {
                Self(self.0 $op o.0)
            }
        }
    )*};
}
op!(Add add +, Sub sub -, Mul mul *, Div div /);

impl AddAssign for F64x4 {
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
