//! `docs/ARCHITECTURE.md` says what the code is: layers, sizes, and which files a new thing touches. Paths and tests that
//! any document cites exist.

use croupier::unstable::BYTES_PER_PATH;
use croupier::unstable::film::{Aov, AovSet};
use croupier::unstable::learn::cache::{CacheSize, Training};
use croupier::{Plan, Settings, Strategy};
use croupier_tests::documents::{FOLDERS, Rows, document, documents, prose, quoted, read, root, sources, tables};
use std::collections::{BTreeSet, HashMap};

const ARCHITECTURE: &str = "docs/ARCHITECTURE.md";

/// A file that a row of "to add X, touch Y" names.
#[derive(Debug, PartialEq, Eq)]
struct Touched {
    path: String,
    new: bool,
    /// What the file holds.
    marks: Vec<String>,
}

/// Files in a cell: `` `PATH` (`MARK`, `MARK`); `PATH` (new) ``.
fn touched(cell: &str) -> Result<Vec<Touched>, String> {
    let mut files = Vec::new();
    for item in cell.split("; ").filter(|i| !i.is_empty()) {
        let wrong = || format!("`{item}` is not a path and what to look for in it");
        let (path, rest) = item.strip_prefix('`').and_then(|i| i.split_once('`')).ok_or_else(wrong)?;
        let inside = rest.strip_prefix(" (").and_then(|r| r.strip_suffix(')')).ok_or_else(wrong)?;
        let marks: Vec<String> = quoted(inside).iter().map(|(mark, _)| mark.to_string()).collect();
        // a mark of three letters is found in any file
        if marks.is_empty() != (inside == "new") || marks.iter().any(|m| m.trim().len() < 4) {
            return Err(wrong());
        }
        files.push(Touched { path: path.into(), new: inside == "new", marks });
    }
    Ok(files)
}

/// What is wrong with a row; `look` gives the text of a file, an empty one of a folder.
fn faults(row: &[String], look: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let [name, core, host, count, _] = row else { return vec![format!("{row:?} has not five cells")] };
    let mut wrong = Vec::new();
    let mut numbers = Vec::new();
    for (cell, folder) in [(core, "core/src/"), (host, "embed-example/host/src/")] {
        let files = touched(cell).unwrap_or_else(|e| {
            wrong.push(e);
            Vec::new()
        });
        let paths: BTreeSet<&str> = files.iter().map(|f| &*f.path).collect();
        if paths.len() != files.len() {
            wrong.push(format!("{folder}: a file twice"));
        }
        numbers.push(paths.iter().filter(|p| p.starts_with(folder)).count().to_string());
        for Touched { path, new, marks } in &files {
            let parent = path.trim_end_matches('/').rsplit_once('/').map_or("", |(parent, _)| parent);
            match look(path) {
                None if !new => wrong.push(format!("no {path}")),
                None if look(parent).is_none() => wrong.push(format!("no {parent} for {path}")),
                Some(_) if *new => wrong.push(format!("{path} is not new")),
                None => (),
                Some(text) => {
                    let missing = marks.iter().filter(|m| !text.contains(&***m));
                    wrong.extend(missing.map(|m| format!("{path} does not hold `{m}`")));
                }
            }
        }
    }
    if numbers.join(" + ") != *count {
        wrong.push(format!("{count} files, but named are {}", numbers.join(" + ")));
    }
    wrong.into_iter().map(|w| format!("{name}: {w}")).collect()
}

/// Text of a file of the repository, an empty one of a folder.
fn look(path: &str) -> Option<String> {
    if root().join(path).is_dir() { Some(String::new()) } else { read(path) }
}

fn rows() -> Rows {
    tables(&document(ARCHITECTURE), "to add").concat()
}

/// Killed by: a table, a macro or a file that is renamed, a feature that has come and is still called new, a file that
/// is added to a row without being counted.
#[test]
fn rows_of_to_add_x_are_true() {
    let rows = rows();
    let wrong: Vec<String> = rows.iter().flat_map(|row| faults(row, look)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for feature in [
        "roulette",
        "BSDF",
        "light",
        "setting",
        "sampler",
        "packet class",
        "media",
        "guiding",
        "C interface",
        "instances",
    ] {
        assert!(rows.iter().any(|r| r[0].contains(feature)), "no row for {feature}");
    }
}

/// The check above can fail.
#[test]
fn wrong_rows_are_found() {
    let files = HashMap::from([
        ("core/src", ""),
        ("core/src/a.rs", "models! {}"),
        ("embed-example/host/src/b.rs", "enum Model"),
    ]);
    let look = |path: &str| files.get(path).map(|t| t.to_string());
    let of = |core: &str, host: &str, count: &str| {
        faults(&["x", core, host, count, "1"].map(String::from), look).join(" and ")
    };
    assert_eq!(of("`core/src/NAME.rs` (new); `core/src/a.rs` (`models!`)", "", "2 + 0"), "");
    assert_eq!(of("", "`embed-example/host/src/b.rs` (`Model`)", "0 + 1"), "");
    assert!(of("", "`embed-example/host/src/b.rs` (`Mo`)", "0 + 1").contains("is not a path"), "a mark too short");
    for (core, count, why) in [
        ("`core/src/b.rs` (`models!`)", "1 + 0", "no core/src/b.rs"),
        ("`core/src/a.rs` (`lights!`)", "1 + 0", "does not hold `lights!`"),
        ("`core/src/a.rs` (`models!`, `lights!`)", "1 + 0", "does not hold `lights!`"),
        ("`core/src/a.rs` (new)", "1 + 0", "is not new"),
        ("`core/bsdf/NAME.rs` (new)", "0 + 0", "no core/bsdf for"),
        ("`core/src/a.rs` (`models!`)", "2 + 0", "named are 1 + 0"),
        ("`core/src/a.rs` (`models!`); `core/src/a.rs` (`models!`)", "1 + 0", "a file twice"),
        ("`core/src/a.rs`", "1 + 0", "is not a path and"),
        ("core/src/a.rs (`models!`)", "1 + 0", "is not a path and"),
    ] {
        let found = of(core, "", count);
        assert!(found.contains(why), "{core}: {found:?} instead of {why}");
    }
}

/// A source without its unit tests and comments.
fn product(text: &str) -> String {
    let text = text.split("#[cfg(test)]").next().unwrap_or("");
    text.lines().filter(|l| !l.trim_start().starts_with("//")).map(|l| format!("{l}\n")).collect()
}

/// Sources of the core, without its test scene and stage tests.
fn core() -> Vec<(String, String)> {
    let mut files = sources("core/src");
    files.retain(|(path, _)| {
        !path.ends_with("/testing.rs") && !path.ends_with("_tests.rs") && !path.ends_with("/lib.rs")
    });
    files.into_iter().map(|(path, text)| (path, product(&text))).collect()
}

/// Core and host decide by no material kind but in the tables: what a BSDF costs to add is in its row. Killed by: a
/// `match` or a comparison with a kind anywhere else, such as the four that once failed silently.
#[test]
fn material_kinds_are_named_in_tables_only() {
    let host = sources("embed-example/host/src").into_iter().map(|(path, text)| (path, product(&text)));
    for (path, text) in core().into_iter().chain(host) {
        for rest in text.split("MaterialKind::").skip(1) {
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let is_kind = name.starts_with(char::is_uppercase) && name.contains(char::is_lowercase);
            assert!(!is_kind, "{path} names MaterialKind::{name}");
        }
    }
}

/// Killed by: a layer that only one of the two tables has, or describes as the other does not. `layers.rs` compares the
/// imports.
#[test]
fn layers_are_those_of_the_crate() {
    let of = |path: &str| tables(&document(path), "layer").concat();
    let layers = of(ARCHITECTURE);
    assert!(layers.len() > 20);
    assert_eq!(layers, of("core/src/lib.rs"), "{ARCHITECTURE} needs the table of layers in core/src/lib.rs");
}

/// Number of bytes that the table of memory states for a row.
fn bytes(what: &str) -> Vec<usize> {
    let rows = tables(&document(ARCHITECTURE), "block").concat();
    let row = rows.iter().find(|r| r[2].contains(what)).unwrap_or_else(|| panic!("no row of {what}"));
    let words = row[3].split(|c: char| !c.is_ascii_digit()).filter(|w| !w.is_empty());
    words.map(|w| w.parse().unwrap()).collect()
}

/// Sizes that the document states are those of the plan. Killed by: a record that grows, a slab that has another length.
#[test]
fn memory_is_as_stated() {
    let sums = |what: &str| bytes(what)[..2].iter().sum::<usize>();
    assert_eq!(sums("waiting vertices") + sums("camera samples"), BYTES_PER_PATH);
    assert!(document(ARCHITECTURE).contains(&format!("A path in flight takes {BYTES_PER_PATH} bytes")));

    let base = Settings {
        size: [64, 64],
        max_depth: 8,
        strategy: Strategy::parse("ears").unwrap(),
        ring: 1024,
        ..Settings::default()
    };
    let shard = |s: &Settings| Plan::new(s).unwrap().shard().size;
    assert_eq!(shard(&Settings { ring: 2048, ..base }) - shard(&base), 1024 * BYTES_PER_PATH);
    let mut larger = base;
    larger.learning.ledger += 1024;
    assert_eq!(shard(&larger) - shard(&base), 1024 * sums("ledger"));
    let wider = Settings { size: [128, 64], ..base };
    assert_eq!(shard(&wider) - shard(&base), 64 * 64 * bytes("`PixelSums`")[0]);
    let session = |s: &Settings| Plan::new(s).unwrap().session().size;
    let aovs = |s: &Settings| Settings { strategy: Strategy::default(), aovs: true.into(), ..*s };
    let none = |s: &Settings| Settings { strategy: Strategy::default(), ..*s };
    let planes: usize = Aov::ALL.iter().filter(|a| AovSet::STANDARD.has(**a)).map(|a| a.channels().len()).sum();
    let expected = planes * bytes("planes of AOVs")[0] + bytes("rays, with")[0];
    assert_eq!(session(&aovs(&base)) - session(&none(&base)), 64 * 64 * expected);
    assert_eq!(Plan::new(&none(&base)).unwrap().bytes_per_pixel()[0], bytes("sums of pixels")[0] as f64);
    let largest = bytes("pixels with most error");
    for (s, pixels) in [(base, largest[1]), (none(&base), largest[2])] {
        let [once, twice] = [1024, 2048].map(|rows| Settings { size: [1024, rows], ..s });
        let of_pixels = Plan::new(&once).unwrap().bytes_per_pixel()[0] as usize * (1 << 20);
        let (found, expected) = (session(&twice) - session(&once), of_pixels + largest[0] * (1 << 20) / pixels);
        // blocks are aligned
        assert!(found.abs_diff(expected) < 128, "{found} bytes, not {expected}");
    }
    let size = CacheSize::within(base.learning.cache_bytes, 1).unwrap();
    let bins = 16 * size.leaves() as usize;
    assert!(Training::layout(size).unwrap().size - bins * bytes("training")[0] < 128);
    let shared = size.bytes(0).unwrap() as f64 / bins as f64;
    assert!((0.0..6.0).contains(&(shared - bytes("cache: sums")[0] as f64)), "{shared} bytes a bin");
}

/// Paths in backquotes and in blocks of code that begin with a folder of the repository, and are not marked as new or as
/// patterns.
fn cited(text: &str) -> BTreeSet<String> {
    let is_path = |t: &str| FOLDERS.iter().any(|f| t.starts_with(f)) && !t.contains(char::is_whitespace);
    let plain = prose(text);
    let mut paths: BTreeSet<String> = quoted(&plain)
        .into_iter()
        .filter(|(t, after)| {
            is_path(t) && !after.starts_with(" (new)") && !t.contains(['*', '<']) && !t.contains("NAME")
        })
        .map(|(t, _)| t.to_string())
        .collect();
    let code = text.lines().scan(false, |inside, l| {
        *inside ^= l.starts_with("```");
        Some(if *inside { l } else { "" })
    });
    let words = code.flat_map(str::split_whitespace).map(|t| t.trim_end_matches(','));
    paths.extend(words.filter(|t| is_path(t)).map(String::from));
    // links
    paths.extend(
        plain.split("](").skip(1).filter_map(|t| t.split_once(')')).map(|(t, _)| t.to_string()).filter(|t| is_path(t)),
    );
    paths
}

/// Killed by: a file that moves while a document still names its old place.
#[test]
fn paths_in_documents_exist() {
    let mut count = 0;
    for name in documents().into_iter().chain(["README.md".into()]) {
        for path in cited(&document(&name)) {
            count += 1;
            assert!(root().join(&path).exists(), "{name}: no {path}");
        }
    }
    assert!(count > 100, "{count} paths");
    let found = cited("`core/a.rs` (new) `core/b.rs` and `core/NAME.rs` [x](docs/c.md)\n```\n  core/d.rs, core\n```\n");
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["core/b.rs", "core/d.rs", "docs/c.md"]);
}

/// Tests in a text that are cited as `` `file`: `test`, `test` ``, with their files.
fn cited_tests(text: &str) -> Vec<(String, String)> {
    let is_test_file = |t: &str| root().join(format!("tests/tests/{t}.rs")).is_file();
    let mut found = Vec::new();
    let mut file: Option<&str> = None;
    for (name, after) in quoted(text) {
        if after.starts_with(": ") && is_test_file(name) {
            file = Some(name);
            continue;
        }
        let Some(f) = file else { continue };
        if name.contains('_') && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            found.push((f.to_string(), name.to_string()));
        }
        if after.trim() != "," {
            file = None;
        }
    }
    found
}

/// Killed by: a test that is renamed or moved while a document still says that it shows something.
#[test]
fn tests_in_documents_exist() {
    let mut count = 0;
    for name in documents() {
        for (file, test) in cited_tests(&document(&name)) {
            count += 1;
            let text = document(&format!("tests/tests/{file}.rs"));
            assert!(text.contains(&format!("fn {test}(")), "{name}: no {test} in {file}");
        }
    }
    assert!(count > 60, "{count} tests");
    let found = cited_tests("`bsdf`: `a_b`, `c_d`; `core/x.rs`; `e_f`; `cache`: `g_h` (`i_j`)");
    let names: Vec<&str> = found.iter().map(|(_, test)| &**test).collect();
    assert_eq!(names, ["a_b", "c_d", "g_h"]);
}
