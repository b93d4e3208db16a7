//! What path guiding brings: relMSE at equal samples, and times CPU seconds, with guiding and without.
//!
//! Both sides render the same seeds in turn, on one thread, from bare shards: loading and baking do not count. The
//! error is the variance of a pixel over the seeds of a side, over the squared mean of all sides plus 0.01, without
//! the worst share of the pixels: no reference takes part, and the brightness of both sides is there to compare.

use clap::Parser;
use croupier::unstable::learn::Guiding;
use croupier::unstable::learn::guiding::GuideUse;
use croupier::unstable::profile::{AnyProfile, Profile, ProfileVisitor};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult, Strategy};
use croupier_benches::clock::Clock;
use croupier_benches::exit::exit_code;
use croupier_benches::results::{Results, Table};
use croupier_benches::stats::digits;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::load::load;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Relative error and efficiency with path guiding and without")]
struct Args {
    /// Folder with the scenes.
    #[arg(long, default_value = "../shared/scenes")]
    scenes: PathBuf,
    /// Scenes of that folder.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "pool,kitchen,water_caustic,living_room,bathroom,cbox,veach_mis"
    )]
    scene: Vec<String>,
    /// Roulette strategies.
    #[arg(long, value_delimiter = ',', default_value = "ears,classic")]
    rrs: Vec<String>,
    /// Settings of guiding that are compared with `off`.
    #[arg(long, value_delimiter = ',', default_value = "on,auto")]
    guiding: Vec<String>,
    /// Renders of each side, 2 at least.
    #[arg(long, default_value_t = 4)]
    seeds: u64,
    /// Samples per pixel.
    #[arg(long, default_value_t = 256)]
    spp: u32,
    /// Columns of the pictures; rows follow from the scene's.
    #[arg(long, default_value_t = 96)]
    columns: u32,
    /// Share of the pixels that is left out.
    #[arg(long, default_value_t = 1e-3)]
    trim: f64,
    /// Write benches/results/guiding.md.
    #[arg(long)]
    write: bool,
}

const NAME: &str = "guiding";
const SHARDS: u32 = 4;

/// Means of the pixels and CPU seconds of a render, and what it says of guiding in the end.
type Rendered = Result<(Vec<[f64; 3]>, f64, Option<GuideUse>), Box<dyn Error>>;

/// A render whose profile is to be chosen.
struct Render<'a, 's> {
    scene: Scene<'s>,
    settings: &'a Settings,
    spp: u32,
}

impl ProfileVisitor for Render<'_, '_> {
    type Out = Rendered;

    fn visit<P: Profile + Send + Sync>(self) -> Rendered {
        let plan = Plan::new(self.settings)?;
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        let mut blocks: Vec<_> = (0..SHARDS).map(|_| AlignedBytes::zeroed(plan.shard().size)).collect();
        let mut session = Session::builder(self.scene).profile::<P>().build(&plan, shared.as_mut())?;
        let shards = blocks.iter_mut().zip(0..).map(|(b, i)| Shard::new(&plan, i, b.as_mut()));
        let mut shards = shards.collect::<Result<Vec<_>, _>>()?;
        let (clock, mut done) = (Clock::start(), 0);
        while done < self.spp {
            let samples = done.max(1).min(self.spp - done);
            session.begin_iteration(samples);
            for shard in &mut shards {
                while shard.step(&session, Budget { rays: u64::MAX }) == StepResult::More {}
            }
            session.end_iteration(&shards)?;
            done += samples;
        }
        Ok((session.film().pixels().map(|p| p.mean()).collect(), clock.seconds(), session.guide_use()))
    }
}

/// All renders of a side.
#[derive(Default)]
struct Side {
    pictures: Vec<Vec<[f64; 3]>>,
    seconds: f64,
    /// In how many renders the guide was enabled in the end.
    enabled: u32,
    /// Gains that it promised then.
    promised: Vec<f64>,
}

impl Side {
    fn mean(&self, pixel: usize, channel: usize) -> f64 {
        self.pictures.iter().map(|p| p[pixel][channel]).sum::<f64>() / self.pictures.len() as f64
    }

    /// Mean over picture and channels.
    fn brightness(&self) -> f64 {
        let sum: f64 = self.pictures.iter().flatten().flatten().sum();
        sum / (3 * self.pictures.len() * self.pictures[0].len()) as f64
    }

    /// relMSE of a render, over the pictures of all sides.
    fn error(&self, all: &[Self], trim: f64) -> f64 {
        let n = self.pictures.len() as f64;
        let pixel = |i: usize| {
            let channel = |c: usize| {
                let own = self.mean(i, c);
                let mean = all.iter().map(|side| side.mean(i, c)).sum::<f64>() / all.len() as f64;
                let squares: f64 = self.pictures.iter().map(|p| (p[i][c] - own).powi(2)).sum();
                squares / (n - 1.0) / (mean * mean + 0.01)
            };
            (0..3).map(channel).sum::<f64>() / 3.0
        };
        let mut errors: Vec<f64> = (0..self.pictures[0].len()).map(pixel).collect();
        errors.sort_by(f64::total_cmp);
        errors.truncate(errors.len() - (errors.len() as f64 * trim) as usize);
        errors.iter().sum::<f64>() / errors.len() as f64
    }
}

fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let mut results = Results::of_this_run(NAME);
    let columns = "scene, strategy, guiding, relMSE without, relMSE with, gain at equal samples, CPU s without, \
                   CPU s with, gain in efficiency, brightness without, brightness with, enabled, gain promised";
    let seeds = args.seeds.max(2);
    let mut table = Table::new(&format!("{} samples per pixel, {seeds} seeds", args.spp), columns);
    print!("{}", table.head());
    let named = |name: &String| {
        let found = [Guiding::On, Guiding::Auto].into_iter().find(|mode| mode.name() == name);
        found.ok_or_else(|| format!("--guiding {name}: must be `on` or `auto`"))
    };
    let modes = args.guiding.iter().map(named).collect::<Result<Vec<_>, _>>()?;
    for name in &args.scene {
        let baked = bake(&load(&args.scenes.join(name))?.0, &BakeOptions::default(), |_, _| ())?;
        let scene = Scene::from_bytes(&baked.bytes)?;
        for rrs in &args.rrs {
            let mut s = Settings { shards: SHARDS, strategy: Strategy::parse(rrs)?, ..Settings::for_scene(&scene) };
            s.shadow_roulette = s.strategy.is_efficiency_aware();
            s.size = [args.columns, (args.columns * s.size[1]).div_ceil(s.size[0])];
            let asked = || [Guiding::Off].into_iter().chain(modes.iter().copied());
            let mut sides: Vec<_> = asked().map(|_| Side::default()).collect();
            for seed in 0..seeds {
                for (side, guiding) in sides.iter_mut().zip(asked()) {
                    s.seed = 1 + seed;
                    s.learning.guiding = guiding;
                    let render = Render { scene, settings: &s, spp: args.spp };
                    let guided = guiding != Guiding::Off;
                    let (picture, seconds, guide) =
                        AnyProfile::smallest(scene.effects).dispatch_guided(guided, render)?;
                    side.pictures.push(picture);
                    side.enabled += u32::from(guide.is_some_and(|g| g.enabled));
                    side.promised.extend(guide.and_then(|g| g.gain).map(|g| g.gain));
                    side.seconds += seconds / seeds as f64;
                }
            }
            let off = &sides[0];
            for (on, mode) in sides[1..].iter().zip(&args.guiding) {
                let (a, b) = (off.error(&sides, args.trim), on.error(&sides, args.trim));
                let efficiency = a * off.seconds / (b * on.seconds);
                let numbers = [a, b, a / b, off.seconds, on.seconds, efficiency, off.brightness(), on.brightness()];
                let promised = on.promised.iter().sum::<f64>() / on.promised.len() as f64;
                let watched = match mode.as_str() {
                    "auto" => [format!("{} of {seeds}", on.enabled), digits(promised)],
                    _ => ["-".into(), "-".into()],
                };
                let numbers = numbers.map(digits).into_iter().chain(watched);
                table.add([name.clone(), rrs.clone(), mode.clone()].into_iter().chain(numbers));
                println!("{}", table.last());
            }
        }
    }
    results.tables.push(table);
    if args.write {
        println!("wrote {}", results.write(NAME)?.display());
    }
    Ok(true)
}

fn main() -> ExitCode {
    exit_code(NAME, run(&Args::parse()))
}
