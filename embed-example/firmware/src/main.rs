//! Prints the results of [`croupier_firmware::probe`], one `name hash` per line, and ends with status 0.
//!
//! Cortex-M7 object code without any library. It runs in a user-mode emulator, whose system calls stand in for a
//! serial port; on a board, `write` and `exit` are the only functions to replace (and a reset handler must switch the
//! FPU on and fill `.data` and `.bss`).
//!
//! There is no panic handler that could run: it calls a function that does not exist, so that the program links only
//! if the optimiser has proved that nothing in it can panic.
#![no_std]
#![no_main]

use core::arch::asm;

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

fn write(text: &[u8]) {
    system_call(WRITE, 1, text.as_ptr() as u32, text.len() as u32);
}

fn exit(status: u32) -> ! {
    system_call(EXIT_GROUP, status, 0, 0);
    loop {}
}

/// A number as 16 hexadecimal digits and a line end.
fn hexadecimal(x: u64) -> [u8; 17] {
    core::array::from_fn(|i| match i {
        16 => b'\n',
        _ => match (x >> (60 - 4 * i)) as u8 & 15 {
            digit @ 0..10 => b'0' + digit,
            digit => b'a' - 10 + digit,
        },
    })
}

/// Where the emulator starts.
#[unsafe(no_mangle)]
extern "C" fn reset() -> ! {
    for (name, hash) in croupier_firmware::probe() {
        write(name.as_bytes());
        write(b" ");
        write(&hexadecimal(hash));
    }
    exit(0)
}

unsafe extern "C" {
    /// Does not exist.
    fn something_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked, see above.
    unsafe { something_can_panic() }
}
