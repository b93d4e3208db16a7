//! What a roulette strategy is worth: error times cost, per scene and strategy, and how much less of both it takes than
//! the baselines.
//!
//! Every (scene, seed, strategy) is one render with one thread. It ends after a wall-clock time; what counts as its cost
//! is the CPU time of its two threads, everything inside: setting up, learning, estimating errors. Its error is relMSE
//! against the scene's reference, without the worst 0.01 % of pixels
//! ([`croupier_host::compare::relmse`]), and in a second, robust figure without the worst 0.1 %. The error of a render
//! falls as 1 / cost, so that relMSE x core-seconds does not depend on when it ended, until it comes near the noise of
//! the reference, which every relMSE contains: it has a column and is subtracted nowhere.
//!
//! Figures are medians over the seeds, with the interval of [`Median`]. Speed-ups are ratios of relMSE x cost of two
//! strategies with the same seed, then their median; over all scenes, the geometric mean of those ratios per seed, then
//! its median. Renders of one seed follow each other, in another order for each seed, so that what else the machine does
//! hits all strategies.
//!
//! `--equal-samples N` renders N samples per pixel and takes rays as the cost. Its figures are the same on every machine.

use clap::Parser;
use croupier::{Film, Scene, Settings, Strategy};
use croupier_benches::clock::cpu_seconds;
use croupier_benches::stats::{Median, coverage, digits, geometric_mean, time_to};
use croupier_benches::subject::Subject;
use croupier_host::compare::{CompareError, relmse, relmse_without};
use croupier_host::drive::{Options, drive_scene};
use croupier_host::image::Rgb;
use croupier_host::render::{Observer, Progress, Target};
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

const SCENES: [&str; 7] = ["kitchen", "bathroom", "living_room", "pool", "water_caustic", "cbox", "veach_mis"];
/// Those of them that the core knows.
const STRATEGIES: [&str; 5] = ["classic", "throughput", "adrrs", "ear", "ears"];
const BASELINES: [&str; 2] = ["classic", "adrrs"];
/// Errors to which times are stated.
const LEVELS: [f64; 3] = [0.1, 0.03, 0.01];
/// Pixels that the robust error leaves out.
const ROBUST: f64 = 1e-3;

#[derive(Parser)]
#[command(about = "Table of error times cost of roulette strategies")]
struct Args {
    /// Folder of the scenes.
    #[arg(long, default_value = "../shared/scenes")]
    scenes: PathBuf,
    /// Only these scenes (any of the folder); several with commas.
    #[arg(long = "scene", value_name = "NAME", value_delimiter = ',', default_values = SCENES)]
    only: Vec<String>,
    /// Only these strategies (any that `croupier render --rrs` knows, with options); several with commas.
    #[arg(long = "strategy", value_name = "NAME", value_delimiter = ',', conflicts_with = "all")]
    strategies: Vec<String>,
    /// Every strategy that needs no options.
    #[arg(long)]
    all: bool,
    /// Independent seeds [default: 8, quick: 3].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    seeds: Option<u32>,
    /// The first of them.
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Wall-clock seconds of each render [default: 30, quick: 5].
    #[arg(long)]
    seconds: Option<f64>,
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
}

impl Args {
    fn seeds(&self) -> u32 {
        self.seeds.unwrap_or(if self.quick { 3 } else { 8 })
    }

    fn target(&self) -> Target {
        let seconds = self.seconds.unwrap_or(if self.quick { 5.0 } else { 30.0 });
        self.equal_samples.map_or(Target::Seconds(seconds), Target::Spp)
    }

    fn strategies(&self) -> Result<Vec<String>, String> {
        if self.strategies.is_empty() {
            let names: Vec<&str> =
                if self.all { Strategy::TABLE.iter().map(|t| t.0).collect() } else { STRATEGIES.to_vec() };
            return Ok(names.into_iter().filter(|s| Strategy::parse(s).is_ok()).map(String::from).collect());
        }
        let known = |s: &String| Strategy::parse(s).map(|_| s.clone()).map_err(|e| format!("{s}: {e}"));
        self.strategies.iter().map(known).collect()
    }
}

/// The picture after an iteration.
#[derive(Clone, Copy)]
struct Snapshot {
    core_seconds: f64,
    wall_seconds: f64,
    samples: u64,
    rays: u64,
    error: f64,
    robust: f64,
}

impl Snapshot {
    fn json(&self) -> Value {
        json!({
            "core_seconds": self.core_seconds, "wall_seconds": self.wall_seconds, "samples": self.samples,
            "rays": self.rays, "relmse": self.error, "relmse_robust": self.robust,
        })
    }
}

/// Takes the snapshots of a render, beside its clock.
struct Watch<'a> {
    reference: &'a Rgb,
    /// CPU time of the calling thread at the start.
    start: Option<f64>,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// CPU time of the thread that traces.
    tracer: Option<f64>,
    /// CPU time of the calling thread that went into snapshots.
    paused: f64,
    snapshots: Vec<Result<Snapshot, CompareError>>,
}

impl<'a> Watch<'a> {
    fn start(reference: &'a Rgb) -> Self {
        Self { reference, start: cpu_seconds(), state: Mutex::default() }
    }

    fn errors(&self, film: &Film<'_>) -> Result<[f64; 2], CompareError> {
        let [width, height] = film.size().map(|s| s as usize);
        let pixels = film.pixels().iter().map(|p| p.mean().map(|x| x as f32)).collect();
        let image = Rgb { width, height, pixels };
        let [error, robust] =
            [relmse(&image, self.reference, false)?, relmse_without(&image, self.reference, ROBUST)?].map(|e| e.value);
        Ok([error, robust])
    }
}

impl Observer for Watch<'_> {
    fn progress(&self, _: &Progress) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).tracer = cpu_seconds();
    }

    fn stop(&self) -> bool {
        false
    }

    fn iteration(&self, film: &Film<'_>, seconds: f64) {
        let now = cpu_seconds();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let cpu = self.start.zip(now).zip(state.tracer).map(|((a, b), tracer)| b - a - state.paused + tracer);
        let sum = |f: fn(&croupier::film::PixelStats) -> u64| film.pixels().iter().map(f).sum::<u64>();
        state.snapshots.push(self.errors(film).map(|[error, robust]| Snapshot {
            core_seconds: cpu.unwrap_or(seconds),
            wall_seconds: seconds,
            samples: sum(|p| p.samples),
            rays: sum(|p| p.rays),
            error,
            robust,
        }));
        state.paused += cpu_seconds().zip(now).map_or(0.0, |(b, a)| b - a);
    }
}

/// A finished render.
struct Run {
    seed: u64,
    pixels: f64,
    /// After each iteration.
    snapshots: Vec<Snapshot>,
    end: Snapshot,
    /// Cost is rays per pixel, not core-seconds.
    by_rays: bool,
}

impl Run {
    fn cost(&self) -> f64 {
        if self.by_rays { self.end.rays as f64 / self.pixels } else { self.end.core_seconds }
    }

    fn spp(&self) -> f64 {
        self.end.samples as f64 / self.pixels
    }

    /// Error x cost; in rays that is relative variance of a sample x its rays.
    fn product(&self) -> f64 {
        self.end.error * self.cost()
    }

    fn robust_product(&self) -> f64 {
        self.end.robust * self.cost()
    }

    fn time_to(&self, level: f64) -> Option<f64> {
        time_to(&self.snapshots.iter().map(|s| (s.core_seconds, s.error)).collect::<Vec<_>>(), level)
    }
}

fn render(subject: &Subject, strategy: &str, seed: u64, target: Target) -> Result<Run, Box<dyn Error>> {
    let scene = Scene::from_bytes(&subject.baked.bytes)?;
    let settings = Settings {
        size: [subject.image.width as u32, subject.image.height as u32],
        seed,
        shards: 16,
        strategy: Strategy::parse(strategy)?,
        ..Settings::for_scene(&scene)
    };
    let watch = Watch::start(&subject.image);
    drive_scene(scene, &Options { settings, target, threads: 1 }, &watch)?;
    let snapshots = watch.state.into_inner().unwrap_or_else(PoisonError::into_inner).snapshots;
    let snapshots = snapshots.into_iter().collect::<Result<Vec<_>, _>>()?;
    let end = *snapshots.last().ok_or("a render without an iteration")?;
    let pixels = subject.image.pixels.len() as f64;
    Ok(Run { seed, pixels, snapshots, end, by_rays: matches!(target, Target::Spp(_)) })
}

/// All renders of a scene: by strategy, then by seed.
struct Group {
    scene: String,
    noise: f64,
    runs: Vec<Vec<Run>>,
}

impl Group {
    fn render(subject: &Subject, strategies: &[String], args: &Args) -> Result<Self, String> {
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
                let name = format!("{}, {}", subject.name, strategies[s]);
                let seed = args.first_seed.wrapping_add(i as u64);
                let run =
                    render(subject, &strategies[s], seed, args.target()).map_err(|e| format!("{name}, {seed}: {e}"))?;
                let (e, spp) = (run.end, digits(run.spp()));
                eprintln!(
                    "{name}, seed {seed}: {spp} spp, {:.2} core-s, relMSE {}",
                    e.core_seconds,
                    digits(run.end.error)
                );
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

    /// Speed-up of a strategy over another, seed by seed.
    fn ratios(&self, strategy: usize, baseline: usize, product: fn(&Run) -> f64) -> Vec<f64> {
        self.runs[baseline].iter().zip(&self.runs[strategy]).map(|(b, s)| product(b) / product(s)).collect()
    }
}

/// The table's text for a median, `-` for none.
fn cell(median: Option<Median>) -> String {
    median.map_or("-".into(), |m| m.to_string())
}

/// Speed-ups are read with their unit.
fn times(median: Option<Median>) -> String {
    median.map_or("-".into(), |m| format!("{:.2}x [{:.2}, {:.2}]", m.median, m.low, m.high))
}

struct Report<'a> {
    args: &'a Args,
    strategies: Vec<String>,
    groups: Vec<Group>,
}

impl Report<'_> {
    fn head(&self) -> String {
        let what = match self.args.target() {
            Target::Spp(n) => format!("{n} samples per pixel each"),
            Target::Seconds(s) => format!("{} s each", digits(s)),
            _ => String::new(),
        };
        let n = self.args.seeds();
        format!(
            "# Error times cost\n\nMade by `cargo run --release -p croupier-benches --bin efficiency`; what the figures \
             are is said in `benches/src/bin/efficiency.rs`.\n{n} seeds, {what}. Intervals hold the true median with \
             {:.0} %.",
            100.0 * coverage(n as usize)
        )
    }

    fn baselines(&self) -> [Option<usize>; 2] {
        BASELINES.map(|b| self.strategies.iter().position(|s| s == b))
    }

    fn table(&self, g: &Group) -> String {
        let by_rays = self.args.equal_samples.is_some();
        let mut columns = vec!["strategy", "spp", "rays/sample"];
        let cost = if by_rays {
            columns.extend([
                "variance per sample",
                "without worst 0.1 %",
                "reference noise x spp",
                "1 / (variance x rays)",
            ]);
            ["over classic", "over adrrs"].as_slice()
        } else {
            columns.extend(["Mrays/s", "relMSE", "without worst 0.1 %", "reference noise", "relMSE x core-s"]);
            ["over classic", "over adrrs", "s to 0.1", "s to 0.03", "s to 0.01"].as_slice()
        };
        columns.extend(cost);
        let mut text = format!("\n## {}\n\n| {} |\n|{}\n", g.scene, columns.join(" | "), "---|".repeat(columns.len()));
        for (s, name) in self.strategies.iter().enumerate() {
            let of = |f: &dyn Fn(&Run) -> f64| Median::of(&g.runs[s].iter().map(f).collect::<Vec<_>>());
            let middle = |f: &dyn Fn(&Run) -> f64| of(f).map_or("-".into(), |m| digits(m.median));
            let mut cells = vec![name.clone(), middle(&Run::spp)];
            cells.push(middle(&|r| r.end.rays as f64 / r.end.samples as f64));
            if by_rays {
                cells.push(cell(of(&|r| r.end.error * r.spp())));
                cells.push(cell(of(&|r| r.end.robust * r.spp())));
                cells.push(middle(&|r| g.noise * r.spp()));
                cells.push(cell(of(&|r| 1.0 / r.product())));
            } else {
                cells.push(middle(&|r| r.end.rays as f64 * 1e-6 / r.end.core_seconds));
                cells.push(cell(of(&|r| r.end.error)));
                cells.push(middle(&|r| r.end.robust));
                cells.push(digits(g.noise));
                cells.push(cell(of(&Run::product)));
            }
            let over = |b: usize| Median::of(&g.ratios(s, b, Run::product));
            cells.extend(self.baselines().map(|b| times(b.and_then(over))));
            if !by_rays {
                // a seed that did not get there took longer than any that did
                let time = |level| of(&|r| r.time_to(level).unwrap_or(f64::INFINITY)).map(|m| m.median);
                let reached = |t: Option<f64>| t.filter(|t| t.is_finite()).map_or("-".into(), digits);
                cells.extend(LEVELS.map(|level| reached(time(level))));
            }
            text += &format!("| {} |\n", cells.join(" | "));
        }
        text
    }

    /// Speed-up over a baseline, geometric mean over the scenes.
    fn mean(&self, strategy: usize, baseline: usize, product: fn(&Run) -> f64) -> Option<Median> {
        let scenes: Vec<Vec<f64>> = self.groups.iter().map(|g| g.ratios(strategy, baseline, product)).collect();
        let of_seed = |i| geometric_mean(&scenes.iter().map(|s| s[i]).collect::<Vec<_>>());
        Median::of(&(0..self.args.seeds() as usize).map(of_seed).collect::<Vec<_>>())
    }

    fn means(&self, strategy: usize) -> [Option<Median>; 4] {
        let [classic, adrrs] = self.baselines();
        let mean = |b: Option<usize>, product| b.and_then(|b| self.mean(strategy, b, product));
        [
            mean(classic, Run::product),
            mean(adrrs, Run::product),
            mean(classic, Run::robust_product),
            mean(adrrs, Run::robust_product),
        ]
    }

    fn summary(&self) -> String {
        let mut text = format!(
            "\n## Geometric mean over {} scenes\n\n| strategy | over classic | over adrrs | over classic, without worst \
             0.1 % | over adrrs, without worst 0.1 % |\n|---|---|---|---|---|\n",
            self.groups.len()
        );
        for (s, name) in self.strategies.iter().enumerate() {
            text += &format!("| {name} | {} |\n", self.means(s).map(times).join(" | "));
        }
        text
    }

    fn json(&self) -> Value {
        let run = |r: &Run| {
            json!({
                "seed": r.seed, "spp": r.spp(), "end": r.end.json(), "product": r.product(),
                "product_robust": r.robust_product(), "seconds_to": LEVELS.map(|l| r.time_to(l)),
                "snapshots": r.snapshots.iter().map(Snapshot::json).collect::<Vec<_>>(),
            })
        };
        let median = |m: Option<Median>| m.map(|m| [m.median, m.low, m.high]);
        let row = |g: &Group, s: usize| {
            let over = |b: usize| median(Median::of(&g.ratios(s, b, Run::product)));
            json!({
                "strategy": self.strategies[s], "runs": g.runs[s].iter().map(run).collect::<Vec<_>>(),
                "over": self.baselines().map(|b| b.and_then(over)),
            })
        };
        let rows = |g: &Group| (0..self.strategies.len()).map(|s| row(g, s)).collect::<Vec<_>>();
        let group = |g: &Group| json!({ "scene": g.scene, "reference_noise": g.noise, "strategies": rows(g) });
        let mean = |s: usize| json!({ "strategy": self.strategies[s], "over": self.means(s).map(median) });
        json!({
            "equal_samples": self.args.equal_samples, "seeds": self.args.seeds(), "coverage": coverage(self.args.seeds() as usize),
            "baselines": BASELINES, "levels": LEVELS, "scenes": self.groups.iter().map(group).collect::<Vec<_>>(),
            "geometric_means": (0..self.strategies.len()).map(mean).collect::<Vec<_>>(),
        })
    }
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut report = Report { args, strategies: args.strategies()?, groups: Vec::new() };
    println!("{}", report.head());
    for name in &args.only {
        let subject = Subject::open(&args.scenes, name).map_err(|e| format!("{name}: {e}"))?;
        let group = Group::render(&subject, &report.strategies, args)?;
        print!("{}", report.table(&group));
        report.groups.push(group);
        if let Some(path) = &args.json {
            std::fs::write(path, report.json().to_string()).map_err(|e| format!("{}: {e}", path.display()))?;
        }
    }
    print!("{}", report.summary());
    Ok(())
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("efficiency: {e}");
            ExitCode::FAILURE
        }
    }
}
