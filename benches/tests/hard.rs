//! The quick tier of `hard` passes, and what is committed of the others is whole and without a failure.

use croupier_benches::hard::{CHECKS, Row, Run, Tier, ledger};
use croupier_benches::results::Results;
use serde_json::Value;
use std::path::Path;

/// Killed by: any fault that the checks are there for, a check that tries nothing.
#[test]
fn the_quick_tier_passes() {
    let mut run = Run::new(Tier::Commit, 1);
    for check in &CHECKS {
        run.check(check).iter().for_each(|line| println!("{line}"));
    }
    assert_eq!(run.failures, 0, "{}", run.table());
    assert!(run.table().rows.iter().all(|r| r[2] != "0"), "a check without cases: {}", run.table());
}

/// Killed by: a row that failed, cases that the catalogue does not have, tables of which none is whole.
#[test]
fn committed_runs_have_no_failures() {
    let catalogue = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/NUMERICS.md");
    let catalogue = std::fs::read_to_string(catalogue).unwrap();
    let rows: Vec<&Row> = CHECKS.iter().flat_map(|c| c.rows).collect();
    let mut whole = 0;
    for tier in [Tier::Nightly, Tier::Weekly] {
        // a tier that nobody had time for has no file yet
        let Ok(mut results) = Results::read(&tier.results()) else { continue };
        let table = results.tables.remove(0);
        let column = |name: &str| table.column(name).unwrap();
        let mut run = 0;
        for row in &rows {
            assert!(catalogue.contains(&format!("| {} |", row.id)), "{} is not in docs/NUMERICS.md", row.id);
            let Some(cells) = table.row(&[row.id, row.what]) else { continue };
            run += 1;
            assert_eq!(cells[column("failures")], "0", "{}, {}: {}", tier.name(), row.id, row.what);
            assert_ne!(cells[column("cases")], "0", "{}, {}: {}", tier.name(), row.id, row.what);
        }
        assert_eq!(table.rows.len(), run, "{}: rows that no check has", tier.name());
        whole += usize::from(run == rows.len());
    }
    assert!(whole > 0);
}

/// Each line says where it is from, and what it found. Killed by: a line that is cut off, a field that is lost.
#[test]
fn the_ledger_is_read_as_it_was_written() {
    let text = std::fs::read_to_string(ledger()).unwrap();
    assert!(text.lines().count() > 0);
    for (number, line) in text.lines().enumerate() {
        let line: Value = serde_json::from_str(line).unwrap_or_else(|e| panic!("line {}: {e}", number + 1));
        for key in ["date", "commit", "machine", "compiler", "tier"] {
            assert!(line[key].as_str().is_some_and(|v| !v.is_empty()), "line {}: no {key}", number + 1);
        }
        let rows = line["rows"].as_array().unwrap();
        assert!(!rows.is_empty() && rows.iter().all(|r| r["cases"].is_u64() && r["failures"].is_u64()));
    }
}
