//! Scene bytes of a path.

use super::look::LookFlags;
use super::notes::{Notes, about};
use super::progress;
use super::values::Exposure;
use croupier_host::bake::{self, BakeError};
use croupier_host::builtin;
use croupier_host::description::SceneDescription;
use croupier_host::load::{self, LoadReport};
use croupier_host::look::{Given, dress};
use memmap2::Mmap;
use std::error::Error;
use std::fs::File;
use std::ops::Deref;
use std::path::Path;

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
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct SceneFlags {
    /// Compensate no material for the energy that single scattering between microfacets loses: darker rough surfaces, as
    /// in renderers without this effect. Baked files stay as they are
    #[arg(long)]
    single_scattering: bool,
    #[command(flatten)]
    look: LookFlags,
}

/// A scene that was opened.
pub(crate) struct Opened {
    pub(crate) bytes: SceneBytes,
    pub(crate) notes: Notes,
    /// Exposure, unless a flag gives one.
    pub(crate) exposure: Exposure,
}

/// Opens a scene: a baked `.crp` file, anything that loads and bakes (a folder with `scene.json`, an `.obj`),
/// `cornell` for the built-in Cornell box, or, without a path, the built-in still life. What had to be assumed, ignored or left out is printed and returned.
pub(crate) fn open(path: Option<&Path>, flags: &SceneFlags) -> Result<Opened, Box<dyn Error>> {
    let baked_file = path.is_some_and(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("crp")));
    if let Some(path) = path.filter(|_| baked_file) {
        let flag = if flags.single_scattering { Some("--single-scattering") } else { flags.look.any() };
        if let Some(flag) = flag {
            return Err(format!("{}: `{flag}` is for baking, not for baked files", path.display()).into());
        }
        return Ok(Opened { bytes: map(path)?, notes: Notes::default(), exposure: Exposure::Stops(0.0) });
    }
    let (look, notes) = flags.look.look()?;
    let (mut description, mut loaded) = match path {
        Some(path) if !is_cornell(path) => load::load_with(path, &look)?,
        _ => {
            let mut scene = if path.is_some() { builtin::cornell_box() } else { builtin::showcase() };
            let notes = dress(&mut scene, &Given::SCENE, &look).map_err(|e| about(path)(&e))?;
            (scene, LoadReport { notes, ..LoadReport::default() })
        }
    };
    loaded.notes.extend(notes);
    if flags.single_scattering {
        description.materials.iter_mut().for_each(|m| m.compensated = false);
    }
    let baked = bake(&description).map_err(|e| about(path)(&e))?;
    let notes = Notes::of(&loaded, &baked.report);
    notes.print(path);
    let exposure = match path {
        // its area light brings the walls to about a fifth of white
        Some(path) if is_cornell(path) => Exposure::Stops(1.0),
        Some(_) if !loaded.framed => Exposure::Stops(0.0),
        _ => Exposure::Auto,
    };
    Ok(Opened { bytes: SceneBytes::Baked(baked), notes, exposure })
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
    let failed = |e| format!("cannot read {}: {e}", path.display());
    let file = File::open(path).map_err(failed)?;
    let data = file.metadata().map_err(failed)?;
    if !data.is_file() {
        return Err(format!("cannot read {}: it is not a file", path.display()).into());
    }
    if data.len() == 0 {
        return Err(format!("{}: the file is empty", path.display()).into());
    }
    // SAFETY: the bytes must not change while they are mapped. This program never writes into an existing file
    // (`image::write_whole` renames a new one over it, which leaves the mapped one as it is); that no other program
    // does is asked of the user in the help text of `bake`.
    let map = unsafe { Mmap::map(&file) }.map_err(failed)?;
    Ok(SceneBytes::Mapped(map))
}
