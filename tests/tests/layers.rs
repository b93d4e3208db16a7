//! Data flows one way: no file imports in a circle, and the layers of `core` keep to the table in its `lib.rs`. The
//! sources are read, see [`croupier_tests::imports`].

use croupier_tests::imports::{Crate, Import};
use std::collections::BTreeMap;
use std::path::Path;

fn sources(folder: &str) -> Crate {
    Crate::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder))
}

fn assert_no_circles(folder: &str) {
    let circles = sources(folder).circles();
    let list = |c: &Vec<Import>| c.iter().map(|i| format!("    {i}")).collect::<Vec<_>>().join("\n");
    let text: Vec<_> = circles.iter().map(list).collect();
    assert!(circles.is_empty(), "{} circles in {folder}:\n{}", circles.len(), text.join("\n\n"));
}

/// Killed by: any file of `core` that imports from one which imports from it, straight or through others.
#[test]
fn files_of_core_import_in_no_circle() {
    assert_no_circles("core/src");
}

/// Killed by: the same in the host program.
#[test]
fn files_of_the_host_import_in_no_circle() {
    assert_no_circles("embed-example/host/src");
}

/// Killed by: an import from a layer that the table does not list, a module without a row, a row below one that uses
/// it.
#[test]
fn layers_of_core_keep_to_their_table() {
    let core = sources("core/src");
    assert!(core.layers().len() > 15, "the modules of lib.rs were not read");
    let faults = core.layer_faults();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

/// The reader of imports sees what it must: else the tests above could pass without looking. Killed by: paths of
/// re-exports that are not followed, a file that is not read.
#[test]
fn known_imports_of_core_are_seen() {
    let found = sources("core/src").imports();
    for (from, to, name) in [
        ("rrs/ears.rs", "rrs/learned.rs", "Learned8"),
        ("rrs/ears.rs", "rrs/adrrs.rs", "adrrs::window"),
        ("denoise/planes.rs", "film/pixel.rs", "PixelStats"),
        ("learn/cache/shared.rs", "learn/cache/tree.rs", "Tree"),
        ("learn/cache/save.rs", "learn/settings.rs", "Objective"),
        ("learn/estimate.rs", "denoise/work.rs", "window_len"),
    ] {
        let seen = found.iter().any(|i| i.from == from && i.to == to && i.names.contains(name));
        let others: Vec<_> = found.iter().filter(|i| i.from == from).map(|i| format!("{i}")).collect();
        assert!(seen, "{from} -> {to}: {name} is not among\n{}", others.join("\n"));
    }
}

/// A crate of made-up files.
fn made_up(files: &[(&str, &str)]) -> Crate {
    let files: BTreeMap<_, _> = files.iter().map(|(f, t)| ((*f).to_owned(), (*t).to_owned())).collect();
    Crate::new(&files)
}

/// Files of each circle.
fn circles(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    let of = |c: Vec<Import>| {
        let mut files: Vec<_> = c.into_iter().map(|i| i.from).collect();
        files.dedup();
        files
    };
    made_up(files).circles().into_iter().map(of).collect()
}

const LIB: (&str, &str) = ("lib.rs", "mod a; mod b; mod c; pub use a::A;");

/// Killed by: `use` trees, inline paths, `super`, re-exports or parents that are not followed, circles of two files
/// only.
#[test]
fn circles_are_found() {
    let (a, b, c) = (("a.rs", "use crate::b::B; pub struct A;"), ("b.rs", "pub struct B;"), ("c.rs", "pub struct C;"));
    assert!(circles(&[LIB, a, b, c]).is_empty());
    for back in [
        "pub struct B; use crate::a::A;",
        "pub struct B; use super::a::{self, A};",
        "pub struct B; use crate::{a::{A as X}, c::C};",
        "pub struct B; use crate::A;",
        "pub struct B(crate::a::A);",
        "use crate::a; pub struct B(a::A);",
        "pub struct B; fn f() { let x = super::a::A; }",
        "pub struct B; pub(crate) use crate::a::A;",
        "pub struct B; mod below; use crate::a::*;",
    ] {
        assert_eq!(circles(&[LIB, a, ("b.rs", back), c]), [["a.rs", "b.rs"]], "{back}");
    }
    let round = [LIB, a, ("b.rs", "use crate::c::C; pub struct B;"), ("c.rs", "pub struct C(crate::A);")];
    assert_eq!(circles(&round), [["a.rs", "b.rs", "c.rs"]]);
    // a child that imports from its parent, which imports more than names to hand on
    let parent = "mod x; pub use x::X; pub struct C; fn f(x: X) {}";
    assert_eq!(
        circles(&[LIB, a, b, ("c.rs", parent), ("c/x.rs", "use super::C; pub struct X;")]),
        [["c.rs", "c/x.rs"]]
    );
}

/// Killed by: comments, text, tests, methods or the children's table counted as imports.
#[test]
fn what_is_no_import_makes_no_circle() {
    let a = ("a.rs", "use crate::b::B; pub struct A;");
    for b in [
        "pub struct B; // use crate::a::A;\n",
        "/// [`crate::a::A`]\n/* use /* */ crate::a::A; */ pub struct B;",
        "pub struct B; const T: &str = \"use crate::a::A;\"; const R: &str = r#\"\"use crate::a::A;\"#;",
        "pub struct B; const Q: char = '\"'; const S: char = '\\''; fn f<'a>(a: &'a B) -> impl Copy + use<'a> { 1 }",
        "pub struct B; #[cfg(test)] mod tests { use crate::a::A; fn f() { A::new() } }",
        "pub struct B; #[cfg(test)] mod only_tests; #[cfg(test)] use crate::a::{A, C};",
        "pub struct B; fn f(b: &B) { b.a() }",
        "use other::a::A; pub struct B;",
    ] {
        assert!(
            circles(&[LIB, a, ("b.rs", b), ("b/only_tests.rs", "use crate::a::A;"), ("c.rs", "")]).is_empty(),
            "{b}"
        );
    }
    let hands_on = [LIB, ("a.rs", "mod x; pub use x::X; pub struct A;"), ("a/x.rs", "use super::A; pub struct X;")];
    assert!(circles(&hands_on).is_empty());
    // contract, table and dispatch in the parent, an implementation in the child
    let contract = "mod x; use x::X; pub trait T<'s> {} pub enum A { X(X) }";
    let x = "use super::{A, T}; pub struct X; impl<'s> T<'s> for X {}";
    assert!(circles(&[LIB, ("a.rs", contract), ("a/x.rs", x)]).is_empty());
    let no_implementation = "use super::{A, T}; pub struct X; impl<'s> Copy for X {}";
    assert_eq!(circles(&[LIB, ("a.rs", contract), ("a/x.rs", no_implementation)]).len(), 1);
}

/// A crate of two layers with this table, where a file of `b` has the text `b`.
fn two_layers(table: &[&str], b: &str) -> Vec<String> {
    let rows: String = table.iter().map(|row| format!("//! {row}\n")).collect();
    let lib = format!("//! text\n//!\n{rows}//!\n//! text\nmod a; mod b; pub mod shown {{ pub use crate::a::A; }}");
    made_up(&[("lib.rs", &lib), ("a.rs", "pub struct A;"), ("b/mod.rs", "mod x;"), ("b/x.rs", b)]).layer_faults()
}

/// Killed by: rows without a module or modules without a row, two rows for one module, uses of a layer below, paths
/// that go round by the crate's root, a table that is not found.
#[test]
fn uses_of_layers_below_are_found() {
    let [head, line] = ["| layer | knows |", "|---|---|"];
    let table = [head, line, "| [`a`] | numbers |", "| `b` | `a` and letters |"];
    let upside_down = [head, line, table[3], table[2]];
    assert_eq!(two_layers(&table, "use crate::a::A;"), [""; 0]);
    assert_eq!(two_layers(&upside_down, ""), [""; 0]);
    for (text, name) in [
        ("use crate::a::A;", "A"),
        ("use super::super::a::A;", "A"),
        ("pub use crate::a::A;", "A"),
        ("fn f(a: crate::a::A) {}", "crate::a::A"),
    ] {
        let fault = format!("`b` may not use `a`: b/x.rs -> a.rs: {name}");
        assert_eq!(two_layers(&upside_down, text), [fault], "{text}");
    }
    // what lib.rs shows to others is not for its own files
    let by_the_root = two_layers(&table, "use crate::shown::A;");
    assert_eq!(by_the_root, ["`b` may not use `lib`: b/x.rs -> lib.rs: A"]);
    assert_eq!(two_layers(&table[..3], ""), ["the table has no row for `b`"]);
    let extra = [&table[..], &["| `c` | |"]].concat();
    assert_eq!(two_layers(&extra, ""), ["the table has a row for `c`, which is no module of lib.rs"]);
    let twice = [&table[..], &table[3..]].concat();
    assert_eq!(two_layers(&twice, ""), ["the table has two rows for `b`"]);
    assert_eq!(two_layers(&[], ""), ["lib.rs has no table with a column `layer`"]);
    assert_eq!(two_layers(&[head, line, "| a | |"], ""), ["a row of the table names no layer: |a||"]);
}

/// Killed by: a column that is not read, names of other columns taken for it, a row that lists one below.
#[test]
fn a_column_of_the_table_narrows_the_uses() {
    let [head, line, a] = ["| layer | may use | knows |", "|---|---|---|", "| `a` | | numbers |"];
    assert_eq!(two_layers(&[head, line, a, "| `b` | `a` | letters |"], "use crate::a::A;"), [""; 0]);
    let unlisted = [head, line, a, "| `b` | nothing | `a` of letters |"];
    assert_eq!(two_layers(&unlisted, ""), [""; 0]);
    assert_eq!(two_layers(&unlisted, "use crate::a::A;"), ["`b` may not use `a`: b/x.rs -> a.rs: A"]);
    let below = [head, line, "| `b` | `a` | letters |", a];
    assert_eq!(two_layers(&below, ""), ["the row of `b` lists `a`, which has no row above it"]);
}
