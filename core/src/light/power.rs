//! Light choice by power.

use super::LightSelector;
use crate::scene::Scene;
use crate::scene::blob::{Alias, NONE};
use croupier_simd::{F32x8, LUMINANCE, Mask8, U32x8, Vec3x8};

/// Rec. 709 luminance of linear RGB; negative channels and NaN count as 0.
pub fn luminance(rgb: [f32; 3]) -> f64 {
    let [r, g, b] = rgb.map(|x| f64::from(x.max(0.0)));
    LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b
}

/// Facts about the scene on which the powers of its lights depend.
#[derive(Clone, Copy, Debug)]
pub struct SceneExtent {
    /// Radius of a sphere around the scene, world units.
    pub radius: f64,
    /// Integral of the environment's luminance over all directions, luminance x sr; 0 without an environment.
    pub environment: f64,
}

/// Power-weighted selection through the scene's alias table, the same for every reference point.
#[derive(Clone, Copy, Debug)]
pub struct PowerSelector<'s>(pub Scene<'s>);

impl LightSelector for PowerSelector<'_> {
    #[inline(always)]
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8, mask: Mask8) -> (U32x8, F32x8) {
        let table = self.0.light_alias;
        let light = pick(table, U32x8::splat(0), table.len() as u32, r);
        (light, self.probability(point, normal, light, mask))
    }

    #[inline(always)]
    fn probability(&self, _point: Vec3x8, _normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8 {
        let light = light.to_array();
        mask.zero_unless(F32x8::from_fn(|i| probability(self.0.light_alias, light[i])))
    }
}

/// The items that the random numbers `r` pick from tables of `len` entries that start at `start` of `tables`, a table
/// per lane; [`NONE`] where there is no such entry. No branch depends on what is loaded: entries of large tables come
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a weight that one of the two has and the other has not.
    #[test]
    fn luminance_has_the_weights_of_the_kernels() {
        for rgb in [[1.0f32, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            let kernel = Vec3x8::splat(rgb[0], rgb[1], rgb[2]).luminance().lane(0);
            assert_eq!(luminance(rgb) as f32, kernel);
        }
        assert_eq!(luminance([-1.0, f32::NAN, 0.0]), 0.0);
    }
}
