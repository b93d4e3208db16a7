//! Scenes: a baked blob in the caller's memory.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::guarded::{Guarded, Kind};
use crate::memory::{Versioned, apart, array_mut, block, output, put_text, range, write_struct};
use crate::records::{Mirror, croupier_camera, croupier_environment, croupier_instance, croupier_light};
use crate::records::{croupier_material, croupier_principled, croupier_scene_facts};
use crate::status::croupier_status::{self, *};
use core::ffi::{c_char, c_void};
use core::ptr;
use croupier::{EditableScene, Scene, SceneError};

/// A scene: a baked blob in the program's memory. Calls that read it may run on several threads at a time, steps of
/// shards included; an edit needs it for itself.
pub struct croupier_scene {
    _opaque: [u8; 0],
}

/// Alignment of every block of memory that becomes an object, bytes.
pub const CROUPIER_ALIGN: usize = 64;

/// Bytes that croupier_scene_init needs besides the blob.
pub const CROUPIER_SCENE_BYTES: usize = 2048;

/// What a scene object holds.
pub(crate) struct SceneData {
    pub scene: EditableScene<&'static mut [u8]>,
}

impl Kind for SceneData {
    const MARK: u32 = u32::from_le_bytes(*b"CRsc");
    const NAME: &'static str = "scene";
}

const _: () = {
    const fn shared_by_threads<T: Sync>() {}
    shared_by_threads::<SceneData>();
    assert!(size_of::<Guarded<SceneData>>() <= CROUPIER_SCENE_BYTES && CROUPIER_ALIGN == crate::memory::ALIGN);
};

impl SceneData {
    /// Addresses and lengths of the blob and of the object, which is `at`.
    pub(crate) fn places(&self, at: *const croupier_scene) -> [(usize, usize); 2] {
        [range(self.scene.bytes()), (at.addr(), size_of::<Guarded<Self>>())]
    }
}

impl CoreError for SceneError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Instructions { .. } => CROUPIER_INSTRUCTIONS,
            _ => CROUPIER_SCENE,
        }
    }
}

/// The scene at an address.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn scene_at<'a>(scene: *const croupier_scene) -> Result<&'a Guarded<SceneData>, Fault> {
    promised!(Guarded::at(scene.cast()))
}

/// Makes a scene object in memory (CROUPIER_SCENE_BYTES bytes at a multiple of CROUPIER_ALIGN) for a baked blob, which
/// is checked in one pass and then read in place. The blob starts at a multiple of 4, of 64 for full speed; it is the
/// scene's until croupier_scene_destroy, and edits change it. *scene becomes the handle, which is the address of the
/// memory; null after a failure. CROUPIER_SCENE, with the object and the number that are wrong in the message, if the
/// blob is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_init(
    memory: *mut c_void,
    memory_size: usize,
    blob: *mut c_void,
    blob_size: usize,
    scene: *mut *mut croupier_scene,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SceneError>, {
        let mut handle = promised!(output(scene, "scene"))?;
        handle.set(ptr::null_mut());
        let place = block(memory, memory_size, CROUPIER_SCENE_BYTES, "memory")?;
        apart(blob.cast::<u8>(), blob_size, &[(place.addr().get(), CROUPIER_SCENE_BYTES)], "blob")?;
        let bytes: &'static mut [u8] = promised!(array_mut(blob.cast::<u8>(), blob_size, "blob"))?;
        let data = SceneData { scene: EditableScene::new(bytes)? };
        promised!(Guarded::place(place.as_ptr().cast(), data));
        handle.set(place.as_ptr().cast());
        Ok(())
    })
}

/// Ends a scene: its memory and its blob are the program's again. Sessions of it can still be read, not stepped.
/// CROUPIER_BUSY, and the scene goes on, while another call uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_destroy(
    scene: *mut croupier_scene,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(scene_at(scene))?.write()?.bury();
        Ok(())
    })
}

/// What the scene has, and its identity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_info(
    scene: *const croupier_scene,
    facts: *mut croupier_scene_facts,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let s = data.scene.scene();
        let [width, height] = s.camera.size;
        let found = croupier_scene_facts {
            width,
            height,
            max_depth: s.info.max_depth,
            triangles: s.triangles.len() as u32,
            materials: s.materials.len() as u32,
            lights: s.lights.len() as u32,
            media: s.media.len() as u32,
            objects: s.objects.len() as u32,
            instances: s.instances.len() as u32,
            bounds_min: s.info.bounds_min,
            bounds_max: s.info.bounds_max,
            identity: s.hash,
            ..croupier_scene_facts::empty()
        };
        promised!(write_struct(facts, &found))
    })
}

/// Writes a record that a scene has.
///
/// # Safety
/// The caller's promise.
unsafe fn show<M: Mirror>(
    scene: *const croupier_scene,
    to: *mut M,
    index: u32,
    find: impl FnOnce(&Scene<'_>) -> Option<M::Core>,
) -> Result<(), Fault> {
    let data = promised!(scene_at(scene))?.read()?;
    let record = find(&data.scene.scene()).ok_or(Fault::new(CROUPIER_RANGE, M::NAME).at(index.into()))?;
    promised!(write_struct(to, &M::from_core(&record)))
}

/// The camera as it is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_camera(
    scene: *const croupier_scene,
    camera: *mut croupier_camera,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, { promised!(show(scene, camera, 0, |s| Some(*s.camera))) })
}

/// Light index as it is. CROUPIER_RANGE if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_light(
    scene: *const croupier_scene,
    index: u32,
    light: *mut croupier_light,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let found = data.scene.scene().lights.get(index as usize).copied();
        let found = found.ok_or(Fault::new(CROUPIER_RANGE, "light").at(index.into()))?;
        promised!(output(light, "light"))?.set(bytemuck::cast(found));
        Ok(())
    })
}

/// Material index as it is. CROUPIER_RANGE if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_material(
    scene: *const croupier_scene,
    index: u32,
    material: *mut croupier_material,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let found = data.scene.scene().materials.get(index as usize).copied();
        let found = found.ok_or(Fault::new(CROUPIER_RANGE, "material").at(index.into()))?;
        promised!(output(material, "material"))?.set(bytemuck::cast(found));
        Ok(())
    })
}

/// Tables of material index as croupier_scene_set_material takes them, so that a material with tables can get another
/// colour. *needed, which may be null, becomes their number, 0 for most kinds; tables, which may be null, gets them.
/// CROUPIER_RANGE if there is no such material, CROUPIER_SIZE if count is less than needed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_material_tables(
    scene: *const croupier_scene,
    index: u32,
    tables: *mut f32,
    count: usize,
    needed: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let found = data.scene.scene().material_tables(index);
        let found = found.ok_or(Fault::new(CROUPIER_RANGE, "material").at(index.into()))?;
        if !needed.is_null() {
            promised!(output(needed, "needed"))?.set(found.len());
        }
        if tables.is_null() {
            return Ok(());
        }
        if count < found.len() {
            return Err(Fault::sizes("tables", found.len(), count));
        }
        apart(tables, found.len(), &data.places(scene), "tables")?;
        promised!(array_mut(tables, found.len(), "tables"))?.copy_from_slice(found);
        Ok(())
    })
}

/// Triangles first to first + count - 1 as hits number them (croupier_hits8): corners gets the positions of the three
/// vertices of each, materials the material of each; both may be null. An intersector of the program's own is built of
/// these, since composing leaves out triangles without an area and baking may order them anew. Triangles within
/// instances have the space of their object. CROUPIER_RANGE if there are not so many.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_triangles(
    scene: *const croupier_scene,
    first: usize,
    count: usize,
    corners: *mut [[f32; 3]; 3],
    materials: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let s = data.scene.scene();
        let end = first.checked_add(count);
        let found = end.and_then(|end| s.triangles.get(first..end));
        let found = found.ok_or(Fault::new(CROUPIER_RANGE, "first triangle").at(first as u64))?;
        let places = data.places(scene);
        if !corners.is_null() {
            apart(corners, count, &places, "corners")?;
            let position = |v: u32| s.vertices.get(v as usize).map_or([0.0; 3], |v| v.p);
            for (to, t) in promised!(array_mut(corners, count, "corners"))?.iter_mut().zip(found) {
                let [a, b, c] = t.vertex;
                *to = [position(a), position(b), position(c)];
            }
        }
        if !materials.is_null() {
            apart(materials, count, &places, "materials")?;
            for (to, t) in promised!(array_mut(materials, count, "materials"))?.iter_mut().zip(found) {
                *to = t.material;
            }
        }
        Ok(())
    })
}

/// What principled material index has besides croupier_scene_material. CROUPIER_RANGE if there is none, or it is of
/// another kind.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_principled(
    scene: *const croupier_scene,
    index: u32,
    principled: *mut croupier_principled,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(show(scene, principled, index, |s| {
            s.materials.get(index as usize).and_then(|m| s.principled(m)).copied()
        }))
    })
}

/// The environment as it is. CROUPIER_RANGE if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_environment(
    scene: *const croupier_scene,
    environment: *mut croupier_environment,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, { promised!(show(scene, environment, 0, |s| s.environment.copied())) })
}

/// Instance index as it is. CROUPIER_RANGE if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_instance(
    scene: *const croupier_scene,
    index: u32,
    instance: *mut croupier_instance,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let found = data.scene.scene().instances.get(index as usize).map(croupier_instance::from_core);
        let found = found.ok_or(Fault::new(CROUPIER_RANGE, "instance").at(index.into()))?;
        promised!(write_struct(instance, &found))
    })
}

/// Name of material index, empty if it has none. Writes at most size bytes, the last one 0; length, which may be null,
/// becomes the length of the whole name without it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_material_name(
    scene: *const croupier_scene,
    index: u32,
    name: *mut c_char,
    size: usize,
    length: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let scene = data.scene.scene();
        promised!(put_text(name, size, length, |out| _ = out.write_str(scene.material_name(index))))
    })
}

/// Name of object index as CROUPIER_AOV_OBJECT shows it, empty if it has none. Texts as of
/// croupier_scene_material_name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_object_name(
    scene: *const croupier_scene,
    index: u32,
    name: *mut c_char,
    size: usize,
    length: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let scene = data.scene.scene();
        promised!(put_text(name, size, length, |out| _ = out.write_str(scene.object_name(index))))
    })
}
