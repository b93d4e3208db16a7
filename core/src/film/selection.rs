//! Sums without the k largest values, by radix selection on the bits of floats: three visits of all values and one that
//! sums, in fixed memory. Visits can be interrupted between any two values.

use bytemuck::{Pod, Zeroable};

/// Number of counters that a selection needs.
pub(crate) const DIGITS: usize = 1 << 11;

/// Bits below each digit, and number of digits above: 11, 10 and 10 bits of a non-negative float.
const SHIFTS: [[u32; 2]; 3] = [[20, 11], [10, 10], [0, 10]];

/// Bits that the last digit tells.
const COARSE: u32 = SHIFTS[2][1];

/// Number of values that are summed beside each.
pub(super) const BESIDE: usize = 6;

/// Sums of the non-negative values that are shown, without the `k` largest in `f32`. Of equal values at the limit, as
/// many are left out as make `k`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Selection {
    /// Number of values in the sum.
    pub count: u64,
    /// Sum of those values.
    pub sum: f64,
    /// Sum of their squares.
    pub sum_sqr: f64,
    /// Sums of the values that were shown beside them.
    pub sum_beside: [f64; BESIDE],
    /// Sum of the largest values, which are left out of `sum`: nothing is ever subtracted (NUMERICS STA-4).
    pub rest: f64,
    /// Number of values that were shown in one visit.
    pub shown: u64,
    /// Values that are still to be left out: of those with the prefix, later of those that are equal to the limit.
    left: u64,
    /// Smallest value that is left out; infinite if there is none.
    pub limit: f32,
    /// Visit that is under way.
    visit: u32,
    /// Bits of the limit that are known.
    prefix: u32,
    /// Bits in which values do not differ.
    ignored: u32,
}

impl Selection {
    /// Is the first visit under way?
    pub(crate) fn is_first_visit(&self) -> bool {
        self.visit == 0
    }

    /// Begins; `counters` are as many as [`DIGITS`].
    pub(crate) fn begin(&mut self, counters: &mut [u32]) {
        *self = Self::default();
        counters.fill(0);
    }

    /// Begins, with a visit less: values that differ by less than 2^-13 are taken for equal.
    pub(crate) fn begin_coarse(&mut self, counters: &mut [u32]) {
        self.begin(counters);
        self.ignored = (1 << COARSE) - 1;
    }

    /// Begins with the last visit, which leaves nothing out: for those who know that before.
    pub(crate) fn begin_with_all(&mut self, counters: &mut [u32]) {
        self.begin(counters);
        (self.limit, self.visit) = (f32::INFINITY, SHIFTS.len() as u32);
    }

    /// Takes the next value of the visit that is under way.
    #[inline(always)]
    pub(crate) fn show(&mut self, x: f64, counters: &mut [u32]) {
        self.show_with(x, [0.0; BESIDE], counters);
    }

    /// Takes the next value of the visit that is under way, with others that are summed where it is.
    #[inline(always)]
    pub(crate) fn show_with(&mut self, x: f64, beside: [f64; BESIDE], counters: &mut [u32]) {
        let bits = (x as f32).to_bits() & 0x7fff_ffff & !self.ignored;
        let short = f32::from_bits(bits);
        if let Some([shift, width]) = SHIFTS.get(self.visit as usize) {
            self.shown += u64::from(self.visit == 0);
            let above = shift + width;
            if self.visit == 0 || bits >> above == self.prefix >> above {
                let digit = (bits >> shift & ((1 << width) - 1)) as usize;
                if let Some(n) = counters.get_mut(digit) {
                    *n = n.saturating_add(1);
                }
            }
            return;
        }
        let tied = short == self.limit && self.left > 0;
        self.left -= u64::from(tied);
        if short > self.limit || tied {
            self.rest += x;
        } else {
            self.count += 1;
            self.sum += x;
            self.sum_sqr += x * x;
            self.sum_beside.iter_mut().zip(beside).for_each(|(sum, y)| *sum += y);
        }
    }

    /// Ends a visit; `k` says of how many values how many are left out. `true` after the last.
    pub(crate) fn end_visit(&mut self, k: impl Fn(u64) -> u64, counters: &mut [u32]) -> bool {
        let Some([shift, _]) = SHIFTS.get(self.visit as usize) else { return true };
        if self.visit == 0 {
            self.left = k(self.shown);
        }
        if self.left == 0 && self.visit == 0 {
            (self.limit, self.visit) = (f32::INFINITY, SHIFTS.len() as u32);
        } else {
            for (digit, n) in (0..counters.len() as u32).zip(&*counters).rev() {
                if self.left <= u64::from(*n) {
                    self.prefix |= digit << shift;
                    break;
                }
                self.left -= u64::from(*n);
            }
            self.limit = f32::from_bits(self.prefix);
            let all_known = self.ignored.count_ones() >= *shift;
            self.visit = if all_known { SHIFTS.len() as u32 } else { self.visit + 1 };
        }
        counters.fill(0);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::{DIGITS, Selection};

    fn of(k: u64, values: &[f64]) -> Selection {
        let (mut s, mut counters) = (Selection::default(), [7; DIGITS]);
        s.begin(&mut counters);
        loop {
            values.iter().for_each(|x| s.show(*x, &mut counters));
            if s.end_visit(|_| k, &mut counters) {
                return s;
            }
        }
    }

    /// Killed by: leaving out all that is equal to the limit, or none of it.
    #[test]
    fn the_largest_are_left_out_and_no_more() {
        let of = |k: u64, values: &[f64]| {
            let s = of(k, values);
            (s.count, s.sum, s.rest)
        };
        assert_eq!(of(0, &[1.0, 3.0, 2.0]), (3, 6.0, 0.0));
        assert_eq!(of(1, &[1.0, 3.0, 2.0]), (2, 3.0, 3.0));
        assert_eq!(of(2, &[3.0, 3.0, 3.0, 1.0]), (2, 4.0, 6.0));
        assert_eq!(of(3, &[9.0, 3.0, 3.0, 3.0, 1.0]), (2, 4.0, 15.0));
        assert_eq!(of(1, &[0.0; 4]), (3, 0.0, 0.0));
        assert_eq!(of(9, &[2.0, 1.0]), (0, 0.0, 3.0));
    }

    /// Killed by: a visit too few or too many, bits that count where they should not.
    #[test]
    fn two_visits_leave_out_as_many() {
        let values: [f64; 64] = core::array::from_fn(|i| 1.0 + ((i * 29) % 64) as f64);
        for k in [1, 7, 63] {
            let (mut s, mut counters, mut visits) = (Selection::default(), [7; DIGITS], 0);
            s.begin_coarse(&mut counters);
            loop {
                values.iter().for_each(|x| s.show(*x, &mut counters));
                visits += 1;
                if s.end_visit(|_| k, &mut counters) {
                    break;
                }
            }
            let kept = 64 - k;
            assert_eq!((visits, s.count, s.sum), (3, kept, (kept * (kept + 1) / 2) as f64), "{k}");
        }
        // equal but for the last digit: the later ones stay
        let (mut s, mut counters) = (Selection::default(), [7; DIGITS]);
        s.begin_coarse(&mut counters);
        let alike = [1.0, 1.0 + 1e-6, 1.0 + 2e-6];
        while {
            alike.iter().for_each(|x| s.show(*x, &mut counters));
            !s.end_visit(|_| 1, &mut counters)
        } {}
        assert_eq!((s.count, s.rest), (2, 1.0));
    }

    /// One visit sums what several that leave nothing out do. Killed by: a limit of 0.
    #[test]
    fn all_values_need_one_visit() {
        let (mut s, mut counters) = (Selection::default(), [7; DIGITS]);
        s.begin_with_all(&mut counters);
        [1.0, 3.0, 2.0].iter().for_each(|x| s.show(*x, &mut counters));
        assert!(s.end_visit(|_| 1, &mut counters));
        assert_eq!((s.count, s.sum, s.sum_sqr, s.rest), (3, 6.0, 14.0, 0.0));
    }

    /// Values that differ in any digit, against sorting. Killed by: a digit that is masked or shifted wrongly, a limit
    /// that is a neighbour.
    #[test]
    fn the_limit_is_the_kth_largest() {
        let mut x = 1u32;
        let mut values = [0.0f64; 300];
        for v in &mut values {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *v = f64::from(f32::from_bits(x >> 1 & 0x7eff_ffff));
        }
        for k in [1, 2, 17, 150, 299, 300] {
            let mut sorted = values;
            sorted.sort_by(|a, b| b.total_cmp(a));
            let s = of(k, &values);
            assert_eq!(f64::from(s.limit), sorted[k as usize - 1], "{k}");
            assert_eq!(s.count, 300 - k);
            assert_eq!(s.shown, 300);
        }
    }
}
