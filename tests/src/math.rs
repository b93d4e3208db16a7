//! Oracles and error sweeps for the elementary functions of `croupier-simd`.
//!
//! The oracle of every function is the f64 function of the platform's C library, whose error (below 1e-9 of an f32
//! ULP) does not count. One ULP at Y is the spacing of f32 at the exact Y, at least the smallest subnormal.

use croupier::unstable::simd::{F32x8, REPRODUCIBLE};

/// Stride of the tests' sweeps: 2^26 arguments.
pub const STRIDE: u64 = 512;

/// A function of one argument and what its documentation promises.
pub struct Unary {
    /// Name of the function.
    pub name: &'static str,
    /// The product's function.
    pub f: fn(F32x8) -> F32x8,
    /// The same in f64.
    pub oracle: fn(f64) -> f64,
    /// Largest error in ULP over all 2^32 arguments, in `reproducible` and in `fast` arithmetic.
    pub max_ulp: [f64; 2],
    /// The argument of the largest error (`reproducible`), as found by the exhaustive sweep.
    pub worst: u32,
    /// 1 for a rising function, -1 for a falling one, 0 where no such promise is made.
    pub direction: f32,
    /// Hash of the results of `sweep` over everything with [`STRIDE`] in `reproducible` arithmetic.
    pub hash: u64,
}

impl Unary {
    /// The promise that holds in the arithmetic this was compiled for.
    pub fn bound(&self) -> f64 {
        self.max_ulp[usize::from(!REPRODUCIBLE)]
    }
}

fn two_pi(u: f64) -> f64 {
    // f64 holds u - round(u) exactly for every f32
    (u - u.round()) * std::f64::consts::TAU
}

fn sin_2pi(u: f64) -> f64 {
    let r = u - u.round();
    // f64 sin(pi) is 1.2e-16, not the 0 that it is here
    if r.abs() == 0.5 { 0.0 } else { two_pi(u).sin() }
}

fn cos_2pi(u: f64) -> f64 {
    let r = (u - u.round()).abs();
    if r == 0.25 { 0.0 } else { two_pi(u).cos() }
}

/// Every function of one argument with its promise (the table in the documentation of `simd/src/math.rs`).
pub const UNARY: [Unary; 6] = [
    Unary {
        name: "exp",
        f: F32x8::exp,
        oracle: f64::exp,
        max_ulp: [1.0, 1.02],
        worst: 0xc2a2_c895,
        direction: 1.0,
        hash: 0x9654_9f6a_6351_e4aa,
    },
    Unary {
        name: "ln",
        f: F32x8::ln,
        oracle: f64::ln,
        max_ulp: [0.8, 0.8],
        worst: 0x3fb4_3845,
        direction: 1.0,
        hash: 0x8e6f_e17e_ad84_b8e7,
    },
    Unary {
        name: "sin_2pi",
        f: |u| u.sin_cos_2pi().0,
        oracle: sin_2pi,
        max_ulp: [1.65, 1.62],
        worst: 0x3da8_a9b9,
        direction: 0.0,
        hash: 0xe1c9_0f3b_4efc_9d88,
    },
    Unary {
        name: "cos_2pi",
        f: |u| u.sin_cos_2pi().1,
        oracle: cos_2pi,
        max_ulp: [1.65, 1.62],
        worst: 0x3e2b_9213,
        direction: 0.0,
        hash: 0x8026_575c_660a_37d6,
    },
    Unary {
        name: "acos",
        f: F32x8::acos,
        oracle: |x| x.clamp(-1.0, 1.0).acos(),
        max_ulp: [1.16, 1.14],
        worst: 0x3f0a_93f3,
        direction: -1.0,
        hash: 0xe3b2_5a0d_2d56_8186,
    },
    Unary {
        name: "asin",
        f: F32x8::asin,
        oracle: |x| x.clamp(-1.0, 1.0).asin(),
        max_ulp: [2.41, 2.35],
        worst: 0x3f00_101f,
        direction: 1.0,
        hash: 0xe1dc_3bcc_6b91_a963,
    },
];

/// Spacing of f32 at `y`.
pub fn ulp(y: f64) -> f64 {
    let e = ((y.abs().to_bits() >> 52) as i32 - 1023).clamp(-126, 127);
    f64::from_bits(((e - 23 + 1023) as u64) << 52)
}

/// Error of `got` in ULP of `exact`; an infinity counts as 2^128. Infinite where exactly one of them is NaN.
pub fn error_ulp(got: f32, exact: f64) -> f64 {
    if got.is_nan() || exact.is_nan() {
        return if got.is_nan() && exact.is_nan() { 0.0 } else { f64::INFINITY };
    }
    const TOP: f64 = 3.402_823_669_209_385e38;
    let got = f64::from(got).clamp(-TOP, TOP);
    let exact = exact.clamp(-TOP, TOP);
    (got - exact).abs() / ulp(exact)
}

/// What a sweep found.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sweep {
    /// Arguments tried.
    pub count: u64,
    /// Largest error in ULP and its argument.
    pub max: (f64, u32),
    /// Sum of the errors in ULP.
    pub sum: f64,
    /// Neighbouring arguments whose results are in the wrong order, and the last such argument.
    pub unordered: (u64, u32),
    /// Order-dependent hash of all result bits, all NaN alike.
    pub hash: u64,
}

impl Sweep {
    /// Two sweeps as one; the hash of `other` counts as one result.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        if other.max.0 > self.max.0 {
            self.max = other.max;
        }
        if other.unordered.0 > 0 {
            self.unordered = (self.unordered.0 + other.unordered.0, other.unordered.1);
        }
        self.hash = mix(self.hash, other.hash);
    }
}

/// One step of the hash (FNV-1a over words).
pub fn mix(hash: u64, word: u64) -> u64 {
    (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23)
}

/// Bits of `x`, one pattern for every NaN (its sign and payload differ between instruction sets).
pub fn canonical_bits(x: f32) -> u32 {
    if x.is_nan() { 0x7fc0_0000 } else { x.to_bits() }
}

/// `f` on eight consecutive bit patterns out of every `stride` (a multiple of 8) in `first..=last`.
///
/// The eight move about within their stride, so that no low bits are always the same; eight neighbours show
/// where the results are not monotonic.
pub fn sweep(f: &Unary, first: u32, last: u32, stride: u64) -> Sweep {
    let mut s = Sweep::default();
    let mut base = u64::from(first);
    // bit pattern and result before this one
    let mut before = (u64::MAX - 1, 0.0);
    while base <= u64::from(last) {
        let shift = base.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        let start = base + (shift % (stride / 8)) * 8;
        base += stride;
        let x: [f32; 8] = std::array::from_fn(|i| f32::from_bits((start + i as u64) as u32));
        let y = (f.f)(F32x8::new(x)).to_array();
        for i in 0..8 {
            let e = error_ulp(y[i], (f.oracle)(f64::from(x[i])));
            s.count += 1;
            s.sum += e;
            if e > s.max.0 {
                s.max = (e, x[i].to_bits());
            }
            // rising bit patterns are falling numbers below zero
            let here = start + i as u64;
            if before.0 == here.wrapping_sub(1) && (y[i] - before.1) * f.direction * 1f32.copysign(x[i]) < 0.0 {
                s.unordered = (s.unordered.0 + 1, x[i].to_bits());
            }
            before = (here, y[i]);
            s.hash = mix(s.hash, u64::from(canonical_bits(y[i])));
        }
    }
    s
}

/// A function of two arguments, `f(a, b)`, and what its documentation promises.
pub struct Binary {
    /// Name of the function.
    pub name: &'static str,
    /// The product's function.
    pub f: fn(F32x8, F32x8) -> F32x8,
    /// The same in f64, with the special values of the product's contract.
    pub oracle: fn(f64, f64) -> f64,
    /// A pair of arguments from a random number generator.
    pub draw: fn(&mut Random) -> (f32, f32),
    /// Promised error in ULP, given the arguments.
    pub bound: fn(f64, f64) -> f64,
    /// [`hash_pairs`] of the results in `reproducible` arithmetic.
    pub hash: u64,
}

fn powf(x: f64, y: f64) -> f64 {
    match (x, y) {
        (_, 0.0) => 1.0,
        (_, 1.0) => x,
        _ if x < 0.0 || y.is_nan() => f64::NAN,
        _ => x.abs().powf(y),
    }
}

/// x log-uniform over all floats, a quarter of them near 1; y so that y ln x is uniform in [-104, 90] or near 0.
fn draw_powf(r: &mut Random) -> (f32, f32) {
    let log = match r.next() & 3 {
        0 => r.between(-1.0, 1.0),
        1 => r.between(-3.0, 3.0) * 10f64.powf(r.between(-7.0, 0.0)),
        _ => r.between(-103.0, 88.7),
    };
    let product = if r.next() & 1 == 0 { r.between(-104.0, 90.0) } else { r.between(-8.0, 8.0) };
    (log.exp() as f32, (product / log) as f32)
}

/// The ratio log-uniform in 1e-12..1e12 (half of them in 1/10..10), the larger one over all floats.
fn draw_atan2(r: &mut Random) -> (f32, f32) {
    let size = 10f64.powf(r.between(-44.0, 38.5));
    let ratio = 10f64.powf(if r.next() & 1 == 0 { r.between(-1.0, 1.0) } else { r.between(-12.0, 12.0) });
    let sign = |bit: u64| if bit & 1 == 0 { 1.0 } else { -1.0 };
    ((size * sign(r.next())) as f32, (size * ratio * sign(r.next())) as f32)
}

/// Every function of two arguments with its promise.
pub const BINARY: [Binary; 2] = [
    Binary {
        name: "powf",
        f: F32x8::powf,
        oracle: powf,
        draw: draw_powf,
        bound: |x, y| 1.2 + 0.22 * (y * x.ln()).abs(),
        hash: 0xff95_4916_62f2_05a3,
    },
    Binary {
        name: "atan2",
        f: F32x8::atan2,
        oracle: f64::atan2,
        draw: draw_atan2,
        bound: |_, _| 2.0,
        hash: 0xdee0_0a5d_5eb1_159d,
    },
];

/// A small generator for tests (splitmix64).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    #[expect(clippy::should_implement_trait, reason = "an endless generator is no iterator")]
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [a, b).
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * (self.next() >> 11) as f64 * (-53f64).exp2()
    }
}

/// What a sweep over pairs found.
#[derive(Clone, Copy, Debug, Default)]
pub struct PairSweep {
    /// Largest error in ULP where |b ln a| <= 8, and its arguments.
    pub near: (f64, f32, f32),
    /// Largest error in ULP, and its arguments.
    pub max: (f64, f32, f32),
    /// Largest error over the promise, and its arguments.
    pub ratio: (f64, f32, f32),
    /// Mean error in ULP.
    pub mean: f64,
}

/// `f` on `8 * packets` random pairs.
pub fn sweep_pairs(f: &Binary, packets: u64, seed: u64) -> PairSweep {
    let mut r = Random(seed);
    let mut s = PairSweep::default();
    for _ in 0..packets {
        let pairs: [(f32, f32); 8] = std::array::from_fn(|_| (f.draw)(&mut r));
        let y = (f.f)(F32x8::new(pairs.map(|p| p.0)), F32x8::new(pairs.map(|p| p.1))).to_array();
        for ((a, b), y) in pairs.into_iter().zip(y) {
            let (x64, y64) = (f64::from(a), f64::from(b));
            let e = error_ulp(y, (f.oracle)(x64, y64));
            let ratio = e / (f.bound)(x64, y64);
            if (y64 * x64.ln()).abs() <= 8.0 && e > s.near.0 {
                s.near = (e, a, b);
            }
            if e > s.max.0 {
                s.max = (e, a, b);
            }
            // a NaN ratio is an argument without a promise: count it as broken
            let ratio = if ratio.is_nan() { f64::INFINITY } else { ratio };
            if ratio > s.ratio.0 {
                s.ratio = (ratio, a, b);
            }
            s.mean += e / (8 * packets) as f64;
        }
    }
    s
}

/// Order-dependent hash of `f` on a million pairs, drawn by integer arithmetic alone: the same on every target.
pub fn hash_pairs(f: &Binary) -> u64 {
    let mut r = Random(2);
    let mut hash = 0;
    for _ in 0..125_000 {
        let pairs: [(f32, f32); 8] = std::array::from_fn(|_| {
            let (bits, more) = (r.next(), r.next());
            // any float, or one between 1/2 and 2
            let a = if more & 1 == 0 { bits as u32 } else { 0x3f00_0000 + (bits as u32 & 0x00ff_ffff) };
            // magnitude 2^-16..2^16
            let b = (more >> 32) as u32 & 0x807f_ffff | (111 + (more >> 8) as u32 % 32) << 23;
            (f32::from_bits(a), f32::from_bits(b))
        });
        let y = (f.f)(F32x8::new(pairs.map(|p| p.0)), F32x8::new(pairs.map(|p| p.1))).to_array();
        hash = y.iter().fold(hash, |h, y| mix(h, u64::from(canonical_bits(*y))));
    }
    hash
}
