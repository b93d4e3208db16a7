//! Texels inside of other geometry.

use super::source::TexelSource;
use crate::sides::Sides;
use croupier::Scene;
use croupier::unstable::bsdf::warp::cosine_hemisphere;
use croupier::unstable::geometry::{Hit8, SurfaceHit8, offset};
use croupier::unstable::rng::Key8;
use croupier::unstable::simd::{F32x8, Frame8, Mask8, U32x8};
use rayon::prelude::*;

/// Key of the rays that look for backs: they have nothing to do with those that bring light.
const SEED: u64 = 0x7465_7865_6c73;

/// Rays of a texel, in packets of eight.
pub(super) const RAYS: u32 = 32;

/// For each texel the share of its rays that first meet the back of an opaque surface: cosine-weighted from the front of
/// its covered part, without scattering. 0 where nothing is covered.
pub(super) fn back_shares(scene: &Scene<'_>, opaque: &[bool], source: &TexelSource<'_>) -> Vec<f32> {
    let sides = Sides::new(scene, opaque);
    let share = |texel: usize| {
        if !source.0.is_covered(texel) {
            return 0.0;
        }
        let backs: u32 = (0..RAYS / 8).map(|packet| backs(scene, &sides, source, texel, packet)).sum();
        backs as f32 / RAYS as f32
    };
    (0..source.0.coverage.len()).into_par_iter().with_min_len(256).map(share).collect()
}

/// How many of eight rays of a texel meet a back.
fn backs(scene: &Scene<'_>, sides: &Sides<'_, '_>, source: &TexelSource<'_>, texel: usize, packet: u32) -> u32 {
    let sample = U32x8::from_fn(|i| 8 * packet + i as u32);
    let [x, y, u, v] = Key8::camera(SEED, U32x8::splat(texel as u32), sample).uniforms(0);
    let numbers = std::array::from_fn(|i| [x.lane(i), y.lane(i)]);
    let points = source.points([texel; 8], numbers, Mask8::all_lanes());
    let hit = Hit8 {
        hit: points.active,
        t: F32x8::ZERO,
        triangle: points.triangle,
        u: points.weights[0],
        v: points.weights[1],
        instance: points.instance,
    };
    let p = SurfaceHit8::gather(scene, &hit).place(scene, F32x8::ZERO);
    let d = Frame8::from_normal(p.ng).to_world(cosine_hemisphere(u, v));
    sides.backs(offset(p.p, p.ng, p.error, d), d, points.active).count()
}
