//! The repository's documents, read as tests need them: tables, names in backquotes, files and what is in them.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders whose files documents cite, at the top of the repository.
pub const FOLDERS: [&str; 6] = ["core/", "simd/", "embed-example/", "tests/", "benches/", "docs/"];

/// Top of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Text of a file of the repository.
pub fn read(path: &str) -> Option<String> {
    fs::read_to_string(root().join(path)).ok()
}

/// Text of a document.
///
/// # Panics
/// Without such a file.
pub fn document(path: &str) -> String {
    read(path).unwrap_or_else(|| panic!("no {path}"))
}

/// Paths of all documents in `docs/`, from the top of the repository.
///
/// # Panics
/// Without such a folder.
pub fn documents() -> Vec<String> {
    let entries = fs::read_dir(root().join("docs")).expect("docs");
    let names = entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut paths: Vec<String> = names.filter(|n| n.ends_with(".md")).map(|n| format!("docs/{n}")).collect();
    paths.sort();
    paths
}

/// Paths of all Rust files below a folder, from the top of the repository, with their texts.
///
/// # Panics
/// Without such a folder.
pub fn sources(folder: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root().join(folder)).expect("a folder") {
        let entry = entry.expect("an entry");
        let path = format!("{folder}/{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            found.extend(sources(&path));
        } else if path.ends_with(".rs") {
            found.push((path.clone(), document(&path)));
        }
    }
    found.sort();
    found
}

/// Rows of a Markdown table, in cells.
pub type Rows = Vec<Vec<String>>;

/// Tables whose first column has the title `first`, without title and rule. A `|` within backquotes is written `\|`.
pub fn tables(text: &str, first: &str) -> Vec<Rows> {
    let cells = |line: &str| -> Vec<String> {
        let line = line.trim().trim_start_matches('|').trim_end_matches('|').replace("\\|", "\u{1}");
        line.split('|').map(|c| c.trim().replace('\u{1}', "|")).collect()
    };
    let mut all: Vec<Rows> = Vec::new();
    let mut inside = false;
    for line in text.lines().map(|l| l.strip_prefix("//! ").unwrap_or(l)) {
        if !line.starts_with('|') {
            inside = false;
        } else if inside {
            all.last_mut().expect("a table").push(cells(line));
        } else if cells(line)[0] == first {
            all.push(Vec::new());
            inside = true;
        }
    }
    for rows in &mut all {
        rows.retain(|r| !r.iter().all(|c| c.chars().all(|c| c == '-' || c == ':')));
    }
    all
}

/// Texts in backquotes, each with the text that follows it.
pub fn quoted(text: &str) -> Vec<(&str, &str)> {
    let parts: Vec<&str> = text.split('`').collect();
    (1..parts.len()).step_by(2).map(|i| (parts[i], parts.get(i + 1).copied().unwrap_or(""))).collect()
}

/// Text without blocks of code.
pub fn prose(text: &str) -> String {
    let mut in_code = false;
    let mut out = String::new();
    for line in text.lines() {
        if line.starts_with("```") {
            in_code = !in_code;
        } else if !in_code {
            out.push_str(line);
            out.push('\n');
        }
    }
    out
}
