//! `croupier render`

use super::cache::CacheFlags;
use super::console::{Outcome, say, say_json};
use super::notes::{Notes, about};
use super::output::Outputs;
use super::progress::Rendering;
use super::scene;
use super::settings::SettingsFlags;
use super::values::{Exposure, exposure, exr_path, positive};
use croupier::Scene;
use croupier::unstable::MAX_PATH_LENGTH;
use croupier_host::render::{PlanSummary, RenderOptions, RenderResult, RenderStats, Target, check, render_scene};
use croupier_host::statistics::Statistics;
use serde::Serialize;
use std::error::Error;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder with scene.json, .obj file, or baked .crp file; `cornell` for the built-in Cornell box; a built-in still life if absent
    pub(crate) scene: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) flags: Flags,
}

/// Flags of a render.
#[derive(clap::Args)]
pub(crate) struct Flags {
    /// EXR file of the picture; a tone-mapped PNG is written beside it
    #[arg(short, long, value_name = "FILE", default_value = "croupier.exr", value_parser = exr_path)]
    output: PathBuf,
    #[command(flatten)]
    settings: SettingsFlags,
    #[command(flatten)]
    until: Until,
    #[command(flatten)]
    scene: scene::SceneFlags,
    /// Threads, 0 for one per processor; the image does not depend on their number
    #[arg(long, value_name = "N", default_value_t = RenderOptions::default().threads)]
    threads: usize,
    /// Exposure of the PNG in stops, -100 to 100, or auto: from the picture. Absent: auto for the built-in
    /// still life and scenes without a camera, 1 for the Cornell box, else 0. The EXR stays as it is
    #[arg(long, value_name = "STOPS", value_parser = exposure, allow_negative_numbers = true)]
    exposure: Option<Exposure>,
    /// Add the denoised picture as layer `denoised`, and tone-map it for the PNG; always for the built-in still life
    #[arg(long)]
    denoise: bool,
    /// Also write roulette factors, rays per sample and paths per sample as false-colour pictures with legends:
    /// NAME.factor1.png to NAME.factor4.png, NAME.cost.png, NAME.paths.png
    #[arg(long)]
    false_color: bool,
    /// Print statistics of paths, iterations and time
    #[arg(long)]
    stats: bool,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
    // The heading of the last flags would hold for any after them.
    #[command(flatten)]
    cache: CacheFlags,
}

/// Stop condition; 64 samples per pixel if none is given.
#[derive(clap::Args)]
#[group(multiple = false)]
struct Until {
    /// Stop after this many samples per pixel, at least 1 [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Stop after this many seconds of rendering, above 0, without loading and writing: no iteration begins that would
    /// pass them at the speed so far, one that has begun is finished, and the first, a sample per pixel, is rendered in
    /// any case
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Stop after this many rays of all kinds, at least 1: no iteration but the first begins that would pass them at
    /// the cost so far
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// Stop after the iteration that brings the estimated relMSE down to this, above 0, with 4 samples per pixel at
    /// least
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
    /// Options for the library.
    fn options(&self) -> Result<RenderOptions, Box<dyn Error>> {
        let mut options = RenderOptions {
            target: self.until.target(),
            threads: self.threads,
            denoise: self.denoise,
            calibrate: self.stats,
            ..self.settings.options()?
        };
        self.cache.apply(&mut options)?;
        // Said before the scene is loaded.
        check(&options)?;
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
    /// The PNG shows the denoised picture.
    denoised: bool,
    /// Complete files.
    written: &'a [PathBuf],
}

/// Runs the command.
pub(crate) fn run(path: Option<&Path>, flags: &Flags) -> Outcome {
    let outputs = Outputs::new(&flags.output, flags.cache.cache_out.as_deref(), flags.false_color);
    // Said now, not after an hour of rendering.
    outputs.check()?;
    let mut options = flags.options()?;
    // the first picture that anyone sees
    options.denoise |= path.is_none();
    let scene::Opened { bytes, mut notes, exposure } = scene::open(path, &flags.scene)?;
    let validated = Scene::from_bytes(&bytes).map_err(|e| about(path)(&e))?;
    if let Some(text) = shortened(&validated, options.settings.max_depth) {
        notes.add(path, text);
    }
    let watch = Rendering::start(options.target);
    let result = render_scene(validated, &options, &watch)
        .map_err(|e| flags.cache.about(&e).unwrap_or_else(|| about(path)(&e)))?;
    drop(watch);
    let RenderResult { picture, stats, statistics, plan, cache, stopped_early } = &result;
    if let Some([x, y]) = stats.first_non_finite {
        let count = stats.counters.get("non_finite").unwrap_or(&1);
        notes.add(path, format!("{count} contributions were not finite and left out, the first in pixel ({x}, {y})"));
    }
    let exposure = flags.exposure.unwrap_or(exposure);
    let image = if options.denoise { "denoised" } else { "" };
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
        denoised: options.denoise,
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

/// Note that paths end earlier than the scene asks for, if no flag asked for it.
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
    if r.denoised {
        say("the PNG shows the denoised picture, the EXR has both")?;
    }
    if names.is_empty() { Ok(()) } else { say(&format!("wrote {}", names.join(", "))) }
}
