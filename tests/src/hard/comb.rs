//! The comb over all random numbers: every factor gets exactly as many samples as it says, on average (NUMERICS RRS-2).

use super::Found;
use crate::stats::SplitMix;
use croupier::unstable::rrs::{COMB_ONE, MAX_FACTOR, MIN_FACTOR, comb};
use croupier::unstable::simd::F32x8;

/// Factors of a packet as multiples of 2^-`bits`: random, with the smallest, the largest, 1 and 0 among them.
fn factors(bits: u32, rng: &mut SplitMix) -> [f32; 8] {
    let grid = (1u64 << bits) as f64;
    let special = [MIN_FACTOR, 1.0, MAX_FACTOR, 0.0];
    std::array::from_fn(|_| {
        let s = match rng.bits() % 12 {
            k @ 0..4 => special[k as usize],
            k if k % 2 == 0 => MIN_FACTOR + (MAX_FACTOR - MIN_FACTOR) * rng.f32(),
            _ => MIN_FACTOR + 2.0 * rng.f32(),
        };
        ((f64::from(s) * grid).floor() / grid) as f32
    })
}

/// Sample counts of the factors `s`, summed over 2^`bits` equally spaced random numbers from 0 on, and how far the sum
/// over the packet was from the sum of its factors at most.
pub fn sums(s: [f32; 8], bits: u32) -> ([u64; 8], f64) {
    let exact: u64 = s.iter().map(|x| (f64::from(*x) * COMB_ONE) as u64).sum();
    let s = F32x8::new(s);
    let (mut sum, mut low, mut high) = ([0u64; 8], u32::MAX, 0);
    for k in 0..1u64 << bits {
        let n = comb(s, (k << (32 - bits)) as u32);
        let mut total = 0;
        for (sum, n) in sum.iter_mut().zip(n) {
            *sum += u64::from(n);
            total += n;
        }
        (low, high) = (low.min(total), high.max(total));
    }
    let exact = exact as f64 / COMB_ONE;
    (sum, (exact - f64::from(low)).max(f64::from(high) - exact))
}

/// Random packets over 2^`bits` random numbers each; with 32 these are all that there are. A case is a count of one
/// factor, a failure a factor whose counts have another mean than the factor itself, or a packet whose total is off by
/// one or more. The figure is how far the total of a packet is from the sum of its factors.
pub fn exact(seed: u64, packets: u64, bits: u32) -> Found {
    let mut rng = SplitMix(seed);
    let mut found = Found::default();
    for _ in 0..packets {
        let s = factors(bits, &mut rng);
        let (sum, off) = sums(s, bits);
        found.cases += 8 << bits;
        found.figure(off);
        for (s, sum) in s.into_iter().zip(sum) {
            let want = (f64::from(s) * (1u64 << bits) as f64) as u64;
            found.fail(u64::from(sum != want), || format!("factor {s}: {sum} samples in place of {want}"));
        }
        found.fail(u64::from(off >= 1.0), || format!("{s:?}: the total is off by {off}"));
    }
    found
}
