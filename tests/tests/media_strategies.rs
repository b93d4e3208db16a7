//! Every strategy has the same mean as none in a scene with fog, smoke in a grid, marble, a pane and a cut-out: the short
//! version of `benches/src/bin/equivalence/`, which tests the same scene within 0.2 %.

use croupier::unstable::learn::ControlVariate;
use croupier::{Counters, Settings, Strategy};
use croupier_tests::media_scene::misty;
use croupier_tests::runner::{Schedule, scheduled, settings};
use croupier_tests::scenes::blob;
use croupier_tests::stats::{Mean, equivalent};

/// Half-width of what counts as equal, relative to the mean. A bias of that much passes a row with [`ALPHA`] at most.
const DELTA: f64 = 0.02;
/// Chance that a row calls equal what differs by [`DELTA`].
const ALPHA: f64 = 0.01;
/// Largest standard error of a row, relative to the mean: equal means are then found equal with 5 standard errors.
const MAX_ERROR: f64 = 0.0055;
/// Pairs of renders, with roulette and without, whose paths begin alike.
const SEEDS: u64 = 24;
const ITERATIONS: &[u32] = &[2, 2, 4, 8, 16];

/// Paths of 12 segments; constant factors multiply at every vertex, so that 4 must do for them.
const ROWS: &[(&str, u32)] = &[
    ("contribution", 12),
    ("throughput", 12),
    ("albedo", 12),
    ("classic:2", 12),
    ("winners", 12),
    ("bolin-meyer", 12),
    ("adrr", 12),
    ("adrrs", 12),
    ("ear", 12),
    ("ears", 12),
    ("ears+shadow+constant", 12),
    ("ears+adaptive", 12),
    ("fixed:0.5", 4),
    ("fixed:2", 4),
    ("fixed:3.3", 4),
];

/// Killed by: a vertex in a medium that takes a factor without its weight, a passage that plays roulette, a light sample
/// behind a medium that lacks its factor, a control variate that is added but not taken away, a ray that waits within a
/// medium and loses its ledger record's weight.
#[test]
fn strategies_keep_the_mean_in_media() {
    let known = |name: &str| ROWS.iter().any(|r| r.0.split(':').next() == Some(name));
    for (name, _) in Strategy::TABLE {
        let unbiased = Strategy::parse(name).is_ok_and(|s| !s.is_biased());
        assert!(!unbiased || *name == "none" || *name == "fixed" || known(name), "`{name}` has no row");
    }
    let scene = blob(&misty([16, 12]));
    let mean = |strategy: &str, max_depth: u32, seed: u64, counters: &mut Counters| {
        let (name, with) = strategy.split_once('+').unwrap_or((strategy, ""));
        let mut s = Settings { seed, max_depth, ..settings(&scene, name) };
        s.learning.subdivide_count = 1000.0;
        (s.shadow_roulette, s.adaptive) = (with.contains("shadow"), with.contains("adaptive"));
        if with.contains("constant") {
            s.control_variate = ControlVariate::Cached;
        }
        let image = scheduled(&scene, &s, ITERATIONS, Schedule::InOrder(1 << 20));
        counters.merge(&image.counters);
        image.mean()
    };
    let without = |max_depth: u32| -> Vec<f64> {
        (0..SEEDS).map(|seed| mean("none", max_depth, seed, &mut Counters::default())).collect()
    };
    let partners = [(12, without(12)), (4, without(4))];
    for (strategy, max_depth) in ROWS {
        let partners = &partners.iter().find(|p| p.0 == *max_depth).expect("a depth with partners").1;
        let (mut difference, mut all, mut c) = (Mean::default(), Mean::default(), Counters::default());
        for (seed, partner) in (0..).zip(partners) {
            difference.add(mean(strategy, *max_depth, seed, &mut c) - partner);
            all.add(*partner);
        }
        let (off, error) = (difference.mean() / all.mean(), difference.error() / all.mean());
        println!("{strategy}: {:+.3} +- {:.3} %, {:.2} Mrays", 100.0 * off, 100.0 * error, c.rays() as f64 * 1e-6);
        assert_eq!((c.non_finite, c.passages_cut), (0, 0), "{strategy}");
        assert!(c.medium_steps > c.camera_samples && c.passed.lanes > c.camera_samples / 2, "{strategy}: {c:?}");
        assert!(error <= MAX_ERROR, "{strategy}: a standard error of {error} sees nothing");
        assert!(equivalent(off, error, DELTA, ALPHA), "{strategy}: {off} +- {error}");
    }
}
