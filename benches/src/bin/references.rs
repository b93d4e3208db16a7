//! Is the picture right? Renders the shared test scenes with every strategy and tests them for bias against references of
//! another renderer.
//!
//! Per scene and strategy, independent seeds are rendered in this process (the scene is loaded and baked once) and their
//! mean, with the standard error that follows from their spread, is compared with `reference.exr`, whose standard error
//! is `reference_stderr.exr`. Block means of 8x8 pixels give z-scores with both errors in quadrature
//! ([`croupier_host::compare::bias`], the firefly-robust kind). A row passes if
//!
//! - at most 2 % of the scores are beyond 3,
//! - their mean lies within +-0.15,
//! - none is beyond 6 that [`NOTES`] does not explain,
//! - the mean of the image is within 0.5 % or 3 standard errors of the reference's.
//!
//! Biased strategies must fail: rows of [`Plan::biased`] pass if the test notices.
//!
//! Exit status: 0 all as expected or the scenes are not there, 1 otherwise.

use clap::Parser;
use croupier::{Scene, Settings, Strategy};
use croupier_host::bake::{BakeOptions, Baked, bake};
use croupier_host::compare::{Bias, BiasOptions, BlockZ, Estimate, Ratio, bias, ratio};
use croupier_host::drive::{Options, Unobserved, drive_scene};
use croupier_host::image::{Picture, Rgb};
use croupier_host::load::load;
use croupier_host::render::Target;
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

#[derive(Parser)]
#[command(about = "Tests renders of the shared scenes for bias against their references")]
struct Args {
    /// Folder of the scenes.
    #[arg(long, default_value = "../shared/scenes")]
    scenes: PathBuf,
    /// Only these scenes.
    #[arg(long = "scene", value_name = "NAME")]
    only: Vec<String>,
    /// Only these strategies (any that `croupier render --rrs` knows), expected to be unbiased.
    #[arg(long = "strategy", value_name = "NAME")]
    strategies: Vec<String>,
    /// Independent seeds per row.
    #[arg(long, default_value_t = 16)]
    seeds: u32,
    /// Number of the first seed.
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Multiplies the samples per pixel of every row.
    #[arg(long, default_value_t = 1.0)]
    effort: f64,
    /// Half the samples, and few strategies.
    #[arg(long)]
    quick: bool,
    /// Threads; 0 takes one per processor.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// One JSON document instead of the table.
    #[arg(long)]
    json: bool,
    /// Also write the mean over the seeds of every row, with its standard error, as an EXR file into this folder.
    #[arg(long, value_name = "FOLDER")]
    save: Option<PathBuf>,
}

/// Scenes, and samples per pixel and seed: what gives each about the same time.
const SCENES: &[(&str, f64)] = &[
    ("cbox", 16.0),
    ("kitchen", 16.0),
    ("bathroom", 16.0),
    ("living_room", 16.0),
    ("pool", 16.0),
    ("water_caustic", 16.0),
    ("veach_mis", 16.0),
    ("white_furnace", 16.0),
    ("material_spheres", 16.0),
];

/// One row of the table for every scene.
struct Plan {
    strategy: &'static str,
    /// Path segments; the scene's own (40) if absent.
    depth: Option<u32>,
    split_budget: u32,
    /// Samples per pixel relative to [`SCENES`]: split samples cost more each.
    effort: f64,
    quick: bool,
    /// Scenes in which the bias must show; empty if there must be none in any.
    biased: &'static [&'static str],
}

impl Plan {
    const fn unbiased(strategy: &'static str) -> Self {
        Self { strategy, depth: None, split_budget: 4096, effort: 1.0, quick: false, biased: &[] }
    }
}

/// Splitting without a bound doubles the work 39 times: a few splits per camera sample are enough to test it.
const FEW_SPLITS: u32 = 6;

const PLANS: &[Plan] = &[
    Plan::unbiased("contribution"),
    Plan::unbiased("throughput"),
    Plan::unbiased("throughput:luminance"),
    Plan::unbiased("throughput:mean"),
    Plan::unbiased("albedo"),
    Plan { quick: true, ..Plan::unbiased("classic") },
    Plan::unbiased("fixed:0.7"),
    Plan { quick: true, split_budget: FEW_SPLITS, effort: 0.25, ..Plan::unbiased("fixed:2") },
    Plan { depth: Some(40), ..Plan::unbiased("none") },
    Plan { quick: true, biased: INDIRECT, ..Plan::unbiased("threshold") },
    Plan { quick: true, biased: INDIRECT, depth: Some(3), ..Plan::unbiased("none") },
];

/// Scenes whose light takes enough bounces.
const INDIRECT: &[&str] = &["cbox", "kitchen", "bathroom", "living_room"];

/// Blocks whose scores may be beyond 6, and why: scene, first column, first row, reason.
const NOTES: &[(&str, usize, usize, &str)] = &[];

const MAX_BEYOND3: f64 = 0.02;
const MAX_MEAN: f64 = 0.15;
const MAX_RATIO: f64 = 0.005;

/// A finished row.
struct Row {
    scene: String,
    strategy: String,
    /// The bias must show.
    biased: bool,
    spp: u32,
    seeds: u32,
    seconds: f64,
    mrays: f64,
    ratio: Ratio,
    bias: Bias,
    /// Blocks beyond 6 without a note.
    unexplained: usize,
    /// Which of the four tests fail.
    failed: Vec<&'static str>,
}

impl Row {
    fn as_expected(&self) -> bool {
        self.failed.is_empty() != self.biased
    }

    fn verdict(&self) -> String {
        match (self.failed.is_empty(), self.biased) {
            (true, false) => "passes".into(),
            (false, true) => format!("fails, as it must ({})", self.failed.join(", ")),
            (true, true) => "PASSES, BUT IS BIASED".into(),
            (false, false) => format!("FAILS: {}", self.failed.join(", ")),
        }
    }

    fn json(&self) -> Value {
        json!({
            "scene": self.scene, "strategy": self.strategy, "biased": self.biased, "spp": self.spp,
            "seeds": self.seeds, "seconds": self.seconds, "mrays": self.mrays, "ratio": self.ratio,
            "bias": self.bias, "unexplained": self.unexplained, "failed": self.failed,
            "as_expected": self.as_expected(),
        })
    }
}

/// A scene with its reference.
struct Subject {
    name: String,
    spp: f64,
    baked: Baked,
    reference: Estimate,
}

impl Subject {
    fn open(folder: &Path, name: &str, spp: f64) -> Result<Self, Box<dyn Error>> {
        let folder = folder.join(name);
        let (scene, _) = load(&folder)?;
        let baked = bake(&scene, &BakeOptions::default(), |_, _| ())?;
        let image = Rgb::read_exr(&folder.join("reference.exr"))?;
        let stderr = Rgb::read_exr(&folder.join("reference_stderr.exr"))?;
        Ok(Self { name: name.into(), spp, baked, reference: Estimate::from_image(&image, Some(&stderr))? })
    }

    fn test(&self, args: &Args, plan: &Plan, strategy: &str) -> Result<Row, Box<dyn Error>> {
        let scene = Scene::from_bytes(&self.baked.bytes)?;
        let base = Settings::for_scene(&scene);
        let halved = if args.quick { 0.5 } else { 1.0 };
        let spp = (self.spp * plan.effort * args.effort * halved).round().max(1.0) as u32;
        let settings = Settings {
            shards: 16,
            max_depth: plan.depth.unwrap_or(base.max_depth),
            strategy: Strategy::parse(strategy)?,
            split_budget: plan.split_budget,
            ..base
        };
        let (mut images, mut mrays, start) = (Vec::new(), 0.0, Instant::now());
        for seed in 0..u64::from(args.seeds) {
            let settings = Settings { seed: args.first_seed + seed, ..settings };
            let options = Options { settings, target: Target::Spp(spp), threads: args.threads };
            let rendered = drive_scene(scene, &options, &Unobserved)?;
            mrays += rendered.counters.rays() as f64 * 1e-6;
            let [width, height] = rendered.size.map(|s| s as usize);
            images.push(Rgb::new(width, height, rendered.image()).ok_or("a picture without its pixels")?);
        }
        let image = Estimate::from_seeds(&images)?;
        let name = plan.depth.map_or(strategy.into(), |d| format!("{strategy}, depth {d}"));
        if let Some(folder) = &args.save {
            save(&image, &folder.join(format!("{} {name}.exr", self.name).replace([' ', ':', ','], "_")))?;
        }
        let ratio = ratio(&image.image_mean(), &self.reference.image_mean());
        let scores = bias(&image, &self.reference, &BiasOptions { robust: true, ..BiasOptions::default() })?;
        let explained = |b: &BlockZ| NOTES.iter().any(|&(s, x, y, _)| (s, x, y) == (&self.name, b.x, b.y));
        let unexplained = scores.beyond6.iter().filter(|b| !explained(b)).count();
        let tests = [
            ("beyond 3", scores.beyond3 <= MAX_BEYOND3),
            ("mean z", scores.mean.abs() <= MAX_MEAN),
            ("beyond 6", unexplained == 0),
            ("image mean", (ratio.value - 1.0).abs() <= MAX_RATIO.max(3.0 * ratio.stderr.unwrap_or(0.0))),
        ];
        Ok(Row {
            scene: self.name.clone(),
            strategy: name,
            biased: !plan.biased.is_empty(),
            spp,
            seeds: args.seeds,
            seconds: start.elapsed().as_secs_f64(),
            mrays,
            ratio,
            bias: scores,
            unexplained,
            failed: tests.iter().filter(|t| !t.1).map(|t| t.0).collect(),
        })
    }
}

fn save(image: &Estimate, path: &Path) -> Result<(), Box<dyn Error>> {
    let mut picture = Picture::new(image.width, image.height);
    let layer =
        |pixels: &[[f64; 3]], f: fn(f64) -> f64| pixels.iter().map(|p| p.map(|x| f(x) as f32)).collect::<Vec<_>>();
    picture.add3("", ["R", "G", "B"], &layer(&image.mean, |x| x));
    picture.add3("stderr", ["R", "G", "B"], &layer(&image.variance, f64::sqrt));
    Ok(picture.write_exr(path)?)
}

/// The rows of one scene.
fn plans(args: &Args, scene: &str) -> Vec<(&'static Plan, String)> {
    if !args.strategies.is_empty() {
        const ANY: &Plan = &Plan::unbiased("");
        return args.strategies.iter().map(|s| (ANY, s.clone())).collect();
    }
    let applies = |p: &&Plan| (p.quick || !args.quick) && (p.biased.is_empty() || p.biased.contains(&scene));
    PLANS.iter().filter(applies).map(|p| (p, p.strategy.into())).collect()
}

const HEAD: &str = "\
| scene | strategy | seeds x spp | Mrays | s | image / reference | beyond 3 | mean z | rms z | largest | verdict |
|---|---|---|---|---|---|---|---|---|---|---|";

fn print(r: &Row) {
    let Row { ratio, bias, .. } = r;
    println!(
        "| {} | {} | {} x {} | {:.0} | {:.1} | {:.5} +- {:.5} | {:.2} % | {:+.3} | {:.3} | {:.2} | {} |",
        r.scene,
        r.strategy,
        r.seeds,
        r.spp,
        r.mrays,
        r.seconds,
        ratio.value,
        ratio.stderr.unwrap_or(f64::NAN),
        100.0 * bias.beyond3,
        bias.mean,
        bias.rms,
        bias.max,
        r.verdict()
    );
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if !args.json {
        println!("{HEAD}");
    }
    let mut rows = Vec::new();
    for &(name, spp) in SCENES.iter().filter(|s| args.only.is_empty() || args.only.iter().any(|o| o == s.0)) {
        if !args.scenes.join(name).is_dir() {
            eprintln!("{name}: skipped, there is no folder {}", args.scenes.join(name).display());
            continue;
        }
        let subject = Subject::open(&args.scenes, name, spp).map_err(|e| format!("{name}: {e}"))?;
        for (plan, strategy) in plans(args, name) {
            let row = subject.test(args, plan, &strategy).map_err(|e| format!("{name}, {strategy}: {e}"))?;
            if !args.json {
                print(&row);
                report(&row);
            }
            rows.push(row);
        }
    }
    let good = rows.iter().filter(|r| r.as_expected()).count();
    if args.json {
        let rows: Vec<Value> = rows.iter().map(Row::json).collect();
        println!("{}", json!({ "rows": rows, "as_expected": good }));
    } else {
        let seconds: f64 = rows.iter().map(|r| r.seconds).sum();
        println!("\n{good} of {} rows as expected, {seconds:.0} s of rendering", rows.len());
    }
    Ok(good == rows.len())
}

/// Blocks beyond 6, to standard error.
fn report(row: &Row) {
    if row.biased {
        return;
    }
    for b in row.bias.beyond6.iter().take(8) {
        let note = NOTES.iter().find(|&&(s, x, y, _)| (s, x, y) == (&row.scene, b.x, b.y));
        let note = note.map_or("no note", |n| n.3);
        eprintln!(
            "  block ({}, {}) channel {}: z {:.2}, {:.5} for {:.5}: {note}",
            b.x, b.y, b.channel, b.z, b.image, b.reference
        );
    }
}

fn main() -> ExitCode {
    let args = Args::parse();
    if !args.scenes.is_dir() {
        println!("skipped: there is no folder {}", args.scenes.display());
        return ExitCode::SUCCESS;
    }
    match run(&args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(e) => {
            eprintln!("references: {e}");
            ExitCode::FAILURE
        }
    }
}
