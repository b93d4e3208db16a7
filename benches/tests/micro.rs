//! The microbenchmarks: every kernel gives its expected answer, and nothing that there is a table of is left out.

use croupier::unstable::bsdf::facts;
use croupier::unstable::scene::blob::{LightKind, MaterialKind};
use croupier_benches::micro;
use croupier_benches::results::Results;
use std::collections::BTreeSet;

/// Killed by: a kernel whose answer has changed, two with one name, one without a lane in use, a material, light or
/// elementary function that nobody measures.
#[test]
fn kernels_give_their_expected_answers() {
    let mut kernels = micro::all().unwrap_or_else(|e| panic!("{e}"));
    let mut names = BTreeSet::new();
    for k in &mut kernels {
        assert!(k.units > 0 && k.lanes.is_none_or(|l| l > 0.0 && l <= 8.0), "{} {}", k.group, k.name);
        assert!(names.insert(format!("{}: {}", k.group, k.name)), "{} {} is there twice", k.group, k.name);
        (k.call)();
    }
    for kind in MaterialKind::ALL.iter().filter(|k| **k != MaterialKind::Own) {
        let groups: &[&str] = match kind {
            MaterialKind::Null => &["straight"],
            _ if facts(*kind).lobes.delta_only() => &["sample"],
            _ => &["sample", "eval", "pdf"],
        };
        for group in groups {
            assert!(names.contains(&format!("bsdf {group}: {}", kind.name())), "no {group} of {}", kind.name());
        }
    }
    let lights = names.iter().filter(|n| n.starts_with("light sample: ")).count();
    assert_eq!(lights, LightKind::ALL.len() + 1, "kinds of light; the environment has two");
}

/// Killed by: a kernel added or renamed without `--bin micro -- --write`.
#[test]
fn committed_counts_are_of_these_kernels() {
    let kernels = micro::all().unwrap_or_else(|e| panic!("{e}"));
    let committed = Results::read("micro").unwrap();
    let table = &committed.tables[0];
    assert_eq!(table.rows.len(), kernels.len());
    for k in &kernels {
        assert!(table.row(&[k.group, &*k.name]).is_some(), "{} {} is not in benches/results/micro.md", k.group, k.name);
    }
}
