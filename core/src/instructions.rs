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
#[inline(never)]
pub fn missing_instructions() -> Option<&'static str> {
    #[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
    {
        let leaves = Leaves::read();
        leaves.missing_v3().or_else(|| if cfg!(target_feature = "avx512f") { leaves.missing_v4() } else { None })
    }
    #[cfg(not(all(target_arch = "x86_64", target_feature = "avx2")))]
    None
}

/// The best instruction set that the processor and its operating system offer, of those that [`INSTRUCTION_SET`] can
/// be on x86-64; elsewhere that of this build. A program that is there in several builds can choose one by it.
#[inline(never)]
pub fn processor_instruction_set() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        let leaves = Leaves::read();
        match (leaves.missing_v3(), leaves.missing_v4()) {
            (Some(_), _) => "x86-64",
            (None, Some(_)) => "x86-64-v3",
            (None, None) => "x86-64-v4",
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    INSTRUCTION_SET
}

/// What the processor says of itself (Intel SDM vol. 2, CPUID; AMD APM vol. 3, appendix E).
#[cfg(any(test, target_arch = "x86_64"))]
#[derive(Clone, Copy)]
struct Leaves {
    /// `ecx` of leaf 1.
    one: u32,
    /// `ebx` of leaf 7.
    seven: u32,
    /// `ecx` of leaf 0x8000_0001.
    extended: u32,
    /// `ebx` of leaf 13: bytes of the states that the system saves now. 512 + 64 are those of SSE with the header, AVX
    /// has 256 behind them, and those of AVX-512 end at 2688 (Intel SDM vol. 1, 13.5).
    saved: u32,
}

#[cfg(any(test, target_arch = "x86_64"))]
impl Leaves {
    #[cfg(target_arch = "x86_64")]
    fn read() -> Self {
        use core::arch::x86_64::{__cpuid, __cpuid_count};
        let (leaves, extended) = (__cpuid(0).eax, __cpuid(0x8000_0000).eax);
        Self {
            one: __cpuid(1).ecx,
            seven: if leaves >= 7 { __cpuid_count(7, 0).ebx } else { 0 },
            extended: if extended >= 0x8000_0001 { __cpuid(0x8000_0001).ecx } else { 0 },
            saved: if leaves >= 13 { __cpuid_count(13, 0).ebx } else { 0 },
        }
    }

    /// The first set of x86-64-v3 that is missing.
    fn missing_v3(&self) -> Option<&'static str> {
        let Self { one, seven, extended, saved } = *self;
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

    /// The first set that x86-64-v4 adds and that is missing.
    fn missing_v4(&self) -> Option<&'static str> {
        let sets = [("AVX-512F", 16), ("AVX-512DQ", 17), ("AVX-512CD", 28), ("AVX-512BW", 30), ("AVX-512VL", 31)];
        let missing = sets.iter().find(|(_, bit)| self.seven & 1 << bit == 0).map(|(name, _)| *name);
        missing.or(if self.saved < 2688 { Some("the operating system's support for AVX-512") } else { None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A processor of 2013 (Haswell), one of 2012 (Ivy Bridge), one with AVX-512, and systems that do not save their
    /// registers. Killed by: a wrong bit number.
    #[test]
    fn names_what_is_missing() {
        let haswell = Leaves { one: 0x7ffa_fbff, seven: 0x0000_27ab, extended: 0x0000_0021, saved: 832 };
        let ivy_bridge = Leaves { one: 0x7fba_e3ff, seven: 0x0000_0281, extended: 0x0000_0001, saved: 832 };
        let v3 = |leaves: Leaves| leaves.missing_v3();
        assert_eq!(v3(haswell), None);
        assert_eq!(v3(ivy_bridge), Some("AVX2"));
        let system = Some("the operating system's support for AVX");
        assert_eq!(v3(Leaves { saved: 576, ..haswell }), system);
        assert_eq!(v3(Leaves { one: haswell.one & !(1 << 27), saved: 0, ..haswell }), system);
        assert_eq!(v3(Leaves { one: haswell.one & !(1 << 12), ..haswell }), Some("FMA"));
        assert_eq!(v3(Leaves { seven: haswell.seven & !(1 << 8), ..haswell }), Some("BMI2"));
        assert_eq!(v3(Leaves { extended: 0, ..haswell }), Some("LZCNT"));
        let skylake_x = Leaves { seven: 0xd39f_fffb, saved: 2696, ..haswell };
        assert_eq!(haswell.missing_v4(), Some("AVX-512F"));
        assert_eq!(skylake_x.missing_v4(), None);
        assert_eq!(Leaves { seven: skylake_x.seven & !(1 << 31), ..skylake_x }.missing_v4(), Some("AVX-512VL"));
        let system = Some("the operating system's support for AVX-512");
        assert_eq!(Leaves { saved: 832, ..skylake_x }.missing_v4(), system);
    }

    /// The tests run, so no instruction is missing, and the processor offers what this build uses. Killed by: a missing
    /// set where there is none; an offer below what runs.
    #[test]
    fn nothing_is_missing_here() {
        assert_eq!(missing_instructions(), None);
        assert!(!INSTRUCTION_SET.is_empty());
        assert!(processor_instruction_set() >= INSTRUCTION_SET, "sets of an architecture sort by their names");
    }
}
