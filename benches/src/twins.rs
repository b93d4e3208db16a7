//! Errors of components against their f64 twins and instructions of kernels, as `croupier report` shows them: a file of
//! the program, since the twins belong to the tests and callgrind to the machine of a developer.

use crate::micro::deviations;
use crate::provenance::{ARITHMETIC, instruction_set};
use crate::results::Results;
use serde::{Deserialize, Serialize};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Packets of eight that each kernel is compared for, where the file is made.
pub const PACKETS: usize = 1024;

/// A kernel of `micro`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Row {
    /// Its group.
    pub group: String,
    /// Its name.
    pub name: String,
    /// Instructions of eight lanes, counted by callgrind.
    pub instructions: Option<f64>,
    /// Largest relative error against the f64 twin.
    pub max: Option<f64>,
    /// Mean of the errors.
    pub mean: Option<f64>,
    /// Relative standard error, if means of random results were compared.
    pub noise: Option<f64>,
    /// Results that were compared.
    pub count: u64,
}

/// All rows of one arithmetic.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Twins {
    /// `reproducible` or `fast`.
    pub arithmetic: String,
    /// Instruction set of the build that instructions are counted of.
    pub instruction_set: String,
    /// Day and commit of the errors, and commit of the instructions.
    pub date: String,
    /// Commit of the errors.
    pub commit: String,
    /// Commit of the instructions.
    pub counted: String,
    /// Kernels.
    pub rows: Vec<Row>,
}

/// Name of the counts of instructions of this arithmetic.
pub fn counts() -> &'static str {
    if ARITHMETIC == "fast" { "micro-fast" } else { "micro" }
}

/// Errors of all kernels that have a twin, and the committed instructions of all that have a count.
pub fn rows(packets: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let found = deviations(packets)?;
    let counts = Results::read(counts())?;
    let table = counts.tables.first().ok_or("no table of instructions")?;
    let column = table.column("instructions").ok_or("no column of instructions")?;
    let wanted = ["math", "bsdf", "light", "medium", "node", "triangle", "film"];
    let mut rows = Vec::new();
    for r in table.rows.iter().filter(|r| wanted.contains(&r[0].split(' ').next().unwrap_or(""))) {
        let d = found.iter().find(|((group, name), _)| *group == r[0] && *name == r[1]).map(|f| f.1);
        // three digits tell enough, and do not change with the last bits of a platform's functions
        let rounded = |x: f64| format!("{x:.2e}").parse().unwrap_or(x);
        rows.push(Row {
            group: r[0].clone(),
            name: r[1].clone(),
            instructions: r[column].parse().ok(),
            max: d.map(|d| rounded(d.max)),
            mean: d.map(|d| rounded(d.sum / d.count as f64)),
            noise: d.map(|d| rounded(d.noise)).filter(|x| *x > 0.0),
            count: d.map_or(0, |d| d.count),
        });
    }
    Ok(rows)
}

impl Twins {
    /// Rows with where they are from.
    pub fn of(run: &Results, arithmetic: &str, rows: Vec<Row>) -> Result<Self, Box<dyn Error>> {
        let header = |results: &Results, key: &str| results.header(key).unwrap_or("unknown").to_string();
        Ok(Self {
            arithmetic: arithmetic.into(),
            instruction_set: instruction_set(),
            date: header(run, "date"),
            commit: header(run, "commit"),
            counted: header(&Results::read(counts())?, "commit"),
            rows,
        })
    }

    /// The file.
    pub fn path() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../embed-example/host/src/cli/report/twins.json")
    }

    /// What the file holds.
    pub fn read() -> Result<Vec<Self>, Box<dyn Error>> {
        let path = Self::path();
        let text = std::fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(serde_json::from_slice(&text)?)
    }

    /// Puts these rows in the place of those of the same arithmetic.
    pub fn write(self) -> Result<PathBuf, Box<dyn Error>> {
        let mut all = if Self::path().exists() { Self::read()? } else { vec![] };
        all.retain(|t| t.arithmetic != self.arithmetic);
        all.push(self);
        all.sort_by(|a, b| b.arithmetic.cmp(&a.arithmetic));
        std::fs::write(Self::path(), serde_json::to_string_pretty(&all)? + "\n")?;
        Ok(Self::path())
    }
}
