//! Structs of the header that mirror records of a scene: `struct_size`, then the record's own members in its order.

use crate::memory::{Versioned, zeroed};
use bytemuck::{Pod, Zeroable};
use croupier::unstable::scene::blob;

/// "No such index".
pub const CROUPIER_NONE: u32 = u32::MAX;

/// A struct that is a record of the core behind its size.
pub(crate) trait Mirror: Versioned + Pod {
    type Core: Pod;

    fn from_core(record: &Self::Core) -> Self {
        const { assert!(size_of::<Self>() == size_of::<Self::Core>() + size_of::<u32>()) };
        let mut mirror = Self::empty();
        let members = bytemuck::bytes_of_mut(&mut mirror).get_mut(size_of::<u32>()..).unwrap_or_default();
        members.copy_from_slice(bytemuck::bytes_of(record));
        mirror
    }

    fn to_core(&self) -> Self::Core {
        let mut record = Self::Core::zeroed();
        let members = bytemuck::bytes_of(self).get(size_of::<u32>()..).unwrap_or_default();
        bytemuck::bytes_of_mut(&mut record).copy_from_slice(members);
        record
    }
}

/// Versions, defaults (zeros but for the size) and cores of mirrors.
macro_rules! mirrors {
    ($($mirror:ident = $core:ident, $bytes:literal, $name:literal;)*) => {$(
        // SAFETY: `repr(C)` and Pod, begins with its size.
        unsafe impl Versioned for $mirror {
            const FIRST: u32 = {
                assert!($bytes <= size_of::<Self>());
                $bytes
            };
            const NAME: &'static str = $name;

            fn empty() -> Self {
                zeroed()
            }
        }

        impl Mirror for $mirror {
            type Core = blob::$core;
        }
    )*};
}

mirrors! {
    croupier_camera = Camera, 72, "camera";
    croupier_principled = PrincipledRecord, 536, "principled";
    croupier_environment = Environment, 68, "environment";
}

/// Records that are in arrays have no size of their own: they have the layout of the blob's version.
macro_rules! records {
    ($($record:ident = $core:ident;)*) => {
        $(const _: () = assert!(size_of::<$record>() == size_of::<blob::$core>());)*
    };
}

records! {
    croupier_light = Light;
    croupier_material = Material;
    croupier_texture = Texture;
    croupier_medium = Medium;
}

/// Projections of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum croupier_camera_kind {
    /// Pinhole or thin lens.
    CROUPIER_PERSPECTIVE = 0,
    /// Parallel rays.
    CROUPIER_ORTHOGRAPHIC = 1,
    /// Every direction, latitude by longitude.
    CROUPIER_PANORAMIC = 2,
}

/// The camera of a scene. A pixel sample is a point (x, y) in [0, width) x [0, height), y down; with X = 2 x / width -
/// 1 and Y = 2 y / height - 1 the ray of a perspective camera looks along forward + right X + down Y, from origin or a
/// point of the lens; that of an orthographic one begins at origin + right X + down Y and runs along forward; a
/// panoramic one looks from origin to longitude pi X (0 is forward, positive towards right) and latitude pi/2 Y
/// (positive towards down). Pictures of another shape than width x height keep the height of the view.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_camera {
    /// sizeof(croupier_camera), set by the program.
    pub struct_size: u32,
    /// croupier_camera_kind.
    pub kind: u32,
    /// World position.
    pub origin: [f32; 3],
    /// Unit viewing axis.
    pub forward: [f32; 3],
    /// From the middle of the picture to its right edge: perspective at distance 1, orthographic in world units;
    /// panoramic a unit vector.
    pub right: [f32; 3],
    /// From the middle of the picture to its lower edge, likewise.
    pub down: [f32; 3],
    /// Radius of the lens, world units; 0 is a pinhole, and 0 for other projections than perspective.
    pub lens_radius: f32,
    /// Distance of the plane in focus along the axis, world units.
    pub focus_distance: f32,
    /// Default columns of pictures; sessions keep those of their settings.
    pub width: u32,
    /// Default rows.
    pub height: u32,
}

/// Kinds of lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum croupier_light_kind {
    /// Emitting triangle (its front side).
    CROUPIER_LIGHT_AREA = 0,
    /// Environment, map or constant.
    CROUPIER_LIGHT_ENVIRONMENT = 1,
    /// Isotropic point.
    CROUPIER_LIGHT_POINT = 2,
    /// Parallel light.
    CROUPIER_LIGHT_DIRECTIONAL = 3,
    /// Point that shines into a cone.
    CROUPIER_LIGHT_SPOT = 4,
    /// Parallel light with the spread of a distant disk.
    CROUPIER_LIGHT_SUN = 5,
    /// Sphere that emits to its outside.
    CROUPIER_LIGHT_SPHERE = 6,
    /// Rectangle that emits from its front.
    CROUPIER_LIGHT_RECTANGLE = 7,
    /// Disk that emits from its front.
    CROUPIER_LIGHT_DISK = 8,
}

/// A light of a scene. Colours are linear Rec. 709.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_light {
    /// croupier_light_kind; cannot change.
    pub kind: u32,
    /// Area: index of the triangle; cannot change. Sphere, rectangle, disk: 1 if it emits to both sides, plus 2 if
    /// camera rays do not see it.
    pub triangle: u32,
    /// Area: area of the triangle, world units squared; cannot change.
    pub area: f32,
    /// Area: 1 + index of the world's instance that the triangle is in, or 0; cannot change.
    pub instance: u32,
    /// Point, spot: position. Sphere, rectangle, disk: middle. Directional, sun: unit direction towards the light.
    pub vector: [f32; 3],
    /// Area, sphere, rectangle, disk: radiance. Point: intensity. Spot: intensity on the axis. Directional, sun:
    /// irradiance on a facing surface. Up to 1e18.
    pub emission: [f32; 3],
    /// Spot: unit axis, 1 - cos of the outer and of the inner half angle, 0. Sun: 1 - cos of its angular radius, then
    /// 0. Sphere: radius, then 0. Rectangle: two halves of edges. Disk: unit normal, radius, 0, 0. Others: 0.
    pub params: [f32; 6],
}

/// Kinds of materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum croupier_material_kind {
    /// Lambertian reflection.
    CROUPIER_DIFFUSE = 0,
    /// Perfect mirror without Fresnel.
    CROUPIER_MIRROR = 1,
    /// Smooth conductor.
    CROUPIER_CONDUCTOR = 2,
    /// GGX conductor.
    CROUPIER_ROUGH_CONDUCTOR = 3,
    /// Smooth dielectric interface.
    CROUPIER_DIELECTRIC = 4,
    /// GGX dielectric interface.
    CROUPIER_ROUGH_DIELECTRIC = 5,
    /// Thin dielectric sheet.
    CROUPIER_THIN_DIELECTRIC = 6,
    /// Smooth coat over a diffuse base.
    CROUPIER_PLASTIC = 7,
    /// GGX coat over a diffuse base.
    CROUPIER_ROUGH_PLASTIC = 8,
    /// Index-matched boundary.
    CROUPIER_NULL_BOUNDARY = 9,
    /// Layers of sheen, coat, metal, dielectric, transmission and a diffuse base: croupier_principled.
    CROUPIER_PRINCIPLED = 10,
}

/// A material of a scene. Members that its kind does not use are 0, indices CROUPIER_NONE.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_material {
    /// croupier_material_kind.
    pub kind: u32,
    /// 1 if both sides behave like the front, plus 2 if the texture's alpha is the share of light that meets the
    /// surface, plus 4 if rough models give back what single scattering between microfacets loses.
    pub flags: u32,
    /// Index of the texture that replaces reflectance, or CROUPIER_NONE.
    pub texture: u32,
    /// First entry of its tables. The library's: ignored when a material is set.
    pub table: u32,
    /// Diffuse albedo, or scale of the specular reflection, 0 to 1; base colour of a principled material. Linear Rec.
    /// 709.
    pub reflectance: [f32; 3],
    /// GGX width, 1e-4 to 1.
    pub alpha: f32,
    /// Conductors: real refractive index by channel. Dielectrics and plastics: the first is the index behind the front
    /// side over that before it.
    pub eta: [f32; 3],
    /// Plastics: reflectance of the interface from inside for diffuse light, which baking derives.
    pub fdr: f32,
    /// Conductors: extinction by channel.
    pub k: [f32; 3],
    /// Index of the medium behind the front side, or CROUPIER_NONE.
    pub medium: u32,
}

/// A texture of a scene.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_texture {
    /// First texel among those of all textures.
    pub first: u32,
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Of textures of principled materials: 1 if red, green and blue are numbers and not sRGB, plus 2 (clamped) or 4
    /// (mirrored) along u, plus 8 or 16 along v. Others have 0.
    pub flags: u32,
}

/// A medium, which fills the inside of the surfaces whose material refers to it. Coefficients are per unit length.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_medium {
    /// 0: homogeneous. 1, a density grid, is baked only.
    pub kind: u32,
    /// Absorption coefficient.
    pub sigma_a: [f32; 3],
    /// Scattering coefficient.
    pub sigma_s: [f32; 3],
    /// Emitted radiance: the source per unit length is sigma_a * emission.
    pub emission: [f32; 3],
    /// Mean cosine of the phase function, -0.99 to 0.99, positive forwards.
    pub g: f32,
    /// Grids: smallest corner; else 0.
    pub bounds_min: [f32; 3],
    /// Grids: largest corner; else 0.
    pub bounds_max: [f32; 3],
    /// Grids: cells along x, y, z; else 0.
    pub cells: [u32; 3],
    /// Grids: first density; else 0.
    pub first_density: u32,
    /// Grids: first majorant; else 0.
    pub first_majorant: u32,
    /// 0.
    pub reserved: [u32; 2],
}

/// A texture with an affine map of its coordinates.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_texture_use {
    /// Index of the texture, or CROUPIER_NONE.
    pub texture: u32,
    /// Rows of the matrix that maps (u, v, 1) of the surface to coordinates of the texture.
    pub transform: [[f32; 3]; 2],
}

/// Albedo of a layer of one roughness.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_layer {
    /// By the square roots of cosines, equally spaced from 0 to 1.
    pub albedo: [f32; 32],
    /// At the nodes of a quadrature over cosines.
    pub nodes: [f32; 4],
}

/// What a principled material has besides croupier_material. Numbers without a range are from 0 to 1. The last four
/// members are derived by baking from the roughnesses, the coat and the sheen: keep them with those.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_principled {
    /// sizeof(croupier_principled), set by the program.
    pub struct_size: u32,
    /// Share of metal.
    pub metalness: f32,
    /// Square root of the GGX width.
    pub roughness: f32,
    /// Share of what enters the dielectric that is transmitted.
    pub transmission: f32,
    /// Strength of the coat.
    pub coat: f32,
    /// Share of light that meets the surface, if the material has the flag 2.
    pub opacity: f32,
    /// Reflectance of the dielectric at grazing angles.
    pub f90: f32,
    /// Reflectance of the dielectric at normal incidence.
    pub f0: [f32; 3],
    /// Colour of the sheen.
    pub sheen_color: [f32; 3],
    /// GGX width of the coat, 1e-4 to 1.
    pub coat_alpha: f32,
    /// Width of the distribution of the sheen's fibres, 0.01 to 1.
    pub sheen_alpha: f32,
    /// Refractive index of solid transmission, 0.1 to 10 and at least 0.01 away from 1.
    pub eta: f32,
    /// Factor on the tangential part of mapped normals, up to 1000.
    pub normal_scale: f32,
    /// 1 if what light passes is a sheet and not a solid, plus 2 if the alpha of the base texture multiplies the
    /// opacity.
    pub flags: u32,
    /// First entry of the rows of reflection among the scene's tables.
    pub reflection: u32,
    /// First entry of the rows of energy among the scene's tables, or CROUPIER_NONE.
    pub energy: u32,
    /// Textures: base colour and opacity; metal (blue) and roughness (green); transmission (red); coat (red); normal;
    /// emission.
    pub textures: [croupier_texture_use; 6],
    /// Albedo of the coat at full strength.
    pub coat_layer: croupier_layer,
    /// Albedo of a white sheen.
    pub sheen_layer: croupier_layer,
}

/// The environment of a scene.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_environment {
    /// sizeof(croupier_environment), set by the program.
    pub struct_size: u32,
    /// 0 for constant radiance, 1 for a map by latitude and longitude; cannot change.
    pub kind: u32,
    /// Index of its light; cannot change.
    pub light: u32,
    /// Columns of the map; cannot change.
    pub width: u32,
    /// Rows of the map; cannot change.
    pub height: u32,
    /// Rows of the rotation from the world to the map.
    pub to_local: [[f32; 3]; 3],
    /// Constant: radiance. Map: scale by channel.
    pub radiance: [f32; 3],
}

/// An instance of an object.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_instance {
    /// sizeof(croupier_instance), set by the program.
    pub struct_size: u32,
    /// Index of the object that it places.
    pub object: u32,
    /// 0 if it is hidden.
    pub visible: u32,
    /// Index of its first light among the world's.
    pub first_light: u32,
    /// Rows of the affine maps to the space around it, when the shutter opens and when it closes.
    pub to_world: [[[f32; 4]; 3]; 2],
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_instance {
    const FIRST: u32 = 112;
    const NAME: &'static str = "instance";

    fn empty() -> Self {
        zeroed()
    }
}

impl croupier_instance {
    pub(crate) fn from_core(i: &blob::Instance) -> Self {
        let visible = u32::from(i.flags & blob::INSTANCE_HIDDEN == 0);
        Self { object: i.object, visible, first_light: i.first_light, to_world: i.to_world, ..Self::empty() }
    }
}

/// What a scene has.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_scene_facts {
    /// sizeof(croupier_scene_facts), set by the program.
    pub struct_size: u32,
    /// Default columns of pictures.
    pub width: u32,
    /// Default rows.
    pub height: u32,
    /// Default number of path segments.
    pub max_depth: u32,
    /// Triangles.
    pub triangles: u32,
    /// Materials.
    pub materials: u32,
    /// Lights.
    pub lights: u32,
    /// Media.
    pub media: u32,
    /// Objects; 0 in a scene without instances, else the world and what instances place.
    pub objects: u32,
    /// Instances.
    pub instances: u32,
    /// Smallest coordinates, world space.
    pub bounds_min: [f32; 3],
    /// Largest coordinates.
    pub bounds_max: [f32; 3],
    /// Identity of the scene as it is: changes with every edit, and comes back when an edit is taken back.
    pub identity: u64,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_scene_facts {
    const FIRST: u32 = 72;
    const NAME: &'static str = "facts";

    fn empty() -> Self {
        zeroed()
    }
}

// Numbers of kinds are the core's.
const _: () = {
    use croupier_camera_kind::*;
    use croupier_light_kind::*;
    use croupier_material_kind::*;
    assert!(CROUPIER_PANORAMIC as u32 == blob::CameraKind::Panoramic as u32);
    assert!(CROUPIER_ORTHOGRAPHIC as u32 == blob::CameraKind::Orthographic as u32);
    assert!(blob::CameraKind::ALL.len() == 3);
    assert!(CROUPIER_LIGHT_ENVIRONMENT as u32 == blob::LightKind::Environment as u32);
    assert!(CROUPIER_LIGHT_SPOT as u32 == blob::LightKind::Spot as u32);
    assert!(CROUPIER_LIGHT_DISK as u32 == blob::LightKind::Disk as u32 && blob::LightKind::ALL.len() == 9);
    assert!(CROUPIER_ROUGH_CONDUCTOR as u32 == blob::MaterialKind::RoughConductor as u32);
    assert!(CROUPIER_ROUGH_PLASTIC as u32 == blob::MaterialKind::RoughPlastic as u32);
    assert!(CROUPIER_PRINCIPLED as u32 == blob::MaterialKind::Principled as u32);
    assert!(blob::MaterialKind::ALL.len() == 12);
    assert!(CROUPIER_NONE == blob::NONE);
};
