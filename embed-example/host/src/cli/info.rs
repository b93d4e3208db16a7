//! `croupier info`

use super::console::{Outcome, say, say_json};
use super::notes::{Notes, about};
use super::scene;
use super::settings::SettingsFlags;
use croupier::unstable::MAX_PATH_LENGTH;
use croupier::unstable::profile::AnyProfile;
use croupier::{Scene, SceneError};
use croupier_host::effects::{Reason, beyond, reasons};
use croupier_host::render::{PlanSummary, RenderOptions, check, plan};
use serde::Serialize;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder with scene.json, .obj file, or baked .crp file; `cornell` for the built-in Cornell box; a built-in still life if absent
    scene: Option<PathBuf>,
    #[command(flatten)]
    scene_flags: scene::SceneFlags,
    /// Print the facts as one line of JSON
    #[arg(long)]
    json: bool,
    // What the memory of a render depends on.
    #[command(flatten)]
    settings: SettingsFlags,
}

#[derive(Serialize)]
struct Facts {
    bytes: usize,
    hash: String,
    triangles: usize,
    dropped_triangles: u32,
    vertices: usize,
    nodes: usize,
    leaves: usize,
    materials: usize,
    textures: usize,
    texels: usize,
    lights: usize,
    bounds: [[f32; 3]; 2],
    size: [u32; 2],
    /// Path segments that the scene asks for, and the most that a path gets.
    max_depth: u32,
    longest_path: u32,
    /// Effects that the scene calls for, each with what uses it.
    effects: Vec<Reason>,
    /// Name of the kernel profile, and the effects that it contains beyond those of the scene.
    profile: &'static str,
    profile_beyond: Vec<&'static str>,
    /// Memory of a render; absent in builds that cannot render.
    plan: Option<PlanSummary>,
    #[serde(flatten)]
    notes: Notes,
}

impl Facts {
    fn of(bytes: &[u8], options: &RenderOptions, notes: Notes) -> Result<Self, SceneError> {
        let scene = Scene::from_bytes(bytes)?;
        Ok(Self {
            bytes: bytes.len(),
            hash: format!("{:016x}", scene.hash),
            triangles: scene.triangles.len(),
            dropped_triangles: scene.info.dropped_triangles,
            vertices: scene.vertices.len(),
            nodes: scene.nodes.len(),
            leaves: scene.leaves.len(),
            materials: scene.materials.len(),
            textures: scene.textures.len(),
            texels: scene.texels.len(),
            lights: scene.lights.len(),
            bounds: [scene.info.bounds_min, scene.info.bounds_max],
            size: scene.camera.size,
            max_depth: scene.info.max_depth,
            longest_path: scene.info.max_depth.min(MAX_PATH_LENGTH),
            effects: reasons(&scene),
            profile: AnyProfile::smallest(scene.effects).name(),
            profile_beyond: beyond(&scene),
            plan: plan(&scene, options).ok(),
            notes,
        })
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Outcome {
    let path = args.scene.as_deref();
    let options = args.settings.options()?;
    // Said before the scene is loaded.
    check(&options)?;
    let scene::Opened { bytes, notes, .. } = scene::open(path, &args.scene_flags)?;
    let f = Facts::of(&bytes, &options, notes).map_err(|e| about(path)(&e))?;
    if args.json {
        return say_json(&f);
    }
    let Facts { triangles, dropped_triangles, vertices, nodes, leaves, materials, textures, texels, lights, .. } = f;
    let line = |name: &str, text: String| say(&format!("{name:12}{text}"));
    line("bytes", format!("{} (hash {})", f.bytes, f.hash))?;
    line("triangles", format!("{triangles} ({dropped_triangles} degenerate ones dropped), {vertices} vertices"))?;
    line("tree", format!("{nodes} nodes, {leaves} leaves"))?;
    line("materials", format!("{materials}, {textures} textures of {texels} texels in all"))?;
    line("lights", lights.to_string())?;
    line("bounds", format!("{:?} to {:?}", f.bounds[0], f.bounds[1]))?;
    let limited =
        if f.max_depth > MAX_PATH_LENGTH { format!(" (the scene asks for {})", f.max_depth) } else { String::new() };
    let [width, height] = f.size;
    line("picture", format!("{width}x{height} pixels, paths of up to {} segments{limited}", f.longest_path))?;
    let title = |i: usize| if i == 0 { "effects" } else { "" };
    f.effects.iter().enumerate().try_for_each(|(i, reason)| line(title(i), reason.to_string()))?;
    if f.effects.is_empty() {
        line(title(0), "none".into())?;
    }
    let beyond = f.profile_beyond.join(", ");
    let beyond =
        if beyond.is_empty() { "no more than these effects".into() } else { format!("also contains {beyond}") };
    line("profile", format!("{}: {beyond}", f.profile))?;
    f.plan.map_or(Ok(()), |p| line("memory", p.to_string()))
}
