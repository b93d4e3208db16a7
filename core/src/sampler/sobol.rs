//! Owen-scrambled Sobol' points, padded block by block (Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4)
//! 2020).
//!
//! Plain version: a block of number `b` of the key (lo, i) draws coordinates 0 to 3 of point `shuffle(i)` of the Sobol'
//! sequence, each scrambled by Owen's method. The seeds of shuffle and scrambles are hashes of `lo` and `b`.
//!
//! 1. *Scrambles are hashes.* Owen's scramble flips each binary digit by a random function of the digits before it.
//!    [`scramble`] is such a function of numbers whose digits are reversed: additions and products carry towards higher
//!    bits only (Laine and Karras 2011; the constants are those of Vegdahl 2021).
//! 2. *Numbers stay reversed.* The sequence is computed with its first digit in bit 0, so that each coordinate is
//!    reversed once, at the end, and the index is never.
//! 3. *Coordinate 1 needs no direction numbers.* Digit j is the sum of those bits b of the index for which the binomial
//!    b over j is odd: b contains the bits of j. Five steps add these (a Pascal matrix modulo 2 is a Kronecker power).
//! 4. *Coordinates 2 and 3 take as many steps as the largest index of the packet has bits.* For this the shuffle keeps
//!    the number of bits of each index: it has no constant term, so that index 0 stays, and 2^k..2^(k+1) is permuted in
//!    itself.

use croupier_simd::U32x8;

/// Direction numbers of coordinates 2 and 3 with reversed digits, one per bit of the index: polynomials x^2 + x + 1 and
/// x^3 + x + 1, initial numbers of Joe and Kuo (2008). Larger indices go on in another block of points.
const DIRECTIONS: [[u32; 2]; INDEX_BITS as usize] = directions();

/// Bits of an index within one sequence.
pub(super) const INDEX_BITS: u32 = 16;

/// The recurrence of Bratley and Fox (1988), eq. 2, on reversed digits: `m_k / 2^k` is bit 0 downwards.
const fn directions() -> [[u32; 2]; INDEX_BITS as usize] {
    let mut out = [[0; 2]; INDEX_BITS as usize];
    // initial numbers m_1, m_2(, m_3): 1, 3 and 1, 3, 1
    let (mut a, mut b) = ([0u32; INDEX_BITS as usize], [0u32; INDEX_BITS as usize]);
    let mut k = 0;
    while k < INDEX_BITS as usize {
        a[k] = match k {
            0 => 1,
            1 => 3,
            _ => a[k - 1] << 1 ^ a[k - 2] << 2 ^ a[k - 2],
        };
        b[k] = match k {
            0 | 2 => 1,
            1 => 3,
            _ => b[k - 2] << 2 ^ b[k - 3] << 3 ^ b[k - 3],
        };
        out[k] = [(a[k] << (31 - k)).reverse_bits(), (b[k] << (31 - k)).reverse_bits()];
        k += 1;
    }
    out
}

/// An Owen scramble of numbers whose first digit is bit 0; its result has it in bit 31.
#[cfg_attr(target_family = "wasm", inline(never))] // for size
#[cfg_attr(not(target_family = "wasm"), inline(always))]
fn scramble(x: U32x8, seed: U32x8) -> U32x8 {
    let x = x ^ (x * U32x8::splat(0x3d20_adea));
    let x = (x + seed) * (seed >> 16 | U32x8::splat(1));
    let x = x ^ (x * U32x8::splat(0x0552_6c56));
    (x ^ (x * U32x8::splat(0x53a2_2864))).reverse_bits()
}

/// The same without a constant term: 0 stays, and so does the lowest bit that is set.
#[inline(always)]
fn shuffle(x: U32x8, seed: U32x8) -> U32x8 {
    let x = x ^ (x * (seed << 1));
    let x = x * (seed >> 16 | U32x8::splat(1));
    let x = x ^ (x * U32x8::splat(0x0552_6c56));
    x ^ (x * U32x8::splat(0x53a2_2864))
}

/// Coordinate 1 of points, first digit in bit 0.
#[inline(always)]
fn pascal(x: U32x8) -> U32x8 {
    let x = x ^ (x >> 1 & U32x8::splat(0x5555_5555));
    let x = x ^ (x >> 2 & U32x8::splat(0x3333_3333));
    let x = x ^ (x >> 4 & U32x8::splat(0x0f0f_0f0f));
    x ^ (x >> 8 & U32x8::splat(0x00ff_00ff))
}

/// Coordinates 2 and 3 of points, first digit in bit 0.
#[inline(always)]
fn others(index: U32x8) -> [U32x8; 2] {
    let used = index.to_array().into_iter().fold(0, |all, i| all | i);
    let (mut left, mut out) = (index, [U32x8::splat(0); 2]);
    for d in DIRECTIONS.iter().take((u32::BITS - used.leading_zeros()) as usize) {
        let on = U32x8::splat(0) - (left & U32x8::splat(1));
        out = [out[0] ^ (on & U32x8::splat(d[0])), out[1] ^ (on & U32x8::splat(d[1]))];
        left = left >> 1;
    }
    out
}

/// Coordinates of the points of eight indices. `seeds` are random.
#[inline(always)]
pub(super) fn points(index: U32x8, seeds: [U32x8; 4]) -> [U32x8; 4] {
    let [a, b, c, d] = seeds;
    // of five numbers, any four are independent
    let shuffled = shuffle(index.reverse_bits(), a ^ b ^ c ^ d).reverse_bits();
    let [z, w] = others(shuffled);
    [scramble(shuffled, a), scramble(pascal(shuffled), b), scramble(z, c), scramble(w, d)]
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::rng::Key8;
    use std::collections::HashSet;
    use std::vec::Vec;

    /// Direction numbers of the Sobol' sequence's first four coordinates, as published: one per bit of the index.
    const PUBLISHED: [[u32; 8]; 4] = [
        [0x8000_0000, 0x4000_0000, 0x2000_0000, 0x1000_0000, 0x0800_0000, 0x0400_0000, 0x0200_0000, 0x0100_0000],
        [0x8000_0000, 0xc000_0000, 0xa000_0000, 0xf000_0000, 0x8800_0000, 0xcc00_0000, 0xaa00_0000, 0xff00_0000],
        [0x8000_0000, 0xc000_0000, 0x6000_0000, 0x9000_0000, 0xe800_0000, 0x5c00_0000, 0x8e00_0000, 0xc500_0000],
        [0x8000_0000, 0xc000_0000, 0x2000_0000, 0x5000_0000, 0xf800_0000, 0x7400_0000, 0xa200_0000, 0x9300_0000],
    ];

    /// Coordinate `c` of point `i` by definition.
    fn oracle(i: u32, c: usize) -> u32 {
        (0..8).filter(|b| i >> b & 1 == 1).fold(0, |x, b| x ^ PUBLISHED[c][b])
    }

    fn seeds(n: u32) -> [U32x8; 4] {
        Key8::camera(17, U32x8::splat(n), U32x8::splat(3)).words(5)
    }

    /// Points 0 to `n` of the sequence of seed `seed`, four words each.
    fn block(n: u32, seed: u32) -> Vec<[u32; 4]> {
        let of = |first: u32| {
            let p = points(U32x8::from_fn(|i| first + i as u32), seeds(seed));
            (0..8).map(move |i| p.map(|x| x.lane(i)))
        };
        (0..n).step_by(8).flat_map(of).take(n as usize).collect()
    }

    /// Before the scramble all coordinates are those of the published direction numbers. Killed by: a polynomial, an
    /// initial number or a step of the Pascal matrix that is another, digits that are not reversed.
    #[test]
    fn coordinates_are_those_of_sobol() {
        for first in (0..256).step_by(8) {
            let index = U32x8::from_fn(|i| first + i as u32);
            let [z, w] = others(index);
            let found = [index, pascal(index), z, w].map(U32x8::reverse_bits);
            for lane in 0..8 {
                let found = found.map(|x| x.lane(lane));
                let wanted = core::array::from_fn(|c| oracle(first + lane as u32, c));
                assert_eq!(found, wanted, "point {}", first + lane as u32);
            }
        }
    }

    /// An Owen scramble: what the first k digits become depends on them alone, and digit k + 1 is flipped for some of
    /// them and not for others; the shuffle keeps 0 and the number of bits besides. Killed by: an even factor, a shift
    /// to the right of what is scrambled, a constant term in the shuffle.
    #[test]
    fn digits_depend_on_those_before() {
        for seed in 0..64 {
            let [s, ..] = seeds(seed);
            for k in 1..32 {
                let below = (1u32 << k) - 1;
                let x = U32x8::from_fn(|i| (i as u32 + 3).wrapping_mul(0x9e37_79b9) & below);
                let y = U32x8::from_fn(|i| x.lane(i) | (i as u32).wrapping_mul(0x85eb_ca6b) << k);
                // of what is scrambled the first digit comes out in bit 31
                for f in [|x, s| scramble(x, s).reverse_bits(), shuffle] {
                    let (x, y) = (f(x, s), f(y, s));
                    for i in 0..8 {
                        assert_eq!(x.lane(i) & below, y.lane(i) & below, "{k} digits, seed {seed}");
                    }
                }
                let top = U32x8::splat(1 << (31 - k));
                let one = shuffle(top, s);
                assert_eq!(one.lane(0).trailing_zeros(), 31 - k, "shuffle, seed {seed}");
            }
            assert_eq!(shuffle(U32x8::splat(0), s).lane(0), 0);
        }
        // digit 4 after each of the 8 beginnings of three digits, over seeds: flipped half the time
        for beginning in 0..8 {
            let flips = (0..4096).filter(|n| scramble(U32x8::splat(beginning), seeds(*n)[1]).lane(0) >> 28 & 1 == 1);
            let flips = flips.count();
            assert!((1850..2250).contains(&flips), "{flips} of 4096 after {beginning:03b}");
        }
    }

    /// Any 2^m points that begin at a multiple of 2^m: coordinates 0 and 1 have one point in each of the elementary
    /// intervals of area 2^-m, 2 and 3 one in each of their 2^m intervals; so it is after shuffle and scramble. Killed
    /// by: a shuffle that mixes blocks, a scramble that is none, coordinates in another order.
    #[test]
    fn blocks_are_nets() {
        for seed in 0..16 {
            let all = block(256, seed);
            for m in 0..=8u32 {
                for part in all.chunks(1 << m) {
                    for rows in 0..=m {
                        let cell = |p: &[u32; 4]| {
                            let digits = |x: u32, n: u32| (u64::from(x) >> (32 - n)) as u32;
                            digits(p[0], rows) << (m - rows) | digits(p[1], m - rows)
                        };
                        let cells: HashSet<u32> = part.iter().map(cell).collect();
                        assert_eq!(cells.len(), part.len(), "seed {seed}, 2^{m} points, {rows} digits of the first");
                    }
                    for c in 2..4 {
                        let cells: HashSet<u64> = part.iter().map(|p| u64::from(p[c]) >> (32 - m)).collect();
                        assert_eq!(cells.len(), part.len(), "seed {seed}, 2^{m} points, coordinate {c}");
                    }
                }
            }
        }
    }

    /// Points 0 to 7 over many seeds: each coordinate is uniform (chi-square with 15 degrees of freedom below its
    /// quantile of 1e-6), the four of a point are independent, and so are those of two blocks. Killed by: a point that
    /// is the same for all seeds, one seed for two coordinates or for the shuffle and a scramble.
    #[test]
    fn points_are_uniform_over_seeds() {
        const N: u32 = 1 << 14;
        for i in [0, 1, 2, 7] {
            let rows: Vec<[f64; 8]> = (0..N)
                .map(|n| {
                    let [a, b] = [2 * n, 2 * n + 1].map(|seed| block(8, seed)[i]);
                    core::array::from_fn(|c| f64::from(if c < 4 { a[c] } else { b[c - 4] }) / 4_294_967_296.0)
                })
                .collect();
            for a in 0..8 {
                let mut bins = [0u32; 16];
                rows.iter().for_each(|r| bins[(r[a] * 16.0) as usize] += 1);
                let expected = f64::from(N) / 16.0;
                let chi: f64 = bins.iter().map(|x| (f64::from(*x) - expected).powi(2) / expected).sum();
                assert!(chi < 56.5, "point {i}, coordinate {a}: chi-square {chi}");
                for b in 0..a {
                    let r = rows.iter().map(|r| (r[a] - 0.5) * (r[b] - 0.5)).sum::<f64>() * 12.0 / f64::from(N);
                    assert!(r.abs() < 0.04, "point {i}, coordinates {a} and {b}: correlation {r}");
                }
            }
        }
    }

    /// Two blocks together: the mean of a product of functions of one and of the other is not noisier than with
    /// independent points, which it would be if both took their points in the same order. Killed by: no shuffle, one
    /// shuffle for all blocks.
    #[test]
    fn blocks_are_shuffled_against_each_other() {
        const RUNS: u32 = 1000;
        for n in [16u32, 64] {
            let mut variance = 0.0;
            for run in 0..RUNS {
                let (a, b) = (block(n, 2 * run), block(n, 2 * run + 1));
                let sign = |x: u32| if x.count_ones() & 1 == 1 { 1.0 } else { -1.0 };
                // of the first two digits: balanced in each block, so that only the pairing matters
                let mean = a.iter().zip(&b).map(|(a, b)| sign(a[0] >> 30) * sign(b[1] >> 30)).sum::<f64>();
                variance += (mean / f64::from(n)).powi(2) / f64::from(RUNS);
            }
            let ratio = variance * f64::from(n);
            assert!((0.5..1.6).contains(&ratio), "{n} points: {ratio} times the variance of independent points");
        }
    }
}
