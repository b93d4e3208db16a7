//! What a roulette strategy is worth: error times cost, per scene and strategy, and how much less of it than with the
//! baselines.
//!
//! Every (scene, seed, strategy) is one render with one thread ([`croupier_benches::measure`]). It ends after a number
//! of core-seconds, the CPU time of its threads, everything inside: setting up, learning, estimating errors. Its error
//! is relMSE against the scene's reference, without the worst 0.01 % of the pixels. It has two faults: small pictures
//! keep fireflies in it, and it contains the noise of the reference, which pulls all ratios to 1 and has a column. So a
//! second figure, with a star, leaves the worst 0.5 % of the pixels (`--outliers`) out and subtracts, in those that are
//! left, the variance that the reference states for itself. relMSE falls as 1 / cost, so that their product hardly
//! depends on when the render ended. Where a few bright samples carry the error, leaving pixels out flatters the render
//! with fewer samples, which has met fewer of them: compare such rows at equal samples, or leave more out than any has
//! met.
//!
//! Figures are medians over the seeds, with the interval of [`Median`]. Speed-ups are ratios of the products of two
//! strategies with the same seed, then their median; over all scenes, the geometric mean of these ratios per seed, then
//! its median. Renders of one seed follow each other, in another order for each seed, so that what else the machine
//! does hits all strategies. A time to an error is read from the errors with a star after the iterations ([`time_to`]).
//!
//! `--write` puts a run of all scenes into `benches/results`: with the usual strategies into `efficiency.md`, with
//! `--all` into `efficiency-all.md`, with `--overhead` into `efficiency-overhead.md`, with `--memory` into
//! `efficiency-memory.md`, with `--over-time` into `efficiency-time.md`.
//!
//! `--over-time` compares pictures of the same age: at each time the strategies that are efficiency-aware with the best
//! of the others, the one with the smallest median error at that time. A picture of 1 second is that of a longer render
//! after 1 second, between two iterations by interpolation.
//!
//! `--equal-samples N` renders N samples per pixel and takes rays as the cost: its tables are the same on every
//! machine.
//!
//! [`time_to`]: croupier_benches::stats::time_to

use clap::Parser;
use croupier_benches::exit::exit_code;
use croupier_benches::measure::{Run, Snapshot, render};
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::{Median, coverage, digits, geometric_mean};
use croupier_benches::subject::Subject;
use croupier_benches::variant::Variant;
use croupier_host::render::Target;
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The program; results of some options have names of their own.
const NAME: &str = "efficiency";
const SCENES: [&str; 9] =
    ["kitchen", "bathroom", "living_room", "pool", "water_caustic", "cbox", "veach_mis", "smoke", "volumetric_caustic"];
/// The last is what the program does by default.
const STRATEGIES: [&str; 4] = ["classic", "adrrs", "ears+shadow", "ears+shadow+auto"];
/// With `--all`.
const ALL: [&str; 24] = [
    "none",
    "threshold",
    "contribution",
    "throughput",
    "throughput:luminance",
    "throughput:mean",
    "albedo",
    "albedo:product",
    "classic",
    "classic:5:relative",
    "winners",
    "bolin-meyer",
    "adrr",
    "adrrs",
    "ear",
    "ears",
    "classic+adaptive",
    "classic+shadow",
    "adrrs+adaptive",
    "ears+adaptive",
    "ears+shadow",
    "ears+constant",
    "ears+small",
    "ears+truth",
];
/// With `--overhead`: the same paths without learning, and with it.
const OVERHEAD: [&str; 2] = ["classic:200", "ears+idle"];
/// With `--memory`: from 256 KiB to 256 MiB for all that is learned.
const MEMORY: [&str; 7] = [
    "classic",
    "ears+shadow+auto+small",
    "ears+shadow+auto+1MiB",
    "ears+shadow+auto+4MiB",
    "ears+shadow+auto+16MiB",
    "ears+shadow+auto+64MiB",
    "ears+shadow+auto+256MiB",
];
/// With `--over-time`: simple rules, and what is compared with the best of them.
const OVER_TIME: [&str; 6] = ["none", "classic", "throughput", "adrrs", "ears+shadow", "ears+shadow+auto"];
/// Core-seconds at which pictures are compared.
const TIMES: [f64; 7] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0];
const BASELINES: [&str; 2] = ["classic", "adrrs"];
/// Errors to which times are stated.
const LEVELS: [f64; 3] = [0.1, 0.03, 0.01];

#[derive(Parser)]
#[command(about = "Table of error times cost of roulette strategies")]
struct Args {
    /// Folder of the scenes.
    #[arg(long, default_value = "../shared/scenes")]
    scenes: PathBuf,
    /// Only these scenes (any of the folder); several with commas.
    #[arg(long = "scene", value_name = "NAME", value_delimiter = ',', default_values = SCENES)]
    only: Vec<String>,
    /// In place of the reference of a scene this EXR file, such as `references --save` writes; several with commas. For
    /// scenes whose reference is wrong.
    #[arg(long = "reference", value_name = "SCENE=FILE", value_delimiter = ',')]
    references: Vec<String>,
    /// Only these strategies (any that `croupier render --rrs` knows, with options, and behind a `+` other choices
    /// such as adaptive, shadow, auto, small, 4MiB, hashed); several with commas.
    #[arg(long = "strategy", value_name = "NAME", value_delimiter = ',', conflicts_with = "all")]
    strategies: Vec<String>,
    /// Every strategy that needs no options: an overview from short renders.
    #[arg(long)]
    all: bool,
    /// What learning costs: rays per second of `ears+idle` over those of `classic:200`, which traces the same paths.
    #[arg(long, conflicts_with_all = ["strategies", "all"])]
    overhead: bool,
    /// What memory for statistics brings: 256 KiB to 256 MiB.
    #[arg(long, conflicts_with_all = ["strategies", "all", "overhead"])]
    memory: bool,
    /// Error after 0.1 to 100 core-seconds, against the best simple rule of that time.
    #[arg(long, conflicts_with_all = ["strategies", "all", "overhead", "memory", "equal_samples"])]
    over_time: bool,
    /// Independent seeds [default: 8, quick: 3, all, overhead and memory: 2].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    seeds: Option<u32>,
    /// The first of them.
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Core-seconds of each render [default: 30, quick: 5, all: 4, memory: 10, over time: 100].
    #[arg(long)]
    seconds: Option<f64>,
    /// Per cent of the pixels that the figures with a star leave out, the worst ones.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.5)]
    outliers: f64,
    /// Samples per pixel of each render, instead of a time.
    #[arg(long, value_name = "N", conflicts_with = "seconds", value_parser = clap::value_parser!(u32).range(1..))]
    equal_samples: Option<u32>,
    /// Fewer seeds and seconds.
    #[arg(long)]
    quick: bool,
    /// Renders side by side; more than there are cores disturb each other.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    threads: u32,
    /// Also write everything, with the errors over time, into this file after every scene.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the tables into benches/results; needs all scenes and one of the sets of strategies.
    #[arg(long, conflicts_with_all = ["only", "strategies", "first_seed", "equal_samples", "quick"])]
    write: bool,
}

impl Args {
    /// Name of the results.
    fn name(&self) -> &'static str {
        match (self.all, self.overhead, self.over_time, self.memory) {
            (true, ..) => "efficiency-all",
            (_, true, ..) => "efficiency-overhead",
            (.., true, _) => "efficiency-time",
            (.., true) => "efficiency-memory",
            _ => NAME,
        }
    }

    fn seeds(&self) -> u32 {
        let usual = match (self.quick, self.all || self.overhead || self.memory) {
            (true, _) => 3,
            (_, true) => 2,
            _ => 8,
        };
        self.seeds.unwrap_or(usual)
    }

    fn seconds(&self) -> f64 {
        let usual = match (self.quick, self.all, self.over_time) {
            _ if self.memory => 10.0,
            (true, ..) => 5.0,
            (_, true, _) => 4.0,
            (.., true) => 100.0,
            _ => 30.0,
        };
        self.seconds.unwrap_or(usual)
    }

    fn target(&self) -> Target {
        self.equal_samples.map_or(Target::Seconds(self.seconds()), Target::Spp)
    }

    fn strategies(&self) -> Result<Vec<Variant>, String> {
        let names: Vec<&str> = match (self.all, self.overhead, self.strategies.is_empty()) {
            (true, ..) => ALL.to_vec(),
            (_, true, _) => OVERHEAD.to_vec(),
            _ if self.over_time => OVER_TIME.to_vec(),
            _ if self.memory => MEMORY.to_vec(),
            (.., false) => self.strategies.iter().map(|s| &**s).collect(),
            _ => STRATEGIES.to_vec(),
        };
        names.into_iter().map(Variant::parse).collect()
    }
}

/// All renders of a scene: by strategy, then by seed.
struct Group {
    scene: String,
    /// What the reference's noise adds to relMSE.
    noise: f64,
    runs: Vec<Vec<Run>>,
}

impl Group {
    fn render(subject: &Subject, strategies: &[Variant], args: &Args) -> Result<Self, String> {
        let (n, seeds) = (strategies.len(), args.seeds() as usize);
        let next = AtomicUsize::new(0);
        let work = || -> Result<Vec<(usize, Run)>, String> {
            let mut done = Vec::new();
            loop {
                let job = next.fetch_add(1, Ordering::Relaxed);
                let (i, s) = (job / n, (job + job / n) % n);
                if i >= seeds {
                    return Ok(done);
                }
                let seed = args.first_seed.wrapping_add(i as u64);
                let name = format!("{}, {}, seed {seed}", subject.name, strategies[s].name);
                let run = render(subject, &strategies[s], seed, args.target(), args.outliers / 100.0)
                    .map_err(|e| format!("{name}: {e}"))?;
                let [spp, seconds, error] = [run.spp(), run.end.core_seconds, run.end.error].map(digits);
                eprintln!("{name}: {spp} spp, {seconds} core-s, relMSE {error}");
                done.push((s, run));
            }
        };
        let results: Vec<_> = std::thread::scope(|scope| {
            let workers: Vec<_> = (0..args.threads).map(|_| scope.spawn(work)).collect();
            workers.into_iter().map(|w| w.join().unwrap_or_else(|_| Err("a render panicked".into()))).collect()
        });
        let mut runs: Vec<Vec<Run>> = strategies.iter().map(|_| Vec::new()).collect();
        for result in results {
            result?.into_iter().for_each(|(s, run)| runs[s].push(run));
        }
        runs.iter_mut().for_each(|r| r.sort_by_key(|r| r.seed.wrapping_sub(args.first_seed)));
        Ok(Self { scene: subject.name.clone(), noise: subject.reference_noise(), runs })
    }

    fn median(&self, strategy: usize, f: impl Fn(&Run) -> f64) -> Option<Median> {
        Median::of(&self.runs[strategy].iter().map(f).collect::<Vec<_>>())
    }

    /// Speed-up of a strategy over another, seed by seed.
    fn ratios(&self, strategy: usize, baseline: usize, product: Product) -> Vec<f64> {
        let pairs = self.runs[baseline].iter().zip(&self.runs[strategy]);
        pairs.map(|(b, s)| product.of(b) / product.of(s)).collect()
    }
}

/// Error times cost.
#[derive(Clone, Copy)]
struct Product {
    /// In rays per pixel, not core-seconds: relative variance of a sample x its rays.
    by_rays: bool,
    robust: bool,
}

impl Product {
    /// NaN if the error is not above the noise.
    fn of(self, run: &Run) -> f64 {
        let error = if self.robust { run.end.robust } else { run.end.error };
        let cost = if self.by_rays { run.end.rays as f64 / run.pixels as f64 } else { run.end.core_seconds };
        if error > 0.0 { error * cost } else { f64::NAN }
    }
}

struct Report<'a> {
    args: &'a Args,
    strategies: Vec<Variant>,
    groups: Vec<Group>,
}

impl Report<'_> {
    fn product(&self, robust: bool) -> Product {
        Product { by_rays: self.args.equal_samples.is_some(), robust }
    }

    fn baselines(&self) -> [Option<usize>; 2] {
        BASELINES.map(|b| self.strategies.iter().position(|s| s.name == b))
    }

    /// Speed-ups over the baselines, with the plain error and with the robust one.
    fn over(&self, f: impl Fn(usize, Product) -> Vec<f64>) -> [Option<Median>; 4] {
        let [a, b] = self.baselines();
        [(a, false), (b, false), (a, true), (b, true)].map(|(b, robust)| Median::of(&f(b?, self.product(robust))))
    }

    fn in_scene(&self, g: &Group, strategy: usize) -> [Option<Median>; 4] {
        self.over(|baseline, product| g.ratios(strategy, baseline, product))
    }

    /// Geometric means over the scenes.
    fn in_all(&self, strategy: usize) -> [Option<Median>; 4] {
        self.over(|baseline, product| {
            let scenes: Vec<Vec<f64>> = self.groups.iter().map(|g| g.ratios(strategy, baseline, product)).collect();
            let of_seed = |i| geometric_mean(&scenes.iter().map(|s| s[i]).collect::<Vec<_>>());
            (0..self.args.seeds() as usize).map(of_seed).collect()
        })
    }

    /// What holds for all tables.
    fn facts(&self) -> Vec<(String, String)> {
        let n = self.args.seeds();
        let what = self.args.equal_samples.map_or_else(
            || format!("{n} seeds of {} core-seconds, one thread each", digits(self.args.seconds())),
            |samples| format!("{n} seeds of {samples} samples per pixel"),
        );
        let coverage = 100.0 * coverage(n as usize);
        let own = self.args.references.iter().filter_map(|r| r.split_once('='));
        let own: Vec<&str> = own.map(|(scene, _)| scene).collect();
        let mut facts = vec![
            ("renders", what),
            ("figures", format!("medians over the seeds [intervals that hold the true median with {coverage:.0} %]")),
            (
                "star",
                format!("without the worst {} % of the pixels and the reference's noise", self.args.outliers)
                    + "; else without 0.01 % and with it",
            ),
        ];
        if !own.is_empty() {
            facts.push(("scenes with another reference than their own", own.join(", ")));
        }
        facts.into_iter().map(|(key, value)| (key.into(), value)).collect()
    }

    /// Speed-ups over `classic`, with a star: strategies in rows, scenes and their geometric mean in columns. `None`
    /// without `classic`.
    fn overview(&self) -> Option<Table> {
        self.baselines()[0]?;
        let names: Vec<&str> = self.groups.iter().map(|g| &*g.scene).collect();
        let mut table = Table::new("Speed-up over classic", &format!("strategy, {}, mean", names.join(", ")));
        for (s, variant) in self.strategies.iter().enumerate().filter(|(_, v)| v.name != BASELINES[0]) {
            let scenes = self.groups.iter().map(|g| self.in_scene(g, s)[2]);
            let figures = scenes.chain([self.in_all(s)[2]]).map(|m| known(m, |m| format!("{:.2}x", m.median)));
            table.add([marked(variant)].into_iter().chain(figures));
        }
        Some(table)
    }

    /// Rays per second while learning over those of the same paths without; `None` unless both were rendered.
    fn overhead(&self) -> Option<Table> {
        let [plain, learns] = OVERHEAD.map(|name| self.strategies.iter().position(|s| s.name == name));
        let (plain, learns) = (plain?, learns?);
        let mut table = Table::new("Cost of learning", "scene, samples per pixel, rays/s");
        let speed = |r: &Run| r.end.rays as f64 / r.end.core_seconds;
        let mut means = Vec::new();
        for g in &self.groups {
            let quotients: Vec<f64> =
                g.runs[learns].iter().zip(&g.runs[plain]).map(|(a, b)| speed(a) / speed(b)).collect();
            let mean = geometric_mean(&quotients);
            means.push(mean);
            table.add([g.scene.clone(), known(g.median(learns, Run::spp), |m| digits(m.median)), format!("{mean:.2}")]);
        }
        table.add(["geometric mean".into(), "".into(), format!("{:.2}", geometric_mean(&means))]);
        Some(table)
    }

    fn table(&self, g: &Group) -> Table {
        let by_rays = self.args.equal_samples.is_some();
        let columns = if by_rays {
            "strategy, spp, rays/sample, V: variance of a sample, V*, reference noise x spp, 1 / (V x rays), \
             over classic, over adrrs, over classic*, over adrrs*"
        } else {
            "strategy, spp, rays/sample, Mrays/s, relMSE, relMSE*, reference noise, relMSE x core-s, \
             over classic, over adrrs, over classic*, over adrrs*, s to 0.1*, s to 0.03*, s to 0.01*"
        };
        let mut table = Table::new(&g.scene, columns);
        for (s, variant) in self.strategies.iter().enumerate() {
            let middle = |f: &dyn Fn(&Run) -> f64| known(g.median(s, f), |m| digits(m.median));
            let with_interval = |f: &dyn Fn(&Run) -> f64| known(g.median(s, f), |m| m.to_string());
            let product = |r: &Run| self.product(false).of(r);
            let mut cells = vec![marked(variant), middle(&Run::spp), middle(&Run::rays_per_sample)];
            if by_rays {
                cells.extend([
                    with_interval(&|r| r.end.error * r.spp()),
                    with_interval(&|r| r.end.robust * r.spp()),
                    middle(&|r| g.noise * r.spp()),
                    with_interval(&|r| 1.0 / product(r)),
                ]);
            } else {
                cells.extend([
                    middle(&|r| r.end.rays as f64 * 1e-6 / r.end.core_seconds),
                    with_interval(&|r| r.end.error),
                    with_interval(&|r| r.end.robust),
                    digits(g.noise),
                    with_interval(&product),
                ]);
            }
            cells.extend(self.in_scene(g, s).map(speed_up));
            if !by_rays {
                // a seed that did not get there took longer than any that did
                let time = |level| g.median(s, |r| r.seconds_to(level).unwrap_or(f64::INFINITY));
                let reached = |t: Option<Median>| known(t.filter(|t| t.median.is_finite()), |t| digits(t.median));
                cells.extend(LEVELS.map(|level| reached(time(level))));
            }
            table.add(cells);
        }
        table
    }

    /// Rows of a scene in the table over time: how much more error the best simple rule of each time has.
    fn over_time(&self, g: &Group, table: &mut Table) {
        let (aware, simple): (Vec<usize>, Vec<usize>) =
            (0..self.strategies.len()).partition(|s| self.strategies[*s].strategy.is_efficiency_aware());
        // nothing is to be compared before all seeds have a picture, and where noise is all that is left of an error
        let errors = |s: usize, t: f64| -> Option<Vec<f64>> {
            g.runs[s].iter().map(|r| r.error_after(t).filter(|e| *e > 0.0)).collect()
        };
        let median = |s: usize, t: f64| errors(s, t).and_then(|e| Median::of(&e));
        for t in TIMES {
            let known = simple.iter().filter_map(|&s| Some((s, median(s, t)?)));
            let Some((best, error)) = known.min_by(|a, b| a.1.median.total_cmp(&b.1.median)) else { continue };
            let ratio = |s: &usize| {
                let (of, own) = (errors(best, t)?, errors(*s, t)?);
                Median::of(&of.iter().zip(&own).map(|(a, b)| a / b).collect::<Vec<_>>())
            };
            let cells = [g.scene.clone(), t.to_string(), marked(&self.strategies[best]), error.to_string()];
            table.add(cells.into_iter().chain(aware.iter().map(|s| speed_up(ratio(s)))));
        }
    }

    /// `None` unless it was asked for.
    fn all_over_time(&self) -> Option<Table> {
        let aware = self.strategies.iter().filter(|s| s.strategy.is_efficiency_aware()).map(|s| &*s.name);
        let columns = ["scene", "core-seconds", "best simple rule", "its relMSE*"].into_iter().chain(aware);
        let mut table =
            Table::new("Error of the best simple rule over that of others", &columns.collect::<Vec<_>>().join(", "));
        self.groups.iter().for_each(|g| self.over_time(g, &mut table));
        self.args.over_time.then_some(table)
    }

    fn summary(&self) -> Table {
        let columns = "strategy, over classic, over adrrs, over classic*, over adrrs*";
        let mut table = Table::new("Geometric mean over the scenes", columns);
        for (s, variant) in self.strategies.iter().enumerate() {
            table.add([marked(variant)].into_iter().chain(self.in_all(s).map(speed_up)));
        }
        table
    }

    fn json(&self) -> Value {
        let medians = |m: [Option<Median>; 4]| m.map(|m| m.map(|m| [m.median, m.low, m.high]));
        let run = |r: &Run| {
            json!({
                "seed": r.seed, "spp": r.spp(), "end": r.end.json(), "product": self.product(false).of(r),
                "product_robust": self.product(true).of(r), "seconds_to": LEVELS.map(|l| r.seconds_to(l)),
                "snapshots": r.snapshots.iter().map(Snapshot::json).collect::<Vec<_>>(),
            })
        };
        let row = |g: &Group, s: usize| {
            let runs = g.runs[s].iter().map(run).collect::<Vec<_>>();
            json!({ "strategy": self.strategies[s].name, "over": medians(self.in_scene(g, s)), "runs": runs })
        };
        let strategies = 0..self.strategies.len();
        let rows = |g: &Group| strategies.clone().map(|s| row(g, s)).collect::<Vec<_>>();
        let group = |g: &Group| json!({ "scene": g.scene, "reference_noise": g.noise, "strategies": rows(g) });
        let mean = |s: usize| json!({ "strategy": self.strategies[s].name, "over": medians(self.in_all(s)) });
        json!({
            "seeds": self.args.seeds(), "coverage": coverage(self.args.seeds() as usize),
            "seconds": self.args.equal_samples.is_none().then(|| self.args.seconds()),
            "equal_samples": self.args.equal_samples,
            "over": ["classic", "adrrs", "classic, robust", "adrrs, robust"], "levels": LEVELS,
            "scenes": self.groups.iter().map(group).collect::<Vec<_>>(),
            "geometric_means": strategies.clone().map(mean).collect::<Vec<_>>(),
        })
    }
}

/// A strategy's name. A strategy that cuts paths is quick, and its relMSE hides that while noise is larger.
fn marked(variant: &Variant) -> String {
    format!("{}{}", variant.name, if variant.strategy.is_biased() { " (biased)" } else { "" })
}

/// A cell of a table; `-` if there is nothing to say.
fn known(m: Option<Median>, text: impl Fn(Median) -> String) -> String {
    m.map_or("-".into(), text)
}

fn speed_up(m: Option<Median>) -> String {
    known(m, |m| format!("{:.2}x [{:.2}, {:.2}]", m.median, m.low, m.high))
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut results = Results::of_this_run(NAME);
    if let Some(name) = args.only.iter().find(|name| !args.scenes.join(name).is_dir()) {
        return Err(format!("there is no scene {name} in {}", args.scenes.display()).into());
    }
    let mut report = Report { args, strategies: args.strategies()?, groups: Vec::new() };
    results.header.extend(report.facts());
    report.facts().iter().for_each(|(key, value)| println!("- {key}: {value}"));
    for name in &args.only {
        let mut subject = Subject::open(&args.scenes, name).map_err(|e| format!("{name}: {e}"))?;
        if let Some((_, file)) = args.references.iter().filter_map(|r| r.split_once('=')).find(|r| r.0 == name) {
            subject = subject.with_reference(file.as_ref()).map_err(|e| format!("{file}: {e}"))?;
        }
        let group = Group::render(&subject, &report.strategies, args)?;
        print!("\n{}", report.table(&group));
        report.groups.push(group);
        if let Some(path) = &args.json {
            std::fs::write(path, report.json().to_string()).map_err(|e| format!("{}: {e}", path.display()))?;
        }
    }
    let mut first: Vec<Table> = [report.overview(), report.overhead()].into_iter().flatten().collect();
    first.extend(report.all_over_time());
    first.iter().chain([&report.summary()]).for_each(|t| print!("\n{t}"));
    if args.write {
        results.tables = first;
        results.tables.extend(report.groups.iter().map(|g| report.table(g)));
        results.tables.push(report.summary());
        eprintln!("wrote {}", results.write(args.name())?.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()).map(|()| true))
}
