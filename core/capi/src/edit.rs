//! Edits of scenes between frames. Each call is a round of its own: what edits have in common (the table that chooses
//! among lights, boxes around instances) is brought up to date before it returns.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::memory::{apart, array, array_mut, output, read_struct};
use crate::records::{Mirror, croupier_camera, croupier_environment, croupier_light};
use crate::records::{croupier_material, croupier_principled};
use crate::scene::{croupier_scene, scene_at};
use crate::status::croupier_status::{self, *};
use bytemuck::Pod;
use core::ffi::c_void;
use croupier::unstable::accel::Primitive;
use croupier::{EditError, SceneEdit};

impl CoreError for EditError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Missing { .. } => CROUPIER_RANGE,
            Self::Fixed { .. } | Self::Shared { .. } => CROUPIER_EDIT_FIXED,
            Self::Room { .. } => CROUPIER_SIZE,
            _ => CROUPIER_EDIT,
        }
    }
}

/// A round of edits.
///
/// # Safety
/// The caller's promise.
unsafe fn edit<T>(
    scene: *mut croupier_scene,
    change: impl FnOnce(&mut SceneEdit<'_>) -> Result<T, Failure<EditError>>,
) -> Result<T, Failure<EditError>> {
    promised!(edit_with(scene, |_| Ok(()), |round, ()| change(round)))
}

/// A round of edits with arrays of the caller's, which `given` makes of pointers once it has compared them with the
/// places of the scene.
///
/// # Safety
/// The caller's promise.
unsafe fn edit_with<A, T>(
    scene: *mut croupier_scene,
    given: impl FnOnce(&[(usize, usize)]) -> Result<A, Fault>,
    change: impl FnOnce(&mut SceneEdit<'_>, A) -> Result<T, Failure<EditError>>,
) -> Result<T, Failure<EditError>> {
    let mut data = promised!(scene_at(scene))?.write()?;
    let given = given(&data.places(scene))?;
    let mut round = data.scene.edit();
    change(&mut round, given)
}

/// A record of the caller's as the core has it.
///
/// # Safety
/// The caller's promise.
unsafe fn record<R: Pod, T: Pod>(record: *const R, about: &'static str) -> Result<T, Fault> {
    let [record] = promised!(array(record, 1, about))? else { return Err(Fault::new(CROUPIER_NULL, about)) };
    Ok(bytemuck::cast(*record))
}

/// Replaces the camera. CROUPIER_EDIT, with the number that is wrong in the message, if it breaks a rule of scenes;
/// the scene is as before then. As after every edit, sessions of the scene need croupier_session_change_scene before
/// they step again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_camera(
    scene: *mut croupier_scene,
    camera: *const croupier_camera,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let camera = promised!(read_struct(camera))?.to_core();
        promised!(edit(scene, |round| Ok(round.camera(camera)?)))
    })
}

/// Replaces light index: emission, and what else its kind lets change (croupier_light). CROUPIER_EDIT_FIXED if another
/// member differs from croupier_scene_light. Takes a pass over the lights.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_light(
    scene: *mut croupier_scene,
    index: u32,
    light: *const croupier_light,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let light = promised!(record(light, "light"))?;
        promised!(edit(scene, |round| Ok(round.light(index, light)?)))
    })
}

/// Gives all emitting triangles of a material this radiance, linear Rec. 709; *changed, which may be null, becomes
/// their number. Takes a pass over the lights.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_emission(
    scene: *mut croupier_scene,
    material: u32,
    radiance: *const [f32; 3],
    changed: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let radiance = promised!(array(radiance, 1, "radiance"))?.first().copied().unwrap_or_default();
        let mut to = if changed.is_null() { None } else { Some(promised!(output(changed, "changed"))?) };
        let count = promised!(edit(scene, |round| Ok(round.emission(material, radiance)?)))?;
        if let Some(to) = &mut to {
            to.set(count);
        }
        Ok(())
    })
}

/// Replaces the environment's rotation and radiance or scale. CROUPIER_RANGE if there is none, CROUPIER_EDIT_FIXED if
/// another member differs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_environment(
    scene: *mut croupier_scene,
    environment: *const croupier_environment,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let environment = promised!(read_struct(environment))?.to_core();
        promised!(edit(scene, |round| Ok(round.environment(environment)?)))
    })
}

/// Replaces material index and its tables: count numbers, as many as its kind has (none for most kinds: null and 0).
/// Those of croupier_scene_material_tables serve as long as kind, roughness, index of refraction and compensation stay.
/// CROUPIER_EDIT_FIXED if the tables have another length than there is room for, or another material reads them too.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_material(
    scene: *mut croupier_scene,
    index: u32,
    material: *const croupier_material,
    tables: *const f32,
    count: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let material = promised!(record(material, "material"))?;
        let given = |places: &[(usize, usize)]| {
            apart(tables, count, places, "tables")?;
            promised!(array(tables, count, "tables"))
        };
        promised!(edit_with(scene, given, |round, tables| Ok(round.material(index, material, tables)?)))
    })
}

/// Replaces principled material index as a whole. CROUPIER_EDIT_FIXED if the old or the new one is of another kind.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_principled(
    scene: *mut croupier_scene,
    index: u32,
    material: *const croupier_material,
    principled: *const croupier_principled,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let material = promised!(record(material, "material"))?;
        let record = promised!(read_struct(principled))?.to_core();
        promised!(edit(scene, |round| Ok(round.principled(index, material, record)?)))
    })
}

/// Rows of the affine maps of an instance to the space around it, when the shutter opens and when it closes: the same
/// twice if it stands still.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_transform {
    /// The two maps.
    pub to_world: [[[f32; 4]; 3]; 2],
}

/// Moves count instances in one round, whose boxes and lights are brought up to date once. *done, which may be null,
/// becomes the number of those that were moved: all of them, or those before the one that is refused (CROUPIER_EDIT;
/// the message has its index).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_transforms(
    scene: *mut croupier_scene,
    indices: *const u32,
    transforms: *const croupier_transform,
    count: usize,
    done: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let given = |places: &[(usize, usize)]| {
            apart(indices, count, places, "indices")?;
            apart(transforms, count, places, "transforms")?;
            let indices = promised!(array(indices, count, "indices"))?;
            Ok((indices, promised!(array(transforms, count, "transforms"))?))
        };
        let mut to = if done.is_null() { None } else { Some(promised!(output(done, "done"))?) };
        let mut moved = 0usize;
        let result = promised!(edit_with(scene, given, |round, (indices, transforms)| {
            for (index, transform) in indices.iter().zip(transforms) {
                round.transform(*index, transform.to_world)?;
                moved = moved.saturating_add(1);
            }
            Ok(())
        }));
        if let Some(to) = &mut to {
            to.set(moved);
        }
        result
    })
}

/// Shows (visible is not 0) or hides an instance with its lights.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_set_visible(
    scene: *mut croupier_scene,
    index: u32,
    visible: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, { promised!(edit(scene, |round| Ok(round.visible(index, visible != 0)?))) })
}

/// Bytes of scratch memory that croupier_scene_rebuild needs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_rebuild_size(
    scene: *mut croupier_scene,
    bytes: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let mut to = promised!(output(bytes, "bytes"))?;
        let needed = promised!(edit(scene, |round| Ok(round.rebuild_len())))?;
        to.set(needed.saturating_mul(size_of::<Primitive>()));
        Ok(())
    })
}

/// Builds the world's tree anew over its instances as they are, which makes rays faster after far moves. scratch
/// starts at a multiple of 4 and is the program's again when the call returns. CROUPIER_SIZE if it is too small,
/// CROUPIER_RANGE in a scene without instances, CROUPIER_EDIT_FIXED if the blob has too little room; the tree is as it
/// was then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_rebuild(
    scene: *mut croupier_scene,
    scratch: *mut c_void,
    scratch_size: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<EditError>, {
        let count = scratch_size.checked_div(size_of::<Primitive>()).unwrap_or(0);
        let given = |places: &[(usize, usize)]| {
            apart(scratch.cast::<u8>(), scratch_size, places, "scratch")?;
            promised!(array_mut(scratch.cast::<Primitive>(), count, "scratch"))
        };
        promised!(edit_with(scene, given, |round, scratch| {
            round.rebuild(scratch).map_err(|e| match e {
                // the core counts records, the caller bytes
                EditError::Room { needed, .. } => {
                    Fault::sizes("scratch", needed.saturating_mul(size_of::<Primitive>()), scratch_size).into()
                }
                e => e.into(),
            })
        }))
    })
}

/// Makes the bytes of an edited scene a blob again, to be stored: until then their hash is that of the bytes before.
/// Takes a pass over all bytes. The identity of the scene changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_seal(
    scene: *mut croupier_scene,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        promised!(scene_at(scene))?.write()?.scene.seal();
        Ok(())
    })
}
