//! What it saves to keep statistics when something moves: `ears` after an edit, with the statistics of the scene as it was
//! ([`Keep::Statistics`]) and without ([`Keep::Nothing`]), by counted cost, never by time.
//!
//! Each render is many iterations of one sample per pixel, as a frame loop makes them. Before an edit the statistics are
//! those of eight iterations. Errors are relMSE against a picture of the edited scene with another seed and 128 samples
//! per pixel, without the worst 0.1 % of its pixels and less what that picture's own noise adds. The error of one render
//! at the cost of another lies on the line through its own iterations in logarithms, or on one of constant error times
//! cost beyond their ends.

use clap::Parser;
use croupier::unstable::cost::{COST_BOUNCE, COST_CAMERA, COST_SHADOW, COST_STRAIGHT};
use croupier::unstable::film::PixelStats;
use croupier::unstable::scene::blob::Camera;
use croupier::{Budget, EditError, Scene, SceneEdit, Settings, StepResult, Strategy};
use croupier_benches::exit::exit_code;
use croupier_benches::placed::place_metal_sphere;
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::{Median, digits};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::description::SceneDescription;
use croupier_host::renderer::{Keep, Renderer, RendererError};
use std::error::Error;
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "What it saves to keep statistics when something moves")]
struct Args {
    /// Write benches/results/moves.md.
    #[arg(long)]
    write: bool,
    /// Renders of each row, each with a seed of its own.
    #[arg(long, default_value_t = 6)]
    seeds: u64,
    /// Columns and rows of the pictures.
    #[arg(long, default_value_t = 96)]
    side: u32,
}

const NAME: &str = "moves";
/// Iterations of one sample per pixel, before and after an edit.
const ITERATIONS: usize = 8;
/// Iterations after which errors are compared.
const SHOWN: [usize; 4] = [1, 2, 4, 8];
/// Iterations of a reference, each as long as all before it: 128 samples per pixel.
const REFERENCE: u32 = 8;
/// Share of the pixels that are left out.
const OUTLIERS: f64 = 1e-3;
const SHARDS: u32 = 16;

/// An edit.
type Change = fn(&mut SceneEdit<'_>, &Before) -> Result<(), EditError>;

/// What edits change, as it was baked.
struct Before {
    camera: Camera,
    materials: Vec<croupier::unstable::scene::blob::Material>,
}

/// The camera, turned about the vertical axis.
fn turn(scene: &mut SceneEdit<'_>, before: &Before, degrees: f32) -> Result<(), EditError> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let turn = |[x, y, z]: [f32; 3]| [cos * x + sin * z, y, cos * z - sin * x];
    let Camera { origin, forward, right, down, .. } = before.camera;
    let turned =
        Camera { origin: turn(origin), forward: turn(forward), right: turn(right), down: turn(down), ..before.camera };
    scene.camera(turned)
}

/// The sphere that is an instance, moved along x.
fn shift(scene: &mut SceneEdit<'_>, x: f32) -> Result<(), EditError> {
    let map = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    scene.transform(0, [map; 2])
}

/// Edits with their names.
type Edits = &'static [(&'static str, Change)];

/// Index of the red wall's material, and of the lamp's.
const RED: u32 = 1;
const LAMP: u32 = 3;

const BOX_EDITS: Edits = &[
    ("camera turned by 1 degree", |s, b| turn(s, b, 1.0)),
    ("camera turned by 10 degrees", |s, b| turn(s, b, 10.0)),
    ("sphere moved by 0.05", |s, _| shift(s, 0.05)),
    ("sphere moved by 0.4", |s, _| shift(s, 0.4)),
    ("red wall made blue", |s, b| {
        let mut material = b.materials[RED as usize];
        material.reflectance.reverse();
        s.material(RED, material, &[])
    }),
    ("lamp twice as bright", |s, _| s.emission(LAMP, [34.0, 24.0, 8.0]).map(drop)),
];

const STILL_EDITS: Edits =
    &[("camera turned by 1 degree", |s, b| turn(s, b, 1.0)), ("camera turned by 10 degrees", |s, b| turn(s, b, 10.0))];

/// The built-in box, its metal sphere as an instance.
fn movable_box() -> SceneDescription {
    let mut scene = builtin::cornell_box();
    place_metal_sphere(&mut scene);
    scene
}

/// A picture after an iteration.
#[derive(Clone, Copy)]
struct Point {
    /// Counted cost per pixel so far.
    cost: f64,
    error: f64,
}

/// One iteration, on two threads: pictures do not depend on them.
fn iterate(renderer: &Renderer, samples: u32) -> Result<(), RendererError> {
    renderer.begin_iteration(samples);
    let work = |from: u32| -> Result<(), RendererError> {
        for shard in (from..SHARDS).step_by(2) {
            while renderer.step(shard, Budget { rays: u64::MAX })? == StepResult::More {}
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let other = scope.spawn(|| work(1));
        work(0)?;
        other.join().unwrap_or(Ok(()))
    })?;
    renderer.end_iteration()
}

fn cost(renderer: &Renderer) -> f64 {
    let c = renderer.counters();
    let rays = [
        (c.camera_rays, COST_CAMERA),
        (c.scatter_rays, COST_BOUNCE),
        (c.shadow_rays, COST_SHADOW),
        (c.straight_rays, COST_STRAIGHT),
    ];
    rays.into_iter().map(|(n, cost)| n as f64 * f64::from(cost)).sum()
}

/// relMSE beyond the noise of the reference.
fn error(picture: impl Iterator<Item = PixelStats>, reference: &[PixelStats]) -> f64 {
    let of_pixel = |(x, r): (PixelStats, &PixelStats)| {
        let (x, mean, variance) = (x.mean(), r.mean(), r.variance_of_mean());
        let part = |c: usize| [(x[c] - mean[c]).powi(2), variance[c]].map(|e| e / (mean[c] * mean[c] + 0.01) / 3.0);
        (0..3).map(part).fold([0.0; 2], |sum, e| [sum[0] + e[0], sum[1] + e[1]])
    };
    let mut errors: Vec<[f64; 2]> = picture.zip(reference).map(of_pixel).collect();
    errors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    errors.truncate(errors.len() - (errors.len() as f64 * OUTLIERS) as usize);
    errors.iter().map(|[e, noise]| e - noise).sum::<f64>() / errors.len() as f64
}

/// Error at a cost.
fn error_at(curve: &[Point], cost: f64) -> f64 {
    let after = curve.partition_point(|p| p.cost < cost);
    match (after.checked_sub(1).and_then(|i| curve.get(i)), curve.get(after)) {
        (Some(a), Some(b)) => {
            let t = (cost / a.cost).ln() / (b.cost / a.cost).ln();
            a.error * (b.error / a.error).powf(t)
        }
        (Some(end), None) | (None, Some(end)) => end.error * end.cost / cost,
        (None, None) => f64::NAN,
    }
}

/// A scene and the settings of its pictures.
struct Subject {
    blob: AlignedBytes,
    settings: Settings,
    before: Before,
}

impl Subject {
    fn new(scene: &SceneDescription, side: u32) -> Result<Self, Box<dyn Error>> {
        let blob = bake(scene, &BakeOptions::default(), |_, _| {})?.bytes;
        let view = Scene::from_bytes(&blob)?;
        let settings = Settings { size: [side; 2], shards: SHARDS, ..Settings::for_scene(&view) };
        let before = Before { camera: *view.camera, materials: view.materials.to_vec() };
        Ok(Self { settings, before, blob })
    }

    fn renderer(&self, strategy: &str, seed: u64) -> Result<Renderer, Box<dyn Error>> {
        let strategy = Strategy::parse(strategy)?;
        let shadow_roulette = strategy.is_efficiency_aware();
        let settings = Settings { strategy, seed, shadow_roulette, ..self.settings };
        Ok(Renderer::new(self.blob.clone(), &settings)?)
    }

    /// The edited scene, well rendered.
    fn reference(&self, change: Change) -> Result<Vec<PixelStats>, Box<dyn Error>> {
        let renderer = self.renderer("ears", 1 << 32)?;
        renderer.edit(Keep::Nothing, |scene| change(scene, &self.before))?;
        for i in 0..REFERENCE {
            iterate(&renderer, 1 << i.saturating_sub(1))?;
        }
        Ok(renderer.with_film(|film| film.pixels().collect()))
    }

    /// Errors after each iteration of the edited scene.
    fn curve(
        &self,
        strategy: &str,
        seed: u64,
        keep: Keep,
        change: Change,
        reference: &[PixelStats],
    ) -> Result<Vec<Point>, Box<dyn Error>> {
        let renderer = self.renderer(strategy, seed)?;
        if keep == Keep::Statistics {
            (0..ITERATIONS).try_for_each(|_| iterate(&renderer, 1))?;
        }
        renderer.edit(keep, |scene| change(scene, &self.before))?;
        let mut curve = Vec::new();
        for _ in 0..ITERATIONS {
            iterate(&renderer, 1)?;
            let error = renderer.with_film(|film| error(film.pixels(), reference));
            curve.push(Point { cost: cost(&renderer) / reference.len() as f64, error });
        }
        Ok(curve)
    }
}

fn median(values: impl Iterator<Item = f64>) -> String {
    Median::of(&values.collect::<Vec<_>>()).map_or_else(|| "-".into(), |m| m.to_string())
}

/// The rows of an edit.
fn add_rows(
    table: &mut Table,
    subject: &Subject,
    seeds: u64,
    name: &str,
    change: Change,
) -> Result<(), Box<dyn Error>> {
    let reference = subject.reference(change)?;
    let mut runs = Vec::new();
    for seed in 1..=seeds {
        let run = |strategy, keep| subject.curve(strategy, seed, keep, change, &reference);
        runs.push([run("ears", Keep::Nothing)?, run("ears", Keep::Statistics)?, run("classic", Keep::Nothing)?]);
    }
    for n in SHOWN {
        let at = |which: usize| runs.iter().map(move |run| run[which][n - 1]);
        let mean = |which: usize, of: fn(Point) -> f64| digits(at(which).map(of).sum::<f64>() / runs.len() as f64);
        let ratio = |which: usize| {
            median(runs.iter().map(|run| {
                let forgotten = run[0][n - 1];
                error_at(&run[which], forgotten.cost) / forgotten.error
            }))
        };
        table.add([
            name.to_string(),
            n.to_string(),
            mean(0, |p| p.cost),
            mean(1, |p| p.cost),
            mean(0, |p| p.error),
            mean(1, |p| p.error),
            ratio(1),
            ratio(2),
        ]);
        println!("{}", table.last());
    }
    Ok(())
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let mut results = Results::of_this_run(NAME);
    let columns = "edit, iterations, cost forgotten, cost kept, relMSE forgotten, relMSE kept, \
        kept over forgotten at equal cost, classic over forgotten at equal cost";
    let scenes = [("built-in box", movable_box(), BOX_EDITS), ("still life", builtin::showcase(), STILL_EDITS)];
    for (name, scene, edits) in scenes {
        let subject = Subject::new(&scene, args.side)?;
        let mut table = Table::new(name, columns);
        println!("{name}\n{}", table.head());
        for (edit, change) in edits {
            add_rows(&mut table, &subject, args.seeds, edit, *change)?;
        }
        results.tables.push(table);
    }
    if args.write {
        let picture = format!("{0} x {0} pixels, {1} seeds, one sample per pixel and iteration", args.side, args.seeds);
        results.header.push(("pictures".into(), picture));
        let interval = "median over seeds [95 % interval of the median; below six seeds the range]";
        results.header.push(("ratios".into(), interval.into()));
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
