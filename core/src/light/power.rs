//! Light choice by power.

use super::LightSelector;
use crate::scene::Scene;
use crate::scene::blob::Alias;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Power-weighted selection through the scene's alias table, the same for every reference point.
#[derive(Clone, Copy, Debug)]
pub struct PowerSelector<'s>(pub Scene<'s>);

impl LightSelector for PowerSelector<'_> {
    #[inline(always)]
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8) -> (U32x8, F32x8) {
        let r = r.to_array();
        let light = U32x8::from_fn(|i| pick(self.0.light_alias, r[i]));
        (light, self.probability(point, normal, light, Mask8::all_lanes()))
    }

    #[inline(always)]
    fn probability(&self, _point: Vec3x8, _normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8 {
        let light = light.to_array();
        mask.zero_unless(F32x8::from_fn(|i| probability(self.0.light_alias, light[i])))
    }
}

/// The item that the random number `r` picks; [`crate::scene::blob::NONE`] from an empty table.
#[inline(always)]
pub(super) fn pick(table: &[Alias], r: u32) -> u32 {
    let wide = u64::from(r) * table.len() as u64;
    let (slot, low) = ((wide >> 32) as u32, wide as u32);
    match table.get(slot as usize) {
        Some(a) if low < a.threshold || a.threshold == u32::MAX => slot,
        Some(a) => a.alias,
        None => crate::scene::blob::NONE,
    }
}

/// The probability of `item`; 0 outside the table.
#[inline(always)]
pub(super) fn probability(table: &[Alias], item: u32) -> f32 {
    table.get(item as usize).map_or(0.0, |a| a.probability)
}
