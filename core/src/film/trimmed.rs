//! Sums of values without the k largest, in one visit of all: the largest so far wait in a binary heap with the smallest of
//! them on top, and what a larger one displaces is summed like the rest.
//!
//! A value may bring others with it, which are summed where it is: an entry is [`WIDTH`] numbers, the first of which decides.

use bytemuck::{Pod, Zeroable};

/// Numbers of an entry.
pub(super) const WIDTH: usize = 8;

/// An entry as the heap has it: bits of floats.
type Entry = [u32; WIDTH];

/// Sums over the entries that are shown, without those of the k largest values. Values are not negative; which of equal
/// ones is left out is decided by their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct TrimmedSums {
    /// Number of entries in the sums.
    pub count: u64,
    /// Sums by place in the entry; the first is that of the values.
    pub sums: [f64; WIDTH],
    /// Sum of squared values.
    pub sum_sqr: f64,
    /// Sum of the values that are left out, from [`Self::end`] on: nothing is ever subtracted (NUMERICS STA-4).
    pub rest: f64,
    /// Number of entries in the heap.
    held: u64,
    /// k.
    room: u64,
    /// Smallest value that is left out, from [`Self::end`] on; infinite if there is none.
    pub limit: f32,
    /// Number of entries of the heap that are in `rest`.
    summed: u32,
}

/// Entries of the heap that are summed in the time in which one is taken out.
const SUMMED_PER_TAKEN: u64 = 32;

impl TrimmedSums {
    /// Words of the heap for the `k` largest entries.
    pub(crate) fn heap_len(k: u64) -> usize {
        usize::try_from(k).unwrap_or(usize::MAX).saturating_mul(WIDTH)
    }

    /// Sums of nothing; the heap that the other methods are given has room for `k` entries.
    pub(crate) fn new(k: u64) -> Self {
        Self { room: k, ..Self::default() }
    }

    /// Number of entries that were shown.
    pub(crate) fn shown(&self) -> u64 {
        self.count + self.held
    }

    /// Takes an entry.
    // this and what it calls once each, not in every visit of pixels: for the size of modules and firmware
    #[inline(never)]
    pub(crate) fn show(&mut self, entry: [f32; WIDTH], heap: &mut [u32]) {
        let entry = entry.map(f32::to_bits);
        if self.held < self.room {
            self.insert(entry, heap);
        } else if self.room > 0 && heap.first().is_some_and(|least| key(&entry) > *least & MAGNITUDE) {
            self.replace_least(entry, heap);
        } else {
            self.add(entry);
        }
    }

    /// Ends, in pieces with the same `k`, not more than that of [`Self::new`]: of the values in the heap the `k` largest are
    /// left out, all if there are not more. A piece takes `limit` entries out of the heap at most, or sums as many as take
    /// that time. How many that was, and whether the sums are complete.
    pub(crate) fn end(&mut self, k: u64, limit: u64, heap: &mut [u32]) -> (u64, bool) {
        let taken = self.held.saturating_sub(k).min(limit);
        for _ in 0..taken {
            self.held -= 1;
            if let Some(last) = heap.as_chunks::<WIDTH>().0.get(self.held as usize).copied() {
                self.replace_least(last, heap);
            }
        }
        let room = (limit - taken).saturating_mul(SUMMED_PER_TAKEN).min(u32::MAX.into());
        let left_out = heap.as_chunks::<WIDTH>().0.iter().take(self.held as usize);
        self.limit = left_out.clone().next().map_or(f32::INFINITY, |e| f32::from_bits(key(e)));
        let mut n = 0;
        for e in left_out.skip(self.summed as usize).take(room as usize) {
            self.rest += f64::from(f32::from_bits(key(e)));
            n += 1;
        }
        self.summed += n;
        let n = u64::from(n);
        (taken + n.div_ceil(SUMMED_PER_TAKEN), n < room)
    }

    /// Adds an entry to the sums.
    // see `show`
    #[inline(never)]
    fn add(&mut self, entry: Entry) {
        let value = f64::from(f32::from_bits(key(&entry)));
        self.count += 1;
        self.sum_sqr += value * value;
        self.sums.iter_mut().zip(entry).for_each(|(sum, x)| *sum += f64::from(f32::from_bits(x)));
    }

    /// Puts an entry into the heap, which has room.
    // see `show`
    #[inline(never)]
    fn insert(&mut self, entry: Entry, heap: &mut [u32]) {
        let entries = heap.as_chunks_mut::<WIDTH>().0;
        let mut at = self.held as usize;
        self.held += 1;
        while at > 0 {
            let above = (at - 1) / 2;
            match entries.get(above).copied() {
                Some(e) if key(&e) > key(&entry) => put(entries, at, e),
                _ => break,
            }
            at = above;
        }
        put(entries, at, entry);
    }

    /// Adds the least entry of the heap to the sums and puts another in its place, which is not less.
    // see `show`
    #[inline(never)]
    fn replace_least(&mut self, entry: Entry, heap: &mut [u32]) {
        let entries = heap.as_chunks_mut::<WIDTH>().0;
        if let Some(least) = entries.first() {
            self.add(*least);
        }
        let held = self.held as usize;
        let mut at = 0;
        loop {
            let below =
                |i: usize| entries.get(2 * at + i).filter(|_| 2 * at + i < held).map(|e| (key(e), 2 * at + i, *e));
            // the lesser of the two below
            let next = match (below(1), below(2)) {
                (Some(a), Some(b)) if b.0 < a.0 => Some(b),
                (a, _) => a,
            };
            match next {
                Some((k, i, e)) if k < key(&entry) => {
                    put(entries, at, e);
                    at = i;
                }
                _ => break,
            }
        }
        put(entries, at, entry);
    }
}

/// Bits of a float without its sign.
const MAGNITUDE: u32 = !(1 << 31);

/// Orders entries like their values: bits of floats that are not negative compare like these.
#[inline(always)]
fn key(entry: &Entry) -> u32 {
    entry[0] & MAGNITUDE
}

fn put(entries: &mut [Entry], at: usize, entry: Entry) {
    if let Some(e) = entries.get_mut(at) {
        *e = entry;
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::{TrimmedSums, WIDTH};
    use std::vec;
    use std::vec::Vec;

    fn of(k: u64, values: &[f32]) -> TrimmedSums {
        let mut heap = vec![7; TrimmedSums::heap_len(k)];
        let mut s = TrimmedSums::new(k);
        for (i, x) in values.iter().enumerate() {
            let mut entry = [0.0; WIDTH];
            (entry[0], entry[1]) = (*x, i as f32);
            s.show(entry, &mut heap);
        }
        assert!(s.end(k, u64::MAX, &mut heap).1);
        s
    }

    /// Killed by: leaving out all that is equal to the limit, or none of it, a negative zero that is the largest.
    #[test]
    fn the_largest_are_left_out_and_no_more() {
        let of = |k: u64, values: &[f32]| {
            let s = of(k, values);
            assert_eq!(s.shown(), values.len() as u64);
            (s.count, s.sums[0], s.rest)
        };
        assert_eq!(of(0, &[1.0, 3.0, 2.0]), (3, 6.0, 0.0));
        assert_eq!(of(1, &[1.0, 3.0, 2.0]), (2, 3.0, 3.0));
        assert_eq!(of(2, &[3.0, 3.0, 3.0, 1.0]), (2, 4.0, 6.0));
        assert_eq!(of(3, &[9.0, 3.0, 3.0, 3.0, 1.0]), (2, 4.0, 15.0));
        assert_eq!(of(1, &[0.0, -0.0, 2.0, -0.0]), (3, 0.0, 2.0));
        assert_eq!(of(9, &[2.0, 1.0]), (0, 0.0, 3.0));
    }

    /// Values that differ in any digit, rising, falling and in no order, against sorting; what they bring is summed where
    /// they are. Killed by: a heap that loses its order, what is displaced and not summed, sums of the wrong entries.
    #[test]
    fn the_limit_is_the_kth_largest() {
        let mut x = 1u32;
        let values: Vec<f32> = (0..300)
            .map(|_| {
                x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f32::from_bits(x >> 1 & 0x5eff_ffff)
            })
            .collect();
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        let falling: Vec<f32> = sorted.iter().rev().copied().collect();
        for values in [&values, &sorted, &falling] {
            for k in [1, 2, 17, 150, 299, 300] {
                let s = of(k, values);
                assert_eq!(s.limit, falling[k as usize - 1], "{k}");
                assert_eq!((s.count, s.shown()), (300 - k, 300));
                let kept: f64 = sorted[..300 - k as usize].iter().map(|x| f64::from(*x)).sum();
                assert!((s.sums[0] - kept).abs() <= 1e-12 * kept);
                let places = values.iter().enumerate().filter(|(_, x)| **x < s.limit).map(|(i, _)| i as f64);
                assert_eq!(s.sums[1], places.sum::<f64>(), "{k}");
                assert_eq!(s.sums[2..], [0.0; WIDTH - 2]);
            }
        }
    }

    /// Where fewer are shown than were expected, fewer are left out. Killed by: a heap that is left out as a whole, one
    /// that gives away its largest.
    #[test]
    fn fewer_are_left_out_of_fewer() {
        let (mut s, mut heap) = (TrimmedSums::new(5), [0; 5 * WIDTH]);
        [4.0, 1.0, 5.0, 2.0, 6.0, 3.0].iter().for_each(|x| s.show([*x; WIDTH], &mut heap));
        assert!(s.end(2, u64::MAX, &mut heap).1);
        assert_eq!((s.count, s.sums[0], s.rest, s.limit), (4, 10.0, 11.0, 5.0));
    }

    /// Ends in pieces do no more than they may and give the bits of one piece; so do sums that stop half way. Killed by:
    /// taking out or summing all at once, work that is not counted, a piece that begins the sum again.
    #[test]
    fn ends_in_pieces_are_bounded_and_give_the_same_bits() {
        let values: Vec<f32> = (0..1000).map(|i| (i * 7919 % 1009) as f32 * 0.1).collect();
        for (room, shown, k) in [(1000, 700, 1), (600, 1000, 600), (600, 1000, 40), (9, 5, 9), (0, 5, 0)] {
            let mut heap = vec![7; TrimmedSums::heap_len(room)];
            let mut s = TrimmedSums::new(room);
            values.iter().take(shown).for_each(|x| s.show([*x; WIDTH], &mut heap));
            let (mut whole, mut same) = (s, heap.clone());
            let (all, done) = whole.end(k, u64::MAX, &mut same);
            assert!(done && all >= s.held.saturating_sub(k), "{all} of {room}");
            for limit in [1, 3, 50] {
                let (mut s, mut heap, mut sum, mut done) = (s, heap.clone(), 0, false);
                while !done {
                    let (work, last) = s.end(k, limit, &mut heap);
                    assert!(work <= limit && (last || work > 0), "{work} of {limit}");
                    (sum, done) = (sum + work, last);
                }
                assert_eq!(s, whole);
                assert!(sum >= all && sum <= 2 * all, "{sum} in pieces, {all} in one");
            }
        }
    }
}
