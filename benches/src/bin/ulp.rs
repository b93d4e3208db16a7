//! Error of every elementary function over all 2^32 arguments (two-argument functions: random ones), as a table.
//!
//! `cargo run --release --bin ulp [NAME]...`; takes about two minutes per function and core.

use croupier_tests::math::{Sweep, UNARY, Unary, sweep};

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
    println!("| function | max ULP | at | mean ULP | unordered neighbours |");
    println!("|---|---|---|---|---|");
    for f in UNARY.iter().filter(|f| names.is_empty() || names.iter().any(|n| n == f.name)) {
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
}
