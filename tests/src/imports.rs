//! Imports between the files of a crate, read from its sources: which file uses names of which, whether they go round
//! in circles, and whether they keep to the table of layers in `lib.rs`.
//!
//! Tokens are read, not types: a path counts as an import of the file that defines the name, through however many
//! re-exports. Calls of methods are not seen; their type's name is. Not counted are
//!
//! 1. tests (`#[cfg(test)]`), comments and doc links;
//! 2. a parent that only hands on names of its children (`pub use`), or declares them;
//! 3. a parent that uses a child which implements a trait of that parent: contract and table of implementations in
//!    `x.rs`, one implementation each in `x/name.rs`.

use crate::source::Module;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;
use std::path::Path;

/// Use of another file's names.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Import {
    /// File that uses the names.
    pub from: String,
    /// File that defines them.
    pub to: String,
    /// Names.
    pub names: BTreeSet<String>,
}

impl fmt::Display for Import {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.names.iter().map(String::as_str).collect();
        write!(f, "{} -> {}: {}", self.from, self.to, names.join(", "))
    }
}

/// Sources of a crate.
pub struct Crate {
    modules: Vec<Module>,
    by_path: HashMap<Vec<String>, usize>,
    /// Text of `lib.rs`.
    root: String,
}

impl Crate {
    /// All files below a folder `src`.
    pub fn read(src: &Path) -> Self {
        fn collect(folder: &Path, src: &Path, out: &mut BTreeMap<String, String>) {
            for entry in std::fs::read_dir(folder).expect("a folder of sources") {
                let path = entry.expect("an entry of the folder").path();
                if path.is_dir() {
                    collect(&path, src, out);
                } else if path.extension().is_some_and(|e| e == "rs") {
                    let name = path.strip_prefix(src).expect("below the folder").to_string_lossy().replace('\\', "/");
                    out.insert(name, std::fs::read_to_string(&path).expect("a source file"));
                }
            }
        }
        let mut files = BTreeMap::new();
        collect(src, src, &mut files);
        Self::new(&files)
    }

    /// Files by their path below `src`.
    pub fn new(files: &BTreeMap<String, String>) -> Self {
        let all: Vec<_> = files.iter().map(|(file, text)| Module::new(file, text)).collect();
        // files that only tests declare are tests
        let mut declared: BTreeSet<Vec<String>> = [vec![], vec!["main".to_owned()]].into();
        let mut left: Vec<Vec<String>> = declared.iter().cloned().collect();
        while let Some(path) = left.pop() {
            for m in all.iter().filter(|m| m.path == path) {
                let below = m.children.iter().map(|c| path.iter().chain([c]).cloned().collect::<Vec<_>>());
                left.extend(below.filter(|c| declared.insert(c.clone())));
            }
        }
        let modules: Vec<_> = all.into_iter().filter(|m| declared.contains(&m.path)).collect();
        let by_path = modules.iter().enumerate().map(|(i, m)| (m.path.clone(), i)).collect();
        Self { modules, by_path, root: files.get("lib.rs").cloned().unwrap_or_default() }
    }

    /// Top-level modules, as `lib.rs` declares them.
    pub fn layers(&self) -> &[String] {
        self.by_path.get(&vec![]).map_or(&[], |root| &self.modules[*root].children)
    }

    /// Imports between different files.
    pub fn imports(&self) -> Vec<Import> {
        let mut found: BTreeMap<(usize, usize), BTreeSet<String>> = BTreeMap::new();
        for (from, m) in self.modules.iter().enumerate() {
            let used: BTreeSet<&String> = m.paths.iter().filter_map(|p| p.first()).collect();
            let mut counted = BTreeSet::new();
            for u in &m.uses {
                let Some((to, whole)) = self.resolve(from, &u.path, 0) else { continue };
                let handed_on = u.public && !used.contains(&u.alias) && self.below(from, to);
                // of a module alone, the paths below say what is used
                if !handed_on && (!whole || u.alias == "*") {
                    found.entry((from, to)).or_default().insert(u.alias.clone());
                    counted.insert(&u.alias);
                }
            }
            for path in m.paths.iter().filter(|p| p.len() > 1 && !counted.contains(&p[0])) {
                if let Some((to, false)) = self.resolve(from, path, 0) {
                    found.entry((from, to)).or_default().insert(path.join("::"));
                }
            }
        }
        let implemented = |from: usize, to: usize| {
            self.below(from, to) && !self.modules[from].traits.is_disjoint(&self.modules[to].implements)
        };
        found.retain(|(from, to), _| from != to && !implemented(*from, *to));
        let file = |i: usize| self.modules[i].file.clone();
        found.into_iter().map(|((from, to), names)| Import { from: file(from), to: file(to), names }).collect()
    }

    /// Is a file in the folder of another?
    fn below(&self, parent: usize, child: usize) -> bool {
        self.modules[child].path.starts_with(&self.modules[parent].path) && parent != child
    }

    /// File that a path in the file `from` leads to, and whether it names the whole file.
    fn resolve(&self, from: usize, path: &[String], depth: usize) -> Option<(usize, bool)> {
        let (first, rest) = path.split_first()?;
        let parent = |m: usize| {
            let (_, above) = self.modules[m].path.split_last()?;
            self.by_path.get(above).copied()
        };
        let at = match first.as_str() {
            "crate" => *self.by_path.get(&vec![])?,
            "self" => from,
            "super" => parent(from)?,
            _ => return self.lookup(from, path, depth, false),
        };
        match rest.first().map(String::as_str) {
            None => Some((at, true)),
            Some("super") => self.resolve(at, rest, depth),
            Some(_) => self.lookup(at, rest, depth, true),
        }
    }

    /// What a path means within a file; `inside` the crate a name that is not found is the file's own (a macro makes
    /// it).
    fn lookup(&self, at: usize, path: &[String], depth: usize, inside: bool) -> Option<(usize, bool)> {
        let (name, rest) = path.split_first()?;
        let m = &self.modules[at];
        let child = || {
            let path: Vec<_> = m.path.iter().chain([name]).cloned().collect();
            self.by_path.get(&path).copied().filter(|_| m.children.contains(name))
        };
        if let Some(c) = child().filter(|_| !rest.is_empty()) {
            return self.lookup(c, rest, depth, true);
        }
        if m.items[0].contains(name) {
            return Some((at, false));
        }
        // the bound is never met: a chain of names that hand each other on does not compile
        let handed_on = || m.uses.iter().find(|u| u.alias == *name && u.path != [name.clone()]);
        if depth < 16
            && let Some(u) = handed_on()
        {
            let path: Vec<_> = u.path.iter().chain(rest).cloned().collect();
            return self.resolve(at, &path, depth + 1);
        }
        if let Some(c) = child() {
            return Some((c, true));
        }
        if m.items[1].contains(name) {
            return Some((at, false));
        }
        if depth < 16 {
            for u in m.uses.iter().filter(|u| u.alias == "*" && u.public) {
                let (to, _) = self.resolve(at, &u.path, depth + 1)?;
                if self.modules[to].items.iter().any(|i| i.contains(name)) {
                    return Some((to, false));
                }
            }
        }
        inside.then_some((at, false))
    }

    /// Groups of files that import each other in circles, each with the imports that tie it.
    pub fn circles(&self) -> Vec<Vec<Import>> {
        let imports = self.imports();
        let mut reach: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for start in imports.iter().map(|i| i.from.as_str()) {
            let (mut seen, mut left) = (BTreeSet::new(), vec![start]);
            while let Some(file) = left.pop() {
                let next = imports.iter().filter(|i| i.from == file).map(|i| i.to.as_str());
                left.extend(next.filter(|to| seen.insert(*to)));
            }
            reach.insert(start, seen);
        }
        let tied = |a: &str, b: &str| reach.get(a).is_some_and(|r| r.contains(b));
        let mut out = Vec::new();
        let mut done = BTreeSet::new();
        for file in reach.keys().copied() {
            if tied(file, file) && done.insert(file) {
                let group: BTreeSet<_> = reach.keys().copied().filter(|o| tied(file, o) && tied(o, file)).collect();
                done.extend(&group);
                let within = |i: &&Import| group.contains(i.from.as_str()) && group.contains(i.to.as_str());
                out.push(imports.iter().filter(within).cloned().collect());
            }
        }
        out
    }

    /// Faults of the table of layers in the documentation of `lib.rs`, and imports that do not keep to it. A layer may
    /// use those in rows above its own; where the table has a column `may use`, only the ones listed there.
    pub fn layer_faults(&self) -> Vec<String> {
        let rows = match table(&self.root) {
            Ok(rows) => rows,
            Err(fault) => return vec![fault],
        };
        let mut faults = Vec::new();
        let mut above: Vec<&str> = Vec::new();
        let mut may_use: HashMap<&str, Vec<&str>> = HashMap::new();
        for (layer, listed) in &rows {
            if !self.layers().contains(layer) {
                faults.push(format!("the table has a row for `{layer}`, which is no module of lib.rs"));
            }
            let listed = listed.as_ref().map(|l| l.iter().map(String::as_str).collect());
            let uses: Vec<&str> = listed.unwrap_or_else(|| above.clone());
            for u in uses.iter().filter(|u| !above.contains(u)) {
                faults.push(format!("the row of `{layer}` lists `{u}`, which has no row above it"));
            }
            if may_use.insert(layer, uses).is_some() {
                faults.push(format!("the table has two rows for `{layer}`"));
            }
            above.push(layer);
        }
        for layer in self.layers().iter().filter(|l| !above.contains(&l.as_str())) {
            faults.push(format!("the table has no row for `{layer}`"));
        }
        let layer_of = |file: &str| file.split(['/', '.']).next().unwrap_or("").to_owned();
        for i in self.imports() {
            let (from, to) = (layer_of(&i.from), layer_of(&i.to));
            let known = may_use.get(from.as_str()).is_none_or(|uses| uses.contains(&to.as_str()));
            if from != to && !known {
                faults.push(format!("`{from}` may not use `{to}`: {i}"));
            }
        }
        faults
    }
}

/// Row of the table of layers: a layer, and those it may use if the table says so.
type Row = (String, Option<Vec<String>>);

/// Rows of the table of layers.
fn table(root: &str) -> Result<Vec<Row>, String> {
    let cells = |line: &str| -> Vec<String> { line.split('|').map(|c| c.trim().to_owned()).collect() };
    let names = |cell: &str| -> Vec<String> { cell.split('`').skip(1).step_by(2).map(str::to_owned).collect() };
    let lines = || root.lines().filter_map(|l| l.strip_prefix("//!")).map(str::trim);
    let header = lines().position(|l| cells(l).get(1).is_some_and(|c| c == "layer"));
    let header = header.ok_or("lib.rs has no table with a column `layer`")?;
    let column = cells(lines().nth(header).unwrap_or("")).iter().position(|c| c == "may use");
    let rows = lines().skip(header + 2).take_while(|l| l.starts_with('|')).map(cells);
    rows.map(|row| {
        let layer = row.get(1).and_then(|c| names(c).first().cloned());
        let layer = layer.ok_or_else(|| format!("a row of the table names no layer: {}", row.join("|")))?;
        Ok((layer, column.map(|c| row.get(c).map(|c| names(c)).unwrap_or_default())))
    })
    .collect()
}
