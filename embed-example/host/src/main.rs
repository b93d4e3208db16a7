//! The program `croupier`.

mod cli;
mod variants;

use std::process::ExitCode;

fn main() -> ExitCode {
    // Before anything else: the rest of the program is made of instructions that the processor may not have.
    match croupier::missing_instructions() {
        Some(missing) => refuse(missing),
        None => start(),
    }
}

/// Says what the processor lacks. Nothing but a message is made here, and no part of it by vectors: the test
/// `old_processors` runs it on one.
#[cold]
#[inline(never)]
fn refuse(missing: &str) -> ExitCode {
    eprintln!("croupier: this build needs a processor with {}; this one lacks {missing}", croupier::INSTRUCTION_SET);
    ExitCode::FAILURE
}

/// The whole program, or that of another instruction set in its place.
#[inline(never)]
fn start() -> ExitCode {
    match variants::choose() {
        Ok(()) => cli::run(),
        Err(message) => {
            eprintln!("croupier: {message}");
            ExitCode::FAILURE
        }
    }
}
