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

/// A report of next to nothing has all sections; its page asks for nothing from elsewhere, and is the same again when
/// it is made from the ledger. Killed by: a figure that needs what the ledger has not, a page that holds a link, a
/// ledger that loses digits.
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
    let figures = ["error-0", "times-0", "settings-0", "depth-0", "kernels", "primitives", "twins-scattering"];
    let more = ["components-scattering", "twins-lights", "components-lights", "twins-media", "components-media"];
    for name in figures.iter().chain(&more).map(|name| format!("{name}.svg")) {
        assert!(files.iter().any(|f| *f == *name), "no {name} in {files:?}");
        assert!(page.contains(&format!("id=\"{}\"", &name[..name.len() - 4])), "{name} is not in the page");
    }
    // an interval or none, full time, kernels and components with what callgrind and the twins say
    for text in ["right, of all", "The full report would take", "Möller-Trumbore", "power heuristic", "commit"] {
        assert!(page.contains(text), "the page does not say {text}");
    }
    assert!(said.contains("the full one: about"), "{said}");
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

/// Another arithmetic is one more setting, and more functions and components. Killed by: a join that loses them, that
/// adds a setting of the same arithmetic.
#[test]
fn ledgers_of_other_builds_are_joined() {
    let dir = tempfile::tempdir().unwrap();
    report(dir.path(), &["--tiny", "--out", "a"]);
    let read = |folder: &str| -> serde_json::Value {
        serde_json::from_slice(&fs::read(dir.path().join(folder).join("ledger.json")).unwrap()).unwrap()
    };
    let mut other = read("a");
    other["made"]["arithmetic"] = "other".into();
    for c in other["components"].as_array_mut().unwrap() {
        c["arithmetic"] = "other".into();
    }
    for k in other["kernels"].as_array_mut().unwrap() {
        k["variant"] = format!("{}, other", k["variant"].as_str().unwrap()).into();
    }
    fs::write(dir.path().join("other.json"), other.to_string()).unwrap();
    report(dir.path(), &["--ledger", "a/ledger.json", "--join", "other.json", "--out", "b"]);
    let count = |ledger: &serde_json::Value, what: &str| ledger[what].as_array().unwrap().len();
    let (one, both) = (read("a"), read("b"));
    for what in ["kernels", "components"] {
        assert_eq!(count(&both, what), 2 * count(&one, what), "{what}");
    }
    let knobs = both["scenes"][0]["knobs"].as_array().unwrap();
    assert!(knobs.iter().any(|k| k["name"] == "arithmetic other, measured apart"), "{knobs:?}");
    // what has the same arithmetic is no setting
    report(dir.path(), &["--ledger", "a/ledger.json", "--join", "b/ledger.json", "--out", "c"]);
    assert_eq!(count(&read("c")["scenes"][0], "knobs"), count(&one["scenes"][0], "knobs"));
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
    let made = r#"{"date":"","commit":"abc","command":"","version":"","machine":"","load":"","instruction_set":"",
        "arithmetic":"","mode":"","seconds_stated":0.0,"seconds_taken":0.0,"seconds_of_all":0.0,"twins":""}"#;
    let ledger =
        |format: u32| format!(r#"{{"format":{format},"made":{made},"kernels":[],"components":[],"scenes":[]}}"#);
    fs::write(dir.path().join("none.json"), "{}").unwrap();
    // of the first format, whose ledgers had less in them
    let first = format!(r#"{{"format":1,"made":{},"kernels":[],"components":[],"scenes":[]}}"#, r#"{"commit":"abc"}"#);
    fs::write(dir.path().join("old.json"), first).unwrap();
    fs::create_dir(dir.path().join("out")).unwrap();
    fs::write(dir.path().join("out/ledger.json"), ledger(2)).unwrap();
    fails(&["--ledger", "missing.json"], "missing.json");
    fails(&["--ledger", "none.json"], "none.json: no ledger");
    fails(&["--ledger", "old.json"], "old.json: a ledger of format 1, this program reads 2; the program of commit abc");
    fails(&["--ledger", "out/ledger.json", "--join", "out/ledger.json", "--out", "out"], "would be written over");
    // an empty ledger is a page without figures
    report(dir.path(), &["--ledger", "out/ledger.json", "--out", "empty"]);
    assert!(fs::read_to_string(dir.path().join("empty/index.html")).unwrap().contains("What accuracy costs"));
}
