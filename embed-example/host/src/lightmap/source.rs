//! The texels of a map as camera samples of the core.

use super::texels::Texels;
use croupier::Scene;
use croupier::unstable::bsdf::NoBsdf;
use croupier::unstable::extension::{Extension, PixelSamples8, SourcePoints8};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use std::f32::consts::PI;

/// Largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Points of the covered parts of texels; pixels are the texels of the map. What a pixel's mean is of is irradiance.
#[derive(Clone, Copy)]
pub(super) struct TexelSource<'a>(pub &'a Texels);

impl TexelSource<'_> {
    /// Points of eight texels for two numbers in [0, 1) each.
    pub(super) fn points(&self, texel: [usize; 8], numbers: [[f32; 2]; 8], active: Mask8) -> SourcePoints8 {
        let (mut triangle, mut instance) = ([u32::MAX; 8], [u32::MAX; 8]);
        let mut weights = [[0.0; 8]; 2];
        let mut found = 0;
        for i in active.lanes() {
            let Some(s) = self.0.sample(texel[i], numbers[i]) else { continue };
            (triangle[i], instance[i]) = (s.triangle, s.instance);
            [weights[0][i], weights[1][i]] = s.weights;
            found |= 1 << i;
        }
        SourcePoints8 {
            triangle: U32x8::new(triangle),
            instance: [U32x8::new(instance), U32x8::splat(u32::MAX)],
            weights: weights.map(F32x8::new),
            scale: Vec3x8::splat(PI, PI, PI),
            active: active & Mask8::from_bits(found),
        }
    }
}

impl Extension for TexelSource<'_> {
    type Bsdf = NoBsdf;
    const POINTS: bool = true;

    fn points(&self, _: &Scene<'_>, s: &PixelSamples8) -> SourcePoints8 {
        let at = |i: usize| s.row.lane(i) as usize * self.0.size[0] as usize + s.column.lane(i) as usize;
        let within =
            |position: F32x8, texel: U32x8, i: usize| (position.lane(i) - texel.lane(i) as f32).clamp(0.0, BELOW_ONE);
        let numbers = |i| [within(s.position[0], s.column, i), within(s.position[1], s.row, i)];
        Self::points(self, std::array::from_fn(at), std::array::from_fn(numbers), s.active)
    }
}
