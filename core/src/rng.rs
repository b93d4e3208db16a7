//! Counter-based random numbers: a path's numbers depend on its key and on the dimension only, not on the order in
//! which packets are processed.

use croupier_simd::{F32x8, U32x8};

/// Finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014, fig. 16): each bit of the result depends on all of `x`.
pub(crate) fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Eight 64-bit keys, one per path vertex or sample.
#[derive(Clone, Copy, Debug)]
pub struct Key8 {
    /// Low words of the keys.
    pub lo: U32x8,
    /// High words of the keys.
    pub hi: U32x8,
}

/// Hash of four words to four random words per lane: `pcg4d` of Jarzynski and Olano, "Hash Functions for GPU
/// Rendering", JCGT 9(3) 2020.
#[cfg_attr(target_family = "wasm", inline(never))] // for size
#[cfg_attr(not(target_family = "wasm"), inline(always))]
fn pcg4d(v: [U32x8; 4]) -> [U32x8; 4] {
    let [mut x, mut y, mut z, mut w] = v.map(|a| a * U32x8::splat(1_664_525) + U32x8::splat(1_013_904_223));
    x = x + y * w;
    y = y + z * x;
    z = z + x * y;
    w = w + y * z;
    [x, y, z, w] = [x, y, z, w].map(|a| a ^ (a >> 16));
    x = x + y * w;
    y = y + z * x;
    z = z + x * y;
    w = w + y * z;
    [x, y, z, w]
}

impl Key8 {
    /// Four independent words of dimension block `dimension`.
    #[inline(always)]
    pub fn words(self, dimension: u32) -> [U32x8; 4] {
        pcg4d([self.lo, self.hi, U32x8::splat(dimension), U32x8::splat(0x9e37_79b9)])
    }

    /// Four independent numbers in [0, 1 - 2^-24] of dimension block `dimension`.
    #[inline(always)]
    pub fn uniforms(self, dimension: u32) -> [F32x8; 4] {
        self.words(dimension).map(U32x8::to_unit)
    }

    /// Key of child number `n` (a sample of a vertex, the next vertex of a sample).
    #[inline(always)]
    pub fn child(self, n: U32x8) -> Self {
        let [lo, hi, ..] = pcg4d([self.lo, self.hi, n, U32x8::splat(0x85eb_ca6b)]);
        Self { lo, hi }
    }
}

impl Key8 {
    /// Key of a camera sample.
    #[inline(always)]
    pub fn camera(seed: u64, pixel: U32x8, sample: U32x8) -> Self {
        let [lo, hi, ..] = pcg4d([pixel, sample, U32x8::splat(seed as u32), U32x8::splat((seed >> 32) as u32)]);
        Self { lo, hi }
    }
}
