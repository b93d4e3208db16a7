//! Records of principled materials, and the tables that they refer to.

use super::record::Record;
use crate::scene::Records;
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError};

/// The record at `table` of a principled material, its textures and tables.
pub(super) fn principled(scene: &Records<'_>, at: Record, m: &Material) -> Result<(), SceneError> {
    let wrong = |found| at.wrong_reference(SectionKind::Tables, found, scene.tables.len());
    let [r] = PrincipledRecord::read(scene.tables, m.table).ok_or_else(|| wrong(m.table))?;
    at.zero(r.flags & !(PRINCIPLED_THIN | PRINCIPLED_ALPHA) == 0)?;
    let [lo, hi] = REFLECTANCE_RANGE;
    for shares in [
        &[r.metalness, r.roughness, r.transmission, r.coat, r.opacity, r.f90][..],
        &r.f0,
        &r.sheen_color,
        &r.coat_layer.albedo,
        &r.coat_layer.nodes,
        &r.sheen_layer.albedo,
        &r.sheen_layer.nodes,
    ] {
        at.all_within(Field::Reflectance, shares, lo, hi)?;
    }
    at.within(Field::Alpha, r.coat_alpha, ALPHA_RANGE[0], ALPHA_RANGE[1])?;
    at.within(Field::SheenWidth, r.sheen_alpha, SHEEN_RANGE[0], SHEEN_RANGE[1])?;
    at.within(Field::Eta, r.eta, PRINCIPLED_ETA_RANGE[0], PRINCIPLED_ETA_RANGE[1])?;
    if (r.eta - 1.0).abs() < PRINCIPLED_CONTRAST {
        return Err(at.bad(Field::Eta, r.eta));
    }
    at.within(Field::NormalScale, r.normal_scale, -MAX_NORMAL_SCALE, MAX_NORMAL_SCALE)?;
    for t in &r.textures {
        at.follow_if_any(SectionKind::Textures, t.texture, scene.textures)?;
        at.all_within(Field::TextureCoordinate, t.transform.as_flattened(), -MAX_COORDINATE, MAX_COORDINATE)?;
    }
    let rows: &[ReflectionRow; PRINCIPLED_ROWS] =
        ReflectionRow::read(scene.tables, r.reflection).ok_or_else(|| wrong(r.reflection))?;
    for row in rows {
        for [normal, grazing, factor, zero] in &row.columns {
            at.all_within(Field::Reflectance, &[*normal, *grazing], lo, hi)?;
            at.within(Field::Compensation, *factor, COMPENSATION_RANGE[0], COMPENSATION_RANGE[1])?;
            at.zero(*zero == 0.0)?;
        }
        at.all_within(Field::Reflectance, row.nodes.as_flattened(), lo, hi)?;
    }
    if r.energy != NONE {
        let rows: &[EnergyRow; PRINCIPLED_ENERGY_ROWS] =
            EnergyRow::read(scene.tables, r.energy).ok_or_else(|| wrong(r.energy))?;
        for row in rows {
            at.all_within(Field::Compensation, row.sides.as_flattened(), ENERGY_RANGE[0], ENERGY_RANGE[1])?;
        }
    }
    Ok(())
}

/// Whether a validated principled material has a texture, and whether that of the normal.
pub(super) fn has_textures(scene: &Records<'_>, m: &Material) -> [bool; 2] {
    let Some([r]) = PrincipledRecord::read(scene.tables, m.table) else { return [false; 2] };
    let there = |t: &TextureRecord| t.texture != NONE;
    let normal = r.textures.get(PrincipledTexture::Normal as usize).is_some_and(there);
    [r.textures.iter().any(there), normal]
}
