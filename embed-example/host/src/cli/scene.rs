//! Scene bytes of a path.

use super::look::LookFlags;
use super::notes::{Notes, about};
use super::progress;
use super::values::{Exposure, bytes};
use croupier_host::bake::{self, BakeError};
use croupier_host::builtin;
use croupier_host::description::SceneDescription;
use croupier_host::load::{self, LoadOptions, LoadReport};
use croupier_host::look::{Given, dress};
use croupier_host::text;
use memmap2::Mmap;
use std::error::Error;
use std::fs::{self, File};
use std::ops::Deref;
use std::path::{Path, PathBuf};

/// Name of the built-in Cornell box.
pub(crate) const CORNELL: &str = "cornell";

/// A scene blob, in memory or on disk.
pub(crate) enum SceneBytes {
    /// Mapped baked file: pages are read when they are touched.
    Mapped(Mmap),
    /// Scene that was baked just now.
    Baked(bake::Baked),
}

impl Deref for SceneBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Baked(baked) => &baked.bytes,
        }
    }
}

/// Flags of commands that bake.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct SceneFlags {
    /// Compensate no material for the energy that single scattering between microfacets loses: darker rough surfaces, as
    /// in renderers without this effect. Baked files stay as they are
    #[arg(long)]
    single_scattering: bool,
    /// Refuse what is otherwise replaced with a note: missing or differently written files, unknown materials and
    /// colours, faces with some texture coordinates only, bytes behind the end of an image
    #[arg(long)]
    strict: bool,
    /// Most bytes that textures and environment maps may take in all while they are decoded, such as 512MiB
    #[arg(long, value_name = "SIZE", default_value = "2GiB", value_parser = bytes)]
    texture_memory: u64,
    #[command(flatten)]
    look: LookFlags,
}

impl SceneFlags {
    /// Are notes about what is nearly right to be errors?
    pub(crate) fn is_strict(&self) -> bool {
        self.strict
    }
}

/// A scene that was opened.
pub(crate) struct Opened {
    pub(crate) bytes: SceneBytes,
    /// What had to be assumed, ignored or left out.
    pub(crate) notes: Notes,
    /// Files that were read.
    pub(crate) files: Vec<PathBuf>,
    /// Exposure, unless a flag gives one.
    pub(crate) exposure: Exposure,
}

/// Opens a scene: a baked `.crp` file, anything that loads and bakes (a folder with `scene.json`, an `.obj`),
/// `cornell` for the built-in Cornell box, or, without a path, the built-in still life. What had to be assumed, ignored or left out is printed and returned.
pub(crate) fn open(path: Option<&Path>, flags: &SceneFlags) -> Result<Opened, Box<dyn Error>> {
    let Some(path) = path.filter(|p| is_baked(p)) else { return open_described(path, flags).map(|(_, opened)| opened) };
    let flag = if flags.single_scattering { Some("--single-scattering") } else { flags.look.any() };
    if let Some(flag) = flag {
        return Err(format!("{}: `{flag}` is for baking, not for baked files", text::path(path)).into());
    }
    let exposure = Exposure::Stops(0.0);
    Ok(Opened { bytes: map(path)?, notes: Notes::default(), files: vec![path.into()], exposure })
}

fn is_baked(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("crp"))
}

/// [`open`] for anything but baked files, with the description that was baked: it has names.
pub(crate) fn open_described(
    path: Option<&Path>,
    flags: &SceneFlags,
) -> Result<(SceneDescription, Opened), Box<dyn Error>> {
    if let Some(path) = path.filter(|p| is_baked(p)) {
        let path = text::path(path);
        return Err(
            format!("{path}: baked files have no names of objects; give the scene that it was baked from").into()
        );
    }
    let mut options = LoadOptions { strict: flags.strict, texture_memory: flags.texture_memory };
    let (look, environment) = flags.look.look(&mut options)?;
    let (mut description, mut loaded) = match path {
        Some(path) if !is_cornell(path) => load::load_with(path, &options, &look)?,
        _ => {
            let mut scene = if path.is_some() { builtin::cornell_box() } else { builtin::showcase() };
            let notes = dress(&mut scene, &Given::SCENE, &look).map_err(|e| about(path)(&e))?;
            (scene, LoadReport { notes, ..LoadReport::default() })
        }
    };
    loaded.notes.extend(environment.notes);
    if flags.single_scattering {
        description.materials.iter_mut().for_each(|m| m.compensated = false);
    }
    // of a folder: its scene.json
    let file = loaded.files.first().map(PathBuf::as_path).or(path);
    let baked = bake(&description).map_err(|e| about(file)(&e))?;
    if path.is_some() && baked.report.triangles == 0 {
        let count = baked.report.dropped_degenerate;
        return Err(about(file)(&format!("none of the {count} triangles has an area: there is nothing to see")).into());
    }
    let notes = Notes::of(&loaded, &baked.report);
    notes.print(path);
    let mut files = loaded.files;
    files.extend(environment.files);
    let exposure = match path {
        // its area light brings the walls to about a fifth of white
        Some(path) if is_cornell(path) => Exposure::Stops(1.0),
        Some(_) if !loaded.framed => Exposure::Stops(0.0),
        _ => Exposure::Auto,
    };
    Ok((description, Opened { bytes: SceneBytes::Baked(baked), notes, files, exposure }))
}

/// The built-in box, unless there is a file of that name.
fn is_cornell(path: &Path) -> bool {
    path == Path::new(CORNELL) && !path.exists()
}

fn bake(description: &SceneDescription) -> Result<bake::Baked, BakeError> {
    let bar = progress::Baking::start();
    bake::bake(description, &bake::BakeOptions::default(), |stage, _| bar.show(stage))
}

fn map(path: &Path) -> Result<SceneBytes, Box<dyn Error>> {
    let failed = |e| format!("cannot read {}: {e}", text::path(path));
    // Opening a pipe waits for its other end: look first.
    let data = fs::metadata(path).map_err(failed)?;
    if !data.is_file() {
        return Err(format!("cannot read {}: it is not a file", text::path(path)).into());
    }
    if data.len() == 0 {
        return Err(format!("{}: the file is empty", text::path(path)).into());
    }
    let file = File::open(path).map_err(failed)?;
    // SAFETY: the bytes must not change while they are mapped. This program never writes into an existing file
    // (`image::write_whole` renames a new one over it, which leaves the mapped one as it is); that no other program
    // does is asked of the user in the help text of `bake`.
    let map = unsafe { Mmap::map(&file) }.map_err(failed)?;
    Ok(SceneBytes::Mapped(map))
}
