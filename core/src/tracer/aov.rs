//! Auxiliary values of pixels: what camera rays hit first, and the factors of roulette along the paths.

use super::book::Bookkeeping;
use super::path::Path8;
use croupier_simd::{F32x8, Mask8, Vec3x8};

impl Bookkeeping<'_> {
    /// Does the caller want auxiliary values?
    pub(super) fn wants_aovs(&self) -> bool {
        !self.aovs.is_empty()
    }

    /// Adds distance, shading normal and albedo of the first hits in the lanes of `first`.
    pub(super) fn record_first_hit(&mut self, first: Mask8, path: &Path8, t: F32x8, normal: Vec3x8, albedo: Vec3x8) {
        let root = path.root.to_array();
        // a host's intersector may answer anything
        let good = first & t.is_finite() & normal.is_finite() & albedo.is_finite();
        for i in first.and_not(good).lanes() {
            self.count_non_finite(root[i]);
        }
        for i in good.lanes() {
            let pixel = self.roots.get(root[i]).target.pixel as usize;
            let Some(aov) = self.aovs.get_mut(pixel) else { continue };
            let (albedo, normal) = (albedo.lane(i), normal.lane(i));
            for c in 0..3 {
                aov.albedo[c] += f64::from(albedo[c]);
                aov.normal[c] += f64::from(normal[c]);
            }
            aov.depth += f64::from(t.lane(i));
            aov.hits += 1.0;
        }
    }

    /// Adds the factors `s` of the vertices in the lanes of `active`.
    pub(super) fn record_factors(&mut self, active: Mask8, path: &Path8, s: F32x8) {
        if !self.wants_aovs() {
            return;
        }
        let (s, root, depth) = (s.to_array(), path.root.to_array(), path.depth.to_array());
        for i in active.lanes() {
            let pixel = self.roots.get(root[i]).target.pixel as usize;
            if let Some(aov) = self.aovs.get_mut(pixel) {
                let d = (depth[i].clamp(1, 4) - 1) as usize;
                aov.factor[d] += f64::from(s[i]);
                aov.vertices[d] += 1.0;
            }
        }
    }
}
