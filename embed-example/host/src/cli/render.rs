//! `croupier render`

use super::cache::CacheFlags;
use super::checkpoint::CheckpointFlags;
use super::console::{Outcome, note, say, say_json};
use super::notes::{Notes, about};
use super::output::{Outputs, Written};
use super::progress::Rendering;
use super::settings::SettingsFlags;
use super::until::Until;
use super::values::{Exposure, exposure, is_part, picture_path};
use super::{scene, signals};
use clap::error::ErrorKind;
use croupier::Scene;
use croupier::unstable::MAX_PATH_LENGTH;
use croupier::unstable::rrs::Space;
use croupier_host::drive::{Part, Rendered};
use croupier_host::memory::{Demand, machine};
use croupier_host::part;
use croupier_host::render::{
    PlanSummary, RenderError, RenderOptions, RenderResult, RenderStats, check, plan, render_part, render_scene,
};
use croupier_host::statistics::Statistics;
use croupier_host::text;
use serde::Serialize;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

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
    /// EXR file of the picture; a tone-mapped PNG is written beside it. With --part a .crpart file
    /// [default: croupier.exr, or part-K-of-N.crpart]
    #[arg(short, long, value_name = "FILE", value_parser = picture_path)]
    output: Option<PathBuf>,
    /// Render part K of N of the picture into one file, for `merge`: with --spp a share of its samples, with --seconds or
    /// --rays so much for each part. Parts learn apart from each other
    #[arg(long, value_name = "K/N", value_parser = str::parse::<Part>, conflicts_with_all = ["denoise", "false_color"])]
    part: Option<Part>,
    #[command(flatten)]
    settings: SettingsFlags,
    #[command(flatten)]
    until: Until,
    #[command(flatten)]
    scene: scene::SceneFlags,
    /// Threads, up to 4096, 0 for one per processor, at most one per shard; the image does not depend on their number
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=4096))]
    threads: u16,
    /// Exposure of the PNG in stops, -100 to 100, or auto: from the picture. Absent: auto for the built-in
    /// still life and scenes without a camera, 1 for the Cornell box, else 0. The EXR stays as it is
    #[arg(long, value_name = "STOPS", value_parser = exposure, allow_negative_numbers = true)]
    exposure: Option<Exposure>,
    /// Add the denoised picture as layer `denoised`, and tone-map it for the PNG; always for the built-in still life
    #[arg(long)]
    denoise: bool,
    /// Also write roulette factors, rays per sample, paths per sample and what path guiding has learned as false-colour
    /// pictures with legends: NAME.factor1.png to NAME.factor4.png, NAME.cost.png, NAME.paths.png, NAME.guide.png
    #[arg(long)]
    false_color: bool,
    /// Print counters, and statistics of paths, iterations and time
    #[arg(long)]
    stats: bool,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
    // The heading of the last flags would hold for any after them.
    #[command(flatten)]
    cache: CacheFlags,
    #[command(flatten)]
    checkpoint: CheckpointFlags,
}

impl Flags {
    /// Options for the library.
    fn options(&self) -> Result<RenderOptions, Box<dyn Error>> {
        let mut options = RenderOptions {
            target: self.until.target(),
            part: self.part,
            threads: self.threads.into(),
            denoise: self.denoise,
            calibrate: self.stats,
            guide_view: self.false_color,
            ..self.settings.options()?
        };
        self.cache.apply(&mut options)?;
        self.checkpoint.apply(&mut options);
        // a part has all that was learned
        options.save_cache |= self.part.is_some() && options.settings.strategy.space() == Some(Space::Scene);
        // Said before the scene is loaded.
        check(&options)?;
        Ok(options)
    }
}

impl Flags {
    /// File of the picture or of the part.
    fn output(&self) -> PathBuf {
        let output = self.output.clone().unwrap_or_else(|| match self.part {
            None => "croupier.exr".into(),
            Some(part) => format!("part-{}-of-{}.crpart", part.number(), part.of()).into(),
        });
        let text = match (self.part, is_part(&output)) {
            (None, true) => "--output FILE.crpart needs --part K/N",
            (Some(_), false) => "--part needs an --output whose name ends in .crpart",
            _ => return output,
        };
        clap::Error::raw(ErrorKind::ArgumentConflict, format!("{text}\n")).exit()
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
    #[serde(skip_serializing_if = "Option::is_none")]
    png: Option<&'a Path>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    false_color: &'a [PathBuf],
    #[serde(skip_serializing_if = "Option::is_none")]
    cache_out: Option<&'a Path>,
    #[serde(skip_serializing_if = "Option::is_none")]
    checkpoint: Option<&'a Path>,
    /// The PNG shows the denoised picture.
    denoised: bool,
    /// Complete files.
    written: &'a [PathBuf],
}

/// Runs the command.
pub(crate) fn run(path: Option<&Path>, flags: &Flags) -> Result<ExitCode, Box<dyn Error>> {
    let checkpoint = flags.checkpoint.output();
    let (output, cache_out) = (flags.output(), flags.cache.cache_out.as_deref());
    let outputs = match flags.part {
        None => Outputs::new(&output, cache_out, checkpoint, flags.false_color),
        Some(_) => Outputs::part(&output, cache_out, checkpoint),
    };
    // Said now, not after an hour of rendering.
    outputs.check()?;
    let mut options = flags.options()?;
    // the first picture that anyone sees
    options.denoise |= path.is_none() && flags.part.is_none();
    let scene::Opened { bytes, mut notes, mut files, exposure } = scene::open(path, &flags.scene)?;
    files.extend(flags.cache.cache_in.clone());
    outputs.spare(&files, flags.checkpoint.input())?;
    let validated = Scene::from_bytes(&bytes).map_err(|e| about(path)(&e))?;
    if let Some(text) = shortened(&validated, options.settings.max_depth) {
        notes.add(path, text);
    }
    let settings = options.settings.with_scene(&validated);
    let memory = plan(&validated, &options)?;
    let demand = Demand::new(bytes.len() as u64, &memory, settings.size, settings.aovs);
    if let Some(text) = demand.judge(machine()).map_err(|e| about(path)(&e))? {
        notes.add(path, text);
    }
    // From here on there is something to save.
    signals::save_at_first();
    if !flags.json {
        let name = path.map_or("built-in scene".into(), text::path);
        let [width, height] = settings.size;
        let (triangles, lights) = (validated.triangles.len(), validated.lights.len());
        say(&format!("{name}: {triangles} triangles, {lights} lights, {width}x{height} pixels"))?;
        let learning = text::bytes(memory.learning_bytes);
        let total = text::bytes(demand.total());
        say(&format!(
            "{}, {} shards: {total} of memory, {learning} of it for learning",
            settings.strategy, memory.shards
        ))?;
    }
    let watch = Rendering::start(options.target);
    let failed = |e: RenderError| {
        let about_file = flags.cache.about(&e).or_else(|| flags.checkpoint.about(&e));
        about_file.unwrap_or_else(|| about(path)(&e))
    };
    let exposure = flags.exposure.unwrap_or(exposure);
    if let Some(part) = flags.part {
        let (rendered, _) = render_part(validated, &options, &watch).map_err(failed)?;
        drop(watch);
        let stops = if let Exposure::Stops(stops) = exposure { Some(stops) } else { None };
        let write = |file: &Path| part::write(file, &validated, &settings, part, options.target, &rendered, stops);
        let written = outputs.write_part(write, rendered.cache.as_deref());
        return report_part(part, &rendered, &written, &notes, flags.json, &output);
    }
    let result = render_scene(validated, &options, &watch).map_err(failed)?;
    drop(watch);
    let RenderResult { picture, stats, statistics, plan, cache, stopped_early, checkpoint_error } = &result;
    if let Some([x, y]) = stats.first_non_finite {
        let count = stats.counters.get("non_finite").unwrap_or(&1);
        notes.add(path, format!("{count} contributions were not finite and left out, the first in pixel ({x}, {y})"));
    }
    let image = if options.denoise { "denoised" } else { "" };
    let mut written = outputs.write(picture, cache.as_deref(), image, exposure);
    if checkpoint_error.is_none() {
        written.files.extend(checkpoint.filter(|c| c.is_file()).map(Path::to_path_buf));
    }
    let drawn = outputs.drawn(picture);
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
        png: outputs.png.as_deref(),
        false_color: &drawn,
        cache_out: outputs.cache,
        checkpoint,
        denoised: options.denoise,
        written: &written.files,
    };
    // The figures are worth having even if a file is missing.
    if flags.json {
        say_json(&report)?
    } else {
        print(&report)?
    }
    if let Some(e) = written.error {
        return Err(e.into());
    }
    if let Some(e) = checkpoint_error {
        return Err(e.clone().into());
    }
    Ok(exit_status(*stopped_early))
}

/// Exit status of a render, and a note if a signal ended it.
fn exit_status(stopped_early: bool) -> ExitCode {
    if let Some(signal) = signals::received().filter(|_| stopped_early) {
        note(&format!("{} ended the render: the picture is partial", signals::name(signal)));
    }
    signals::exit_status().filter(|_| stopped_early).map_or(ExitCode::SUCCESS, ExitCode::from)
}

/// Figures of a part of a picture.
#[derive(Serialize)]
struct PartReport<'a> {
    part: u32,
    of: u32,
    /// Number of the first camera sample of each pixel, and samples per pixel.
    first_sample: u32,
    spp: u32,
    rays: u64,
    seconds: f64,
    stopped_early: bool,
    #[serde(flatten)]
    notes: &'a Notes,
    output: &'a Path,
    /// Complete files.
    written: &'a [PathBuf],
}

/// Says what has become of a part.
fn report_part(
    part: Part,
    r: &Rendered,
    written: &Written,
    notes: &Notes,
    json: bool,
    output: &Path,
) -> Result<ExitCode, Box<dyn Error>> {
    let (number, of, spp, seconds) = (part.number(), part.of(), r.spp, r.seconds);
    let (rays, stopped_early, files) = (r.counters.rays(), r.stopped_early, &written.files);
    let first_sample = r.first_sample;
    if json {
        let report = PartReport {
            part: number,
            of,
            first_sample,
            spp,
            rays,
            seconds,
            stopped_early,
            notes,
            output,
            written: files,
        };
        say_json(&report)?;
    } else {
        let partial = if stopped_early { "partial: " } else { "" };
        let millions = rays as f64 * 1e-6;
        say(&format!(
            "{partial}part {number} of {of}: {spp} samples per pixel from {first_sample} on, {millions:.1} million rays in {seconds:.1} s"
        ))?;
        let names: Vec<_> = files.iter().map(|p| text::path(p)).collect();
        say(&format!("wrote {}", names.join(", ")))?;
    }
    if let Some(e) = &written.error {
        return Err(e.to_string().into());
    }
    if let Some(e) = &r.checkpoint_error {
        return Err(e.clone().into());
    }
    Ok(exit_status(stopped_early))
}

/// Note that paths end earlier than the scene asks for, if no flag asked for it.
fn shortened(scene: &Scene<'_>, given: u32) -> Option<String> {
    let wanted = scene.info.max_depth;
    let text = || format!("paths end after {MAX_PATH_LENGTH} segments, the scene asks for {wanted}");
    (given == 0 && wanted > MAX_PATH_LENGTH).then(text)
}

/// Result and files, a line each; with the statistics also counters and tables.
fn print(r: &Report<'_>) -> Outcome {
    let partial = if r.stopped_early { "partial picture: " } else { "" };
    let RenderStats { spp, rays, seconds, mrays_per_s, .. } = *r.stats;
    let error = r.stats.relmse_estimate.map_or(String::new(), |e| {
        match r.stats.relmse_interval {
            Some([a, b]) => format!(", estimated relMSE {e:.3e} ({a:.3e} to {b:.3e})"),
            // few pixels cause most of it, or light that is not found yet may
            None => format!(", relMSE unresolved: at least {:.3e}", r.stats.relmse_at_least.unwrap_or(e)),
        }
    });
    let millions = rays as f64 * 1e-6;
    say(&format!(
        "{partial}{spp:.1} samples per pixel, {millions:.1} million rays in {seconds:.1} s, {mrays_per_s:.2} Mrays/s{error}"
    ))?;
    if let Some(statistics) = r.statistics {
        for (name, count) in r.stats.counters.iter().filter(|(_, count)| **count > 0) {
            say(&format!("{name}: {count}"))?;
        }
        say(&format!("memory: {}", r.plan))?;
        say(&format!("\n{statistics}"))?;
    }
    let names: Vec<_> = r.written.iter().map(|p| text::path(p)).collect();
    if r.denoised {
        say("the PNG shows the denoised picture, the EXR has both")?;
    }
    if names.is_empty() { Ok(()) } else { say(&format!("wrote {}", names.join(", "))) }
}
