//! Alias tables whose probabilities are what the sampler does, to the last of the 2^32 random numbers.
//!
//! A table with real-valued thresholds rounds twice: the widths that sampling realises and the probabilities that
//! the estimator divides by differ, and the estimate is biased by the difference (NUMERICS SMP-3). Here the weights
//! become integer widths first; the widths, the thresholds and the probabilities then follow exactly.

use croupier::unstable::scene::blob::Alias;
use std::cmp::Ordering;

/// Number of 32-bit numbers.
const RANGE: u64 = 1 << 32;

/// First of the 32-bit numbers that pick slot `i` of `n`: the smallest r with `(r n) >> 32 >= i`.
fn first(i: usize, n: usize) -> u64 {
    ((i as u64) << 32).div_ceil(n as u64)
}

/// Integer widths that sum to exactly 2^32: 0 for a weight of 0, at least 1 for a positive weight.
///
/// Every positive weight gets one unit, the rest is distributed by rounding the running sum, so that a width is within
/// one unit of its share of `2^32 - n`. Negative and non-finite weights count as 0. `None` if no weight is positive.
pub fn widths(weights: &[f64]) -> Option<Vec<u64>> {
    let clean = |w: f64| if w.is_finite() && w > 0.0 { w } else { 0.0 };
    let largest = weights.iter().copied().map(clean).fold(0.0, f64::max);
    if largest == 0.0 {
        return None;
    }
    let positive = weights.iter().filter(|w| clean(**w) > 0.0).count() as u64;
    assert!(positive <= RANGE, "more items than 32-bit numbers");
    // Relative to the largest, so that a sum of huge weights stays finite.
    let total: f64 = weights.iter().map(|w| clean(*w) / largest).sum();
    let spare = RANGE - positive;
    let (mut sum, mut given) = (0.0, 0);
    let mut widths = Vec::with_capacity(weights.len());
    for w in weights.iter().copied().map(clean) {
        sum += w / largest;
        let upto = ((sum / total * spare as f64).round() as u64).min(spare);
        widths.push(if w > 0.0 { 1 + upto - given } else { 0 });
        given = upto;
    }
    Some(widths)
}

/// Builds the alias table of `weights` (Vose, IEEE Trans. Software Eng. 17(9) 1991, on integer widths).
///
/// [`Alias::probability`] is the share of the 2^32 random numbers that pick the item, rounded to `f32`: an item of
/// weight 0 is never picked, one of positive weight by at least one number. Negative and non-finite weights count as
/// 0. Returns an empty table if no weight is positive.
///
/// ```
/// use croupier_host::alias;
/// let table = alias::build(&[1.0, 0.0, 3.0]);
/// assert_eq!(table[1].probability, 0.0);
/// assert!((table[2].probability - 0.75).abs() < 1e-6);
/// assert!(alias::build(&[0.0, 0.0]).is_empty());
/// ```
pub fn build(weights: &[f64]) -> Vec<Alias> {
    let Some(widths) = widths(weights) else { return Vec::new() };
    let n = widths.len();
    let capacity = |i: usize| first(i + 1, n) - first(i, n);
    // What each item still has to place. Slots with less than they hold are filled up by items with more; the sums
    // are equal and exact, so every slot ends full.
    let mut left = widths.clone();
    let (mut small, mut large) = (Vec::new(), Vec::new());
    for (i, w) in left.iter().enumerate() {
        match w.cmp(&capacity(i)) {
            Ordering::Less => small.push(i),
            Ordering::Greater => large.push(i),
            Ordering::Equal => {}
        }
    }
    let keep_all = |i: usize| Alias { threshold: u32::MAX, alias: i as u32, probability: 0.0 };
    let mut table: Vec<Alias> = (0..n).map(keep_all).collect();
    while let (Some(s), Some(&l)) = (small.pop(), large.last()) {
        table[s] = Alias { threshold: threshold(s, n, left[s]), alias: l as u32, probability: 0.0 };
        // Capacities differ by at most one, and `l` holds more than its own: this never goes below 0.
        left[l] -= capacity(s) - left[s];
        match left[l].cmp(&capacity(l)) {
            Ordering::Less => {
                large.pop();
                small.push(l);
            }
            Ordering::Equal => drop(large.pop()),
            Ordering::Greater => {}
        }
    }
    for (entry, w) in table.iter_mut().zip(&widths) {
        entry.probability = (*w as f64 / RANGE as f64) as f32;
    }
    table
}

/// The threshold that keeps slot `i` of `n` for exactly the first `keep` of its random numbers, `keep` less than all.
fn threshold(i: usize, n: usize, keep: u64) -> u32 {
    if keep == 0 {
        return 0;
    }
    // Low word of the first number that is not kept; the last kept one lies n below. `u32::MAX` is reserved.
    let low = (first(i, n) + keep) * n as u64 - ((i as u64) << 32);
    u32::try_from(low).unwrap_or(u32::MAX).min(u32::MAX - 1)
}
