//! What accuracy costs: estimated error of the built-in scene over samples and rays, with the program's defaults; and
//! the time of the same picture by builds with other arithmetic and instruction sets.
//!
//! The first table depends on nothing but the program. For the second the program builds itself with other flags, each
//! into a folder of its own, and the builds take turns; a time is the CPU time of the process while it renders with one
//! thread. `--write` puts both into `benches/results/accuracy.md`.

use clap::Parser;
use cpu_time::ProcessTime;
use croupier::Strategy;
use croupier_benches::exit::exit_code;
use croupier_benches::provenance;
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::digits;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::drive::Unobserved;
use croupier_host::render::{RenderOptions, RenderStats, Target, render};
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

#[derive(Parser)]
#[command(about = "Error of the built-in scene over samples, and time by build")]
struct Args {
    /// Only the first table, which needs no other builds.
    #[arg(long)]
    quick: bool,
    /// Renders of each build.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Write benches/results/accuracy.md; needs a build for x86-64-v3 with reproducible arithmetic.
    #[arg(long, conflicts_with = "quick")]
    write: bool,
    /// One row of the second table as JSON: what the builds are run with.
    #[arg(long, hide = true)]
    this_build: bool,
}

const NAME: &str = "accuracy";
const SAMPLES: [u32; 4] = [4, 16, 64, 256];
/// Samples per pixel and strategy of the second table: one whose paths hardly differ between builds with other bits.
const TIMED: (u32, &str) = (16, "classic");

/// Another build: name of its folder, features, flags of the compiler.
const BUILDS: [(&str, &str, &str); 2] =
    [("fast", "fast", "-C target-cpu=x86-64-v3"), ("baseline", "", "-C target-cpu=x86-64")];

fn stats(options: RenderOptions, spp: u32, threads: usize) -> Result<RenderStats, Box<dyn Error>> {
    let baked = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {})?;
    let options = RenderOptions { target: Target::Spp(spp), threads, ..options };
    Ok(render(&baked.bytes, &options, &Unobserved)?.stats)
}

fn errors() -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new("Error over samples", "samples per pixel, million rays, estimated relMSE, low, high");
    for spp in SAMPLES {
        let s = stats(RenderOptions::default(), spp, 0)?;
        let end = |x: Option<f64>| x.map_or("unresolved".into(), digits);
        let interval = s.relmse_interval;
        let error = [s.relmse_estimate, interval.map(|i| i[0]), interval.map(|i| i[1])].map(end);
        let cells = [spp.to_string(), format!("{:.1}", s.rays as f64 * 1e-6)];
        table.add(cells.into_iter().chain(error));
    }
    Ok(table)
}

/// The timed render by this build.
fn this_build() -> Result<Value, Box<dyn Error>> {
    let start = ProcessTime::now();
    let s = stats(RenderOptions::new(Strategy::parse(TIMED.1)?), TIMED.0, 1)?;
    Ok(json!({
        "arithmetic": provenance::ARITHMETIC, "instruction set": provenance::instruction_set(),
        "seconds": start.elapsed().as_secs_f64(), "relmse": s.relmse_estimate,
    }))
}

/// Compiles another build of this program; where it is.
fn build((folder, features, flags): (&str, &str, &str)) -> Result<PathBuf, Box<dyn Error>> {
    let this = std::env::current_exe()?;
    // .../target/release/accuracy
    let target = this.ancestors().nth(2).ok_or("this program lies in no target folder")?.join(folder);
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--quiet", "--release", "--package", env!("CARGO_PKG_NAME"), "--bin", NAME]);
    cargo.args(["--features", features, "--target-dir"]).arg(&target);
    cargo.env_remove("CARGO_ENCODED_RUSTFLAGS").env("RUSTFLAGS", flags);
    let status = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).status()?;
    if !status.success() {
        return Err(format!("the build with {flags} failed").into());
    }
    Ok(target.join("release").join(this.file_name().unwrap_or_default()))
}

fn run_build(program: &Path) -> Result<Value, Box<dyn Error>> {
    let output = Command::new(program).arg("--this-build").output()?;
    if !output.status.success() {
        return Err(format!("{}: {}", program.display(), String::from_utf8_lossy(&output.stderr)).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn builds(rounds: u32) -> Result<Table, Box<dyn Error>> {
    let mut programs = vec![std::env::current_exe()?];
    for other in BUILDS {
        programs.push(build(other)?);
    }
    let mut runs = vec![Vec::new(); programs.len()];
    for _ in 0..rounds {
        for (program, runs) in programs.iter().zip(&mut runs) {
            runs.push(run_build(program)?);
        }
    }
    let title = format!("Time of {} samples per pixel", TIMED.0);
    let columns = "arithmetic, instruction set, CPU seconds, lowest, highest, estimated relMSE";
    let mut table = Table::new(&title, columns);
    for runs in runs {
        let mut seconds: Vec<f64> = runs.iter().filter_map(|r| r["seconds"].as_f64()).collect();
        seconds.sort_by(f64::total_cmp);
        let text = |key: &str| runs[0][key].as_str().unwrap_or("unknown").to_string();
        let times = [seconds[seconds.len() / 2], seconds[0], seconds[seconds.len() - 1]].map(|s| format!("{s:.2}"));
        let error = runs[0]["relmse"].as_f64().map_or("unknown".into(), digits);
        table.add([text("arithmetic"), text("instruction set")].into_iter().chain(times).chain([error]));
    }
    Ok(table)
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if args.this_build {
        println!("{}", this_build()?);
        return Ok(());
    }
    let mut results = Results::of_this_run(NAME);
    if args.write && (provenance::instruction_set() != "x86-64-v3" || provenance::ARITHMETIC != "reproducible") {
        return Err("--write needs the build that the repository's own flags make".into());
    }
    results.header.push(("strategy".into(), format!("the default in the first table, {} in the second", TIMED.1)));
    let table = errors()?;
    println!("{table}");
    results.tables.push(table);
    if !args.quick {
        let table = builds(args.rounds)?;
        println!("{table}");
        results.tables.push(table);
    }
    if args.write {
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()).map(|()| true))
}
