//! Files of results are read as they were written, and documents cite what they say.

use croupier_benches::figures::{Checked, check};
use croupier_benches::results::{Results, Table};
use std::error::Error;
use std::path::{Path, PathBuf};

fn sample() -> Results {
    let mut speed = Table::new("", "scene, strategy, Mrays/s, spread");
    speed.add(["cbox", "ears", "6.26 [6.1, 6.4]", "-"]);
    speed.add(["cbox", "classic", "8.09", "-"]);
    speed.add(["kitchen", "ears", "2.315", "-0.25"]);
    let mut gain = Table::new("Speed-up over classic", "strategy, cbox, kitchen, mean");
    gain.add(["ears+shadow", "1.41x", "2.42x", "1.85x"]);
    gain.add(["adrrs", "1.14x", "1.90x", "1.47x"]);
    let header = [("date", "2026-01-02"), ("command", "cargo run -- --only a: b")];
    Results { header: header.map(|(k, v)| (k.into(), v.into())).into(), tables: vec![speed, gain] }
}

fn read(name: &str) -> Result<Results, Box<dyn Error>> {
    if name == "sample" { Ok(sample()) } else { Err(format!("no {name}").into()) }
}

/// Killed by: a second table that is read as rows of the first, titles or header lines that are lost, a rule of dashes
/// that is read as a row.
#[test]
fn results_are_read_as_they_were_written() {
    let text = sample().text("sample").unwrap();
    let back = Results::parse(&text);
    assert_eq!(back, sample(), "{text}");
    assert_eq!(back.header("command"), Some("cargo run -- --only a: b"));
    assert_eq!(back.tables[0].row(&["kitchen", "ears"]).map(|r| &*r[2]), Some("2.315"));
    assert_eq!(back.tables[0].row(&["kitchen", "classic"]), None);
}

/// Every way to write a marker. Killed by: figures that are counted without being compared, rows and columns that are
/// not exchanged, names that are not replaced.
/// Killed by: a tolerance on the wrong side, columns or rows that are not looked at or not found, rows that are compared
/// with others.
#[test]
fn figures_that_rise_are_found() {
    let table = |rows: &[[&str; 4]]| {
        let mut table = Table::new("", "scene, strategy, rays, instructions");
        rows.iter().for_each(|r| table.add(*r));
        table
    };
    let old = table(&[["box", "none", "16", "1000"], ["box", "ears", "16", "2000"]]);
    let risen = |rows: &[[&str; 4]], columns: &[&str]| table(rows).risen(&old, 2, columns, 2.0);
    let both = ["rays", "instructions"];
    assert_eq!(risen(&[["box", "ears", "16", "2040"], ["box", "none", "3", "1020"]], &both), Ok(vec![]));
    let above = risen(&[["box", "none", "16", "1000"], ["box", "ears", "17", "2041"]], &both).unwrap();
    assert_eq!(above, ["box, ears, rays: 16 -> 17 (+6.25 %)", "box, ears, instructions: 2000 -> 2041 (+2.05 %)"]);
    assert_eq!(risen(&[["box", "ears", "17", "2041"]], &["rays"]).unwrap().len(), 1);
    let error = |rows: &[[&str; 4]], column| risen(rows, &[column]).unwrap_err();
    assert!(error(&[["hall", "ears", "1", "1"]], "rays").contains("hall"));
    assert!(error(&[["box", "ears", "1", "1"]], "rats").contains("'rats': there is no such column"));
    assert!(error(&[["box", "ears", "1", "some"]], "instructions").contains("'some' is no number"));
}

#[test]
fn figures_that_agree_are_counted() {
    let document = "\
        `ears` has 6.3<!-- = sample / cbox, ears / Mrays/s --> million rays per second, 2.3x<!-- = sample / kitchen, \
        ears / Mrays/s -->, and is **1.41x**<!-- = sample / Speed-up over classic / ears+shadow / cbox --> as good.\n\n\
        <!-- a comment that is no marker -->\n```text\n1<!-- = sample / in code / none -->\n```\n\
        <!-- table = sample / Speed-up over classic; ears = ears+shadow; over both = mean -->\n\
        | scene | `adrrs` | **`ears`** |\n|---|---|---|\n| cbox | 1.1 | **1.41x** |\n| over both | 1.47x | 1.9x |\n\n\
        <!-- table = sample; keys = 2; speed (spread) = Mrays/s, spread -->\n\
        | scene | strategy | speed (spread) |\n|---|---|---|\n| kitchen | ears | 2.31 (-0.3) |\n";
    assert_eq!(check(document, read), Checked { figures: 9, wrong: Vec::new() });
}

/// Killed by: any comparison that is left out, errors that pass for comments.
#[test]
fn figures_that_do_not_agree_are_found() {
    for (document, why) in [
        ("6.2<!-- = sample / cbox, ears / Mrays/s -->", "6.2 should be 6.26"),
        ("6.270<!-- = sample / cbox, ears / Mrays/s -->", "6.270 should be"),
        ("0.25<!-- = sample / kitchen, ears / spread -->", "0.25 should be -0.25"),
        ("fast<!-- = sample / cbox, ears / Mrays/s -->", "no figure before"),
        ("1<!-- = sample / cbox, none / Mrays/s -->", "no such row or column"),
        ("1<!-- = sample / cbox, ears / Grays/s -->", "no such row or column"),
        ("1<!-- = sample / Speed-down / cbox / ears -->", "no such table"),
        ("1<!-- = sample / cbox -->", "is not FILE"),
        ("1<!-- = sample / cbox, ears /\nMrays/s -->", "does not end on its line"),
        ("1<!--\n= sample / cbox, ears / Mrays/s -->", "does not end on its line"),
        ("1<!-- = other / cbox / ears -->", "no other"),
        (
            "<!-- table = sample / Speed-up over classic -->\n| a | adrrs |\n|---|---|\n| cbox | 1.15 |",
            "1.15 should be 1.14x",
        ),
        ("<!-- table = sample / Speed-up over classic -->\n| a | ears |\n|---|---|\n| cbox | 1.41 |", "nothing for"),
        ("<!-- table = sample / Speed-up over classic -->\n\n| a | adrrs |", "no table below"),
        ("<!-- table = sample / Speed-up over classic -->\n| a | adrrs |\n|---|---|\n\n", "no figures below"),
        ("<!-- table = sample / Speed-up -->\n| a | adrrs |\n|---|---|\n| cbox | 1.14 |", "no table with this title"),
    ] {
        let checked = check(document, read);
        assert_eq!((checked.figures, checked.wrong.len()), (0, 1), "{document}");
        assert!(checked.wrong[0].contains(why), "{document}: {checked:?}");
    }
}

/// Killed by: results that are renewed without the documents that cite them, or the other way round; a README without
/// figures.
#[test]
fn documents_cite_the_newest_results() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    let in_folder = |name: &str| -> Vec<PathBuf> {
        std::fs::read_dir(root.join(name)).unwrap().map(|e| e.unwrap().path()).collect()
    };
    let mut documents = [in_folder("docs"), in_folder("benches")].concat();
    documents.retain(|p| p.extension().is_some_and(|e| e == "md"));
    documents.push(root.join("README.md"));
    let mut wrong = Vec::new();
    for path in documents {
        let name = path.strip_prefix(root).unwrap().display().to_string();
        let checked = check(&std::fs::read_to_string(&path).unwrap(), Results::read);
        wrong.extend(checked.wrong.iter().map(|w| format!("{name}, {w}")));
        assert!(name != "README.md" || checked.figures > 0, "README.md has no marked figure");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// All committed files of results state where they are from, and hold what their format allows. Killed by: a file that
/// was edited so that it is not read as it is written.
#[test]
fn committed_results_state_their_provenance() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../results");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            // the page of `croupier report`: its ledger says where it is from
            assert!(path.join("ledger.json").exists(), "{path:?}: no ledger");
            continue;
        }
        if path.extension().is_some_and(|e| e == "jsonl") {
            // the ledger of `hard`, with a test of its own
            continue;
        }
        let name = path.file_stem().unwrap().to_str().unwrap();
        let results = Results::read(name).unwrap();
        for key in ["date", "commit", "command", "machine", "compiler", "instruction set", "arithmetic"] {
            assert!(results.header(key).is_some_and(|v| !v.is_empty()), "{name}: no {key}");
        }
        assert!(!results.tables.is_empty(), "{name}: no table");
        for table in &results.tables {
            assert!(table.rows.iter().all(|r| r.len() == table.columns.len()), "{name}: {}", table.title);
        }
        assert_eq!(results.text(name).unwrap(), std::fs::read_to_string(&path).unwrap(), "{name}");
    }
}
