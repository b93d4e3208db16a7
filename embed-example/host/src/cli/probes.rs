//! `croupier probes`

use super::console::{note, say, say_json};
use super::look::point;
use super::notes::{Notes, about};
use super::progress::Rendering;
use super::settings::SettingsFlags;
use super::values::{counts, json_path, share};
use super::{output, scene, signals};
use croupier::{Scene, Settings};
use croupier_host::image::{ImageError, write_whole};
use croupier_host::memory::{Demand, machine};
use croupier_host::probes::{ProbeFile, ProbeOptions, grid, picture_size, render_probes};
use croupier_host::render::{RenderOptions, Target, check, plan};
use croupier_host::text;
use serde::Serialize;
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder with scene.json, .gltf, .glb, .obj, .ply or .stl file; `cornell` for the built-in Cornell box
    scene: PathBuf,
    #[command(flatten)]
    places: Places,
    /// JSON file of the probes
    #[arg(short, long, value_name = "FILE", default_value = "probes.json", value_parser = json_path)]
    output: PathBuf,
    /// Directions of each probe, 2 to 16777216
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(2..=1 << 24))]
    spp: u32,
    /// Share of directions that may first meet the back of an opaque surface, 0 to 1; a probe with more is marked as not
    /// valid: it is inside of something
    #[arg(long, value_name = "X", default_value_t = 0.5, value_parser = share, allow_negative_numbers = true)]
    backs: f32,
    /// Threads, up to 4096, 0 for one per processor; probes do not depend on their number
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=4096))]
    threads: u16,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsFlags,
    #[command(flatten)]
    scene_flags: scene::SceneFlags,
}

/// Where the probes are.
#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct Places {
    /// Middles of so many equal cells of the scene's bounds along x, y and z
    #[arg(long, value_name = "NxNxN", value_parser = counts)]
    grid: Option<[u32; 3]>,
    /// Points in the world; may be given several times
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    at: Vec<[f64; 3]>,
}

#[derive(Serialize)]
struct Report<'a> {
    probes: usize,
    valid: usize,
    #[serde(flatten)]
    notes: &'a Notes,
    written: &'a Path,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<ExitCode, Box<dyn Error>> {
    let path = Some(args.scene.as_path());
    output::writable(&args.output)?;
    let render = args.settings.options()?;
    if render.settings.size != [0; 2] || render.settings.adaptive {
        return Err("probes have no `--size` and no `--adaptive`: `--spp` is the number of their directions".into());
    }
    check(&render)?;
    let (description, scene::Opened { bytes, mut notes, files, .. }) = scene::open_described(path, &args.scene_flags)?;
    output::spares(&[&args.output], &files)?;
    let file = files.first().map(PathBuf::as_path).or(path);
    let validated = Scene::from_bytes(&bytes).map_err(|e| about(file)(&e))?;
    let positions = match args.places.grid {
        Some(counts) => grid([validated.info.bounds_min, validated.info.bounds_max], counts),
        None => args.places.at.iter().map(|p| p.map(|x| x as f32)).collect(),
    };
    let options = ProbeOptions {
        settings: render.settings,
        rays: args.spp,
        threads: args.threads.into(),
        most_backs: args.backs,
    };
    let settings = Settings { size: picture_size(positions.len(), args.spp), ..render.settings };
    let memory = plan(&validated, &RenderOptions { settings, ..render.clone() })?;
    let demand = Demand::new(bytes.len() as u64, &memory, settings.size, settings.aovs);
    if let Some(text) = demand.judge(machine()).map_err(|e| about(file)(&e))? {
        notes.add(file, text);
    }
    signals::save_at_first();
    let watch = Rendering::start(Target::Spp(args.spp));
    let probes = render_probes(validated, &description, &positions, &options, &watch);
    let probes = probes.map_err(|e| about(file)(&e))?;
    drop(watch);
    let failed = |e| ImageError::Write(args.output.clone(), e);
    let json = serde_json::to_string(&ProbeFile::new(&probes))?;
    write_whole(&args.output, |out| writeln!(out, "{json}").map_err(failed))?;
    let valid = probes.iter().filter(|p| p.valid).count();
    if args.json {
        say_json(&Report { probes: probes.len(), valid, notes: &notes, written: &args.output })?;
    } else {
        say(&format!("{} probes, {valid} of them valid", probes.len()))?;
        say(&format!("wrote {}", text::path(&args.output)))?;
    }
    if let Some(signal) = signals::received() {
        note(&format!("{} ended the render: the probes have fewer directions", signals::name(signal)));
    }
    Ok(signals::exit_status().map_or(ExitCode::SUCCESS, ExitCode::from))
}
