//! The built-in denoiser: a guess at the noise-free picture from the noisy one, the errors of its pixels and what the
//! first hits look like. In fixed memory, the same bits on every instruction set.
//!
//! ```text
//! prepare   e = color / albedo; pixels that are not finite are filled from their neighbours;
//!           variance of a pixel = the larger of its own and its neighbourhood's
//! 5 times   step 1, 2, 4, 8, 16: e(p) <- weighted mean of e(q) over the 3x3 pixels q that are `step` apart,
//!           weight = kernel * max(0, 1 - |e(p) - e(q)|^2 / (k^2 (var(p) + var(q))) - feature distance)^2;
//!           the variance of the mean goes along
//! despeckle a pixel beyond all its 8 neighbours goes to the nearest of them, by 3 standard errors at most
//! finish    what the picture lost or gained in all goes back to its noisy pixels; color = e * albedo
//! ```
//!
//! Two pixels belong together if their standard errors explain their difference (Sakai et al., A Statistical Approach
//! to Monte Carlo Denoising, SIGGRAPH Asia 2024, test memberships in one window): so a bright rare sample, whose error
//! is as large as itself, is shared out, and an edge that the errors do not explain stays. The scales are those of
//! Dammertz et al., Edge-Avoiding À-Trous Wavelet Transform, HPG 2010, with the variance carried along as by Schied et
//! al., Spatiotemporal Variance-Guided Filtering, HPG 2017. Dividing by the albedo keeps textures.
//!
//! A weighted mean darkens a little where bright pixels find few companions, hence the last step: the mean of the
//! picture is that of its samples. It has one limit: a pixel of one sample has no variance but its square, which
//! excuses every difference. From one sample per pixel the features alone draw the edges, and a lamp that looks like
//! its wall bleeds.

mod filter;
mod finish;
mod planes;
mod prepare;

use core::fmt;
use croupier_simd::F32x8;
pub use planes::Planes;

/// The noisy picture: planes of `columns * rows` values, row by row; longer ones are cut. Pixels whose color or
/// variance is not finite (or beyond [`COLOR_LIMIT`] or its square) count as absent.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'a> {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Mean radiance, rgb.
    pub color: [&'a [f32]; 3],
    /// Squared standard error of the mean. Where it is 0 all around, pixels keep their values; among noisy neighbours 0
    /// rather means that all samples of a pixel missed the light.
    pub variance: [&'a [f32]; 3],
    /// Mean albedo of the first hits, 0 to 1, 0 where nothing is hit. Three empty slices: unknown.
    pub albedo: [&'a [f32]; 3],
    /// Mean shading normal of the first hits, world space, 0 where nothing is hit. Three empty slices: unknown.
    pub normal: [&'a [f32]; 3],
}

/// Radiance above which a pixel counts as absent: squares of sums of it stay finite.
pub const COLOR_LIMIT: f32 = 1e15;

/// What has too few values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A plane of [`Noisy::color`].
    Color,
    /// A plane of [`Noisy::variance`].
    Variance,
    /// A plane of [`Noisy::albedo`].
    Albedo,
    /// A plane of [`Noisy::normal`].
    Normal,
    /// The scratch memory; see [`scratch_len`].
    Scratch,
    /// A plane of the result.
    Out,
    /// The memory of [`Planes`]; see [`Planes::len`].
    Planes,
}

/// A slice is too short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DenoiseError {
    /// Which one.
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

/// Values of scratch memory that [`denoise`] needs for a picture of `size`; `usize::MAX` if that is not addressable.
pub fn scratch_len(size: [u32; 2]) -> usize {
    let grid = Grid::new(size);
    grid.rows.saturating_mul(grid.stride).saturating_mul(2 * SIGNAL + FEATURES)
}

/// Denoises into `out`, three planes like those of [`Noisy::color`]. What `scratch` and `out` hold before does not
/// matter. A picture without noise comes back as it is, but for rounding; what comes back is finite, always.
pub fn denoise(noisy: &Noisy<'_>, scratch: &mut [f32], out: [&mut [f32]; 3]) -> Result<(), DenoiseError> {
    let (size, grid) = (noisy.size, Grid::new(noisy.size));
    let check = |part, needed, given| {
        if given < needed { Err(DenoiseError { part, size, needed, given }) } else { Ok(()) }
    };
    let pixels = grid.columns.saturating_mul(grid.rows);
    for (part, planes) in [(Part::Color, &noisy.color), (Part::Variance, &noisy.variance)] {
        planes.iter().try_for_each(|p| check(part, pixels, p.len()))?;
    }
    for (part, planes) in [(Part::Albedo, &noisy.albedo), (Part::Normal, &noisy.normal)] {
        if planes.iter().any(|p| !p.is_empty()) {
            planes.iter().try_for_each(|p| check(part, pixels, p.len()))?;
        }
    }
    out.iter().try_for_each(|p| check(Part::Out, pixels, p.len()))?;
    let needed = scratch_len(size);
    check(Part::Scratch, needed, scratch.len())?;
    if pixels == 0 {
        return Ok(());
    }

    let signal = grid.rows * grid.stride * SIGNAL;
    let (mut from, rest) = scratch.split_at_mut(signal);
    let (mut to, features) = rest.split_at_mut(signal);
    prepare::prepare(noisy, grid, from, to, features);
    let mut factor = MEMBERSHIP;
    for step in STEPS {
        filter::smooth(grid, step, factor * factor, from, features, to);
        core::mem::swap(&mut from, &mut to);
        factor *= MEMBERSHIP_DECAY;
    }
    filter::despeckle(grid, from, features, to);
    finish::finish(noisy, grid, to, features, out);
    Ok(())
}

/// Distances of the taps, level by level.
const STEPS: [usize; 5] = [1, 2, 4, 8, 16];
/// Columns of margin on either side of a scratch row: no tap leaves the row. A multiple of 8.
const MARGIN: usize = 16;
/// Values of a pixel that the levels change: e (rgb) and the variance of e, summed over rgb.
const SIGNAL: usize = 4;
/// Values of a pixel that stay: normal, albedo, each scaled so that a distance of 1 separates, and [`REACH`].
const FEATURES: usize = 7;
/// Plane of the features: how far [`filter::despeckle`] may move the pixel.
const REACH: usize = 6;
/// Normal, x, of what is not in the picture: far from all that is.
const NOWHERE: f32 = 1e9;

/// Standard errors of a difference at which two pixels stop belonging together at the first level. Chosen by hand
/// after varying one number at a time, by the relMSE of seven scenes with 4 and 16 samples per pixel: no joint optimum,
/// and not checked on other scenes.
const MEMBERSHIP: f32 = 2.75;
/// Its factor from level to level: neighbours have come to share samples, and variances count them as independent.
const MEMBERSHIP_DECAY: f32 = 0.95;
/// Per squared distance of two normals, 1 separates. See [`MEMBERSHIP`].
const NORMAL_WEIGHT: f32 = 3.5;
/// Per squared distance of two albedos. See [`MEMBERSHIP`].
const ALBEDO_WEIGHT: f32 = 3.0;
/// Smallest divisor: below it radiance is hardly the surface's own color.
const ALBEDO_FLOOR: f32 = 0.1;
/// Standard errors by which a pixel may be moved towards its neighbours.
const DESPECKLE: f32 = 3.0;
/// Squared radiance that never matters: keeps 0 / 0 away.
const TINY: f32 = 1e-20;

/// Where a pixel is in scratch memory: rows of planes, each plane with a margin on both sides.
#[derive(Clone, Copy)]
struct Grid {
    columns: usize,
    rows: usize,
    /// `columns`, up to a multiple of 8.
    padded: usize,
    /// Values from one plane of a row to the next.
    stride: usize,
}

impl Grid {
    fn new(size: [u32; 2]) -> Self {
        let [columns, rows] = size.map(|n| n as usize);
        let padded = columns.saturating_add(7) & !7;
        Self { columns, rows, padded, stride: padded.saturating_add(2 * MARGIN) }
    }

    /// First lanes of the packets of a row, from the beginning of a plane.
    fn packets(self) -> impl Iterator<Item = usize> {
        (MARGIN..MARGIN + self.padded).step_by(8)
    }

    /// Row `y` of a block with `planes` planes; empty if there is no such row.
    fn row(self, block: &[f32], planes: usize, y: usize) -> &[f32] {
        let len = planes * self.stride;
        if y < self.rows { block.get(y * len..).and_then(|r| r.get(..len)).unwrap_or(&[]) } else { &[] }
    }

    fn row_mut(self, block: &mut [f32], planes: usize, y: usize) -> &mut [f32] {
        let len = planes * self.stride;
        if y < self.rows { block.get_mut(y * len..).and_then(|r| r.get_mut(..len)).unwrap_or(&mut []) } else { &mut [] }
    }
}

/// Eight values from `at`; 0 if they are not all there.
#[inline(always)]
fn load(row: &[f32], at: usize) -> F32x8 {
    match row.get(at..).and_then(|r| r.first_chunk()) {
        Some(a) => F32x8::new(*a),
        None => F32x8::ZERO,
    }
}

#[inline(always)]
fn store(row: &mut [f32], at: usize, x: F32x8) {
    if let Some(a) = row.get_mut(at..).and_then(|r| r.first_chunk_mut()) {
        *a = x.to_array();
    }
}
