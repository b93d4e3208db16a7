//! The longest call of a host's frame loop (`embed-example/host/examples/frame_loop.rs`), in instructions: each call of
//! the renderer is a function after which callgrind writes what it has counted, so that every single call is known.
//!
//! Two renders for each strategy. The end of an iteration, edits and reading are those of a picture of 1920 x 1080 with
//! auxiliary values, after paths of four segments; steps are those of whole paths in a strip of that picture. A third one
//! of both strategies alike has ten thousand instances, of which one moves.

use clap::Parser;
use croupier::unstable::accel::Primitive;
use croupier::unstable::scene::blob::{Camera, Light};
use croupier::{Budget, Scene, Settings, StepResult, Strategy};
use croupier_benches::callgrind::{self, Folder};
use croupier_benches::exit::exit_code;
use croupier_benches::placed::{place_metal_sphere, place_metal_spheres};
use croupier_benches::provenance;
use croupier_benches::results::{Results, Table};
use croupier_host::builtin;
use croupier_host::description::SceneDescription;
use croupier_host::renderer::{Keep, Renderer, RendererError};
use std::collections::BTreeMap;
use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "The longest call of a frame loop, counted by callgrind")]
struct Args {
    /// Write benches/results/frame.md.
    #[arg(long)]
    write: bool,
    /// Fail if a call that the example makes takes a millisecond or more. Edits of ten thousand instances are none of them:
    /// those take longer, as the table says.
    #[arg(long)]
    check: bool,
    /// Only this strategy.
    #[arg(long)]
    only: Option<String>,
    /// Rows of the picture whose iterations end.
    #[arg(long, default_value_t = 1080)]
    rows: u32,
    /// Make the calls on this blob and print the kind of each: what the program runs under valgrind.
    #[arg(long, hide = true, requires = "strategy")]
    blob: Option<std::path::PathBuf>,
    #[arg(long, hide = true)]
    strategy: Option<String>,
    /// Measure steps instead of ends.
    #[arg(long, hide = true)]
    steps: bool,
    /// Measure edits of the scene with many instances.
    #[arg(long, hide = true)]
    crowd: bool,
}

const NAME: &str = "frame";
const STRATEGIES: [&str; 2] = ["classic", "ears"];
const COLUMNS: u32 = 1920;
const SHARDS: u32 = 64;
/// Rows of the picture whose steps are measured.
const STRIP: u32 = 48;
/// Budgets of pieces of the end of an iteration, in units of a ray; the second is that of the example.
const FINISH: [u64; 2] = [2_000, 6_000];
/// The budget of the example for pieces of the end of an iteration.
const EXAMPLE_FINISH: u64 = FINISH[1];
/// Budgets of steps, in rays; the first is that of the example.
const STEP: [u64; 3] = [1_250, 2_000, 10_000];
/// A millisecond at 3 G instructions a second.
const LIMIT: u64 = 3_000_000;
/// Side of the square of instances: 10,000 in all.
const CROWD: u32 = 100;
/// What is done to them.
const MOVE: &str = "move one of 10000 instances";
const REBUILD: &str = "rebuild the top level of 10000 instances";

/// The calls, by kind in their order.
#[derive(Default)]
struct Calls(Vec<String>);

impl Calls {
    fn make<T>(&mut self, kind: &str, call: impl FnOnce() -> T) -> T {
        self.0.push(kind.into());
        let (mut call, mut result) = (Some(call), None);
        callgrind::bench_collect(&mut || result = call.take().map(|c| c()));
        result.expect("the call was made")
    }
}

/// Whole paths, in pieces of both sizes in turn.
fn steps(renderer: &Renderer, calls: &mut Calls) -> Result<(), RendererError> {
    for rays in FINISH {
        renderer.begin_iteration(1);
        for shard in 0..renderer.plan().settings().shards {
            for rays in STEP.into_iter().cycle() {
                let kind = format!("step, {rays}");
                if calls.make(&kind, || renderer.step(shard, Budget { rays }))? == StepResult::Done {
                    break;
                }
            }
        }
        finish(renderer, rays, calls)?;
    }
    Ok(())
}

/// Ends an iteration; a call is named by the stage that it begins with.
fn finish(renderer: &Renderer, rays: u64, calls: &mut Calls) -> Result<(), RendererError> {
    loop {
        let kind = format!("finish_iteration ({}), {rays}", renderer.finishing_stage());
        if calls.make(&kind, || renderer.finish_iteration(Budget { rays }))? == StepResult::Done {
            return Ok(());
        }
    }
}

/// Two iterations, whose ends are in pieces of one size each, and what else a frame calls.
fn ends(renderer: &Renderer, calls: &mut Calls) -> Result<(), RendererError> {
    let (camera, light, object) =
        renderer.with_scene(|scene| (*scene.camera, scene.lights[0], scene.instances[0].to_world));
    for rays in FINISH {
        calls.make("begin_iteration", || renderer.begin_iteration(1));
        for shard in 0..SHARDS {
            calls.make("first step of a shard, 1", || renderer.step(shard, Budget { rays: 1 }))?;
            while renderer.step(shard, Budget { rays: u64::MAX })? == StepResult::More {}
        }
        calls.make("read the unfinished pixels of one of 64 shards", || {
            renderer.with_unfinished(0, |pixel, mean, samples| {
                black_box((pixel, mean, samples));
            });
        });
        finish(renderer, rays, calls)?;
    }
    calls.make("error estimate", || black_box(renderer.with_film(|film| film.error_estimate())));
    calls.make("read 16384 pixels of the film", || {
        renderer.with_film(|film| {
            (0..16384).for_each(|i| {
                black_box(film.pixel(i).mean());
            })
        })
    });
    for (keep, name) in [(Keep::Statistics, "statistics"), (Keep::Nothing, "nothing")] {
        calls.make(&format!("edit the camera, keep {name}"), || {
            let [x, y, z] = camera.origin;
            renderer.edit(keep, |s| s.camera(Camera { origin: [x + 0.01, y, z], ..camera }))
        })?;
        calls.make(&format!("edit a light, keep {name}"), || {
            let emission = light.emission.map(|x| x * 0.5);
            renderer.edit(keep, |s| s.light(0, Light { emission, ..light }))
        })?;
        calls.make(&format!("move an object, keep {name}"), || {
            let mut moved = object;
            moved.iter_mut().for_each(|key| key[0][3] += 0.25);
            renderer.edit(keep, |s| s.transform(0, moved))
        })?;
        renderer.edit(keep, |s| s.transform(0, object))?;
        renderer.edit(keep, |s| s.light(0, light))?;
        renderer.edit(keep, |s| s.camera(camera))?;
        calls.make("begin_iteration", || renderer.begin_iteration(1));
    }
    Ok(())
}

/// Moves one of many, far and near, with the tree refitted or built anew.
fn crowd(renderer: &Renderer, calls: &mut Calls) -> Result<(), RendererError> {
    let index = CROWD * CROWD / 2;
    let object = renderer.with_scene(|scene| scene.instances[index as usize].to_world);
    let mut scratch = Vec::new();
    renderer.edit(Keep::Nothing, |s| {
        scratch.resize(s.rebuild_len(), <Primitive as bytemuck::Zeroable>::zeroed());
        Ok(())
    })?;
    for (i, keep) in [Keep::Statistics, Keep::Nothing].into_iter().enumerate() {
        let mut moved = object;
        moved.iter_mut().for_each(|key| key[1][3] += 0.1 * (i + 1) as f32);
        calls.make(MOVE, || renderer.edit(keep, |s| s.transform(index, moved)))?;
        calls.make(REBUILD, || renderer.edit(keep, |s| s.rebuild(&mut scratch)))?;
    }
    Ok(())
}

/// The built-in box with a carpet of small spheres.
fn crowded() -> SceneDescription {
    let mut scene = builtin::cornell_box();
    let step = 1.8 / CROWD as f32;
    let map = |i: u32| {
        let at = [-0.9 + step * (i % CROWD) as f32, 0.05, -0.9 + step * (i / CROWD) as f32];
        std::array::from_fn(|k| {
            let mut line = [0.0, 0.0, 0.0, at[k]];
            line[k] = 0.02;
            line
        })
    };
    place_metal_spheres(&mut scene, (0..CROWD * CROWD).map(map));
    scene
}

/// Makes the calls.
fn run_calls(args: &Args, blob: &Path, strategy: &str) -> Result<Calls, Box<dyn Error>> {
    let bytes = callgrind::read(blob)?;
    let scene = Settings::for_scene(&Scene::from_bytes(&bytes)?);
    let strategy = Strategy::parse(strategy)?;
    let settings = Settings { strategy, shards: SHARDS, aovs: true.into(), ..scene };
    let mut calls = Calls::default();
    match args.steps {
        _ if args.crowd => {
            let s = Settings { size: [64, 36], shards: 1, ..settings };
            crowd(&Renderer::new(bytes, &s)?, &mut calls)?;
        }
        true => {
            let s = Settings { size: [COLUMNS, STRIP], shards: 2, ..settings };
            steps(&Renderer::new(bytes, &s)?, &mut calls)?;
        }
        false => {
            let s = Settings { size: [COLUMNS, args.rows], max_depth: 4, ..settings };
            ends(&Renderer::new(bytes, &s)?, &mut calls)?;
        }
    }
    Ok(calls)
}

/// For each kind of call how many there were, and the instructions of the longest.
type Longest = BTreeMap<String, (u64, u64)>;

/// Whether the example makes calls of this kind, with this budget.
fn is_of_example(kind: &str) -> bool {
    let budget = kind.rsplit_once(", ").and_then(|(_, n)| n.parse::<u64>().ok());
    match kind {
        MOVE | REBUILD => false,
        _ if kind.starts_with("step, ") => budget == Some(STEP[0]),
        _ if kind.starts_with("finish_iteration") => budget == Some(EXAMPLE_FINISH),
        _ => true,
    }
}

/// Runs this program with `args` under callgrind.
fn count(folder: &Folder, args: &[&str], longest: &mut Longest) -> Result<(), Box<dyn Error>> {
    for (kind, n) in callgrind::each_call(folder, args)? {
        let (calls, most) = longest.entry(kind).or_default();
        (*calls, *most) = (*calls + 1, n.max(*most));
    }
    Ok(())
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    if let (Some(blob), Some(strategy)) = (&args.blob, &args.strategy) {
        run_calls(args, blob, strategy)?.0.iter().for_each(|kind| println!("{kind}"));
        return Ok(true);
    }
    let mut results = Results::of_this_run(NAME);
    let folder = Folder::new(NAME)?;
    let mut scene = builtin::cornell_box();
    place_metal_sphere(&mut scene);
    let blob = folder.bake("built-in", &scene)?;
    let many = folder.bake("crowd", &crowded())?;
    let mut above = Vec::new();
    for strategy in STRATEGIES.into_iter().filter(|s| args.only.as_deref().is_none_or(|only| only == *s)) {
        let (blob, rows) = (blob.to_string_lossy(), args.rows.to_string());
        let child = ["--blob", &blob, "--strategy", strategy, "--rows", &rows];
        let mut longest = Longest::new();
        count(&folder, &[&child[..], &["--steps"]].concat(), &mut longest)?;
        count(&folder, &child, &mut longest)?;
        let many = many.to_string_lossy();
        count(&folder, &["--blob", &many, "--strategy", strategy, "--crowd"], &mut longest)?;
        let mut table = Table::new(strategy, "call and its budget, calls, instructions of the longest, below 1 ms");
        for (kind, (calls, most)) in &longest {
            if is_of_example(kind) && *most >= LIMIT {
                above.push(format!("{strategy}, {kind}: {most} instructions"));
            }
            let below = if *most < LIMIT { "yes" } else { "no" };
            table.add([kind.replace(',', ":"), calls.to_string(), most.to_string(), below.into()]);
        }
        print!("{table}");
        results.tables.push(table);
    }
    if args.write {
        results.header.push((
            "picture".into(),
            format!("built-in box with an instance, {COLUMNS} x {} pixels, {SHARDS} shards", args.rows),
        ));
        results.header.push(("1 ms".into(), format!("{LIMIT} instructions")));
        results.header.push(("valgrind".into(), provenance::version_of("valgrind")));
        println!("wrote {}", results.write(NAME)?.display());
    }
    above.iter().for_each(|kind| println!("too long: {kind}"));
    Ok(!args.check || above.is_empty())
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
