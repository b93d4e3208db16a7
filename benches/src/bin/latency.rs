//! How long a host waits for the smallest step: the rays and the instructions of every step with a budget of one packet,
//! in a small picture on one shard. Each step is a call after which callgrind writes what it has counted.

use clap::Parser;
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult, Strategy};
use croupier_benches::callgrind::{self, Folder, bench_collect};
use croupier_benches::exit::exit_code;
use croupier_benches::provenance;
use croupier_benches::results::{Results, Table};
use croupier_host::blob::AlignedBytes;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "The longest of the smallest steps, counted by callgrind")]
struct Args {
    /// Folder with the scene `kitchen`; what is not there is skipped.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"))]
    scenes: PathBuf,
    /// Only this scene.
    #[arg(long)]
    only: Option<String>,
    /// Compare with benches/results/latency.md; exit status 1 if a figure of a row has risen by more than 2 %.
    #[arg(long)]
    check: bool,
    /// Write benches/results/latency.md.
    #[arg(long, conflicts_with_all = ["check", "only"])]
    write: bool,
    /// Render this blob with `--strategy` and print the rays of each step: what the program runs under valgrind.
    #[arg(long, hide = true, requires = "strategy")]
    blob: Option<PathBuf>,
    #[arg(long, hide = true)]
    strategy: Option<String>,
}

const NAME: &str = "latency";
const SCENES: [&str; 2] = ["built-in", "kitchen"];
const STRATEGIES: [&str; 2] = ["classic", "ears"];
/// Pixels of the pictures, about.
const PIXELS: f64 = 1024.0;
/// Samples per pixel of the iterations. The last, with learned factors, is measured.
const ITERATIONS: [u32; 3] = [2, 2, 1];
const COLUMNS: &str = "scene, strategy, steps, rays of the longest, instructions of the longest, of the mean";
/// Columns that must not rise, and by how many per cent they may.
const CHECKED: ([&str; 3], f64) = (["rays of the longest", "instructions of the longest", "of the mean"], 2.0);

/// Renders, and prints the rays of each measured step.
fn render(blob: &Path, strategy: &str) -> Result<(), Box<dyn Error>> {
    let bytes = callgrind::read(blob)?;
    let scene = Scene::from_bytes(&bytes)?;
    let [width, height] = scene.camera.size.map(f64::from);
    let scale = (PIXELS / (width * height)).sqrt();
    let size = [width, height].map(|x| (x * scale).round() as u32);
    let mut settings = Settings { size, strategy: Strategy::parse(strategy)?, ..Settings::for_scene(&scene) };
    settings.learning.cache_bytes = 1 << 20;
    let plan = Plan::new(&settings)?;
    let (mut shared, mut block) = (AlignedBytes::zeroed(plan.session().size), AlignedBytes::zeroed(plan.shard().size));
    let mut session = Session::new(scene, &plan, shared.as_mut())?;
    let mut shard = Shard::new(&plan, 0, block.as_mut())?;
    for (samples, left) in ITERATIONS.into_iter().zip((0..ITERATIONS.len()).rev()) {
        session.begin_iteration(samples);
        if left > 0 {
            while shard.step(&session, Budget { rays: 1 << 20 }) == StepResult::More {}
            session.end_iteration([&shard])?;
            continue;
        }
        let mut done = false;
        while !done {
            let before = if shard.has_joined(&session) { shard.counters().rays() } else { 0 };
            bench_collect(&mut || done = shard.step(&session, Budget { rays: 1 }) == StepResult::Done);
            println!("{}", shard.counters().rays() - before);
        }
    }
    Ok(())
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if let (Some(blob), Some(strategy)) = (&args.blob, &args.strategy) {
        render(blob, strategy)?;
        return Ok(true);
    }
    callgrind::note_profile(args.write)?;
    let mut results = Results::of_this_run(NAME);
    let committed = if args.check { Some(Results::read(NAME)?) } else { None };
    let difference = committed.as_ref().and_then(|c| results.differs_in(c, &["instruction set", "arithmetic"]));
    if let Some(difference) = difference {
        println!("skipped: the {difference}");
        return Ok(true);
    }
    let folder = Folder::new(NAME)?;
    let mut table = Table::new("", COLUMNS);
    for scene in SCENES.into_iter().filter(|s| args.only.as_deref().is_none_or(|only| only == *s)) {
        let Some(found) = callgrind::description(scene, &args.scenes)? else { continue };
        let blob = folder.bake(scene, &found)?;
        for strategy in STRATEGIES {
            let steps = callgrind::each_call(&folder, &["--blob", &blob.to_string_lossy(), "--strategy", strategy])?;
            let rays = steps.iter().filter_map(|(rays, _)| rays.parse::<u64>().ok()).max().ok_or("no steps")?;
            let most = steps.iter().map(|(_, n)| *n).max().ok_or("no steps")?;
            let mean = steps.iter().map(|(_, n)| *n).sum::<u64>() / steps.len() as u64;
            let numbers = [steps.len() as u64, rays, most, mean].map(|n| n.to_string());
            let row: Vec<_> = [scene, strategy].map(String::from).into_iter().chain(numbers).collect();
            println!("{}", row.join(", "));
            table.add(row);
        }
    }
    if table.rows.is_empty() {
        return Err("no row fits".into());
    }
    if let Some(committed) = &committed {
        let old = committed.tables.first().ok_or("no table in the committed results")?;
        let risen = table.risen(old, 2, &CHECKED.0, CHECKED.1)?;
        risen.iter().for_each(|figure| println!("RISEN {figure}"));
        println!("{} rows of benches/results/{NAME}.md checked, {} figures above it", table.rows.len(), risen.len());
        if !risen.is_empty() {
            println!("if that is meant: cargo run --profile embed -p croupier-benches --bin {NAME} -- --write");
        }
        return Ok(risen.is_empty());
    }
    if args.write {
        if table.rows.len() < SCENES.len() * STRATEGIES.len() {
            return Err("only a run of all scenes may replace the committed results".into());
        }
        results.header.push(("picture".into(), format!("about {PIXELS} pixels, one shard, budget of one ray")));
        results.header.push(("valgrind".into(), provenance::version_of("valgrind")));
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
