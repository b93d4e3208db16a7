//! Materials and textures: the records, and the table of what readers and writers of a blob know about each kind.
//!
//! A scattering model is a row of `material_table` here, a kernel `bsdf/NAME.rs`, and a row of `models!` in
//! `bsdf/mod.rs`. From the row here follow its effect and the effect's name, the validator's checks, what the host's
//! baker asks for and derives, and the keys in scene files. A parameter that no model has yet is a [`Parameter`] more;
//! every place that must know it then fails to compile.

use bytemuck::{Pod, Zeroable};

/// GGX widths of rough materials.
pub const ALPHA_RANGE: [f32; 2] = [1e-4, 1.0];
/// Relative refractive indices of dielectrics and plastics.
pub const ETA_RANGE: [f32; 2] = [0.01, 100.0];
/// Refractive indices and extinctions of conductors.
pub const CONDUCTOR_RANGE: [f32; 2] = [0.0, 1e4];
/// Smallest value of the larger of refractive index and extinction of a conductor, per channel: with both 0 the Fresnel
/// reflectance would be 0/0 at normal incidence.
pub const MIN_CONDUCTOR: f32 = 1e-4;
/// Reflectances and transmittances.
pub const REFLECTANCE_RANGE: [f32; 2] = [0.0, 1.0];
/// Internal reflectances of coats: below 1, so that 1 - reflectance * fdr is above 0.
pub const FDR_RANGE: [f32; 2] = [0.0, 1.0 - f32::EPSILON];
/// Entries of a table of transmittances: equally spaced cosines from 0 to 1, both ends included.
pub const TRANSMITTANCE_ENTRIES: usize = 64;
/// Entries of a table of compensation: `x(mu)` of `bsdf/compensation.rs` equally spaced from 0 to 1, both ends included.
pub const COMPENSATION_ENTRIES: usize = 64;
/// Factors s of compensated conductors and coats.
pub const COMPENSATION_RANGE: [f32; 2] = [0.5, 4.0];
/// Energies that rough dielectrics scatter; above 0, because compensation divides by them.
pub const ENERGY_RANGE: [f32; 2] = [1e-12, 1.0];

/// The material kinds, one row each, handed to the macro `$then`: kind and number in the blob, name in scene files,
/// effect, whether light passes it, whether it has delta lobes only, and the parameters that it uses.
macro_rules! material_table {
    ($then:ident) => {
        $then! {
            /// Lambertian reflection.
            Diffuse = 0, "diffuse", DIFFUSE, transmissive: false, delta: false, [Reflectance];
            /// Perfect mirror without Fresnel.
            Mirror = 1, "mirror", MIRROR, transmissive: false, delta: true, [Reflectance];
            /// Smooth conductor.
            Conductor = 2, "conductor", CONDUCTOR, transmissive: false, delta: true, [ComplexEta, Reflectance];
            /// GGX conductor.
            RoughConductor = 3, "roughconductor", ROUGH_CONDUCTOR, transmissive: false, delta: false,
                [ComplexEta, Reflectance, Alpha, CompensationTable];
            /// Smooth dielectric interface.
            Dielectric = 4, "dielectric", DIELECTRIC, transmissive: true, delta: true, [RelativeEta];
            /// GGX dielectric interface.
            RoughDielectric = 5, "roughdielectric", ROUGH_DIELECTRIC, transmissive: true, delta: false,
                [RelativeEta, Alpha, EnergyTable];
            /// Thin dielectric sheet.
            ThinDielectric = 6, "thindielectric", THIN_DIELECTRIC, transmissive: true, delta: true, [RelativeEta];
            /// Smooth coat over a diffuse base.
            Plastic = 7, "plastic", PLASTIC, transmissive: false, delta: false,
                [Reflectance, RelativeEta, InternalReflectance];
            /// GGX coat over a diffuse base.
            RoughPlastic = 8, "roughplastic", ROUGH_PLASTIC, transmissive: false, delta: false,
                [Reflectance, RelativeEta, Alpha, InternalReflectance, TransmittanceTable, CompensationTable];
            /// Index-matched boundary.
            Null = 9, "null", NULL, transmissive: true, delta: true, [];
            /// Layers of sheen, coat, metal, dielectric, transmission and a diffuse base.
            Principled = 10, "principled", PRINCIPLED, transmissive: true, delta: false, [Principled];
            /// A host's own model.
            Own = 11, "own", OWN, transmissive: true, delta: false, [Reflectance, Alpha];
        }
    };
}
pub(crate) use material_table;

/// Row of the table of material kinds: the facts that do not depend on the kernel.
#[derive(Clone, Copy, Debug)]
pub struct MaterialFacts {
    /// Light passes through: the surface scatters from behind as well, and being two-sided means nothing.
    pub transmissive: bool,
    /// All lobes are delta lobes.
    pub delta: bool,
    /// Parameters that the model uses.
    pub parameters: &'static [Parameter],
}

impl MaterialFacts {
    /// Whether [`MATERIAL_COMPENSATED`] means anything.
    pub fn compensates(&self) -> bool {
        self.parameters.iter().any(|p| p.compensates())
    }
}

macro_rules! define {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal, $effect:ident,
        transmissive: $transmissive:literal, delta: $delta:literal, [$($parameter:ident),*];)*) => {
        kinds! {
            /// Scattering models.
            MaterialKind { $($(#[$doc])* $kind = $number, $name;)* }
        }

        impl MaterialKind {
            /// Row of the table.
            pub const fn facts(self) -> &'static MaterialFacts {
                match self {
                    $(Self::$kind => &MaterialFacts {
                        transmissive: $transmissive,
                        delta: $delta,
                        parameters: &[$(Parameter::$parameter),*],
                    }),*
                }
            }
        }
    };
}
material_table!(define);

/// Parameters of scattering models, a closed set. The formulas are in `bsdf/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// `reflectance`, or the texture in its place: diffuse albedo, or scale of a specular reflection.
    Reflectance,
    /// `alpha`: GGX width.
    Alpha,
    /// `eta[0]`: refractive index behind the front side over that before it.
    RelativeEta,
    /// `eta` and `k`: complex refractive index per channel.
    ComplexEta,
    /// `fdr`, derived: reflectance of the coat from inside for diffuse light, by the table if there is one.
    InternalReflectance,
    /// `table`, derived from `eta[0]` and `alpha`: energy that the coat transmits from outside.
    TransmittanceTable,
    /// `table`, or behind the transmittances; derived from `alpha`, with [`MATERIAL_COMPENSATED`] only: factors of
    /// reflection.
    CompensationTable,
    /// `table`, derived from `eta[0]` and `alpha`, with [`MATERIAL_COMPENSATED`] only: energy scattered to both sides,
    /// from outside and then from inside.
    EnergyTable,
    /// `table`: a record of numbers, texture references and tables.
    Principled,
}

impl MaterialKind {
    /// The kind whose scattering model a host brings.
    pub const HOSTS: Self = Self::Own;
    /// The kind of vertices that stand for irradiance: reflects all that arrives, if its reflectance is 1, evenly.
    pub const LAMBERTIAN: Self = Self::Diffuse;
}

/// Bits of the kinds that have a [`PrincipledRecord`](super::PrincipledRecord).
pub const LAYERED_KINDS: u32 = {
    let (mut bits, mut rest) = (0, MaterialKind::ALL);
    while let [kind, others @ ..] = rest {
        let mut parameters = kind.facts().parameters;
        while let [parameter, more @ ..] = parameters {
            bits |= (matches!(parameter, Parameter::Principled) as u32) << *kind as u32;
            parameters = more;
        }
        rest = others;
    }
    bits
};

impl Parameter {
    /// Every parameter.
    pub const ALL: &'static [Self] = &[
        Self::Reflectance,
        Self::Alpha,
        Self::RelativeEta,
        Self::ComplexEta,
        Self::InternalReflectance,
        Self::TransmittanceTable,
        Self::CompensationTable,
        Self::EnergyTable,
        Self::Principled,
    ];

    /// Smallest and largest value allowed of each number.
    pub const fn range(self) -> [f32; 2] {
        match self {
            Self::Reflectance | Self::TransmittanceTable | Self::Principled => REFLECTANCE_RANGE,
            Self::Alpha => ALPHA_RANGE,
            Self::RelativeEta => ETA_RANGE,
            Self::ComplexEta => CONDUCTOR_RANGE,
            Self::InternalReflectance => FDR_RANGE,
            Self::CompensationTable => COMPENSATION_RANGE,
            Self::EnergyTable => ENERGY_RANGE,
        }
    }

    /// Keys in scene files; none for what baking derives from other parameters.
    pub const fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Reflectance => &["reflectance"],
            Self::Alpha => &["alpha"],
            Self::RelativeEta => &["int_ior", "ext_ior"],
            Self::ComplexEta => &["eta", "k"],
            // each key of a principled material has a default
            Self::InternalReflectance
            | Self::TransmittanceTable
            | Self::CompensationTable
            | Self::EnergyTable
            | Self::Principled => &[],
        }
    }

    /// Entries in the tables section, behind those of the parameters before it in the row of the kind.
    pub const fn entries(self) -> usize {
        match self {
            Self::TransmittanceTable => TRANSMITTANCE_ENTRIES,
            Self::CompensationTable => COMPENSATION_ENTRIES,
            Self::EnergyTable => 2 * COMPENSATION_ENTRIES,
            Self::Reflectance
            | Self::Alpha
            | Self::RelativeEta
            | Self::ComplexEta
            | Self::InternalReflectance
            | Self::Principled => 0,
        }
    }

    /// Whether materials without [`MATERIAL_COMPENSATED`] do without it.
    pub const fn compensates(self) -> bool {
        matches!(self, Self::CompensationTable | Self::EnergyTable)
    }
}

/// One material, a cache line; fields a kind does not use are 0. See `bsdf/` for each model's parameters.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Material {
    /// [`MaterialKind`].
    pub kind: u32,
    /// [`MATERIAL_TWO_SIDED`], [`MATERIAL_CUTOUT`], [`MATERIAL_COMPENSATED`].
    pub flags: u32,
    /// Texture index that replaces `reflectance`, or [`NONE`](super::NONE).
    pub texture: u32,
    /// First entry of this material's table in the tables section, or [`NONE`](super::NONE).
    pub table: u32,
    /// Linear Rec. 709; diffuse albedo or scale of the specular reflection.
    pub reflectance: [f32; 3],
    /// GGX width.
    pub alpha: f32,
    /// Conductors: real refractive index per channel. Dielectrics and plastics: `eta[0]` = int_ior / ext_ior.
    pub eta: [f32; 3],
    /// Plastics: reflectance of the interface from inside for diffuse light (`Fdr`, or `R` of the rough plastic).
    pub fdr: f32,
    /// Conductors: extinction per channel.
    pub k: [f32; 3],
    /// Index of the medium behind the front side, or [`NONE`](super::NONE): the surface bounds no medium.
    pub medium: u32,
}

impl Material {
    /// Entries of the tables of its kind, from `table` on; 0 for a principled one, whose record says where they are.
    pub fn table_entries(&self) -> usize {
        let compensated = self.flags & MATERIAL_COMPENSATED != 0;
        let used = |p: &&Parameter| compensated || !p.compensates();
        let facts = MaterialKind::from_u32(self.kind).map(MaterialKind::facts);
        facts.map_or(0, |f| f.parameters.iter().filter(used).map(|p| p.entries()).sum())
    }

    /// A material of this kind without texture, tables and medium; its numbers are 0, and those that the kind uses
    /// ([`MaterialFacts::parameters`]) are still to be set.
    pub const fn new(kind: MaterialKind) -> Self {
        Self {
            kind: kind as u32,
            flags: 0,
            texture: super::NONE,
            table: super::NONE,
            reflectance: [0.0; 3],
            alpha: 0.0,
            eta: [0.0; 3],
            fdr: 0.0,
            k: [0.0; 3],
            medium: super::NONE,
        }
    }
}

/// Both sides behave like the front.
pub const MATERIAL_TWO_SIDED: u32 = 1;
/// The texture's alpha is the share of light that meets the surface; the rest passes straight through.
pub const MATERIAL_CUTOUT: u32 = 2;
/// Rough models give back what single scattering between microfacets loses; nothing to models without roughness.
pub const MATERIAL_COMPENSATED: u32 = 4;
/// Every flag of a material.
pub const MATERIAL_FLAGS: u32 = MATERIAL_TWO_SIDED | MATERIAL_CUTOUT | MATERIAL_COMPENSATED;

/// One texture: `width * height` texels from `first` in the texels section; row 0 is the top (v = 1).
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Texture {
    /// First texel.
    pub first: u32,
    /// Columns, >= 1.
    pub width: u32,
    /// Rows, >= 1.
    pub height: u32,
    /// [`TEXTURE_LINEAR`], wrapping along both axes ([`TEXTURE_WRAP_U`], [`TEXTURE_WRAP_V`]). Textures in
    /// [`Material::texture`] have 0.
    pub flags: u32,
}

/// Red, green and blue are numbers, code / 255; else sRGB-encoded.
pub const TEXTURE_LINEAR: u32 = 1;
/// Bits of a wrapping mode, at [`TEXTURE_WRAP_U`] and [`TEXTURE_WRAP_V`].
pub const TEXTURE_WRAP: u32 = 3;
/// First bit of the wrapping mode along u.
pub const TEXTURE_WRAP_U: u32 = 1;
/// First bit of the wrapping mode along v.
pub const TEXTURE_WRAP_V: u32 = 3;
/// Wrapping mode: the texture again beyond its edges.
pub const TEXTURE_REPEAT: u32 = 0;
/// Wrapping mode: the texel at the edge.
pub const TEXTURE_CLAMP: u32 = 1;
/// Wrapping mode: the texture mirrored at its edges.
pub const TEXTURE_MIRROR: u32 = 2;
