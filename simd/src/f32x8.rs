//! Eight floats.

use crate::{I32x8, Mask8, U32x8};
use bytemuck::{Pod, Zeroable};
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use wide::f32x8;

/// Eight `f32` lanes. Arithmetic is IEEE single precision, lane by lane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct F32x8(pub(crate) f32x8);

impl F32x8 {
    /// All lanes 0.
    pub const ZERO: Self = Self::splat(0.0);
    /// All lanes 1.
    pub const ONE: Self = Self::splat(1.0);
    /// All lanes +infinity.
    pub const INFINITY: Self = Self::splat(f32::INFINITY);

    /// All lanes equal to `x`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn splat(x: f32) -> Self {
        Self(f32x8::splat(x))
    }

    /// Lane `i` = `a[i]`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn new(a: [f32; 8]) -> Self {
        Self(f32x8::new(a))
    }

    /// Lane `i` = `f(i)`: a gather is `F32x8::from_fn(|i| table[index[i]])`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn from_fn(mut f: impl FnMut(usize) -> f32) -> Self {
        // written out: `core::array::from_fn` is not always inlined, and a gather is in every hot loop
        Self::new([f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)])
    }

    /// Array of the lanes.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn to_array(self) -> [f32; 8] {
        self.0.to_array()
    }

    /// Lane `i & 7`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn lane(self, i: usize) -> f32 {
        self.to_array()[i & 7]
    }

    /// Copy of `self` with lane `i & 7` replaced by `x`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn with_lane(self, i: usize, x: f32) -> Self {
        let mut a = self.to_array();
        a[i & 7] = x;
        Self::new(a)
    }

    /// Sum of a product, `self * a + b`: two roundings in `reproducible` arithmetic, one in `fast` where the target
    /// fuses. Never use it where a sign must be exact (edge functions, NUMERICS TRI-1).
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn mul_add(self, a: Self, b: Self) -> Self {
        #[cfg(feature = "fast")]
        return Self(self.0.mul_add(a.0, b.0));
        #[cfg(not(feature = "fast"))]
        return self * a + b;
    }

    /// Larger of both, `self < o ? o : self`: a NaN in either gives `self`, and so do two zeros of different sign.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn max(self, o: Self) -> Self {
        // `maxps o, self` is this rule in one instruction; other targets' maxima treat NaN and zeros differently.
        #[cfg(target_feature = "sse")]
        return Self(o.0.fast_max(self.0));
        #[cfg(not(target_feature = "sse"))]
        return self.lt(o).select(o, self);
    }

    /// Smaller of both, `o < self ? o : self`: a NaN in either gives `self`, and so do two zeros of different sign.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn min(self, o: Self) -> Self {
        #[cfg(target_feature = "sse")]
        return Self(o.0.fast_min(self.0));
        #[cfg(not(target_feature = "sse"))]
        return o.lt(self).select(o, self);
    }

    /// Clamped to `lo` and `hi` (`lo <= hi`, no NaN); a NaN becomes `lo`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn clamp(self, lo: f32, hi: f32) -> Self {
        Self::splat(lo).max(self).min(Self::splat(hi))
    }

    /// Absolute value.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn abs(self) -> Self {
        Self(self.0.abs())
    }

    /// Square root, correctly rounded; NaN below 0.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn sqrt(self) -> Self {
        #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
        return Self::new(self.to_array().map(|x| {
            let y: f32;
            // SAFETY: one FPU instruction on registers, which every `eabihf` target has.
            #[expect(
                unsafe_code,
                reason = "the compiler has no safe function for the instruction without the standard library"
            )]
            unsafe {
                core::arch::asm!("vsqrt.f32 {0}, {1}", out(sreg) y, in(sreg) x,
                    options(pure, nomem, nostack, preserves_flags));
            }
            y
        }));
        #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
        return Self(self.0.sqrt());
    }

    /// Square root of `max(self, 0)`; a NaN becomes 0.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn safe_sqrt(self) -> Self {
        Self::ZERO.max(self).sqrt()
    }

    /// Nearest integer, ties to even. Keeps infinities, NaN and the sign of zero: -0.3 gives -0.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn round(self) -> Self {
        #[cfg(any(target_feature = "sse4.1", target_feature = "simd128", target_arch = "aarch64"))]
        return Self(self.0.round_ties_even());
        // Without a rounding instruction: 2^23 pushes the fraction out of the significand. (`wide` loses the
        // sign of zero here, so its fall-back would not give the same bits as the instruction.)
        #[cfg(not(any(target_feature = "sse4.1", target_feature = "simd128", target_arch = "aarch64")))]
        {
            let a = self.abs();
            let r = (a + 8_388_608.0) - 8_388_608.0;
            a.lt(Self::splat(8_388_608.0)).select(r.copysign(self), self)
        }
    }

    /// Largest integer not above. Keeps infinities, NaN and the sign of zero.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn floor(self) -> Self {
        #[cfg(any(target_feature = "sse4.1", target_feature = "simd128", target_arch = "aarch64"))]
        return Self(self.0.floor());
        #[cfg(not(any(target_feature = "sse4.1", target_feature = "simd128", target_arch = "aarch64")))]
        {
            let r = self.round();
            r - self.lt(r).zero_unless(Self::ONE)
        }
    }

    /// Square.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn sqr(self) -> Self {
        self * self
    }

    /// Magnitude of `self`, sign of `s`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn copysign(self, s: Self) -> Self {
        let sign = U32x8::splat(0x8000_0000);
        Self::from_bits((self.to_bits() & !sign) | (s.to_bits() & sign))
    }

    /// Is the value finite?
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn is_finite(self) -> Mask8 {
        self.abs().lt(Self::INFINITY)
    }

    /// Is the sign bit set?
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn is_sign_negative(self) -> Mask8 {
        let sign = U32x8::splat(0x8000_0000);
        (self.to_bits() & sign).eq(sign)
    }

    /// `self < o`, false for NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn lt(self, o: Self) -> Mask8 {
        Mask8(self.0.simd_lt(o.0))
    }

    /// `self <= o`, false for NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn le(self, o: Self) -> Mask8 {
        Mask8(self.0.simd_le(o.0))
    }

    /// `self > o`, false for NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn gt(self, o: Self) -> Mask8 {
        Mask8(self.0.simd_gt(o.0))
    }

    /// `self >= o`, false for NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn ge(self, o: Self) -> Mask8 {
        Mask8(self.0.simd_ge(o.0))
    }

    /// `self == o`, false for NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn eq(self, o: Self) -> Mask8 {
        Mask8(self.0.simd_eq(o.0))
    }

    /// Bit patterns of the lanes.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_bits(self) -> U32x8 {
        bytemuck::cast(self)
    }

    /// Floats from bit patterns.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn from_bits(b: U32x8) -> Self {
        bytemuck::cast(b)
    }

    /// Integers, rounded towards zero and saturating; NaN gives 0.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_i32(self) -> I32x8 {
        I32x8(self.0.trunc_int())
    }

    /// Sum of the lanes in a fixed order: ((0+4)+(2+6)) + ((1+5)+(3+7)).
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn sum(self) -> f32 {
        self.reduce(|a, b| a + b)
    }

    /// Smallest lane; lanes must not be NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn min_lane(self) -> f32 {
        self.reduce(|a, b| if b < a { b } else { a })
    }

    /// Largest lane; lanes must not be NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn max_lane(self) -> f32 {
        self.reduce(|a, b| if b > a { b } else { a })
    }

    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn reduce(self, f: impl Fn(f32, f32) -> f32) -> f32 {
        let a = self.to_array();
        f(f(f(a[0], a[4]), f(a[2], a[6])), f(f(a[1], a[5]), f(a[3], a[7])))
    }

    /// Transposes an 8x8 block: `out[r]` lane `c` = `rows[c]` lane `r`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn transpose(rows: [Self; 8]) -> [Self; 8] {
        bytemuck::cast(f32x8::transpose(bytemuck::cast(rows)))
    }
}

impl Mask8 {
    /// `a` where set, else `b`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn select(self, a: F32x8, b: F32x8) -> F32x8 {
        F32x8(self.0.select(a.0, b.0))
    }

    /// `x` where set, else +0 (whatever `x` holds there, NaN included).
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn zero_unless(self, x: F32x8) -> F32x8 {
        F32x8(self.0 & x.0)
    }
}

macro_rules! ops {
    ($($tr:ident $f:ident $atr:ident $af:ident $op:tt),*) => {$(
        impl $tr for F32x8 {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $f(self, o: Self) -> Self {
                Self(self.0 $op o.0)
            }
        }
        impl $tr<f32> for F32x8 {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $f(self, o: f32) -> Self {
                Self(self.0 $op f32x8::splat(o))
            }
        }
        impl $tr<F32x8> for f32 {
            type Output = F32x8;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $f(self, o: F32x8) -> F32x8 {
                F32x8(f32x8::splat(self) $op o.0)
            }
        }
        impl $atr for F32x8 {
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $af(&mut self, o: Self) {
                *self = *self $op o;
            }
        }
    )*};
}
ops!(Add add AddAssign add_assign +, Sub sub SubAssign sub_assign -,
     Mul mul MulAssign mul_assign *, Div div DivAssign div_assign /);

impl Neg for F32x8 {
    type Output = Self;
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn neg(self) -> Self {
        Self::from_bits(self.to_bits() ^ U32x8::splat(0x8000_0000))
    }
}
