//! How far scattering models, lights and media are from their f64 twins, which are those of the tests.
//!
//! A row is a kernel of `micro`: largest and mean error of its results, relative to the twin's (to 1e-3 where that is
//! smaller). In `reproducible` arithmetic they are the same on every machine. `--write` puts them, with the
//! instructions that `benches/results/micro.md` has for the same kernels, into the file that `croupier report` shows
//! them from; run it for both arithmetics (`--features fast`).

use clap::Parser;
use croupier_benches::exit::exit_code;
use croupier_benches::provenance::ARITHMETIC;
use croupier_benches::results::{Results, Table};
use croupier_benches::twins::{PACKETS, Twins, rows};
use std::error::Error;
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Errors of scattering models, lights and media against f64")]
struct Args {
    /// Packets of eight that each is compared for.
    #[arg(long, default_value_t = PACKETS)]
    packets: usize,
    /// Write the rows of this arithmetic into the file that `croupier report` reads.
    #[arg(long, conflicts_with = "packets")]
    write: bool,
}

const NAME: &str = "twins";

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    // before measuring: others may commit meanwhile
    let results = Results::of_this_run(NAME);
    let found = rows(args.packets)?;
    let mut table = Table::new("", "group, kernel, instructions, largest error, mean error, standard error, results");
    for r in &found {
        let figure = |x: Option<f64>| x.map_or("-".into(), |x| format!("{x:.2e}"));
        let instructions = r.instructions.map_or("-".into(), |x| x.to_string());
        let errors = [figure(r.max), figure(r.mean), figure(r.noise)];
        table.add(
            [vec![r.group.clone(), r.name.clone(), instructions], errors.into(), vec![r.count.to_string()]].concat(),
        );
    }
    print!("{table}");
    if args.write {
        println!("wrote {}", Twins::of(&results, ARITHMETIC, found)?.write()?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
