//! Planes of the denoiser in one piece of memory, filled from a film.

use super::denoise;
use super::noisy::{DenoiseError, Noisy, Part};
use crate::film::{PixelAov, PixelStats};

/// Input and result of [`denoise`], carved out of one slice: fill every pixel with [`Planes::set`], call
/// [`Planes::denoise`], read [`Planes::out`].
#[derive(Debug)]
pub struct Planes<'m> {
    size: [u32; 2],
    /// Mean radiance, linear rgb.
    pub color: [&'m mut [f32]; 3],
    /// Squared standard error of the mean; see [`Noisy::variance`].
    pub variance: [&'m mut [f32]; 3],
    /// Mean albedo of the first hits ([`Noisy::albedo`]); empty without features.
    pub albedo: [&'m mut [f32]; 3],
    /// Mean shading normal of the first hits ([`Noisy::normal`]); empty without features.
    pub normal: [&'m mut [f32]; 3],
    /// Denoised picture, linear rgb.
    pub out: [&'m mut [f32]; 3],
}

impl<'m> Planes<'m> {
    /// Number of values needed; `usize::MAX` if that is not addressable.
    pub fn len(size: [u32; 2], features: bool) -> usize {
        let [columns, rows] = size.map(|n| n as usize);
        columns.saturating_mul(rows).saturating_mul(if features { 15 } else { 9 })
    }

    /// Carves the planes; what they hold stays as it is.
    pub fn carve(size: [u32; 2], features: bool, memory: &'m mut [f32]) -> Result<Self, DenoiseError> {
        let (needed, given) = (Self::len(size, features), memory.len());
        let mut rest = memory.get_mut(..needed).ok_or(DenoiseError { part: Part::Planes, size, needed, given })?;
        // `needed` is at least this, or they are both 0.
        let pixels = size[0] as usize * size[1] as usize;
        let mut three = |pixels: usize| {
            [(); 3].map(|()| {
                let (plane, tail) = core::mem::take(&mut rest).split_at_mut_checked(pixels).unwrap_or_default();
                rest = tail;
                plane
            })
        };
        let aux = if features { pixels } else { 0 };
        Ok(Self {
            size,
            color: three(pixels),
            variance: three(pixels),
            albedo: three(aux),
            normal: three(aux),
            out: three(pixels),
        })
    }

    /// Sets a pixel from its sums. One without samples counts as absent. Without `aov` its albedo and normal are 0.
    pub fn set(&mut self, pixel: usize, stats: &PixelStats, aov: Option<&PixelAov>) {
        let n = stats.samples.max(1) as f64;
        let (mean, variance) = (stats.mean(), stats.variance_of_mean());
        let (albedo, normal) = aov.map_or(([0.0; 3], [0.0; 3]), |a| (a.albedo, a.normal));
        let put = |plane: &mut [f32], x: f64| {
            if let Some(p) = plane.get_mut(pixel) {
                *p = x as f32;
            }
        };
        for c in 0..3 {
            put(self.color[c], if stats.samples > 0 { mean[c] } else { f64::NAN });
            put(self.variance[c], variance[c]);
            put(self.albedo[c], albedo[c] / n);
            put(self.normal[c], normal[c] / n);
        }
    }

    /// Denoises into [`Planes::out`]; see [`denoise`].
    pub fn denoise(&mut self, scratch: &mut [f32]) -> Result<(), DenoiseError> {
        fn shared<'a>(planes: &'a [&mut [f32]; 3]) -> [&'a [f32]; 3] {
            planes.each_ref().map(|p| &**p)
        }
        let noisy = Noisy {
            size: self.size,
            color: shared(&self.color),
            variance: shared(&self.variance),
            albedo: shared(&self.albedo),
            normal: shared(&self.normal),
        };
        denoise(&noisy, scratch, self.out.each_mut().map(|p| &mut **p))
    }
}
