//! What choosing lights by the tree costs and brings against choosing them by power, under 1 to 10,000 emitters of
//! about the same light in all (`croupier_tests::many_lights`).
//!
//! relMSE is from the film's own variances at equal samples, instructions per ray are callgrind's (`--count`), cost is
//! their product: what a picture of one error costs, up to a factor that all rows share. The tree is built for every row,
//! also where bakers leave it out. The goal is at most three times the instructions per ray of a single emitter.

use clap::Parser;
use croupier::unstable::light::{LightSelector, LightTree, PowerSelector, TreeSelector, build_light_tree};
use croupier::unstable::scene::Records;
use croupier::unstable::scene::blob::{LightNode, NONE};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult, Strategy};
use croupier_benches::callgrind::{self, Folder, bench_collect};
use croupier_benches::exit::exit_code;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_tests::many_lights::cloud;
use std::error::Error;
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Lights chosen by the tree and by power, under 1 to 10,000 emitters")]
struct Args {
    /// Numbers of emitters.
    #[arg(long, value_delimiter = ',', default_value = "1,4,8,16,32,100,1000,10000")]
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

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let folder = Folder::new("lights")?;
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
        print!("{n:>6} emitters: relMSE {:.5} -> {:.5}, {:.2} times less", power.0, tree.0, power.0 / tree.0);
        if args.count {
            let list = n.to_string();
            let (spp, depth) = (args.spp.to_string(), args.depth.to_string());
            let arguments = ["--once", "--emitters", &list, "--spp", &spp, "--depth", &depth];
            let calls = callgrind::each_call(&folder, &arguments)?;
            let per_ray = |k: usize| {
                let rays = calls[2 * k].0.parse::<f64>().unwrap_or(f64::NAN);
                (calls[2 * k].1 + calls[2 * k + 1].1) as f64 / rays
            };
            let [a, b] = [per_ray(0), per_ray(1)];
            print!("; instructions per ray {a:.0} -> {b:.0}; cost {:.2} -> {:.2}", a * power.0, b * tree.0);
        }
        println!();
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code("lights", run(&Args::parse()))
}
