//! Statistics of one bin in their three forms: of one shard and iteration ([`BinRecord`]), of all iterations
//! ([`BinSums`]), as look-ups read them ([`FrozenBin`]).
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use crate::rrs::Local8;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, U32x8, Vec3x8};

/// Direction bins of a leaf.
pub(in crate::learn) const BINS: usize = 16;

/// Number of no bin: of vertices whose samples are not learned from. Above the number of every bin.
pub const NO_BIN: u32 = u32::MAX;

/// Samples, pairs and shadow rays that one bin takes from one shard in one iteration, each: below it no f32 sum stalls.
pub const BIN_LIMIT: u16 = u16::MAX;

/// Largest value or cost, 2^55: greater ones count as this, and sums of [`BIN_LIMIT`] squares are still finite.
pub const MAX_VALUE: f32 = 36_028_797_018_963_968.0;
/// Largest second moment: twice the square of [`MAX_VALUE`].
const MAX_SQUARE: f32 = 2.0 * MAX_VALUE * MAX_VALUE;

/// Weight of `moment - mean^2` in the variance, in pairs.
const SPREAD_PAIRS: f64 = 16.0;

/// Sums of one shard in one iteration.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BinRecord {
    count: u16,
    pairs: u16,
    cost: f32,
    sum: [f32; 3],
    sqr: [f32; 3],
    pair: [f32; 3],
    /// Squares of contributions of next event estimation, all channels.
    nee: f32,
}

impl BinRecord {
    /// Adds a finite sample; `false` if the bin is full.
    #[inline]
    pub(super) fn add(&mut self, x: [f32; 3], cost: f32) -> bool {
        if self.count == BIN_LIMIT {
            return false;
        }
        self.count += 1;
        self.cost += cost.clamp(0.0, MAX_VALUE);
        for ((sum, sqr), x) in self.sum.iter_mut().zip(&mut self.sqr).zip(x) {
            let x = x.clamp(0.0, MAX_VALUE);
            *sum += x;
            *sqr += x * x;
        }
        true
    }

    /// Are these sums that samples may have?
    pub(super) fn is_sound(&self) -> bool {
        let Self { count: _, pairs: _, cost, sum, sqr, pair, nee } = self;
        let all = [sum, sqr, pair].into_iter().flatten().chain([cost, nee]);
        all.into_iter().all(|x| (0.0..=f32::MAX).contains(x))
    }

    /// Adds the square of a finite contribution of next event estimation, times its probability.
    #[inline]
    pub(super) fn add_nee(&mut self, x: [f32; 3], nee_probability: f32) {
        if self.count != BIN_LIMIT {
            let square: f32 = x.map(|x| x.clamp(0.0, MAX_VALUE)).map(|x| x * x).iter().sum();
            // there may be more of them than samples: incomplete samples are not added
            self.nee = (self.nee + nee_probability.clamp(0.0, 1.0) * square).min(f32::MAX);
        }
    }

    /// Adds a finite half squared difference; `false` if the bin is full.
    #[inline]
    pub(super) fn add_pair(&mut self, half_squared_difference: [f32; 3]) -> bool {
        if self.pairs == BIN_LIMIT {
            return false;
        }
        self.pairs += 1;
        for (sum, d) in self.pair.iter_mut().zip(half_squared_difference) {
            *sum += d.clamp(0.0, MAX_SQUARE);
        }
        true
    }
}

/// Shadow rays of one shard in one iteration, from a leaf towards a bin's directions.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ShadowRecord {
    rays: u16,
    visible: u16,
}

impl ShadowRecord {
    /// Are these counts that rays may have?
    pub(super) fn is_sound(&self) -> bool {
        self.visible <= self.rays
    }

    /// Adds a ray; `false` if the record is full.
    #[inline]
    pub(super) fn add(&mut self, visible: bool) -> bool {
        if self.rays == BIN_LIMIT {
            return false;
        }
        self.rays += 1;
        self.visible += u16::from(visible);
        true
    }
}

/// Sums over all iterations, in f64 so that 1e9 samples lose nothing.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BinSums {
    pub(super) count: f64,
    pub(super) pairs: f64,
    cost: f64,
    sum: [f64; 3],
    sqr: [f64; 3],
    pair: [f64; 3],
    /// Shadow rays from the leaf towards the bin's directions, from vertices of any bin of the leaf.
    rays: f64,
    /// Shadow rays among them that were unoccluded.
    visible: f64,
    /// Squares of contributions of next event estimation, all channels, as if every sample had used it.
    nee: f64,
}

/// Number of the sums.
const FIELDS: usize = size_of::<BinSums>() / 8;

impl BinSums {
    pub(super) const ZERO: Self = Self {
        count: 0.0,
        pairs: 0.0,
        cost: 0.0,
        sum: [0.0; 3],
        sqr: [0.0; 3],
        pair: [0.0; 3],
        rays: 0.0,
        visible: 0.0,
        nee: 0.0,
    };

    pub(super) fn fields(&self) -> &[f64; FIELDS] {
        bytemuck::cast_ref(self)
    }

    pub(super) fn fields_mut(&mut self) -> &mut [f64; FIELDS] {
        bytemuck::cast_mut(self)
    }

    pub(super) fn scale(&mut self, s: f64) {
        self.fields_mut().iter_mut().for_each(|x| *x *= s);
    }

    /// Adds `share` of `o`.
    pub(super) fn add(&mut self, o: &Self, share: f64) {
        for (a, b) in self.fields_mut().iter_mut().zip(o.fields()) {
            *a += share * b;
        }
    }

    /// Shrinks towards `prior`: adds `samples` samples, pairs and shadow rays that are what `prior` has on average.
    pub(super) fn shrink(&mut self, prior: &Self, samples: f64) {
        if prior.count > 0.0 {
            let own = *self;
            self.add(prior, samples / prior.count);
            (self.pairs, self.pair) = (own.pairs, own.pair);
            (self.rays, self.visible) = (own.rays, own.visible);
        }
        if prior.pairs > 0.0 {
            let share = samples / prior.pairs;
            self.pairs += samples;
            self.pair.iter_mut().zip(prior.pair).for_each(|(a, b)| *a += share * b);
        }
        if prior.rays > 0.0 {
            self.rays += samples;
            self.visible += samples * prior.visible / prior.rays;
        }
    }

    /// Square root of the share of unoccluded shadow rays, in 255ths, rounded up; 255 where none was traced.
    fn visibility(&self) -> u8 {
        let share = self.visible / self.rays;
        if share < 1.0 {
            let root = F32x8::splat(share as f32).sqrt().lane(0) * 255.0;
            let floor = root as u8;
            floor + u8::from(root > f32::from(floor))
        } else {
            u8::MAX
        }
    }

    pub(super) fn absorb_shadows(&mut self, s: &ShadowRecord) {
        self.rays += f64::from(s.rays);
        self.visible += f64::from(s.visible);
    }

    pub(super) fn absorb(&mut self, r: &BinRecord) {
        self.count += f64::from(r.count);
        self.pairs += f64::from(r.pairs);
        self.cost += f64::from(r.cost);
        self.nee += f64::from(r.nee);
        for (a, b) in [(&mut self.sum, r.sum), (&mut self.sqr, r.sqr), (&mut self.pair, r.pair)] {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += f64::from(b));
        }
    }
}

/// Statistics that look-ups read: all numbers finite, none negative. One row of eight words, half a cache line: a
/// render reads one at every vertex, so colours are [`short`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub(super) struct FrozenBin {
    count: f32,
    cost: f32,
    /// Mean, moment, variance, rgb each: two [`short`]s a word, the first below.
    colors: [u32; 5],
    /// Share of next event estimation ([`Local8::nee_share`]).
    nee_share: f32,
}

/// Number clamped to [0, `max`]; a NaN is 0.
fn saturate(x: f64, max: f32) -> f32 {
    if x > 0.0 { x.min(f64::from(max)) as f32 } else { 0.0 }
}

/// Upper half of a number that is finite and not negative: 8 significant bits, rounded towards 0. The relative error is
/// below 2^-7 for numbers above 1e-38.
fn short(x: f32) -> u32 {
    x.to_bits() >> 16
}

/// [`short`] of the number rounded up. [`MAX_SQUARE`] is a power of two, which stays as it is.
fn short_above(x: f32) -> u32 {
    short(f32::from_bits(x.to_bits() + 0xffff))
}

fn long(x: u32) -> f32 {
    f32::from_bits(x << 16)
}

impl FrozenBin {
    pub(super) const ZERO: Self = Self { count: 0.0, cost: 0.0, colors: [0; 5], nee_share: 0.0 };

    /// Statistics of one sample with the sums `s`.
    fn of(s: &BinSums) -> Self {
        let mut f = Self::ZERO;
        let n = s.count.max(1e-300);
        f.cost = saturate(s.cost / n, MAX_VALUE);
        f.count = saturate(s.count, MAX_VALUE);
        let ([mut mean, mut moment, mut variance], sums) = ([[0; 3]; 3], s.sum.iter().zip(&s.sqr).zip(&s.pair));
        let out = mean.iter_mut().zip(&mut moment).zip(&mut variance);
        for (((mean, moment), variance), ((s1, s2), p)) in out.zip(sums) {
            let (m, m2) = (s1 / n, s2 / n);
            *mean = short(saturate(m, MAX_VALUE));
            *moment = short_above(saturate(m2, MAX_SQUARE).max(long(*mean) * long(*mean)));
            let spread = (m2 - m * m).max(0.0);
            let v = (p + SPREAD_PAIRS * spread) / (s.pairs + SPREAD_PAIRS);
            *variance = short(saturate(v, MAX_SQUARE)).min(*moment);
        }
        let ([a, b, c], [d, e, g], [h, i, j]) = (mean, moment, variance);
        let squares: f64 = s.sqr.iter().sum();
        f.nee_share = saturate(s.nee / squares.max(f64::MIN_POSITIVE), 1.0);
        f.colors = [a | b << 16, c | d << 16, e | g << 16, h | i << 16, j];
        f
    }
}

/// Computes what look-ups read of one leaf, whose surroundings have the sums `prior`. Without samples all `count` are
/// 0.
pub(super) fn freeze_leaf(
    sums: &[BinSums],
    frozen: &mut [FrozenBin],
    visibility: &mut [u8],
    prior: &BinSums,
    samples: f64,
) {
    let mut leaf = BinSums::ZERO;
    sums.iter().for_each(|b| leaf.add(b, 1.0));
    let known = leaf.count > 0.0;
    leaf.shrink(prior, samples);
    for ((f, visibility), b) in frozen.iter_mut().zip(visibility).zip(sums) {
        let mut b = *b;
        let own = b.count;
        b.shrink(&leaf, samples);
        *visibility = b.visibility();
        *f = if known { FrozenBin::of(&b) } else { FrozenBin::ZERO };
        f.count = saturate(own, MAX_VALUE);
    }
}

impl FrozenBin {
    /// Statistics of eight bins, one per lane.
    #[inline(always)]
    pub(super) fn transpose(rows: [&Self; 8]) -> Local8 {
        let row = |f: &Self| F32x8::new(*bytemuck::cast_ref::<_, [f32; 8]>(f));
        let [f0, f1, f2, f3, f4, f5, f6, f7] = rows;
        let rows = [row(f0), row(f1), row(f2), row(f3), row(f4), row(f5), row(f6), row(f7)];
        let [count, cost, a, b, c, d, e, nee_share] = F32x8::transpose(rows);
        let below = |w: F32x8| F32x8::from_bits(w.to_bits() << 16);
        let above = |w: F32x8| F32x8::from_bits(w.to_bits() & U32x8::splat(0xffff_0000));
        Local8 {
            mean: Vec3x8::new(below(a), above(a), below(b)),
            moment: Vec3x8::new(above(b), below(c), above(c)),
            variance: Vec3x8::new(below(d), above(d), below(e)),
            cost,
            nee_share,
            count,
        }
    }
}
