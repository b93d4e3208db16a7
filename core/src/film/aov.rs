//! Auxiliary values of pixels ("AOVs"): which there are, and planes of those that were asked for.

use super::coverage::{self, NO_INDEX, RANKS};
use crate::bits::bit_set;
use crate::names::names;
use bytemuck::{Pod, Zeroable};
use core::fmt;

/// An auxiliary value of pixels. Where nothing else is said, planes hold means over the camera samples of a pixel, those
/// that missed everything counted as 0; divide by [`Aov::Alpha`] for means over the samples that hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Aov {
    /// Albedo of the first hit, rgb, seen from the camera, as roulette uses it: reflected and transmitted, 1 for clear
    /// glass.
    Albedo,
    /// Shading normal of the first hit, xyz, world space; shorter than 1 where normals differ within the pixel.
    Normal,
    /// Distance to the first hit, world units.
    Depth,
    /// Share of the camera samples that met a surface or scattered in a medium (coverage), 0 to 1.
    Alpha,
    /// Sum of the factors of roulette at vertices of depth 1, 2, 3 and above, and number of these vertices: eight planes.
    Factors,
    /// Number of paths: the camera sample and what splitting added.
    Paths,
    /// Number of rays of all kinds. It has no plane but is part of the pixels' statistics
    /// ([`PixelStats::rays`](super::PixelStats::rays)), which are sums.
    Cost,
    /// Radiance of what is seen directly: emitters and environment, rgb. Emission, direct and indirect light add up to the
    /// picture, but for rounding in `f32`; in adaptive renders they are weighted means like it.
    Emission,
    /// Radiance of light that scattered once, rgb.
    Direct,
    /// Radiance of light that scattered more often, rgb.
    Indirect,
    /// Index of the first hit's material, of the first camera sample of the pixel in its first iteration; -1 where
    /// that sample met no surface. Exact below 2^24.
    Material,
    /// Index of the first hit's object ([`Scene::object_of`](crate::Scene::object_of)), of the same sample as
    /// [`Self::Material`]; -1 where it met no surface. Exact below 2^24. [`Scene::object_name`](crate::Scene::object_name)
    /// has the names.
    Object,
    /// The two materials that cover most of the pixel: index and share of the camera samples, largest share first; index -1
    /// and share 0 where there is none. Shares of pixels in which samples meet two materials are exact, of others they may
    /// be too small, as an iteration counts the two that it meets first.
    MaterialCoverage,
    /// The two objects that cover most of the pixel, likewise.
    ObjectCoverage,
    /// Motion of the first hit across the image while the shutter is open, xy: where the surface point is seen when it closes
    /// less where it is seen when it opens, in pixels, x to the right and y down. 0 of what does not move, of scattering in
    /// media, of surfaces of the host's own ([`Intersector`](crate::unstable::accel::Intersector)), and of points that are
    /// behind the camera at either time. The camera is the scene's, which does not move; its lens counts as a pinhole.
    Motion,
}

names!(Aov: Albedo = "albedo", Normal = "normal", Depth = "depth", Alpha = "alpha", Factors = "factors",
    Paths = "paths", Cost = "cost", Emission = "emission", Direct = "direct", Indirect = "indirect",
    Material = "material", Object = "object", MaterialCoverage = "material_coverage",
    ObjectCoverage = "object_coverage", Motion = "motion");

impl Aov {
    /// All of them.
    pub const ALL: [Self; 15] = [
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::Alpha,
        Self::Factors,
        Self::Paths,
        Self::Cost,
        Self::Emission,
        Self::Direct,
        Self::Indirect,
        Self::Material,
        Self::Object,
        Self::MaterialCoverage,
        Self::ObjectCoverage,
        Self::Motion,
    ];

    /// Names of the planes, as usual in EXR files.
    pub const fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo | Self::Emission | Self::Direct | Self::Indirect => &["R", "G", "B"],
            Self::Normal => &["X", "Y", "Z"],
            Self::Depth => &["Z"],
            Self::Alpha => &["A"],
            Self::Factors => &["S1", "S2", "S3", "S4", "N1", "N2", "N3", "N4"],
            Self::Paths => &["N"],
            Self::Cost => &[],
            Self::Material | Self::Object => &["id"],
            Self::MaterialCoverage | Self::ObjectCoverage => &["id1", "coverage1", "id2", "coverage2"],
            Self::Motion => &["X", "Y"],
        }
    }

    /// Channels that hold indices, one bit each.
    const fn indices(self) -> u64 {
        match self {
            Self::Material | Self::Object => 1,
            Self::MaterialCoverage | Self::ObjectCoverage => 0b101,
            _ => 0,
        }
    }
}

/// Set of auxiliary values. As text it is a list of their names with commas between, `true` for [`Self::STANDARD`] or
/// `false` for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AovSet(u32);

bit_set!(AovSet);

impl AovSet {
    /// None.
    pub const NONE: Self = Self(0);
    /// Albedo, normal, depth and alpha of the first hits, factors of roulette, paths and cost.
    pub const STANDARD: Self = Self((1 << (Aov::Cost as u32 + 1)) - 1);
    /// What is known of first hits.
    pub(crate) const FIRST_HITS: Self = Self::FIRST_EIGHT.with(Self::SURFACES);
    /// What surfaces are and how they move.
    pub(crate) const SURFACES: Self = Self::of(&[Aov::Material, Aov::Object, Aov::Motion]).with(Self::COVERAGE);
    /// Coverage by index.
    const COVERAGE: Self = Self::of(&[Aov::MaterialCoverage, Aov::ObjectCoverage]);
    /// Those of first hits that are the first planes if a set has all of them, eight in a row.
    pub(crate) const FIRST_EIGHT: Self = Self::of(&[Aov::Albedo, Aov::Normal, Aov::Depth, Aov::Alpha]);
    /// Parts of the radiance.
    pub(crate) const LIGHT: Self = Self::of(&[Aov::Emission, Aov::Direct, Aov::Indirect]);

    /// One bit for each, by its number.
    pub(crate) const fn bits(self) -> u32 {
        self.0
    }

    /// The set of these.
    pub const fn of(aovs: &[Aov]) -> Self {
        let (mut set, mut i) = (0, 0);
        while i < aovs.len() {
            set |= 1 << aovs[i] as u32;
            i += 1;
        }
        Self(set)
    }

    /// Is this one in the set?
    pub const fn has(self, aov: Aov) -> bool {
        self.0 >> aov as u32 & 1 != 0
    }

    /// Set of the text; `None` for a name that is none.
    pub(crate) fn from_text(text: &str) -> Option<Self> {
        match text {
            "true" => Some(Self::STANDARD),
            "false" => Some(Self::NONE),
            _ => text.split(',').try_fold(Self::NONE, |set, name| Some(set.with(Self::of(&[Aov::from_name(name)?])))),
        }
    }
}

impl From<bool> for AovSet {
    fn from(standard: bool) -> Self {
        if standard { Self::STANDARD } else { Self::NONE }
    }
}

impl fmt::Display for AovSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NONE => f.write_str("false"),
            Self::STANDARD => f.write_str("true"),
            _ => {
                let mut names = Aov::ALL.iter().filter(|a| self.has(**a)).enumerate();
                names.try_for_each(|(i, a)| write!(f, "{}{}", if i == 0 { "" } else { "," }, a.name()))
            }
        }
    }
}

/// Where the planes of a set are among all of its planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AovLayout {
    set: AovSet,
    first: [usize; Aov::ALL.len()],
    /// Number of planes.
    pub planes: usize,
    /// Planes of indices, one bit each.
    ids: u64,
    /// Planes that hold no means, one bit each.
    kept: u64,
}

impl AovLayout {
    pub(crate) fn new(set: AovSet) -> Self {
        let mut layout = Self { set, first: [0; Aov::ALL.len()], planes: 0, ids: 0, kept: 0 };
        for (aov, first) in Aov::ALL.into_iter().zip(&mut layout.first) {
            *first = layout.planes;
            if set.has(aov) {
                let of_coverage = if AovSet::COVERAGE.has(aov) { 0b1111 } else { 0 };
                layout.ids |= aov.indices() << layout.planes;
                layout.kept |= (aov.indices() | of_coverage) << layout.planes;
                layout.planes += aov.channels().len();
            }
        }
        layout
    }

    /// Number of the first plane, if the set has any.
    #[inline(always)]
    pub(crate) fn first(&self, aov: Aov) -> Option<usize> {
        if self.set.has(aov) { self.first.get(aov as usize).copied() } else { None }
    }

    /// Is anything of `other` in the set?
    #[inline(always)]
    pub(crate) fn any(&self, other: AovSet) -> bool {
        self.set.intersects(other)
    }

    /// Is all of `other` in the set?
    #[inline(always)]
    pub(crate) fn all(&self, other: AovSet) -> bool {
        self.set.contains(other)
    }

    #[inline(always)]
    fn is_id(&self, plane: usize) -> bool {
        self.ids >> plane & 1 != 0
    }

    /// Does the plane hold something else than means?
    #[inline(always)]
    fn is_kept(&self, plane: usize) -> bool {
        self.kept >> plane & 1 != 0
    }
}

/// Sums of one iteration, one row of values per pixel of a shard.
#[derive(Debug)]
pub(crate) struct AovSums<'m> {
    pub layout: AovLayout,
    values: &'m mut [f32],
}

impl<'m> AovSums<'m> {
    pub(crate) fn new(layout: AovLayout, values: &'m mut [f32]) -> Self {
        Self { layout, values }
    }

    /// All values.
    pub(crate) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self.values)
    }

    /// All values, to be changed.
    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(self.values)
    }

    /// Values of a pixel; none if there are none.
    #[inline]
    pub(crate) fn row(&self, pixel: usize) -> &[f32] {
        let n = self.layout.planes;
        self.values.get(pixel * n..pixel * n + n).unwrap_or(&[])
    }

    /// Values of a pixel, to be changed.
    #[inline]
    pub(crate) fn row_mut(&mut self, pixel: usize) -> &mut [f32] {
        let n = self.layout.planes;
        self.values.get_mut(pixel * n..pixel * n + n).unwrap_or(&mut [])
    }

    /// Number of values of a pixel, and all values.
    #[inline(always)]
    pub(crate) fn rows_mut(&mut self) -> (usize, &mut [f32]) {
        (self.layout.planes, self.values)
    }

    /// Empties a pixel.
    #[inline]
    pub(crate) fn clear(&mut self, pixel: usize) {
        let layout = self.layout;
        let row = self.row_mut(pixel);
        row.fill(0.0);
        if layout.ids != 0 {
            row.iter_mut().enumerate().filter(|(plane, _)| layout.is_id(*plane)).for_each(|(_, x)| *x = NO_INDEX);
        }
    }

    /// Counts a sample of `index` towards the coverage of a pixel.
    pub(crate) fn cover(&mut self, pixel: usize, aov: Aov, index: f32) {
        if let Some(first) = self.layout.first(aov)
            && let Some(row) = self.row_mut(pixel).get_mut(first..)
        {
            coverage::count(row, index);
        }
    }

    /// Value `channel` of one of the pixel's auxiliary values, if it is wanted.
    #[inline]
    pub(crate) fn get(&mut self, pixel: usize, aov: Aov, channel: usize) -> Option<&mut f32> {
        let plane = self.layout.first(aov)? + channel;
        self.values.get_mut(pixel * self.layout.planes + plane)
    }

    /// Adds to it.
    #[inline]
    pub(crate) fn add<const N: usize>(&mut self, pixel: usize, aov: Aov, x: [f32; N]) {
        for (channel, x) in x.into_iter().enumerate() {
            if let Some(sum) = self.get(pixel, aov, channel) {
                *sum += x;
            }
        }
    }
}

/// Planes of all pixels, row by row.
#[derive(Debug)]
pub(crate) struct AovPlanes<'m> {
    layout: AovLayout,
    pixels: usize,
    values: &'m mut [f32],
}

impl<'m> AovPlanes<'m> {
    pub(crate) fn new(layout: AovLayout, pixels: usize, values: &'m mut [f32]) -> Self {
        Self { layout, pixels, values }
    }

    /// Plane `channel` of an auxiliary value.
    pub(crate) fn plane(&self, aov: Aov, channel: usize) -> Option<&[f32]> {
        let plane = self.layout.first(aov).filter(|_| channel < aov.channels().len())? + channel;
        self.values.get(plane * self.pixels..(plane + 1) * self.pixels)
    }

    /// Value of a pixel, 0 where there is none.
    fn value(&self, aov: Aov, channel: usize, pixel: usize) -> f64 {
        self.plane(aov, channel).and_then(|p| p.get(pixel)).map_or(0.0, |x| f64::from(*x))
    }

    /// Number of planes.
    pub(crate) fn planes(&self) -> usize {
        self.layout.planes
    }

    /// Does the plane hold indices?
    pub(crate) fn is_index(&self, plane: usize) -> bool {
        self.layout.is_id(plane)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.layout.set == AovSet::NONE
    }

    /// Adds the sums of `more` samples to the means over `before` samples of a pixel.
    pub(crate) fn merge(&mut self, pixel: usize, before: u32, more: u32, sums: &[f32]) {
        let (more, total) = (f64::from(more), f64::from(before) + f64::from(more));
        let means = self.values.get_mut(pixel..).unwrap_or(&mut []).iter_mut().step_by(self.pixels.max(1));
        if more == 0.0 {
            if before == 0 {
                means.zip(0..).for_each(|(mean, plane)| *mean = if self.layout.is_id(plane) { NO_INDEX } else { 0.0 });
            }
            return;
        }
        let first = before == 0;
        let merged = |mean: f32, sum: f32| {
            let old = if first { 0.0 } else { f64::from(mean) };
            (old + (f64::from(sum) - more * old) / total) as f32
        };
        if self.layout.ids == 0 {
            means.zip(sums).for_each(|(mean, sum)| *mean = merged(*mean, *sum));
            return;
        }
        for ((mean, sum), plane) in means.zip(sums).zip(0..) {
            if !self.layout.is_kept(plane) {
                *mean = merged(*mean, *sum);
            } else if first && self.layout.is_id(plane) {
                *mean = *sum;
            }
        }
        if self.layout.any(AovSet::COVERAGE) {
            self.merge_coverage(pixel, before, more, sums);
        }
    }

    /// [`Self::merge`] of coverage by index.
    #[cold]
    fn merge_coverage(&mut self, pixel: usize, before: u32, more: f64, sums: &[f32]) {
        for aov in [Aov::MaterialCoverage, Aov::ObjectCoverage] {
            let Some(first) = self.layout.first(aov) else { continue };
            let places: [usize; 2 * RANKS] = core::array::from_fn(|k| (first + k) * self.pixels + pixel);
            let old = places.map(|at| self.values.get(at).copied().unwrap_or(0.0));
            let [a, b, c, d] = old;
            let counts = sums.get(first..first + 2 * RANKS).unwrap_or(&[]);
            let merged = coverage::merge([[a, b], [c, d]], before.into(), more, counts);
            for (at, x) in places.iter().zip(merged.as_flattened()) {
                if let Some(value) = self.values.get_mut(*at) {
                    *value = *x;
                }
            }
        }
    }

    /// Merges as [`Self::merge`], but parts of the radiance as the picture: their means over earlier samples count as those of
    /// `weight` samples of now.
    pub(crate) fn merge_weighted(&mut self, pixel: usize, before: u32, more: u32, sums: &[f32], weight: f64) {
        const LIGHT: [Aov; 3] = [Aov::Emission, Aov::Direct, Aov::Indirect];
        if more == 0 || !self.layout.any(AovSet::LIGHT) {
            return self.merge(pixel, before, more, sums);
        }
        let old = LIGHT.map(|aov| [0, 1, 2].map(|c| if before == 0 { 0.0 } else { self.value(aov, c, pixel) }));
        self.merge(pixel, before, more, sums);
        let more = f64::from(more);
        for (aov, old) in LIGHT.into_iter().zip(old) {
            let Some(first) = self.layout.first(aov) else { continue };
            for (plane, old) in (first..).zip(old) {
                let sum = sums.get(plane).copied().map_or(0.0, f64::from);
                if let Some(mean) = self.values.get_mut(plane * self.pixels + pixel) {
                    *mean = (old + (sum - more * old) / (weight + more)) as f32;
                }
            }
        }
    }

    /// Sums of a pixel over `samples` samples.
    pub(crate) fn sums(&self, pixel: usize, samples: u32) -> PixelAov {
        let n = f64::from(samples);
        let of = |aov, channel| n * self.value(aov, channel, pixel);
        PixelAov {
            albedo: core::array::from_fn(|c| of(Aov::Albedo, c)),
            normal: core::array::from_fn(|c| of(Aov::Normal, c)),
            depth: of(Aov::Depth, 0),
            hits: of(Aov::Alpha, 0),
            factor: core::array::from_fn(|c| of(Aov::Factors, c)),
            vertices: core::array::from_fn(|c| of(Aov::Factors, 4 + c)),
            paths: of(Aov::Paths, 0),
        }
    }
}

/// Sums of auxiliary values of one pixel, computed from the means of its planes; 0 for those that the settings do not ask
/// for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PixelAov {
    /// Sum of albedos ([`Aov::Albedo`]).
    pub albedo: [f64; 3],
    /// Sum of shading normals of the first hit, world space.
    pub normal: [f64; 3],
    /// Sum of distances to the first hit, world units.
    pub depth: f64,
    /// Number of camera samples that hit a surface.
    pub hits: f64,
    /// Sum of roulette factors at vertices of depth 1, 2, 3 and above.
    pub factor: [f64; 4],
    /// Number of those vertices.
    pub vertices: [f64; 4],
    /// Number of paths: camera samples and samples that splitting added.
    pub paths: f64,
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;
    use std::vec;

    /// Killed by: a name that stands for another, a set that is written as another.
    #[test]
    fn sets_are_read_as_they_are_written() {
        for bits in 0..1 << Aov::ALL.len() {
            let set = AovSet(bits);
            assert_eq!(AovSet::from_text(&set.to_string()), Some(set), "{set}");
        }
        assert!(Aov::ALL.iter().all(|a| AovSet::of(&[*a]).has(*a) && !AovSet::NONE.has(*a)));
        assert_eq!(AovSet::STANDARD.to_string(), "true");
        assert_eq!(AovSet::from_text("albedo,depth"), Some(AovSet::of(&[Aov::Albedo, Aov::Depth])));
        assert_eq!([AovSet::from_text("albedo,"), AovSet::from_text("Depth"), AovSet::from_text("")], [None; 3]);
    }

    /// Means over iterations, indices of the first sample. Killed by: a mean over iterations instead of samples, planes
    /// that overlap, an index that is averaged, a pixel without samples that counts.
    #[test]
    fn planes_hold_means_over_samples() {
        let layout = AovLayout::new(AovSet::of(&[Aov::Depth, Aov::Material, Aov::Normal]));
        assert_eq!(layout.planes, 5);
        let (mut memory, mut rows) = (vec![f32::NAN; 10], vec![f32::NAN; 10]);
        let mut planes = AovPlanes::new(layout, 2, &mut memory);
        let mut sums = AovSums::new(layout, &mut rows);
        sums.clear(1);
        assert_eq!(sums.row(1), [0.0, 0.0, 0.0, 0.0, -1.0]);
        sums.add(1, Aov::Depth, [6.0]);
        sums.add(1, Aov::Normal, [0.0, 1.0, 2.0]);
        sums.add(1, Aov::Albedo, [7.0; 3]);
        *sums.get(1, Aov::Material, 0).unwrap() = 4.0;
        planes.merge(0, 0, 0, &[]);
        planes.merge(1, 0, 2, sums.row(1));
        sums.clear(1);
        sums.add(1, Aov::Depth, [1.0]);
        *sums.get(1, Aov::Material, 0).unwrap() = 9.0;
        planes.merge(1, 2, 6, sums.row(1));
        planes.merge(1, 8, 0, &[]);
        assert_eq!(planes.plane(Aov::Depth, 0), Some(&[0.0, 7.0 / 8.0][..]));
        assert_eq!(planes.plane(Aov::Normal, 2), Some(&[0.0, 0.25][..]));
        assert_eq!(planes.plane(Aov::Material, 0), Some(&[-1.0, 4.0][..]));
        assert_eq!([planes.plane(Aov::Albedo, 0), planes.plane(Aov::Depth, 1)], [None; 2]);
        assert_eq!(planes.sums(1, 8).depth, 7.0);
    }
}
