//! Whether the stated error of a picture and its interval hold: many renders that differ in nothing but the seed have the
//! truth in themselves.
//!
//! For each scene, number of samples and strategy: the expectation of the relMSE, from the squared differences of all
//! renders from their mean; the stated relMSE over the true one and how many of the stated 95 % intervals hold it, of the
//! renders whose error is resolved; how many of them hold the error of their own picture, against the mean of all other
//! renders (a strategy that learns is worth more with one seed than with another, and pictures with a firefly have a
//! larger error than those without, so that the expectation may be far from the error of each); of the others, how many
//! true errors are as large as stated at least, and how many intervals would have missed, had they been given; and the
//! squared standard errors of single pixels over the true ones, both relative as relMSE is. Fails if fewer than nine in
//! ten of all resolved intervals hold the expectation, or the error of their picture.
//!
//! Renders with many samples are fewer: `--seeds` up to 32 samples per pixel, then in inverse proportion to the root of
//! the samples. With `--keep FILE` a run that was broken off goes on with the scenes that it has not finished.

use clap::Parser;
use croupier::{ErrorEstimate, Film, Scene, Settings, Strategy};
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::digits;
use croupier_benches::subject::Subject;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::drive::{Observer, Progress, Rendered};
use croupier_host::render::{RenderOptions, Target, render_part};
use serde::{Deserialize, Serialize};
use std::error::Error;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;

#[derive(Parser)]
#[command(about = "How often the interval of the stated error holds the true one")]
struct Args {
    /// Scenes: `built-in`, `still-life`, or folders within `--scenes`.
    #[arg(default_values_t = SCENES.map(String::from))]
    names: Vec<String>,
    /// Folder with the scenes; what is not there is skipped.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"))]
    scenes: PathBuf,
    /// Samples per pixel.
    #[arg(long, value_delimiter = ',', default_values_t = [8, 32, 128, 512])]
    spp: Vec<u32>,
    /// Strategies.
    #[arg(long, value_delimiter = ',', default_values_t = ["classic", "throughput", "adrrs", "ears"].map(String::from))]
    strategies: Vec<String>,
    /// Renders of each row, up to 32 samples per pixel.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(2..))]
    seeds: u32,
    /// Columns and rows of the pictures.
    #[arg(long, default_value_t = 96)]
    size: u32,
    /// Write what every iteration of each render states, and its mean and variance of every pixel and channel, here, as
    /// f32.
    #[arg(long)]
    dump: Option<PathBuf>,
    /// Keep the rows of finished scenes in this file, and take those that it has of the same commit and options.
    #[arg(long)]
    keep: Option<PathBuf>,
    /// Write benches/results/intervals.md.
    #[arg(long)]
    write: bool,
}

const NAME: &str = "intervals";
const SCENES: [&str; 9] =
    ["built-in", "still-life", "cbox", "pool", "veach_mis", "living_room", "bathroom", "kitchen", "white_furnace"];
const COLUMNS: &str = "scene, samples per pixel, strategy, seeds, true relMSE, its standard error, stated / true, \
                       hold the expectation, hold the own error, unresolved, at least as stated, would have missed, \
                       pixels' stated / true";
/// Part of the resolved intervals that must hold.
const ENOUGH: f64 = 0.9;
/// Constant in the denominator of relMSE.
const EPSILON: f64 = croupier::unstable::film::REL_MSE_EPSILON;
/// Samples per pixel from which on renders are fewer, and the fewest.
const MANY: u32 = 32;
const FEWEST: u32 = 8;

fn blob(name: &str, args: &Args) -> Result<Option<AlignedBytes>, Box<dyn Error>> {
    let built_in = match name {
        "built-in" => Some(builtin::cornell_box()),
        "still-life" => Some(builtin::showcase()),
        _ => None,
    };
    if let Some(scene) = built_in {
        return Ok(Some(bake(&scene, &BakeOptions::default(), |_, _| {})?.bytes));
    }
    if !args.scenes.join(name).is_dir() {
        eprintln!("{NAME}: no scene {name} in {}, skipped", args.scenes.display());
        return Ok(None);
    }
    Ok(Some(Subject::open(&args.scenes, name)?.baked.bytes))
}

/// Renders of a row.
fn seeds(args: &Args, spp: u32) -> u32 {
    let fewer = (f64::from(args.seeds) * (f64::from(MANY) / f64::from(spp)).sqrt().min(1.0)).round() as u32;
    fewer.max(FEWEST.min(args.seeds))
}

/// Renders of one number of samples and one strategy.
struct Row {
    spp: u32,
    strategy: String,
    /// Means of every pixel and channel.
    pictures: Vec<Vec<f64>>,
    /// Sums of the squared standard errors that are stated, of every pixel and channel.
    variances: Vec<f64>,
    stated: Vec<ErrorEstimate>,
}

/// Mean and variance of a pixel and channel over pictures.
fn moments(pictures: &[Vec<f64>], i: usize) -> [f64; 2] {
    let n = pictures.len() as f64;
    let mean = pictures.iter().map(|p| p[i]).sum::<f64>() / n;
    [mean, pictures.iter().map(|p| (p[i] - mean) * (p[i] - mean)).sum::<f64>() / (n - 1.0)]
}

impl Row {
    /// Expectation of the relMSE of the pictures, its standard error, and the stated relative variance of a pixel over the
    /// true one.
    fn truth(&self, denominators: &[f64]) -> [f64; 3] {
        let s = self.pictures.len() as f64;
        let (mut each, mut stated) = (vec![0.0; self.pictures.len()], 0.0);
        for (i, denominator) in denominators.iter().enumerate() {
            let [mean, _] = moments(&self.pictures, i);
            let scale = 1.0 / denominator / denominators.len() as f64;
            for (e, p) in each.iter_mut().zip(&self.pictures) {
                *e += (p[i] - mean) * (p[i] - mean) * s / (s - 1.0) * scale;
            }
            stated += self.variances[i] / s * scale;
        }
        let mean = each.iter().sum::<f64>() / s;
        let variance = each.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / (s - 1.0) / s;
        [mean, variance.sqrt(), stated / mean]
    }

    fn add(&mut self, r: &Rendered) {
        self.pictures.push(r.pixels.iter().flat_map(|p| p.mean()).collect());
        let variances = r.pixels.iter().flat_map(|p| {
            let factor = r.variance_factors.of(p);
            p.variance_of_mean().map(|v| factor * v)
        });
        self.variances.resize(3 * r.pixels.len(), 0.0);
        self.variances.iter_mut().zip(variances).for_each(|(sum, v)| *sum += v);
        self.stated.push(r.error);
    }

    /// relMSE of each picture against the mean of all others.
    fn own_errors(&self, all: &Reference) -> Vec<f64> {
        let own = f64::from(self.spp);
        let rest = all.samples - own;
        let one = |picture: &Vec<f64>| {
            let pixels = picture.iter().zip(&all.sums).zip(&all.denominators);
            let sum: f64 = pixels.map(|((x, sum), d)| (x - (sum - own * x) / rest).powi(2) / d).sum();
            // the reference has an error too; right on average, little of outliers if the others have many more samples
            sum / picture.len() as f64 * rest / all.samples
        };
        self.pictures.iter().map(one).collect()
    }

    fn judge(&self, scene: &str, all: &Reference) -> Judged {
        let [error, noise, pixels] = self.truth(&all.denominators);
        let holds = |e: &&ErrorEstimate| e.low <= error && error <= e.high;
        let own = self.own_errors(all);
        let hold_own =
            self.stated.iter().zip(&own).filter(|(e, own)| e.is_resolved() && e.low <= **own && **own <= e.high);
        let hold_own = hold_own.count();
        let (told, untold): (Vec<_>, Vec<_>) = self.stated.iter().partition(|e| e.is_resolved());
        let hold = told.iter().filter(|e| holds(e)).count();
        let mean = told.iter().map(|e| e.rel_mse).sum::<f64>() / told.len() as f64;
        let of = |n: usize, all: usize| if all == 0 { "-".into() } else { format!("{n} of {all}") };
        let cells = vec![
            scene.into(),
            self.spp.to_string(),
            self.strategy.clone(),
            self.stated.len().to_string(),
            digits(error),
            digits(noise),
            if told.is_empty() { "-".into() } else { format!("{:.2}", mean / error) },
            of(hold, told.len()),
            of(hold_own, told.len()),
            of(untold.len(), self.stated.len()),
            of(untold.iter().filter(|e| error >= e.at_least).count(), untold.len()),
            of(untold.iter().filter(|e| !holds(e)).count(), untold.len()),
            format!("{pixels:.2}"),
        ];
        Judged { cells, held: hold, held_own: hold_own, resolved: told.len() }
    }
}

/// A row of the table.
#[derive(Clone, Deserialize, Serialize)]
struct Judged {
    cells: Vec<String>,
    held: usize,
    held_own: usize,
    resolved: usize,
}

/// Rows of a finished scene.
#[derive(Deserialize, Serialize)]
struct Kept {
    /// Commit, options and scene.
    key: String,
    rows: Vec<Judged>,
}

/// Rows of a scene from an earlier run with the same key.
fn kept(file: &Path, key: &str) -> Option<Vec<Judged>> {
    let text = std::fs::read_to_string(file).ok()?;
    let mut all = text.lines().filter_map(|line| serde_json::from_str::<Kept>(line).ok());
    all.rfind(|k| k.key == key).map(|k| k.rows)
}

/// Truth from all renders of a scene.
struct Reference {
    /// Samples per pixel.
    samples: f64,
    /// Sums of samples of every pixel and channel.
    sums: Vec<f64>,
    /// What relMSE divides by: from the renders of a row alone there would be so much noise in it that the truth of few
    /// samples would be too large. What noise is left in the squared mean is taken off.
    denominators: Vec<f64>,
}

impl Reference {
    fn of(rows: &[Row]) -> Self {
        let samples: f64 = rows.iter().map(|r| f64::from(r.spp) * r.pictures.len() as f64).sum();
        let one = |i: usize| {
            let (mut sum, mut variance) = (0.0, 0.0_f64);
            for r in rows {
                let (n, [m, v]) = (f64::from(r.spp) * r.pictures.len() as f64, moments(&r.pictures, i));
                sum += n * m;
                variance += n * n * v / r.pictures.len() as f64;
            }
            let mean: f64 = sum / samples;
            (sum, (mean.powi(2) - variance / (samples * samples)).max(0.0) + EPSILON)
        };
        let (sums, denominators) = (0..rows[0].pictures[0].len()).map(one).unzip();
        Self { samples, sums, denominators }
    }
}

/// Renders with one seed.
fn rendered(scene: Scene<'_>, row: &Row, seed: u32, size: u32, dump: &Dump) -> Result<Rendered, Box<dyn Error>> {
    let options = RenderOptions::new(Strategy::parse(&row.strategy)?);
    let settings = Settings { size: [size; 2], seed: seed.into(), aovs: false.into(), ..options.settings };
    let options = RenderOptions { settings, target: Target::Spp(row.spp), ..options };
    Ok(render_part(scene, &options, dump)?.0)
}

/// Writes, after every iteration: samples, what was stated, mean and variance of every pixel and channel.
struct Dump(Option<Mutex<BufWriter<File>>>);

impl Dump {
    fn new(file: Option<PathBuf>) -> Result<Self, std::io::Error> {
        Ok(Self(file.map(File::create).transpose()?.map(|f| Mutex::new(BufWriter::new(f)))))
    }
}

impl Observer for Dump {
    fn progress(&self, _: &Progress) {}

    fn stop(&self) -> bool {
        false
    }

    fn iteration(&self, film: &Film<'_>, _: f64) {
        let Some(Ok(mut out)) = self.0.as_ref().map(Mutex::lock) else { return };
        let e = film.error_estimate();
        let samples = film.pixel(0).samples as f64;
        let stated = [samples, e.rel_mse, e.low, e.high, e.rel_mse_all, e.independence, e.effective_pixels];
        let pixels = film.pixels().flat_map(|p| [p.mean(), p.variance_of_mean()]).flatten();
        for x in stated.into_iter().chain(pixels) {
            if let Err(e) = out.write_all(&(x as f32).to_le_bytes()) {
                eprintln!("{NAME}: cannot write the dump: {e}");
                return;
            }
        }
    }
}

/// All rows of a scene.
fn measure(name: &str, bytes: &[u8], args: &Args) -> Result<Vec<Judged>, Box<dyn Error>> {
    let scene = Scene::from_bytes(bytes)?;
    let (mut rows, mut seed) = (Vec::new(), 0);
    for &spp in &args.spp {
        for strategy in &args.strategies {
            let (strategy, nothing) = (strategy.clone(), (vec![], vec![], vec![]));
            let mut row = Row { spp, strategy, pictures: nothing.0, variances: nothing.1, stated: nothing.2 };
            for i in 0..seeds(args, spp) {
                // no two rows share samples
                seed += 1;
                let file = |folder: &PathBuf| folder.join(format!("{name}-{spp}-{}-{i}.f32", row.strategy));
                let dump = Dump::new(args.dump.as_ref().map(file))?;
                row.add(&rendered(scene, &row, seed, args.size, &dump)?);
            }
            rows.push(row);
        }
    }
    let all = Reference::of(&rows);
    Ok(rows.iter().map(|r| r.judge(name, &all)).collect())
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let mut results = Results::of_this_run(NAME);
    let commit = results.header("commit").unwrap_or_default().to_string();
    let mut table = Table::new("", COLUMNS);
    let (mut held, mut held_own, mut resolved) = (0, 0, 0);
    for name in &args.names {
        let key = format!("{commit} {} {} {:?} {:?} {name}", args.size, args.seeds, args.spp, args.strategies);
        let known = args.keep.as_ref().and_then(|file| kept(file, &key));
        let rows = match known {
            Some(rows) => rows,
            None => {
                let Some(bytes) = blob(name, args)? else { continue };
                let rows = measure(name, bytes.as_ref(), args)?;
                if let Some(file) = &args.keep {
                    let line = serde_json::to_string(&Kept { key, rows: rows.clone() })?;
                    writeln!(OpenOptions::new().create(true).append(true).open(file)?, "{line}")?;
                }
                rows
            }
        };
        for row in rows {
            held += row.held;
            held_own += row.held_own;
            resolved += row.resolved;
            println!("{}", row.cells.join(", "));
            table.add(row.cells);
        }
    }
    let said =
        format!("of {resolved} that are resolved {held} hold the expectation, {held_own} the error of their picture");
    println!("intervals: {said}");
    if args.write {
        results.header.push(("picture".into(), format!("{0} x {0} pixels", args.size)));
        results.header.push(("intervals".into(), said));
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(held.min(held_own) as f64 >= ENOUGH * resolved as f64)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
