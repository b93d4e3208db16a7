//! Sampling tables of environment maps.
//!
//! Light samples share the map with BSDF samples, which find what is even in it at least as well. So cells are not chosen
//! by their luminance but by what it has above the mean of the map (MIS compensation: Karlik, Sik, Vevoda, Skrivan and
//! Krivanek, "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling", ACM TOG 38(6) 2019,
//! section 5, with half of the samples from each technique). Cells at or below the mean are left to BSDF samples alone:
//! there the density of light samples is 0, and theirs counts in full. That is right because every lobe that a light
//! sample could see is sampled in all its directions; delta lobes and rays from cameras, probes and texels' hemispheres
//! never had light samples to share with.

use super::math::Math;
use crate::edit::light_table;
use crate::light::luminance;
use crate::scene::blob::Alias;
use core::f64::consts::{PI, TAU};

/// Share of a map's light above its mean below which it counts as even.
const EVEN: f64 = 1e-3;

/// A lat-long map as the kernels read it: bilinear in polar angle and azimuth. Cell (i, j) is the one between the
/// texels of column i and the next (wrapping), of row j and the next. Row j lies at the polar angle `j pi / (height -
/// 1)`.
#[derive(Clone, Copy, Debug)]
pub struct LatLong<'a> {
    texels: &'a [[f32; 3]],
    width: usize,
    height: usize,
    scale: [f32; 3],
}

impl<'a> LatLong<'a> {
    /// A map of `width` x `height` texels, row 0 (+Y) first; `None` unless `width >= 1`, `height >= 2` and that many
    /// texels are given.
    pub fn new(texels: &'a [[f32; 3]], [width, height]: [u32; 2]) -> Option<Self> {
        let (width, height) = (width as usize, height as usize);
        let fits = width >= 1 && height >= 2 && width.checked_mul(height) == Some(texels.len());
        fits.then_some(Self { texels, width, height, scale: [1.0; 3] })
    }

    /// With a factor on all texels.
    pub fn scaled(self, scale: [f32; 3]) -> Self {
        Self { scale, ..self }
    }

    /// Texels, without the factor.
    pub(super) fn texels(&self) -> &'a [[f32; 3]] {
        self.texels
    }

    /// Rows of cells.
    pub fn rows(&self) -> usize {
        self.height - 1
    }

    /// Columns of cells.
    pub fn columns(&self) -> usize {
        self.width
    }

    /// Integral of the sine of the polar angle over cells of row `j`: in all, and weighted with 0 at the upper edge to
    /// 1 at the lower one.
    fn sines<M: Math>(&self, j: usize) -> [f64; 2] {
        let step = PI / self.rows() as f64;
        let (a, b) = (j as f64 * step, (j + 1) as f64 * step);
        let (sin, _) = M::sin_cos((a + b) / 2.0);
        let (sin_half, _) = M::sin_cos(step / 2.0);
        let all = 2.0 * sin * sin_half;
        let ((sin_a, _), (sin_b, cos_b)) = (M::sin_cos(a), M::sin_cos(b));
        [all, ((sin_b - sin_a) / step - cos_b).clamp(0.0, all)]
    }

    /// Integrals of the luminance over the cells of row `j`, in luminance x sr, one after the other. Within a cell the
    /// map is linear in the polar angle, weighted with its sine; the integral is exact.
    pub fn row<M: Math>(&self, j: usize) -> impl Fn(usize) -> f64 + use<'a, M> {
        let [all, lower] = self.sines::<M>(j);
        let Self { texels, width, scale: [x, y, z], .. } = *self;
        let at = move |i: usize, j: usize| {
            texels.get(j * width + i % width).map_or(0.0, |[r, g, b]| luminance([r * x, g * y, b * z]))
        };
        move |i| {
            let (top, bottom) = (at(i, j) + at(i + 1, j), at(i, j + 1) + at(i + 1, j + 1));
            (top * (all - lower) + bottom * lower) / 2.0 * TAU / width as f64
        }
    }

    /// Solid angle of each cell of row `j`, sr.
    fn solid_angle<M: Math>(&self, j: usize) -> f64 {
        let [all, _] = self.sines::<M>(j);
        all * TAU / self.width as f64
    }

    /// Luminance that light samples leave to BSDF samples in every direction: the mean over the sphere; 0 for a map that is
    /// even but for the share `EVEN`, whose rest above the mean would be rounding.
    pub fn shared_luminance<M: Math>(&self) -> f64 {
        let total = self.integral::<M>();
        let mean = total / (2.0 * TAU);
        let above = |j| {
            let weight = self.weights::<M>(j, mean);
            (0..self.width).map(weight).sum::<f64>()
        };
        if (0..self.rows()).map(above).sum::<f64>() > EVEN * total { mean } else { 0.0 }
    }

    /// Weights with which the cells of row `j` are chosen: [`Self::row`] above `shared`, the luminance of
    /// [`Self::shared_luminance`].
    pub fn weights<M: Math>(&self, j: usize, shared: f64) -> impl Fn(usize) -> f64 + use<'a, M> {
        let (integral, left) = (self.row::<M>(j), shared * self.solid_angle::<M>(j));
        move |i| (integral(i) - left).max(0.0)
    }

    /// Integral over row `j`.
    fn row_sum<M: Math>(&self, j: usize) -> f64 {
        let cell = self.row::<M>(j);
        (0..self.width).map(cell).sum()
    }

    /// Integral over all directions.
    pub(super) fn integral<M: Math>(&self) -> f64 {
        (0..self.rows()).map(|j| self.row_sum::<M>(j)).sum()
    }

    /// Entries of the alias tables: one table over the rows, one for each row over its cells.
    pub(super) fn entries(&self) -> usize {
        self.rows() * (self.width + 1)
    }

    /// Fills the alias tables, as many entries as [`Self::entries`]. A row is never picked or has cells that are.
    pub(super) fn tabulate<M: Math>(&self, tables: &mut [Alias]) {
        let Some((over_rows, cells)) = tables.split_at_mut_checked(self.rows()) else { return };
        let shared = self.shared_luminance::<M>();
        for (j, row) in cells.chunks_exact_mut(self.width.max(1)).enumerate() {
            let cell = self.weights::<M>(j, shared);
            let sum: f64 = (0..self.width).map(&cell).sum();
            light_table::build(row, |i| if sum > 0.0 { cell(i as usize) } else { 1.0 });
        }
        let of_row = |j: u32| (0..self.width).map(self.weights::<M>(j as usize, shared)).sum();
        light_table::build(over_rows, of_row);
    }
}
