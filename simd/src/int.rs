//! Eight integers: wrapping arithmetic, logical shifts.

use crate::{F32x8, Mask8};
use bytemuck::{Pod, Zeroable};
use core::ops::{Add, BitAnd, BitOr, BitXor, Mul, Not, Shl, Shr, Sub};
use wide::{i32x8, u32x8};

/// Eight `u32` lanes; arithmetic wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct U32x8(pub(crate) u32x8);

/// Eight `i32` lanes; arithmetic wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct I32x8(pub(crate) i32x8);

macro_rules! common {
    ($t:ident, $w:ident, $s:ty) => {
        impl $t {
            /// All lanes equal to `x`.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub const fn splat(x: $s) -> Self {
                Self($w::splat(x))
            }

            /// Lane `i` = `a[i]`.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub const fn new(a: [$s; 8]) -> Self {
                Self($w::new(a))
            }

            /// Lane `i` = `f(i)`.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub fn from_fn(mut f: impl FnMut(usize) -> $s) -> Self {
                // written out: `core::array::from_fn` is not always inlined, and a gather is in every hot loop
        Self::new([f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)])
            }

            /// Array of the lanes.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub const fn to_array(self) -> [$s; 8] {
                self.0.to_array()
            }

            /// Lane `i & 7`.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub fn lane(self, i: usize) -> $s {
                self.to_array()[i & 7]
            }

            /// `self == o`.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub fn eq(self, o: Self) -> Mask8 {
                Mask8(bytemuck::cast(self.0.simd_eq(o.0)))
            }

            /// `self < o`.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub fn lt(self, o: Self) -> Mask8 {
                Mask8(bytemuck::cast(self.0.simd_lt(o.0)))
            }

            /// `a` where `mask`, else `b`.
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            pub fn select(mask: Mask8, a: Self, b: Self) -> Self {
                bytemuck::cast(mask.select(bytemuck::cast(a), bytemuck::cast(b)))
            }
        }
        common!(@op $t, Add add +, Sub sub -, Mul mul *, BitAnd bitand &, BitOr bitor |, BitXor bitxor ^);
        impl Not for $t {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn not(self) -> Self {
                Self(!self.0)
            }
        }
        impl Shl<u32> for $t {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn shl(self, n: u32) -> Self {
                Self(self.0 << n)
            }
        }
        impl Shr<u32> for $t {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn shr(self, n: u32) -> Self {
                Self(self.0 >> n)
            }
        }
    };
    (@op $t:ident, $($tr:ident $f:ident $op:tt),*) => {$(
        impl $tr for $t {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $f(self, o: Self) -> Self {
                Self(self.0 $op o.0)
            }
        }
    )*};
}
common!(U32x8, u32x8, u32);
common!(I32x8, i32x8, i32);

impl U32x8 {
    /// A float on the grid of 2^-24 in [0, 1 - 2^-24], from the upper 24 bits (NUMERICS SMP-1).
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_unit(self) -> F32x8 {
        (self >> 8).to_i32().to_f32() * (1.0 / 16_777_216.0)
    }

    /// Bit `i` of each lane as bit `31 - i`.
    #[cfg_attr(any(feature = "compact", target_family = "wasm"), inline(never))]
    #[cfg_attr(not(any(feature = "compact", target_family = "wasm")), inline(always))]
    pub fn reverse_bits(self) -> Self {
        if cfg!(target_family = "wasm") {
            // an instruction, or a shuffle, elsewhere
            let masks = [0x5555_5555, 0x3333_3333, 0x0f0f_0f0f, 0x00ff_00ff, 0x0000_ffff];
            return masks.into_iter().enumerate().fold(self, |x, (i, mask)| {
                let (by, mask) = (1 << i, Self::splat(mask));
                (x >> by & mask) | (x & mask) << by
            });
        }
        Self::new(self.to_array().map(u32::reverse_bits))
    }

    /// Smallest lane.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn min_lane(self) -> u32 {
        let a = self.to_array();
        a[0].min(a[4]).min(a[2].min(a[6])).min(a[1].min(a[5]).min(a[3].min(a[7])))
    }

    /// Signed numbers of the same bits.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_i32(self) -> I32x8 {
        bytemuck::cast(self)
    }
}

impl I32x8 {
    /// Nearest float.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_f32(self) -> F32x8 {
        F32x8(self.0.round_float())
    }

    /// Unsigned numbers of the same bits.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_u32(self) -> U32x8 {
        bytemuck::cast(self)
    }
}
