//! Error of every elementary function over all 2^32 arguments, as a table; for two arguments over 10^8 random pairs.
//!
//! `cargo run --release --bin ulp [NAME]...` takes one to two core-minutes per function; with
//! `--features croupier/fast` it measures fused arithmetic.

use croupier_tests::math::{BINARY, Sweep, UNARY, Unary, sweep, sweep_pairs};

const PARTS: u64 = 64;

fn exhaustive(f: &'static Unary) -> Sweep {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
    let size = (1u64 << 32) / PARTS;
    let handles: Vec<_> = (0..threads)
        .map(|t| {
            std::thread::spawn(move || {
                let part = |p: u64| sweep(f, (p * size) as u32, (p * size + size - 1) as u32, 8);
                let mut s = Sweep::default();
                (t..PARTS).step_by(threads as usize).for_each(|p| s.merge(&part(p)));
                s
            })
        })
        .collect();
    let mut s = Sweep::default();
    handles.into_iter().for_each(|h| s.merge(&h.join().expect("a sweep panicked")));
    s
}

fn main() {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let wanted = |name: &str| names.is_empty() || names.iter().any(|n| n == name);
    println!("| function | max ULP | at | mean ULP | unordered neighbours |");
    println!("|---|---|---|---|---|");
    for f in UNARY.iter().filter(|f| wanted(f.name)) {
        let s = exhaustive(f);
        let mean = s.sum / s.count as f64;
        println!(
            "| {} | {:.4} | {:e} = {:#010x} | {:.4} | {} ({:#010x}) |",
            f.name,
            s.max.0,
            f32::from_bits(s.max.1),
            s.max.1,
            mean,
            s.unordered.0,
            s.unordered.1
        );
    }
    println!();
    println!("| function | max ULP, abs(y ln x) <= 8 | max ULP | at | largest part of the promise | at | mean ULP |");
    println!("|---|---|---|---|---|---|---|");
    for f in BINARY.iter().filter(|f| wanted(f.name)) {
        let s = sweep_pairs(f, 12_500_000, 2);
        println!(
            "| {} | {:.4} | {:.4} | {:e}, {:e} | {:.3} | {:e}, {:e} | {:.4} |",
            f.name, s.near.0, s.max.0, s.max.1, s.max.2, s.ratio.0, s.ratio.1, s.ratio.2, s.mean
        );
    }
}
