//! Damaged inputs of every format, a fixed number from a fixed seed: no panic, and never more than a gibibyte. What happens
//! to each is in `fuzz/src/inputs.rs`, which `cargo fuzz` runs as well (`.ci/fuzz`). Alone in its binary, because the
//! counting allocator is global.
//!
//! `CROUPIER_FUZZED=N` runs N inputs of each format, with another seed for each N: longer runs where there is no fuzzer.

#[path = "../fuzz/src/inputs.rs"]
#[expect(unreachable_pub, reason = "the file is part of a library as well")]
mod inputs;

#[path = "../fuzz/src/memory.rs"]
#[expect(unreachable_pub, reason = "the file is part of a library as well")]
mod memory;

use croupier_tests::stats::SplitMix;
use inputs::{FORMATS, Workbench};
use std::path::Path;

/// Inputs of each format of scene files.
const INPUTS: usize = 1_000;

/// Inputs of each format that is rendered from with learned roulette, which takes longer: whole sessions.
const SESSIONS: usize = 500;

/// Most bytes in use at a time, of all tests of this binary.
const LIMIT: usize = 1 << 30;

#[global_allocator]
static ALLOCATOR: memory::Counting = memory::Counting::unlimited();

/// One to four changes: bits, bytes and words that are telling, parts cut out, doubled, or taken from another seed.
fn mutate(seed: &[u8], other: &[u8], words: &[&str], rng: &mut SplitMix) -> Vec<u8> {
    let mut out = seed.to_vec();
    for _ in 0..1 + rng.word() % 4 {
        let n = out.len().max(1);
        let (at, length) = (rng.word() as usize % n, 1 + rng.word() as usize % 16);
        let at = at.min(out.len());
        let end = (at + length).min(out.len());
        let telling = [0, 1, 0x7f, 0x80, 0xff, b'0', b'-', b'\n'];
        match rng.word() % 9 {
            0 if at < out.len() => out[at] ^= 1 << (rng.word() % 8),
            1 if at < out.len() => out[at] = telling[rng.word() as usize % telling.len()],
            2 => out[at..end].fill(telling[rng.word() as usize % telling.len()]),
            3 => drop(out.drain(at..end)),
            4 => {
                let part = out[at..end].to_vec();
                drop(out.splice(at..at, part));
            }
            5 if !other.is_empty() => {
                let from = rng.word() as usize % other.len();
                drop(out.splice(at..end, other[from..(from + length).min(other.len())].iter().copied()));
            }
            6 | 7 if !words.is_empty() => {
                let word = words[rng.word() as usize % words.len()];
                drop(out.splice(at..at, word.bytes()));
            }
            8 if end - at >= 4 => {
                let numbers = [0u32, 1, u32::MAX, 0x7fff_ffff, f32::NAN.to_bits(), f32::INFINITY.to_bits(), 1 << 16];
                let bytes = numbers[rng.word() as usize % numbers.len()].to_le_bytes();
                out[at..at + 4].copy_from_slice(&bytes);
            }
            _ if rng.word().is_multiple_of(8) => out.truncate(at),
            _ => {}
        }
    }
    out
}

/// Files of the corpus of a format in the repository; those named `found-*` have once failed.
fn corpus(name: &str) -> Vec<std::path::PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(name);
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<_> = entries.map(|e| e.unwrap().path()).collect();
    files.sort();
    files
}

fn check(name: &str) {
    let format = FORMATS.iter().find(|f| f.name == name).unwrap();
    let seeds = (format.seeds)();
    let mut bench = Workbench::default();
    for (i, seed) in seeds.iter().enumerate() {
        assert!((format.run)(&mut bench, seed), "seed {i} of {name} is refused");
    }
    for file in corpus(name) {
        // also what the fuzzer has found, whatever becomes of it: no panic
        (format.run)(&mut bench, &std::fs::read(file).unwrap());
    }
    let more = std::env::var("CROUPIER_FUZZED").ok().map(|n| n.parse::<usize>().unwrap());
    let inputs =
        more.unwrap_or(if matches!(name, "blob" | "cache" | "guide" | "checkpoint") { SESSIONS } else { INPUTS });
    let mut rng = SplitMix(name.bytes().map(u64::from).sum::<u64>() + more.unwrap_or(0) as u64);
    let mut accepted = 0;
    for i in 0..inputs {
        let seed = &seeds[i % seeds.len()];
        let other = &seeds[rng.word() as usize % seeds.len()];
        let input = mutate(seed, other, format.words, &mut rng);
        let run = std::panic::AssertUnwindSafe(|| (format.run)(&mut bench, &input));
        match std::panic::catch_unwind(run) {
            Ok(fine) => accepted += usize::from(fine),
            Err(_) => panic!("{name} {i}: {:?}", String::from_utf8_lossy(&input)),
        }
    }
    let peak = ALLOCATOR.peak();
    println!("{name}: {accepted} of {inputs} accepted, {} MiB at most", peak >> 20);
    assert!(peak <= LIMIT, "{name}: {peak} bytes");
    // Inputs that are all refused or all accepted test little.
    assert!((inputs / 200..inputs).contains(&accepted), "{name}: {accepted} accepted");
}

/// Killed by: a panic or an allocation of the size that a file states, in any reader.
macro_rules! formats {
    ($($name:ident),*) => {
        $(#[test]
        fn $name() {
            check(stringify!($name));
        })*

        /// Killed by: a format without a test here.
        #[test]
        fn every_format_is_tested() {
            let tested = [$(stringify!($name)),*];
            assert!(FORMATS.iter().all(|f| tested.contains(&f.name)));
        }
    };
}
formats!(obj, mtl, gltf, glb, ply, stl, json, png, jpeg, exr, hdr, blob, cache, guide, checkpoint);
