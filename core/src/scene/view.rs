//! The one door from bytes to a [`Scene`].

use super::Effects;
use super::blob::*;
use bytemuck::Pod;
use core::fmt;

/// A validated scene: slices into the caller's bytes. Nothing re-checks after this.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'s> {
    /// Facts about the whole.
    pub info: &'s SceneInfo,
    /// Tree.
    pub nodes: &'s [Node],
    /// Leaves of the tree.
    pub leaves: &'s [Leaf],
    /// Triangles.
    pub triangles: &'s [Triangle],
    /// Vertices.
    pub vertices: &'s [Vertex],
    /// Materials.
    pub materials: &'s [Material],
    /// Textures.
    pub textures: &'s [Texture],
    /// sRGB texels.
    pub texels: &'s [u32],
    /// Tables of materials.
    pub tables: &'s [f32],
    /// Lights.
    pub lights: &'s [Light],
    /// Alias table over the lights.
    pub light_alias: &'s [Alias],
    /// The environment, if any.
    pub environment: Option<&'s Environment>,
    /// Radiance of the environment map.
    pub env_texels: &'s [[f32; 3]],
    /// Alias tables of the environment map.
    pub env_alias: &'s [Alias],
    /// Camera.
    pub camera: &'s Camera,
    /// Material names, newline-separated.
    pub names: &'s [u8],
    /// What it calls for.
    pub effects: Effects,
    /// Hash of the content.
    pub hash: u64,
}

/// Why bytes are not a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SceneError {
    /// Fewer bytes than the header says.
    Truncated {
        /// Bytes needed.
        needed: u64,
        /// Bytes given.
        given: u64,
    },
    /// The first bytes are not `CROUPIER`.
    Magic,
    /// Made by another version.
    Version(u32),
    /// The bytes must start at a multiple of 4.
    Misaligned,
    /// A section's place, stride or count is impossible.
    Section(SectionKind),
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated { needed, given } => write!(f, "scene blob needs {needed} bytes, {given} given"),
            Self::Magic => write!(f, "not a scene blob: the first bytes are not CROUPIER"),
            Self::Version(v) => write!(f, "scene blob of version {v}, this library reads version {VERSION}"),
            Self::Misaligned => write!(f, "scene blob must start at an address that is a multiple of 4"),
            Self::Section(k) => write!(f, "section `{}` has an impossible place, stride or count", k.name()),
        }
    }
}

impl core::error::Error for SceneError {}

/// The records of section `kind`, empty if there is no such section.
fn section<'s, T: Pod>(bytes: &'s [u8], table: &[Section], kind: SectionKind) -> Result<&'s [T], SceneError> {
    let bad = SceneError::Section(kind);
    let mut found = table.iter().filter(|s| s.kind == kind as u32);
    let Some(s) = found.next() else { return Ok(&[]) };
    if found.next().is_some() || s.stride as usize != size_of::<T>() || s.offset % ALIGN as u64 != 0 {
        return Err(bad);
    }
    let length = s.count.checked_mul(u64::from(s.stride)).ok_or(bad)?;
    let end = s.offset.checked_add(length).ok_or(bad)?;
    let (start, end) = (usize::try_from(s.offset).map_err(|_| bad)?, usize::try_from(end).map_err(|_| bad)?);
    let bytes = bytes.get(start..end).ok_or(bad)?;
    bytemuck::try_cast_slice(bytes).map_err(|_| bad)
}

impl<'s> Scene<'s> {
    /// Validates a blob. Survives any bytes.
    pub fn from_bytes(bytes: &'s [u8]) -> Result<Self, SceneError> {
        let given = bytes.len() as u64;
        let head = bytes.get(..size_of::<Header>()).ok_or(SceneError::Truncated { needed: 64, given })?;
        let header: &Header = bytemuck::try_from_bytes(head).map_err(|_| SceneError::Misaligned)?;
        if header.magic != MAGIC {
            return Err(SceneError::Magic);
        }
        if header.version != VERSION {
            return Err(SceneError::Version(header.version));
        }
        let needed = header.length;
        if given < needed {
            return Err(SceneError::Truncated { needed, given });
        }
        let table_end = size_of::<Header>() as u64 + u64::from(header.sections) * size_of::<Section>() as u64;
        let table = bytes.get(size_of::<Header>()..usize::try_from(table_end).unwrap_or(usize::MAX));
        let table = table.ok_or(SceneError::Truncated { needed: table_end, given })?;
        let table: &[Section] = bytemuck::try_cast_slice(table).map_err(|_| SceneError::Misaligned)?;
        let info: &[SceneInfo] = section(bytes, table, SectionKind::Info)?;
        let camera: &[Camera] = section(bytes, table, SectionKind::Cameras)?;
        let environment: &[Environment] = section(bytes, table, SectionKind::Environment)?;
        let mut scene = Self {
            info: info.first().ok_or(SceneError::Section(SectionKind::Info))?,
            nodes: section(bytes, table, SectionKind::Nodes)?,
            leaves: section(bytes, table, SectionKind::Leaves)?,
            triangles: section(bytes, table, SectionKind::Triangles)?,
            vertices: section(bytes, table, SectionKind::Vertices)?,
            materials: section(bytes, table, SectionKind::Materials)?,
            textures: section(bytes, table, SectionKind::Textures)?,
            texels: section(bytes, table, SectionKind::Texels)?,
            tables: section(bytes, table, SectionKind::Tables)?,
            lights: section(bytes, table, SectionKind::Lights)?,
            light_alias: section(bytes, table, SectionKind::LightAlias)?,
            environment: environment.first(),
            env_texels: section(bytes, table, SectionKind::EnvTexels)?,
            env_alias: section(bytes, table, SectionKind::EnvAlias)?,
            camera: camera.first().ok_or(SceneError::Section(SectionKind::Cameras))?,
            names: section(bytes, table, SectionKind::Names)?,
            effects: Effects::default(),
            hash: header.hash,
        };
        scene.effects = scene.called_for();
        Ok(scene)
    }

    fn called_for(&self) -> Effects {
        let mut e = Effects::of_materials(self.materials).with(Effects::of_lights(self.lights));
        if let Some(env) = self.environment {
            e = e.with(Effects::of_environment(env.kind));
        }
        if self.camera.lens_radius > 0.0 {
            e = e.with(Effects::LENS);
        }
        if self.triangles.iter().any(|t| t.flags & TRIANGLE_SMOOTH != 0) {
            e = e.with(Effects::SMOOTH_NORMALS);
        }
        e
    }
}
