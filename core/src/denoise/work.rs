//! Memory that the denoiser works in.

use super::grid::Grid;

/// Memory that is worked in. Planes have one value per pixel, row by row.
#[derive(Debug)]
pub(crate) struct Work<'a> {
    /// Color over albedo, in the end the result.
    pub e: [&'a mut [f32]; 3],
    /// Variance of the color over albedo, summed over rgb.
    pub variance: &'a mut [f32],
    /// Largest change of a pixel by `despeckle`.
    pub reach: &'a mut [f32],
    /// Rows as they were before the pass that is under way; [`window_len`] values.
    pub window: &'a mut [f32],
}

/// Number of values of [`Work::window`].
pub(crate) fn window_len(size: [u32; 2]) -> usize {
    Grid::new(size).window_len()
}
