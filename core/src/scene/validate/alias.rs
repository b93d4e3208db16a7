//! Alias tables: what picking does against what the stated probabilities say.

use super::record::{Record, hash_of};
use crate::scene::blob::{Alias, SectionKind};
use crate::scene::error::{Field, SceneError};

/// Aliases are in range, thresholds and probabilities have their documented form. `first` is the place of `table` in
/// its section.
pub(super) fn well_formed(of: SectionKind, first: usize, table: &[Alias]) -> Result<(), SceneError> {
    for (i, a) in table.iter().enumerate() {
        let at = Record { of, index: first.saturating_add(i) };
        let always = a.threshold == u32::MAX;
        if a.alias as usize >= table.len() || (always && a.alias as usize != i) {
            return Err(at.wrong_reference(of, a.alias, table.len()));
        }
        at.within(Field::Probability, a.probability, 0.0, 1.0)?;
    }
    Ok(())
}

/// The thresholds of a well-formed table give the probabilities it states.
///
/// Adding up what the slots give to each item would need memory per item. Instead one random combination of the items'
/// relative errors is computed (Freivalds, "Probabilistic machines can use less running time", 1977): with weights h_i
/// in +-[1/2, 1],
///
///   sum_i h_i (p_i - w_i) / p_i  =  sum_i h_i - sum over slots j of (keep_j h_j / p_j + rest_j h_a(j) / p_a(j))
///
/// where w_i is the exact width of item i (numbers of 2^32 that pick it, over 2^32). Items within a relative 2^-20 of
/// their width pass always (n = 1) or beyond doubt (the sum of n independent terms stays below 4 sqrt(n) 2^-20); a
/// single item off by more than 16 sqrt(n) 2^-20 fails. Items of probability 0 must have no width at all.
pub(super) fn consistent(of: SectionKind, first: usize, table: &[Alias]) -> Result<(), SceneError> {
    const ALL: f64 = 4_294_967_296.0;
    const ALLOWED: f64 = 4.0 / 1_048_576.0;
    let n = table.len() as u64;
    let mut sum = 0.0f64;
    let mut start = 0u64;
    for (j, a) in (0u64..).zip(table) {
        // r picks slot j if j 2^32 <= r n < (j + 1) 2^32, and keeps it if r n < j 2^32 + threshold.
        let end = (j.saturating_add(1) << 32).div_ceil(n);
        let kept = if a.threshold == u32::MAX {
            end
        } else {
            (j << 32).saturating_add(u64::from(a.threshold)).div_ceil(n).min(end)
        };
        let keep = kept.saturating_sub(start) as f64 / ALL;
        let rest = end.saturating_sub(kept) as f64 / ALL;
        start = end;
        let other = table.get(a.alias as usize).map_or(0.0, |o| o.probability);
        for (item, share, p) in [(j, keep, a.probability), (u64::from(a.alias), rest, other)] {
            if share > 0.0 {
                if p == 0.0 {
                    let at = Record { of, index: first.saturating_add(usize::try_from(item).unwrap_or(0)) };
                    return Err(at.bad(Field::Probability, p));
                }
                sum -= weight(item) * share / f64::from(p);
            }
        }
        if a.probability > 0.0 {
            sum += weight(j);
        }
    }
    if sum * sum <= ALLOWED * ALLOWED * n as f64 {
        return Ok(());
    }
    let [first, length] = [first, table.len()].map(|x| u32::try_from(x).unwrap_or(u32::MAX));
    Err(SceneError::AliasTable { of, first, length, deviation: sum as f32 })
}

/// h_i: sign and size in [1/2, 1] from the hash of the item.
fn weight(item: u64) -> f64 {
    let bits = hash_of(item);
    // 2^31 values of [1/2, 1), sign from bit 0.
    let size = 0.5 + (bits >> 33) as f64 / 4_294_967_296.0;
    if bits & 1 == 0 { size } else { -size }
}
