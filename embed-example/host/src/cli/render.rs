//! `croupier render`

use super::cache::CacheFlags;
use super::notes::Notes;
use super::output::Outputs;
use super::progress::Rendering;
use super::settings::SettingsFlags;
use super::{Outcome, say, say_json, scene};
use croupier::{MAX_PATH_LENGTH, Scene};
use croupier_host::render::{PlanSummary, RenderOptions, RenderResult, RenderStats, Target, check, render_scene};
use croupier_host::statistics::Statistics;
use serde::Serialize;
use std::error::Error;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// Folder with scene.json, .obj file, or baked .crp file; the built-in Cornell box if absent
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub flags: Flags,
}

/// How to render and where to put it.
#[derive(clap::Args)]
pub struct Flags {
    /// Where the picture goes; a tone-mapped PNG goes beside it
    #[arg(short, long, value_name = "FILE", default_value = "croupier.exr", value_parser = exr_path)]
    output: PathBuf,
    #[command(flatten)]
    settings: SettingsFlags,
    #[command(flatten)]
    until: Until,
    /// Threads, 0 for one per processor; the image does not depend on them
    #[arg(long, value_name = "N", default_value_t = RenderOptions::default().threads)]
    threads: usize,
    /// Stops of exposure for the PNG; 0 if absent, 1 for the built-in scene
    #[arg(long, value_name = "STOPS", value_parser = super::stops, allow_negative_numbers = true)]
    exposure: Option<f32>,
    /// Add the denoised picture as layer `denoised`, and make the PNG from it
    #[arg(long)]
    denoise: bool,
    /// Also write roulette factors, costs and paths as pictures with legends: NAME.factor1.png to NAME.factor4.png,
    /// NAME.cost.png, NAME.paths.png
    #[arg(long)]
    false_color: bool,
    /// Print what paths, iterations and learning took
    #[arg(long)]
    stats: bool,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
    // The heading of the last flags would hold for any after them.
    #[command(flatten)]
    cache: CacheFlags,
}

/// When to stop; 64 samples per pixel if nothing is given.
#[derive(clap::Args)]
#[group(multiple = false)]
struct Until {
    /// Stop after this many samples per pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Stop after this time, loading and writing not counted: no iteration begins that would pass it at the speed so
    /// far, one that has begun is finished, and the first, a sample per pixel, is rendered in any case
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Stop after this many rays: no iteration begins that would pass them at the cost so far, but for the first
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// Stop after the iteration that brings the estimated relMSE to this, with 4 samples per pixel at least
    #[arg(long, value_name = "E", value_parser = positive, allow_negative_numbers = true)]
    until_error: Option<f64>,
}

impl Until {
    fn target(&self) -> Target {
        let given = self.spp.map(Target::Spp).or(self.seconds.map(Target::Seconds));
        let given = given.or(self.rays.map(Target::Rays)).or(self.until_error.map(Target::Error));
        given.unwrap_or(RenderOptions::default().target)
    }
}

impl Flags {
    /// The same for the library.
    fn options(&self) -> Result<RenderOptions, Box<dyn Error>> {
        let mut options = RenderOptions {
            target: self.until.target(),
            threads: self.threads,
            denoise: self.denoise,
            calibrate: self.stats,
            ..self.settings.options()?
        };
        // Said before the scene is loaded.
        check(&options)?;
        self.cache.apply(&mut options)?;
        Ok(options)
    }
}

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    stats: &'a RenderStats,
    #[serde(flatten)]
    notes: &'a Notes,
    #[serde(flatten)]
    statistics: Option<&'a Statistics>,
    width: usize,
    height: usize,
    plan: &'a PlanSummary,
    strategy: &'a str,
    seed: u64,
    stopped_early: bool,
    output: &'a Path,
    png: &'a Path,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    false_color: &'a [PathBuf],
    #[serde(skip_serializing_if = "Option::is_none")]
    cache_out: Option<&'a Path>,
    /// Those of the files above that are complete.
    written: &'a [PathBuf],
}

/// Runs the command.
pub fn run(path: Option<&Path>, flags: &Flags) -> Outcome {
    let outputs = Outputs::new(&flags.output, flags.cache.cache_out.as_deref(), flags.false_color);
    // Said now, not after an hour of rendering.
    outputs.check()?;
    let options = flags.options()?;
    let (bytes, mut notes) = scene::open(path)?;
    let validated = Scene::from_bytes(&bytes).map_err(|e| scene::about(path)(&e))?;
    if let Some(text) = shortened(&validated, options.settings.max_depth) {
        notes.add(path, text);
    }
    let watch = Rendering::start(options.target);
    let result = render_scene(validated, &options, &watch)
        .map_err(|e| flags.cache.about(&e).unwrap_or_else(|| scene::about(path)(&e)))?;
    drop(watch);
    let RenderResult { picture, stats, statistics, plan, cache, stopped_early } = &result;
    if let Some([x, y]) = stats.first_non_finite {
        let count = stats.counters.get("non_finite").unwrap_or(&1);
        notes.add(path, format!("{count} contributions were not finite and left out, the first in pixel ({x}, {y})"));
    }
    // Its lamp lights the walls to about a fifth of white.
    let exposure = flags.exposure.unwrap_or(if path.is_none() { 1.0 } else { 0.0 });
    let image = if flags.denoise { "denoised" } else { "" };
    let written = outputs.write(picture, cache.as_deref(), image, exposure);
    let report = Report {
        stats,
        notes: &notes,
        statistics: flags.stats.then_some(statistics),
        width: picture.width,
        height: picture.height,
        plan,
        strategy: &options.settings.strategy.to_string(),
        seed: options.settings.seed,
        stopped_early: *stopped_early,
        output: outputs.exr,
        png: &outputs.png,
        false_color: &outputs.false_color,
        cache_out: outputs.cache,
        written: &written.files,
    };
    // The figures are worth having even if a file is missing.
    if flags.json {
        say_json(&report)?
    } else {
        print(&report)?
    }
    written.error.map_or(Ok(()), |e| Err(e.into()))
}

/// What to say if paths end before the scene wants them to, and nobody asked for it.
fn shortened(scene: &Scene<'_>, given: u32) -> Option<String> {
    let wanted = scene.info.max_depth;
    let text = || format!("paths end after {MAX_PATH_LENGTH} segments, the scene asks for {wanted}");
    (given == 0 && wanted > MAX_PATH_LENGTH).then(text)
}

fn print(r: &Report<'_>) -> Outcome {
    let early = if r.stopped_early { "stopped early: " } else { "" };
    let RenderStats { spp, rays, seconds, mrays_per_s, .. } = *r.stats;
    say(&format!(
        "{early}{}x{} pixels, {spp:.1} samples per pixel, {:.1} million rays in {seconds:.1} s, {mrays_per_s:.2} Mrays/s",
        r.width,
        r.height,
        rays as f64 * 1e-6
    ))?;
    if let Some(e) = r.stats.relmse_estimate {
        let interval = r.stats.relmse_interval.map_or(String::new(), |[a, b]| format!(" ({a:.3e} to {b:.3e})"));
        say(&format!("estimated relMSE {e:.3e}{interval}"))?;
    }
    for (name, count) in r.stats.counters.iter().filter(|(_, count)| **count > 0) {
        say(&format!("{name}: {count}"))?;
    }
    say(&format!("memory: {}", r.plan))?;
    if let Some(statistics) = r.statistics {
        say(&format!("\n{statistics}"))?;
    }
    let names: Vec<_> = r.written.iter().map(|p| p.display().to_string()).collect();
    if names.is_empty() { Ok(()) } else { say(&format!("wrote {}", names.join(", "))) }
}

fn exr_path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        Ok(path)
    } else {
        Err("the name must end in .exr".into())
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        Ok(_) => Err("must be above 0 and finite".into()),
        Err(e) => Err(e.to_string()),
    }
}
