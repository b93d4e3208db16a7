//! The manual and the header know the same functions.

use std::collections::BTreeSet;

/// Names of functions in a text: `croupier_...(`.
fn functions(text: &str) -> BTreeSet<&str> {
    let mut found = BTreeSet::new();
    for (at, _) in text.match_indices("croupier_") {
        let before = text[..at].chars().next_back();
        let rest = &text[at..];
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
        if rest[end..].starts_with('(') && before.is_none_or(|c| !c.is_ascii_alphanumeric() && c != '_') {
            found.insert(&rest[..end]);
        }
    }
    found
}

/// Killed by: a function without an entry, an entry of one that is gone, a struct or a status that nothing explains.
#[test]
fn the_manual_has_every_function() {
    let header = include_str!("../include/croupier.h");
    let manual = include_str!("../../../docs/C.md");
    let declared: BTreeSet<&str> = functions(header);
    assert!(declared.len() > 75, "{} functions", declared.len());
    let entries: BTreeSet<&str> = functions(manual);
    let missing: Vec<_> = declared.difference(&entries).collect();
    assert!(missing.is_empty(), "docs/C.md has no {missing:?}");
    let gone: Vec<_> = entries.difference(&declared).collect();
    assert!(gone.is_empty(), "docs/C.md has {gone:?}");
}

/// The example of the README is that of the manual. Killed by: a change of one of them.
#[test]
fn the_readme_has_the_example_of_the_manual() {
    let example = |text: &'static str| text.split("```c\n").nth(1).and_then(|rest| rest.split("```").next());
    let manual = example(include_str!("../../../docs/C.md"));
    assert!(manual.is_some_and(|e| e.contains("croupier_shard_step")));
    assert_eq!(example(include_str!("../../../README.md")), manual);
}

/// The examples in the manual are those that compile elsewhere, or parts of them: they call what there is. Killed by:
/// a reader of names that sees none.
#[test]
fn names_are_found() {
    let found = functions("x croupier_a(1) croupier_b; my_croupier_c( `croupier_d()`");
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["croupier_a", "croupier_d"]);
}
