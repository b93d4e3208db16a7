//! Builds of the program for several instruction sets, and which of them runs.
//!
//! Croupier's eight lanes are instructions that are chosen at compile time, so that no kernel asks what it may use. A
//! program for all processors is therefore several files, which `.ci/install` makes:
//!
//! | file | built for |
//! |---|---|
//! | `bin/croupier` | x86-64: every processor |
//! | `libexec/croupier/croupier-x86-64-v3` | AVX2 and FMA |
//!
//! The one that is started asks the processor once, and becomes (`exec`) the best that it finds beside itself or in
//! `../libexec/croupier`; without any it goes on. Pictures do not depend on the choice, only their time does. The
//! environment variable [`VARIABLE`] asks for one of [`SETS`]. Systems other than Unix run the file that is started.

use croupier::{INSTRUCTION_SET, processor_instruction_set};
use std::path::{Path, PathBuf};

/// Environment variable that asks for an instruction set.
const VARIABLE: &str = "CROUPIER_INSTRUCTIONS";

/// Instruction sets of programs, ascending.
const SETS: [&str; 3] = ["x86-64", "x86-64-v3", "x86-64-v4"];

/// Begin of the names of the files, in front of the instruction set.
const PREFIX: &str = "croupier-";

/// Becomes the program for the processor, if that is another one; returns if this one is to go on. The error is a
/// message.
pub(crate) fn choose() -> Result<(), String> {
    let asked = std::env::var_os(VARIABLE).filter(|set| !set.is_empty());
    let asked = asked.map(|set| set.to_string_lossy().into_owned());
    // The file itself, not a link that leads to it from another folder.
    let program = std::env::current_exe().and_then(std::fs::canonicalize);
    let Ok(program) = program else { return Ok(()) };
    if is_variant(&program) {
        return match asked {
            Some(set) if set != INSTRUCTION_SET => {
                Err(format!("{VARIABLE} is {set:.40?}, but {} is built for {INSTRUCTION_SET}", program.display()))
            }
            _ => Ok(()),
        };
    }
    let found = |set: &str| variant(&program, set).is_some();
    let Some(set) = choice(INSTRUCTION_SET, processor_instruction_set(), asked.as_deref(), found)? else {
        return Ok(());
    };
    match variant(&program, set).map(|file| (replace(&file), file)) {
        Some((error, file)) if asked.is_some() => Err(format!("cannot run {}: {error}", file.display())),
        // This program can do the same.
        _ => Ok(()),
    }
}

/// The instruction set to change to, `None` to stay with one's `own`.
fn choice(
    own: &str,
    processor: &str,
    asked: Option<&str>,
    found: impl Fn(&str) -> bool,
) -> Result<Option<&'static str>, String> {
    let rank = |set: &str| SETS.iter().position(|s| *s == set);
    let Some(asked) = asked else {
        // Builds for other architectures have no rank, and no variants.
        let Some((own, most)) = rank(own).zip(rank(processor)) else { return Ok(None) };
        return Ok(SETS.iter().take(most + 1).skip(own + 1).rev().find(|set| found(set)).copied());
    };
    if asked == own {
        return Ok(None);
    }
    let asked: String = asked.chars().take(40).collect();
    let Some(set) = SETS.iter().find(|set| **set == asked) else {
        return Err(format!("{VARIABLE} is {asked:?}; this program is for {own}, others for {}", SETS.join(", ")));
    };
    if rank(set) > rank(processor) {
        return Err(format!("{VARIABLE} asks for {set}; this processor has {processor}"));
    }
    if !found(set) {
        let places = "neither beside this program nor in ../libexec/croupier";
        return Err(format!("{VARIABLE} asks for {set}; there is no {PREFIX}{set}, {places}"));
    }
    Ok(Some(set))
}

/// Whether a file is one that others become: such a file stays itself, whatever it is built for, so that nothing goes
/// round in a circle.
fn is_variant(program: &Path) -> bool {
    program.file_name().is_some_and(|name| name.to_string_lossy().starts_with(PREFIX))
}

/// The file of a program for an instruction set.
fn variant(program: &Path, set: &str) -> Option<PathBuf> {
    let folder = program.parent()?;
    let name = format!("{PREFIX}{set}");
    [folder.join(&name), folder.join("../libexec/croupier").join(&name)].into_iter().find(|file| file.is_file())
}

/// Becomes the program `file`, with the same arguments and under the same name; returns only if that fails.
#[cfg(unix)]
fn replace(file: &Path) -> std::io::Error {
    use std::os::unix::process::CommandExt;
    let mut arguments = std::env::args_os();
    let mut command = std::process::Command::new(file);
    if let Some(name) = arguments.next() {
        command.arg0(name);
    }
    command.args(arguments).exec()
}

#[cfg(not(unix))]
fn replace(_file: &Path) -> std::io::Error {
    std::io::ErrorKind::Unsupported.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    const V1: &str = SETS[0];
    const V3: &str = SETS[1];
    const V4: &str = SETS[2];

    /// Killed by: a program that the processor cannot run; one that is worse than that which is started; a missing file.
    #[test]
    fn the_best_that_is_there_and_runs() {
        let all = |_: &str| true;
        let no_v4 = |set: &str| set != V4;
        let none = |_: &str| false;
        assert_eq!(choice(V1, V3, None, all), Ok(Some(V3)));
        assert_eq!(choice(V1, V4, None, all), Ok(Some(V4)));
        assert_eq!(choice(V1, V4, None, no_v4), Ok(Some(V3)));
        assert_eq!(choice(V1, V1, None, all), Ok(None));
        assert_eq!(choice(V1, V4, None, none), Ok(None));
        assert_eq!(choice(V3, V3, None, all), Ok(None));
        assert_eq!(choice(V3, V1, None, all), Ok(None));
        assert_eq!(choice("aarch64", "aarch64", None, all), Ok(None));
    }

    /// Killed by: a request that is not followed, or without a word.
    #[test]
    fn the_one_that_was_asked_for() {
        let all = |_: &str| true;
        assert_eq!(choice(V1, V4, Some(V1), all), Ok(None));
        assert_eq!(choice(V3, V3, Some(V1), all), Ok(Some(V1)));
        assert_eq!(choice(V1, V4, Some(V3), all), Ok(Some(V3)));
        assert_eq!(choice("aarch64", "aarch64", Some("aarch64"), all), Ok(None));
        let message = |asked: &str, found: bool| choice(V1, V3, Some(asked), |_| found).unwrap_err();
        assert!(message(V4, true).contains("asks for x86-64-v4; this processor has x86-64-v3"));
        assert!(message(V3, false).contains("there is no croupier-x86-64-v3"));
        assert!(message(&"\n".repeat(999), true).len() < 300);
        assert!(choice("aarch64", "aarch64", Some(V3), all).is_err());
    }

    /// Killed by: a program that becomes itself without end.
    #[test]
    fn variants_are_told_by_their_names() {
        assert!(is_variant(Path::new("/a/croupier-x86-64-v3")));
        assert!(!is_variant(Path::new("/croupier-x86-64/croupier")));
    }
}
