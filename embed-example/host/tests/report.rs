//! `croupier report` from outside: its files, the page that needs nothing else, ledgers that are none.
#![cfg(feature = "program")]

mod common;

use common::{croupier, text};
use std::fs;
use std::path::Path;

/// Runs the program, which must succeed.
fn report(folder: &Path, arguments: &[&str]) -> String {
    let out = croupier(folder, &[&["report"], arguments].concat());
    assert!(out.status.success(), "{arguments:?}: {}", text(&out.stderr));
    text(&out.stdout)
}

/// A report of next to nothing has all sections; its page asks for nothing from elsewhere, and is the same again when it is
/// made from the ledger. Killed by: a figure that needs what the ledger has not, a page that holds a link, a ledger that
/// loses digits.
#[test]
fn the_page_is_made_of_the_ledger_alone() {
    let dir = tempfile::tempdir().unwrap();
    let said = report(dir.path(), &["--tiny", "--out", "a"]);
    assert!(said.contains("tiny report: about") && said.contains("a/index.html"), "{said}");
    let page = fs::read_to_string(dir.path().join("a/index.html")).unwrap();
    for link in ["http:", "https:", "//", "src=", "@import", "url("] {
        assert!(!page.contains(link), "the page has {link}");
    }
    let names = |folder: &str| {
        let mut names: Vec<_> =
            fs::read_dir(dir.path().join(folder)).unwrap().map(|f| f.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let files = names("a");
    for name in ["error-0.svg", "times-0.svg", "settings-0.svg", "depth-0.svg", "kernels.svg", "reliability.svg"] {
        assert!(files.iter().any(|f| f == name), "no {name} in {files:?}");
        assert!(page.contains(&format!("id=\"{}\"", &name[..name.len() - 4])), "{name} is not in the page");
    }
    report(dir.path(), &["--ledger", "a/ledger.json", "--out", "b"]);
    assert_eq!(names("b"), files);
    for name in &files {
        let [a, b] = ["a", "b"].map(|folder| fs::read(dir.path().join(folder).join(name)).unwrap());
        assert!(a == b, "{name:?} differs");
    }
    // beside the ledger, which stays; functions that are there are not joined again
    report(dir.path(), &["--ledger", "a/ledger.json", "--out", "a"]);
    report(dir.path(), &["--ledger", "a/ledger.json", "--join", "b/ledger.json", "--out", "c"]);
    let [a, c] = ["a", "c"].map(|folder| fs::read(dir.path().join(folder).join("ledger.json")).unwrap());
    assert!(a == c, "functions were joined twice");
}

/// Killed by: a ledger of another format that is read, one that is written over, a fault without the file's name.
#[test]
fn what_is_no_ledger_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let fails = |arguments: &[&str], part: &str| {
        let out = croupier(dir.path(), &[&["report"], arguments].concat());
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{error}");
        assert!(error.starts_with("croupier: ") && error.contains(part), "{arguments:?}: {error}");
    };
    let made = r#"{"date":"","commit":"","command":"","version":"","machine":"","load":"","instruction_set":"",
        "arithmetic":"","mode":"","seconds_stated":0.0,"seconds_taken":0.0}"#;
    let ledger =
        |format: u32| format!(r#"{{"format":{format},"made":{made},"kernels":[],"components":[],"scenes":[]}}"#);
    fs::write(dir.path().join("none.json"), "{}").unwrap();
    fs::write(dir.path().join("old.json"), ledger(0)).unwrap();
    fs::create_dir(dir.path().join("out")).unwrap();
    fs::write(dir.path().join("out/ledger.json"), ledger(1)).unwrap();
    fails(&["--ledger", "missing.json"], "missing.json");
    fails(&["--ledger", "none.json"], "none.json: no ledger");
    fails(&["--ledger", "old.json"], "old.json: a ledger of format 0");
    fails(&["--ledger", "out/ledger.json", "--join", "out/ledger.json", "--out", "out"], "would be written over");
    // an empty ledger is a page without figures
    report(dir.path(), &["--ledger", "out/ledger.json", "--out", "empty"]);
    assert!(fs::read_to_string(dir.path().join("empty/index.html")).unwrap().contains("What accuracy costs"));
}
