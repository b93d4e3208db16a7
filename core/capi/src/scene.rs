//! Scenes: a baked blob in the caller's memory.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::guarded::{Guarded, Kind};
use crate::memory::{Versioned, array_mut, block, output, overlap, put_text, write_struct};
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
    /// Address and length of the blob.
    pub(crate) fn blob(&self) -> (usize, usize) {
        let bytes = self.scene.bytes();
        (bytes.as_ptr().addr(), bytes.len())
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
        let bytes: &'static mut [u8] = promised!(array_mut(blob.cast::<u8>(), blob_size, "blob"))?;
        if overlap((place.addr().get(), CROUPIER_SCENE_BYTES), (bytes.as_ptr().addr(), bytes.len())) {
            return Err(Fault::new(CROUPIER_OVERLAP, "blob").into());
        }
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
