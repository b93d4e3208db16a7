//! What a board gives a program: a reset handler, a stack, a clock, a serial port, blocks of static memory.
//!
//! Two variants: the machine model `mps2-an500` of an emulator, a Cortex-M7 without an operating system; and, with the
//! feature `user-mode`, a process of a user-mode emulator that runs the same Cortex-M7 code. On another board, `write`,
//! `exit`, `clock` and the addresses in `machine.ld` are what to replace.

#![allow(dead_code, reason = "a module of several programs, which do not need all of it")]
#![allow(unused_imports, reason = "as above")]

#[cfg_attr(not(feature = "user-mode"), path = "board/machine.rs")]
#[cfg_attr(feature = "user-mode", path = "board/user.rs")]
mod kind;

pub use kind::{clock, exit, start_clock, write};

use core::cell::UnsafeCell;

unsafe extern "C" {
    /// Lowest word of the stack.
    static __stack_bottom: UnsafeCell<u32>;
    /// End of the stack.
    static __stack_top: UnsafeCell<u32>;
}

/// What the reset handlers fill the stack with.
const PAINT: u32 = 0xc0de_cafe;

/// Bytes of the stack that have been used, and of the whole stack. Needs a stack that the reset handler has painted.
pub fn stack_used() -> [usize; 2] {
    let (bottom, top) = (&raw const __stack_bottom as usize, &raw const __stack_top as usize);
    let mut at = bottom;
    // SAFETY: words of the stack, which the linker script aligns to 8 bytes. Volatile, because the stack is no object of
    // the program.
    while at < top && unsafe { (at as *const u32).read_volatile() } == PAINT {
        at += 4;
    }
    [top - at, top - bottom]
}

/// Static memory that one owner takes at the start.
#[repr(C, align(64))]
pub struct Block<const N: usize>(UnsafeCell<[u8; N]>);

// SAFETY: there is one thread, and no interrupt handler uses blocks.
unsafe impl<const N: usize> Sync for Block<N> {}

impl<const N: usize> Block<N> {
    /// Zeroed memory.
    pub const fn new() -> Self {
        Self(UnsafeCell::new([0; N]))
    }

    /// The memory.
    ///
    /// # Safety
    /// Not more than once for each block.
    pub unsafe fn take(&'static self) -> &'static mut [u8] {
        // SAFETY: the only reference, as the caller promises.
        unsafe { &mut *self.0.get() }
    }
}

/// Writes a name and a number as 16 hexadecimal digits.
pub fn line_hexadecimal(name: &str, x: u64) {
    let digits: [u8; 17] = core::array::from_fn(|i| match i {
        16 => b'\n',
        _ => match (x >> (60 - 4 * i)) as u8 & 15 {
            digit @ 0..10 => b'0' + digit,
            digit => b'a' - 10 + digit,
        },
    });
    write(name.as_bytes());
    write(b" ");
    write(&digits);
}

/// Writes a name and a number.
pub fn line(name: &str, x: u64) {
    write(name.as_bytes());
    write(b" ");
    let mut rest = x;
    let mut digits = [0; 20];
    let mut first = digits.len();
    for (i, digit) in digits.iter_mut().enumerate().rev() {
        (*digit, first) = (b'0' + (rest % 10) as u8, i);
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    write(digits.get(first..).unwrap_or_default());
    write(b"\n");
}
