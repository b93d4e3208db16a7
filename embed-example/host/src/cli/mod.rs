//! Command line: arguments, exit status, and one file per command.
//!
//! Exit status 0: done (also when stopped by Ctrl-C with the picture so far written); 1: the last line on stderr says
//! what went wrong; 2: the arguments make no sense. Results go to stdout, progress, notes and errors to stderr.

mod bake;
mod cache;
mod compare;
mod info;
mod notes;
mod output;
mod progress;
mod render;
mod scene;
mod settings;

use clap::{Parser, Subcommand};
use std::error::Error;
use std::io::{self, Write};
use std::process::ExitCode;

/// Path tracer with Russian roulette and splitting. Without a command it renders the built-in scene.
#[derive(Parser)]
#[command(name = "croupier", version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    render: render::Flags,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene to an EXR file with all layers and a PNG beside it
    Render(render::Args),
    /// Bake a scene into one file that loads at once
    Bake(bake::Args),
    /// Say what a scene holds, calls for and takes
    Info(info::Args),
    /// Measure how far an image is from a reference
    Compare(compare::Args),
}

type Outcome = Result<(), Box<dyn Error>>;

/// The whole program.
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match cli.command {
        None => render::run(None, &cli.render),
        Some(Command::Render(args)) => render::run(args.scene.as_deref(), &args.flags),
        Some(Command::Bake(args)) => bake::run(&args),
        Some(Command::Info(args)) => info::run(&args),
        Some(Command::Compare(args)) => compare::run(&args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            complain(&e.to_string());
            ExitCode::FAILURE
        }
    }
}

/// Prints one line on stderr, whatever the text holds.
fn complain(text: &str) {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let _ = writeln!(io::stderr(), "croupier: {text}");
}

/// Prints what is no error, but may not be what the user expects.
fn note(text: &str) {
    complain(&format!("note: {text}"));
}

/// Prints a line of results. A reader that has gone away (`croupier info | head`) is no error.
fn say(line: &str) -> Outcome {
    match writeln!(io::stdout(), "{line}") {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(e.into()),
        _ => Ok(()),
    }
}

/// Prints results as one line of JSON; numbers that are not finite become `null`.
fn say_json(value: &impl serde::Serialize) -> Outcome {
    say(&serde_json::to_string(value)?)
}

/// An exposure.
fn stops(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if x.abs() <= 100.0 => Ok(x),
        Ok(_) => Err("must be between -100 and 100".into()),
        Err(e) => Err(e.to_string()),
    }
}
