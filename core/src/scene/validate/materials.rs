//! Materials, their textures and tables.

use super::principled::{has_textures, principled};
use super::record::{Record, records};
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError};
use crate::scene::{Effects, Records};

/// Every texture's texels are in the texels section.
pub(super) fn textures(scene: &Records<'_>) -> Result<(), SceneError> {
    for (at, t) in records(SectionKind::Textures, scene.textures) {
        at.side(Field::Width, t.width, 1)?;
        at.side(Field::Height, t.height, 1)?;
        let mode = |first: u32| t.flags >> first & TEXTURE_WRAP;
        at.zero(t.flags >> 5 == 0 && mode(TEXTURE_WRAP_U) <= TEXTURE_MIRROR && mode(TEXTURE_WRAP_V) <= TEXTURE_MIRROR)?;
        // Sides of at most 2^16: neither product nor sum overflows 64 bits.
        let texels = u64::from(t.width).saturating_mul(u64::from(t.height));
        if u64::from(t.first).saturating_add(texels) > scene.texels.len() as u64 {
            return Err(at.wrong_reference(SectionKind::Texels, t.first, scene.texels.len()));
        }
    }
    Ok(())
}

/// Every material's kind, references and the parameters that the kind uses; the others are finite.
pub(super) fn materials(scene: &Records<'_>) -> Result<(), SceneError> {
    records(SectionKind::Materials, scene.materials).try_for_each(|(at, m)| material(scene, at, m))
}

/// One material.
pub(super) fn material(scene: &Records<'_>, at: Record, m: &Material) -> Result<(), SceneError> {
    let kind = parameters(scene, at, m)?;
    tables(scene, at, m, kind)
}

/// One material but for its tables; its kind.
pub(super) fn parameters(scene: &Records<'_>, at: Record, m: &Material) -> Result<MaterialKind, SceneError> {
    let kind = MaterialKind::from_u32(m.kind);
    let kind = kind.ok_or(SceneError::Kind { of: at.of, index: at.index(), found: m.kind })?;
    at.zero(m.flags & !MATERIAL_FLAGS == 0)?;
    at.finite(Field::Alpha, &[m.alpha])?;
    at.finite(Field::Eta, &m.eta)?;
    at.finite(Field::Extinction, &m.k)?;
    at.finite(Field::InternalReflectance, &[m.fdr])?;
    // What arrives at a surface reads these before it looks at the kind.
    at.follow_if_any(SectionKind::Textures, m.texture, scene.textures)?;
    at.zero(scene.textures.get(m.texture as usize).is_none_or(|t| t.flags == 0))?;
    at.follow_if_any(SectionKind::Media, m.medium, scene.media)?;
    parameter(at, m, Parameter::Reflectance)?;
    kind.facts().parameters.iter().try_for_each(|p| parameter(at, m, *p))?;
    Ok(kind)
}

/// The tables of a material, one behind the other from `table` on; a material without any refers to none.
fn tables(scene: &Records<'_>, at: Record, m: &Material, kind: MaterialKind) -> Result<(), SceneError> {
    let compensated = m.flags & MATERIAL_COMPENSATED != 0;
    let wrong = || at.wrong_reference(SectionKind::Tables, m.table, scene.tables.len());
    let present = |p: &&Parameter| p.entries() > 0 && (compensated || !p.compensates());
    if kind.facts().parameters.contains(&Parameter::Principled) {
        return principled(scene, at, m);
    }
    let mut next = m.table as usize;
    let mut any = false;
    for p in kind.facts().parameters.iter().filter(present) {
        let ([lo, hi], end) = (p.range(), next.saturating_add(p.entries()));
        let field = if p.compensates() { Field::Compensation } else { Field::Reflectance };
        at.all_within(field, scene.tables.get(next..end).ok_or_else(wrong)?, lo, hi)?;
        (next, any) = (end, true);
    }
    if any || m.table == NONE { Ok(()) } else { Err(wrong()) }
}

/// One parameter of a material that uses it.
fn parameter(at: Record, m: &Material, parameter: Parameter) -> Result<(), SceneError> {
    let [lo, hi] = parameter.range();
    match parameter {
        Parameter::Reflectance => at.all_within(Field::Reflectance, &m.reflectance, lo, hi),
        Parameter::Alpha => at.within(Field::Alpha, m.alpha, lo, hi),
        Parameter::RelativeEta => {
            let [eta, ..] = m.eta;
            at.within(Field::Eta, eta, lo, hi)
        }
        Parameter::ComplexEta => {
            at.all_within(Field::Eta, &m.eta, lo, hi)?;
            at.all_within(Field::Extinction, &m.k, lo, hi)?;
            let larger = |(eta, k): (&f32, &f32)| at.within(Field::Extinction, eta.max(*k), MIN_CONDUCTOR, hi);
            m.eta.iter().zip(&m.k).try_for_each(larger)
        }
        Parameter::InternalReflectance => at.within(Field::InternalReflectance, m.fdr, lo, hi),
        // `tables` checks them
        Parameter::TransmittanceTable
        | Parameter::CompensationTable
        | Parameter::EnergyTable
        | Parameter::Principled => Ok(()),
    }
}

/// Effects of a surface of a validated material.
pub(super) fn effects(scene: &Records<'_>, m: &Material) -> Effects {
    let known = MaterialKind::from_u32(m.kind);
    let compensates = known.is_some_and(|k| k.facts().compensates());
    let kind = known.map(Effects::of_material).unwrap_or_default();
    let textured = m.texture != NONE;
    let principled = known.is_some_and(|k| k.facts().parameters.contains(&Parameter::Principled));
    let [by_record, mapped] = if principled { has_textures(scene, m) } else { [false; 2] };
    let also = [
        (textured || by_record, Effects::TEXTURES),
        (mapped, Effects::NORMAL_MAPS),
        ((textured || principled) && m.flags & MATERIAL_CUTOUT != 0, Effects::ALPHA),
        (compensates && m.flags & MATERIAL_COMPENSATED != 0, Effects::MULTIPLE_SCATTERING),
    ];
    also.iter().filter(|(present, _)| *present).fold(kind, |all, (_, effect)| all.with(*effect))
}
