//! Command line: arguments, exit status, and one file per command.
//!
//! Exit status 0: done; 1: the last line on stderr says what went wrong; 2: the arguments make no sense; 130 (Ctrl-C), 143
//! (SIGTERM), 129 (SIGHUP): ended by a signal, a render with its partial picture written. Results go to stdout, progress, notes and errors to stderr.

mod bake;
mod cache;
mod checkpoint;
mod compare;
mod console;
mod info;
mod lightmap;
mod look;
mod merge;
mod notes;
mod output;
mod probes;
mod progress;
mod render;
mod report;
mod scene;
mod settings;
mod signals;
mod until;
mod values;

use clap::{Parser, Subcommand};
use croupier_host::text::{EXCERPT, excerpt};
use std::process::ExitCode;
use std::sync::LazyLock;

/// Path tracer with Russian roulette and splitting. Without a command it renders a built-in still life.
#[derive(Parser)]
#[command(name = "croupier", version, long_version = VERSION.as_str(), args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    render: render::Flags,
}

/// `--version` says which instruction set is in use; `-V` is the version alone.
static VERSION: LazyLock<String> =
    LazyLock::new(|| format!("{} ({})", env!("CARGO_PKG_VERSION"), croupier::INSTRUCTION_SET));

#[derive(Subcommand)]
enum Command {
    /// Render a scene to an EXR file with all layers and a PNG beside it
    Render(render::Args),
    /// Make the picture of parts that `render --part` wrote, in any order
    Merge(merge::Args),
    /// Bake a scene into one file that is mapped instead of loaded
    Bake(bake::Args),
    /// Print what a scene contains, the effects it needs and the memory a render takes
    Info(info::Args),
    /// Render the irradiance of an object, texel by texel, to an EXR file and a PNG beside it
    Lightmap(lightmap::Args),
    /// Render the light at points as spherical harmonics to a JSON file
    Probes(probes::Args),
    /// Compare an image with a reference: error, bias, perceived difference
    Compare(compare::Args),
    /// Measure what accuracy costs in time: one page with figures, tables and the numbers behind them
    Report(report::Args),
}

/// Says what is wrong with the arguments, or what was asked for; quotes long arguments in part.
fn refuse(e: &clap::Error) -> ExitCode {
    let given: Vec<String> = std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
    let parts = given.iter().flat_map(|a| [Some(a.as_str()), a.split_once('=').map(|(_, value)| value)]).flatten();
    let mut long: Vec<&str> = parts.filter(|a| a.len() > EXCERPT).collect();
    // one may be a part of another
    long.sort_by_key(|a| std::cmp::Reverse(a.len()));
    if long.is_empty() {
        // in colours, where a person reads it; nobody is there to be told of an error
        let _ = e.print();
    } else {
        eprint!("{}", long.iter().fold(e.to_string(), |text, a| text.replace(a, &excerpt(a))));
    }
    ExitCode::from(u8::try_from(e.exit_code()).unwrap_or(2))
}

/// The whole program.
pub(crate) fn run() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => return refuse(&e),
    };
    signals::install();
    let done = |()| ExitCode::SUCCESS;
    let outcome = match cli.command {
        None => render::run(None, &cli.render),
        Some(Command::Render(args)) => render::run(args.scene.as_deref(), &args.flags),
        Some(Command::Merge(args)) => merge::run(&args).map(done),
        Some(Command::Bake(args)) => bake::run(&args).map(done),
        Some(Command::Info(args)) => info::run(&args).map(done),
        Some(Command::Lightmap(args)) => lightmap::run(&args),
        Some(Command::Probes(args)) => probes::run(&args),
        Some(Command::Compare(args)) => compare::run(&args).map(done),
        Some(Command::Report(args)) => report::run(&args).map(done),
    };
    match outcome {
        Ok(status) => status,
        Err(e) => {
            console::complain(&e.to_string());
            ExitCode::FAILURE
        }
    }
}
