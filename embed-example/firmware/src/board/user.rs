//! A process of a user-mode emulator: Linux system calls stand in for a serial port, and there is no clock.

use core::arch::{asm, global_asm};

// Where the emulator starts: a stack of the program's own, painted.
global_asm!(
    ".text",
    ".syntax unified",
    ".thumb_func",
    ".global reset",
    "reset:",
    "ldr r0, =__stack_bottom",
    "ldr r1, =__stack_top",
    "mov sp, r1",
    "ldr r2, =0xc0decafe",
    "1: str r2, [r0], #4",
    "cmp r0, r1",
    "blo 1b",
    "bl main",
    ".ltorg",
);

/// Number of the system call that writes bytes.
const WRITE: u32 = 4;
/// Number of the system call that ends the program.
const EXIT_GROUP: u32 = 248;

fn system_call(number: u32, a: u32, b: u32, c: u32) -> u32 {
    let result;
    // SAFETY: both calls used here read memory at most. r7 is the frame pointer, hence kept in r12.
    unsafe {
        asm!("mov r12, r7", "mov r7, {number}", "svc 0", "mov r7, r12",
            number = in(reg) number, inlateout("r0") a => result, in("r1") b, in("r2") c, out("r12") _);
    }
    result
}

/// Writes bytes to standard output.
pub fn write(text: &[u8]) {
    system_call(WRITE, 1, text.as_ptr() as u32, text.len() as u32);
}

/// Ends the program.
pub fn exit(status: u32) -> ! {
    system_call(EXIT_GROUP, status, 0, 0);
    loop {}
}

/// There is no clock.
pub fn start_clock() {}

/// There is no clock.
pub fn clock() -> u32 {
    0
}
