//! Composes scenes from triangles that the page has: the blob with its tree, for the renderer and for any other host of
//! Croupier. A module without imports and without an allocator: the page (`site/compose.js`) lays out its memory above
//! `__heap_base` and passes addresses.
//!
//! This file is the boundary, with all of the unsafe code. Every address is that of as many bytes of the module's
//! memory as the function says, at a multiple of 64 where nothing else is said, and nothing else lies there.
//!
//! The functions return the length of a message that they have written, 0 if all went well.
#![no_std]

mod compose;
mod message;

use compose::{Arrays, Numbers};
use core::slice;
use croupier::unstable::scene::blob::Material;
use message::{MESSAGE_BYTES, written};

/// Bytes that a message needs.
#[unsafe(no_mangle)]
pub extern "C" fn message_bytes() -> usize {
    MESSAGE_BYTES
}

/// What [`compose`] takes: addresses and lengths of arrays, then numbers. The arrays need an alignment of 4 only.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Parts {
    positions: *const [f32; 3],
    normals: *const [f32; 3],
    vertices: usize,
    triangles: *const [u32; 3],
    triangle_materials: *const u32,
    triangle_count: usize,
    /// 16 words each (`Material` in `core/src/scene/blob/materials.rs`).
    materials: *const Material,
    /// Radiance of each.
    emission: *const [f32; 3],
    material_count: usize,
    /// Lat-long map.
    sky: *const [f32; 3],
    sky_size: [u32; 2],
    view: Numbers,
}

impl Parts {
    /// # Safety
    /// The page's promise for every array.
    unsafe fn arrays<'a>(&self) -> Arrays<'a> {
        let [columns, rows] = self.sky_size.map(|n| n as usize);
        // SAFETY: the caller's promise
        unsafe {
            Arrays {
                positions: slice::from_raw_parts(self.positions, self.vertices),
                normals: slice::from_raw_parts(self.normals, self.vertices),
                triangles: slice::from_raw_parts(self.triangles, self.triangle_count),
                triangle_materials: slice::from_raw_parts(self.triangle_materials, self.triangle_count),
                materials: slice::from_raw_parts(self.materials, self.material_count),
                emission: slice::from_raw_parts(self.emission, self.material_count),
                sky: slice::from_raw_parts(self.sky, columns.saturating_mul(rows)),
                sky_size: self.sky_size,
                view: self.view,
            }
        }
    }
}

/// Writes the bytes of the two blocks that composing a scene of these parts needs.
///
/// # Safety
/// See above; `sizes` has two words.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn compose_sizes(parts: *const Parts, sizes: *mut [usize; 2], message: *mut u8) -> usize {
    // SAFETY: the page's promise, see the head of this file
    let arrays = unsafe { (*parts).arrays() };
    let found = compose::sizes(&arrays).map(|found| {
        // SAFETY: likewise
        unsafe { sizes.write(found) }
    });
    // SAFETY: the caller's promise
    unsafe { answer(found, message) }
}

/// Composes a scene's blob in the first of two blocks of the [`compose_sizes`] of the same parts, and writes its
/// length. The second block holds nothing of use afterwards.
///
/// # Safety
/// See above; `length` has a word.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn compose(
    parts: *const Parts,
    blocks: *const [*mut u8; 2],
    sizes: *const [usize; 2],
    length: *mut usize,
    message: *mut u8,
) -> usize {
    // SAFETY: the page's promise, see the head of this file
    let (arrays, [blob, scratch], sizes) = unsafe { ((*parts).arrays(), *blocks, *sizes) };
    // SAFETY: likewise
    let blob = unsafe { slice::from_raw_parts_mut(blob, sizes[0]) };
    // SAFETY: likewise
    let scratch = unsafe { slice::from_raw_parts_mut(scratch, sizes[1]) };
    let composed = compose::compose(&arrays, blob, scratch).map(|bytes| {
        // SAFETY: likewise
        unsafe { length.write(bytes) }
    });
    // SAFETY: the caller's promise
    unsafe { answer(composed, message) }
}

/// Writes the message of an error; its length.
///
/// # Safety
/// `message` has [`MESSAGE_BYTES`].
unsafe fn answer<T, E: core::fmt::Display>(result: Result<T, E>, message: *mut u8) -> usize {
    match result {
        Ok(_) => 0,
        Err(e) => {
            // SAFETY: the caller's promise
            let room = unsafe { slice::from_raw_parts_mut(message, MESSAGE_BYTES) };
            written(&e, room)
        }
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // a trap: an exception of the call, in the page
    core::arch::wasm32::unreachable()
}
