//! Rays per second of the built-in traversal beside obvhs's own Bvh2 and CwBvh traversals, and beside Embree 4 where
//! its shared library is given, on identical ray arrays.
//!
//! Sets: primary rays, first and third diffuse bounce, shadow rays from primary and from first-bounce hits towards a
//! square emitter below the top of the scene. Kernels take turns inside each round; the table shows medians over the
//! rounds, the spread between the quartiles, and the ratio to Bvh2. Times are CPU times of this thread where the system
//! tells them. Answers are checked against each other first.
//!
//! `--write` puts the table, and times of repeated windows of packets (`--window` of 512, 64 and 1), into
//! `benches/results/traversal.md`; with `--embree LIBRARY` other tables of three scenes into
//! `benches/results/traversal-embree.md` (see `beside`).
//!
//! Beware: `glam` with `scalar-math` anywhere in the same build turns obvhs's own vectors scalar, which about halves
//! its Bvh2 on closest hits. The header of the table says which it is.

mod beside;
mod embree;
mod kernels;
mod rays;
mod truth;

use clap::Parser;
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use kernels::{NAMES, Subject, median, vectors};
use rays::Set;
use std::error::Error;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Rays per second of the traversal, beside obvhs and Embree")]
struct Args {
    /// Scene: an OBJ file, its camera in scene.json beside it. Default: the kitchen if it is there, else a generated
    /// one.
    scene: Option<PathBuf>,
    /// Rounds.
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Primary rays across.
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Only sets whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Instead of the table: nanoseconds per ray when windows of this many packets are traced again and again, which
    /// tells what waiting for memory and unpredictable branches cost.
    #[arg(long, value_name = "PACKETS", conflicts_with = "json")]
    window: Option<NonZero<usize>>,
    /// One line of JSON instead of the table.
    #[arg(long)]
    json: bool,
    /// Embree 4's shared library, which is measured too and whose hits are compared; needs a C compiler. Without a
    /// scene: kitchen and cbox, as far as they are there, and the generated one.
    #[arg(long, value_name = "LIBRARY", conflicts_with_all = ["window", "json"])]
    embree: Option<PathBuf>,
    /// Write benches/results/traversal.md, or traversal-embree.md; needs the kitchen, with --embree the cbox, too.
    #[arg(long, conflicts_with_all = ["scene", "only", "window", "json"])]
    write: bool,
}

const NAME: &str = "traversal";
/// Packets of the windows in the committed results.
const WINDOWS: [usize; 3] = [512, 64, 1];
/// What a measurement of a set takes.
const SECONDS: f64 = 0.15;

/// A scene beside the repository.
fn scene_of(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes").join(name).join("scene.obj");
    path.exists().then_some(path)
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if let Some(library) = &args.embree {
        return beside::run(args, library);
    }
    let mut results = Results::of_this_run(NAME);
    let scene = args.scene.clone().or_else(|| scene_of("kitchen"));
    if args.write && scene.is_none() {
        return Err("--write: there is no kitchen".into());
    }
    let subject = Subject::new(scene.as_deref());
    let kernels = subject.kernels();
    let sets = rays::sets(&kernels.wide, &subject.triangles, &subject.camera, args.width);
    let sets: Vec<Set> = sets.into_iter().filter(|s| s.name.contains(&args.only)).collect();
    let passes = kernels.passes(&sets, SECONDS);
    if let Some(size) = args.window {
        print!("{}", kernels.windows(&sets, &[size.get()], args.rounds));
        return Ok(true);
    }

    let mut times = vec![vec![Vec::new(); 3]; sets.len()];
    for round in 0..args.rounds.max(1) {
        for ((set, times), passes) in sets.iter().zip(&mut times).zip(&passes) {
            for k in 0..3 {
                let k = (k + round) % 3;
                times[k].push(kernels.seconds(k, set, passes[k]));
            }
        }
    }

    let mut rows = Vec::new();
    for (set, times) in sets.iter().zip(times) {
        let speed = times.into_iter().map(|t| {
            let (t, spread) = median(t);
            (set.single.len() as f64 / t * 1e-6, spread)
        });
        rows.push((set, speed.collect::<Vec<_>>()));
    }
    if args.json {
        println!("{}", json(&subject, &rows));
        return Ok(true);
    }
    let facts = [
        (
            "scene",
            format!(
                "{}, {} triangles; tree built in {:.2} s",
                subject.name,
                subject.triangles.len(),
                subject.build_seconds
            ),
        ),
        ("tree", subject.facts()),
        ("obvhs", vectors().into()),
        ("Embree", "not measured: no `--embree LIBRARY`".into()),
        ("figures", format!("Mrays/s, medians of {} rounds (spread between the quartiles)", args.rounds.max(1))),
    ];
    facts.iter().for_each(|(key, value)| println!("- {key}: {value}"));
    results.header.extend(facts.map(|(key, value)| (key.into(), value)));
    let mut table = Table::new("Speed", &format!("rays, number, {}, ratio to Bvh2", NAMES.join(", ")));
    for (set, s) in rows {
        let kernels = s.iter().map(|(speed, spread)| format!("{speed:.2} ({:.0} %)", 100.0 * spread));
        let ratio = format!("{:.2}", s[0].0 / s[1].0);
        table.add([set.name.to_string(), set.single.len().to_string()].into_iter().chain(kernels).chain([ratio]));
    }
    print!("\n{table}");
    results.tables.push(table);
    if args.write {
        let table = kernels.windows(&sets, &WINDOWS, args.rounds);
        print!("\n{table}");
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

/// The table as JSON; `rows` have speed and spread by kernel.
fn json(subject: &Subject, rows: &[(&Set, Vec<(f64, f64)>)]) -> serde_json::Value {
    let sets: Vec<_> = rows
        .iter()
        .map(|(set, s)| {
            let kernel = |k: usize| serde_json::json!({"mrays_per_s": s[k].0, "spread": s[k].1});
            serde_json::json!({
                "set": set.name, "rays": set.single.len(), "ratio": s[0].0 / s[1].0,
                "croupier": kernel(0), "bvh2": kernel(1), "cwbvh": kernel(2),
            })
        })
        .collect();
    let tree = serde_json::json!({
        "depth": subject.tree.depth, "nodes": subject.tree.nodes.len(), "leaves": subject.tree.leaves.len(),
        "bytes_per_triangle": subject.bytes_per_triangle(), "build_seconds": subject.build_seconds,
    });
    serde_json::json!({
        "scene": subject.name, "triangles": subject.triangles.len(), "obvhs": vectors(), "tree": tree, "sets": sets,
    })
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
