//! The record of a principled material and the tables that it refers to, all in the tables section: records of words
//! that are read in place of its floats.

use super::NONE;
use bytemuck::{Pod, Zeroable};

/// Columns of the tables of a principled material: cosines, their square roots equally spaced from 0 to 1, both ends
/// included.
pub const PRINCIPLED_COLUMNS: usize = 32;
/// Rows of the tables of its reflection: roughnesses, equally spaced from 0 to 1, both ends included.
pub const PRINCIPLED_ROWS: usize = 32;
/// Rows of the tables of its solid transmission, as [`PRINCIPLED_ROWS`].
pub const PRINCIPLED_ENERGY_ROWS: usize = 16;
/// Nodes of the quadrature over cosines that scales the diffuse base: Gauss-Legendre in the squared cosine.
pub const PRINCIPLED_NODES: usize = 4;
/// Widths of the distribution of fibres (sheen).
pub const SHEEN_RANGE: [f32; 2] = [1e-2, 1.0];
/// Refractive indices of a principled dielectric, the outside being 1; at least 0.01 away from 1.
pub const PRINCIPLED_ETA_RANGE: [f32; 2] = [0.1, 10.0];
/// Smallest distance of these from 1: a narrower contrast would make transmission a delta lobe.
pub const PRINCIPLED_CONTRAST: f32 = 0.01;
/// Scales of normal maps, as magnitudes.
pub const MAX_NORMAL_SCALE: f32 = 1e3;

/// [`PrincipledRecord::flags`]: what light passes is a sheet, not a solid.
pub const PRINCIPLED_THIN: u32 = 1;
/// [`PrincipledRecord::flags`]: the alpha of the base texture multiplies the opacity.
pub const PRINCIPLED_ALPHA: u32 = 2;

/// A texture with an affine map of its coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TextureRecord {
    /// Index of the texture, or [`NONE`].
    pub texture: u32,
    /// Rows of the matrix that maps (u, v, 1) of the surface to coordinates of the texture.
    pub transform: [[f32; 3]; 2],
}

impl TextureRecord {
    /// No texture.
    pub const NONE: Self = Self { texture: NONE, transform: [[0.0; 3]; 2] };
}

/// Albedo of a layer of one roughness.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LayerRecord {
    /// By cosine ([`PRINCIPLED_COLUMNS`]), 0 to 1.
    pub albedo: [f32; PRINCIPLED_COLUMNS],
    /// At the nodes of the quadrature.
    pub nodes: [f32; PRINCIPLED_NODES],
}

/// Which of [`PrincipledRecord::textures`] is which.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum PrincipledTexture {
    /// Base colour and opacity.
    Base = 0,
    /// Green: roughness; blue: metalness.
    MetalRough = 1,
    /// Red: transmission.
    Transmission = 2,
    /// Red: coat.
    Coat = 3,
    /// Normal in tangent space.
    Normal = 4,
    /// Factor of the radiance that the triangles emit.
    Emission = 5,
}

/// Textures of a principled material.
pub const PRINCIPLED_TEXTURES: usize = 6;

/// A principled material: what [`Material`](super::Material) has no room for. The base colour is the material's
/// `reflectance`. Numbers without a range are from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PrincipledRecord {
    /// Share of metal.
    pub metalness: f32,
    /// Square root of the GGX width.
    pub roughness: f32,
    /// Share of what enters the dielectric that is transmitted.
    pub transmission: f32,
    /// Strength of the coat.
    pub coat: f32,
    /// Share of light that meets the surface, with [`MATERIAL_CUTOUT`](super::MATERIAL_CUTOUT); else all of it does.
    pub opacity: f32,
    /// Reflectance of the dielectric at grazing angles.
    pub f90: f32,
    /// Reflectance of the dielectric at normal incidence.
    pub f0: [f32; 3],
    /// Colour of the sheen.
    pub sheen_color: [f32; 3],
    /// GGX width of the coat, [`ALPHA_RANGE`](super::ALPHA_RANGE).
    pub coat_alpha: f32,
    /// Width of the distribution of the sheen's fibres, [`SHEEN_RANGE`].
    pub sheen_alpha: f32,
    /// Refractive index of solid transmission, [`PRINCIPLED_ETA_RANGE`].
    pub eta: f32,
    /// Factor on the tangential part of mapped normals, up to [`MAX_NORMAL_SCALE`].
    pub normal_scale: f32,
    /// [`PRINCIPLED_THIN`], [`PRINCIPLED_ALPHA`].
    pub flags: u32,
    /// First entry of [`PRINCIPLED_ROWS`] rows [`ReflectionRow`] in the tables section.
    pub reflection: u32,
    /// First entry of [`PRINCIPLED_ENERGY_ROWS`] rows [`EnergyRow`], or [`NONE`]: not compensated.
    pub energy: u32,
    /// By [`PrincipledTexture`].
    pub textures: [TextureRecord; PRINCIPLED_TEXTURES],
    /// Albedo of the coat at full strength.
    pub coat_layer: LayerRecord,
    /// Albedo of a white sheen.
    pub sheen_layer: LayerRecord,
}

/// GGX reflection of one roughness by cosine; the entries of a column are interpolated together.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ReflectionRow {
    /// Each: the single-scattering albedo of Schlick's term `1 - (1 - c)^5`, that of `(1 - c)^5`, and the factor s of
    /// `bsdf/compensation.rs`; the last is 0.
    pub columns: [[f32; 4]; PRINCIPLED_COLUMNS],
    /// The two albedos at the nodes of the quadrature.
    pub nodes: [[f32; 2]; PRINCIPLED_NODES],
}

/// Energy that a rough interface scatters to both sides, by cosine: seen from outside, from inside.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct EnergyRow {
    /// By side and column, [`ENERGY_RANGE`](super::ENERGY_RANGE).
    pub sides: [[f32; PRINCIPLED_COLUMNS]; 2],
}

/// A record that the tables section holds.
pub trait TableRecord: Pod {
    /// Entries that it takes.
    const ENTRIES: usize = size_of::<Self>().div_ceil(size_of::<f32>());

    /// `N` of them from entry `first` of `tables` on.
    #[inline(always)]
    fn read<const N: usize>(tables: &[f32], first: u32) -> Option<&[Self; N]> {
        let first = first as usize;
        let end = first.checked_add(N.checked_mul(Self::ENTRIES)?)?;
        let records = bytemuck::try_cast_slice(tables.get(first..end)?).ok()?;
        records.first_chunk()
    }
}

impl TableRecord for PrincipledRecord {}
impl TableRecord for ReflectionRow {}
impl TableRecord for EnergyRow {}
