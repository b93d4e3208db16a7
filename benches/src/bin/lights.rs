//! What choosing lights by the tree costs and brings against choosing them by power, under 1 to 10,000 emitters of
//! about the same light in all (`croupier_tests::many_lights`).
//!
//! relMSE is from the film's own variances at equal samples, instructions per ray are callgrind's (`--count`), cost is
//! their product: what a picture of one error costs, up to a factor that all rows share. The tree is built for every row,
//! also where bakers leave it out. With `--count` the most emitters may take at most three times the instructions per ray
//! of a single one, by the tree; exit status 1 otherwise. `--write` puts a run of the usual numbers of emitters into
//! `benches/results/lights.md`.

use clap::Parser;
use croupier::unstable::light::{LightSelector, LightTree, PowerSelector, TreeSelector, build_light_tree};
use croupier::unstable::scene::Records;
use croupier::unstable::scene::blob::{LightNode, NONE};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult, Strategy};
use croupier_benches::callgrind::{self, Folder, bench_collect};
use croupier_benches::exit::exit_code;
use croupier_benches::provenance;
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::digits;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_tests::many_lights::cloud;
use std::error::Error;
use std::process::ExitCode;

const NAME: &str = "lights";
const COLUMNS: &str = "emitters, relMSE by power, by the tree, ratio, instructions per ray by power, by the tree, cost by \
     power, by the tree";
/// The numbers of emitters of the committed table.
const EMITTERS: [u32; 8] = [1, 4, 8, 16, 32, 100, 1000, 10_000];
/// Instructions per ray of the most emitters over those of one, by the tree, at most.
const MOST: f64 = 3.0;

#[derive(Parser)]
#[command(about = "Lights chosen by the tree and by power, under 1 to 10,000 emitters")]
struct Args {
    /// Numbers of emitters.
    #[arg(long, value_delimiter = ',', default_values_t = EMITTERS)]
    emitters: Vec<u32>,
    /// Samples per pixel.
    #[arg(long, default_value_t = 16)]
    spp: u32,
    /// Path segments.
    #[arg(long, default_value_t = 3)]
    depth: u32,
    /// Count instructions under valgrind.
    #[arg(long)]
    count: bool,
    /// Write benches/results/lights.md, with counts.
    #[arg(long, conflicts_with_all = ["emitters", "once"])]
    write: bool,
    /// Render once and print; what the program runs under valgrind.
    #[arg(long, hide = true)]
    once: bool,
}

/// relMSE and rays of a render by one thread.
fn render<L: LightSelector>(scene: Scene<'_>, selector: L, args: &Args) -> Result<(f64, u64), Box<dyn Error>> {
    let strategy = Strategy::parse("classic")?;
    let settings = Settings { strategy, max_depth: args.depth, ..Settings::for_scene(&scene) };
    let plan = Plan::new(&settings)?;
    let [mut shared, mut block] = [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
    let mut session = Session::builder(scene).light_selector(selector).build(&plan, shared.as_mut())?;
    let mut shard = Shard::new(&plan, 0, block.as_mut())?;
    for samples in [args.spp / 2, args.spp - args.spp / 2] {
        session.begin_iteration(samples);
        bench_collect(&mut || while shard.step(&session, Budget { rays: u64::MAX }) == StepResult::More {});
        session.end_iteration([&shard])?;
    }
    // independent renders: the error is the variance of the mean
    let film = session.film();
    let mut errors: Vec<f64> = film
        .pixels()
        .map(|p| {
            let channels = p.mean().into_iter().zip(p.variance_of_mean());
            channels.map(|(mean, variance)| variance / (mean * mean + 0.01)).sum::<f64>() / 3.0
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let kept = errors.len() - errors.len() / 1000;
    Ok((errors[..kept].iter().sum::<f64>() / kept as f64, session.counters().rays()))
}

/// A scene with a tree, whatever the number of its lights.
fn with_tree<T>(scene: Scene<'_>, f: impl FnOnce(Scene<'_>) -> T) -> T {
    let n = scene.lights.len();
    let mut nodes: Vec<LightNode> = vec![bytemuck::Zeroable::zeroed(); n];
    let (mut trails, mut order) = (vec![NONE; n], vec![0; n]);
    let tree = LightTree { nodes: &mut nodes, trails: &mut trails, order: &mut order };
    let count = build_light_tree(&scene, tree).unwrap_or(0);
    f(Scene::assume_valid(Records { light_nodes: &nodes[..count], light_trails: &trails, ..*scene }))
}

/// Instructions per ray of a render with lights chosen by power and by the tree.
fn count(folder: &Folder, emitters: u32, args: &Args) -> Result<[f64; 2], Box<dyn Error>> {
    let [list, spp, depth] = [emitters, args.spp, args.depth].map(|n| n.to_string());
    let calls = callgrind::each_call(folder, &["--once", "--emitters", &list, "--spp", &spp, "--depth", &depth])?;
    let of = |k: usize| -> Option<f64> {
        let [first, second] = calls.get(2 * k..2 * k + 2)? else { return None };
        Some((first.1 + second.1) as f64 / first.0.parse::<f64>().ok()?)
    };
    of(0).zip(of(1)).map(|(a, b)| [a, b]).ok_or_else(|| "callgrind has not counted every render".into())
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let counted = args.count || args.write;
    if counted {
        callgrind::note_profile(args.write)?;
    }
    let mut results = Results::of_this_run(NAME);
    let folder = Folder::new(NAME)?;
    let mut table = Table::new("", COLUMNS);
    // of the fewest emitters and of the most
    let mut by_tree = Vec::new();
    for &n in &args.emitters {
        let bytes = bake(&cloud(n, [64, 48]), &BakeOptions::default(), |_, _| {})?.bytes;
        let scene = Scene::from_bytes(&bytes)?;
        let power = render(scene, PowerSelector(scene), args)?;
        let tree = with_tree(scene, |scene| render(scene, TreeSelector(scene), args))?;
        if args.once {
            // a line for each counted call: two iterations of each
            for rays in [power.1, power.1, tree.1, tree.1] {
                println!("{rays}");
            }
            continue;
        }
        let mut row = vec![n.to_string(), digits(power.0), digits(tree.0), format!("{:.2}", power.0 / tree.0)];
        if counted {
            let [a, b] = count(&folder, n, args)?;
            by_tree.push((n, b));
            row.extend([a, b].map(|x| format!("{x:.0}")));
            row.extend([a * power.0, b * tree.0].map(|x| format!("{x:.2}")));
        }
        println!("{}", row.join(", "));
        row.resize(COLUMNS.split(", ").count(), "-".into());
        table.add(row);
    }
    by_tree.sort_by_key(|(n, _)| *n);
    let [Some((fewest, few)), Some((most, many))] = [by_tree.first(), by_tree.last()] else { return Ok(true) };
    let ratio = many / few;
    println!("{most} emitters take {ratio:.2} times the instructions per ray of {fewest}, {MOST} allowed over one");
    if args.write {
        results.header.push(("ratio of the last row to the first".into(), format!("{ratio:.2}, {MOST} allowed")));
        results.header.push(("valgrind".into(), provenance::version_of("valgrind")));
        results.tables.push(table);
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(*fewest > 1 || ratio <= MOST)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
