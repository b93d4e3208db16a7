//! The media of eight lanes.

use crate::scene::Scene;
use crate::scene::blob::{Medium, MediumKind};
use bytemuck::Zeroable;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Extinction below this counts as none where distances are drawn: its inverse would overflow. Nothing is that long.
const MIN_SIGMA: f32 = 1e-36;

/// Coefficients per unit length at density 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Media8 {
    /// Absorption.
    pub(super) sigma_a: Vec3x8,
    /// Scattering.
    pub(super) sigma_s: Vec3x8,
    /// Extinction, the sum.
    pub(super) sigma_t: Vec3x8,
    /// Emitted radiance.
    pub(super) emission: Vec3x8,
    /// Lanes with a density grid.
    pub(super) grid: Mask8,
}

impl Media8 {
    /// Media of the lanes in `active`; others, and indices out of range, are clear.
    #[inline(always)]
    pub(super) fn gather(scene: &Scene<'_>, medium: U32x8, active: Mask8) -> Self {
        let clear = Medium::zeroed();
        let (index, bits) = (medium.to_array(), active.bits());
        let of = |i: usize| {
            let m = if bits >> i & 1 == 1 { scene.media.get(index[i] as usize) } else { None };
            m.unwrap_or(&clear)
        };
        let media = [of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)];
        let sigma_a = Vec3x8::from_fn(|i| media[i & 7].sigma_a);
        let sigma_s = Vec3x8::from_fn(|i| media[i & 7].sigma_s);
        Self {
            sigma_a,
            sigma_s,
            sigma_t: sigma_a + sigma_s,
            emission: Vec3x8::from_fn(|i| media[i & 7].emission),
            grid: U32x8::from_fn(|i| media[i & 7].kind).eq(U32x8::splat(MediumKind::Grid as u32)) & active,
        }
    }

    /// Largest extinction coefficient of the channels in which `alive` is above 0; 0 below [`MIN_SIGMA`].
    #[inline(always)]
    pub(super) fn largest(&self, alive: Vec3x8) -> F32x8 {
        let of = |alive: F32x8, sigma: F32x8| alive.gt(F32x8::ZERO).zero_unless(sigma);
        let t = self.sigma_t;
        let largest = Vec3x8::new(of(alive.x, t.x), of(alive.y, t.y), of(alive.z, t.z)).max_component();
        largest.gt(F32x8::splat(MIN_SIGMA)).zero_unless(largest)
    }
}
