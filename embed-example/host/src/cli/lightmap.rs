//! `croupier lightmap`

use super::console::{note, say, say_json};
use super::notes::{Notes, about};
use super::progress::Rendering;
use super::settings::SettingsFlags;
use super::until::Until;
use super::values::{Exposure, exposure, exr_path, share};
use super::{output, scene, signals};
use croupier::{Scene, Settings};
use croupier_host::drive::DriveError;
use croupier_host::image::{Rgb, write_png};
use croupier_host::lightmap::{Lightmap, LightmapError, LightmapOptions, Surface, TexelOrigin, render_lightmap};
use croupier_host::look::exposure::auto;
use croupier_host::memory::{Demand, machine};
use croupier_host::render::{RenderOptions, check, plan};
use croupier_host::text;
use croupier_host::tonemap::{Curve, tonemap};
use serde::Serialize;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Columns and rows of a map whose size is not given.
const SIZE: [u32; 2] = [256, 256];

#[derive(clap::Args)]
#[command(after_help = "Without --size the map has 256x256 texels. Samples are those of each texel.")]
pub(crate) struct Args {
    /// Folder with scene.json, .gltf, .glb, .obj, .ply or .stl file; `cornell` for the built-in Cornell box
    scene: PathBuf,
    /// Object, or instance, whose lightmap is rendered; several share the map by their texture coordinates
    #[arg(long, value_name = "NAME", required = true)]
    object: Vec<String>,
    /// EXR file of the map: irradiance, and layers of its making. A tone-mapped PNG is written beside it
    #[arg(short, long, value_name = "FILE", default_value = "lightmap.exr", value_parser = exr_path)]
    output: PathBuf,
    /// Rings of texels around charts that take the value of a neighbour, so that bilinear look-ups do not read black
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(0..=4096))]
    gutter: u32,
    /// Share of a texel's rays that may first meet the back of an opaque surface, 0 to 1; a texel with more is taken to be
    /// inside of something, and filled from its neighbours
    #[arg(long, value_name = "X", default_value_t = 0.5, value_parser = share, allow_negative_numbers = true)]
    backs: f32,
    /// Denoise the map, chart by chart
    #[arg(long)]
    denoise: bool,
    #[command(flatten)]
    until: Until,
    /// Threads, up to 4096, 0 for one per processor; the map does not depend on their number
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=4096))]
    threads: u16,
    /// Exposure of the PNG in stops, -100 to 100, or auto: from the map, the default. It shows irradiance over pi, as a
    /// white surface does
    #[arg(long, value_name = "STOPS", value_parser = exposure, allow_negative_numbers = true)]
    exposure: Option<Exposure>,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsFlags,
    #[command(flatten)]
    scene_flags: scene::SceneFlags,
}

#[derive(Serialize)]
struct Report<'a> {
    width: u32,
    height: u32,
    charts: u32,
    sampled_texels: usize,
    filled_texels: usize,
    gutter_texels: usize,
    spp: u32,
    rays: u64,
    seconds: f64,
    stopped_early: bool,
    #[serde(flatten)]
    notes: &'a Notes,
    written: &'a [&'a Path],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<ExitCode, Box<dyn Error>> {
    let path = Some(args.scene.as_path());
    let png = args.output.with_extension("png");
    output::writable(&args.output)?;
    output::writable(&png)?;
    let render = RenderOptions { target: args.until.target(), ..args.settings.options()? };
    check(&render)?;
    let (description, scene::Opened { bytes, mut notes, files, .. }) = scene::open_described(path, &args.scene_flags)?;
    output::spares(&[&args.output, &png], &files)?;
    let file = files.first().map(PathBuf::as_path).or(path);
    let names: Vec<&str> = args.object.iter().map(String::as_str).collect();
    let surface = Surface::of(&description, &names).map_err(|e| about(file)(&e))?;
    drop(description);
    let validated = Scene::from_bytes(&bytes).map_err(|e| about(file)(&e))?;
    let mut settings = render.settings;
    if settings.size == [0; 2] {
        settings.size = SIZE;
    }
    let options = LightmapOptions {
        settings,
        target: render.target,
        threads: args.threads.into(),
        denoise: args.denoise,
        gutter: args.gutter,
        most_backs: args.backs,
    };
    let aovs = settings.aovs.with(LightmapOptions::AOVS);
    let memory = plan(&validated, &RenderOptions { settings: Settings { aovs, ..settings }, ..render })?;
    let demand = Demand::new(bytes.len() as u64, &memory, settings.size, aovs);
    if let Some(text) = demand.judge(machine()).map_err(|e| about(file)(&e))? {
        notes.add(file, text);
    }
    signals::save_at_first();
    let watch = Rendering::start(options.target);
    let map = render_lightmap(validated, &surface, &options, &watch).map_err(|e| explained(&e, file))?;
    drop(watch);
    for overlap in &map.overlaps {
        let text = overlap.to_string();
        if args.scene_flags.is_strict() {
            return Err(about(file)(&text).into());
        }
        notes.add(file, text);
    }
    let picture = map.picture();
    picture.write_exr(&args.output)?;
    write_png(&png, picture.width, picture.height, &shown(&map, args.exposure.unwrap_or(Exposure::Auto)))?;
    report(args, &map, &notes, &[&args.output, &png])?;
    let stopped = map.rendered.stopped_early;
    if let Some(signal) = signals::received().filter(|_| stopped) {
        note(&format!("{} ended the render: the map has fewer samples", signals::name(signal)));
    }
    let status = signals::exit_status().filter(|_| stopped);
    Ok(status.map_or(ExitCode::SUCCESS, ExitCode::from))
}

/// Text of an error with what to do.
fn explained(e: &LightmapError, file: Option<&Path>) -> String {
    match e {
        LightmapError::Drive(DriveError::Memory(_)) => {
            about(file)(&format!("{e}; less of --size or --shards takes less"))
        }
        _ => about(file)(e),
    }
}

/// The map as white surfaces show it.
fn shown(map: &Lightmap, exposure: Exposure) -> Vec<[u8; 3]> {
    let white = |e: &[f32; 3]| e.map(|x| x * std::f32::consts::FRAC_1_PI);
    let [width, height] = map.size.map(|n| n as usize);
    let image = Rgb { width, height, pixels: map.irradiance.iter().map(white).collect() };
    let stops = match exposure {
        Exposure::Stops(stops) => stops,
        Exposure::Auto => auto(&image),
    };
    tonemap(&image, stops, Curve::Shoulder)
}

fn report(args: &Args, map: &Lightmap, notes: &Notes, written: &[&Path]) -> Result<(), Box<dyn Error>> {
    let [width, height] = map.size;
    let count = |origin| map.count(origin);
    let report = Report {
        width,
        height,
        charts: map.charts,
        sampled_texels: count(TexelOrigin::Samples),
        filled_texels: count(TexelOrigin::Filled),
        gutter_texels: count(TexelOrigin::Gutter),
        spp: map.rendered.spp,
        rays: map.rendered.counters.rays(),
        seconds: map.rendered.seconds,
        stopped_early: map.rendered.stopped_early,
        notes,
        written,
    };
    if args.json {
        return say_json(&report);
    }
    let Report { charts, sampled_texels, filled_texels, gutter_texels, spp, rays, seconds, .. } = report;
    say(&format!(
        "{width}x{height} texels, {charts} charts: {sampled_texels} texels sampled, {filled_texels} filled, {gutter_texels} in the gutter"
    ))?;
    say(&format!("{spp} samples per texel, {:.1} million rays in {seconds:.1} s", rays as f64 * 1e-6))?;
    let names: Vec<_> = written.iter().map(|p| text::path(p)).collect();
    say(&format!("wrote {}", names.join(", ")))
}
