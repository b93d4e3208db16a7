//! The program `croupier`.

mod cli;
mod cpu;

use std::process::ExitCode;

fn main() -> ExitCode {
    // Before anything else: the rest of the program is made of instructions that the processor may not have.
    if let Some(missing) = cpu::missing() {
        eprintln!("croupier: this build needs a processor with AVX2 and FMA (x86-64-v3); this one lacks {missing}");
        return ExitCode::FAILURE;
    }
    cli::run()
}
