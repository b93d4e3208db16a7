//! Check that the processor has the instructions that this program is compiled to.

/// The first instruction set that the program uses and the processor lacks.
///
/// Asks the processor itself: the standard library's detection answers "yes" at compile time for what the compiler was
/// allowed to use, which is exactly what is in doubt here.
#[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
#[inline(never)]
pub(crate) fn missing() -> Option<&'static str> {
    use std::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};
    // SAFETY: every x86-64 processor has `cpuid`; leaves 0 and 1 always exist, the others are asked for only if leaf 0
    // and 0x8000_0000 say that they do. `xgetbv` runs only if the OSXSAVE bit says that the system has enabled it.
    unsafe {
        let (leaves, extended) = (__cpuid(0).eax, __cpuid(0x8000_0000).eax);
        let one = __cpuid(1).ecx;
        let seven = if leaves >= 7 { __cpuid_count(7, 0).ebx } else { 0 };
        let extended = if extended >= 0x8000_0001 { __cpuid(0x8000_0001).ecx } else { 0 };
        let state = if one & OSXSAVE != 0 { _xgetbv(0) } else { 0 };
        first_missing(one, seven, extended, state)
    }
}

/// Programs built for the baseline of their architecture run everywhere.
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2")))]
pub(crate) fn missing() -> Option<&'static str> {
    None
}

#[cfg(any(test, all(target_arch = "x86_64", target_feature = "avx2")))]
const OSXSAVE: u32 = 1 << 27;

/// From `ecx` of leaf 1, `ebx` of leaf 7, `ecx` of leaf 0x8000_0001 and the extended control register 0 (Intel SDM vol.
/// 2, CPUID; AMD APM vol. 3, appendix E).
#[cfg(any(test, all(target_arch = "x86_64", target_feature = "avx2")))]
fn first_missing(one: u32, seven: u32, extended: u32, state: u64) -> Option<&'static str> {
    let sets = [
        ("AVX", one & 1 << 28 != 0),
        ("the operating system's support for AVX", one & OSXSAVE != 0 && state & 6 == 6),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A processor of 2013 (Haswell), one of 2012 (Ivy Bridge), and a system that does not save AVX registers. Killed
    /// by: a wrong bit number.
    #[test]
    fn names_what_is_missing() {
        let (one, seven, extended) = (0x7ffa_fbff, 0x0000_27ab, 0x0000_0021);
        assert_eq!(first_missing(one, seven, extended, 7), None);
        assert_eq!(first_missing(0x7fba_e3ff, 0x0000_0281, 0x0000_0001, 7), Some("AVX2"));
        assert_eq!(first_missing(one, seven, extended, 3), Some("the operating system's support for AVX"));
        assert_eq!(first_missing(one & !(1 << 12), seven, extended, 7), Some("FMA"));
        assert_eq!(first_missing(one, seven & !(1 << 8), extended, 7), Some("BMI2"));
        assert_eq!(first_missing(one, seven, 0, 7), Some("LZCNT"));
    }

    /// The tests run, so no instruction is missing. Killed by: a missing set where there is none.
    #[test]
    fn nothing_is_missing_here() {
        assert_eq!(missing(), None);
    }
}
