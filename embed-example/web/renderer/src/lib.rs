//! Croupier for a web page: a module without imports, without an allocator and without variables of its own. The page
//! (`site/croupier.js`) grows the memory, decides what lies where above `__heap_base`, and passes addresses; the
//! clock, the size of steps and the threads (workers with an instance of their own) are the page's, too.
//!
//! ```text
//! scene_open -> picture_sizes -> picture_open -> picture_begin -> picture_step ... -> picture_finish ...
//!                                                |     ^                                      |
//!                  scene_look -> picture_restart +     +--------------------------------------+
//!
//! picture_show -> tone_map or false_colors -> ImageData
//! ```
//!
//! This file is the boundary, with all of the unsafe code. What every function asks of the page:
//!
//! * an address is that of as many bytes of the module's memory as the function says, at a multiple of 64, and nothing
//!   else lies there;
//! * scenes and pictures lie where [`scene_open`] and [`picture_open`] were told to put them; they are valid until
//!   their own bytes, or those of the blob and the blocks that they were made of, are used for something else.
//!
//! The functions that can be refused return 0 if all went well, else a [`Refused`] as a number: messages are in the page,
//! which keeps the module small. The composer, which sees what users bring, names objects and numbers.
#![no_std]

mod color;
mod picture;
mod scene;

use core::slice;
use picture::{Picture, Plane};
use scene::OpenScene;

/// Why something is refused. The page has the words.
#[derive(Clone, Copy)]
#[repr(u32)]
pub enum Refused {
    /// The bytes are no scene.
    Scene = 1,
    /// The camera breaks a rule of scenes.
    Camera = 2,
    /// The settings are no pairs of names and values, or one of them is unknown or out of its range.
    Setting = 3,
    /// The settings do not fit together.
    Settings = 4,
    /// The scene calls for effects that the module's kernels do not have, or the memory does not fit.
    Session = 5,
}

/// Bytes of a scene (0) and of a picture (1): what lies at their addresses.
#[unsafe(no_mangle)]
pub extern "C" fn control_bytes(what: u32) -> usize {
    if what == 0 { size_of::<OpenScene>() } else { size_of::<Picture<'_>>() }
}

/// Validates the blob of `length` bytes and puts a scene at `scene`, [`control_bytes`]`(0)` bytes.
///
/// # Safety
/// See above. The scene keeps the blob.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn scene_open(scene: *mut OpenScene, blob: *mut u8, length: usize) -> u32 {
    // SAFETY: the page's promise, for as long as it uses the scene
    let blob = unsafe { slice::from_raw_parts_mut(blob, length) };
    let opened = OpenScene::new(blob).map(|opened| {
        // SAFETY: the page's promise; what lay there has nothing to drop
        unsafe { scene.write(opened) }
    });
    status(opened)
}

/// Writes the camera's record, 17 words (`Camera` in `core/src/scene/blob.rs`), and behind it the scene's box:
/// smallest and largest coordinates.
///
/// # Safety
/// See above; `out` has 23 words.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn scene_view(scene: *const OpenScene, out: *mut [u32; 23]) {
    // SAFETY: the page's promise, see the head of this file
    let scene = unsafe { &*scene };
    // SAFETY: likewise
    unsafe { out.write(scene.view()) };
}

/// Replaces the camera by one of [`scene_view`]'s record. Pictures of the scene are to be restarted.
///
/// # Safety
/// See above; `camera` has 17 words.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn scene_look(scene: *mut OpenScene, camera: *const [u32; 17]) -> u32 {
    // SAFETY: the page's promise, see the head of this file
    let (scene, camera) = unsafe { (&mut *scene, &*camera) };
    status(scene.look(camera))
}

/// Writes the bytes of the two blocks that a picture with these settings needs: `name=value` pairs with spaces between.
///
/// # Safety
/// See above; `settings` has `length` bytes, `sizes` two words.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_sizes(
    scene: *const OpenScene,
    settings: *const u8,
    length: usize,
    sizes: *mut [usize; 2],
) -> u32 {
    // SAFETY: the page's promise, see the head of this file
    let (scene, settings) = unsafe { (&*scene, slice::from_raw_parts(settings, length)) };
    let planned = picture::plan(scene, settings).map(|plan| {
        // SAFETY: likewise
        unsafe { sizes.write([plan.session().size, plan.shard().size]) }
    });
    status(planned)
}

/// Puts a picture of the scene at `picture`, [`control_bytes`]`(1)` bytes, with blocks of the [`picture_sizes`] of the
/// same settings.
///
/// # Safety
/// See above. The picture keeps both blocks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_open(
    picture: *mut Picture<'static>,
    scene: *const OpenScene,
    settings: *const u8,
    length: usize,
    blocks: *const [*mut u8; 2],
) -> u32 {
    // SAFETY: the page's promise, see the head of this file
    let (scene, settings, [session, shard]) = unsafe { (&*scene, slice::from_raw_parts(settings, length), *blocks) };
    let opened = picture::plan(scene, settings).and_then(|plan| {
        // SAFETY: the page's promise, for as long as it uses the picture: it has asked for the sizes
        let session = unsafe { slice::from_raw_parts_mut(session, plan.session().size) };
        // SAFETY: likewise
        let shard = unsafe { slice::from_raw_parts_mut(shard, plan.shard().size) };
        Picture::new(scene, &plan, session, shard)
    });
    let opened = opened.map(|opened| {
        // SAFETY: likewise; what lay there has nothing to drop
        unsafe { picture.write(opened) }
    });
    status(opened)
}

/// Begins a new picture of the scene as it is now; what roulette and splitting have learned stays.
///
/// # Safety
/// See above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_restart(picture: *mut Picture<'static>, scene: *const OpenScene) -> u32 {
    // SAFETY: the page's promise, see the head of this file
    let (picture, scene) = unsafe { (&mut *picture, &*scene) };
    status(picture.restart(scene))
}

/// Begins an iteration of so many samples per pixel.
///
/// # Safety
/// See above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_begin(picture: *mut Picture<'static>, samples: u32) {
    // SAFETY: the page's promise, see the head of this file
    let picture = unsafe { &mut *picture };
    picture.begin(samples);
}

/// Traces about so many rays of the iteration: 0 if there is more to do, 1 at its end.
///
/// # Safety
/// See above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_step(picture: *mut Picture<'static>, scene: *const OpenScene, rays: u32) -> u32 {
    // SAFETY: the page's promise, see the head of this file
    let (picture, scene) = unsafe { (&mut *picture, &*scene) };
    u32::from(picture.step(scene, rays))
}

/// Merges and learns, about as long as so many rays take: 0 if there is more to do, 1 when the next iteration can
/// begin.
///
/// # Safety
/// See above.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_finish(picture: *mut Picture<'static>, rays: u32) -> u32 {
    // SAFETY: the page's promise, see the head of this file
    let picture = unsafe { &mut *picture };
    u32::from(picture.finish(rays))
}

/// Writes four floats for each pixel, row by row: a colour or a value, and the number of samples that it is of. 1 if
/// there is such a [`Plane`].
///
/// # Safety
/// See above; `out` has room for `pixels`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_show(
    picture: *const Picture<'static>,
    scene: *const OpenScene,
    plane: u32,
    out: *mut [f32; 4],
    pixels: usize,
) -> u32 {
    // SAFETY: the page's promise, see the head of this file
    let (picture, scene, out) = unsafe { (&*picture, &*scene, slice::from_raw_parts_mut(out, pixels)) };
    u32::from(Plane::from_number(plane).is_some_and(|plane| picture.show(scene, plane, out)))
}

/// Writes what [`Picture::numbers`] lists.
///
/// # Safety
/// See above; `out` has room for them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn picture_numbers(picture: *const Picture<'static>, out: *mut [f64; picture::NUMBERS]) {
    // SAFETY: the page's promise, see the head of this file
    let picture = unsafe { &*picture };
    // SAFETY: likewise
    unsafe { out.write(picture.numbers()) };
}

/// Adds the pixels of another picture of the same view to those at `into`, each by its number of samples.
///
/// # Safety
/// See above; both have room for `pixels`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn average(into: *mut [f32; 4], from: *const [f32; 4], pixels: usize) {
    // SAFETY: the page's promise, see the head of this file
    let (into, from) = unsafe { (slice::from_raw_parts_mut(into, pixels), slice::from_raw_parts(from, pixels)) };
    color::average(into, from);
}

/// Colours times `gain` as 8-bit sRGB with a shoulder for highlights; pixels without samples are transparent.
///
/// # Safety
/// See above; both have room for `pixels`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tone_map(from: *const [f32; 4], pixels: usize, gain: f32, out: *mut [u8; 4]) {
    // SAFETY: the page's promise, see the head of this file
    let (from, out) = unsafe { (slice::from_raw_parts(from, pixels), slice::from_raw_parts_mut(out, pixels)) };
    color::tone_map(from, gain, out);
}

/// Roulette factors as colours: red ends paths, white leaves them, blue splits them; pixels without a value are grey.
///
/// # Safety
/// See above; both have room for `pixels`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn false_colors(from: *const [f32; 4], pixels: usize, out: *mut [u8; 4]) {
    // SAFETY: the page's promise, see the head of this file
    let (from, out) = unsafe { (slice::from_raw_parts(from, pixels), slice::from_raw_parts_mut(out, pixels)) };
    color::false_colors(from, out);
}

fn status<T>(result: Result<T, Refused>) -> u32 {
    result.map_or_else(|refused| refused as u32, |_| 0)
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // a trap: an exception of the call, in the page
    core::arch::wasm32::unreachable()
}
