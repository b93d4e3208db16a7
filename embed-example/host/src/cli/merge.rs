//! `croupier merge`

use super::console::{Outcome, note, say, say_json};
use super::output::{Outputs, Written};
use super::values::{Exposure, exposure, exr_path};
use croupier_host::part::{Merged, merge};
use croupier_host::render::{RenderStats, merged};
use croupier_host::text;
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Files of all parts, in any order
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// EXR file of the picture; a tone-mapped PNG is written beside it
    #[arg(short, long, value_name = "FILE", default_value = "croupier.exr", value_parser = exr_path)]
    output: PathBuf,
    /// Exposure of the PNG in stops, -100 to 100, or auto: from the picture; that of the parts if absent. The EXR stays as
    /// it is
    #[arg(long, value_name = "STOPS", value_parser = exposure, allow_negative_numbers = true)]
    exposure: Option<Exposure>,
    /// Add the denoised picture as layer `denoised`, and tone-map it for the PNG
    #[arg(long)]
    denoise: bool,
    /// Also write false-colour pictures, as `render` does
    #[arg(long)]
    false_color: bool,
    /// Save what all parts have learned of the scene
    #[arg(long, value_name = "FILE")]
    cache_out: Option<PathBuf>,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    stats: &'a RenderStats,
    parts: usize,
    width: u32,
    height: u32,
    strategy: &'a str,
    seed: u64,
    /// A part was stopped before its target.
    stopped_early: bool,
    output: &'a Path,
    denoised: bool,
    /// Complete files.
    written: &'a [PathBuf],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Outcome {
    let outputs = Outputs::new(&args.output, args.cache_out.as_deref(), None, args.false_color);
    outputs.check()?;
    outputs.spare(&args.parts, None)?;
    let parts = merge(&args.parts)?;
    let Merged { rendered, settings, exposure, stopped, .. } = &parts;
    if args.cache_out.is_some() && rendered.cache.is_none() {
        return Err(format!("roulette strategy `{}` learns nothing from the scene", settings.strategy.name()).into());
    }
    for part in stopped {
        note(&format!("{} was stopped: its samples count, there are fewer of them", text::path(part)));
    }
    let (picture, stats) = merged(&parts, args.denoise);
    let exposure = args.exposure.unwrap_or(exposure.map_or(Exposure::Auto, Exposure::Stops));
    let image = if args.denoise { "denoised" } else { "" };
    let Written { files, error } = outputs.write(&picture, rendered.cache.as_deref(), image, exposure);
    let [width, height] = settings.size;
    let report = Report {
        stats: &stats,
        parts: args.parts.len(),
        width,
        height,
        strategy: &settings.strategy.to_string(),
        seed: settings.seed,
        stopped_early: !stopped.is_empty(),
        output: outputs.exr,
        denoised: args.denoise,
        written: &files,
    };
    if args.json {
        say_json(&report)?;
    } else {
        let RenderStats { spp, rays, relmse_estimate, .. } = &stats;
        let error = relmse_estimate.map_or(String::new(), |e| format!(", estimated relMSE {e:.3e}"));
        let millions = *rays as f64 * 1e-6;
        say(&format!("{} parts: {spp:.1} samples per pixel, {millions:.1} million rays{error}", args.parts.len()))?;
        let names: Vec<_> = files.iter().map(|p| text::path(p)).collect();
        say(&format!("wrote {}", names.join(", ")))?;
    }
    error.map_or(Ok(()), |e| Err(e.into()))
}
