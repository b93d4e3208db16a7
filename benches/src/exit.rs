//! How a benchmark ends.

use std::error::Error;
use std::process::ExitCode;

/// Exit code of the benchmark `name`: failure if it has found a fault (`false`) or cannot run, which standard error says.
pub fn exit_code(name: &str, outcome: Result<bool, Box<dyn Error>>) -> ExitCode {
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(e) => {
            eprintln!("{name}: {e}");
            ExitCode::FAILURE
        }
    }
}
