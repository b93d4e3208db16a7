//! Auxiliary values of pixels: what camera rays hit first, the factors of roulette along the paths, parts of the radiance.

use super::book::{Beyond, Bookkeeping};
use super::first_surfaces::FirstSurfaces8;
use super::path::Path8;
use crate::film::{Aov, AovSet};
use crate::scene::blob::NONE;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

impl Bookkeeping<'_> {
    /// Does the caller want to know of first hits?
    pub(super) fn wants_first_hits(&self) -> bool {
        self.aovs.layout.any(AovSet::FIRST_HITS)
    }

    /// Does the caller want their albedos?
    pub(super) fn wants_albedo(&self) -> bool {
        self.aovs.layout.first(Aov::Albedo).is_some()
    }

    /// Does the caller want to know what the surfaces are, and how they move?
    pub(super) fn wants_surfaces(&self) -> bool {
        self.aovs.layout.any(AovSet::SURFACES)
    }

    /// Does the caller want to know how they move?
    pub(super) fn wants_motion(&self) -> bool {
        self.aovs.layout.first(Aov::Motion).is_some()
    }

    /// Adds distance, shading normal and albedo of the first hits in the lanes of `first`; returns those whose numbers are
    /// finite.
    pub(super) fn record_first_hit(
        &mut self,
        first: Mask8,
        path: &Path8,
        t: F32x8,
        normal: Vec3x8,
        albedo: Vec3x8,
    ) -> Mask8 {
        let root = path.root.to_array();
        // a host's intersector may answer anything
        let good = first & t.is_finite() & normal.is_finite() & albedo.is_finite();
        for i in first.and_not(good).lanes() {
            self.count_non_finite(root[i]);
        }
        // what is written to each of eight planes, by lane
        let [a, n] = [albedo, normal];
        let rows = F32x8::transpose([a.x, a.y, a.z, n.x, n.y, n.z, t, F32x8::ONE]);
        if self.aovs.layout.all(AovSet::FIRST_EIGHT) {
            let (planes, values) = self.aovs.rows_mut();
            for i in good.lanes() {
                let pixel = self.roots.get(root[i]).target.pixel();
                if let Some(sums) = values.get_mut(pixel * planes..).and_then(|row| row.first_chunk_mut::<8>()) {
                    *sums = (F32x8::new(*sums) + rows[i]).to_array();
                }
            }
        } else {
            self.add_some_of_eight(good, &root, &rows);
        }
        good
    }

    /// Adds those of the eight values of [`AovSet::FIRST_EIGHT`] that are asked for.
    #[cold]
    fn add_some_of_eight(&mut self, good: Mask8, root: &[u32; 8], rows: &[F32x8; 8]) {
        for i in good.lanes() {
            let pixel = self.roots.get(root[i]).target.pixel();
            let [ax, ay, az, nx, ny, nz, t, one] = rows[i].to_array();
            self.aovs.add(pixel, Aov::Albedo, [ax, ay, az]);
            self.aovs.add(pixel, Aov::Normal, [nx, ny, nz]);
            self.aovs.add(pixel, Aov::Depth, [t]);
            self.aovs.add(pixel, Aov::Alpha, [one]);
        }
    }

    /// Adds what the surfaces of first hits are: indices of the first camera samples of pixels, coverage and motion of all.
    #[cold]
    pub(super) fn record_surfaces(&mut self, good: Mask8, path: &Path8, found: &FirstSurfaces8) {
        for i in good.lanes() {
            let target = self.roots.get(path.root.lane(i)).target;
            let pixel = target.pixel();
            let of_surface = [
                (Aov::Material, Aov::MaterialCoverage, found.material.lane(i)),
                (Aov::Object, Aov::ObjectCoverage, found.object.lane(i)),
            ];
            for (first, coverage, index) in of_surface.into_iter().filter(|s| s.2 != NONE) {
                self.aovs.cover(pixel, coverage, index as f32);
                if target.is_first()
                    && let Some(known) = self.aovs.get(pixel, first, 0)
                {
                    *known = index as f32;
                }
            }
            self.aovs.add(pixel, Aov::Motion, found.motion.map(|x| x.lane(i)));
        }
    }

    /// Adds the factors `s` of the vertices in the lanes of `active`.
    #[inline(always)]
    pub(super) fn record_factors(&mut self, active: Mask8, path: &Path8, s: F32x8) {
        if let Some(first) = self.aovs.layout.first(Aov::Factors) {
            self.add_factors(first, active, path, s);
        }
    }

    /// [`Self::record_factors`], plane `first` being the first of the eight.
    #[inline(never)]
    fn add_factors(&mut self, first: usize, active: Mask8, path: &Path8, s: F32x8) {
        // plane of the factor among the eight
        let plane = U32x8::select(path.depth.lt(U32x8::splat(4)), path.depth - U32x8::splat(1), U32x8::splat(3));
        let (s, root, plane) = (s.to_array(), path.root.to_array(), plane.to_array());
        let (planes, values) = self.aovs.rows_mut();
        let Some(values) = values.get_mut(first..) else { return };
        // so few planes that the compiler knows of no overflow below
        let planes = planes & 0xff;
        for i in active.lanes() {
            let at = self.roots.get(root[i]).target.pixel() * planes;
            if let Some(sums) = values.get_mut(at..at + 8).and_then(|row| row.first_chunk_mut::<8>()) {
                let d = plane[i] as usize & 3;
                sums[d] += s[i];
                sums[4 + d] += 1.0;
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
