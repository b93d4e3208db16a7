//! Hard numerical cases in three sizes: what the tests check with fixed seeds and few cases
//! ([`croupier_tests::hard`]), with fresh seeds and as many cases as a tier has time for.
//!
//! The tables in `benches/results/hard-TIER.md` are those of the newest run; `benches/results/hard.jsonl` keeps one
//! line of JSON per run that was written, so that history is not lost.

use crate::parts::in_parts;
use crate::results::{Results, Table};
use croupier_tests::bsdf::V;
use croupier_tests::environment;
use croupier_tests::geometry::{Mesh, star};
use croupier_tests::hard::{Found, aimed, boxes, comb, even, sampling, spawned, torture};
use croupier_tests::math::{Sweep, UNARY, Unary, sweep};
use croupier_tests::stats::{FAMILY_ALPHA, Mean, SplitMix, normal_quantile_upper, sidak};
use serde_json::{Map, Value, json};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// How much is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tier {
    /// Seconds.
    Commit,
    /// Some minutes.
    Nightly,
    /// Hours; 40 minutes are expected on two idle cores.
    Weekly,
}

impl Tier {
    /// All of them, from small to large.
    pub const ALL: [Self; 3] = [Self::Commit, Self::Nightly, Self::Weekly];

    /// As the command line names it.
    pub fn name(self) -> &'static str {
        ["commit", "nightly", "weekly"][self as usize]
    }

    /// The tier of this name.
    pub fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.name() == name)
    }

    /// Name of its file of results.
    pub fn results(self) -> String {
        format!("hard-{}", self.name())
    }
}

/// A row of the table, before it is filled in.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Row of `docs/NUMERICS.md`.
    pub id: &'static str,
    /// What the cases are.
    pub what: &'static str,
    /// What a failure is.
    pub failure: &'static str,
    /// What the worst figure is, with its unit; empty if nothing is measured.
    pub figure: &'static str,
}

/// A check: its rows, its sizes by tier, and the function that gives what it has found for each row.
pub struct Check {
    /// One or more.
    pub rows: &'static [Row],
    sizes: [u64; 3],
    run: fn(u64, u64) -> Vec<Found>,
}

const fn row(id: &'static str, what: &'static str, failure: &'static str, figure: &'static str) -> Row {
    Row { id, what, failure, figure }
}

/// A figure of tests of samples.
const P: &str = "-log10 of the smallest p";

/// All checks. Sizes are numbers of cases where nothing else is said.
pub const CHECKS: [Check; 12] = [
    Check {
        rows: &[row("TRI-1", "rays within closed meshes, two thirds aimed at edges and vertices", "leaks", "")],
        sizes: [600_000, 15_000_000, 1_500_000_000],
        run: aimed_rays,
    },
    Check {
        rows: &[row(
            "OFF-1",
            "rays that leave hard triangles",
            "self-hits",
            "start, in 2^-24 of the largest coordinate",
        )],
        sizes: [200_000, 10_000_000, 100_000_000],
        run: |seed, n| merged(n, 64 * 2000, seed, |seed, n| spawned::self_hits(seed, n / 64)),
    },
    Check {
        rows: &[row("OFF-3", "shadow rays between triangles that see each other", "blocked or blind", "")],
        sizes: [100_000, 2_000_000, 20_000_000],
        run: |seed, n| merged(n, 8 * 5000, seed, |seed, n| spawned::shadow_rays(seed, n / 8)),
    },
    Check {
        rows: &[row("BOX-1", "rays and boxes", "boxes missed", "part of the padding that lets rays in")],
        sizes: [600_000, 20_000_000, 500_000_000],
        // of three packets two are whole and one is a single ray
        run: |seed, n| merged(n, 100_000, seed, |seed, n| boxes::missed(seed, 3 * n / 17)),
    },
    // sizes: arguments of each function; `ulp` tries all 2^32
    Check { rows: &FUNCTIONS, sizes: [1 << 18, 1 << 24, 1 << 28], run: functions },
    // sizes: random numbers, of which 2^32 are all
    Check {
        rows: &[row("RRS-2", "sample counts of the comb", "wrong means", "a total's distance from the sum")],
        sizes: [1 << 18, 1 << 27, 1 << 32],
        run: |seed, n| merged(4, 1, seed, |seed, packets| comb::exact(seed, packets as u64, n.trailing_zeros())),
    },
    Check {
        rows: &[row(
            "FLM-1",
            "equal samples of one pixel",
            "wrong means, errors, counts",
            "relative error of the mean",
        )],
        sizes: [200_000, 20_000_000, 500_000_000],
        run: equal_samples,
    },
    // sizes of the next four: samples of each configuration
    Check {
        rows: &[row("GGX-4", "samples of surfaces in cells", "improbable counts", P)],
        sizes: [1 << 12, 1 << 18, 1 << 22],
        run: surfaces,
    },
    Check {
        rows: &[row("MED-8", "samples of phase functions in cells", "improbable counts", P)],
        sizes: [1 << 14, 1 << 21, 1 << 24],
        run: phase_functions,
    },
    Check {
        rows: &[row("MED-1", "free flights in cells", "improbable counts", P)],
        sizes: [1 << 14, 1 << 21, 1 << 24],
        run: |seed, n| {
            tests_of_p(8, |i, level| {
                let p = sampling::distances(part_seed(seed, i), n as u32).p;
                Found::of_p(p, level, n, || format!("run {i}"))
            })
        },
    },
    Check {
        rows: &[row("SMP-5", "samples of environment maps in cells", "improbable counts, strays", P)],
        sizes: [1 << 16, 1 << 21, 1 << 24],
        run: environments,
    },
    // sizes: seeds
    Check { rows: &HARD_SCENES, sizes: [1, 3, 16], run: hard_scenes },
];

/// Seed of a part of a check.
fn part_seed(seed: u64, part: u64) -> u64 {
    SplitMix(seed.wrapping_add(part.wrapping_mul(0x9e37_79b9_7f4a_7c15))).bits()
}

fn in_order(parts: Vec<Found>) -> Vec<Found> {
    let mut all = Found::default();
    parts.into_iter().for_each(|p| all.merge(p));
    vec![all]
}

/// Parts of `size` of `n` cases on all cores, each with its own seed.
fn merged(n: u64, size: u64, seed: u64, f: impl Fn(u64, usize) -> Found + Sync) -> Vec<Found> {
    let part = |i: u64| f(part_seed(seed, i), size.min(n - i * size) as usize);
    in_order(in_parts(n.div_ceil(size), part))
}

fn aimed_rays(seed: u64, n: u64) -> Vec<Found> {
    const PACKETS: u64 = 12_500;
    let part = |i: u64| {
        let seed = part_seed(seed, i);
        // a mesh of its own for each
        let place = aimed::PLACEMENTS[(i % 5) as usize];
        let vertices = 16 + (seed % 48) as usize;
        aimed::leaks(&Mesh::new(star(vertices, place.0, place.1, seed)), place, seed ^ 1, PACKETS as usize)
    };
    in_order(in_parts(n.div_ceil(8 * PACKETS), part))
}

const BEYOND: &str = "results beyond the promise, or out of order";
/// In the order of [`UNARY`].
const FUNCTIONS: [Row; 6] = [
    row("MTH-1", "arguments of exp", BEYOND, "largest error in ULP"),
    row("MTH-1", "arguments of ln", BEYOND, "largest error in ULP"),
    row("MTH-1", "arguments of sin 2 pi x", BEYOND, "largest error in ULP"),
    row("MTH-1", "arguments of cos 2 pi x", BEYOND, "largest error in ULP"),
    row("MTH-1", "arguments of acos", BEYOND, "largest error in ULP"),
    row("MTH-1", "arguments of asin", BEYOND, "largest error in ULP"),
];

/// Error of a function for eight arguments in a row out of every `stride`, on all cores; with 8 these are all 2^32.
pub fn swept(f: &'static Unary, stride: u64) -> Sweep {
    const PARTS: u64 = 64;
    let size = (1u64 << 32) / PARTS;
    let part = |p: u64| sweep(f, (p * size) as u32, (p * size + size - 1) as u32, stride);
    let mut all = Sweep::default();
    in_parts(PARTS, part).iter().for_each(|s| all.merge(s));
    all
}

/// What of a sweep is not as promised: an error that is too large, results of neighbours in the wrong order.
pub fn broken_promises(f: &Unary, s: &Sweep) -> Option<String> {
    let [max, unordered] = [s.max.0 > f.bound(), f.direction != 0.0 && s.unordered.0 > 0];
    (max || unordered)
        .then(|| format!("{}: {} ULP at {:#010x}, unordered: {:?}", f.name, s.max.0, s.max.1, s.unordered))
}

fn functions(seed: u64, n: u64) -> Vec<Found> {
    let sweeps = UNARY.iter().map(|f| {
        // other arguments with other seeds: the first pattern is anywhere within the stride
        let stride = 8 * ((1u64 << 32) / n);
        let s = swept(f, stride - 8 * (seed % (stride / 64).max(1)));
        let broken = broken_promises(f, &s);
        let mut found = Found { cases: s.count, worst: s.max.0, ..Found::default() };
        found.fail(u64::from(broken.is_some()), || broken.unwrap_or_default());
        found
    });
    sweeps.collect()
}

/// Two pixels: one with a long iteration, one with many.
fn equal_samples(seed: u64, n: u64) -> Vec<Found> {
    let pixel = |part: u64| {
        let iterations = if part == 0 { 1 } else { 1000 };
        even::sky(part_seed(seed, part), (n / 2 / iterations) as u32, iterations as usize)
    };
    in_order(in_parts(2, pixel))
}

/// Statistical tests on all cores; together they give one false alarm in 1e6.
fn tests_of_p(n: usize, test: impl Fn(u64, f64) -> Found + Sync) -> Vec<Found> {
    let level = sidak(FAMILY_ALPHA, n);
    in_order(in_parts(n as u64, |i| test(i, level)))
}

fn surfaces(seed: u64, n: u64) -> Vec<Found> {
    let all = sampling::configurations();
    // quadrature has to be finer than the noise of counts
    let points = if n > 1 << 20 {
        64
    } else if n > 1 << 16 {
        32
    } else {
        16
    };
    tests_of_p(all.len(), |i, level| {
        let (case, wo): &(_, V) = &all[i as usize];
        let p = sampling::surface(case, *wo, part_seed(seed, i), n, points).p;
        Found::of_p(p, level, n, || format!("{} at {:.2} degrees", case.name(), wo[2].acos().to_degrees()))
    })
}

fn phase_functions(seed: u64, n: u64) -> Vec<Found> {
    let all = sampling::MEAN_COSINES;
    tests_of_p(all.len(), |i, level| {
        let g = all[i as usize];
        let p = sampling::phase_function(g, part_seed(seed, i), n).p;
        Found::of_p(p, level, n, || format!("mean cosine {g}"))
    })
}

fn environments(seed: u64, n: u64) -> Vec<Found> {
    let all: Vec<_> = environment::cases().into_iter().filter(|c| c.name != "fine").collect();
    tests_of_p(all.len(), |i, level| {
        let case = &all[i as usize];
        let e = sampling::environment(case, part_seed(seed, i), n / 8);
        let mut found = Found::of_p(e.p, level, e.total, || case.name.into());
        found.fail(u64::from(e.strays > e.total / 50_000), || format!("{}: {} strays", case.name, e.strays));
        found
    })
}

const HARD_SCENES: [Row; 3] = [
    row("FLM-3", "numbers of pictures of hard scenes, all strategies", "not finite, negative, unexplained", ""),
    row("RRS-8", "pictures of hard scenes, strategies without bias", "wrong means", "standard errors of a mean"),
    row("TRI-5", "pictures of a box of needles", "more than 1 % of the light lost", "part of the light lost (open)"),
];

/// Renders with as many seeds as said; means over all of them against their expectation.
fn hard_scenes(seed: u64, seeds: u64) -> Vec<Found> {
    let (scenes, strategies) = (torture::all(seed), torture::strategies());
    let kinds = (scenes.len() * strategies.len()) as u64;
    let renders = in_parts(kinds * seeds, |i| {
        let k = (i % kinds) as usize;
        scenes[k / strategies.len()].render(&strategies[k % strategies.len()], part_seed(seed, i))
    });
    let [mut numbers, mut means, mut open] = [(); 3].map(|()| Found::default());
    for r in &renders {
        numbers.merge(r.numbers.clone());
        numbers.fail(u64::from(r.unexplained.is_some()), || format!("{}: {:?}", r.what, r.unexplained));
    }
    let allowed = normal_quantile_upper(sidak(FAMILY_ALPHA, kinds as usize) / 2.0);
    for k in 0..kinds as usize {
        let of_kind = renders.iter().skip(k).step_by(kinds as usize);
        let (mut between, mut within) = (Mean::default(), 0.0);
        for [mean, error] in of_kind.filter_map(|r| r.mean) {
            between.add(mean);
            within += error * error;
        }
        if renders[k].mean.is_none() {
            continue;
        }
        let expected = &scenes[k / strategies.len()].expected;
        // the larger of both: renders without a rare sample state too small an error
        let within = within.sqrt() / seeds as f64;
        let error = if seeds >= 16 { within.max(between.error()) } else { within };
        let what = || format!("{}: {} +- {error:e}, expected {}", renders[k].what, between.mean(), expected.mean);
        if expected.open_loss > 0.0 {
            // with the strategy that has the least noise
            if strategies[k % strategies.len()] == "none" {
                let loss = (1.0 - between.mean() / expected.mean).max(0.0);
                open.cases += seeds;
                open.figure(loss);
                open.fail(u64::from(loss - allowed * error / expected.mean > expected.open_loss), what);
            }
            continue;
        }
        let off = ((between.mean() - expected.mean).abs() - expected.rounding * expected.scale()).max(0.0);
        let sigmas = if off == 0.0 { 0.0 } else { off / error };
        means.cases += seeds;
        means.figure(sigmas);
        means.fail(u64::from(sigmas.is_nan() || sigmas > allowed), what);
    }
    vec![numbers, means, open]
}

/// A run of the checks of a tier.
pub struct Run {
    tier: Tier,
    seed: u64,
    results: Results,
    rows: Vec<Value>,
    /// Failures of all checks.
    pub failures: u64,
}

/// Columns of the table.
const COLUMNS: &str = "id, cases are, cases, failures are, failures, figure, worst, seed, seconds";

impl Run {
    /// A run that is about to start.
    pub fn new(tier: Tier, seed: u64) -> Self {
        let mut results = Results::of_this_run("hard");
        results.tables.push(Table::new("", COLUMNS));
        Self { tier, seed, results, rows: Vec::new(), failures: 0 }
    }

    /// Names of the columns as lines of Markdown.
    pub fn head(&self) -> String {
        self.results.tables[0].head()
    }

    /// Runs a check, and gives each of its rows as a line of Markdown, below it what failed first.
    pub fn check(&mut self, check: &Check) -> Vec<String> {
        let start = Instant::now();
        let found = (check.run)(self.seed, check.sizes[self.tier as usize]);
        let seconds = format!("{:.1}", start.elapsed().as_secs_f64());
        let mut lines = Vec::new();
        for (row, f) in check.rows.iter().zip(found) {
            let measured = !row.figure.is_empty();
            let worst = if measured { figure(f.worst) } else { "-".into() };
            let name = if measured { row.figure } else { "-" };
            let (cases, failures) = (f.cases.to_string(), f.failures.to_string());
            let table = &mut self.results.tables[0];
            table.add([
                row.id,
                row.what,
                &cases,
                row.failure,
                &failures,
                name,
                &worst,
                &self.seed.to_string(),
                &seconds,
            ]);
            lines.push(table.last());
            lines.extend(f.example.as_ref().map(|e| format!("{}: {e}", row.id)));
            self.rows.push(json!({
                "id": row.id, "cases_are": row.what, "cases": f.cases, "failures_are": row.failure,
                "failures": f.failures, "figure": measured.then_some(row.figure), "worst": measured.then_some(f.worst),
                "seconds": seconds, "first_failure": f.example,
            }));
            self.failures += f.failures;
        }
        lines
    }

    /// The table so far.
    pub fn table(&self) -> &Table {
        &self.results.tables[0]
    }

    /// Puts the rows into the file of results of the tier, and adds a line to the ledger. Rows of other checks stay if
    /// they are of the same version and machine.
    ///
    /// # Errors
    /// What is written is of another version, and this run has not all checks; or a file cannot be written.
    pub fn write(&self) -> Result<[PathBuf; 2], Box<dyn Error>> {
        let mut results = self.results.clone();
        let expected: Vec<&Row> = CHECKS.iter().flat_map(|c| c.rows).collect();
        if self.table().rows.len() < expected.len()
            && let Ok(old) = Results::read(&self.tier.results())
        {
            if let Some(difference) = self.results.differs_in(&old, &VERSION) {
                return Err(
                    format!("only a run of all checks replaces results of another version: {difference}").into()
                );
            }
            let row = |r: &&Row| {
                let key = [r.id, r.what];
                let new = self.table().row(&key);
                new.or_else(|| old.tables.first()?.row(&key)).map(<[String]>::to_vec)
            };
            results.tables[0].rows = expected.iter().filter_map(row).collect();
        }
        let table = results.write(&self.tier.results())?;
        let mut line: Map<String, Value> = self.results.header.iter().map(|(k, v)| (k.clone(), json!(v))).collect();
        line.insert("tier".into(), json!(self.tier.name()));
        line.insert("seed".into(), json!(self.seed));
        line.insert("rows".into(), json!(self.rows));
        let path = ledger();
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&path)?;
        writeln!(file, "{}", Value::Object(line))?;
        Ok([table, path])
    }
}

/// What is the same for all rows of a table.
const VERSION: [&str; 5] = ["commit", "machine", "compiler", "instruction set", "arithmetic"];

/// Three significant digits, small numbers with an exponent.
fn figure(x: f64) -> String {
    if x != 0.0 && x.abs() < 1e-3 { format!("{x:.2e}") } else { crate::stats::digits(x) }
}

/// The file with a line of JSON for each run that was written.
pub fn ledger() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results").join("hard.jsonl")
}
