//! A validated scene: slices into the caller's bytes.

use super::blob::*;
use super::effects::Effects;
use super::error::{SceneError, SectionFault};
use super::records::Records;
use super::sections::{SectionTable, Sections};
use super::validate;
use crate::instructions::missing_instructions;
use core::ops::Deref;

/// A validated scene: its [`Records`], to be read and not to be changed. [`Scene::from_bytes`] makes one if all of this
/// holds, and nothing re-checks it:
///
/// * every index that a record holds is in range of its section or [`NONE`], and every section has fewer than 2^31
///   records,
/// * the tree is a tree: at most [`MAX_TREE_DEPTH`] nodes on a path, every triangle in exactly one leaf,
/// * instances refer to objects in at most [`MAX_INSTANCE_DEPTH`] levels without cycles, their boxes hold what rays can meet,
/// * every number that a formula reads is finite and in the range that [`super::Field`] states,
/// * no density of a medium's grid exceeds the majorants of the bricks within one cell of it.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'s>(Records<'s>);

impl<'s> Deref for Scene<'s> {
    type Target = Records<'s>;

    #[inline(always)]
    fn deref(&self) -> &Records<'s> {
        &self.0
    }
}

impl<'s> Scene<'s> {
    /// Validates a blob in one pass without allocating; survives any bytes. Bytes beyond the blob's own length are
    /// ignored. The bytes must start at a multiple of 4 (of 64 for full speed).
    ///
    /// # Errors
    /// The first fault found, see [`SceneError`].
    pub fn from_bytes(bytes: &'s [u8]) -> Result<Self, SceneError> {
        Self::validated(bytes).map(|(scene, _)| scene)
    }

    /// [`Self::from_bytes`], and where the sections are.
    pub(crate) fn validated(bytes: &'s [u8]) -> Result<(Self, SectionTable), SceneError> {
        // Hosts begin with a scene: what follows is made of instructions that the processor may not have.
        match missing_instructions() {
            Some(missing) => Err(SceneError::Instructions { missing }),
            None => Self::checked(bytes),
        }
    }

    #[inline(never)]
    fn checked(bytes: &'s [u8]) -> Result<(Self, SectionTable), SceneError> {
        let sections = Sections::new(bytes)?;
        let mut records = Self::records(&sections)?;
        records.effects = validate::scene(&records)?;
        records.highlight = validate::single::highlight(&records, validate::single::brightest(&records));
        Ok((Self(records), sections.table()))
    }

    /// The records of sound sections, without their effects.
    pub(crate) fn records(sections: &Sections<'s>) -> Result<Records<'s>, SceneError> {
        let environment = match sections.records(SectionKind::Environment)? {
            [] => None,
            [environment] => Some(environment),
            more => {
                let fault = SectionFault::Count(more.len() as u64);
                return Err(SceneError::Section { kind: SectionKind::Environment, fault });
            }
        };
        Ok(Records {
            info: sections.one(SectionKind::Info)?,
            nodes: sections.records(SectionKind::Nodes)?,
            leaves: sections.records(SectionKind::Leaves)?,
            triangles: sections.records(SectionKind::Triangles)?,
            vertices: sections.records(SectionKind::Vertices)?,
            materials: sections.records(SectionKind::Materials)?,
            textures: sections.records(SectionKind::Textures)?,
            texels: sections.records(SectionKind::Texels)?,
            tables: sections.records(SectionKind::Tables)?,
            lights: sections.records(SectionKind::Lights)?,
            light_alias: sections.records(SectionKind::LightAlias)?,
            light_nodes: sections.records(SectionKind::LightNodes)?,
            light_trails: sections.records(SectionKind::LightTrails)?,
            environment,
            env_texels: sections.records(SectionKind::EnvTexels)?,
            env_alias: sections.records(SectionKind::EnvAlias)?,
            camera: sections.one(SectionKind::Cameras)?,
            media: sections.records(SectionKind::Media)?,
            densities: sections.records(SectionKind::Densities)?,
            majorants: sections.records(SectionKind::Majorants)?,
            objects: sections.records(SectionKind::Objects)?,
            instances: sections.records(SectionKind::Instances)?,
            names: sections.records(SectionKind::Names)?,
            effects: Effects::default(),
            highlight: 0.0,
            hash: sections.table().hash,
        })
    }

    /// The scene with the effects of all of its materials, for surfaces that are not triangles.
    pub(crate) fn with_all_materials(mut self) -> Self {
        self.0.effects = self.0.effects.with(validate::effects_of_materials(&self.0));
        self
    }

    /// Takes records as they are, for tests that need a part of a scene. If they break a promise of [`Scene`], pictures
    /// may be wrong, it may panic, and a walk of the tree may never end; memory stays safe.
    #[doc(hidden)]
    pub fn assume_valid(records: Records<'s>) -> Self {
        Self(records)
    }

    /// The record of a material, if it is a principled one.
    #[inline(always)]
    pub fn principled(&self, m: &Material) -> Option<&'s PrincipledRecord> {
        if m.kind >= u32::BITS || LAYERED_KINDS >> m.kind & 1 == 0 {
            return None;
        }
        PrincipledRecord::read::<1>(self.0.tables, m.table).map(|[r]| r)
    }

    /// Tables of a material as [`SceneEdit::material`](crate::SceneEdit::material) takes them: none for most kinds. `None` if
    /// there is no such material.
    pub fn material_tables(&self, material: u32) -> Option<&'s [f32]> {
        let m = self.0.materials.get(material as usize)?;
        let (first, count) = (m.table as usize, m.table_entries());
        if count == 0 { Some(&[]) } else { self.0.tables.get(first..first.saturating_add(count)) }
    }

    /// Name of a material, empty if it has none.
    pub fn material_name(&self, material: u32) -> &'s str {
        if (material as usize) < self.materials.len() { self.name(material as usize) } else { "" }
    }

    /// Index of the object that a hit belongs to: of a triangle within instances, the index of the world's instance around
    /// it; of the world's own triangles, their object's number behind the world's instances. [`NONE`] if there is no such
    /// triangle.
    pub fn object_of(&self, triangle: u32, world_instance: u32) -> u32 {
        if world_instance != NONE {
            return world_instance;
        }
        let instances = self.objects.first().map_or(0, |world| world.instances);
        let number = |t: &Triangle| instances.saturating_add(t.flags >> TRIANGLE_OBJECT_SHIFT);
        self.triangles.get(triangle as usize).map_or(NONE, number)
    }

    /// Name of an object by its index ([`Self::object_of`]), empty if it has none. Hosts may bake scenes without names.
    pub fn object_name(&self, object: u32) -> &'s str {
        self.name(self.materials.len().saturating_add(object as usize))
    }

    /// A line of the names.
    fn name(&self, line: usize) -> &'s str {
        core::str::from_utf8(self.names).unwrap_or("").lines().nth(line).unwrap_or("")
    }
}
