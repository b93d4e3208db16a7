//! Edits of materials and their tables.

use super::editable::SceneEdit;
use super::error::EditError;
use crate::scene::blob::*;
use crate::scene::check;

impl SceneEdit<'_> {
    /// Replaces a material and the tables that it refers to: as many entries as its kind has, in their order, computed
    /// by whoever bakes materials; they must fit where the old ones are. Kind, texture and medium may change; triangles
    /// and lights stay as they are.
    ///
    /// The effects of the scene grow by those of the material and never shrink: a session must have a profile with them.
    ///
    /// # Errors
    /// No such material, one that breaks a rule of the blob, or more tables than there is room for.
    pub fn material(&mut self, index: u32, material: Material, tables: &[f32]) -> Result<(), EditError> {
        let of = SectionKind::Materials;
        let old: Material = self.read(of, index)?;
        let room = |m: &Material| {
            let compensated = m.flags & MATERIAL_COMPENSATED != 0;
            let used = |p: &&Parameter| compensated || !p.compensates();
            let facts = MaterialKind::from_u32(m.kind).map(MaterialKind::facts);
            facts.map_or(0, |f| f.parameters.iter().filter(used).map(|p| p.entries()).sum::<usize>())
        };
        let first = if tables.is_empty() { NONE } else { old.table };
        let material = Material { table: first, ..material };
        if tables.len() != room(&material) || tables.len() > room(&old) {
            return Err(EditError::Fixed { of, index });
        }
        let kept = Tables::new(self, first, tables);
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
        Ok(())
    }
}

/// Tables of a material, replaced, and how to take that back.
struct Tables<'e, 'a> {
    edit: &'e mut SceneEdit<'a>,
    first: u32,
    old: [f32; TABLE_ROOM],
    count: usize,
}

/// Most entries that a material's tables have.
const TABLE_ROOM: usize = TRANSMITTANCE_ENTRIES + 2 * COMPENSATION_ENTRIES;

impl<'e, 'a> Tables<'e, 'a> {
    fn new(edit: &'e mut SceneEdit<'a>, first: u32, new: &[f32]) -> Self {
        let mut old = [0.0; TABLE_ROOM];
        let count = new.len().min(TABLE_ROOM);
        for (i, (slot, x)) in (first..=u32::MAX).zip(old.iter_mut().zip(new)) {
            *slot = edit.read(SectionKind::Tables, i).unwrap_or(0.0);
            edit.write(SectionKind::Tables, i, x);
        }
        Self { edit, first, old, count }
    }

    fn restore(self) {
        for (i, x) in (self.first..=u32::MAX).zip(self.old.iter().take(self.count)) {
            self.edit.write(SectionKind::Tables, i, x);
        }
    }
}
