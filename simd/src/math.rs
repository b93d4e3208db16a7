//! Elementary functions on eight lanes, without fused operations: the same bits on every target.

use crate::{F32x8, I32x8, Mask8, U32x8};

/// Horner's rule, highest coefficient first.
#[inline(always)]
fn poly<const N: usize>(x: F32x8, c: [f32; N]) -> F32x8 {
    let mut r = F32x8::splat(c[0]);
    for k in &c[1..] {
        r = r.mul_add(x, F32x8::splat(*k));
    }
    r
}

/// 2^n for integers -126 <= n <= 127.
#[inline(always)]
fn exp2i(n: I32x8) -> F32x8 {
    F32x8::from_bits(((n + I32x8::splat(127)) << 23).to_u32())
}

impl F32x8 {
    /// e^x; 0 below -87.3, +inf above 88.7.
    #[inline(always)]
    pub fn exp(self) -> Self {
        let n = (self * core::f32::consts::LOG2_E + 0.5).floor().clamp(-126.0, 128.0);
        let r = self - n * 0.693_359_4;
        let r = r - n * -2.121_944_4e-4;
        let p = poly(r, [1.987_569_1e-4, 1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 0.166_666_66, 0.5]);
        let y = p * r * r + r + 1.0;
        let ni = n.to_i32();
        // two steps, so that n = 128 does not overflow early
        let h = I32x8(ni.0 >> 1u32);
        let y = y * exp2i(h) * exp2i(ni - h);
        let y = self.lt(Self::splat(-87.336_54)).select(Self::ZERO, y);
        self.gt(Self::splat(88.722_83)).select(Self::INFINITY, y)
    }

    /// Natural logarithm; -inf at 0, NaN below.
    #[inline(always)]
    pub fn ln(self) -> Self {
        let tiny = self.lt(Self::splat(f32::MIN_POSITIVE));
        let x = tiny.select(self * 8_388_608.0, self);
        let bits = x.to_bits();
        let e = I32x8(bytemuck::cast((bits >> 23).0)) - I32x8::splat(126);
        let m = Self::from_bits((bits & U32x8::splat(0x007f_ffff)) | U32x8::splat(0x3f00_0000));
        let low = m.lt(Self::splat(core::f32::consts::FRAC_1_SQRT_2));
        let e = e.to_f32() - low.zero_unless(Self::ONE) - tiny.zero_unless(Self::splat(23.0));
        let f = low.select(m + m, m) - 1.0;
        let z = f * f;
        let p = poly(
            f,
            [
                7.037_683_6e-2,
                -1.151_461e-1,
                1.167_699_9e-1,
                -1.242_014_1e-1,
                1.424_932_3e-1,
                -1.666_805_8e-1,
                2.000_071_5e-1,
                -2.499_999_4e-1,
                3.333_333e-1,
            ],
        );
        let y = p * f * z + e * -2.121_944_4e-4 - z * 0.5;
        let y = f + y + e * 0.693_359_4;
        let y = self.eq(Self::ZERO).select(Self::splat(f32::NEG_INFINITY), y);
        let y = self.eq(Self::INFINITY).select(Self::INFINITY, y);
        (self.lt(Self::ZERO) | !self.eq(self)).select(Self::splat(f32::NAN), y)
    }

    /// x^y for x >= 0 as `exp(y ln x)`; 0^y = 0 for y > 0. Relative error grows with |y ln x|.
    #[inline(always)]
    pub fn powf(self, y: Self) -> Self {
        let r = (y * self.ln()).exp();
        self.eq(Self::ZERO).select(y.eq(Self::ZERO).select(Self::ONE, Self::ZERO), r)
    }

    /// (sin, cos) of 2 pi u for |u| <= 2^22; the reduction is exact (NUMERICS SMP-9).
    #[inline(always)]
    pub fn sin_cos_2pi(self) -> (Self, Self) {
        let q = (self * 4.0 + 0.5).floor();
        let r = (self - q * 0.25) * core::f32::consts::TAU;
        let z = r * r;
        let s = poly(z, [-1.951_529_6e-4, 8.332_161e-3, -1.666_665_5e-1]) * z * r + r;
        let c = poly(z, [2.443_315_7e-5, -1.388_731_6e-3, 4.166_664_6e-2]) * z * z - z * 0.5 + 1.0;
        let q = q.to_i32();
        let odd = (q & I32x8::splat(1)).eq(I32x8::splat(1));
        let (a, b) = (odd.select(c, s), odd.select(s, c));
        let neg = |q: I32x8, x: Self| -> Self { Self::from_bits(x.to_bits() ^ ((q & I32x8::splat(2)) << 30).to_u32()) };
        (neg(q, a), neg(q + I32x8::splat(1), b))
    }

    /// Arc cosine of x clamped to [-1, 1], in [0, pi].
    #[inline(always)]
    pub fn acos(self) -> Self {
        let a = self.abs().min(Self::ONE);
        let big = a.gt(Self::splat(0.5));
        let z = big.select((1.0 - a) * 0.5, a * a);
        let s = big.select(z.sqrt(), a);
        let p = poly(z, [4.216_32e-2, 2.418_131_2e-2, 4.547_002_6e-2, 7.495_300_3e-2, 1.666_675_2e-1]);
        let asin = p * z * s + s;
        let pos = big.select(asin + asin, core::f32::consts::FRAC_PI_2 - asin);
        let neg = big.select(core::f32::consts::PI - (asin + asin), core::f32::consts::FRAC_PI_2 + asin);
        self.is_sign_negative().select(neg, pos)
    }

    /// Angle of the point (x, self) in (-pi, pi]; 0 at the origin.
    #[inline(always)]
    pub fn atan2(self, x: Self) -> Self {
        let (ay, ax) = (self.abs(), x.abs());
        let swap = ay.gt(ax);
        let (hi, lo) = (swap.select(ay, ax), swap.select(ax, ay));
        let t = hi.gt(Self::ZERO).select(lo / hi, Self::ZERO);
        let big = t.gt(Self::splat(0.414_213_57));
        let t = big.select((t - 1.0) / (t + 1.0), t);
        let z = t * t;
        let p = poly(z, [8.053_744_4e-2, -1.387_768_5e-1, 1.997_771_1e-1, -3.333_294_9e-1]);
        let r = p * z * t + t + big.zero_unless(Self::splat(core::f32::consts::FRAC_PI_4));
        let r = swap.select(core::f32::consts::FRAC_PI_2 - r, r);
        let neg_x: Mask8 = x.is_sign_negative();
        neg_x.select(core::f32::consts::PI - r, r).copysign(self)
    }
}
