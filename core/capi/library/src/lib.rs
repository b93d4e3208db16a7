//! What C links: the functions of `croupier-capi`, and what a program without the standard library needs besides.
#![no_std]

pub use croupier_capi::*;

/// Panics are not expected: the library has none on any input that its callers promise. One ends the program, as nothing may
/// unwind into C.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    #[cfg(feature = "link-check")]
    {
        unsafe extern "C" {
            fn croupier_panic_path_left() -> !;
        }
        // SAFETY: there is no such function: what calls it does not link.
        unsafe { croupier_panic_path_left() }
    }
    #[cfg(all(not(feature = "link-check"), any(unix, windows)))]
    {
        unsafe extern "C" {
            fn abort() -> !;
        }
        // SAFETY: of the C library, takes nothing and does not return.
        unsafe { abort() }
    }
    #[cfg(all(not(feature = "link-check"), not(any(unix, windows))))]
    loop {
        core::hint::spin_loop();
    }
}
