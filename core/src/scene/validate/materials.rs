//! Materials, their textures and tables.

use super::{Record, records};
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError};
use crate::scene::{Effects, Records};

/// Every texture's texels are in the texels section.
pub(super) fn textures(scene: &Records<'_>) -> Result<(), SceneError> {
    for (at, t) in records(SectionKind::Textures, scene.textures) {
        at.side(Field::Width, t.width, 1)?;
        at.side(Field::Height, t.height, 1)?;
        at.zero(t.reserved == 0)?;
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
    for (at, m) in records(SectionKind::Materials, scene.materials) {
        let kind = MaterialKind::from_u32(m.kind);
        let kind = kind.ok_or(SceneError::Kind { of: at.of, index: at.index(), found: m.kind })?;
        at.zero(m.flags & !MATERIAL_TWO_SIDED == 0 && m.reserved == 0.0 && m.reserved2 == 0.0)?;
        at.follow_if_any(SectionKind::Textures, m.texture, scene.textures)?;
        at.all_within(Field::Reflectance, &m.reflectance, 0.0, 1.0)?;
        at.all_within(Field::Emission, &m.emission, 0.0, MAX_EMISSION)?;
        at.finite(Field::Alpha, &[m.alpha])?;
        at.finite(Field::Eta, &m.eta)?;
        at.finite(Field::Extinction, &m.k)?;
        at.finite(Field::InternalReflectance, &[m.fdr])?;
        use MaterialKind::*;
        if matches!(kind, RoughConductor | RoughDielectric | RoughPlastic) {
            let [lo, hi] = ALPHA_RANGE;
            at.within(Field::Alpha, m.alpha, lo, hi)?;
        }
        if matches!(kind, Dielectric | RoughDielectric | ThinDielectric | Plastic | RoughPlastic) {
            let ([eta, ..], [lo, hi]) = (m.eta, ETA_RANGE);
            at.within(Field::Eta, eta, lo, hi)?;
        }
        if matches!(kind, Conductor | RoughConductor) {
            conductor(at, m)?;
        }
        if matches!(kind, Plastic | RoughPlastic) {
            // Below 1, so that 1 - reflectance * fdr is above 0.
            at.within(Field::InternalReflectance, m.fdr, 0.0, 1.0 - f32::EPSILON)?;
        }
        table(scene, at, m, kind)?;
    }
    Ok(())
}

/// Per channel eta and k, not both 0: the Fresnel reflectance would be 0/0 at normal incidence.
fn conductor(at: Record, m: &Material) -> Result<(), SceneError> {
    at.all_within(Field::Eta, &m.eta, 0.0, MAX_CONDUCTOR)?;
    at.all_within(Field::Extinction, &m.k, 0.0, MAX_CONDUCTOR)?;
    m.eta.iter().zip(&m.k).try_for_each(|(eta, k)| at.within(Field::Extinction, eta.max(*k), 1e-4, MAX_CONDUCTOR))
}

/// Rough plastics have a table of transmittances, other kinds have none.
fn table(scene: &Records<'_>, at: Record, m: &Material, kind: MaterialKind) -> Result<(), SceneError> {
    let wrong = at.wrong_reference(SectionKind::Tables, m.table, scene.tables.len());
    if kind != MaterialKind::RoughPlastic {
        return if m.table == NONE { Ok(()) } else { Err(wrong) };
    }
    let start = m.table as usize;
    let entries = scene.tables.get(start..start.saturating_add(ROUGH_PLASTIC_ENTRIES as usize)).ok_or(wrong)?;
    at.all_within(Field::Reflectance, entries, 0.0, 1.0)
}

/// What a surface of this (validated) material calls for.
pub(super) fn effects(m: &Material) -> Effects {
    let kind = MaterialKind::from_u32(m.kind).map(Effects::of_material).unwrap_or_default();
    if m.texture == NONE { kind } else { kind.with(Effects::TEXTURES) }
}
