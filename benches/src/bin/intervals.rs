//! Whether the stated error of a picture and its interval hold: many renders that differ in nothing but the seed have the
//! truth in themselves.
//!
//! For each scene, number of samples and strategy: the expectation of the relMSE, from the squared differences of all
//! renders from their mean; the stated relMSE over it; and how many of the stated 95 % intervals hold it.

use clap::Parser;
use croupier::{Scene, Settings, Strategy};
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
use std::io::Write;
use std::path::PathBuf;
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

/// What all renders of a row say.
struct Truth {
    /// Expected relMSE, and its standard error.
    error: [f64; 2],
}

/// Expectation of the relMSE of these pictures, each a mean of every pixel and channel.
fn truth(pictures: &[Vec<f64>]) -> Truth {
    let s = pictures.len() as f64;
    let n = pictures[0].len();
    let mut each = vec![0.0; pictures.len()];
    for i in 0..n {
        let mean = pictures.iter().map(|p| p[i]).sum::<f64>() / s;
        let spread = pictures.iter().map(|p| (p[i] - mean) * (p[i] - mean)).sum::<f64>();
        let denominator = (mean * mean - spread / (s - 1.0) / s).max(0.0) + EPSILON;
        for (e, p) in each.iter_mut().zip(pictures) {
            *e += (p[i] - mean) * (p[i] - mean) / denominator * s / (s - 1.0) / n as f64;
        }
    }
    let mean = each.iter().sum::<f64>() / s;
    let variance = each.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / (s - 1.0) / s;
    Truth { error: [mean, variance.sqrt()] }
}

/// Renders with one seed.
fn rendered(scene: Scene<'_>, strategy: &str, spp: u32, seed: u32, size: u32) -> Result<Rendered, Box<dyn Error>> {
    let options = RenderOptions::new(Strategy::parse(strategy)?);
    let settings = Settings { size: [size; 2], seed: seed.into(), aovs: false.into(), ..options.settings };
    let options = RenderOptions { settings, target: Target::Spp(spp), ..options };
    Ok(render_part(scene, &options, &Unobserved)?.0)
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let columns =
        "scene, samples per pixel, strategy, true relMSE, its standard error, stated / true, intervals that hold";
    let mut table = Table::new("", columns);
    for name in &args.names {
        let Some(bytes) = blob(name, args)? else { continue };
        let scene = Scene::from_bytes(&bytes)?;
        for &spp in &args.spp {
            for strategy in &args.strategies {
                let mut pictures = Vec::new();
                let mut stated = Vec::new();
                for seed in 0..args.seeds {
                    let r = rendered(scene, strategy, spp, seed + 1, args.size)?;
                    pictures.push(r.pixels.iter().flat_map(|p| p.mean()).collect::<Vec<_>>());
                    stated.push(r.error);
                    if let Some(folder) = &args.dump {
                        let file = folder.join(format!("{name}-{spp}-{strategy}-{seed}.f64"));
                        let mut out = std::io::BufWriter::new(std::fs::File::create(file)?);
                        for x in [r.error.rel_mse, r.error.low, r.error.high, r.error.independence] {
                            out.write_all(&x.to_le_bytes())?;
                        }
                        for x in r.pixels.iter().flat_map(|p| [p.mean(), p.variance_of_mean()]).flatten() {
                            out.write_all(&x.to_le_bytes())?;
                        }
                    }
                }
                let Truth { error: [error, noise] } = truth(&pictures);
                let mean = stated.iter().map(|e| e.rel_mse).sum::<f64>() / stated.len() as f64;
                let hold = stated.iter().filter(|e| e.low <= error && error <= e.high).count();
                let held = format!("{hold} of {}", stated.len());
                let figures = [digits(error), digits(noise), format!("{:.2}", mean / error), held];
                let row = [name.clone(), spp.to_string(), strategy.clone()].into_iter().chain(figures);
                let row: Vec<String> = row.collect();
                println!("{}", row.join(", "));
                table.add(row);
            }
        }
    }
    if args.write {
        let mut results = Results::of_this_run(NAME);
        results.header.push(("picture".into(), format!("{0} x {0} pixels, {1} seeds", args.size, args.seeds)));
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
