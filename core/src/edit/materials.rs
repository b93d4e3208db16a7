//! Edits of materials and their tables.

use super::editable::SceneEdit;
use super::error::EditError;
use crate::scene::blob::*;
use crate::scene::check;
use core::ops::Range;

impl SceneEdit<'_> {
    /// Replaces a material and the tables that it refers to: as many entries as its kind has, in their order, computed
    /// by whoever bakes materials, or those of [`Scene::material_tables`](crate::Scene::material_tables) as long as kind,
    /// roughness, refractive index and compensation stay; they must fit where the old ones are. Kind, texture and medium may change; triangles
    /// and lights stay as they are. A principled material keeps its record; [`Self::principled`] replaces both.
    ///
    /// A material that goes over to a kind without tables, or without that record, loses the place of those that it had, and cannot
    /// go back.
    ///
    /// Takes a pass over the materials and, where any is smooth, over the lights
    /// ([`Records::highlight`](crate::unstable::scene::Records::highlight)).
    ///
    /// The effects of the scene grow by those of the material and never shrink: a session must have a profile with them.
    ///
    /// # Errors
    /// No such material, one that breaks a rule of the blob, more tables than there is room for, or new tables in a place
    /// that other materials read too ([`EditError::Shared`]: bakers store equal tables once).
    pub fn material(&mut self, index: u32, material: Material, tables: &[f32]) -> Result<(), EditError> {
        let of = SectionKind::Materials;
        let old: Material = self.read(of, index)?;
        let keeps_record = is_layered(&material);
        let kept = keeps_record || !tables.is_empty();
        let material = Material { table: if kept { old.table } else { NONE }, ..material };
        let fits = tables.len() == material.table_entries() && tables.len() <= old.table_entries();
        if !fits || (keeps_record && !is_layered(&old)) {
            return Err(EditError::Fixed { of, index });
        }
        self.replace(index, material, bytemuck::cast_slice(tables))
    }

    /// Replaces a principled material and its record. The tables that the record refers to (reflection and energy) are
    /// any that the scene has; they stay as they are.
    ///
    /// # Errors
    /// As of [`Self::material`]; [`EditError::Fixed`] too if the old or the new material is not a principled one.
    pub fn principled(&mut self, index: u32, material: Material, record: PrincipledRecord) -> Result<(), EditError> {
        let of = SectionKind::Materials;
        let old: Material = self.read(of, index)?;
        if !is_layered(&old) || !is_layered(&material) {
            return Err(EditError::Fixed { of, index });
        }
        self.replace(index, Material { table: old.table, ..material }, bytemuck::cast_slice(&[record]))
    }

    /// Writes a material, and `tables`, bit by bit, where it says.
    fn replace(&mut self, index: u32, material: Material, tables: &[u32]) -> Result<(), EditError> {
        let of = SectionKind::Materials;
        let kept = Tables::replace(self, index, material.table, tables)?;
        let checked = match kept.edit.records() {
            Some(scene) => check::material(&scene, index, &material).map_err(EditError::Invalid),
            None => Err(EditError::Missing { of, index }),
        };
        let effects = match checked {
            Ok(effects) => effects,
            Err(e) => {
                kept.restore();
                return Err(e);
            }
        };
        self.write(of, index, &material);
        *self.effects = self.effects.with(effects);
        self.find_highlight();
        Ok(())
    }
}

/// Has it a principled record?
fn is_layered(m: &Material) -> bool {
    m.kind < u32::BITS && LAYERED_KINDS >> m.kind & 1 != 0
}

/// Entries of the tables section that a material reads.
fn reads(tables: &[f32], m: &Material) -> [Range<usize>; 3] {
    let from = |first: u32, count: usize| first as usize..(first as usize).saturating_add(count);
    let record = PrincipledRecord::read::<1>(tables, m.table).filter(|_| is_layered(m));
    let Some([r]) = record else { return [from(m.table, m.table_entries()), 0..0, 0..0] };
    let energy = if r.energy == NONE { 0..0 } else { from(r.energy, PRINCIPLED_ENERGY_ROWS * EnergyRow::ENTRIES) };
    let reflection = from(r.reflection, PRINCIPLED_ROWS * ReflectionRow::ENTRIES);
    [from(m.table, PrincipledRecord::ENTRIES), reflection, energy]
}

/// Tables of a material, replaced, and how to take that back.
struct Tables<'e, 'a> {
    edit: &'e mut SceneEdit<'a>,
    first: u32,
    old: [u32; TABLE_ROOM],
    count: usize,
}

/// Most entries that an edit replaces.
const TABLE_ROOM: usize = {
    let tables = TRANSMITTANCE_ENTRIES + 2 * COMPENSATION_ENTRIES;
    let record = PrincipledRecord::ENTRIES;
    if tables > record { tables } else { record }
};

impl<'e, 'a> Tables<'e, 'a> {
    /// Writes `new` from entry `first` on, unless it changes what another material than `index` reads.
    fn replace(edit: &'e mut SceneEdit<'a>, index: u32, first: u32, new: &[u32]) -> Result<Self, EditError> {
        let (start, count) = (first as usize, new.len().min(TABLE_ROOM));
        let place = start..start.saturating_add(count);
        if let (Some(scene), true) = (edit.records(), count > 0) {
            let same = scene.tables.get(place.clone()).is_some_and(|old| bytemuck::cast_slice::<f32, u32>(old) == new);
            let meets = |r: &Range<usize>| r.start < place.end && place.start < r.end;
            let others = (0..=u32::MAX).zip(scene.materials).filter(|(i, _)| *i != index && !same);
            for (with, m) in others {
                if reads(scene.tables, m).iter().any(meets) {
                    return Err(EditError::Shared { material: index, with });
                }
            }
        }
        let mut old = [0; TABLE_ROOM];
        for (i, (slot, x)) in (first..=u32::MAX).zip(old.iter_mut().zip(new)) {
            *slot = edit.read(SectionKind::Tables, i).unwrap_or(0);
            edit.write(SectionKind::Tables, i, x);
        }
        Ok(Self { edit, first, old, count })
    }

    fn restore(self) {
        for (i, x) in (self.first..=u32::MAX).zip(self.old.iter().take(self.count)) {
            self.edit.write(SectionKind::Tables, i, x);
        }
    }
}
