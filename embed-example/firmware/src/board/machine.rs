//! The machine model `mps2-an500` of qemu-system-arm: text goes out by semihosting, and so does the exit status.

use core::arch::{asm, global_asm};

// The vector table, and the reset handler: it paints the stack, switches the FPU on before any code that uses it, copies
// `.data` from flash and clears `.bss`. Faults end the program with status 3.
global_asm!(
    ".section .vectors, \"a\", %progbits",
    ".word __stack_top",
    ".word reset",
    ".rept 14",
    ".word fault",
    ".endr",
    ".text",
    ".syntax unified",
    ".thumb_func",
    ".global reset",
    "reset:",
    "ldr r0, =0xe000ed88", // CPACR: coprocessors 10 and 11 are the FPU
    "ldr r1, [r0]",
    "orr r1, r1, #0xf00000",
    "str r1, [r0]",
    "dsb",
    "isb",
    "ldr r0, =__stack_bottom",
    "ldr r1, =__stack_top",
    "ldr r2, =0xc0decafe",
    "1: str r2, [r0], #4",
    "cmp r0, r1",
    "blo 1b",
    "ldr r0, =__data_start",
    "ldr r1, =__data_end",
    "ldr r2, =__data_load",
    "b 3f",
    "2: ldr r3, [r2], #4",
    "str r3, [r0], #4",
    "3: cmp r0, r1",
    "blo 2b",
    "ldr r0, =__bss_start",
    "ldr r1, =__bss_end",
    "movs r2, #0",
    "b 5f",
    "4: str r2, [r0], #4",
    "5: cmp r0, r1",
    "blo 4b",
    "bl main",
    ".thumb_func",
    "fault:",
    "movs r0, #3",
    "b end_program",
    ".ltorg",
);

/// Semihosting: opens a file, closes it, writes to it, ends the program with a status.
const SYS_OPEN: u32 = 0x01;
const SYS_CLOSE: u32 = 0x02;
const SYS_WRITE: u32 = 0x05;
const SYS_EXIT_EXTENDED: u32 = 0x20;
/// Reason of an ordinary exit.
const APPLICATION_EXIT: u32 = 0x20026;
/// Mode of a file that is written.
const MODE_WRITE: u32 = 4;

fn semihosting<const N: usize>(operation: u32, arguments: [u32; N]) -> u32 {
    let result;
    // SAFETY: the debugger reads the arguments, and the memory that they point to; the calls used here write none.
    unsafe {
        asm!("bkpt 0xab", inlateout("r0") operation => result, in("r1") &raw const arguments, options(nostack));
    }
    result
}

/// Writes bytes to the debugger's console.
pub fn write(text: &[u8]) {
    let console = semihosting(SYS_OPEN, [b":tt\0".as_ptr() as u32, MODE_WRITE, 3]);
    semihosting(SYS_WRITE, [console, text.as_ptr() as u32, text.len() as u32]);
    semihosting(SYS_CLOSE, [console]);
}

/// Ends the program.
pub fn exit(status: u32) -> ! {
    end_program(status)
}

#[unsafe(no_mangle)]
extern "C" fn end_program(status: u32) -> ! {
    semihosting(SYS_EXIT_EXTENDED, [APPLICATION_EXIT, status]);
    loop {}
}

/// The system timer's registers: control, reload value, current value.
const SYSTICK: [*mut u32; 3] = [0xe000_e010 as *mut u32, 0xe000_e014 as *mut u32, 0xe000_e018 as *mut u32];
/// Largest value of the 24-bit timer.
const MOST: u32 = 0x00ff_ffff;

/// Starts the system timer with the processor's clock, without its interrupt.
pub fn start_clock() {
    let [control, reload, current] = SYSTICK;
    for (register, value) in [(reload, MOST), (current, 0), (control, 0b101)] {
        // SAFETY: the timer's registers, which every Cortex-M7 has; nothing else uses them.
        unsafe { register.write_volatile(value) };
    }
}

/// Time since the start in cycles of the timer, 24 bits. It wraps around.
pub fn clock() -> u32 {
    // SAFETY: as above.
    MOST - (unsafe { SYSTICK[2].read_volatile() } & MOST)
}
