//! Kernels one at a time, counted by callgrind: instructions and cache misses per packet of eight.
//!
//! The kernels, their inputs and their expected answers are those of `cargo bench` ([`micro`]), which measures
//! time. Every kernel is called twice, and the second call is counted. Counts of instructions repeat as those of
//! `instructions` do; misses are those of modelled caches ([`callgrind::CACHES`]) and depend on where memory lies, so
//! that they move by a few. `--check` compares with `benches/results/micro.md`.

use clap::Parser;
use croupier_benches::callgrind::{self, CACHES, Folder, WithCaches};
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_benches::{micro, provenance};
use std::error::Error;
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Instructions and cache misses of single kernels, counted by callgrind")]
struct Args {
    /// Only kernels whose `GROUP NAME` contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Compare with benches/results/micro.md; exit status 1 if a kernel's instructions have risen by more than
    /// `--tolerance`, or its first-level misses by a quarter and half a miss per unit: another layout of the same code
    /// and data in memory changes them by up to 8 %, and last-level ones, which are not compared, by two thirds.
    #[arg(long)]
    check: bool,
    /// Per cent by which instructions may rise.
    #[arg(long, value_name = "PERCENT", default_value_t = 2.0)]
    tolerance: f64,
    /// Write benches/results/micro.md.
    #[arg(long, conflicts_with_all = ["check", "only"])]
    write: bool,
    /// Call the kernels and print their names: what the program runs under valgrind.
    #[arg(long, hide = true)]
    call: bool,
}

const NAME: &str = if croupier::unstable::simd::REPRODUCIBLE { "micro" } else { "micro-fast" };
const COLUMNS: &str = "group, kernel, per, lanes used, instructions, first-level misses, last-level misses";
/// First-level misses per unit by which they may rise in any case, and per cent.
const MISSES: (f64, f64) = (0.5, 25.0);

/// Calls kernels, prints a line for each.
fn call(only: &str) -> Result<(), Box<dyn Error>> {
    for mut kernel in micro::all()? {
        if !format!("{} {}", kernel.group, kernel.name).contains(only) {
            continue;
        }
        // what is done once is not counted
        (kernel.call)();
        callgrind::bench_collect(&mut kernel.call);
        let lanes = kernel.lanes.map_or("-".into(), |l| format!("{l:.2}"));
        println!("{}\t{}\t{}\t{lanes}\t{}", kernel.group, kernel.name, kernel.unit, kernel.units);
    }
    Ok(())
}

/// A row of the table.
fn row(line: &str, counted: &WithCaches) -> Option<Vec<String>> {
    let mut cells: Vec<String> = line.split('\t').map(String::from).collect();
    let units: f64 = cells.pop()?.parse().ok()?;
    cells.push(format!("{:.1}", counted.instructions as f64 / units));
    cells.extend([counted.first_misses, counted.last_misses].map(|n| format!("{:.3}", n as f64 / units)));
    Some(cells)
}

/// Prints what has changed against the committed rows; how many figures have risen.
fn check(table: &Table, tolerance: f64, results: &Results) -> Result<usize, Box<dyn Error>> {
    let committed = Results::read(NAME)?;
    if let Some(difference) = results.differs_in(&committed, &["compiler", "valgrind"]) {
        println!("counts may differ because the {difference}");
    }
    let old = committed.tables.first().ok_or("no table in the committed results")?;
    let mut risen = 0;
    for row in &table.rows {
        let names = [&*row[0], &*row[1]];
        let Some(before) = old.row(&names) else {
            println!("{} {}: not in the committed results, which `--write` makes anew", names[0], names[1]);
            risen += 1;
            continue;
        };
        // columns of the figures, by how much the rounded one may rise in any case, and per cent
        for (k, (slack, percent)) in [(4, (0.1, tolerance)), (5, MISSES)] {
            let [new, old]: [f64; 2] = [row[k].parse()?, before[k].parse()?];
            let too_much = new > old * (1.0 + percent / 100.0) + slack;
            if too_much || (k == 4 && (new - old).abs() > old * 0.005 + slack) {
                let change = 100.0 * (new / old - 1.0);
                let verdict = if too_much { " RISEN" } else { "" };
                println!("{} {}, {}: {old} -> {new} ({change:+.2} %){verdict}", names[0], names[1], table.columns[k]);
            }
            risen += usize::from(too_much);
        }
    }
    Ok(risen)
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if args.call {
        call(&args.only)?;
        return Ok(true);
    }
    callgrind::note_profile(args.write)?;
    let mut results = Results::of_this_run(NAME);
    results.header.push(("valgrind".into(), provenance::version_of("valgrind")));
    results.header.push(("caches".into(), CACHES.join(" ")));
    if args.check
        && let Some(difference) = results.differs_in(&Results::read(NAME)?, &["instruction set", "arithmetic"])
    {
        println!("skipped: the {difference}");
        return Ok(true);
    }
    let folder = Folder::new(NAME)?;
    let mut table = Table::new("", COLUMNS);
    for (line, counted) in callgrind::each_call_with_caches(&folder, &["--call", "--only", &args.only])? {
        table.add(row(&line, &counted).ok_or("a line that is none of a kernel's")?);
    }
    if table.rows.is_empty() {
        return Err(format!("no kernel whose name contains '{}'", args.only).into());
    }
    if args.check {
        let risen = check(&table, args.tolerance, &results)?;
        println!("{} kernels, {risen} figures have risen", table.rows.len());
        return Ok(risen == 0);
    }
    print!("{table}");
    if args.write {
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
