//! The microbenchmarks: every kernel gives its expected answer, and nothing that there is a table of is left out.

use croupier::unstable::bsdf::facts;
use croupier::unstable::scene::blob::{LightKind, MaterialKind};
use croupier_benches::micro;
use croupier_benches::provenance::ARITHMETIC;
use croupier_benches::results::Results;
use croupier_benches::twins::{self, Twins};
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

/// Killed by: a component that has moved away from its f64 twin, one added or renamed without `--bin twins -- --write`,
/// a scattering model, light or medium without a twin.
#[test]
fn committed_errors_are_of_these_kernels() {
    let all = Twins::read().unwrap();
    let committed = all.iter().find(|t| t.arithmetic == ARITHMETIC).unwrap_or_else(|| panic!("no {ARITHMETIC} rows"));
    let rows = twins::rows(twins::PACKETS).unwrap();
    assert_eq!(committed.rows.len(), rows.len());
    for (old, new) in committed.rows.iter().zip(&rows) {
        let name = format!("{} {}", new.group, new.name);
        assert_eq!((&old.group, &old.name, old.count), (&new.group, &new.name, new.count));
        // the twins' own functions may differ in their last bits from one platform to the next, instructions by 2 %
        let near = |a: Option<f64>, b: Option<f64>, by: f64| match a.zip(b) {
            Some((a, b)) => (a - b).abs() <= by * b.abs() + 1e-9,
            None => a == b,
        };
        assert!(near(old.mean, new.mean, 0.02) && near(old.max, new.max, 0.02), "{name}: {old:?} -> {new:?}");
        assert!(near(old.instructions, new.instructions, 0.02), "{name}: {old:?} -> {new:?}");
        let group = new.group.split(' ').next().unwrap();
        let compared = ["sample", "eval", "pdf", "transmittance"].iter().any(|o| new.group.ends_with(o));
        if ["bsdf", "light", "medium"].contains(&group) && compared {
            assert!(new.mean.is_some_and(|mean| new.noise.is_some() || mean < 1e-4), "{name}: {new:?}");
        }
    }
}
