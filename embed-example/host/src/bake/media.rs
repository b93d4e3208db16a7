//! Participating media: records, densities, majorants.

use super::BakeError;
use crate::description::{Density, Medium};
use bytemuck::Zeroable;
use croupier::unstable::scene::blob::{self, BRICK, MAJORANT_MARGIN, MediumKind};
use croupier::unstable::scene::blob::{
    MAX_ANISOTROPY, MAX_COEFFICIENT, MAX_COORDINATE, MAX_EMISSION, MAX_MEDIA, MAX_SIDE,
};

/// Sections of the blob.
#[derive(Default)]
pub(super) struct Media {
    pub media: Vec<blob::Medium>,
    pub densities: Vec<f32>,
    pub majorants: Vec<f32>,
}

/// Media in order of priority.
pub(super) fn bake(media: &[Medium]) -> Result<Media, BakeError> {
    if media.len() > MAX_MEDIA {
        return Err(BakeError::Media { count: media.len(), most: MAX_MEDIA });
    }
    let mut out = Media::default();
    for m in media {
        let (sigma_a, sigma_s) = (m.sigma_a, m.sigma_s);
        within(m, "sigma_a", &sigma_a, [0.0, MAX_COEFFICIENT])?;
        within(m, "sigma_s", &sigma_s, [0.0, MAX_COEFFICIENT])?;
        within(m, "emission", &m.emission, [0.0, MAX_EMISSION])?;
        within(m, "g", &[m.g], [-MAX_ANISOTROPY, MAX_ANISOTROPY])?;
        let mut record = blob::Medium { sigma_a, sigma_s, emission: m.emission, g: m.g, ..Zeroable::zeroed() };
        match &m.density {
            Density::Homogeneous => record.kind = MediumKind::Homogeneous as u32,
            Density::Grid { cells, bounds, values } => out.grid(m, &mut record, *cells, *bounds, values)?,
        }
        out.media.push(record);
    }
    Ok(out)
}

fn within(m: &Medium, what: &'static str, numbers: &[f32], range: [f32; 2]) -> Result<(), BakeError> {
    let bad = numbers.iter().find(|x| !(range[0]..=range[1]).contains(*x));
    bad.map_or(Ok(()), |found| Err(BakeError::Medium { medium: m.name.clone(), what, found: *found, range }))
}

impl Media {
    fn grid(
        &mut self,
        m: &Medium,
        record: &mut blob::Medium,
        cells: [u32; 3],
        bounds: [[f32; 3]; 2],
        values: &[f32],
    ) -> Result<(), BakeError> {
        for axis in 0..3 {
            let [lo, hi] = bounds.map(|p| p[axis]);
            within(m, "bound of the grid", &[lo, hi], [-MAX_COORDINATE, MAX_COORDINATE])?;
            // As many cells per unit length as f32 can hold, at most.
            let narrowest = (f64::from(cells[axis]) / f64::from(f32::MAX)) as f32;
            within(m, "width of the grid", &[hi - lo], [narrowest.next_up(), 2.0 * MAX_COORDINATE])?;
        }
        let sides = cells.iter().all(|n| (1..=MAX_SIDE).contains(n));
        // at most 2^48
        let count = if sides { cells.iter().map(|n| u64::from(*n)).product() } else { u64::MAX };
        if count != values.len() as u64 || self.densities.len() as u64 + count >= 1 << 31 {
            return Err(BakeError::Grid { medium: m.name.clone(), cells, values: values.len() });
        }
        within(m, "density", values, [0.0, MAX_COEFFICIENT])?;
        record.kind = MediumKind::Grid as u32;
        [record.bounds_min, record.bounds_max] = bounds;
        record.cells = cells;
        record.first_density = self.densities.len() as u32;
        record.first_majorant = self.majorants.len() as u32;
        self.densities.extend_from_slice(values);
        self.majorants.extend(majorants(cells, values));
        Ok(())
    }
}

/// For each brick the largest density in it and in one cell around it, between which the interpolation in the brick
/// stays, times [`MAJORANT_MARGIN`], rounded up.
fn majorants(cells: [u32; 3], values: &[f32]) -> Vec<f32> {
    let bricks = cells.map(|n| n.div_ceil(BRICK));
    let range = |axis: usize, brick: u32| {
        let first = brick * BRICK;
        first.saturating_sub(1) as usize..(first + BRICK + 1).min(cells[axis]) as usize
    };
    let [nx, ny, _] = cells.map(|n| n as usize);
    let mut out = Vec::with_capacity(bricks.iter().map(|n| *n as usize).product());
    for z in 0..bricks[2] {
        for y in 0..bricks[1] {
            for x in 0..bricks[0] {
                let rows = range(2, z).flat_map(|k| range(1, y).map(move |j| (k * ny + j) * nx));
                let xs = range(0, x);
                let near = rows.flat_map(|row| &values[row + xs.start..row + xs.end]);
                out.push(inflated(near.fold(0.0, |most, d| most.max(*d))));
            }
        }
    }
    out
}

/// The smallest `f32` from `density` times [`MAJORANT_MARGIN`] on.
fn inflated(density: f32) -> f32 {
    // exact in f64
    let exact = f64::from(density) * f64::from(MAJORANT_MARGIN);
    let nearest = exact as f32;
    if f64::from(nearest) < exact { nearest.next_up() } else { nearest }
}
