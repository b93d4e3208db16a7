//! Which library this is.

use crate::fault::{Fault, answer, croupier_message, promised};
use crate::memory::put_text;
use crate::status::croupier_status::{self, *};
use core::ffi::c_char;

/// Version of this interface: it grows when functions, members of structs or numbers are added, and a program for a
/// smaller one works on. What does not work on is another soname.
pub const CROUPIER_ABI_VERSION: u32 = 1;

/// CROUPIER_ABI_VERSION of the library that is loaded: the program needs at least the one that it was compiled with.
#[unsafe(no_mangle)]
pub extern "C" fn croupier_abi_version() -> u32 {
    CROUPIER_ABI_VERSION
}

/// Version of the library, such as 0.1.0. The text is the library's and stays.
#[unsafe(no_mangle)]
pub extern "C" fn croupier_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// A text with a zero byte behind it.
const fn ended<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    let (head, _) = bytes.split_at_mut(text.len());
    head.copy_from_slice(text.as_bytes());
    bytes
}

/// Instruction set that the library was compiled for: x86-64, x86-64-v3, aarch64 and the like. The text is the
/// library's and stays.
#[unsafe(no_mangle)]
pub extern "C" fn croupier_instruction_set() -> *const c_char {
    const SET: [u8; croupier::INSTRUCTION_SET.len() + 1] = ended(croupier::INSTRUCTION_SET);
    static TEXT: [u8; SET.len()] = SET;
    TEXT.as_ptr().cast()
}

/// CROUPIER_OK if the processor, and the operating system, have all instructions that the library was compiled for;
/// CROUPIER_INSTRUCTIONS, with the first that is missing in the message, if not: no other function is to be called
/// then. On other processors than x86-64 nothing is known, and the answer is CROUPIER_OK.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_check_processor(message: *mut croupier_message) -> croupier_status {
    answer!(message, Fault, {
        match croupier::missing_instructions() {
            None => Ok(()),
            Some(missing) => Err(Fault::new(CROUPIER_INSTRUCTIONS, missing)),
        }
    })
}

/// The best instruction set that processor and operating system offer, of those that there are builds for: x86-64,
/// x86-64-v3 or x86-64-v4; elsewhere that of the library. Writes at most size bytes, the last one 0; length, which may
/// be null, becomes the length of the whole text without it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_processor_instruction_set(
    text: *mut c_char,
    size: usize,
    length: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let name = croupier::processor_instruction_set();
        promised!(put_text(text, size, length, |out| _ = out.write_str(name)))
    })
}
