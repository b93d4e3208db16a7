//! Prints the results of [`croupier_firmware::probe`], one `name hash` per line, and ends with status 0.
//!
//! There is no panic handler that could run: it calls a function that does not exist, so that the program links only
//! if the optimiser has proved that nothing in it can panic.
#![no_std]
#![no_main]

#[path = "../board.rs"]
mod board;

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    for (name, hash) in croupier_firmware::probe() {
        board::line_hexadecimal(name, hash);
    }
    board::exit(0)
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
