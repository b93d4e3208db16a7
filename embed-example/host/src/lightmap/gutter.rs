//! Texels without samples of their own: those inside of other geometry, and the gutter around charts, from which bilinear
//! look-ups at their borders read.

/// Columns and rows in the order in which neighbours are asked: those across an edge, then those across a corner.
const NEIGHBOURS: [[i64; 2]; 8] = [[-1, 0], [1, 0], [0, -1], [0, 1], [-1, -1], [1, -1], [-1, 1], [1, 1]];

/// Indices of the neighbours of a texel in the map.
fn neighbours(size: [u32; 2], texel: usize) -> impl Iterator<Item = usize> {
    let [width, height] = size.map(i64::from);
    let (x, y) = (texel as i64 % width, texel as i64 / width);
    NEIGHBOURS.into_iter().map(move |[dx, dy]| [x + dx, y + dy]).filter_map(move |[x, y]| {
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        inside.then_some((y * width + x) as usize)
    })
}

/// Fills texels in rings around those that are `filled` already, at most `rings` of them: a texel for which `takes` is
/// true of it and a filled neighbour takes what `of` makes of those neighbours, the first across an edge if there is one.
/// Returns the number of texels that were filled.
pub(super) fn grow(
    size: [u32; 2],
    filled: &mut [bool],
    rings: u32,
    takes: impl Fn(usize, usize) -> bool,
    mut fill: impl FnMut(usize, &[usize]),
) -> usize {
    let mut count = 0;
    // only texels beside the last ring can be in the next
    let mut last: Vec<usize> = (0..filled.len()).filter(|i| filled[*i]).collect();
    for _ in 0..rings {
        let mut ring: Vec<usize> = last.iter().flat_map(|i| neighbours(size, *i)).filter(|i| !filled[*i]).collect();
        ring.sort_unstable();
        ring.dedup();
        ring.retain(|texel| {
            let from: Vec<usize> =
                neighbours(size, *texel).filter(|other| filled[*other] && takes(*texel, *other)).collect();
            if !from.is_empty() {
                fill(*texel, &from);
            }
            !from.is_empty()
        });
        if ring.is_empty() {
            break;
        }
        ring.iter().for_each(|i| filled[*i] = true);
        count += ring.len();
        last = ring;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: rings that are too many or too few, one that spreads within itself, neighbours beyond the edge of the
    /// map or in the next row, texels that do not take and are filled.
    #[test]
    fn rings_are_squares_around_what_is_filled() {
        let size = [9, 7];
        for (seed, rings) in [(0, 1), (0, 3), (31, 2), (62, 20)] {
            let mut filled = vec![false; 63];
            filled[seed] = true;
            let mut from = vec![usize::MAX; 63];
            let count = grow(size, &mut filled, rings, |texel, _| texel != 40, |texel, f| from[texel] = f[0]);
            let at = |i: usize| [(i % 9) as i64, (i / 9) as i64];
            let far = |i: usize, k: usize| {
                let ([x, y], [u, v]) = (at(i), at(k));
                (x - u).abs().max((y - v).abs())
            };
            for i in 0..63 {
                let within = far(i, seed) <= i64::from(rings);
                assert_eq!(filled[i], within && i != 40, "{seed} {rings} {i}");
                if filled[i] && i != seed {
                    assert_eq!((far(i, from[i]), far(from[i], seed)), (1, far(i, seed) - 1));
                }
            }
            assert_eq!(count, filled.iter().filter(|f| **f).count() - 1);
        }
    }
}
