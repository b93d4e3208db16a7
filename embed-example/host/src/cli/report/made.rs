//! Where a ledger comes from: date, commit, machine, build.

use super::ledger::Made;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

/// All that is known before measuring.
pub(super) fn here(mode: &str) -> Made {
    Made {
        date: date(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs())),
        commit: commit(),
        command: command(),
        version: env!("CARGO_PKG_VERSION").into(),
        machine: machine(),
        load: std::fs::read_to_string("/proc/loadavg")
            .ok()
            .and_then(|text| text.split(' ').next().map(String::from))
            .unwrap_or_else(|| "unknown".into()),
        instruction_set: croupier::INSTRUCTION_SET.into(),
        arithmetic: super::kernels::ARITHMETIC.into(),
        mode: mode.into(),
        twins: super::twins::Twins::of_this_build().source(),
        ..Made::default()
    }
}

/// Day in UTC of seconds since 1970 (Hinnant, "chrono-compatible low-level date algorithms").
fn date(seconds: u64) -> String {
    let days = (seconds / 86_400) as i64 + 719_468;
    let (era, day) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let (day, month) = (day - (153 * month + 2) / 5 + 1, if month < 10 { month + 3 } else { month - 9 });
    format!("{:04}-{month:02}-{day:02}", year + era * 400 + i64::from(month <= 2))
}

/// Commit of the sources that the program was built from, if they are still there.
fn commit() -> String {
    let git = |args: &[&str]| {
        let out = Command::new("git").args(["-C", env!("CARGO_MANIFEST_DIR")]).args(args).output().ok()?;
        let text = String::from_utf8(out.stdout).ok().filter(|_| out.status.success())?;
        Some(text.trim_end().to_string())
    };
    let Some(hash) = git(&["rev-parse", "--short=12", "HEAD"]) else { return "unknown".into() };
    match git(&["status", "--porcelain", "--untracked-files=no", "--", ":/", ":(exclude,top)benches/results"])
        .as_deref()
    {
        Some("") => hash,
        _ => format!("{hash} with uncommitted changes"),
    }
}

/// The command, with paths cut to their last part.
fn command() -> String {
    let last = |text: String| {
        let name = std::path::Path::new(&text).file_name().map(|n| n.to_string_lossy().into_owned());
        if text.contains('/') { name.unwrap_or(text) } else { text }
    };
    let arguments: Vec<_> = std::env::args().skip(1).map(last).collect();
    format!("croupier {}", arguments.join(" "))
}

/// Model of the processor and number of cores.
fn machine() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = info.lines().find(|l| l.starts_with("model name")).and_then(|l| l.split_once(": "));
    let model = line.map_or("unknown processor", |l| l.1.trim());
    format!("{model}, {} cores", super::timing::threads())
}

#[cfg(test)]
mod tests {
    /// Killed by: months that begin in January, days off by one.
    #[test]
    fn dates() {
        let day = 86_400;
        assert_eq!(super::date(0), "1970-01-01");
        assert_eq!(super::date(951_782_400), "2000-02-29");
        assert_eq!(super::date(951_782_400 + day), "2000-03-01");
        assert_eq!(super::date(1_798_761_599), "2026-12-31");
        assert_eq!(super::date(1_798_761_600), "2027-01-01");
    }
}
