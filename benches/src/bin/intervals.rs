//! Whether the stated error of a picture and its interval hold: many renders that differ in nothing but the seed have the
//! truth in themselves.
//!
//! For each scene, number of samples and strategy: the expectation of the relMSE, from the squared differences of all
//! renders from their mean; of how many renders the error is resolved, and of those, the stated relMSE over the true one
//! and how many of the stated 95 % intervals hold it. Fails if fewer than nine in ten of all do.

use clap::Parser;
use croupier::{ErrorEstimate, Scene, Settings, Strategy};
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::digits;
use croupier_benches::subject::Subject;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::drive::{Rendered, Unobserved};
use croupier_host::render::{RenderOptions, Target, render_part};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "How often the interval of the stated error holds the true one")]
struct Args {
    /// Scenes: `built-in`, or folders within `--scenes`.
    #[arg(default_values_t = ["built-in".to_string(), "cbox".into(), "pool".into(), "veach_mis".into()])]
    names: Vec<String>,
    /// Folder with the scenes; what is not there is skipped.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"))]
    scenes: PathBuf,
    /// Samples per pixel.
    #[arg(long, value_delimiter = ',', default_values_t = [8, 32])]
    spp: Vec<u32>,
    /// Strategies.
    #[arg(long, value_delimiter = ',', default_values_t = ["classic".to_string(), "ears".into()])]
    strategies: Vec<String>,
    /// Renders of each row.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(2..))]
    seeds: u32,
    /// Columns and rows of the pictures.
    #[arg(long, default_value_t = 96)]
    size: u32,
    /// Write mean and variance of every pixel and channel of each render here, as f64.
    #[arg(long)]
    dump: Option<PathBuf>,
    /// Write benches/results/intervals.md.
    #[arg(long)]
    write: bool,
}

const NAME: &str = "intervals";
/// Part of the resolved intervals that must hold.
const ENOUGH: f64 = 0.9;
/// Constant in the denominator of relMSE.
const EPSILON: f64 = croupier::unstable::film::REL_MSE_EPSILON;

fn blob(name: &str, args: &Args) -> Result<Option<AlignedBytes>, Box<dyn Error>> {
    if name == "built-in" {
        return Ok(Some(bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {})?.bytes));
    }
    if !args.scenes.join(name).is_dir() {
        eprintln!("{NAME}: no scene {name} in {}, skipped", args.scenes.display());
        return Ok(None);
    }
    Ok(Some(Subject::open(&args.scenes, name)?.baked.bytes))
}

/// Renders of one number of samples and one strategy.
struct Row {
    spp: u32,
    strategy: String,
    /// Means of every pixel and channel.
    pictures: Vec<Vec<f64>>,
    stated: Vec<ErrorEstimate>,
}

impl Row {
    /// Expectation of the relMSE of the pictures, and its standard error.
    fn truth(&self, denominators: &[f64]) -> [f64; 2] {
        let s = self.pictures.len() as f64;
        let mut each = vec![0.0; self.pictures.len()];
        for (i, denominator) in denominators.iter().enumerate() {
            let mean = self.pictures.iter().map(|p| p[i]).sum::<f64>() / s;
            for (e, p) in each.iter_mut().zip(&self.pictures) {
                *e += (p[i] - mean) * (p[i] - mean) / denominator * s / (s - 1.0) / denominators.len() as f64;
            }
        }
        let mean = each.iter().sum::<f64>() / s;
        let variance = each.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / (s - 1.0) / s;
        [mean, variance.sqrt()]
    }
}

/// What relMSE divides by, from all renders of a scene: those of a row alone would leave so much noise in it that the
/// truth of few samples would be too large.
fn denominators(rows: &[Row]) -> Vec<f64> {
    let samples = |r: &Row| f64::from(r.spp) * r.pictures.len() as f64;
    let all: f64 = rows.iter().map(samples).sum();
    let mut means = vec![0.0; rows[0].pictures[0].len()];
    for r in rows {
        for p in &r.pictures {
            means.iter_mut().zip(p).for_each(|(m, x)| *m += f64::from(r.spp) / all * x);
        }
    }
    means.into_iter().map(|m| m * m + EPSILON).collect()
}

/// Renders with one seed.
fn rendered(scene: Scene<'_>, strategy: &str, spp: u32, seed: u32, size: u32) -> Result<Rendered, Box<dyn Error>> {
    let options = RenderOptions::new(Strategy::parse(strategy)?);
    let settings = Settings { size: [size; 2], seed: seed.into(), aovs: false.into(), ..options.settings };
    let options = RenderOptions { settings, target: Target::Spp(spp), ..options };
    Ok(render_part(scene, &options, &Unobserved)?.0)
}

/// Writes what was stated, and mean and variance of every pixel and channel.
fn dump(file: &Path, r: &Rendered) -> Result<(), Box<dyn Error>> {
    let mut out = BufWriter::new(File::create(file)?);
    let e = r.error;
    let pixels = r.pixels.iter().flat_map(|p| [p.mean(), p.variance_of_mean()]).flatten();
    for x in [e.rel_mse, e.low, e.high, e.independence, e.effective_pixels].into_iter().chain(pixels) {
        out.write_all(&x.to_le_bytes())?;
    }
    Ok(())
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let columns = "scene, samples per pixel, strategy, true relMSE, its standard error, stated / true, resolved, \
                   intervals that hold";
    let mut table = Table::new("", columns);
    let (mut held, mut resolved) = (0, 0);
    for name in &args.names {
        let Some(bytes) = blob(name, args)? else { continue };
        let scene = Scene::from_bytes(&bytes)?;
        let mut rows = Vec::new();
        for &spp in &args.spp {
            for strategy in &args.strategies {
                let mut row = Row { spp, strategy: strategy.clone(), pictures: vec![], stated: vec![] };
                for i in 0..args.seeds {
                    // no two rows share samples
                    let seed = 1 + i + rows.len() as u32 * args.seeds;
                    let r = rendered(scene, strategy, spp, seed, args.size)?;
                    row.pictures.push(r.pixels.iter().flat_map(|p| p.mean()).collect::<Vec<_>>());
                    row.stated.push(r.error);
                    if let Some(folder) = &args.dump {
                        dump(&folder.join(format!("{name}-{spp}-{strategy}-{i}.f64")), &r)?;
                    }
                }
                rows.push(row);
            }
        }
        let denominators = denominators(&rows);
        for r in rows {
            let [error, noise] = r.truth(&denominators);
            let told: Vec<_> = r.stated.iter().filter(|e| e.is_resolved()).collect();
            let hold = told.iter().filter(|e| e.low <= error && error <= e.high).count();
            (held, resolved) = (held + hold, resolved + told.len());
            let mean = told.iter().map(|e| e.rel_mse).sum::<f64>() / told.len() as f64;
            let ratio = if told.is_empty() { "-".into() } else { format!("{:.2}", mean / error) };
            let counts = [format!("{} of {}", told.len(), r.stated.len()), format!("{hold} of {}", told.len())];
            let row: Vec<String> = [name.clone(), r.spp.to_string(), r.strategy, digits(error), digits(noise), ratio]
                .into_iter()
                .chain(counts)
                .collect();
            println!("{}", row.join(", "));
            table.add(row);
        }
    }
    println!("{held} of {resolved} resolved intervals hold");
    if args.write {
        let mut results = Results::of_this_run(NAME);
        results.header.push(("picture".into(), format!("{0} x {0} pixels, {1} seeds", args.size, args.seeds)));
        results.header.push(("intervals".into(), format!("{held} of {resolved} that are resolved hold")));
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(held as f64 >= ENOUGH * resolved as f64)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
