//! The built-in denoiser: an estimate of the noise-free picture from the noisy one, the standard errors of its pixels,
//! and albedo and normal of the first hits. In fixed memory, with the same bits on every instruction set.
//!
//! ```text
//! prepare   e = color / albedo; pixels that are not finite are filled from their neighbours;
//!           variance of a pixel = the larger of its own and its neighbourhood's
//! 5 times   step 1, 2, 4, 8, 16: e(p) <- weighted mean of e(q) over the 3x3 pixels q that are `step` apart,
//!           weight = kernel * max(0, 1 - |e(p) - e(q)|^2 / (k^2 (var(p) + var(q))) - feature distance)^2;
//!           the variance of the mean goes along
//! despeckle a pixel beyond all its 8 neighbours goes to the nearest of them, by 3 standard errors at most
//! finish    the difference of the means goes back to the noisy pixels; color = e * albedo
//! ```
//!
//! Two pixels belong together if their standard errors explain their difference (Sakai et al., A Statistical Approach
//! to Monte Carlo Denoising, SIGGRAPH Asia 2024, test memberships in one window): a rare bright sample, whose error is
//! as large as itself, is distributed over its neighbours, and an edge that the errors do not explain stays. The scales
//! are those of Dammertz et al., Edge-Avoiding À-Trous Wavelet Transform, HPG 2010, with the variance filtered along as
//! by Schied et al., Spatiotemporal Variance-Guided Filtering, HPG 2017. Dividing by the albedo keeps textures.
//!
//! A weighted mean darkens a little where bright pixels have few similar neighbours, hence the last step: the mean of
//! the picture is that of its samples. One limit remains: the variance of a pixel with one sample is taken to be its
//! square, which explains every difference. With one sample per pixel only the features make edges, and an emitter with
//! the albedo and normal of the wall around it bleeds.

mod filter;
mod finish;
mod grid;
mod noisy;
mod pixels;
mod planes;
mod prepare;
mod progress;
mod work;

pub(crate) use noisy::NoisySource;
pub use noisy::{COLOR_LIMIT, DenoiseError, Noisy, Part};
pub use planes::Planes;
pub(crate) use progress::Progress;
pub(crate) use work::{Work, window_len};

/// Number of values of scratch memory that [`denoise`] needs for a picture of `size`: two per pixel and a window of rows;
/// `usize::MAX` if that is not addressable.
pub fn scratch_len(size: [u32; 2]) -> usize {
    let [columns, rows] = size.map(|n| n as usize);
    columns.saturating_mul(rows).saturating_mul(2).saturating_add(window_len(size))
}

/// Denoises into `out`, three planes of linear rgb. What `scratch` and `out` hold before does not
/// matter. A picture without noise comes back as it is, but for rounding; what comes back is finite, always.
pub fn denoise(noisy: &Noisy<'_>, scratch: &mut [f32], out: [&mut [f32]; 3]) -> Result<(), DenoiseError> {
    let size = noisy.size;
    let check = |part, needed, given| {
        if given < needed { Err(DenoiseError { part, size, needed, given }) } else { Ok(()) }
    };
    let [columns, rows] = size.map(|n| n as usize);
    let pixels = columns.saturating_mul(rows);
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

    let (variance, rest) = scratch.split_at_mut(pixels);
    let (reach, window) = rest.split_at_mut(pixels);
    let mut work = Work { e: out, variance, reach, window };
    let mut progress = Progress::default();
    while !progress.row(size, noisy, &mut work) {}
    Ok(())
}
