//! Scenes from arrays: for hosts that bring triangles at run time.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::memory::{ALIGN, Versioned, array, array_mut, output, overlap, range, read_struct};
use crate::memory::{write_struct, zeroed};
use crate::records::{Mirror, croupier_camera, croupier_light, croupier_light_kind, croupier_material};
use crate::records::{croupier_medium, croupier_texture};
use crate::status::croupier_status::{self, *};
use bytemuck::{Pod, Zeroable, cast_slice};
use core::ffi::c_void;
use core::ptr;
use croupier::MemoryError;
use croupier::unstable::compose::{ComposeError, FieldError, LightSource, SceneParts, Sides, Surround, View};
use croupier::unstable::scene::blob::{CameraKind, MaterialKind};

impl CoreError for ComposeError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Blob(MemoryError::Misaligned) | Self::Scratch(MemoryError::Misaligned) => CROUPIER_MISALIGNED,
            Self::Blob(_) | Self::Scratch(_) => CROUPIER_SIZE,
            _ => CROUPIER_COMPOSE,
        }
    }
}

impl CoreError for FieldError {
    fn status(&self) -> croupier_status {
        CROUPIER_RANGE
    }
}

/// Environments of composed scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum croupier_surround {
    /// None.
    CROUPIER_SURROUND_NONE = 0,
    /// The same radiance from all directions.
    CROUPIER_SURROUND_CONSTANT = 1,
    /// A map by latitude and longitude.
    CROUPIER_SURROUND_MAP = 2,
}

/// Arrays that make up a scene. Those that are not needed are null, with a count of 0. Lengths are in the scene's unit,
/// emission is linear Rec. 709. The arrays are read while a call that takes this struct runs, and not afterwards.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_arrays {
    /// sizeof(croupier_arrays), set by the program.
    pub struct_size: u32,
    /// Path segments from the camera, a default for the settings; 0 stands for 40.
    pub max_depth: u32,
    /// Camera, see croupier_camera_from_view.
    pub camera: *const croupier_camera,
    /// Positions of vertices, world space, each coordinate up to 1e9 as a magnitude.
    pub positions: *const [f32; 3],
    /// Normals of vertices, of any length, or null: all triangles are flat. Triangles with a vertex whose normal is 0
    /// are flat.
    pub normals: *const [f32; 3],
    /// Texture coordinates of vertices, v upwards, or null.
    pub uvs: *const [f32; 2],
    /// Number of vertices.
    pub vertices: usize,
    /// Vertices of triangles, counter-clockwise seen from the front. Those without an area are left out of the
    /// scene, and those behind them count on without a gap: triangle_count less the triangles of croupier_scene_facts
    /// are missing, and croupier_scene_triangles gives what the numbers of hits mean.
    pub triangles: *const [u32; 3],
    /// Materials of triangles, or null: all have material 0.
    pub triangle_materials: *const u32,
    /// Number of triangles.
    pub triangle_count: usize,
    /// Materials, see croupier_material_init. fdr of plastics may be 0, and the table of rough ones CROUPIER_NONE:
    /// they are computed then.
    pub materials: *const croupier_material,
    /// Radiance that the triangles of each material emit from their front, or null: none emit.
    pub emission: *const [f32; 3],
    /// Number of materials.
    pub material_count: usize,
    /// Tables that materials refer to.
    pub tables: *const f32,
    /// Number of their entries.
    pub table_count: usize,
    /// Names of materials, UTF-8, each ended by a newline.
    pub names: *const u8,
    /// Bytes of names.
    pub names_size: usize,
    /// Textures.
    pub textures: *const croupier_texture,
    /// Number of textures.
    pub texture_count: usize,
    /// Texels of textures: bytes red, green, blue, alpha from the lowest on; row 0 is the top.
    pub texels: *const u32,
    /// Number of texels.
    pub texel_count: usize,
    /// Homogeneous media, those of higher priority first.
    pub media: *const croupier_medium,
    /// Number of media.
    pub medium_count: usize,
    /// Lights that are no triangles, see croupier_light_from_source. In the scene they follow those of the triangles:
    /// first those without a shape, then the environment, then those with one.
    pub lights: *const croupier_light,
    /// Number of these lights.
    pub light_count: usize,
    /// croupier_surround.
    pub surround: u32,
    /// Map: columns, 1 to 65536.
    pub map_width: u32,
    /// Map: rows, 2 to 65536.
    pub map_height: u32,
    /// Constant: radiance. Map: factor on all texels.
    pub radiance: [f32; 3],
    /// Map: rows of the rotation from the map to the world.
    pub map_to_world: [[f32; 3]; 3],
    /// 0.
    pub reserved: u32,
    /// Map: radiance of its texels, the row towards +Y of the map first.
    pub map: *const [f32; 3],
}

// SAFETY: `repr(C)`, begins with its size; pointers may have any value until they are used, which is the caller's promise.
unsafe impl Versioned for croupier_arrays {
    const FIRST: u32 = size_of::<Self>() as u32;
    const NAME: &'static str = "arrays";

    fn empty() -> Self {
        Self {
            struct_size: size_of::<Self>() as u32,
            max_depth: 0,
            camera: ptr::null(),
            positions: ptr::null(),
            normals: ptr::null(),
            uvs: ptr::null(),
            vertices: 0,
            triangles: ptr::null(),
            triangle_materials: ptr::null(),
            triangle_count: 0,
            materials: ptr::null(),
            emission: ptr::null(),
            material_count: 0,
            tables: ptr::null(),
            table_count: 0,
            names: ptr::null(),
            names_size: 0,
            textures: ptr::null(),
            texture_count: 0,
            texels: ptr::null(),
            texel_count: 0,
            media: ptr::null(),
            medium_count: 0,
            lights: ptr::null(),
            light_count: 0,
            surround: 0,
            map_width: 0,
            map_height: 0,
            radiance: [0.0; 3],
            map_to_world: [[0.0; 3]; 3],
            reserved: 0,
            map: ptr::null(),
        }
    }
}

impl croupier_arrays {
    /// No arrays.
    pub fn none() -> Self {
        Self::empty()
    }
}

/// An array with an entry for each record of another one, or nothing.
///
/// # Safety
/// The caller's promise.
unsafe fn optional<'a, T>(first: *const T, count: usize, about: &'static str) -> Result<&'a [T], Fault> {
    promised!(array(first, if first.is_null() { 0 } else { count }, about))
}

/// The parts that arrays are.
///
/// # Safety
/// The caller's promise for each array.
unsafe fn parts<'a>(arrays: *const croupier_arrays) -> Result<SceneParts<'a>, Fault> {
    let a = promised!(read_struct(arrays))?;
    let camera: croupier_camera = promised!(read_struct(a.camera))?;
    let materials: &[croupier_material] = promised!(array(a.materials, a.material_count, "materials"))?;
    let media: &[croupier_medium] = promised!(array(a.media, a.medium_count, "media"))?;
    let lights: &[croupier_light] = promised!(array(a.lights, a.light_count, "lights"))?;
    let textures: &[croupier_texture] = promised!(array(a.textures, a.texture_count, "textures"))?;
    const CONSTANT: u32 = croupier_surround::CROUPIER_SURROUND_CONSTANT as u32;
    const MAP: u32 = croupier_surround::CROUPIER_SURROUND_MAP as u32;
    let environment = match a.surround {
        0 => None,
        CONSTANT => Some(Surround::Constant { radiance: a.radiance }),
        MAP => {
            let texels = (a.map_width as usize).checked_mul(a.map_height as usize);
            let texels = texels.ok_or(Fault::new(CROUPIER_SIZE, "map"))?;
            let (size, texels) = ([a.map_width, a.map_height], promised!(array(a.map, texels, "map"))?);
            Some(Surround::Map { size, texels, scale: a.radiance, to_world: a.map_to_world })
        }
        other => return Err(Fault::new(CROUPIER_RANGE, "surround").at(other.into())),
    };
    let none = SceneParts::new(camera.to_core());
    Ok(SceneParts {
        positions: promised!(array(a.positions, a.vertices, "positions"))?,
        normals: promised!(optional(a.normals, a.vertices, "normals"))?,
        uvs: promised!(optional(a.uvs, a.vertices, "uvs"))?,
        triangles: promised!(array(a.triangles, a.triangle_count, "triangles"))?,
        triangle_materials: promised!(optional(a.triangle_materials, a.triangle_count, "triangle_materials"))?,
        materials: cast_slice(materials),
        emission: promised!(optional(a.emission, a.material_count, "emission"))?,
        tables: promised!(array(a.tables, a.table_count, "tables"))?,
        names: promised!(array(a.names, a.names_size, "names"))?,
        textures: cast_slice(textures),
        texels: promised!(array(a.texels, a.texel_count, "texels"))?,
        media: cast_slice(media),
        lights: cast_slice(lights),
        environment,
        max_depth: if a.max_depth == 0 { none.max_depth } else { a.max_depth },
        ..none
    })
}

/// Address and length of each array, with its name.
fn arrays_of(p: &SceneParts<'_>) -> [((usize, usize), &'static str); 14] {
    let map = match p.environment {
        Some(Surround::Map { texels, .. }) => range(texels),
        _ => (0, 0),
    };
    [
        (range(p.positions), "positions"),
        (range(p.normals), "normals"),
        (range(p.uvs), "uvs"),
        (range(p.triangles), "triangles"),
        (range(p.triangle_materials), "triangle_materials"),
        (range(p.materials), "materials"),
        (range(p.emission), "emission"),
        (range(p.tables), "tables"),
        (range(p.names), "names"),
        (range(p.textures), "textures"),
        (range(p.texels), "texels"),
        (range(p.media), "media"),
        (range(p.lights), "lights"),
        (map, "map"),
    ]
}

/// Bytes that croupier_scene_compose needs: of the blob (what always suffices; most take a third of it), and of
/// intermediate results. CROUPIER_COMPOSE, with the record and the number that are wrong in the message, if the arrays
/// make no scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_compose_size(
    arrays: *const croupier_arrays,
    blob_size: *mut usize,
    scratch_size: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<ComposeError>, {
        let (mut blob, mut scratch) =
            (promised!(output(blob_size, "blob_size"))?, promised!(output(scratch_size, "scratch_size"))?);
        let layout = promised!(parts(arrays))?.layout()?;
        blob.set(layout.blob.size);
        scratch.set(layout.scratch.size);
        Ok(())
    })
}

/// Builds a scene of arrays: its tree of triangles, its tables, everything that baking does. blob and scratch start at
/// multiples of CROUPIER_ALIGN and overlap neither each other nor an array. *length becomes the blob's own length:
/// blob and length are what croupier_scene_init takes. scratch is the program's again. Takes a time that grows with
/// the triangles times their logarithm. CROUPIER_COMPOSE as of croupier_scene_compose_size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_compose(
    arrays: *const croupier_arrays,
    blob: *mut c_void,
    blob_size: usize,
    scratch: *mut c_void,
    scratch_size: usize,
    length: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<ComposeError>, {
        let mut length = promised!(output(length, "length"))?;
        length.set(0);
        let parts = promised!(parts(arrays))?;
        for (block, about) in [(blob, "blob"), (scratch, "scratch")] {
            if !block.addr().is_multiple_of(ALIGN) {
                return Err(Fault::new(CROUPIER_MISALIGNED, about).into());
            }
        }
        let to = (blob.addr(), blob_size);
        if overlap(to, (scratch.addr(), scratch_size)) {
            return Err(Fault::new(CROUPIER_OVERLAP, "scratch").into());
        }
        for (array, about) in arrays_of(&parts) {
            if overlap(to, array) || overlap((scratch.addr(), scratch_size), array) {
                return Err(Fault::new(CROUPIER_OVERLAP, about).into());
            }
        }
        let blob = promised!(array_mut(blob.cast::<u8>(), blob_size, "blob"))?;
        let scratch = promised!(array_mut(scratch.cast::<u8>(), scratch_size, "scratch"))?;
        length.set(parts.compose(blob, scratch)?.len());
        Ok(())
    })
}

/// Fills in a material: its kind (croupier_material_kind), and what no material of the kind has. CROUPIER_RANGE if
/// there is no such kind.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_material_init(
    material: *mut croupier_material,
    kind: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let mut to = promised!(output(material, "material"))?;
        let kind = MaterialKind::from_u32(kind).ok_or(Fault::new(CROUPIER_RANGE, "kind").at(kind.into()))?;
        to.set(bytemuck::cast(croupier::unstable::scene::blob::Material::new(kind)));
        Ok(())
    })
}

/// A camera by where it is and what it looks at, world space.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_view {
    /// sizeof(croupier_view), set by the program.
    pub struct_size: u32,
    /// croupier_camera_kind.
    pub kind: u32,
    /// Position.
    pub origin: [f64; 3],
    /// A point on the viewing axis.
    pub target: [f64; 3],
    /// Upwards, not parallel to the axis.
    pub up: [f64; 3],
    /// Perspective: full vertical field of view, degrees, above 0.001 and below 179.9. Orthographic: height of the
    /// picture, world units. Panoramic: not read.
    pub extent: f64,
    /// Columns, 1 to 65536.
    pub width: u32,
    /// Rows, 1 to 65536.
    pub height: u32,
    /// Radius of the lens, 0 for a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus along the axis; not read without a lens.
    pub focus_distance: f32,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_view {
    const FIRST: u32 = 104;
    const NAME: &'static str = "view";

    fn empty() -> Self {
        zeroed()
    }
}

/// The camera of a view, for croupier_arrays and croupier_scene_set_camera. CROUPIER_RANGE, with the number in the
/// message, if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_camera_from_view(
    view: *const croupier_view,
    camera: *mut croupier_camera,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<FieldError>, {
        let v = promised!(read_struct(view))?;
        let view = View {
            kind: CameraKind::from_u32(v.kind).ok_or(Fault::new(CROUPIER_RANGE, "kind").at(v.kind.into()))?,
            origin: v.origin,
            target: v.target,
            up: v.up,
            extent: v.extent,
            size: [v.width, v.height],
            lens_radius: v.lens_radius,
            focus_distance: v.focus_distance,
        };
        promised!(write_struct(camera, &croupier_camera::from_core(&view.record()?)))?;
        Ok(())
    })
}

/// A light that is no triangle, in the units that people use. Members that its kind does not have are not read.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_light_source {
    /// sizeof(croupier_light_source), set by the program.
    pub struct_size: u32,
    /// croupier_light_kind, from CROUPIER_LIGHT_POINT on.
    pub kind: u32,
    /// Point, spot: position. Sphere, rectangle, disk: middle.
    pub position: [f32; 3],
    /// Directional, sun, spot: direction in which the light travels. Disk: normal of its front. Of any length but 0.
    pub direction: [f32; 3],
    /// Point, spot: intensity. Directional, sun: irradiance of a facing surface. Sphere, rectangle, disk: radiance.
    pub emission: [f32; 3],
    /// Rectangle: edges, at right angles; the front is where their cross product points.
    pub edges: [[f32; 3]; 2],
    /// Sphere, disk: radius.
    pub radius: f32,
    /// Spot: half angle within which the intensity is full, degrees.
    pub inner_deg: f32,
    /// Spot: half angle at which the intensity reaches 0, degrees.
    pub outer_deg: f32,
    /// Sun: angular diameter, degrees.
    pub angle_deg: f32,
    /// Sphere, rectangle, disk: not 0 if it emits from its back as well.
    pub two_sided: u32,
    /// Sphere, rectangle, disk: not 0 if camera rays do not see it.
    pub hidden: u32,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_light_source {
    const FIRST: u32 = 92;
    const NAME: &'static str = "source";

    fn empty() -> Self {
        zeroed()
    }
}

/// The record of a light, for croupier_arrays and croupier_scene_set_light. A black one is kept: it may light up later.
/// CROUPIER_RANGE, with the number in the message, if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_light_from_source(
    source: *const croupier_light_source,
    light: *mut croupier_light,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<FieldError>, {
        let s = promised!(read_struct(source))?;
        let mut to = promised!(output(light, "light"))?;
        let (position, direction, emission) = (s.position, s.direction, s.emission);
        let sides = Sides { two_sided: s.two_sided != 0, visible: s.hidden == 0 };
        const POINT: u32 = croupier_light_kind::CROUPIER_LIGHT_POINT as u32;
        const DIRECTIONAL: u32 = croupier_light_kind::CROUPIER_LIGHT_DIRECTIONAL as u32;
        const SPOT: u32 = croupier_light_kind::CROUPIER_LIGHT_SPOT as u32;
        const SUN: u32 = croupier_light_kind::CROUPIER_LIGHT_SUN as u32;
        const SPHERE: u32 = croupier_light_kind::CROUPIER_LIGHT_SPHERE as u32;
        const RECTANGLE: u32 = croupier_light_kind::CROUPIER_LIGHT_RECTANGLE as u32;
        const DISK: u32 = croupier_light_kind::CROUPIER_LIGHT_DISK as u32;
        let source = match s.kind {
            POINT => LightSource::Point { position, intensity: emission },
            DIRECTIONAL => LightSource::Directional { direction, irradiance: emission },
            SPOT => {
                let (inner_deg, outer_deg) = (s.inner_deg, s.outer_deg);
                LightSource::Spot { position, direction, intensity: emission, inner_deg, outer_deg }
            }
            SUN => LightSource::Sun { direction, irradiance: emission, angle_deg: s.angle_deg },
            SPHERE => LightSource::Sphere { position, radius: s.radius, radiance: emission, sides },
            RECTANGLE => LightSource::Rectangle { position, edges: s.edges, radiance: emission, sides },
            DISK => LightSource::Disk { position, direction, radius: s.radius, radiance: emission, sides },
            other => return Err(Fault::new(CROUPIER_RANGE, "kind").at(other.into()).into()),
        };
        to.set(bytemuck::cast(source.record()?));
        Ok(())
    })
}
