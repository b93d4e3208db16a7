//! The alias table over the lights, built where it is, without other memory.
//!
//! The sweep of Hübschle-Schneider and Sanders ("Parallel Weighted Random Sampling", ESA 2019, section 4.2): one cursor
//! runs over the items that do not fill their slot, another over those that overfill it; each remembers nothing but
//! where it is. As in the host's baker the weights become integer widths first, so that the stated probabilities are what
//! picking does (NUMERICS SMP-3): every positive weight gets one of the 2^32 random numbers, the rest is distributed by
//! rounding the running sum.

use crate::film::SqrtNewton;
use crate::scene::blob::{Alias, SceneInfo};

/// Number of 32-bit random numbers.
const RANGE: u64 = 1 << 32;

/// Weights with their sum, from which widths follow one after the other.
struct Widths<W> {
    weight: W,
    items: u32,
    total: f64,
    spare: u64,
}

/// A width and where the next one begins.
#[derive(Clone, Copy, Default)]
struct Cursor {
    /// The next item.
    item: u32,
    /// Sum of the weights before it.
    sum: f64,
    /// Numbers given away before it, but for one per positive weight.
    given: u64,
}

impl<W: Fn(u32) -> f64> Widths<W> {
    /// `None` if no weight is positive, or if there are more than random numbers.
    fn new(items: u32, weight: W) -> Option<Self> {
        let (mut total, mut positive) = (0.0, 0u64);
        for i in 0..items {
            let w = weight(i);
            total += w;
            positive += u64::from(w > 0.0);
        }
        let spare = RANGE.checked_sub(positive)?;
        (total > 0.0 && total.is_finite()).then_some(Self { weight, items, total, spare })
    }

    /// The next item and its width.
    fn next(&self, cursor: &mut Cursor) -> Option<(u32, u64)> {
        let item = cursor.item;
        if item >= self.items {
            return None;
        }
        let w = (self.weight)(item);
        cursor.item += 1;
        cursor.sum += w;
        // rounded to the nearest number, as positive numbers are
        let upto = ((cursor.sum / self.total * self.spare as f64 + 0.5) as u64).min(self.spare);
        let width = if w > 0.0 { 1 + upto.saturating_sub(cursor.given) } else { 0 };
        cursor.given = cursor.given.max(upto);
        Some((item, width))
    }

    /// The next item whose width is above its slot's (`overfull`), or is not.
    fn find(&self, cursor: &mut Cursor, overfull: bool) -> Option<(u32, u64)> {
        loop {
            let (item, width) = self.next(cursor)?;
            if (width > slot(item, self.items)) == overfull {
                return Some((item, width));
            }
        }
    }
}

/// First of the random numbers that pick slot `i` of `n`: the smallest r with `(r n) >> 32 >= i`.
fn first(i: u32, n: u32) -> u64 {
    (u64::from(i) << 32).div_ceil(u64::from(n.max(1)))
}

/// How many random numbers pick slot `i` of `n`.
fn slot(i: u32, n: u32) -> u64 {
    first(i.saturating_add(1), n) - first(i, n)
}

/// The entry that keeps slot `i` of `n` for the first `keep` of its random numbers and gives the others to `alias`.
fn entry(i: u32, n: u32, keep: u64, alias: u32) -> Alias {
    let threshold = match keep {
        0 => 0,
        // the low word of the first number that is not kept; the value that means "always" is left out
        _ => ((first(i, n) + keep) * u64::from(n) - (u64::from(i) << 32)).min(u64::from(u32::MAX - 1)) as u32,
    };
    Alias { threshold, alias, probability: 0.0 }
}

/// Fills `table` for items with these weights, which are finite and not negative; whatever weight it has, an item of
/// weight 0 is never picked. Without a positive weight nothing is ever picked: all probabilities are 0.
pub(crate) fn build(table: &mut [Alias], weight: impl Fn(u32) -> f64) {
    let n = u32::try_from(table.len()).unwrap_or(u32::MAX);
    for (item, alias) in (0..n).zip(table.iter_mut()) {
        *alias = Alias { threshold: u32::MAX, alias: item, probability: 0.0 };
    }
    let Some(widths) = Widths::new(n, weight) else { return };
    let mut put = |i: u32, entry: Alias| {
        if let Some(place) = table.get_mut(i as usize) {
            *place = entry;
        }
    };
    let (mut small, mut large) = (Cursor::default(), Cursor::default());
    let mut next_small = widths.find(&mut small, false);
    let mut over = widths.find(&mut large, true);
    while let Some((heavy, left)) = over {
        let room = slot(heavy, n);
        over = if left > room {
            let Some((light, width)) = next_small else { break };
            next_small = widths.find(&mut small, false);
            // an item that fills its slot exactly keeps all of it
            let gap = slot(light, n) - width;
            if gap > 0 {
                put(light, entry(light, n, width, heavy));
            }
            Some((heavy, left - gap))
        } else if left < room {
            let Some((next, width)) = widths.find(&mut large, true) else { break };
            put(heavy, entry(heavy, n, left, next));
            Some((next, width - (room - left)))
        } else {
            widths.find(&mut large, true)
        };
    }
    let mut all = Cursor::default();
    while let Some((item, width)) = widths.next(&mut all) {
        if let Some(place) = table.get_mut(item as usize) {
            place.probability = (width as f64 / RANGE as f64) as f32;
        }
    }
}

/// Radius of a sphere around a scene, by which lights at infinity have power: half the diagonal of its bounds, 1 if it has no
/// extent.
pub(crate) fn radius(info: &SceneInfo) -> f64 {
    let extent = |a: usize| {
        let side = |p: &[f32; 3]| p.get(a).copied().map_or(0.0, f64::from);
        side(&info.bounds_max) - side(&info.bounds_min)
    };
    let [x, y, z] = [extent(0), extent(1), extent(2)];
    let square = (x * x + y * y + z * z) / 4.0;
    if square > 0.0 { square.sqrt_newton() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// How many of the 2^32 random numbers pick each item, from the definition of [`Alias`].
    fn picked(table: &[Alias]) -> Vec<u64> {
        let n = table.len() as u64;
        let mut out = std::vec![0; table.len()];
        for (j, a) in (0u64..).zip(table) {
            let (from, to) = ((j << 32).div_ceil(n), ((j + 1) << 32).div_ceil(n));
            let keep = match a.threshold {
                u32::MAX => to,
                t => ((j << 32) + u64::from(t)).div_ceil(n).clamp(from, to),
            };
            out[j as usize] += keep - from;
            out[a.alias as usize] += to - keep;
        }
        out
    }

    /// Every item is picked by as many numbers as its probability says, which is its share of the weight to within one
    /// number. Killed by: a gap filled twice, an item that overfills after it was filled, a threshold off by one, a
    /// weight of 0 that is picked.
    #[test]
    fn probabilities_are_what_picking_does() {
        let mut word = 1u32;
        let mut next = || {
            word = word.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            f64::from(word >> 8) / 16_777_216.0
        };
        for n in [1usize, 2, 3, 7, 64, 1000] {
            for kind in 0..5 {
                let weights: Vec<f64> = (0..n)
                    .map(|i| match kind {
                        0 => 1.0,
                        1 => next(),
                        2 => next().powi(12) * 1e6,
                        3 => f64::from(u8::from(i % 3 == 0)) * next(),
                        _ => {
                            if i == n / 2 {
                                1e9
                            } else {
                                1e-9
                            }
                        }
                    })
                    .collect();
                let mut table = std::vec![Alias { threshold: 7, alias: 7, probability: 7.0 }; n];
                build(&mut table, |i| weights[i as usize]);
                let total: f64 = weights.iter().sum();
                let picked = picked(&table);
                assert_eq!(picked.iter().sum::<u64>(), RANGE);
                for (i, w) in weights.iter().enumerate() {
                    assert_eq!(table[i].probability, (picked[i] as f64 / RANGE as f64) as f32, "{n} {kind} {i}");
                    assert_eq!(*w > 0.0, picked[i] > 0);
                    let positive = weights.iter().filter(|w| **w > 0.0).count() as f64;
                    let ideal = if *w > 0.0 { 1.0 + w / total * (RANGE as f64 - positive) } else { 0.0 };
                    assert!((picked[i] as f64 - ideal).abs() <= 1.001, "{n} {kind} {i}: {} of {ideal}", picked[i]);
                }
            }
        }
        let mut table = std::vec![Alias { threshold: 7, alias: 7, probability: 7.0 }; 3];
        build(&mut table, |_| 0.0);
        assert!(table.iter().all(|a| a.probability == 0.0));
    }
}
