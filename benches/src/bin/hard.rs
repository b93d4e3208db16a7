//! Hard numerical cases with fresh seeds, as many as the tier has time for: leaks, self-hits, missed boxes, errors of
//! functions, distributions of samples, pictures that are not finite or have the wrong mean.
//!
//! A line for each check says how many of its cases failed and what the worst measured figure was; below it, what
//! failed first. The exit status is 0 only if nothing failed. `--write` puts the run into
//! `benches/results/hard-TIER.md` and adds it to `benches/results/hard.jsonl`. A run of some checks replaces their
//! rows, if the others are of the same version.

use clap::Parser;
use croupier_benches::exit::exit_code;
use croupier_benches::hard::{CHECKS, Run, Tier};
use std::error::Error;
use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

#[derive(Parser)]
#[command(about = "Hard numerical cases: failures and worst figures")]
struct Args {
    /// Only checks whose id begins so, as `TRI` or `BOX-1`.
    #[arg(value_name = "ID")]
    ids: Vec<String>,
    /// How much to try: `commit` (seconds), `nightly` (minutes) or `weekly` (hours).
    #[arg(long, default_value = "commit", value_parser = |s: &str| Tier::of(s).ok_or("no such tier"))]
    tier: Tier,
    /// Seed of all random numbers; without it the clock's.
    #[arg(long)]
    seed: Option<u64>,
    /// Write the results: rows of these checks, or all.
    #[arg(long)]
    write: bool,
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64 % 1_000_000_007);
    let seed = args.seed.unwrap_or_else(clock);
    println!("tier {}, seed {seed}\n", args.tier.name());
    let mut run = Run::new(args.tier, seed);
    print!("{}", run.head());
    let mut tried = 0;
    for check in &CHECKS {
        if args.ids.is_empty() || check.rows.iter().any(|r| args.ids.iter().any(|id| r.id.starts_with(&**id))) {
            run.check(check).iter().for_each(|line| println!("{line}"));
            tried += 1;
        }
    }
    if tried == 0 {
        return Err(format!("no check {}", args.ids.join(", ")).into());
    }
    println!("\n{tried} checks, {} failures", run.failures);
    if args.write {
        run.write()?.iter().for_each(|path| println!("wrote {}", path.display()));
    }
    Ok(run.failures == 0)
}

fn main() -> ExitCode {
    exit_code("hard", run(&Args::parse()))
}
