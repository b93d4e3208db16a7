//! Sums without the k largest values, by radix selection: four passes over the values, no memory.

/// Sums of values without the largest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Trimmed {
    /// Number of values in the sum.
    pub count: u64,
    /// Sum of those values.
    pub sum: f64,
    /// Sum of their squares.
    pub sum_sqr: f64,
    /// Sum of the largest values, which are left out of `sum`: nothing is ever subtracted (NUMERICS STA-4).
    pub rest: f64,
    /// Smallest value that was left out; infinite if there is none.
    pub limit: f32,
}

/// Sums of the non-negative values that `visit` shows, without the `k` largest in `f32`. Of equal values at the limit,
/// as many are left out as make `k`.
#[inline(always)]
pub(crate) fn trimmed(k: usize, mut visit: impl FnMut(&mut dyn FnMut(f64))) -> Trimmed {
    let mut t = Trimmed { limit: f32::INFINITY, ..Trimmed::default() };
    let mut out = k;
    if k > 0 {
        t.limit = kth_largest(k, |show| visit(&mut |x| show(x as f32)));
        let limit = t.limit;
        visit(&mut |x| out = out.saturating_sub(usize::from(x as f32 > limit)));
    }
    visit(&mut |x| {
        let tied = x as f32 == t.limit && out > 0;
        out -= usize::from(tied);
        if x as f32 > t.limit || tied {
            t.rest += x;
        } else {
            t.count += 1;
            t.sum += x;
            t.sum_sqr += x * x;
        }
    });
    t
}

/// Finds the `k`-th largest (k >= 1) of the non-negative values that `visit` shows, by radix selection on the float's
/// bits: four visits, no memory. 0 if there are fewer.
#[inline(always)]
fn kth_largest(k: usize, mut visit: impl FnMut(&mut dyn FnMut(f32))) -> f32 {
    let (mut prefix, mut left) = (0u32, k);
    for shift in [24u32, 16, 8, 0] {
        let mut histogram = [0usize; 256];
        visit(&mut |x| {
            let bits = x.to_bits();
            if shift == 24 || bits >> (shift + 8) == prefix >> (shift + 8) {
                histogram[(bits >> shift & 0xff) as usize] += 1;
            }
        });
        for digit in (0..256usize).rev() {
            if left <= histogram[digit] {
                prefix |= (digit as u32) << shift;
                break;
            }
            left -= histogram[digit];
        }
    }
    f32::from_bits(prefix)
}

#[cfg(test)]
mod tests {
    use super::trimmed;

    /// Killed by: leaving out all that is equal to the limit, or none of it.
    #[test]
    fn the_largest_are_left_out_and_no_more() {
        let of = |k: usize, values: &[f64]| {
            let t = trimmed(k, |show| values.iter().for_each(|x| show(*x)));
            (t.count, t.sum, t.rest)
        };
        assert_eq!(of(0, &[1.0, 3.0, 2.0]), (3, 6.0, 0.0));
        assert_eq!(of(1, &[1.0, 3.0, 2.0]), (2, 3.0, 3.0));
        assert_eq!(of(2, &[3.0, 3.0, 3.0, 1.0]), (2, 4.0, 6.0));
        assert_eq!(of(3, &[9.0, 3.0, 3.0, 3.0, 1.0]), (2, 4.0, 15.0));
        assert_eq!(of(1, &[0.0; 4]), (3, 0.0, 0.0));
        assert_eq!(of(9, &[2.0, 1.0]), (0, 0.0, 3.0));
    }
}
