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
} else if cfg!(all(target_arch = "x86_64", target_feature = "avx")) {
    "x86-64-v2 with AVX"
} else if cfg!(all(target_arch = "x86_64", target_feature = "sse4.2")) {
    "x86-64-v2"
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

/// The first instruction set that this build uses and the processor, or the operating system, lacks.
///
/// Asks the processor itself: the standard library's detection answers "yes" at compile time for what the compiler was
/// allowed to use, which is exactly what is in doubt here. Only sets that the compiler was allowed to use count. Builds
/// for the baseline of their architecture run everywhere; of other architectures than x86-64 nothing is known. The
/// function is small and computes with integers, so that it runs where the rest would not.
#[inline(never)]
pub fn missing_instructions() -> Option<&'static str> {
    #[cfg(target_arch = "x86_64")]
    return sets(&Processor::ask()).into_iter().find(|s| s.used && !s.present).map(|s| s.name);
    #[cfg(not(target_arch = "x86_64"))]
    None
}

/// The best instruction set that the processor and its operating system offer, of those that [`INSTRUCTION_SET`] can
/// be on x86-64; elsewhere that of this build. A program that is there in several builds can choose one by it.
#[inline(never)]
pub fn processor_instruction_set() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    return level(&Processor::ask());
    #[cfg(not(target_arch = "x86_64"))]
    INSTRUCTION_SET
}

/// What CPUID says (Intel SDM vol. 2, CPUID; AMD APM vol. 3, appendix E).
#[cfg(any(test, target_arch = "x86_64"))]
#[derive(Clone, Copy)]
struct Processor {
    /// `ecx` of leaf 1.
    one: u32,
    /// `ebx` of leaf 7.
    seven: u32,
    /// `ecx` of leaf 0x8000_0001.
    extended: u32,
    /// `ebx` of leaf 13: bytes of the states that the system saves now.
    saved: u32,
    /// `ebx` and `eax` of sub-leaf 7 of leaf 13: where registers 16 to 31 of AVX-512, the last of its three states, begin
    /// among the saved bytes, and how many they are. Processors differ in that.
    upper: [u32; 2],
}

#[cfg(target_arch = "x86_64")]
impl Processor {
    fn ask() -> Self {
        use core::arch::x86_64::{__cpuid, __cpuid_count};
        let (leaves, extended) = (__cpuid(0).eax, __cpuid(0x8000_0000).eax);
        let states = |sub| __cpuid_count(13, sub);
        Self {
            one: __cpuid(1).ecx,
            seven: if leaves >= 7 { __cpuid_count(7, 0).ebx } else { 0 },
            extended: if extended >= 0x8000_0001 { __cpuid(0x8000_0001).ecx } else { 0 },
            saved: if leaves >= 13 { states(0).ebx } else { 0 },
            upper: if leaves >= 13 { [states(7).ebx, states(7).eax] } else { [0; 2] },
        }
    }
}

/// A set of instructions.
#[cfg(any(test, target_arch = "x86_64"))]
struct InstructionSet {
    name: &'static str,
    /// The compiler was allowed to use it.
    used: bool,
    present: bool,
}

/// Every set beyond the baseline that compilers use by themselves. The states of SSE and the header take 512 + 64 bytes; AVX
/// has 256 behind them (Intel SDM vol. 1, 13.5).
#[cfg(any(test, target_arch = "x86_64"))]
fn sets(p: &Processor) -> [InstructionSet; 20] {
    let [one, seven, extended] = [p.one, p.seven, p.extended].map(|word| move |bit: u32| word & 1 << bit != 0);
    let [start, bytes] = p.upper;
    let saves = |end: u32| one(27) && p.saved >= end;
    let upper = bytes > 0 && saves(start.saturating_add(bytes));
    macro_rules! sets {
        ($($name:literal, $feature:literal, $present:expr;)*) => {
            [$(InstructionSet { name: $name, used: cfg!(target_feature = $feature), present: $present }),*]
        };
    }
    sets! {
        "SSE3", "sse3", one(0);
        "SSSE3", "ssse3", one(9);
        "SSE4.1", "sse4.1", one(19);
        "SSE4.2", "sse4.2", one(20);
        "POPCNT", "popcnt", one(23);
        "AVX", "avx", one(28);
        "the operating system's support for AVX", "avx", saves(512 + 64 + 256);
        "AVX2", "avx2", seven(5);
        "FMA", "fma", one(12);
        "F16C", "f16c", one(29);
        "MOVBE", "movbe", one(22);
        "BMI1", "bmi1", seven(3);
        "BMI2", "bmi2", seven(8);
        "LZCNT", "lzcnt", extended(5);
        "AVX-512F", "avx512f", seven(16);
        "the operating system's support for AVX-512", "avx512f", upper;
        "AVX-512DQ", "avx512dq", seven(17);
        "AVX-512CD", "avx512cd", seven(28);
        "AVX-512BW", "avx512bw", seven(30);
        "AVX-512VL", "avx512vl", seven(31);
    }
}

/// The level of x86-64 that a processor offers.
#[cfg(any(test, target_arch = "x86_64"))]
fn level(p: &Processor) -> &'static str {
    let all = sets(p);
    let of_v4 = |s: &&InstructionSet| s.name.contains("AVX-512");
    if all.iter().filter(|s| !of_v4(s)).any(|s| !s.present) {
        "x86-64"
    } else if all.iter().filter(of_v4).any(|s| !s.present) {
        "x86-64-v3"
    } else {
        "x86-64-v4"
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// Names of the sets that are missing, whatever this build uses.
    fn missing(p: &Processor) -> Vec<&'static str> {
        sets(p).into_iter().filter(|s| !s.present).map(|s| s.name).collect()
    }

    /// A processor of 2013 (Haswell), one of 2012 (Ivy Bridge), two with AVX-512 whose states lie at different places, and
    /// systems that do not save all registers. Killed by: a wrong bit number, a size of states that is one maker's.
    #[test]
    fn names_what_is_missing() {
        let avx512 = [
            "AVX-512F",
            "the operating system's support for AVX-512",
            "AVX-512DQ",
            "AVX-512CD",
            "AVX-512BW",
            "AVX-512VL",
        ];
        let haswell =
            Processor { one: 0x7ffa_fbff, seven: 0x0000_27ab, extended: 0x0000_0021, saved: 832, upper: [0; 2] };
        let without = |first: &[&'static str]| [first, &avx512].concat();
        assert_eq!(missing(&haswell), avx512);
        let ivy = Processor { one: 0x7fba_e3ff, seven: 0x0000_0281, extended: 1, ..haswell };
        assert_eq!(missing(&ivy), without(&["AVX2", "FMA", "MOVBE", "BMI1", "BMI2", "LZCNT"]));
        let system = "the operating system's support for AVX";
        assert_eq!(missing(&Processor { saved: 576, ..haswell }), without(&[system]));
        assert_eq!(missing(&Processor { one: haswell.one & !(1 << 27), saved: 0, ..haswell }), without(&[system]));
        for (word, bit, name) in [
            (0, 0, "SSE3"),
            (0, 9, "SSSE3"),
            (0, 19, "SSE4.1"),
            (0, 20, "SSE4.2"),
            (0, 23, "POPCNT"),
            (0, 12, "FMA"),
            (0, 22, "MOVBE"),
            (0, 29, "F16C"),
            (1, 3, "BMI1"),
            (1, 8, "BMI2"),
            (2, 5, "LZCNT"),
        ] {
            let mut words = [haswell.one, haswell.seven, haswell.extended];
            words[word] &= !(1 << bit);
            let [one, seven, extended] = words;
            assert_eq!(missing(&Processor { one, seven, extended, ..haswell }), without(&[name]));
        }
        let seven = haswell.seven | 0xd003_0000;
        for (upper, saved) in [([1664, 1024], 2696), ([1408, 1024], 2440)] {
            let p = Processor { seven, saved, upper, ..haswell };
            assert!(missing(&p).is_empty());
            assert_eq!([level(&p), level(&haswell), level(&ivy)], ["x86-64-v4", "x86-64-v3", "x86-64"]);
            assert_eq!(missing(&Processor { saved: 832, ..p }), ["the operating system's support for AVX-512"]);
            assert_eq!(missing(&Processor { seven: seven & !(1 << 31), ..p }), ["AVX-512VL"]);
        }
    }

    /// The tests run, so no instruction is missing; a set counts if this build uses it. Killed by: a missing set where there
    /// is none, a set that counts whatever was compiled.
    #[test]
    fn nothing_is_missing_here() {
        assert_eq!(missing_instructions(), None);
        assert!(!INSTRUCTION_SET.is_empty());
        assert!(processor_instruction_set() >= INSTRUCTION_SET, "sets of an architecture sort by their names");
        #[cfg(target_arch = "x86_64")]
        for s in sets(&Processor::ask()) {
            assert!(s.present || !s.used, "{}", s.name);
        }
        let nothing = Processor { one: 0, seven: 0, extended: 0, saved: 0, upper: [0; 2] };
        let used: Vec<_> = sets(&nothing).into_iter().filter(|s| s.used).map(|s| s.name).collect();
        assert_eq!(used.contains(&"FMA"), cfg!(target_feature = "fma"));
        assert_eq!(used.contains(&"SSE4.2"), cfg!(target_feature = "sse4.2"));
        assert_eq!(used.contains(&"MOVBE"), cfg!(target_feature = "movbe"));
    }
}
