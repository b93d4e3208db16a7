//! Input of the denoiser: planes of the noisy picture, and errors about them.

use core::fmt;
use croupier_simd::F32x8;

/// Noisy picture: planes of `columns * rows` values, row by row; longer ones are cut. Pixels whose color or
/// variance is not finite (or beyond [`COLOR_LIMIT`] or its square) count as absent.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'a> {
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// Mean radiance, linear rgb.
    pub color: [&'a [f32]; 3],
    /// Squared standard error of the mean. Where it is 0 in the whole neighbourhood, pixels keep their values; among
    /// noisy neighbours, 0 means that all samples of a pixel missed the light.
    pub variance: [&'a [f32]; 3],
    /// Mean albedo of the first hits, 0 to 1, 0 where nothing is hit. Three empty slices: unknown.
    pub albedo: [&'a [f32]; 3],
    /// Mean shading normal of the first hits, world space, 0 where nothing is hit. Three empty slices: unknown.
    pub normal: [&'a [f32]; 3],
}

/// Source of eight neighbouring pixels of the noisy picture, from pixel index `at` on, row by row. What it gives for
/// pixels beyond the end of the row does not matter. Every call gives the same bits.
pub(crate) trait NoisySource {
    /// Mean radiance, and its squared standard error; see [`Noisy::color`].
    fn color(&self, at: usize) -> ([F32x8; 3], [F32x8; 3]);

    /// Albedo (1 if unknown) and normal (0 if unknown); see [`Noisy::albedo`].
    fn features(&self, at: usize) -> ([F32x8; 3], [F32x8; 3]);
}

/// Radiance above which a pixel counts as absent: squares of sums of it stay finite.
pub const COLOR_LIMIT: f32 = 1e15;

/// Slice that has too few values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A plane of the noisy picture.
    Color,
    /// A plane of [`Noisy::variance`].
    Variance,
    /// A plane of [`Noisy::albedo`].
    Albedo,
    /// A plane of [`Noisy::normal`].
    Normal,
    /// Scratch memory; see [`scratch_len`](super::scratch_len).
    Scratch,
    /// A plane of the result.
    Out,
    /// Memory of [`Planes`](super::Planes); see [`Planes::len`](super::Planes::len).
    Planes,
}

/// Error about a slice that is too short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DenoiseError {
    /// Slice that is too short.
    pub part: Part,
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// Values needed.
    pub needed: usize,
    /// Values given.
    pub given: usize,
}

impl fmt::Display for DenoiseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = match self.part {
            Part::Color => "a color plane",
            Part::Variance => "a variance plane",
            Part::Albedo => "an albedo plane",
            Part::Normal => "a normal plane",
            Part::Scratch => "scratch memory",
            Part::Out => "a result plane",
            Part::Planes => "plane memory",
        };
        let [columns, rows] = self.size;
        write!(f, "{part} for {columns}x{rows} pixels needs {} values, {} given", self.needed, self.given)
    }
}

impl core::error::Error for DenoiseError {}
