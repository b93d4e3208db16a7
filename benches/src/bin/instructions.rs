//! Instructions per ray, counted by callgrind: a figure of speed that does not depend on the machine and its load.
//!
//! Every row is a small render on one thread, made by this program under valgrind. Two parts are counted, and nothing
//! else: stepping the shards (paths, rays, learning's records), and ending iterations (merging, denoising, learning).
//! The same build gives the same counts; another compiler may give others, and so may another C library, whose `memcpy`
//! chooses its instructions when it runs. `--check` compares with `benches/results/instructions.md` and fails when a
//! figure has risen, or when one of stepping is more than 0.5 % above that of `instructions-before-media.md`: effects
//! that a scene does not call for cost nothing (docs/EFFECTS.md). Scenes that use what was added since are not compared
//! with that ([`CHANGED`]).
//!
//! Not made with gungraun (once iai-callgrind): it compares with runs that it keeps below `target/`, where this needs a
//! committed table and figures per ray, and it needs a runner of its own version installed beside cargo.

use clap::Parser;
use croupier::{Plan, Scene, Settings};
use croupier_benches::callgrind::{self, Counted, Folder};
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_benches::variant::Variant;
use croupier_benches::{provenance, serial};
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Instructions per ray, counted by callgrind")]
struct Args {
    /// Folder with the scenes `cbox` and `kitchen`; what is not there is skipped.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/scenes"))]
    scenes: PathBuf,
    /// Only rows whose `SCENE STRATEGY` contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Compare with benches/results/instructions.md; exit status 1 if a row has risen by more than `--tolerance`.
    #[arg(long)]
    check: bool,
    /// Per cent by which a row may rise.
    #[arg(long, value_name = "PERCENT", default_value_t = 2.0)]
    tolerance: f64,
    /// Write benches/results/instructions.md.
    #[arg(long, conflicts_with_all = ["check", "only"])]
    write: bool,
    /// Render this blob with `--strategy` and print its rays: what the program runs under valgrind.
    #[arg(long, hide = true, requires = "strategy")]
    blob: Option<PathBuf>,
    #[arg(long, hide = true)]
    strategy: Option<String>,
}

const NAME: &str = "instructions";
/// Counts of the library before it had media and straight passages, and per cent that a figure of stepping may be above
/// them.
const WITHOUT: (&str, f64) = ("instructions-before-media", 0.5);
/// Scenes that trace other paths since then: the panes of `kitchen` (`thindielectric`) are passed straight on, also by
/// shadow rays, which they blocked before.
const CHANGED: &[&str] = &["kitchen"];
const SCENES: [&str; 3] = ["built-in", "cbox", "kitchen"];
/// `ears+shadow` is what the program calls `ears`, but for path guiding.
const STRATEGIES: [&str; 3] = ["classic", "ears", "ears+shadow"];
/// Samples per pixel of the iterations: learned factors are in use from the second on.
const ITERATIONS: [u32; 4] = [1, 1, 2, 4];
/// Pixels of the pictures, about.
const PIXELS: f64 = 9216.0;
const SHARDS: u32 = 2;
const COLUMNS: &str =
    "scene, strategy, rays, instructions in step, in end_iteration, step per ray, end_iteration per ray";

/// A render, and what was counted in it.
struct Row {
    scene: &'static str,
    strategy: &'static str,
    counted: Counted,
}

impl Row {
    fn cells(&self) -> Vec<String> {
        let [step, end] = self.counted.instructions;
        let [step_per_ray, end_per_ray] = self.counted.per_ray().map(|x| format!("{x:.2}"));
        let counts = [self.counted.rays, step, end].map(|n| n.to_string());
        let names = [self.scene, self.strategy].map(String::from);
        names.into_iter().chain(counts).chain([step_per_ray, end_per_ray]).collect()
    }
}

/// The render of a row, and its rays.
fn render(blob: &Path, strategy: &str) -> Result<Value, Box<dyn Error>> {
    let bytes = callgrind::read(blob)?;
    let scene = Scene::from_bytes(&bytes)?;
    let [width, height] = scene.camera.size.map(f64::from);
    let scale = (PIXELS / (width * height)).sqrt();
    let size = [width, height].map(|x| (x * scale).round() as u32);
    // features for the denoiser, as the program renders
    let settings = Settings { size, shards: SHARDS, aovs: true.into(), ..Settings::for_scene(&scene) };
    let plan = Plan::new(&Variant::parse(strategy)?.apply(settings))?;
    let (counters, _) = serial::render(scene, &plan, &ITERATIONS)?;
    Ok(json!({ "rays": counters.rays() }))
}

/// Counts one row under callgrind.
fn count(folder: &Folder, blob: &Path, scene: &'static str, strategy: &'static str) -> Result<Row, Box<dyn Error>> {
    let args = ["--blob", &blob.to_string_lossy(), "--strategy", strategy];
    let counted = callgrind::count(folder, &format!("{scene}, {strategy}"), &args)?;
    Ok(Row { scene, strategy, counted })
}

/// Prints each row beside the committed one; how many have risen.
fn check(rows: &[Row], tolerance: f64, results: &Results) -> Result<usize, Box<dyn Error>> {
    let committed = Results::read(NAME)?;
    let table = committed.tables.first().ok_or("no table in the committed results")?;
    if let Some(difference) = results.differs_in(&committed, &["compiler"]) {
        println!("counts may differ because the {difference}");
    }
    let column = |name: &str| table.column(name).ok_or_else(|| format!("no column '{name}' in the committed results"));
    let columns = [column("step per ray")?, column("end_iteration per ray")?];
    let rays = column("rays")?;
    let mut risen = 0;
    for row in rows {
        let key = [row.scene, row.strategy];
        let old = table.row(&key).ok_or_else(|| format!("{key:?}: not in the committed results"))?;
        print!("{:<10}{:<13}", row.scene, row.strategy);
        for ((name, new), k) in ["step", "end_iteration"].iter().zip(row.counted.per_ray()).zip(columns) {
            let old: f64 = old[k].parse()?;
            // the committed figure is rounded
            let too_much = new > old * (1.0 + tolerance / 100.0) + 0.005;
            risen += usize::from(too_much);
            let change = 100.0 * (new / old - 1.0);
            print!("{name} {old:9.2} -> {new:9.2} ({change:+.2} %){}  ", if too_much { " RISEN" } else { "" });
        }
        println!(
            "{}",
            if old[rays] == row.counted.rays.to_string() { "" } else { "(other rays: the paths have changed)" }
        );
    }
    let table = Results::read(WITHOUT.0)?;
    let table = table.tables.first().ok_or("no table of the counts before")?;
    let step = table.column("step per ray").ok_or("no column 'step per ray' in the counts before")?;
    for row in rows.iter().filter(|r| !CHANGED.contains(&r.scene)) {
        let key = [row.scene, row.strategy];
        let old: f64 = table.row(&key).ok_or_else(|| format!("{key:?}: not in the counts before"))?[step].parse()?;
        let change = 100.0 * (row.counted.per_ray()[0] / old - 1.0);
        if change > WITHOUT.1 {
            println!("{} {}: {change:+.2} % above {}", row.scene, row.strategy, WITHOUT.0);
            risen += 1;
        }
    }
    Ok(risen)
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if let (Some(blob), Some(strategy)) = (&args.blob, &args.strategy) {
        println!("{}", render(blob, strategy)?);
        return Ok(true);
    }
    callgrind::note_profile(args.write)?;
    let mut results = Results::of_this_run(NAME);
    if args.check
        && let Some(difference) = results.differs_in(&Results::read(NAME)?, &["instruction set", "arithmetic"])
    {
        println!("skipped: the {difference}");
        return Ok(true);
    }
    let folder = Folder::new(NAME)?;
    let mut rows = Vec::new();
    let mut table = Table::new("", COLUMNS);
    for scene in SCENES {
        let wanted = STRATEGIES.into_iter().filter(|s| format!("{scene} {s}").contains(&args.only));
        let wanted: Vec<_> = wanted.collect();
        let found = if wanted.is_empty() { None } else { callgrind::description(scene, &args.scenes)? };
        let Some(found) = found else { continue };
        let blob = folder.bake(scene, &found)?;
        for strategy in wanted {
            let row = count(&folder, &blob, scene, strategy)?;
            eprintln!("{}", row.cells().join(", "));
            table.add(row.cells());
            rows.push(row);
        }
    }
    if rows.is_empty() {
        return Err("no row fits".into());
    }
    if args.check {
        let risen = check(&rows, args.tolerance, &results)?;
        println!("{} rows of benches/results/{NAME}.md checked, {risen} figures above it", rows.len());
        if risen > 0 {
            println!("if that is meant: cargo run --profile embed -p croupier-benches --bin {NAME} -- --write");
        }
        return Ok(risen == 0);
    }
    print!("{table}");
    if args.write {
        if rows.len() < SCENES.len() * STRATEGIES.len() {
            return Err("only a run of all scenes may replace the committed results".into());
        }
        results.header.push(("valgrind".into(), provenance::version_of("valgrind")));
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
