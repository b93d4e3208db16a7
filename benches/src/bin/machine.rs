//! How full the lanes of the packet machine are, how many vertices wait, what a path's state weighs and how many rays a
//! whole render traces per second, by ring size and roulette strategy.
//!
//! Everything but the speed depends on nothing but scene and settings: `benches/results/machine.md` holds it, and
//! `--check` fails when a build gives other numbers. Every render has 16 shards, stepped one after the other on one
//! thread; runs of all rows take turns, and a run's time is the CPU time of this thread where the system tells it.

use clap::Parser;
use croupier::unstable::BYTES_PER_PATH;
use croupier::{Counters, Plan, Scene, Settings, Strategy};
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_benches::serial;
use croupier_host::bake::{BakeOptions, Baked, bake};
use croupier_host::{builtin, load};
use std::error::Error;
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
    /// Compare the deterministic columns of the built-in scene with benches/results/machine.md; exit status 1 if they
    /// differ.
    #[arg(long)]
    check: bool,
    /// Write benches/results/machine.md; needs all three scenes.
    #[arg(long, conflicts_with_all = ["check", "only"])]
    write: bool,
}

const NAME: &str = "machine";
const RINGS: [u32; 5] = [16, 64, 256, 512, 2048];
const SHARDS: u32 = 16;
/// Title and columns of what depends on scene and settings alone.
const LANES: (&str, &str) =
    ("Lanes and memory", "scene, strategy, ring, scatter, trace, occlude, surface, peak, shard bytes, bytes per path");
const SPEED: (&str, &str) = ("Speed", "scene, strategy, ring, million rays, Mrays/s, lowest, highest");

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
        let (counters, seconds) = serial::render(self.blob, &self.plan, self.load.iterations)?;
        self.counters = counters;
        self.seconds.push(seconds);
        Ok(())
    }

    /// The cells that tell rows apart.
    fn key(&self) -> [String; 3] {
        [self.scene.into(), self.load.strategy.into(), self.plan.settings().ring.to_string()]
    }

    fn lanes(&self) -> Vec<String> {
        let c = &self.counters;
        let shares = [c.scatter, c.trace, c.occlude, c.surface].map(|u| format!("{:.4}", u.share()));
        let sizes = [c.ring_peak as usize, self.plan.shard().size, BYTES_PER_PATH].map(|n| n.to_string());
        self.key().into_iter().chain(shares).chain(sizes).collect()
    }

    /// Median, smallest and largest speed.
    fn speed(&self) -> Vec<String> {
        let rays = self.counters.rays() as f64 * 1e-6;
        let mut speeds: Vec<f64> = self.seconds.iter().map(|s| rays / s).collect();
        speeds.sort_by(f64::total_cmp);
        let figures = [rays, speeds[speeds.len() / 2], speeds[0], speeds[speeds.len() - 1]];
        self.key().into_iter().chain(figures.map(|x| format!("{x:.2}"))).collect()
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

/// Reports each committed row that the build does not reproduce; how many there are.
fn check(rows: &[Row<'_>]) -> Result<usize, Box<dyn Error>> {
    let committed = Results::read(NAME)?;
    let table = committed.table(LANES.0).ok_or("no table of lanes in the committed results")?;
    let mut differ = 0;
    for row in rows {
        let new = row.lanes();
        let old = table.row(&row.key().each_ref().map(|k| &**k));
        if old != Some(&new) {
            println!("committed: {}\n      now: {}", old.map_or("nothing".into(), |o| o.join(", ")), new.join(", "));
            differ += 1;
        }
    }
    Ok(differ)
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if args.check && !croupier::unstable::simd::REPRODUCIBLE {
        println!("skipped: the snapshot holds for reproducible arithmetic only");
        return Ok(true);
    }
    let mut results = Results::of_this_run(NAME);
    let scenes = scenes(args)?;
    if args.write && (scenes.len() < 3 || args.rounds == 0) {
        return Err("only a run of all three scenes, with speeds, may replace the committed results".into());
    }
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
        println!("{} rows of benches/results/{NAME}.md checked, {differ} differ", rows.len());
        if differ > 0 {
            println!("if that is meant: cargo run --release -p croupier-benches --bin {NAME} -- --write");
        }
        return Ok(differ == 0);
    }
    let [mut lanes, mut speed] = [LANES, SPEED].map(|(title, columns)| Table::new(title, columns));
    for row in &rows {
        lanes.add(row.lanes());
        speed.add(row.speed());
    }
    results.tables = if rounds > 0 { vec![lanes, speed] } else { vec![lanes] };
    results.tables.iter().for_each(|t| println!("{t}"));
    if args.write {
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
