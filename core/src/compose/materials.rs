//! Materials of a blob, and the tables that follow from their parameters.

use super::compensation::{EnergyMatrix, compensated_conductor, compensated_dielectric, compensated_plastic};
use super::error::ComposeError;
use super::math::Portable;
use super::microfacet::{diffuse_fresnel_inside, rough_plastic};
use super::parts::SceneParts;
use crate::scene::blob::{COMPENSATION_ENTRIES, MATERIAL_COMPENSATED, Material, MaterialKind, NONE, Parameter};
use crate::scene::{Records, check};

/// What of a material composing derives.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Derived {
    /// Nothing: it has no tables, or its own.
    Nothing,
    /// The internal reflectance of a smooth coat.
    Smooth,
    /// Tables, and the internal reflectance of a rough coat.
    Tables,
    /// Tables that composing does not compute.
    Unknown,
}

/// What derived tables hold.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DerivedTables {
    /// Entries in all.
    pub(super) entries: usize,
    /// Is an [`EnergyMatrix`] needed to compute them?
    pub(super) matrix: bool,
}

fn parameters(m: &Material) -> &'static [Parameter] {
    MaterialKind::from_u32(m.kind).map_or(&[], |kind| kind.facts().parameters)
}

fn is_compensated(m: &Material) -> bool {
    m.flags & MATERIAL_COMPENSATED != 0
}

/// Parameters of a material that are tables, in their order.
fn tables_of(m: &Material) -> impl Iterator<Item = Parameter> + use<> {
    let compensated = is_compensated(m);
    parameters(m).iter().copied().filter(move |p| p.entries() > 0 && (compensated || !p.compensates()))
}

fn derived(m: &Material) -> Derived {
    let principled = parameters(m).contains(&Parameter::Principled);
    match (m.table, tables_of(m).next()) {
        (NONE, _) if principled => Derived::Unknown,
        (NONE, Some(_)) => Derived::Tables,
        (_, None) if parameters(m).contains(&Parameter::InternalReflectance) && m.fdr == 0.0 => Derived::Smooth,
        _ => Derived::Nothing,
    }
}

/// Relative refractive index; 0 of materials without one.
fn eta(m: &Material) -> f32 {
    let [eta, ..] = m.eta;
    if parameters(m).contains(&Parameter::RelativeEta) { eta } else { 0.0 }
}

/// The first of `materials` that has the tables of this one: they share them.
fn first_like(materials: &[Material], m: &Material) -> Option<usize> {
    let surface = |m: &Material| [m.kind, m.alpha.to_bits(), eta(m).to_bits(), u32::from(is_compensated(m))];
    materials.iter().position(|other| surface(other) == surface(m) && derived(other) == Derived::Tables)
}

/// Checks all materials and what they refer to; what tables are derived.
pub(super) fn check(parts: &SceneParts<'_>) -> Result<DerivedTables, ComposeError> {
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
    let mut all = DerivedTables::default();
    for (at, (index, m)) in (0u32..).zip(parts.materials).enumerate() {
        check::parameters(&records, index, m)?;
        match derived(m) {
            Derived::Unknown => return Err(ComposeError::Tables { index }),
            // the only one of its like up to here
            Derived::Tables if first_like(parts.materials, m) == Some(at) => {
                for table in tables_of(m) {
                    all.entries = all.entries.saturating_add(table.entries());
                    all.matrix |= table == Parameter::CompensationTable;
                }
            }
            Derived::Tables => {}
            Derived::Smooth | Derived::Nothing => check::material(&records, index, m).map(|_| ())?,
        }
    }
    Ok(all)
}

/// Internal reflectance stays below 1, so that the series of internal reflections converges.
fn inside(r: f32) -> f32 {
    let [lo, hi] = Parameter::InternalReflectance.range();
    r.clamp(lo, hi)
}

/// Tables in the making.
struct Tables<'a> {
    /// What is not filled yet.
    rest: &'a mut [f32],
    /// Number of its first entry.
    first: u32,
    matrix: &'a mut [EnergyMatrix],
}

impl Tables<'_> {
    /// Adds a table, its numbers within the range of the parameter.
    fn add(&mut self, parameter: Parameter, numbers: impl IntoIterator<Item = f32>) {
        let [lo, hi] = parameter.range();
        let rest = core::mem::take(&mut self.rest);
        let Some((table, rest)) = rest.split_at_mut_checked(parameter.entries()) else { return };
        table.iter_mut().zip(numbers).for_each(|(place, x)| *place = x.clamp(lo, hi));
        (self.rest, self.first) = (rest, self.first.saturating_add(parameter.entries() as u32));
    }

    /// Adds the tables of a material and tells it.
    fn derive(&mut self, m: &mut Material) {
        let (alpha, eta) = (f64::from(m.alpha), f64::from(eta(m)));
        let compensated = is_compensated(m);
        let mut factors = [1.0; COMPENSATION_ENTRIES];
        if let Some(matrix) = self.matrix.first_mut()
            && tables_of(m).any(|p| p == Parameter::CompensationTable)
        {
            factors = compensated_conductor::<Portable>(alpha, matrix);
        }
        m.table = self.first;
        for p in tables_of(m) {
            match p {
                Parameter::TransmittanceTable => {
                    let coat = match compensated {
                        true => compensated_plastic::<Portable>(alpha, eta, &factors),
                        false => rough_plastic::<Portable>(alpha, eta),
                    };
                    m.fdr = inside(coat.r);
                    self.add(p, coat.transmittance);
                }
                Parameter::CompensationTable => self.add(p, factors.map(|s| s as f32)),
                Parameter::EnergyTable => {
                    let sides = compensated_dielectric::<Portable>(alpha, eta);
                    self.add(p, sides.as_flattened().iter().map(|e| *e as f32));
                }
                Parameter::Reflectance
                | Parameter::Alpha
                | Parameter::RelativeEta
                | Parameter::ComplexEta
                | Parameter::InternalReflectance
                | Parameter::Principled => {}
            }
        }
    }
}

/// Writes as many materials as there are, and the tables behind those that were given.
pub(super) fn write(parts: &SceneParts<'_>, out: &mut [Material], tables: &mut [f32], matrix: &mut [EnergyMatrix]) {
    let Some((given, rest)) = tables.split_at_mut_checked(parts.tables.len()) else { return };
    given.copy_from_slice(parts.tables);
    let mut tables = Tables { rest, first: parts.tables.len() as u32, matrix };
    for (at, m) in parts.materials.iter().enumerate() {
        let mut record = *m;
        match derived(m) {
            Derived::Smooth => record.fdr = inside(diffuse_fresnel_inside::<Portable>(f64::from(eta(m)))),
            Derived::Tables => match first_like(parts.materials, m).filter(|like| *like < at) {
                Some(like) => {
                    let known = out.get(like).copied().unwrap_or(*m);
                    (record.table, record.fdr) = (known.table, known.fdr);
                }
                None => tables.derive(&mut record),
            },
            Derived::Nothing | Derived::Unknown => {}
        }
        if let Some(place) = out.get_mut(at) {
            *place = record;
        }
    }
}
