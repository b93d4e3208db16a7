//! Do documents cite what the results say? Figures carry invisible markers, comments of HTML, that say where they are
//! from; [`check`] compares them. How to write a marker is said in `benches/README.md`.

use crate::results::{Results, Table};
use std::collections::HashMap;
use std::error::Error;

/// The outcome for one document.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Figures that were compared.
    pub figures: usize,
    /// What is wrong, each with the number of its line.
    pub wrong: Vec<String>,
}

/// Compares every marked figure of a document with the results that `read` finds by their names. Blocks of code are
/// left out.
pub fn check(document: &str, read: impl Fn(&str) -> Result<Results, Box<dyn Error>>) -> Checked {
    let mut checked = Checked::default();
    let mut files = HashMap::new();
    let lines: Vec<&str> = document.lines().collect();
    let mut in_code = false;
    for (i, line) in lines.iter().enumerate() {
        in_code ^= line.starts_with("```");
        if in_code {
            continue;
        }
        let mut rest = *line;
        while let Some((before, marker)) = rest.split_once("<!--") {
            let marker = marker.trim_start();
            let Some((text, after)) = marker.split_once("-->") else {
                // not to be left unchecked when a paragraph is wrapped anew
                if ["", "=", "table"].iter().any(|s| marker.split(' ').next() == Some(*s)) {
                    checked.wrong.push(format!("line {}: a marker that does not end on its line", i + 1));
                }
                break;
            };
            rest = after;
            let text = text.trim();
            let table = text.strip_prefix("table = ");
            let Some(source) = table.or_else(|| text.strip_prefix("= ")) else { continue };
            let name = source.split([';', '/']).next().unwrap_or("").trim();
            let file = files.entry(name.to_string()).or_insert_with(|| read(name).map_err(|e| e.to_string()));
            let outcome = match file {
                Err(e) => Err(e.clone()),
                Ok(file) if table.is_some() => check_table(&lines[i + 1..], source, file),
                Ok(file) => check_figure(before, source, file),
            };
            match outcome {
                Ok(figures) => checked.figures += figures,
                Err(e) => checked.wrong.push(format!("line {}: {e}", i + 1)),
            }
        }
    }
    checked
}

/// `FILE / ROW / COLUMN`, or `FILE / TABLE / ROW / COLUMN`.
fn check_figure(before: &str, source: &str, file: &Results) -> Result<usize, String> {
    let parts: Vec<&str> = source.split(" / ").map(str::trim).collect();
    let (table, row, column) = match parts[..] {
        [_, row, column] => (file.tables.first(), row, column),
        [_, title, row, column] => (file.table(title), row, column),
        _ => return Err(format!("`{source}` is not FILE / TABLE / ROW / COLUMN")),
    };
    let table = table.ok_or_else(|| format!("`{source}`: no such table"))?;
    let keys: Vec<&str> = row.split(", ").collect();
    let cell = cell(table, &keys, column).ok_or_else(|| format!("`{source}`: no such row or column"))?;
    let figure = numbers(before).pop().ok_or_else(|| format!("no figure before the marker of `{source}`"))?;
    agrees(figure, cell).map(|()| 1).map_err(|e| format!("{e} (`{source}`)"))
}

/// A whole table: `FILE / TABLE; NAME = NAME, ...; keys = 2`.
fn check_table(lines: &[&str], source: &str, file: &Results) -> Result<usize, String> {
    let mut options = source.split(';').map(str::trim);
    let title = options.next().and_then(|s| s.split_once(" / ")).map_or("", |(_, title)| title.trim());
    let table = file.table(title).ok_or_else(|| format!("`{source}`: no table with this title"))?;
    let aliases = options.map(|o| o.split_once(" = ").ok_or_else(|| format!("`{o}` is not NAME = NAME")));
    let aliases = aliases.collect::<Result<HashMap<_, _>, _>>()?;
    let keys = aliases.get("keys").map_or(Ok(1), |n| n.parse::<usize>()).map_err(|e| format!("keys: {e}"))?;
    let known = |name: &str| aliases.get(name).copied().unwrap_or(name).to_string();

    let end = lines.iter().position(|l| !l.starts_with('|')).unwrap_or(lines.len());
    let cited = Results::parse(&lines[..end].join("\n")).tables.pop().ok_or("no table below the marker")?;
    let columns: Vec<String> = cited.columns.iter().map(|c| known(&plain(c))).collect();
    let mut figures = 0;
    for row in &cited.rows {
        let row: Vec<String> = row.iter().map(|c| plain(c)).collect();
        let names: Vec<String> = row.iter().take(keys).map(|c| known(c)).collect();
        let names: Vec<&str> = names.iter().map(|n| &**n).collect();
        for (text, columns) in row.iter().zip(&columns).skip(keys) {
            let wanted: Vec<&str> = columns.split(", ").collect();
            let given = if wanted.len() == 1 { vec![&**text] } else { numbers(text) };
            if given.len() != wanted.len() {
                return Err(format!("`{text}` has not one number for each of `{columns}`"));
            }
            for (given, column) in given.iter().zip(wanted) {
                // a table may also be cited with rows and columns exchanged
                let cell = cell(table, &names, column).or_else(|| cell(table, &[column], names.first()?));
                let cell = cell.ok_or_else(|| format!("`{source}`: nothing for {names:?} and `{column}`"))?;
                agrees(given, cell).map_err(|e| format!("{e} ({names:?}, `{column}`)"))?;
                figures += 1;
            }
        }
    }
    if figures == 0 { Err(format!("`{source}`: no figures below the marker")) } else { Ok(figures) }
}

fn cell<'a>(table: &'a Table, keys: &[&str], column: &str) -> Option<&'a str> {
    table.row(keys)?.get(table.column(column)?).map(|c| &**c)
}

/// Text without what Markdown makes bold or code.
fn plain(cell: &str) -> String {
    cell.replace(['`', '*'], "").trim().into()
}

/// Numbers in a text, in order: digits with points, commas between thousands, and a minus that follows no word.
fn numbers(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut start = 0;
    while let Some(first) = text[start..].find(|c: char| c.is_ascii_digit()).map(|i| start + i) {
        let end = text[first..].find(|c: char| !c.is_ascii_digit() && c != '.' && c != ',');
        let end = end.map_or(text.len(), |i| first + i);
        let minus = text[..first].strip_suffix('-').is_some_and(|t| t.is_empty() || t.ends_with([' ', '[', '(']));
        found.push(text[first - usize::from(minus)..end].trim_end_matches(['.', ',']));
        start = end;
    }
    found
}

/// Is the first number of a cell the given one, when it is rounded to as many decimals? Texts must be equal.
fn agrees(given: &str, cell: &str) -> Result<(), String> {
    let value = |text: &str| numbers(text).first().and_then(|n| n.replace(',', "").parse::<f64>().ok());
    let equal = match (value(given), value(cell)) {
        (Some(a), Some(b)) => {
            let decimals = numbers(given)[0].split_once('.').map_or(0, |(_, d)| d.len());
            (a - b).abs() <= 0.5 * 0.1f64.powi(decimals as i32) * (1.0 + 1e-9)
        }
        _ => given == cell,
    };
    if equal { Ok(()) } else { Err(format!("{given} should be {cell}")) }
}
