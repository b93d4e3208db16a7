//! From the filtered planes to the result: mean corrected, color multiplied by albedo.

use super::grid::{Grid, MARGIN, TINY, load_pixels, store_pixels};
use super::noisy::NoisySource;
use super::pixels::NoisyPixels8;
use super::work::Work;
use croupier_simd::F32x8;

/// Squared relative standard error (of `REACH`) above which a pixel takes part in the correction of the mean.
const NOISY: f32 = 1e-2;
/// Bounds of the correction, relative to the noisy pixels' radiance.
const CORRECTION: (f64, f64) = (-0.5, 1.0);

/// Eight pixels of the filtered picture.
struct Filtered {
    e: [F32x8; 3],
    /// 0 where the pixel was exact, about 1 where it was noisy.
    noisy: F32x8,
}

impl Filtered {
    #[inline(always)]
    fn read(grid: Grid, work: &Work<'_>, x: usize, y: usize) -> Self {
        let at = grid.pixels(x, y);
        let e: [F32x8; 3] = core::array::from_fn(|c| load_pixels(work.e[c], at));
        // Not the filtered variance: the filter spreads it into exact pixels.
        let reach2 = load_pixels(work.reach, at).sqr();
        let square = e[0].sqr() + e[1].sqr() + e[2].sqr();
        Self { e, noisy: reach2 / (reach2 + square * NOISY + TINY) }
    }
}

/// Radiance that row `y` lost, and that of its noisy pixels, which can take it back; exact pixels, emitters above all,
/// take no part.
pub(super) fn lost_in_row<S: NoisySource>(noisy: &S, grid: Grid, y: usize, work: &Work<'_>) -> [[f32; 3]; 2] {
    let (mut lost, mut takers) = ([F32x8::ZERO; 3], [F32x8::ZERO; 3]);
    for x in grid.packets() {
        let (p, f) = (NoisyPixels8::read(noisy, grid, x - MARGIN, y), Filtered::read(grid, work, x, y));
        for c in 0..3 {
            // Unchanged pixels differ by exactly 0: the sum over emitters does not lose the rest in rounding.
            lost[c] += p.present.zero_unless((p.e[c] - f.e[c]) * p.divisor[c]);
            takers[c] += p.present.zero_unless(f.e[c] * p.divisor[c] * f.noisy);
        }
    }
    [lost.map(F32x8::sum), takers.map(F32x8::sum)]
}

/// Share of a noisy pixel's radiance that is added to it, per channel, so that the picture keeps its mean.
pub(super) fn gain(lost: [f64; 3], takers: [f64; 3]) -> [f32; 3] {
    core::array::from_fn(|c| {
        if takers[c] > 0.0 { (lost[c] / takers[c]).clamp(CORRECTION.0, CORRECTION.1) as f32 } else { 0.0 }
    })
}

/// Turns row `y` of the planes into the result.
pub(super) fn finish_row<S: NoisySource>(noisy: &S, grid: Grid, y: usize, gain: [f32; 3], work: &mut Work<'_>) {
    for x in grid.packets() {
        let (p, f) = (NoisyPixels8::read(noisy, grid, x - MARGIN, y), Filtered::read(grid, work, x, y));
        for (c, plane) in work.e.iter_mut().enumerate() {
            store_pixels(plane, grid.pixels(x, y), f.e[c] * p.divisor[c] * (1.0 + f.noisy * gain[c]));
        }
    }
}
