//! Compensation of the energy that rough models lose because light that a microfacet scatters onto another one is not
//! followed ([`MATERIAL_COMPENSATED`]): single scattering, scaled up so that nothing is lost where nothing is absorbed.
//! Lobes, densities and samples stay those of single scattering; values and weights change by one factor.
//!
//! | model | factor | furnace | reciprocal |
//! |---|---|---|---|
//! | conductor, coat of a plastic | `m / (F + m (1 - F))` with `m = s(wo) s(wi)` | 1 for F = 1 | yes |
//! | dielectric | `1 / E(wo)`, E of the side of `wo` (Turquin 2019, section 3) | 1 | no |
//!
//! s solves `s(wo) x (integral of f cos s(wi)) = 1` for F = 1 (symmetric scaling, Sinkhorn & Knopp 1967). It keeps the
//! shape of the lobe like Turquin's factor 1 / E(wo), and swapping directions changes nothing, as with the additive lobe
//! of Kulla & Conty 2017, which needs a sampling technique of its own. s^2 is between 1 and 4. F below 1 attenuates each
//! further scattering: with m in place of 1 / E, the factor is the sum of the series `F E (1 + F (1 - E) + ...)` that
//! Kulla & Conty use, with the F of the half vector.
//!
//! For dielectrics symmetric scaling exists as well, but both sides lose different shares, and what transmission cannot
//! balance it takes from reflection: at eta 1.5 and alpha 1 a tenth of single scattering would be left of it. Turquin's
//! factor is never below 1, and as eta approaches 1 the interface vanishes as it should.
//!
//! Tables have [`COMPENSATION_ENTRIES`] numbers, equally spaced in `x(mu) = mu / 2 (1 + (1 + alpha) / (mu + alpha))`,
//! which resolves grazing angles below alpha as well as the angles around a critical one. `compose/compensation.rs`
//! computes them; interpolated linearly they are within 5e-4 of a white furnace for conductors, and within 5e-3 for
//! dielectrics (tests `tests/tests/bsdf_compensation.rs`).

use super::Materials8;
use super::ggx::Ggx8;
use crate::scene::Scene;
use crate::scene::blob::{COMPENSATION_ENTRIES, MATERIAL_COMPENSATED};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Tables of eight materials; `PRESENT` is whether the kernel profile has the effect.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compensation8<'s, const PRESENT: bool> {
    /// Lanes whose material is compensated.
    lanes: Mask8,
    tables: &'s [f32],
    /// First entries, 0 in all lanes if no lane is compensated.
    first: U32x8,
}

impl<'s, const PRESENT: bool> Compensation8<'s, PRESENT> {
    /// Tables that begin `offset` entries behind the start of each material's.
    #[inline(always)]
    pub(super) fn gather(scene: &Scene<'s>, m: &Materials8<'_>, offset: u32) -> Self {
        let mut compensated = Self { lanes: Mask8::NONE, tables: scene.tables, first: U32x8::splat(0) };
        let any = PRESENT && m.0.iter().fold(0, |flags, m| flags | m.flags) & MATERIAL_COMPENSATED != 0;
        if any {
            let flagged = |i: usize| u32::from(m.0[i].flags & MATERIAL_COMPENSATED != 0) << i;
            compensated.lanes = Mask8::from_bits((0..8).fold(0, |bits, i| bits | flagged(i)));
            compensated.first = U32x8::from_fn(|i| m.0[i].table.wrapping_add(offset));
        }
        compensated
    }

    /// Entry of each lane's table at the cosine `mu`, `skip` entries further on.
    #[inline(always)]
    fn at(&self, ggx: &Ggx8, mu: F32x8, skip: U32x8) -> F32x8 {
        let (mu, alpha) = (mu.clamp(0.0, 1.0), ggx.alpha());
        let x = mu * 0.5 * ((1.0 + alpha) / (mu + alpha) + 1.0);
        let last = (COMPENSATION_ENTRIES - 1) as f32;
        let x = x.clamp(0.0, 1.0) * last;
        let cell = x.floor().min(F32x8::splat(last - 1.0));
        let (i, start) = (cell.to_i32().to_array(), (self.first + skip).to_array());
        let entry = |lane: usize, step: usize| {
            let at = (start[lane] as usize).wrapping_add(i[lane] as usize).wrapping_add(step);
            self.tables.get(at).copied().unwrap_or(1.0)
        };
        let (a, b) = (F32x8::from_fn(|l| entry(l, 0)), F32x8::from_fn(|l| entry(l, 1)));
        a + (x - cell) * (b - a)
    }

    /// s(wo) s(wi).
    #[inline(always)]
    fn product(&self, ggx: &Ggx8, wo: Vec3x8, wi: Vec3x8) -> F32x8 {
        let from_start = U32x8::splat(0);
        self.at(ggx, wo.z, from_start) * self.at(ggx, wi.z, from_start)
    }

    /// Fresnel reflectance `f` of a reflection wo -> wi, times the factor of conductors in the lanes that have one.
    #[inline(always)]
    pub(super) fn reflectance(&self, f: Vec3x8, ggx: &Ggx8, wo: Vec3x8, wi: Vec3x8) -> Vec3x8 {
        if !PRESENT || self.lanes.none() {
            return f;
        }
        let m = self.product(ggx, wo, wi);
        Vec3x8::select(self.lanes, f.map(|f| f * m / (m * (1.0 - f) + f)), f)
    }

    /// [`Self::reflectance`] of one channel.
    #[inline(always)]
    pub(super) fn grey_reflectance(&self, f: F32x8, ggx: &Ggx8, wo: Vec3x8, wi: Vec3x8) -> F32x8 {
        if !PRESENT || self.lanes.none() {
            return f;
        }
        let m = self.product(ggx, wo, wi);
        self.lanes.select(f * m / (m * (1.0 - f) + f), f)
    }

    /// Value `f` of a dielectric seen at the cosine `mu`, from behind where `below`, over the energy scattered by that
    /// side in the lanes that have it.
    #[inline(always)]
    pub(super) fn over_energy(&self, f: F32x8, ggx: &Ggx8, mu: F32x8, below: Mask8) -> F32x8 {
        if !PRESENT || self.lanes.none() {
            return f;
        }
        let behind = U32x8::from_fn(|i| if below.lane(i) { COMPENSATION_ENTRIES as u32 } else { 0 });
        self.lanes.select(f / self.at(ggx, mu, behind), f)
    }
}
