//! Records of eight lanes, word by word: each record is loaded in whole rows of eight words, and eight rows are
//! transposed. A word at a time would take five times as many instructions.

use bytemuck::Pod;
use core::array;
use croupier_simd::F32x8;

/// Words of the records that eight lanes refer to: word `c` of row `r` is `[r][c]`, with the bits of what it holds. Lanes
/// whose index is out of range have the words of `none`. `R` is a record of `ROWS` rows of eight words; what is not read
/// of the result costs next to nothing.
#[inline(always)]
#[expect(clippy::indexing_slicing, reason = "lanes and rows are below the lengths of their arrays")]
pub(crate) fn gather<R: Pod, const ROWS: usize>(records: &[R], index: [u32; 8], none: &R) -> [[F32x8; 8]; ROWS]
where
    [[f32; 8]; ROWS]: Pod,
{
    let row = |lane: usize| -> &[[f32; 8]; ROWS] {
        bytemuck::cast_ref(records.get(index[lane & 7] as usize).unwrap_or(none))
    };
    // written out: `array::map` would go through memory
    let rows = [row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7)];
    array::from_fn(|r| {
        let of = |lane: usize| F32x8::new(rows[lane][r]);
        F32x8::transpose([of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a lane or a word in the place of another, an index that is trusted.
    #[test]
    #[expect(clippy::indexing_slicing, reason = "words are below the lengths of their arrays")]
    fn each_lane_has_the_words_of_its_record() {
        let records: [[u32; 16]; 5] = array::from_fn(|i| array::from_fn(|k| 0x7f80_0001 + (100 * i + k) as u32));
        let index = [3, 0, 4, 5, u32::MAX, 1, 2, 3];
        let found: [[F32x8; 8]; 2] = gather(&records, index, &[7; 16]);
        for (lane, i) in index.into_iter().enumerate() {
            for k in 0..16 {
                let wanted = records.get(i as usize).map_or(7, |r| r[k]);
                assert_eq!(found[k / 8][k % 8].to_bits().lane(lane), wanted, "lane {lane}, word {k}");
            }
        }
    }
}
