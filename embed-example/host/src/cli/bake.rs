//! `croupier bake`

use super::console::{Outcome, say, say_json};
use super::notes::{Notes, about};
use super::scene;
use super::values::crp_path;
use croupier::Scene;
use croupier_host::image::{ImageError, write_whole};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder with scene.json, or .obj file
    scene: PathBuf,
    /// Where the baked scene goes. Programs map this file into memory: replace it by another `bake`, never edit it in
    /// place
    #[arg(short, long, value_name = "FILE", value_parser = crp_path)]
    output: PathBuf,
    #[command(flatten)]
    scene_flags: scene::SceneFlags,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    output: &'a Path,
    bytes: usize,
    triangles: usize,
    dropped_triangles: u32,
    hash: String,
    #[serde(flatten)]
    notes: Notes,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Outcome {
    super::output::writable(&args.output)?;
    let scene::Opened { bytes, notes, files, .. } = scene::open(Some(&args.scene), &args.scene_flags)?;
    super::output::spares(&[&args.output], &files)?;
    let scene = Scene::from_bytes(&bytes).map_err(|e| about(Some(&args.scene))(&e))?;
    write_whole(&args.output, |out| out.write_all(&bytes).map_err(|e| ImageError::Write(args.output.clone(), e)))?;
    let (triangles, dropped_triangles) = (scene.triangles.len(), scene.info.dropped_triangles);
    let hash = format!("{:016x}", scene.hash);
    if args.json {
        return say_json(&Report {
            output: &args.output,
            bytes: bytes.len(),
            triangles,
            dropped_triangles,
            hash,
            notes,
        });
    }
    let dropped = match dropped_triangles {
        0 => String::new(),
        n => format!(" ({n} degenerate ones dropped)"),
    };
    say(&format!("wrote {}: {triangles} triangles{dropped}, {} bytes", args.output.display(), bytes.len()))
}
