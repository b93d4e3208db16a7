//! Error of every elementary function over all 2^32 arguments, as a table; for two arguments over 10^8 random pairs.
//!
//! One to two core-minutes per function. `--features fast` measures fused arithmetic. `--write` puts the tables of all
//! functions into `benches/results/ulp.md`, those of fused arithmetic into `ulp-fast.md`.

use clap::Parser;
use croupier_benches::results::{Results, Table};
use croupier_tests::math::{BINARY, Sweep, UNARY, Unary, sweep, sweep_pairs};

use std::error::Error;

#[derive(Parser)]
#[command(about = "Errors of the elementary functions in units in the last place")]
struct Args {
    /// Only these functions.
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    /// Write the tables into benches/results; needs all functions.
    #[arg(long, conflicts_with = "names")]
    write: bool,
}

const NAME: &str = if croupier::unstable::simd::REPRODUCIBLE { "ulp" } else { "ulp-fast" };
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

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let mut results = Results::of_this_run("ulp");
    let wanted = |name: &str| args.names.is_empty() || args.names.iter().any(|n| n == name);

    let mut table = Table::new("One argument", "function, max ULP, at, mean ULP, unordered neighbours");
    print!("{}", table.head());
    for f in UNARY.iter().filter(|f| wanted(f.name)) {
        let s = exhaustive(f);
        table.add([
            f.name.to_string(),
            format!("{:.4}", s.max.0),
            format!("{:e} = {:#010x}", f32::from_bits(s.max.1), s.max.1),
            format!("{:.4}", s.sum / s.count as f64),
            format!("{} ({:#010x})", s.unordered.0, s.unordered.1),
        ]);
        println!("{}", table.last());
    }
    results.tables.push(table);

    let columns = "function, max ULP where abs(y ln x) <= 8, max ULP, worst at, largest part of the promise, \
                   largest at, mean ULP";
    let mut table = Table::new("Two arguments", columns);
    print!("\n{}", table.head());
    for f in BINARY.iter().filter(|f| wanted(f.name)) {
        let s = sweep_pairs(f, 12_500_000, 2);
        table.add([
            f.name.to_string(),
            format!("{:.4}", s.near.0),
            format!("{:.4}", s.max.0),
            format!("{:e}, {:e}", s.max.1, s.max.2),
            format!("{:.3}", s.ratio.0),
            format!("{:e}, {:e}", s.ratio.1, s.ratio.2),
            format!("{:.4}", s.mean),
        ]);
        println!("{}", table.last());
    }
    results.tables.push(table);
    if args.write {
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(())
}
