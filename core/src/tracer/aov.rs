//! Auxiliary values of pixels: what camera rays hit first, the factors of roulette along the paths, parts of the radiance.

use super::book::{Beyond, Bookkeeping};
use super::path::Path8;
use crate::film::{Aov, AovSet};
use croupier_simd::{F32x8, Mask8, Vec3x8};

impl Bookkeeping<'_> {
    /// Does the caller want to know of first hits?
    pub(super) fn wants_first_hits(&self) -> bool {
        self.aovs.layout.any(AovSet::FIRST_HITS)
    }

    /// Does the caller want their albedos?
    pub(super) fn wants_albedo(&self) -> bool {
        self.aovs.layout.first(Aov::Albedo).is_some()
    }

    /// Adds distance, shading normal, albedo and material of the first hits in the lanes of `first`. Objects are to be
    /// recorded here too, beside the material, when hits tell them.
    pub(super) fn record_first_hit(
        &mut self,
        first: Mask8,
        path: &Path8,
        t: F32x8,
        normal: Vec3x8,
        albedo: Vec3x8,
        material: &[u32; 8],
    ) {
        let root = path.root.to_array();
        // a host's intersector may answer anything
        let good = first & t.is_finite() & normal.is_finite() & albedo.is_finite();
        for i in first.and_not(good).lanes() {
            self.count_non_finite(root[i]);
        }
        // what is not asked for lies beyond every row
        let first_of = |aov| self.aovs.layout.first(aov).unwrap_or(usize::MAX);
        let [a, n, d, h, m] = [
            first_of(Aov::Albedo),
            first_of(Aov::Normal),
            first_of(Aov::Depth),
            first_of(Aov::Alpha),
            first_of(Aov::Material),
        ];
        let [albedo, normal] = [albedo, normal].map(|v| [v.x.to_array(), v.y.to_array(), v.z.to_array()]);
        let t = t.to_array();
        for i in good.lanes() {
            let target = self.roots.get(root[i]).target;
            let row = self.aovs.row_mut(target.pixel());
            for (first, x) in [(a, &albedo), (n, &normal)] {
                if let Some(sums) = row.get_mut(first..).and_then(|r| r.first_chunk_mut::<3>()) {
                    *sums = [sums[0] + x[0][i], sums[1] + x[1][i], sums[2] + x[2][i]];
                }
            }
            for (first, x) in [(d, t[i]), (h, 1.0)] {
                if let Some(sum) = row.get_mut(first) {
                    *sum += x;
                }
            }
            if target.is_first()
                && let Some(id) = row.get_mut(m)
            {
                *id = material[i] as i32 as f32;
            }
        }
    }

    /// Adds the factors `s` of the vertices in the lanes of `active`.
    pub(super) fn record_factors(&mut self, active: Mask8, path: &Path8, s: F32x8) {
        let Some(first) = self.aovs.layout.first(Aov::Factors) else { return };
        let (s, root, depth) = (s.to_array(), path.root.to_array(), path.depth.to_array());
        for i in active.lanes() {
            let pixel = self.roots.get(root[i]).target.pixel();
            let d = first + (depth[i].clamp(1, 4) - 1) as usize;
            let row = self.aovs.row_mut(pixel);
            for (plane, x) in [(d, s[i]), (4 + d, 1.0)] {
                if let Some(sum) = row.get_mut(plane) {
                    *sum += x;
                }
            }
        }
    }

    /// Adds radiance to the part of the picture that it belongs to, by how often the light scattered. What a control
    /// variate adds is 0 on average, and counts as indirect.
    #[cold]
    pub(super) fn record_light(&mut self, good: Mask8, path: &Path8, radiance: Vec3x8, beyond: Beyond) {
        let (root, depth) = (path.root.to_array(), path.depth.to_array());
        for i in good.lanes() {
            let pixel = self.roots.get(root[i]).target.pixel();
            let aov = match (beyond, depth[i]) {
                (Beyond::Ray, 0..=1) => Aov::Emission,
                (Beyond::Ray, 2) | (Beyond::ShadowRay, 0..=1) => Aov::Direct,
                _ => Aov::Indirect,
            };
            self.aovs.add(pixel, aov, radiance.lane(i));
        }
    }
}
