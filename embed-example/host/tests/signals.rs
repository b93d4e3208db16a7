//! Signals: what is saved, what is left behind, which status.
#![cfg(feature = "program")]
#![cfg(target_os = "linux")]

mod common;

use common::text;
use croupier_host::image::Picture;
use std::io::{BufRead, BufReader, Read};
use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

/// A render, which ends with the test at the latest.
struct Render(Child);

impl Deref for Render {
    type Target = Child;

    fn deref(&self) -> &Child {
        &self.0
    }
}

impl DerefMut for Render {
    fn deref_mut(&mut self) -> &mut Child {
        &mut self.0
    }
}

impl Drop for Render {
    fn drop(&mut self) {
        // an error says that it has ended
        let _ = self.0.kill();
    }
}

/// A render that has begun and would take weeks, and the lines that it has yet to say. It takes signals even if the tests
/// run in the background of a shell, which ignores some.
fn begin(folder: &Path, size: &str, more: &[&str]) -> (Render, BufReader<ChildStdout>) {
    let child = Command::new("env")
        .args(["--default-signal=INT,HUP,TERM", env!("CARGO_BIN_EXE_croupier")])
        .args(["render", "--size", size, "--threads", "1", "--rrs", "ears", "--seconds", "1000000"])
        .args(more)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut child = Render(child);
    let mut said = BufReader::new(child.stdout.take().unwrap());
    // Scene and memory: from there on a signal saves.
    let mut lines = String::new();
    (0..2).for_each(|_| assert!(said.read_line(&mut lines).unwrap() > 0));
    assert!(lines.contains("built-in scene: "), "{lines}");
    (child, said)
}

fn send(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

fn rest(mut from: impl Read) -> String {
    let mut all = Vec::new();
    from.read_to_end(&mut all).unwrap();
    text(&all)
}

fn names(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

/// Killed by: a signal that is not caught, after which the statistics or the pictures are lost, whose picture is said
/// to be whole, or that ends in status 0.
#[test]
fn everything_is_saved_after_a_signal() {
    for (signal, status, name) in [("-INT", 130, "Ctrl-C"), ("-TERM", 143, "SIGTERM"), ("-HUP", 129, "SIGHUP")] {
        let dir = tempfile::tempdir().unwrap();
        let (mut child, said) = begin(dir.path(), "16x16", &["--cache-out", "a.cache", "--checkpoint", "a.check"]);
        send(&child, signal);
        let (said, notes) = (rest(said), rest(child.stderr.take().unwrap()));
        assert_eq!(child.wait().unwrap().code(), Some(status), "{notes}");
        assert!(said.starts_with("partial picture: "), "{said}");
        assert!(notes.contains(&format!("{name} ended the render: the picture is partial")), "{notes}");
        assert!(std::fs::read(dir.path().join("a.cache")).unwrap().starts_with(b"CRPCACHE"));
        assert_eq!(names(dir.path()), ["a.cache", "a.check", "croupier.exr", "croupier.png"]);
        let exr = Picture::read_exr(&dir.path().join("croupier.exr")).unwrap();
        assert!((exr.width, exr.height) == (16, 16) && exr.rgb("").unwrap().pixels.iter().any(|c| c[0] > 0.0));
    }
}

/// A second signal ends the program at once, whatever it was doing, and leaves no temporary file: also none that was there
/// when it came. Killed by: a second signal that is ignored, temporary files that nobody removes.
#[test]
fn a_second_signal_ends_it_at_once() {
    let mut seen = 0;
    for pause in [Some(0), Some(5), Some(20), Some(60), None, None, None] {
        let dir = tempfile::tempdir().unwrap();
        // large files, so that some are being written
        let (mut child, said) = begin(dir.path(), "1200x900", &["--false-color"]);
        send(&child, "-INT");
        // The first is taken before the second comes: else they are one.
        let mut notes = BufReader::new(child.stderr.take().unwrap());
        let mut lines = String::new();
        while !lines.contains("once more ends the program at once") {
            assert!(notes.read_line(&mut lines).unwrap() > 0, "{lines}");
        }
        match pause {
            Some(pause) => std::thread::sleep(std::time::Duration::from_millis(pause)),
            // until a file is being written, or all are
            None => loop {
                if names(dir.path()).iter().any(|n| n.contains(".part")) {
                    seen += 1;
                    break;
                }
                if child.try_wait().unwrap().is_some() {
                    break;
                }
            },
        }
        // a process that has been waited for is no longer there
        if child.try_wait().unwrap().is_none() {
            send(&child, "-TERM");
        }
        drop(said);
        let status = child.wait().unwrap().code();
        // 143, or 130 if everything was written before it came
        assert!(matches!(status, Some(130 | 143)), "{status:?}");
        assert!(names(dir.path()).iter().all(|n| !n.contains(".part")), "{:?}", names(dir.path()));
    }
    assert!(seen > 0, "no temporary file was seen");
}

/// Killed by: a handler where the parent process wants a signal ignored (`nohup`).
#[test]
fn ignored_signals_stay_ignored() {
    let dir = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_croupier");
    let script = format!("trap '' HUP; exec {program} render --size 16x16 --threads 1 --seconds 1000000");
    let mut child =
        Command::new("sh").args(["-c", &script]).current_dir(dir.path()).stdout(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap());
    let mut lines = String::new();
    (0..2).for_each(|_| assert!(said.read_line(&mut lines).unwrap() > 0));
    send(&child, "-HUP");
    std::thread::sleep(std::time::Duration::from_millis(200));
    assert!(child.try_wait().unwrap().is_none());
    send(&child, "-TERM");
    assert_eq!(child.wait().unwrap().code(), Some(143));
}
