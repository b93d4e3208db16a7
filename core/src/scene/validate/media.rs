//! Participating media and their grids.

use super::record::{Record, records};
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError, SectionFault};
use crate::scene::{Effects, Records};

/// Every medium's coefficients and, of those with a grid, box, densities and majorants. The ranges keep the extinction,
/// (sigma_a + sigma_s) times density or majorant, finite in `f32`.
///
/// Linear in the grid: a brick looks at 6^3 cells for its 4^3. Media may share a grid, which is then checked for each,
/// [`MAX_MEDIA`] times at most.
pub(super) fn media(scene: &Records<'_>) -> Result<(), SceneError> {
    if scene.media.len() > MAX_MEDIA {
        let fault = SectionFault::Count(scene.media.len() as u64);
        return Err(SceneError::Section { kind: SectionKind::Media, fault });
    }
    for (at, m) in records(SectionKind::Media, scene.media) {
        let kind = MediumKind::from_u32(m.kind);
        let kind = kind.ok_or(SceneError::Kind { of: at.of, index: at.index(), found: m.kind })?;
        at.zero(m.reserved == [0; 2])?;
        at.all_within(Field::Absorption, &m.sigma_a, 0.0, MAX_COEFFICIENT)?;
        at.all_within(Field::Scattering, &m.sigma_s, 0.0, MAX_COEFFICIENT)?;
        at.all_within(Field::Emission, &m.emission, 0.0, MAX_EMISSION)?;
        at.within(Field::Anisotropy, m.g, -MAX_ANISOTROPY, MAX_ANISOTROPY)?;
        match kind {
            MediumKind::Homogeneous => {
                let bounds = [m.bounds_min, m.bounds_max].map(|p| p.map(f32::to_bits)) == [[0; 3]; 2];
                at.zero(bounds && m.cells == [0; 3] && m.first_density == 0 && m.first_majorant == 0)?;
            }
            MediumKind::Grid => grid(scene, at, m)?,
        }
    }
    Ok(())
}

/// The box of a grid spans space, its values are there, and no density exceeds the majorants that cover it.
fn grid(scene: &Records<'_>, at: Record, m: &Medium) -> Result<(), SceneError> {
    at.all_within(Field::Bounds, &m.bounds_min, -MAX_COORDINATE, MAX_COORDINATE)?;
    at.all_within(Field::Bounds, &m.bounds_max, -MAX_COORDINATE, MAX_COORDINATE)?;
    for ((lo, hi), n) in m.bounds_min.iter().zip(&m.bounds_max).zip(m.cells) {
        if n == 0 || n > MAX_SIDE {
            return Err(at.bad(Field::Cells, n as f32));
        }
        // Cells per unit length, by which positions become cells, stay finite; a box without width has infinitely many.
        let per_unit = n as f32 / (hi - lo);
        if !(per_unit > 0.0 && per_unit.is_finite()) {
            return Err(at.bad(Field::Bounds, *hi));
        }
    }
    let densities = values(at, SectionKind::Densities, scene.densities, m.first_density, m.cells)?;
    let majorants = values(at, SectionKind::Majorants, scene.majorants, m.first_majorant, m.bricks())?;
    for (offset, density) in densities.iter().enumerate() {
        let of = SectionKind::Densities;
        let at = Record { of, index: offset.saturating_add(m.first_density as usize) };
        at.within(Field::Density, *density, 0.0, MAX_COEFFICIENT)?;
    }
    let [bricks_x, bricks_y, bricks_z] = m.bricks();
    let bricks = (0..bricks_z).flat_map(|z| (0..bricks_y).flat_map(move |y| (0..bricks_x).map(move |x| [x, y, z])));
    for ((offset, majorant), brick) in majorants.iter().enumerate().zip(bricks) {
        // In f64 the product of two f32 is exact.
        let least = f64::from(MAJORANT_MARGIN) * f64::from(largest(densities, m.cells, brick));
        if !(f64::from(*majorant) >= least && *majorant <= MAX_MAJORANT) {
            let of = SectionKind::Majorants;
            let at = Record { of, index: offset.saturating_add(m.first_majorant as usize) };
            return Err(at.bad(Field::Majorant, *majorant));
        }
    }
    Ok(())
}

/// The values of a grid of `n` cells or bricks from `first` on.
fn values(at: Record, to: SectionKind, section: &[f32], first: u32, n: [u32; 3]) -> Result<&[f32], SceneError> {
    // Sides of at most 2^16: neither products nor sum overflow 64 bits.
    let count = n.iter().fold(1u64, |product, n| product.saturating_mul(u64::from(*n)));
    let range = usize::try_from(u64::from(first).saturating_add(count)).map(|end| first as usize..end);
    let found = range.ok().and_then(|range| section.get(range));
    found.ok_or(at.wrong_reference(to, first, section.len()))
}

/// Largest density of a brick and of one cell around it. `densities` has as many values as there are cells.
fn largest(densities: &[f32], [nx, ny, nz]: [u32; 3], brick: [u32; 3]) -> f32 {
    let [xs, ys, zs] = [(0, nx), (1, ny), (2, nz)].map(|(axis, n)| {
        let first = brick.get(axis).copied().unwrap_or(0).saturating_mul(BRICK);
        first.saturating_sub(1)..first.saturating_add(BRICK).saturating_add(1).min(n)
    });
    let index = |x: u32, y: u32, z: u32| {
        let row = (z as usize).saturating_mul(ny as usize).saturating_add(y as usize);
        row.saturating_mul(nx as usize).saturating_add(x as usize)
    };
    let rows = zs.flat_map(|z| ys.clone().map(move |y| (y, z)));
    let rows = rows.filter_map(|(y, z)| densities.get(index(xs.start, y, z)..index(xs.end, y, z)));
    rows.flatten().fold(0.0f32, |most, d| most.max(*d))
}

/// Effects of the medium behind a surface of a validated material.
pub(super) fn effects(scene: &Records<'_>, m: &Material) -> Effects {
    match scene.media.get(m.medium as usize) {
        None => Effects::default(),
        Some(medium) if medium.kind == MediumKind::Grid as u32 => Effects::MEDIA.with(Effects::GRID_MEDIA),
        Some(_) => Effects::MEDIA,
    }
}
