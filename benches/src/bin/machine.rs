//! How full the lanes of the packet machine are, how many vertices wait, what a path's state weighs and how many rays a
//! whole render traces per second, by ring size and roulette strategy.
//!
//! Everything but the speed depends on nothing but scene and settings: [`SNAPSHOT`] holds it, and `--check` fails when
//! a build gives other numbers. Every render is one iteration of 16 shards, stepped one after the other on one thread;
//! runs of all rows take turns, and a run's time is the CPU time of this thread where the system tells it.

use clap::Parser;
use croupier::profile::{AnyProfile, DiffuseOnly, Full, Profile};
use croupier::{BYTES_PER_PATH, Budget, Counters, Plan, Scene, Session, Settings, Shard, StepResult, Strategy};
use croupier_benches::clock::Clock;
use croupier_host::bake::{BakeOptions, Baked, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::{builtin, load};
use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Lane utilisation, waiting vertices and speed of the packet machine")]
struct Args {
    /// Folder with the scenes `kitchen` and `cbox`; what is not there is left out.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"))]
    scenes: PathBuf,
    /// Only scenes whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Runs of each row for its speed; 0 leaves the speed out.
    #[arg(long, default_value_t = 5)]
    rounds: usize,
    /// Compare the deterministic columns of the built-in scene with benches/MACHINE.md; exit status 1 if they differ.
    #[arg(long)]
    check: bool,
    /// Write the tables into benches/MACHINE.md.
    #[arg(long, conflicts_with = "check")]
    write: bool,
}

const SNAPSHOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/MACHINE.md");
const RINGS: [u32; 5] = [16, 64, 256, 512, 2048];
const SHARDS: u32 = 16;
const HEADER: &str = "scene,strategy,ring,scatter,trace,occlude,surface,peak,shard_bytes,bytes_per_path";

/// What a strategy is measured with, so that every row traces about a million rays or more: `fixed:3.3` would give each
/// camera sample its whole split budget of deep paths.
struct Load {
    strategy: &'static str,
    /// Samples per pixel of the iterations.
    iterations: &'static [u32],
    max_depth: u32,
    split_budget: u32,
}

const LOADS: [Load; 4] = [
    Load { strategy: "none", iterations: &[2], max_depth: 12, split_budget: 0 },
    Load { strategy: "classic", iterations: &[4], max_depth: 40, split_budget: 0 },
    Load { strategy: "fixed:3.3", iterations: &[1], max_depth: 6, split_budget: 16 },
    Load { strategy: "ears", iterations: &[1, 1, 2, 4], max_depth: 40, split_budget: 4096 },
];

/// One line of the tables.
struct Row<'a> {
    scene: &'a str,
    load: &'a Load,
    blob: Scene<'a>,
    plan: Plan,
    counters: Counters,
    seconds: Vec<f64>,
}

impl<'a> Row<'a> {
    fn new(scene: &'a str, blob: Scene<'a>, load: &'a Load, ring: u32) -> Result<Self, Box<dyn Error>> {
        let [w, h] = blob.camera.size;
        let settings = Settings {
            // as wide as the smallest of the scenes
            size: [192, 192 * h / w],
            shards: SHARDS,
            max_depth: load.max_depth,
            strategy: Strategy::parse(load.strategy)?,
            ring,
            split_budget: load.split_budget,
            ..Settings::for_scene(&blob)
        };
        let plan = Plan::new(&settings)?;
        Ok(Self { scene, load, blob, plan, counters: Counters::default(), seconds: Vec::new() })
    }

    /// Renders once more.
    fn run(&mut self) -> Result<(), Box<dyn Error>> {
        let (counters, seconds) = match AnyProfile::smallest(self.blob.effects) {
            AnyProfile::DiffuseOnly => self.render::<DiffuseOnly>()?,
            AnyProfile::Full => self.render::<Full>()?,
        };
        self.counters = counters;
        self.seconds.push(seconds);
        Ok(())
    }

    fn render<P: Profile>(&self) -> Result<(Counters, f64), Box<dyn Error>> {
        let (plan, scene) = (&self.plan, self.blob);
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        let mut blocks: Vec<_> = (0..SHARDS).map(|_| AlignedBytes::zeroed(plan.shard().size)).collect();
        let mut session = Session::builder(scene).profile::<P>().build(plan, shared.as_mut())?;
        let shards = blocks.iter_mut().zip(0..).map(|(b, i)| Shard::new(plan, i, b.as_mut()));
        let mut shards = shards.collect::<Result<Vec<_>, _>>()?;
        let clock = Clock::start();
        for &samples in self.load.iterations {
            session.begin_iteration(samples);
            for shard in &mut shards {
                while shard.step(&session, Budget { rays: u64::MAX }) == StepResult::More {}
            }
            session.end_iteration(&shards)?;
        }
        Ok((*session.counters(), clock.seconds()))
    }

    /// Its line of the snapshot.
    fn snapshot(&self) -> String {
        let c = &self.counters;
        let [scatter, trace, occlude, surface] = [c.scatter, c.trace, c.occlude, c.surface].map(|u| u.share());
        format!(
            "{},{},{},{scatter:.4},{trace:.4},{occlude:.4},{surface:.4},{},{},{BYTES_PER_PATH}",
            self.scene,
            self.load.strategy,
            self.plan.settings().ring,
            c.ring_peak,
            self.plan.shard().size,
        )
    }

    /// Its line of the table of speeds: median, smallest and largest.
    fn speed(&self) -> String {
        let rays = self.counters.rays() as f64 * 1e-6;
        let mut speeds: Vec<f64> = self.seconds.iter().map(|s| rays / s).collect();
        speeds.sort_by(f64::total_cmp);
        let (low, high) = (speeds[0], speeds[speeds.len() - 1]);
        format!(
            "| {} | {} | {} | {rays:.2} | {:.2} | {low:.2} to {high:.2} |",
            self.scene,
            self.load.strategy,
            self.plan.settings().ring,
            speeds[speeds.len() / 2],
        )
    }
}

/// The built-in scene, and those of the folder that are there.
fn scenes(args: &Args) -> Result<Vec<(&'static str, Baked)>, Box<dyn Error>> {
    let mut scenes = Vec::new();
    let mut add = |name, path: Option<&Path>| -> Result<(), Box<dyn Error>> {
        if !name_fits(args, name) {
            return Ok(());
        }
        let description = match path {
            None => builtin::cornell_box(),
            Some(path) if path.join("scene.json").exists() => load::load(path)?.0,
            Some(path) => {
                eprintln!("skipped {name}: there is no {}", path.display());
                return Ok(());
            }
        };
        scenes.push((name, bake(&description, &BakeOptions::default(), |_, _| {})?));
        Ok(())
    };
    add("built-in", None)?;
    if !args.check {
        add("cbox", Some(&args.scenes.join("cbox")))?;
        add("kitchen", Some(&args.scenes.join("kitchen")))?;
    }
    Ok(scenes)
}

fn name_fits(args: &Args, name: &str) -> bool {
    name.contains(&args.only)
}

/// The lines of `text` between ```` ```NAME ```` and the closing fence, and where they are.
fn block<'a>(text: &'a str, name: &str) -> Option<(std::ops::Range<usize>, &'a str)> {
    let open = format!("```{name}\n");
    let start = text.find(&open)? + open.len();
    let end = start + text[start..].find("```")?;
    Some((start..end, &text[start..end]))
}

/// Reports each line of the snapshot that the build does not reproduce; how many there are.
fn check(rows: &[Row<'_>]) -> Result<usize, Box<dyn Error>> {
    let text = std::fs::read_to_string(SNAPSHOT).map_err(|e| format!("{SNAPSHOT}: {e}"))?;
    let (_, old) = block(&text, "csv").ok_or_else(|| format!("{SNAPSHOT}: no block of csv"))?;
    let mut differ = 0;
    for row in rows {
        let new = row.snapshot();
        let key: Vec<&str> = new.split(',').take(3).collect();
        let key = key.join(",") + ",";
        let old = old.lines().find(|l| l.starts_with(&key)).unwrap_or("nothing");
        if old != new {
            println!("snapshot: {old}\n     now: {new}");
            differ += 1;
        }
    }
    Ok(differ)
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if args.check && !croupier::simd::REPRODUCIBLE {
        println!("skipped: the snapshot holds for reproducible arithmetic only");
        return Ok(true);
    }
    let scenes = scenes(args)?;
    let mut rows = Vec::new();
    for (name, baked) in &scenes {
        let scene = Scene::from_bytes(&baked.bytes)?;
        for load in &LOADS {
            for ring in RINGS {
                rows.push(Row::new(name, scene, load, ring)?);
            }
        }
    }
    // Rows take turns, so that what else the machine does hits all of them.
    let rounds = if args.check { 0 } else { args.rounds };
    for _ in 0..rounds.max(1) {
        for row in &mut rows {
            row.run()?;
        }
    }
    if args.check {
        let differ = check(&rows)?;
        println!("{} rows of benches/MACHINE.md checked, {differ} differ", rows.len());
        if differ > 0 {
            println!("if that is meant: cargo run --release -p croupier-benches --bin machine -- --write");
        }
        return Ok(differ == 0);
    }
    let mut snapshot = format!("{HEADER}\n");
    for row in &rows {
        writeln!(snapshot, "{}", row.snapshot())?;
    }
    let mut speeds =
        String::from("| scene | strategy | ring | million rays | Mrays/s | runs |\n|---|---|---|---|---|---|\n");
    for row in &rows {
        writeln!(speeds, "{}", row.speed())?;
    }
    print!("{snapshot}");
    if rounds > 0 {
        print!("\n{speeds}");
    }
    if args.write {
        if scenes.len() < 3 {
            return Err("only a run of all three scenes may replace the snapshot".into());
        }
        let mut text = std::fs::read_to_string(SNAPSHOT)?;
        let (range, _) = block(&text, "csv").ok_or("no block of csv to replace")?;
        text.replace_range(range, &snapshot);
        if rounds > 0 {
            let start = text.find("| scene | strategy | ring | million rays").ok_or("no table of speeds to replace")?;
            text.replace_range(start.., &speeds);
        }
        std::fs::write(SNAPSHOT, text)?;
    }
    Ok(true)
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(e) => {
            eprintln!("machine: {e}");
            ExitCode::FAILURE
        }
    }
}
