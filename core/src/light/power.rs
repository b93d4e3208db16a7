//! Light choice by power.

use super::LightSelector;
use crate::scene::Scene;
use crate::scene::blob::{Alias, NONE};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Power-weighted selection through the scene's alias table, the same for every reference point.
#[derive(Clone, Copy, Debug)]
pub struct PowerSelector<'s>(pub Scene<'s>);

impl LightSelector for PowerSelector<'_> {
    #[inline(always)]
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8) -> (U32x8, F32x8) {
        let table = self.0.light_alias;
        let light = pick(table, U32x8::splat(0), table.len() as u32, r);
        (light, self.probability(point, normal, light, Mask8::all_lanes()))
    }

    #[inline(always)]
    fn probability(&self, _point: Vec3x8, _normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8 {
        let light = light.to_array();
        mask.zero_unless(F32x8::from_fn(|i| probability(self.0.light_alias, light[i])))
    }
}

/// The items that the random numbers `r` pick from tables of `len` entries that start at `start` of `tables`, a table
/// per lane; [`NONE`] where there is no such entry. No branch hangs on what is loaded: entries of large tables come
/// from memory, and eight loads that wait for each other take much longer than eight at a time.
#[inline(always)]
pub(super) fn pick(tables: &[Alias], start: U32x8, len: u32, r: U32x8) -> U32x8 {
    let (start, r) = (start.to_array(), r.to_array());
    let (mut slot, mut rest, mut threshold, mut alias) = ([0; 8], [0; 8], [0; 8], [NONE; 8]);
    for i in 0..8 {
        let wide = u64::from(r[i]) * u64::from(len);
        (slot[i], rest[i]) = ((wide >> 32) as u32, wide as u32);
        if let Some(a) = tables.get(start[i] as usize + slot[i] as usize) {
            (threshold[i], alias[i]) = (a.threshold, a.alias);
        }
    }
    let threshold = U32x8::new(threshold);
    let keep = U32x8::new(rest).lt(threshold) | threshold.eq(U32x8::splat(u32::MAX));
    U32x8::select(keep, U32x8::new(slot), U32x8::new(alias))
}

/// The probability of `item`; 0 outside the table.
#[inline(always)]
pub(super) fn probability(table: &[Alias], item: u32) -> f32 {
    table.get(item as usize).map_or(0.0, |a| a.probability)
}
