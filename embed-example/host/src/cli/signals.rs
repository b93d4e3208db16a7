//! Signals that ask the program to end: SIGINT (Ctrl-C), SIGTERM and SIGHUP.
//!
//! While a render runs, the first one ends it soon, and everything is saved; the exit status is 128 plus the number of the
//! signal. While the files of a render that is complete are written, the first one changes nothing, and the status is 0.
//! Any other one ends the program at once, without temporary files left behind, with the status 128 plus its number.
//! Signals that the parent process has set to be ignored (`nohup`, jobs in the background of a script)
//! stay ignored.

use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

/// Number of the first signal, 0 before.
static RECEIVED: AtomicI32 = AtomicI32::new(0);

/// Whether a signal is to be answered by saving.
static SAVING: AtomicBool = AtomicBool::new(false);

/// From now on the first signal asks for what there is so far.
pub(crate) fn save_at_first() {
    SAVING.store(true, Ordering::Relaxed);
}

/// Number of the signal that asked for the end of the render.
pub(crate) fn received() -> Option<i32> {
    Some(RECEIVED.load(Ordering::Relaxed)).filter(|n| *n != 0)
}

/// Exit status of a program that a signal ended.
fn status(signal: i32) -> i32 {
    128 + signal
}

/// Exit status after an interrupted render; `None` without a signal.
pub(crate) fn exit_status() -> Option<u8> {
    received().and_then(|n| u8::try_from(status(n)).ok())
}

/// Name of a signal for messages.
pub(crate) fn name(signal: i32) -> String {
    match signal {
        1 => "SIGHUP".into(),
        2 => "Ctrl-C".into(),
        15 => "SIGTERM".into(),
        n => format!("signal {n}"),
    }
}

/// Answers a signal.
fn answer(signal: i32) {
    let first = RECEIVED.compare_exchange(0, signal, Ordering::Relaxed, Ordering::Relaxed).is_ok();
    if first && SAVING.load(Ordering::Relaxed) {
        super::console::note(&format!(
            "{}: the picture so far is saved; once more ends the program at once",
            name(signal)
        ));
        return;
    }
    croupier_host::image::remove_parts();
    #[expect(clippy::disallowed_methods, reason = "there is nothing to save, or the user asked twice for the end")]
    std::process::exit(status(signal));
}

/// Begins to catch the signals. Where that fails, they do what they do by default.
#[cfg(unix)]
pub(crate) fn install() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let caught = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|s| !ignored(*s));
    let Ok(mut signals) = signal_hook::iterator::Signals::new(caught) else { return };
    std::thread::spawn(move || signals.forever().for_each(answer));
}

/// Begins to catch Ctrl-C.
#[cfg(not(unix))]
pub(crate) fn install() {
    // Fails only if a handler is there already; then that one decides.
    let _ = ctrlc::set_handler(|| answer(2));
}

/// Whether the parent process has set the signal to be ignored; known on Linux only.
#[cfg(unix)]
fn ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|l| l.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|m| u64::from_str_radix(m.trim(), 16).ok()).unwrap_or(0);
    (1..=64).contains(&signal) && mask >> (signal - 1) & 1 == 1
}
