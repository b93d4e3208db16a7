//! The environment, its map and the tables that sample it.

use super::alias;
use super::record::{Record, dot, records};
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError, SectionFault};
use crate::scene::{Effects, Records};

/// Effects of a sound environment, and whether it emits.
#[derive(Default)]
pub(super) struct Found {
    pub effects: Effects,
    pub emits: bool,
}

/// The environment, if any, and that its sections have the sizes it calls for.
pub(super) fn environment(scene: &Records<'_>) -> Result<Found, SceneError> {
    let count = |kind, n: usize| SceneError::Section { kind, fault: SectionFault::Count(n as u64) };
    let (texels, tables) = (scene.env_texels.len(), scene.env_alias.len());
    let map = scene.environment.filter(|e| e.kind == EnvironmentKind::Map as u32);
    if map.is_none() && texels != 0 {
        return Err(count(SectionKind::EnvTexels, texels));
    }
    if map.is_none() && tables != 0 {
        return Err(count(SectionKind::EnvAlias, tables));
    }
    let Some(e) = scene.environment else { return Ok(Found::default()) };
    let at = Record { of: SectionKind::Environment, index: 0 };
    let kind = EnvironmentKind::from_u32(e.kind);
    let kind = kind.ok_or(SceneError::Kind { of: at.of, index: 0, found: e.kind })?;
    let effects = Effects::of_environment(kind);
    if at.follow(SectionKind::Lights, e.light, scene.lights)?.kind != LightKind::Environment as u32 {
        return Err(at.wrong_reference(SectionKind::Lights, e.light, scene.lights.len()));
    }
    at.all_within(Field::Emission, &e.radiance, 0.0, MAX_EMISSION)?;
    if map.is_none() {
        return Ok(Found { effects, emits: e.radiance != [0.0; 3] });
    }
    rotation(at, e)?;
    at.side(Field::Width, e.width, 1)?;
    at.side(Field::Height, e.height, 2)?;
    // Sides of at most 2^16: the products fit 64 bits.
    let [width, height, rows] = [e.width, e.height, e.height.saturating_sub(1)].map(u64::from);
    if texels as u64 != width.saturating_mul(height) {
        return Err(count(SectionKind::EnvTexels, texels));
    }
    let brightest = radiance(scene, e)?;
    let black = brightest == [0.0; 3];
    let full = rows.saturating_mul(width.saturating_add(1));
    if tables as u64 != full && !(black && tables == 0) {
        return Err(count(SectionKind::EnvAlias, tables));
    }
    if tables != 0 {
        self::tables(scene.env_alias, e)?;
    }
    Ok(Found { effects, emits: brightest.iter().zip(&e.radiance).any(|(texel, scale)| texel * scale > 0.0) })
}

/// Another rotation and scale of the environment, where `brightest` are the map's largest values by channel.
pub(super) fn placement(e: &Environment, brightest: [f32; 3]) -> Result<(), SceneError> {
    let at = Record { of: SectionKind::Environment, index: 0 };
    at.all_within(Field::Emission, &e.radiance, 0.0, MAX_EMISSION)?;
    if e.kind == EnvironmentKind::Constant as u32 {
        return Ok(());
    }
    rotation(at, e)?;
    at.within(Field::Emission, largest(&brightest) * largest(&e.radiance), 0.0, MAX_EMISSION)
}

/// Largest values of the map by channel.
// once: for the size of modules and firmware
#[inline(never)]
pub(super) fn brightest(scene: &Records<'_>) -> [f32; 3] {
    let mut brightest = [0.0f32; 3];
    for texel in scene.env_texels {
        for (b, x) in brightest.iter_mut().zip(texel) {
            if *x > *b {
                *b = *x;
            }
        }
    }
    brightest
}

fn largest(rgb: &[f32; 3]) -> f32 {
    rgb.iter().fold(0.0f32, |a, b| a.max(*b))
}

/// Rows are unit and at right angles, within 2e-3.
fn rotation(at: Record, e: &Environment) -> Result<(), SceneError> {
    let [x, y, z] = e.to_local;
    for (a, b) in [(x, y), (y, z), (z, x)] {
        at.unit(a)?;
        at.within(Field::Direction, dot(a, b), -2e-3, 2e-3)?;
    }
    Ok(())
}

/// Texels, and the brightest under the largest scale, are legal radiances. Returns the brightest of each channel.
fn radiance(scene: &Records<'_>, e: &Environment) -> Result<[f32; 3], SceneError> {
    for (at, texel) in records(SectionKind::EnvTexels, scene.env_texels) {
        at.all_within(Field::Emission, texel, 0.0, MAX_EMISSION)?;
    }
    let brightest = brightest(scene);
    let at = Record { of: SectionKind::Environment, index: 0 };
    at.within(Field::Emission, largest(&brightest) * largest(&e.radiance), 0.0, MAX_EMISSION)?;
    Ok(brightest)
}

/// One table over the rows of cells, then one per row; rows that are never picked need only be well-formed.
fn tables(entries: &[Alias], e: &Environment) -> Result<(), SceneError> {
    let of = SectionKind::EnvAlias;
    let rows = e.height.saturating_sub(1) as usize;
    let Some((over_rows, cells)) = entries.split_at_checked(rows) else { return Ok(()) };
    alias::well_formed(of, 0, over_rows)?;
    alias::consistent(of, 0, over_rows)?;
    let mut first = rows;
    for (row, table) in over_rows.iter().zip(cells.chunks_exact(e.width.max(1) as usize)) {
        alias::well_formed(of, first, table)?;
        if row.probability > 0.0 {
            alias::consistent(of, first, table)?;
        }
        first = first.saturating_add(table.len());
    }
    Ok(())
}
