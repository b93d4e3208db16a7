//! The picture of `embed-example/c/box.c` in Rust, compiled as the library is: what `.ci/run c` compares its instructions with.

use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
use std::error::Error;

/// A cache line.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([u8; 64]);

/// Memory as the core wants it.
fn block(lines: &mut [Line]) -> &mut [u8] {
    let bytes = size_of_val(lines);
    // SAFETY: lines are bytes without padding.
    unsafe { std::slice::from_raw_parts_mut(lines.as_mut_ptr().cast(), bytes) }
}

/// What is counted: as croupier_shard_step.
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn rust_shard_step(shard: &mut Shard<'_>, session: &Session<'_, '_>, rays: u64) -> bool {
    shard.step(session, Budget { rays }) == StepResult::More
}

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::fs::read(std::env::args().nth(1).ok_or("usage: overhead SCENE.crp")?)?;
    let memory = |bytes: usize| vec![Line([0; 64]); bytes.div_ceil(64)];
    let mut blob = memory(file.len());
    block(&mut blob)[..file.len()].copy_from_slice(&file);
    let scene = Scene::from_bytes(block(&mut blob))?;
    let mut settings = Settings::for_scene(&scene);
    for (name, text) in [
        ("rrs", "ears"),
        ("ring", "64"),
        ("ledger", "256"),
        ("cache-bytes", "65536"),
        ("split-budget", "64"),
        ("pixel-estimator", "blocks"),
    ] {
        settings.set(name, text)?;
    }
    let plan = Plan::new(&settings)?;
    let (mut shared, mut own) = (memory(plan.session().size), memory(plan.shard().size));
    let mut session = Session::new(scene, &plan, block(&mut shared))?;
    let mut shard = Shard::new(&plan, 0, block(&mut own))?;
    for samples in [2, 2, 4] {
        session.begin_iteration(samples);
        while rust_shard_step(&mut shard, &session, 1000) {}
        session.end_iteration([&shard])?;
    }
    let bytes = session.film().pixels().flat_map(|p| p.mean().map(|x| x as f32)).flat_map(f32::to_le_bytes);
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3));
    println!("{hash:016x}");
    Ok(())
}
