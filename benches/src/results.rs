//! Generated results, `benches/results/NAME.md`: one file per benchmark, written whole by one run, so that no table
//! mixes versions. A file states its provenance, then holds tables; prose about them is in `benches/README.md`.
//!
//! The format is Markdown with one row per line, which reads well on a web page and in a diff; [`Results::read`] reads
//! it back for checks.

use crate::provenance;
use std::error::Error;
use std::fmt::{self, Write};
use std::path::{Path, PathBuf};

/// A table with a title; all rows have as many cells as there are columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Heading; the first table of a file may have none.
    pub title: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Cells, row by row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows; `columns` are separated by commas.
    pub fn new(title: &str, columns: &str) -> Self {
        let columns = columns.split(',').map(|c| c.trim().into()).collect();
        Self { title: title.into(), columns, rows: Vec::new() }
    }

    /// Adds a row; cells must not contain a bar.
    pub fn add(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The names of the columns as lines of Markdown.
    pub fn head(&self) -> String {
        format!("{}\n|{}\n", line(&self.columns), "---|".repeat(self.columns.len()))
    }

    /// The newest row as a line of Markdown: long runs print rows as they come.
    pub fn last(&self) -> String {
        self.rows.last().map_or(String::new(), |r| line(r))
    }

    /// Index of a column.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c == name)
    }

    /// The first row that begins with these cells.
    pub fn row(&self, key: &[&str]) -> Option<&[String]> {
        self.rows.iter().find(|r| key.iter().zip(*r).all(|(k, c)| k == c)).map(|r| &**r)
    }

    /// Compares each row with that of a committed table that begins with the same `keys` cells: figures of these columns
    /// that are more than `percent` above the committed ones, as text.
    ///
    /// # Errors
    /// A row or column that the committed table has not, or a cell that is no number.
    pub fn risen(&self, old: &Self, keys: usize, columns: &[&str], percent: f64) -> Result<Vec<String>, String> {
        let mut risen = Vec::new();
        for row in &self.rows {
            let key: Vec<&str> = row.iter().take(keys).map(|c| &**c).collect();
            let old_row = old.row(&key).ok_or_else(|| format!("{key:?}: not in the committed results"))?;
            for column in columns {
                let figure = |table: &Self, cells: &[String]| {
                    let cell = table.column(column).and_then(|k| cells.get(k)).ok_or("there is no such column")?;
                    cell.parse::<f64>().map_err(|_| format!("'{cell}' is no number"))
                };
                let of = |table, cells| figure(table, cells).map_err(|e| format!("{key:?}, '{column}': {e}"));
                let (new, old) = (of(self, row)?, of(old, old_row)?);
                if new > old * (1.0 + percent / 100.0) {
                    let change = 100.0 * (new / old - 1.0);
                    risen.push(format!("{}, {column}: {old} -> {new} ({change:+.2} %)", key.join(", ")));
                }
            }
        }
        Ok(risen)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.title.is_empty() {
            writeln!(f, "## {}\n", self.title)?;
        }
        f.write_str(&self.head())?;
        self.rows.iter().try_for_each(|r| writeln!(f, "{}", line(r)))
    }
}

fn line(cells: &[String]) -> String {
    format!("| {} |", cells.join(" | "))
}

/// A file of results.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Results {
    /// Provenance and other facts that hold for all tables: (key, value).
    pub header: Vec<(String, String)>,
    /// The tables.
    pub tables: Vec<Table>,
}

impl Results {
    /// Without tables yet, with the provenance of this run of a benchmark. To be made when the run starts: while it
    /// lasts, others may commit.
    pub fn of_this_run(name: &str) -> Self {
        Self { header: provenance::of_this_run(name), tables: Vec::new() }
    }

    /// Reads a file of results, by the name of its benchmark.
    pub fn read(name: &str) -> Result<Self, Box<dyn Error>> {
        let path = path(name);
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self::parse(&text))
    }

    /// Reads the text of a file; lines that are neither header nor table are left out.
    pub fn parse(text: &str) -> Self {
        let mut results = Self::default();
        let mut title = String::new();
        // a table ends at the first line that is no row
        let mut open = false;
        for line in text.lines() {
            if let Some(cells) = line.strip_prefix('|').and_then(|l| l.strip_suffix('|')) {
                let cells: Vec<String> = cells.split('|').map(|c| c.trim().into()).collect();
                match results.tables.last_mut() {
                    Some(_) if cells.iter().all(|c| c == "---") => (),
                    Some(table) if open => table.rows.push(cells),
                    _ => {
                        let title = std::mem::take(&mut title);
                        results.tables.push(Table { title, columns: cells, rows: Vec::new() });
                    }
                }
                open = true;
                continue;
            }
            open = false;
            if let Some(heading) = line.strip_prefix("## ") {
                title = heading.into();
            } else if let Some((key, value)) = line.strip_prefix("- ").and_then(|l| l.split_once(": "))
                && results.tables.is_empty()
            {
                results.header.push((key.into(), value.into()));
            }
        }
        results
    }

    /// Value of a line of the header.
    pub fn header(&self, key: &str) -> Option<&str> {
        self.header.iter().find(|(k, _)| k == key).map(|(_, v)| &**v)
    }

    /// The table with this title.
    pub fn table(&self, title: &str) -> Option<&Table> {
        self.tables.iter().find(|t| t.title == title)
    }

    /// Reports where this differs from the committed results in what `keys` of the header say; figures of another
    /// instruction set are no measure.
    pub fn differs_in(&self, other: &Self, keys: &[&str]) -> Option<String> {
        let key = keys.iter().find(|k| self.header(k) != other.header(k))?;
        let value = |r: &Self| r.header(key).unwrap_or("unknown").to_string();
        Some(format!("{key} is {}, in the committed results {}", value(self), value(other)))
    }

    /// The whole text of the file.
    pub fn text(&self, name: &str) -> Result<String, fmt::Error> {
        let mut text =
            format!("# Results of `{name}`\n\nGenerated, do not edit; explained in [README.md](../README.md).\n\n");
        for (key, value) in &self.header {
            writeln!(text, "- {key}: {value}")?;
        }
        self.tables.iter().try_for_each(|t| write!(text, "\n{t}"))?;
        Ok(text)
    }

    /// Writes the file; where it is.
    pub fn write(&self, name: &str) -> Result<PathBuf, Box<dyn Error>> {
        let path = path(name);
        std::fs::write(&path, self.text(name)?).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(path)
    }
}

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results").join(name).with_extension("md")
}
