//! Output of commands, and how they end.

use croupier_host::text::escaped;
use std::error::Error;
use std::io::{self, Write};

/// Result of a command; an error is printed as one line.
pub(crate) type Outcome = Result<(), Box<dyn Error>>;

/// Prints one line on stderr, whatever the text holds.
pub(crate) fn complain(text: &str) {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let _ = writeln!(io::stderr(), "croupier: {}", escaped(&text));
}

/// Prints a note: no error, but perhaps not what the user expects.
pub(crate) fn note(text: &str) {
    complain(&format!("note: {text}"));
}

/// Prints a line of results. A reader that has gone away (`croupier info | head`) is no error.
pub(crate) fn say(line: &str) -> Outcome {
    match writeln!(io::stdout(), "{line}") {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(e.into()),
        _ => Ok(()),
    }
}

/// Prints results as one line of JSON; numbers that are not finite become `null`.
pub(crate) fn say_json(value: &impl serde::Serialize) -> Outcome {
    say(&serde_json::to_string(value)?)
}
