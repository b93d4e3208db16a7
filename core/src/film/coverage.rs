//! Coverage of pixels by index: how large a share of the samples met which material or object, the two largest shares of
//! each pixel, as Cryptomatte ranks them (Friedman and Jones 2015).
//!
//! A row holds pairs of an index and how much of the pixel it covers. An iteration counts the first [`RANKS`] indices that
//! the pixel's samples meet, from their first sample on, so that pixels with no more of them have exact shares. Others are
//! left out, and a share that is merged from several iterations may be too small by what was left out, never too large.

/// Pairs of each pixel.
pub(super) const RANKS: usize = 2;

/// What no sample has met.
pub(super) const NO_INDEX: f32 = -1.0;

/// An index, and the number of samples or the share of a pixel that it has; nothing where that is 0.
pub(super) type Pair = [f32; 2];

/// Counts a sample of `index` in the values of a pixel.
pub(super) fn count(row: &mut [f32], index: f32) {
    for [known, n] in row.as_chunks_mut::<2>().0.iter_mut().take(RANKS) {
        if *n == 0.0 || *known == index {
            (*known, *n) = (index, *n + 1.0);
            return;
        }
    }
}

/// The shares of `before + more` samples, largest first: of `before` samples there are `old` ones, of `more` the
/// counts in `row`.
pub(super) fn merge(old: [Pair; RANKS], before: f64, more: f64, row: &[f32]) -> [Pair; RANKS] {
    let total = (before + more).max(1.0);
    let counts = row.as_chunks::<2>().0;
    let counted = |index: f32| counts.iter().find(|c| c[0] == index).map_or(0.0, |c| f64::from(c[1]));
    let is_known = |index: f32| before > 0.0 && old.iter().any(|o| o[1] > 0.0 && o[0] == index);
    let mut ranks = [[f64::from(NO_INDEX), 0.0]; RANKS];
    let mut rank = |index: f32, share: f64| {
        let mut next = [f64::from(index), share];
        for pair in &mut ranks {
            if next[1] > pair[1] {
                core::mem::swap(pair, &mut next);
            }
        }
    };
    if before > 0.0 {
        for [index, share] in old {
            let share = f64::from(share);
            // a share of 1 stays 1
            rank(index, share + (counted(index) - more * share) / total);
        }
    }
    for [index, n] in counts.iter().filter(|c| !is_known(c[0])) {
        rank(*index, f64::from(*n) / total);
    }
    ranks.map(|r| r.map(|x| x as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Pair = [NO_INDEX, 0.0];

    fn counts(ids: &[f32]) -> [f32; 4] {
        let mut row = [NO_INDEX, 0.0, NO_INDEX, 0.0];
        ids.iter().for_each(|id| count(&mut row, *id));
        row
    }

    /// Killed by: a third index that takes a place of the first two, an index 0 that is taken for none.
    #[test]
    fn the_first_two_indices_are_counted() {
        assert_eq!(counts(&[]), [-1.0, 0.0, -1.0, 0.0]);
        assert_eq!(counts(&[0.0, 0.0]), [0.0, 2.0, -1.0, 0.0]);
        assert_eq!(counts(&[7.0, 0.0, 3.0, 7.0, 0.0, 7.0]), [7.0, 3.0, 0.0, 2.0]);
    }

    /// Killed by: shares of iterations that are averaged without their samples, ranks out of order, an old share that is
    /// not diluted, one that a smaller newcomer replaces, memory that is read before the first samples.
    #[test]
    fn shares_are_those_of_all_samples() {
        let first = merge([[f32::NAN; 2]; 2], 0.0, 4.0, &counts(&[5.0, 2.0, 2.0, 2.0]));
        assert_eq!(first, [[2.0, 0.75], [5.0, 0.25]]);
        let swapped = merge(first, 4.0, 12.0, &counts(&[5.0; 12]));
        assert_eq!(swapped, [[5.0, 13.0 / 16.0], [2.0, 3.0 / 16.0]]);
        let newcomer = merge(swapped, 16.0, 16.0, &counts(&[9.0; 16]));
        assert_eq!(newcomer, [[9.0, 0.5], [5.0, 13.0 / 32.0]]);
        let smaller = merge(newcomer, 32.0, 1.0, &counts(&[4.0]));
        assert_eq!(smaller.map(|p| p[0]), [9.0, 5.0]);
        assert!((smaller[0][1] - 16.0 / 33.0).abs() < 1e-6);
        let whole = (0..5).fold([NONE; 2], |m, i| merge(m, f64::from(3 * i), 3.0, &counts(&[1.0; 3])));
        assert_eq!(whole, [[1.0, 1.0], NONE]);
        assert_eq!(merge([[f32::NAN; 2]; 2], 0.0, 2.0, &counts(&[])), [NONE; 2]);
    }
}
