//! `docs/GLOSSARY.md` says where terms are, `docs/PROGRAM.md` has every setting, and documents use the words of the field.

use croupier::Settings;
use croupier_tests::documents::{Rows, document, documents, prose, quoted, read, tables};
use std::collections::HashSet;

/// What is wrong with the rows of a glossary; `read` gives the text of a file.
fn faults(rows: &Rows, read: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut terms = HashSet::new();
    for row in rows {
        let [term, symbol, unit, meaning, place] = &row[..] else {
            wrong.push(format!("{row:?} has not five cells"));
            continue;
        };
        if !terms.insert(term) {
            wrong.push(format!("{term} twice"));
        }
        if [term, symbol, unit].iter().any(|c| c.is_empty()) || meaning.split(' ').count() < 2 {
            wrong.push(format!("{term} lacks a symbol, a unit or a meaning"));
        }
        match quoted(place)[..] {
            [(path, " ("), (identifier, ")")] => match read(path) {
                None => wrong.push(format!("{term}: no {path}")),
                Some(text) if !holds(&text, identifier) => wrong.push(format!("{term}: no {identifier} in {path}")),
                Some(_) => (),
            },
            _ => wrong.push(format!("{term}: `{place}` is not a file and an identifier")),
        }
    }
    wrong
}

/// Does a text hold a name as a whole word?
fn holds(text: &str, name: &str) -> bool {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    let borders =
        text.match_indices(name).map(|(i, _)| (text[..i].chars().next_back(), text[i + name.len()..].chars().next()));
    borders.into_iter().any(|(before, after)| !before.is_some_and(part) && !after.is_some_and(part))
}

/// Killed by: a type or field that is renamed, a file that moves, a term without a unit.
#[test]
fn terms_are_where_the_glossary_says() {
    let rows = tables(&document("docs/GLOSSARY.md"), "term").concat();
    assert!(rows.len() >= 30, "{} terms", rows.len());
    let wrong = faults(&rows, read);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The check above can fail.
#[test]
fn wrong_terms_are_found() {
    let of = |line: &str| {
        let text = format!("| term | symbol | unit | meaning | where |\n|---|---|---|---|---|\n{line}");
        faults(&tables(&text, "term").concat(), |path| (path == "a.rs").then(|| "struct Ring8;".into())).join(" and ")
    };
    assert_eq!(of("| ring | - | 1 | a ring | `a.rs` (`struct Ring8`) |"), "");
    for (line, why) in [
        ("| ring | - | 1 | a ring | `b.rs` (`Ring8`) |", "no b.rs"),
        ("| ring | - | 1 | a ring | `a.rs` (`Ring`) |", "no Ring in a.rs"),
        ("| ring | - | 1 | a ring | `a.rs` |", "is not a file and an identifier"),
        ("| ring | - | | a ring | `a.rs` (`Ring8`) |", "lacks"),
        ("| ring | - | 1 | ring | `a.rs` (`Ring8`) |", "lacks"),
        ("| ring | - | 1 | `a.rs` (`Ring8`) |", "not five cells"),
        ("| r | - | 1 | a ring | `a.rs` (`Ring8`) |\n| r | - | 1 | a ring | `a.rs` (`Ring8`) |", "r twice"),
    ] {
        assert!(of(line).contains(why), "{line}: {}", of(line));
    }
}

/// Killed by: a setting that only the help text knows.
#[test]
fn the_program_s_manual_has_every_setting() {
    let text = document("docs/PROGRAM.md");
    for row in Settings::TABLE {
        assert!(holds(&text, &format!("--{}", row.name)), "docs/PROGRAM.md has no --{}", row.name);
    }
}

/// Words of our own, for which the field has others. Names of tests and files are not looked at.
#[test]
fn documents_use_the_words_of_the_field() {
    let ours = [
        "hangs on",
        "hang on",
        "mended",
        "reckon",
        "reckoned",
        "in vain",
        "for ever",
        "spoil",
        "spoils",
        "spoiled",
        "matte",
        "shiny",
        "sky",
        "lamp",
        "lamps",
        "tamed",
        "wish",
        "wishes",
        "allotment",
        "knowledge",
        "deal",
        "deals",
        "dealt",
    ];
    for name in documents().into_iter().chain(["README.md".into()]) {
        let text = prose(&document(&name)).replace(['\n'], " ");
        let outside: String = text.split('`').step_by(2).collect::<Vec<_>>().join(" ").to_lowercase();
        for word in ours {
            assert!(!holds(&outside, word), "{name} says `{word}`");
        }
    }
}
