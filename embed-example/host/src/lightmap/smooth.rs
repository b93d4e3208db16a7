//! The denoised map: chart by chart, so that no light crosses from one to another.

use super::texels::{NO_CHART, Texels};
use croupier::unstable::denoise::{Planes, scratch_len};
use croupier::unstable::film::{PixelAov, PixelStats};

/// Smallest and largest column and row of each chart's texels; `None` for charts without any.
fn bounds(texels: &Texels) -> Vec<Option<[[u32; 2]; 2]>> {
    let mut bounds: Vec<Option<[[u32; 2]; 2]>> = vec![None; texels.charts as usize];
    for (texel, chart) in (0u32..).zip(&texels.chart).filter(|(_, chart)| **chart != NO_CHART) {
        let at = [texel % texels.size[0], texel / texels.size[0]];
        let Some(of) = bounds.get_mut(*chart as usize) else { continue };
        let [lo, hi] = of.unwrap_or([at, at]);
        *of = Some([[lo[0].min(at[0]), lo[1].min(at[1])], [hi[0].max(at[0]), hi[1].max(at[1])]]);
    }
    bounds
}

/// Denoises the texels that are `valid` from the film's sums and mean normals into `out`; other texels stay as they are.
///
/// Each chart is a picture of its own, whose other texels are absent. The albedo of its texels is 1, so that nothing is
/// divided by it; that of the absent ones is 0, which lies so far off that they give nothing to the others, though the
/// denoiser fills them.
pub(super) fn denoise(
    texels: &Texels,
    pixels: &[PixelStats],
    normals: &[[f32; 3]],
    valid: &[bool],
    out: &mut [[f32; 3]],
) {
    let (mut memory, mut scratch) = (Vec::new(), Vec::new());
    for (chart, bounds) in (0..).zip(bounds(texels)) {
        let Some([lo, hi]) = bounds else { continue };
        let size = [hi[0] - lo[0] + 1, hi[1] - lo[1] + 1];
        let at = |i: usize| {
            let (x, y) = (i as u32 % size[0] + lo[0], i as u32 / size[0] + lo[1]);
            (y * texels.size[0] + x) as usize
        };
        let count = size[0] as usize * size[1] as usize;
        let of_chart = |i: usize| texels.chart[at(i)] == chart && valid[at(i)];
        memory.clear();
        memory.resize(Planes::len(size, true), 0.0);
        scratch.resize(scratch_len(size).max(scratch.len()), 0.0);
        // memory of the sizes asked for
        let Ok(mut planes) = Planes::carve(size, true, &mut memory) else { continue };
        for i in 0..count {
            match of_chart(i) {
                true => {
                    let n = pixels[at(i)].samples as f64;
                    let feature = normals[at(i)].map(|x| f64::from(x) * n);
                    let first = PixelAov { albedo: [n; 3], normal: feature, ..PixelAov::default() };
                    planes.set(i, &pixels[at(i)], Some(&first));
                }
                false => planes.set(i, &PixelStats::default(), None),
            }
        }
        if planes.denoise(&mut scratch).is_err() {
            continue;
        }
        for i in (0..count).filter(|i| of_chart(*i)) {
            out[at(i)] = planes.out.each_ref().map(|plane| plane[i]);
        }
    }
}
