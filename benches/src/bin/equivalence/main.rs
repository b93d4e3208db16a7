//! Do roulette and splitting leave the picture's mean alone on real scenes? Equivalence tests (two one-sided tests,
//! TOST) of every unbiased strategy against renders without roulette, both with the same `max_depth`: is the mean over
//! pixels and channels the same within 0.2 %? A bias of 0.2 % passes with a probability of 5 % at most, one of 0.3 %
//! with less than 1e-3; a row whose standard error is above [`MAX_ERROR`] fails, as it could not tell.
//!
//! A row is the mean over renders with different seeds. Its standard error comes from their spread, since the samples
//! of a render that learns hang together. Pictures are small, because bias does not depend on size; geometry, materials
//! and lights are the scene's own. Noise that both sides share is taken out; this does not change the expectation of
//! their difference:
//!
//! - Every render has a partner without roulette and with the same seed: their paths begin alike.
//! - Where adaptive sampling gives pixels different numbers of samples, light that the camera sees directly differs all
//!   the same: the same render with `max_depth` 1 is subtracted on both sides.
//!
//! How many seeds a row takes follows from a pilot with other seeds. A row that is not decided (or noisier than its
//! pilot said) is rendered once more, longer, with new seeds, and they alone count. `threshold` is biased: its row is
//! there to show that bias is found.
//!
//! `--write` puts a run of all rows into `benches/results/equivalence.md`; its figures depend on nothing but the
//! program and the scenes. In the table a star says that the noisiest pixels are left out; splits, paths that roulette
//! ended and factors that were limited because the ring was full are per camera sample. Exit status: 0 all rows as they
//! should be, or the scenes are not there; 1 otherwise.

mod rows;

use clap::Parser;
use croupier::unstable::learn::Learning;
use croupier::{Counters, Settings, Strategy};
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::load::load;
use croupier_tests::media_scene::misty;
use croupier_tests::runner::{Image, Learned, Schedule, learning, poison, settings};
use croupier_tests::stats::{Mean, SplitMix, equivalent};
use std::collections::HashMap;
use std::error::Error;
use std::num::NonZero;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use rows::{MISTY, Row, SCENES, Trial};

const NAME: &str = "equivalence";
const COLUMNS: &str =
    "scene, strategy, max depth, seeds, difference, standard error, Mrays, splits, terminated, limited, verdict";

/// Half-width of what counts as equal, relative to the mean.
const DELTA: f64 = 0.002;
/// Chance that one round calls equal what differs by [`DELTA`]; there are two rounds.
const ALPHA: f64 = 0.025;
/// Largest standard error of a row, relative to the mean.
const MAX_ERROR: f64 = 0.0006;
/// Standard errors to aim at: with few rays, in the first round and in the second.
const AIMS: [f64; 3] = [0.0003, 0.0005, 0.000_35];
/// Rays that count as few, millions.
const FEW_MRAYS: f64 = 40.0;
/// Seeds of a pilot.
const PILOT: u64 = 48;
/// Fewest and most seeds of a round: the spread of fewer says little.
const SEEDS: [u64; 2] = [64, 20_000];
/// First seeds of the pilot, of the rounds, of sessions whose cache another one loads, of what finds noisy pixels.
const STREAMS: [u64; 5] = [0, 1 << 32, 2 << 32, 3 << 32, 4 << 32];
/// Part of the pixels that rows with `calm` leave out: glints of small lights hold 1 % of the light and nearly all of
/// the noise, and would take a hundred times as many samples.
const NOISY: f64 = 1.0 / 24.0;
/// One thread renders one picture.
const IN_ORDER: Schedule = Schedule::InOrder(1 << 20);

#[derive(Parser)]
#[command(about = "Tests on the shared scenes that roulette and splitting do not change the mean")]
struct Args {
    /// Folder of the scenes.
    #[arg(long, default_value = "../shared/scenes")]
    scenes: PathBuf,
    /// Only these scenes.
    #[arg(long = "scene", value_name = "NAME")]
    only: Vec<String>,
    /// Only rows whose strategy begins so.
    #[arg(long, value_name = "NAME", default_value = "")]
    strategy: String,
    /// The rows that CI runs.
    #[arg(long)]
    quick: bool,
    /// Leave no pixel out: hours.
    #[arg(long)]
    all_pixels: bool,
    /// Threads; 0 takes one per processor. Does not change the figures.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Write benches/results/equivalence.md; needs every row.
    #[arg(long, conflicts_with_all = ["only", "strategy", "quick", "all_pixels"])]
    write: bool,
}

/// What counts of a render.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    /// Mean over pixels and channels.
    mean: f64,
    /// The same at `max_depth` 1.
    direct: f64,
    counters: Counters,
    /// Largest share of samples that a guide took.
    guided: f64,
}

/// What partners share: depth, iterations, whether noisy pixels are left out, and the first seed.
type Key = (u32, &'static [u32], bool, u64);

/// A scene that is rendered small.
struct Place {
    blob: AlignedBytes,
    threads: usize,
    /// Renders without roulette that rows have in common, seed by seed.
    partners: HashMap<Key, Vec<Sample>>,
    /// Pixels that are not among the noisiest, by depth.
    calm: HashMap<u32, Vec<bool>>,
}

impl Place {
    fn open(scenes: &Path, name: &str, size: [u32; 2], threads: usize) -> Result<Self, Box<dyn Error>> {
        let mut scene = if name == MISTY { misty(size) } else { load(&scenes.join(name))?.0 };
        scene.camera.size = size;
        let blob = bake(&scene, &BakeOptions::default(), |_, _| ())?.bytes;
        Ok(Self { blob, threads, partners: HashMap::new(), calm: HashMap::new() })
    }

    /// One render as the row's trial wants it, and the largest share of samples that a guide took.
    fn render(&self, row: &Row, depth: u32, seed: u64) -> (Image, f64) {
        let s = settings(&self.blob, row.strategy);
        // statistics of a size that suits small pictures
        let small = Learning { cache_bytes: 1 << 20, subdivide_count: 2000.0, ..s.learning };
        let mut s = Settings { seed, max_depth: depth, learning: small, ..s };
        row.trial.set(&mut s);
        let mut saved = Vec::new();
        if row.trial == Trial::Reloaded {
            let mut save = |_, l: &mut dyn Learned| saved = l.saved().expect("a strategy with a cache");
            learning(&self.blob, &Settings { seed: seed + STREAMS[3], ..s }, &[2, 2, 4, 1], IN_ORDER, &mut save);
        }
        let (mut rng, mut guided) = (SplitMix(seed), 0.0f64);
        let image = learning(&self.blob, &s, row.iterations, IN_ORDER, &mut |i, l: &mut dyn Learned| match row.trial {
            Trial::Reloaded if i % 2 == 0 => l.load(&saved).expect("statistics of this scene"),
            Trial::Poisoned if i > 0 => poison(l, &mut rng),
            Trial::Guided | Trial::Thinned => guided = guided.max(l.guide().map_or(0.0, |g| g.1)),
            _ => {}
        });
        (image, guided)
    }

    fn sample(&self, row: &Row, seed: u64) -> Sample {
        let mean = |image: &Image| match self.calm.get(&row.depth).filter(|_| row.calm) {
            None => image.mean(),
            Some(calm) => {
                let pixels = image.pixels.iter().zip(calm).filter(|p| *p.1);
                pixels.flat_map(|p| p.0.mean()).sum::<f64>() / (3 * calm.iter().filter(|c| **c).count()) as f64
            }
        };
        let (image, guided) = self.render(row, row.depth, seed);
        Sample { mean: mean(&image), direct: mean(&self.render(row, 1, seed).0), counters: image.counters, guided }
    }

    /// Finds the pixels that a row leaves out, from renders without roulette.
    fn find_noise(&mut self, row: &Row) {
        if !row.calm || self.calm.contains_key(&row.depth) {
            return;
        }
        let none = Row { strategy: "none", trial: Trial::None, iterations: &[64], ..*row };
        let images = each(self.threads, STREAMS[4]..STREAMS[4] + 128, |seed| self.render(&none, row.depth, seed).0);
        let pixels = 0..images.first().map_or(0, |i| i.pixels.len());
        let noise = |p: usize| images.iter().flat_map(|i| i.pixels[p].variance_of_mean()).sum::<f64>();
        let noise: Vec<f64> = pixels.map(noise).collect();
        let mut sorted = noise.clone();
        sorted.sort_by(f64::total_cmp);
        let bound = sorted[((1.0 - NOISY) * sorted.len() as f64) as usize];
        self.calm.insert(row.depth, noise.iter().map(|n| *n < bound).collect());
    }

    /// Renders `n` seeds of a stream and their partners.
    fn round(&mut self, row: &Row, stream: u64, n: u64) -> Round {
        self.find_noise(row);
        let none = Row { strategy: "none", trial: Trial::None, ..*row };
        let key = (row.depth, row.iterations, row.calm, stream);
        let mut partners = self.partners.remove(&key).unwrap_or_default();
        let missing = stream + partners.len() as u64..stream + n;
        partners.extend(each(self.threads, missing, |seed| self.sample(&none, seed)));
        let samples = each(self.threads, stream..stream + n, |seed| self.sample(row, seed));
        let mut round = Round::default();
        for (x, y) in samples.iter().zip(&partners) {
            round.add(x, y);
        }
        self.partners.insert(key, partners);
        round
    }

    /// Renders a row until it is decided.
    fn test(&mut self, row: &Row) -> Round {
        let pilot = self.round(row, STREAMS[0], PILOT);
        let few = pilot.seeds(AIMS[0]);
        let affordable = (FEW_MRAYS / pilot.mrays() * PILOT as f64) as u64;
        let n = pilot.seeds(AIMS[1]).max(few.min(affordable));
        let first = self.round(row, STREAMS[1], n.clamp(SEEDS[0], SEEDS[1]));
        if first.error() <= MAX_ERROR && (first.equal() || first.different()) {
            return first;
        }
        self.round(row, STREAMS[2], first.seeds(AIMS[2]).clamp(SEEDS[0], SEEDS[1]))
    }
}

/// The difference of a row from its partners.
#[derive(Default)]
struct Round {
    n: u64,
    difference: Mean,
    /// Of the partners, with all light.
    mean: Mean,
    counters: Counters,
    /// Largest share of samples that a guide took.
    guided: f64,
}

impl Round {
    fn add(&mut self, x: &Sample, y: &Sample) {
        self.n += 1;
        self.difference.add((x.mean - x.direct) - (y.mean - y.direct));
        self.mean.add(y.mean);
        self.counters.merge(&x.counters);
        self.guided = self.guided.max(x.guided);
    }

    fn value(&self) -> f64 {
        self.difference.mean() / self.mean.mean()
    }

    fn error(&self) -> f64 {
        self.difference.error() / self.mean.mean()
    }

    fn equal(&self) -> bool {
        equivalent(self.value(), self.error(), DELTA, ALPHA)
    }

    /// Is the difference larger than [`DELTA`] beyond doubt?
    fn different(&self) -> bool {
        self.value().abs() > DELTA + 4.0 * self.error()
    }

    fn mrays(&self) -> f64 {
        self.counters.rays() as f64 * 1e-6
    }

    /// Seeds for a standard error.
    fn seeds(&self, aim: f64) -> u64 {
        (self.n as f64 * (self.error() / aim).powi(2)).ceil() as u64
    }

    /// Is the row as it should be, and in which words?
    fn verdict(&self, row: &Row) -> (bool, &'static str) {
        let biased = is_biased(row.strategy);
        let tests = [
            (self.counters.non_finite == 0, "FAILS: not finite"),
            (row.trial.happened(&self.counters, self.guided), "FAILS: not what it says"),
            (self.error() <= MAX_ERROR, "FAILS: too noisy"),
            (biased || self.equal(), "FAILS: not equal"),
            (!biased || self.different(), "BIASED, BUT NOT FOUND"),
        ];
        let passed = if biased { "biased, and found" } else { "equal" };
        tests.iter().find(|t| !t.0).map_or((true, passed), |t| (false, t.1))
    }
}

fn is_biased(strategy: &str) -> bool {
    Strategy::parse(strategy).is_ok_and(|s| s.is_biased())
}

/// `f` of every seed, in their order, on some threads.
fn each<T: Send>(threads: usize, seeds: Range<u64>, f: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(seeds.start);
    let done = Mutex::new(Vec::new());
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                break;
            }
            let value = f(seed);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((seed, value));
        }
    };
    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(work))));
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|d| d.0);
    done.into_iter().map(|d| d.1).collect()
}

fn cells(scene: &str, row: &Row, round: &Round) -> [String; 11] {
    let c = &round.counters;
    let per_sample = |n: u64| n as f64 / c.camera_samples as f64;
    [
        scene.into(),
        format!("{}{}{}", row.strategy, row.trial.name(), if row.calm { " *" } else { "" }),
        row.depth.to_string(),
        round.n.to_string(),
        format!("{:+.3} %", 100.0 * round.value()),
        format!("{:.3} %", 100.0 * round.error()),
        format!("{:.0}", round.mrays()),
        format!("{:.2}", per_sample(c.splits)),
        format!("{:.2}", per_sample(c.paths_terminated)),
        format!("{:.3}", per_sample(c.splits_limited_by_ring)),
        round.verdict(row).1.into(),
    ]
}

/// Unbiased strategies without a row of this scene.
fn forgotten<'a>(rows: &'a [Row]) -> impl Iterator<Item = &'static str> + 'a {
    let named = |name: &str| rows.iter().any(|r| r.strategy.split(':').next() == Some(name));
    Strategy::TABLE.iter().map(|t| t.0).filter(move |name| *name != "none" && !is_biased(name) && !named(name))
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let start = Instant::now();
    let threads = match args.threads {
        0 => std::thread::available_parallelism().map_or(1, NonZero::get),
        n => n,
    };
    let mut results = Results::of_this_run(NAME);
    if let Some((name, ..)) = SCENES.iter().find(|s| args.write && s.0 != MISTY && !args.scenes.join(s.0).is_dir()) {
        return Err(format!("--write: there is no scene {name}").into());
    }
    let mut table = Table::new("", COLUMNS);
    print!("{}", table.head());
    let (mut good, mut all) = (0, 0);
    for (name, size, rows) in SCENES.iter().filter(|s| args.only.is_empty() || args.only.iter().any(|o| o == s.0)) {
        if let Some(strategy) = forgotten(rows).next() {
            return Err(format!("{name}: strategy `{strategy}` has no row").into());
        }
        let mut place = Place::open(&args.scenes, name, *size, threads).map_err(|e| format!("{name}: {e}"))?;
        for row in rows.iter().filter(|r| r.strategy.starts_with(&args.strategy) && (r.quick || !args.quick)) {
            let row = Row { calm: row.calm && !args.all_pixels, ..*row };
            let round = place.test(&row);
            table.add(cells(name, &row, &round));
            println!("{}", table.last());
            all += 1;
            good += u32::from(round.verdict(&row).0);
        }
        eprintln!("{name}: {:.0} s", start.elapsed().as_secs_f64());
    }
    println!("\n{good} of {all} rows as they should be.");
    if args.write {
        results.header.push(("rows as they should be".into(), format!("{good} of {all}")));
        results.tables.push(table);
        eprintln!("wrote {}", results.write(NAME)?.display());
    }
    Ok(good == all)
}

fn main() -> ExitCode {
    let args = Args::parse();
    if !args.scenes.is_dir() {
        println!("skipped: there is no folder {}", args.scenes.display());
        return ExitCode::SUCCESS;
    }
    exit_code(NAME, run(&args))
}
