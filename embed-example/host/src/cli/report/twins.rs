//! What is not measured here, since the program has neither the tests' f64 twins nor callgrind: errors of components
//! and instructions of kernels, as `cargo run -p croupier-benches --bin twins -- --write` has put them into
//! `twins.json`.

use super::kernels::ARITHMETIC;
use super::ledger::Twin;
use croupier::INSTRUCTION_SET;
use serde::Deserialize;

/// A kernel of the microbenchmarks.
#[derive(Deserialize)]
struct Row {
    group: String,
    name: String,
    instructions: Option<f64>,
    max: Option<f64>,
    mean: Option<f64>,
    noise: Option<f64>,
    count: u64,
}

/// All rows of one arithmetic.
#[derive(Deserialize)]
struct Table {
    arithmetic: String,
    instruction_set: String,
    date: String,
    commit: String,
    counted: String,
    rows: Vec<Row>,
}

/// Rows that hold for this build.
pub(super) struct Twins(Option<Table>);

impl Twins {
    pub(super) fn of_this_build() -> Self {
        let tables: Vec<Table> = serde_json::from_str(include_str!("twins.json")).unwrap_or_default();
        Self(tables.into_iter().find(|t| t.arithmetic == ARITHMETIC))
    }

    /// Where they are from, as a sentence.
    pub(super) fn source(&self) -> String {
        let Some(t) = &self.0 else { return format!("There are none of {ARITHMETIC} arithmetic.") };
        format!(
            "Errors against f64: commit {}, {}. Instructions: commit {}, {}.",
            t.commit, t.date, t.counted, t.instruction_set
        )
    }

    fn row(&self, group: &str, name: &str) -> Option<&Row> {
        self.0.as_ref()?.rows.iter().find(|r| r.group == group && r.name == name)
    }

    /// Instructions of eight lanes, for the instruction set that they were counted of.
    pub(super) fn instructions(&self, group: &str, name: &str) -> Option<f64> {
        let counted = self.0.as_ref().is_some_and(|t| t.instruction_set == INSTRUCTION_SET);
        self.row(group, name).filter(|_| counted)?.instructions
    }

    /// Errors against f64: in `reproducible` arithmetic the same with every instruction set.
    pub(super) fn errors(&self, group: &str, name: &str) -> Option<Twin> {
        let row = self.row(group, name)?;
        Some(Twin { max: row.max?, mean: row.mean?, noise: row.noise, count: row.count })
    }
}
