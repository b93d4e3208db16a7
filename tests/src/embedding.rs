//! The picture that every example of embedding renders: same scene, settings and iterations, hence the same hash,
//! whatever the language, processor, threads or machines.

use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;

/// Settings besides the scene's own, as names and texts.
pub const SETTINGS: [(&str, &str); 6] = [
    ("rrs", "ears"),
    ("ring", "64"),
    ("ledger", "256"),
    ("cache-bytes", "65536"),
    ("split-budget", "64"),
    ("pixel-estimator", "blocks"),
];

/// Samples per pixel of each iteration.
pub const ITERATIONS: [u32; 3] = [2, 2, 4];

/// The file with the pictures' hashes.
pub const HASHES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../embed-example/hashes.txt");

/// Pictures by name, with their numbers of shards: one for a single thread, one for several threads or machines.
pub const PICTURES: [(&str, u32); 2] = [("A", 1), ("B", 8)];

/// The baked scene of `embed-example/box.crp`.
pub fn baked() -> AlignedBytes {
    bake(&builtin::cornell_blocks(), &BakeOptions::default(), |_, _| {}).unwrap().bytes
}

/// The settings of a picture with this number of shards.
pub fn settings(scene: &Scene<'_>, shards: u32) -> Settings {
    let mut settings = Settings { shards, ..Settings::for_scene(scene) };
    for (name, text) in SETTINGS {
        settings.set(name, text).unwrap();
    }
    settings
}

/// Renders a picture, all shards on this thread; its hash.
pub fn render(blob: &[u8], shards: u32) -> u64 {
    let scene = Scene::from_bytes(blob).unwrap();
    let plan = Plan::new(&settings(&scene, shards)).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut blocks: Vec<AlignedBytes> = (0..shards).map(|i| AlignedBytes::zeroed(plan.shard_of(i).size)).collect();
    let mut session = Session::new(scene, &plan, shared.as_mut()).unwrap();
    let mut shards: Vec<Shard<'_>> =
        (0..).zip(&mut blocks).map(|(i, block)| Shard::new(&plan, i, block.as_mut()).unwrap()).collect();
    for samples in ITERATIONS {
        session.begin_iteration(samples);
        for shard in &mut shards {
            while shard.step(&session, Budget { rays: 1000 }) == StepResult::More {}
        }
        session.end_iteration(&shards).unwrap();
    }
    hash(session.film().pixels().flat_map(|pixel| pixel.mean().map(|x| x as f32)))
}

/// 64-bit FNV-1a over the little-endian bytes of numbers: mean R, G and B of every pixel in the order of rows.
pub fn hash(values: impl Iterator<Item = f32>) -> u64 {
    let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    values.flat_map(f32::to_le_bytes).fold(0xcbf2_9ce4_8422_2325, mix)
}
