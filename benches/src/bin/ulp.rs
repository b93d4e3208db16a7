//! Error of every elementary function over all 2^32 arguments, as a table; for two arguments over 10^8 random pairs.
//!
//! One to two core-minutes per function. The exit status is 0 only if all promises hold. `--features fast` measures fused arithmetic. `--write` puts the tables of all
//! functions into `benches/results/ulp.md`, those of fused arithmetic into `ulp-fast.md`.

use clap::Parser;
use croupier_benches::exit::exit_code;
use croupier_benches::hard::{broken_promises, swept};
use croupier_benches::results::{Results, Table};
use croupier_tests::math::{BINARY, UNARY, sweep_pairs};

use std::error::Error;
use std::process::ExitCode;

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
fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let mut results = Results::of_this_run("ulp");
    let wanted = |name: &str| args.names.is_empty() || args.names.iter().any(|n| n == name);

    let mut table = Table::new("One argument", "function, max ULP, at, mean ULP, unordered neighbours");
    let mut broken = Vec::new();
    print!("{}", table.head());
    for f in UNARY.iter().filter(|f| wanted(f.name)) {
        let s = swept(f, 8);
        broken.extend(broken_promises(f, &s));
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
        if s.ratio.0 > 1.0 {
            broken.push(format!("{}: {} of the promise", f.name, s.ratio.0));
        }
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
    broken.iter().for_each(|b| println!("broken: {b}"));
    Ok(broken.is_empty())
}

fn main() -> ExitCode {
    exit_code("ulp", run(&Args::parse()))
}
