//! `docs/CLUSTER.md` has the figures that the code has.

use croupier_tests::documents::document;
use croupier_tests::exchange::{COLUMNS, measured, rows};

/// Killed by: a record or a header of a saved shard that grows, other defaults, a figure that is not updated.
#[test]
fn bytes_that_processes_exchange_are_as_stated() {
    let text = document("docs/CLUSTER.md");
    assert!(text.contains(&format!("| {COLUMNS} |")), "need | {COLUMNS} |");
    for row in rows() {
        assert!(text.contains(&row), "need {row}");
    }
    let sent = measured();
    let line = format!("{} bytes in each iteration", sent[0]);
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(sent.iter().all(|n| *n == sent[0]) && words.contains(&line), "need {line}, found {sent:?}");
}
