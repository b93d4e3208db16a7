//! Lane masks: a type of their own, never floats.

use core::ops::{BitAnd, BitAndAssign, BitOr, BitOrAssign, BitXor, Not};
use wide::f32x8;

/// One boolean per lane.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Mask8(pub(crate) f32x8);

const BITS: [u32; 8] = [1, 2, 4, 8, 16, 32, 64, 128];

impl Mask8 {
    /// Mask without lanes.
    pub const NONE: Self = Self(f32x8::splat(0.0));

    /// Mask with all lanes equal to `b`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn splat(b: bool) -> Self {
        Self(bytemuck::cast(wide::u32x8::splat(u32::from(b).wrapping_neg())))
    }

    /// Mask with all lanes.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn all_lanes() -> Self {
        Self(!f32x8::splat(0.0))
    }

    /// Mask with lane `i` from bit `i`; higher bits are ignored.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn from_bits(bits: u32) -> Self {
        let b = wide::u32x8::new(BITS);
        Self(bytemuck::cast((wide::u32x8::splat(bits) & b).simd_eq(b)))
    }

    /// Mask with the first `n` lanes.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn first(n: usize) -> Self {
        Self::from_bits((1u32 << n.min(8)) - 1)
    }

    /// Bits of the lanes: bit `i` is lane `i`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn bits(self) -> u32 {
        self.0.to_bitmask()
    }

    /// Is any lane set?
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn any(self) -> bool {
        self.bits() != 0
    }

    /// Are all lanes set?
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn all(self) -> bool {
        self.bits() == 0xff
    }

    /// Is no lane set?
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn none(self) -> bool {
        self.bits() == 0
    }

    /// Number of set lanes.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn count(self) -> u32 {
        self.bits().count_ones()
    }

    /// State of lane `i`; `false` outside `0..8`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn lane(self, i: usize) -> bool {
        i < 8 && self.bits() >> i & 1 == 1
    }

    /// Numbers of the set lanes, ascending.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn lanes(self) -> Lanes {
        Lanes(self.bits())
    }

    /// `self` without the lanes of `other`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn and_not(self, other: Self) -> Self {
        self & !other
    }
}

/// Iterator over the set lanes of a [`Mask8`].
#[derive(Clone, Copy, Debug)]
pub struct Lanes(u32);

impl Iterator for Lanes {
    type Item = usize;
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let i = self.0.trailing_zeros() as usize & 7;
        self.0 &= self.0 - 1;
        Some(i)
    }
}

macro_rules! bit_op {
    ($tr:ident, $f:ident, $op:tt) => {
        impl $tr for Mask8 {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $f(self, o: Self) -> Self {
                Self(self.0 $op o.0)
            }
        }
    };
}
bit_op!(BitAnd, bitand, &);
bit_op!(BitOr, bitor, |);
bit_op!(BitXor, bitxor, ^);

impl Not for Mask8 {
    type Output = Self;
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn not(self) -> Self {
        Self(!self.0)
    }
}

impl BitAndAssign for Mask8 {
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn bitand_assign(&mut self, o: Self) {
        *self = *self & o;
    }
}

impl BitOrAssign for Mask8 {
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn bitor_assign(&mut self, o: Self) {
        *self = *self | o;
    }
}

impl core::fmt::Debug for Mask8 {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Mask8({:08b})", self.bits())
    }
}

impl PartialEq for Mask8 {
    fn eq(&self, o: &Self) -> bool {
        self.bits() == o.bits()
    }
}

impl Eq for Mask8 {}
