//! The program `croupier`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    // Before anything else: the rest of the program is made of instructions that the processor may not have.
    if let Some(missing) = croupier::missing_instructions() {
        eprintln!(
            "croupier: this build needs a processor with {}; this one lacks {missing}",
            croupier::INSTRUCTION_SET
        );
        return ExitCode::FAILURE;
    }
    cli::run()
}
