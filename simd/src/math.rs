//! Elementary functions on eight lanes, without operations that only some targets have.
//!
//! The contract. Errors are in ULP of the exact value (the spacing of `f32` there, at least the smallest
//! subnormal), in `reproducible` / `fast` arithmetic; subnormal arguments and results are handled like all others.
//!
//! | function | domain | max ULP | mean | exact, and special values | monotonic |
//! |---|---|---|---|---|---|
//! | [`exp`](F32x8::exp) | all | 1.00 / 1.02 | 0.22 | e^±0 = 1, e^-inf = 0, e^inf = inf | yes |
//! | [`ln`](F32x8::ln) | x >= 0, else NaN | 0.80 / 0.80 | 0.25 | ln 1 = +0, ln ±0 = -inf, ln inf = inf | yes |
//! | [`sin_cos_2pi`](F32x8::sin_cos_2pi) | finite, else NaN | 1.65 / 1.62 | 0.31 | 0 and ±1 at all k/4 | no promise |
//! | [`acos`](F32x8::acos) | clamped to [-1, 1] | 1.16 / 1.14 | 0.27 | acos 1 = +0; -1, 0 the floats nearest to pi, pi/2 | yes |
//! | [`asin`](F32x8::asin) | clamped to [-1, 1] | 2.41 / 2.35 | 0.11 | asin ±0 = ±0; ±1 the floats nearest to ±pi/2 | yes |
//! | [`powf`](F32x8::powf) | x >= 0, else NaN | 1.2 + 0.22 abs(y ln x) | 0.29 | x^0 = 1, x^1 = x, 1^y = 1 | no promise |
//! | [`atan2`](F32x8::atan2) | all | 2 | 0.29 | as IEEE 754, signs of zero too | no promise |
//!
//! A NaN argument gives NaN (but x^0 = 1, also for NaN). The maxima and means of the functions of one argument are
//! from every argument where they are neither constant nor a straight line (one sign for the odd and even ones); those
//! of `powf` and `atan2` are promises with a margin over the worst of 10^8 random and aimed pairs (powf 1.84 ULP up to
//! |y ln x| = 8, 16.5 at 79; atan2 1.54). `tests/tests/simd_math.rs` measures all of it; the program `ulp` of `benches`
//! goes through all 2^32 arguments.
//!
//! The polynomials are minimax fits (Remez exchange) whose coefficients were rounded to `f32` one after the other,
//! lowest first, refitting the rest each time; those of `ln` by a search over neighbouring floats.

use crate::{F32x8, I32x8, Mask8, U32x8};
use core::f32::consts::{FRAC_PI_2, LOG2_E, PI, TAU};

/// 1.5 * 2^23. `x + ROUND` has the integer nearest to `x` in its low bits (|x| < 2^22), ties to even, and
/// `x + ROUND - ROUND` is that integer: rounding and conversion to int in one addition on every target.
const ROUND: f32 = 12_582_912.0;

/// ln 2 = LN2_HI + LN2_LO; LN2_HI has 9 significant bits, so that n * LN2_HI is exact for |n| < 2^15.
const LN2_HI: f32 = 0.693_359_4;
const LN2_LO: f32 = -2.121_944_4e-4;

/// (pi - fl(pi)) / pi: `base * PI_LO` is what the float `base` = fl(k pi) lacks.
const PI_LO: f32 = -2.782_753_4e-8;

/// Minimax (e^r - 1 - r) / r^2 on |r| <= ln(2)/2.
const EXP: [f32; 5] = [1.383_904_2e-3, 8.369_198e-3, 4.166_810_2e-2, 0.166_665_17, 0.499_999_94];

/// Minimax (ln(1 + f) - f + f^2/2) / f^3 on sqrt(1/2) <= 1 + f <= sqrt(2).
const LN: [f32; 9] = [
    6.746_95e-2,
    -0.116_756_2,
    0.118_880_48,
    -0.124_055_27,
    0.142_195_34,
    -0.166_679_7,
    0.200_021_09,
    -0.250_000_12,
    0.333_333_14,
];

/// Minimax sin(2 pi t) / t - fl(2 pi), in t^2, on |t| <= 1/8.
const SIN: [f32; 4] = [-75.427_345, 81.593_43, -41.341_67, -1.748_455_5e-7];

/// Minimax (cos(2 pi t) - 1) / t^2, in t^2, on |t| <= 1/8.
const COS: [f32; 4] = [58.561_275, -85.423_12, 64.939_14, -19.739_208];

/// Minimax (asin(s) - s) / s^3, in s^2, on |s| <= 1/2.
const ASIN: [f32; 5] = [4.215_821_3e-2, 2.418_481_6e-2, 4.546_914_6e-2, 7.495_309_4e-2, 0.166_667_52];

/// Minimax (atan(t) - t) / t^3, in t^2, on |t| <= 1.
const ATAN: [f32; 9] = [
    -1.782_145_1e-3,
    1.086_627_2e-2,
    -3.109_353_4e-2,
    5.787_887e-2,
    -8.399_208e-2,
    0.109_508_61,
    -0.142_640_14,
    0.199_985_3,
    -0.333_333,
];

/// Horner's rule, highest coefficient first.
#[cfg_attr(feature = "compact", inline(never))]
#[cfg_attr(not(feature = "compact"), inline(always))]
fn poly<const N: usize>(x: F32x8, c: [f32; N]) -> F32x8 {
    let mut r = F32x8::splat(c[0]);
    for k in &c[1..] {
        r = r.mul_add(x, F32x8::splat(*k));
    }
    r
}

/// 2^n for integers -126 <= n <= 127.
#[cfg_attr(feature = "compact", inline(never))]
#[cfg_attr(not(feature = "compact"), inline(always))]
fn exp2i(n: I32x8) -> F32x8 {
    F32x8::from_bits(((n + I32x8::splat(127)) << 23).to_u32())
}

/// The upper 12 significant bits: products of two such numbers are exact.
#[cfg_attr(feature = "compact", inline(never))]
#[cfg_attr(not(feature = "compact"), inline(always))]
fn head(x: F32x8) -> F32x8 {
    F32x8::from_bits(x.to_bits() & U32x8::splat(0xffff_f000))
}

/// x with its sign flipped where `m`.
#[cfg_attr(feature = "compact", inline(never))]
#[cfg_attr(not(feature = "compact"), inline(always))]
fn negate_if(m: Mask8, x: F32x8) -> F32x8 {
    F32x8::from_bits(x.to_bits() ^ m.zero_unless(F32x8::splat(-0.0)).to_bits())
}

/// e^(x + lo) for |lo| < 1e-4; any x.
#[cfg_attr(feature = "compact", inline(never))]
#[cfg_attr(not(feature = "compact"), inline(always))]
fn exp_sum(x: F32x8, lo: F32x8) -> F32x8 {
    // beyond these the scaling below gives 0 and infinity by itself; a NaN passes
    let x = x.max(F32x8::splat(-104.0)).min(F32x8::splat(89.0));
    let m = x.mul_add(F32x8::splat(LOG2_E), F32x8::splat(ROUND));
    let n = m - ROUND;
    // exact, then one rounding of a small term
    let r = (x - n * LN2_HI) - n * LN2_LO + lo;
    let y = (poly(r, EXP) * r).mul_add(r, r) + 1.0;
    // 2^k in two factors: k = 128 does not overflow early, and a subnormal result is rounded once
    let k = I32x8(bytemuck::cast((m.to_bits() - F32x8::splat(ROUND).to_bits()).0));
    let h = k >> 1;
    y * exp2i(h) * exp2i(k - h)
}

/// (e, f) with x = 2^e (1 + f) and sqrt(1/2) <= 1 + f < sqrt(2), f exact; for finite x > 0.
#[cfg_attr(feature = "compact", inline(never))]
#[cfg_attr(not(feature = "compact"), inline(always))]
fn frexp(x: F32x8) -> (F32x8, F32x8) {
    let tiny = x.lt(F32x8::splat(f32::MIN_POSITIVE));
    let bits = tiny.select(x * 8_388_608.0, x).to_bits();
    let sqrt_half = U32x8::splat(core::f32::consts::FRAC_1_SQRT_2.to_bits());
    let e = I32x8(bytemuck::cast((bits - sqrt_half).0)) >> 23;
    let m = F32x8::from_bits(bits - (e << 23).to_u32());
    (e.to_f32() - tiny.zero_unless(F32x8::splat(23.0)), m - 1.0)
}

impl F32x8 {
    /// e^x within 1.02 ULP, monotonic. Subnormal results are rounded, not flushed; 0 below -103.98, +infinity above
    /// 88.72.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn exp(self) -> Self {
        // -0, not 0: adding it is no operation, and the compiler knows
        exp_sum(self, Self::splat(-0.0))
    }

    /// Natural logarithm within 0.8 ULP, monotonic, subnormals included; -infinity at +-0, NaN below.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn ln(self) -> Self {
        let (e, f) = frexp(self);
        let z = f * f;
        let y = (poly(f, LN) * f).mul_add(z, e * LN2_LO) - z * 0.5;
        let y = f + y + e * LN2_HI;
        let edge = self.eq(Self::ZERO).select(Self::splat(f32::NEG_INFINITY), Self::splat(f32::NAN));
        let y = self.gt(Self::ZERO).select(y, edge);
        self.lt(Self::INFINITY).select(y, self)
    }

    /// x^y for x >= 0 (either zero counts as +0), NaN for x < 0; within 1.2 + 0.22 |y ln x| ULP (3 where
    /// |y ln x| = 8).
    ///
    /// x^0 = 1 and x^1 = x for every x, 1^y = 1 for every y but NaN; 0 and infinity as in IEEE 754.
    /// The logarithm is carried in two floats, because its relative error grows to |y ln x| times as much
    /// in the result.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn powf(self, y: Self) -> Self {
        let (e, f) = frexp(self);
        // hi + lo = ln(1 + f): f^2/2 is split so that its large part is exact
        let (fh, z) = (head(f), f * f);
        let a = fh * fh * 0.5;
        let hi = f - a;
        let lo = (f - hi) - a;
        let lo = lo - (f - fh) * (f + fh) * 0.5;
        let lo = lo + poly(f, LN) * f * z;
        // + e ln 2
        let (eh, el) = (e * LN2_HI, e * LN2_LO);
        let s = eh + hi;
        let lo = (hi - (s - eh)) + lo + el;
        let l = s + lo;
        let lo = lo - (l - s);
        // y (l + lo); where |y| > 2^33 only the limits 0, 1 and infinity are left
        let yc = y.max(Self::splat(-8.6e9)).min(Self::splat(8.6e9));
        let (lh, yh) = (head(l), head(yc));
        let p = lh * yh;
        let rest = lh * (yc - yh) + (l - lh) * yc + lo * yc;
        let t = p + rest;
        let tl = t.abs().lt(Self::splat(128.0)).zero_unless(rest - (t - p));
        let r = exp_sum(t, tl);

        let zero = self.eq(Self::ZERO);
        let edge = (zero ^ y.lt(Self::ZERO)).select(Self::ZERO, Self::INFINITY);
        let nan = self.lt(Self::ZERO) | !self.eq(self) | !y.eq(y);
        let r = (zero | self.eq(Self::INFINITY)).select(edge, r);
        let r = nan.select(Self::splat(f32::NAN), r);
        let r = y.eq(Self::ONE).select(self, r);
        y.eq(Self::ZERO).select(Self::ONE, r)
    }

    /// (sin, cos) of 2 pi u, each within 1.65 ULP (also next to its zeros). The reduction is exact for every finite u
    /// (NUMERICS SMP-9): both are exactly 0 or +-1 at multiples of 1/4 (the sign of such a zero means nothing). NaN at
    /// infinity.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn sin_cos_2pi(self) -> (Self, Self) {
        let u = self - self.round();
        let m = u.mul_add(Self::splat(4.0), Self::splat(ROUND));
        let t = u - (m - ROUND) * 0.25;
        let z = t * t;
        let s = poly(z, SIN).mul_add(t, t * TAU);
        let c = poly(z, COS).mul_add(z, Self::ONE);
        let q = m.to_bits();
        let odd = (q & U32x8::splat(1)).eq(U32x8::splat(1));
        let sign = |q: U32x8, x: Self| Self::from_bits(x.to_bits() ^ ((q & U32x8::splat(2)) << 30));
        (sign(q, odd.select(c, s)), sign(q + U32x8::splat(1), odd.select(s, c)))
    }

    /// (large, asin(|x|) or, where large, 2 asin(sqrt((1 - |x|) / 2)) = acos(|x|)), |x| clamped to 1.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn asin_parts(self) -> (Mask8, Self) {
        let a = self.abs().min(Self::ONE);
        let big = a.gt(Self::splat(0.5));
        let z = big.select((1.0 - a) * 0.5, a * a);
        let s = big.select(z.sqrt(), a);
        let v = (poly(z, ASIN) * z).mul_add(s, s);
        (big, big.select(v + v, v))
    }

    /// Arc cosine of x clamped to [-1, 1], in [0, pi], within 1.16 ULP, monotonic.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn acos(self) -> Self {
        let (big, v) = self.asin_parts();
        let neg = self.is_sign_negative();
        let base = big.select(neg.zero_unless(Self::splat(PI)), Self::splat(FRAC_PI_2));
        base + (negate_if(neg ^ !big, v) + base * PI_LO)
    }

    /// Arc sine of x clamped to [-1, 1], in [-pi/2, pi/2], within 2.41 ULP, monotonic.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn asin(self) -> Self {
        let (big, v) = self.asin_parts();
        big.select(FRAC_PI_2 - (v - FRAC_PI_2 * PI_LO), v).copysign(self)
    }

    /// Angle of the point (x, self) in [-pi, pi] within 2 ULP, with the signs and limits of IEEE 754: a zero x takes
    /// its side from its sign, and the origin is +-0 or +-pi.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn atan2(self, x: Self) -> Self {
        let (ay, ax) = (self.abs(), x.abs());
        let swap = ay.gt(ax);
        let (hi, lo) = (swap.select(ay, ax), swap.select(ax, ay));
        // inf/inf is 1 and 0/0 is 0
        let t = lo.eq(hi).select(Self::ONE, lo / hi);
        let t = (hi + lo).eq(Self::ZERO).select(Self::ZERO, t);
        let z = t * t;
        let r = (poly(z, ATAN) * z).mul_add(t, t);
        let neg = x.is_sign_negative();
        let base = swap.select(Self::splat(FRAC_PI_2), neg.zero_unless(Self::splat(PI)));
        (base + (negate_if(swap ^ neg, r) + base * PI_LO)).copysign(self)
    }
}
