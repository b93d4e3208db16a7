//! Variance of pixels with Sobol' points against hashed numbers, at equal samples per pixel.
//!
//! A row renders a scene small, with the program's own schedule of iterations, with both samplers and many seeds. The
//! variance of a pixel is that of its mean between seeds, over its squared mean (plus 0.01), which needs no reference;
//! the same worst pixels are left out on both sides. `gain` is the ratio, hashed over Sobol', with its 95 % interval by
//! the jackknife over seeds. `stated` is the film's own estimate of relMSE over what is found, all pixels counted: 1 if
//! the error that a render states is the true one.

use clap::Parser;
use croupier::unstable::Sampler;
use croupier::{Scene, Settings, Strategy};
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::drive::{Options, Rendered, Target, Unobserved, drive};
use croupier_host::load::load;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Variance of the samplers at equal samples")]
struct Args {
    /// Folder of the scenes besides the built-in one; what is not there is skipped.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"))]
    scenes: PathBuf,
    /// Only these scenes.
    #[arg(long = "scene", value_name = "NAME")]
    only: Vec<String>,
    /// Only these strategies.
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_values = ["classic", "ears"])]
    strategy: Vec<String>,
    /// Samples per pixel.
    #[arg(long, value_name = "N", value_delimiter = ',', default_values_t = [16, 64, 256])]
    spp: Vec<u32>,
    /// Pixels of a picture, about.
    #[arg(long, default_value_t = 768.0)]
    pixels: f64,
    /// Renders of each sampler.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u64).range(3..))]
    seeds: u64,
    /// Share of the worst pixels that is left out.
    #[arg(long, default_value_t = 0.005)]
    trim: f64,
    /// Threads; 0 takes one per processor.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Write benches/results/samplers.md.
    #[arg(long, conflicts_with_all = ["only"])]
    write: bool,
}

const NAME: &str = "samplers";
const BUILT_IN: &str = "built-in";
const SCENES: [&str; 8] =
    [BUILT_IN, "cbox", "living_room", "kitchen", "bathroom", "veach_mis", "pool", "water_caustic"];
const COLUMNS: &str = "scene, strategy, samples per pixel, gain, low, high, stated hashed, stated sobol";

/// Relative variance of every pixel between renders, without render `without`.
fn variances(renders: &[Rendered], without: Option<usize>) -> Vec<f64> {
    let used: Vec<&Rendered> =
        renders.iter().enumerate().filter(|(i, _)| Some(*i) != without).map(|(_, r)| r).collect();
    let n = used.len() as f64;
    let channel = |i: usize, c: usize| {
        let mean = used.iter().map(|r| r.pixels[i].mean()[c]).sum::<f64>() / n;
        let spread = used.iter().map(|r| (r.pixels[i].mean()[c] - mean).powi(2)).sum::<f64>();
        spread / (n - 1.0) / (mean * mean + 0.01)
    };
    let pixels = used.first().map_or(0, |r| r.pixels.len());
    (0..pixels).map(|i| (channel(i, 0) + channel(i, 1) + channel(i, 2)) / 3.0).collect()
}

/// Sums of both samplers' variances over the pixels that are kept.
fn sums([a, b]: [&[f64]; 2], kept: &[bool]) -> [f64; 2] {
    [a, b].map(|v| v.iter().zip(kept).filter(|p| *p.1).map(|p| p.0).sum::<f64>())
}

/// Pixels that are not among the worst of both samplers together.
fn kept([a, b]: [&[f64]; 2], trim: f64) -> Vec<bool> {
    let both: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + b).collect();
    let mut sorted = both.clone();
    sorted.sort_by(f64::total_cmp);
    let last = (((1.0 - trim) * sorted.len() as f64).ceil() as usize).clamp(1, sorted.len()) - 1;
    both.iter().map(|x| *x <= sorted[last]).collect()
}

fn row(blob: &[u8], strategy: &str, spp: u32, args: &Args) -> Result<[f64; 5], Box<dyn Error>> {
    let scene = Scene::from_bytes(blob)?;
    let [width, height] = scene.camera.size.map(f64::from);
    let scale = (args.pixels / (width * height)).sqrt();
    let size = [width, height].map(|x| (x * scale).round().max(1.0) as u32);
    let base = Settings { size, strategy: Strategy::parse(strategy)?, shards: 2, ..Settings::for_scene(&scene) };
    let renders = |sampler| {
        let render = |seed| {
            let settings = Settings { seed, sampler, ..base };
            let options = Options { threads: args.threads, ..Options::new(settings, Target::Spp(spp)) };
            drive(blob, &options, &Unobserved)
        };
        (0..args.seeds).map(render).collect::<Result<Vec<_>, _>>()
    };
    let (hashed, sobol) = (renders(Sampler::Hashed)?, renders(Sampler::Sobol)?);
    let [a, b] = [&hashed, &sobol].map(|r| variances(r, None));
    let kept = kept([&a, &b], args.trim);
    let gain = |[a, b]: [f64; 2]| (a / b).ln();
    let all = gain(sums([&a, &b], &kept));
    // seeds of the two sides are independent: each is left out in turn
    let spread = |of: usize| {
        let one = |i: usize| {
            let mut v = [a.clone(), b.clone()];
            v[of] = variances(if of == 0 { &hashed } else { &sobol }, Some(i));
            (gain(sums([&v[0], &v[1]], &kept)) - all).powi(2)
        };
        let n = args.seeds as f64;
        (0..args.seeds as usize).map(one).sum::<f64>() * (n - 1.0) / n
    };
    let error = 1.96 * (spread(0) + spread(1)).sqrt();
    let stated = |renders: &[Rendered], found: &[f64]| {
        let stated = renders.iter().map(|r| r.error.rel_mse_all).sum::<f64>() / renders.len() as f64;
        stated / (found.iter().sum::<f64>() / found.len() as f64)
    };
    Ok([all.exp(), (all - error).exp(), (all + error).exp(), stated(&hashed, &a), stated(&sobol, &b)])
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut results = Results::of_this_run(NAME);
    let facts = format!("{} pixels, {} seeds, {} % of the pixels left out", args.pixels, args.seeds, 100.0 * args.trim);
    results.header.push(("renders".into(), facts));
    let mut table = Table::new("", COLUMNS);
    print!("{}", table.head());
    for name in SCENES {
        let wanted = args.only.is_empty() || args.only.iter().any(|only| only == name);
        if !wanted || name != BUILT_IN && !args.scenes.join(name).exists() {
            continue;
        }
        let scene = if name == BUILT_IN { builtin::cornell_box() } else { load(&args.scenes.join(name))?.0 };
        let blob = bake(&scene, &BakeOptions::default(), |_, _| ())?.bytes;
        for strategy in &args.strategy {
            for spp in &args.spp {
                let figures = row(&blob, strategy, *spp, args)?.map(|x| format!("{x:.2}"));
                table.add([name.to_string(), strategy.clone(), spp.to_string()].into_iter().chain(figures));
                println!("{}", table.last());
            }
        }
    }
    results.tables.push(table);
    if args.write {
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()).map(|()| true))
}
