//! Instructions that this build uses, and whether the processor has them.
//!
//! `wide` chooses instructions when it is compiled; a program for a newer processor than the one it runs on is ended by
//! the system in the middle of a computation. Hosts ask [`missing_instructions`] before anything else;
//! [`crate::Session::new`] asks as well.

/// The instruction set that this build of the crate computes with.
pub const INSTRUCTION_SET: &str = if cfg!(all(target_arch = "x86_64", target_feature = "avx512f")) {
    "x86-64-v4"
} else if cfg!(all(target_arch = "x86_64", target_feature = "avx2")) {
    "x86-64-v3"
} else if cfg!(target_arch = "x86_64") {
    "x86-64"
} else if cfg!(target_arch = "x86") {
    "x86"
} else if cfg!(target_arch = "aarch64") {
    "aarch64"
} else if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) {
    "wasm simd128"
} else if cfg!(target_arch = "wasm32") {
    "wasm"
} else if cfg!(target_arch = "arm") {
    "arm"
} else {
    "scalar"
};

/// The first instruction set that this build uses and the processor lacks.
///
/// Asks the processor itself: the standard library's detection answers "yes" at compile time for what the compiler was
/// allowed to use, which is exactly what is in doubt here. Builds for the baseline of their architecture run
/// everywhere. The function is small and computes with integers, so that it runs where the rest would not.
#[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
#[inline(never)]
pub fn missing_instructions() -> Option<&'static str> {
    use core::arch::x86_64::{__cpuid, __cpuid_count};
    let (leaves, extended) = (__cpuid(0).eax, __cpuid(0x8000_0000).eax);
    let one = __cpuid(1).ecx;
    let seven = if leaves >= 7 { __cpuid_count(7, 0).ebx } else { 0 };
    let extended = if extended >= 0x8000_0001 { __cpuid(0x8000_0001).ecx } else { 0 };
    let saved = if leaves >= 13 { __cpuid_count(13, 0).ebx } else { 0 };
    first_missing(one, seven, extended, saved).or(missing_avx512(seven))
}

/// See the other one: nothing can be missing.
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2")))]
pub fn missing_instructions() -> Option<&'static str> {
    None
}

/// From `ecx` of leaf 1, `ebx` of leaf 7, `ecx` of leaf 0x8000_0001 and `ebx` of leaf 13: the bytes that the states take
/// which the system saves now (Intel SDM vol. 2, CPUID; AMD APM vol. 3, appendix E). 512 + 64 are those of SSE with the
/// header; AVX has 256 behind them (Intel SDM vol. 1, 13.5).
#[cfg(any(test, all(target_arch = "x86_64", target_feature = "avx2")))]
fn first_missing(one: u32, seven: u32, extended: u32, saved: u32) -> Option<&'static str> {
    let sets = [
        ("AVX", one & 1 << 28 != 0),
        ("the operating system's support for AVX", one & 1 << 27 != 0 && saved >= 512 + 64 + 256),
        ("AVX2", seven & 1 << 5 != 0),
        ("FMA", one & 1 << 12 != 0),
        ("F16C", one & 1 << 29 != 0),
        ("MOVBE", one & 1 << 22 != 0),
        ("BMI1", seven & 1 << 3 != 0),
        ("BMI2", seven & 1 << 8 != 0),
        ("LZCNT", extended & 1 << 5 != 0),
    ];
    sets.iter().find(|(_, present)| !present).map(|(name, _)| *name)
}

/// From `ebx` of leaf 7: the sets of x86-64-v4, if the build may use them.
#[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
fn missing_avx512(seven: u32) -> Option<&'static str> {
    let sets = [("AVX-512F", 16), ("AVX-512DQ", 17), ("AVX-512CD", 28), ("AVX-512BW", 30), ("AVX-512VL", 31)];
    let used = cfg!(target_feature = "avx512f");
    sets.iter().find(|(_, bit)| used && seven & 1 << bit == 0).map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A processor of 2013 (Haswell), one of 2012 (Ivy Bridge), and a system that does not save AVX registers. Killed
    /// by: a wrong bit number.
    #[test]
    fn names_what_is_missing() {
        let (one, seven, extended, saved) = (0x7ffa_fbff, 0x0000_27ab, 0x0000_0021, 832);
        assert_eq!(first_missing(one, seven, extended, saved), None);
        assert_eq!(first_missing(0x7fba_e3ff, 0x0000_0281, 0x0000_0001, saved), Some("AVX2"));
        assert_eq!(first_missing(one, seven, extended, 576), Some("the operating system's support for AVX"));
        assert_eq!(first_missing(one & !(1 << 27), seven, extended, 0), Some("the operating system's support for AVX"));
        assert_eq!(first_missing(one & !(1 << 12), seven, extended, saved), Some("FMA"));
        assert_eq!(first_missing(one, seven & !(1 << 8), extended, saved), Some("BMI2"));
        assert_eq!(first_missing(one, seven, 0, saved), Some("LZCNT"));
    }

    /// The tests run, so no instruction is missing. Killed by: a missing set where there is none.
    #[test]
    fn nothing_is_missing_here() {
        assert_eq!(missing_instructions(), None);
        assert!(!INSTRUCTION_SET.is_empty());
    }
}
