//! What processes that share a picture send to each other: the table of docs/CLUSTER.md.

use crate::embedding::{ITERATIONS, baked, settings};
use crate::runner::finish;
use croupier::unstable::film::AovSet;
use croupier::{Plan, Scene, Session, Settings, Shard, Strategy};
use croupier_host::blob::AlignedBytes;

/// Titles of the columns.
pub const COLUMNS: &str =
    "picture | shards | layers | pixels | statistics at most | bytes per pixel | shards in memory";

/// Bytes that all shards of a plan save at most.
fn most(plan: &Plan) -> usize {
    (0..plan.settings().shards).map(|i| plan.saved_shard(i)).sum()
}

/// A row of the table, from the plan alone: bytes of one iteration of all shards.
fn row(name: &str, settings: &Settings) -> String {
    let of = |s: &Settings| Plan::new(s).expect("settings that can be used");
    let nothing = of(&Settings { strategy: Strategy::parse("none").expect("a strategy"), ..*settings });
    let plan = of(settings);
    let ([width, height], shards, layers) = (settings.size, settings.shards, settings.aovs != AovSet::NONE);
    let (pixels, all) = (most(&nothing), most(&plan));
    let statistics = all - pixels;
    let memory: usize = (0..shards).map(|i| plan.shard_of(i).size).sum();
    let per_pixel = all as f64 / (f64::from(width) * f64::from(height));
    let layers = if layers { "standard" } else { "none" };
    format!("| {name} | {shards} | {layers} | {pixels} | {statistics} | {per_pixel:.1} | {memory} |")
}

/// Rows of the table.
pub fn rows() -> Vec<String> {
    let bytes = baked();
    let scene = Scene::from_bytes(&bytes).expect("the box");
    let large = |shards, aovs: bool| Settings {
        size: [1920, 1080],
        shards,
        aovs: aovs.into(),
        strategy: Strategy::parse("ears").expect("a strategy"),
        ..Settings::for_scene(&scene)
    };
    vec![
        row("`B`, 64 x 64", &settings(&scene, 8)),
        row("1920 x 1080", &large(64, false)),
        row("1920 x 1080", &large(64, true)),
        row("1920 x 1080", &large(1024, false)),
    ]
}

/// Bytes that all shards of picture `B` save in each iteration.
pub fn measured() -> Vec<usize> {
    let bytes = baked();
    let scene = Scene::from_bytes(&bytes).expect("the box");
    let plan = Plan::new(&settings(&scene, 8)).expect("settings that can be used");
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut blocks: Vec<_> = (0..8).map(|i| AlignedBytes::zeroed(plan.shard_of(i).size)).collect();
    let mut session = Session::new(scene, &plan, shared.as_mut()).expect("a session");
    let shards = (0..).zip(&mut blocks).map(|(i, block)| Shard::new(&plan, i, block.as_mut()));
    let mut shards: Vec<_> = shards.collect::<Result<_, _>>().expect("shards");
    let one = |samples: u32| {
        session.begin_iteration(samples);
        shards.iter_mut().for_each(|shard| finish(&session, shard, 1 << 20));
        session.end_iteration(&shards).expect("all shards are done");
        shards.iter().map(Shard::saved_len).sum()
    };
    ITERATIONS.into_iter().map(one).collect()
}
