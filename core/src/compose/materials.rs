//! Materials of a blob, and the tables that follow from their parameters.

use super::error::ComposeError;
use super::math::Portable;
use super::microfacet;
use super::parts::SceneParts;
use crate::scene::blob::{MATERIAL_COMPENSATED, Material, MaterialKind, NONE, Parameter, TRANSMITTANCE_ENTRIES};
use crate::scene::{Records, check};

/// What of a material composing derives.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Derived {
    /// Nothing: it has no tables, or its own.
    Nothing,
    /// The internal reflectance of a smooth coat.
    Smooth,
    /// Transmittances and internal reflectance of a rough coat.
    Rough,
    /// Tables that composing does not compute.
    Unknown,
}

fn derived(m: &Material) -> Derived {
    let compensated = m.flags & MATERIAL_COMPENSATED != 0;
    let parameters = MaterialKind::from_u32(m.kind).map_or(&[][..], |kind| kind.facts().parameters);
    let has_table = |p: &&Parameter| match p {
        Parameter::Principled => true,
        p => p.entries() > 0 && (compensated || !p.compensates()),
    };
    let mut tables = parameters.iter().filter(has_table);
    match (m.table, tables.next(), tables.next()) {
        (NONE, Some(Parameter::TransmittanceTable), None) => Derived::Rough,
        (NONE, Some(_), _) => Derived::Unknown,
        (_, None, _) if parameters.contains(&Parameter::InternalReflectance) && m.fdr == 0.0 => Derived::Smooth,
        _ => Derived::Nothing,
    }
}

/// Relative refractive index.
fn eta(m: &Material) -> f32 {
    let [eta, ..] = m.eta;
    eta
}

/// The first of `materials` with a rough coat like this one: they share a table.
fn first_like(materials: &[Material], m: &Material) -> Option<usize> {
    let coat = |m: &Material| [m.alpha.to_bits(), eta(m).to_bits()];
    materials.iter().position(|other| coat(other) == coat(m) && derived(other) == Derived::Rough)
}

/// Checks all materials and what they refer to; how many entries of tables are derived.
pub(super) fn check(parts: &SceneParts<'_>) -> Result<usize, ComposeError> {
    let records = Records {
        materials: parts.materials,
        textures: parts.textures,
        texels: parts.texels,
        tables: parts.tables,
        media: parts.media,
        names: parts.names,
        ..Records::NOTHING
    };
    check::around_materials(&records)?;
    let mut entries = 0usize;
    for (at, (index, m)) in (0u32..).zip(parts.materials).enumerate() {
        check::parameters(&records, index, m)?;
        match derived(m) {
            Derived::Unknown => return Err(ComposeError::Tables { index }),
            // the only one of its like up to here
            Derived::Rough if first_like(parts.materials, m) == Some(at) => {
                entries = entries.saturating_add(TRANSMITTANCE_ENTRIES);
            }
            Derived::Rough => {}
            Derived::Smooth | Derived::Nothing => check::material(&records, index, m).map(|_| ())?,
        }
    }
    Ok(entries)
}

/// Internal reflectance stays below 1, so that the series of internal reflections converges.
fn inside(r: f32) -> f32 {
    let [lo, hi] = Parameter::InternalReflectance.range();
    r.clamp(lo, hi)
}

/// Writes as many materials as there are, and the tables behind those that were given.
pub(super) fn write(parts: &SceneParts<'_>, out: &mut [Material], tables: &mut [f32]) {
    let Some((given, mut derived_tables)) = tables.split_at_mut_checked(parts.tables.len()) else { return };
    given.copy_from_slice(parts.tables);
    let mut first = parts.tables.len() as u32;
    for (at, m) in parts.materials.iter().enumerate() {
        let mut record = *m;
        match derived(m) {
            Derived::Smooth => {
                record.fdr = inside(microfacet::diffuse_fresnel_inside::<Portable>(f64::from(eta(m))));
            }
            Derived::Rough => match first_like(parts.materials, m).filter(|like| *like < at) {
                Some(like) => {
                    let known = out.get(like).copied().unwrap_or(*m);
                    (record.table, record.fdr) = (known.table, known.fdr);
                }
                None => {
                    let table = microfacet::rough_plastic::<Portable>(f64::from(m.alpha), f64::from(eta(m)));
                    let [lo, hi] = Parameter::TransmittanceTable.range();
                    let rest = core::mem::take(&mut derived_tables);
                    let Some((place, rest)) = rest.split_at_mut_checked(TRANSMITTANCE_ENTRIES) else { return };
                    place.iter_mut().zip(table.transmittance).for_each(|(x, t)| *x = t.clamp(lo, hi));
                    (record.table, record.fdr) = (first, inside(table.r));
                    (derived_tables, first) = (rest, first.saturating_add(TRANSMITTANCE_ENTRIES as u32));
                }
            },
            Derived::Nothing | Derived::Unknown => {}
        }
        if let Some(place) = out.get_mut(at) {
            *place = record;
        }
    }
}
