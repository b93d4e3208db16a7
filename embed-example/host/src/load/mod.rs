//! Files into a [`SceneDescription`].
//!
//! | file | reads |
//! |---|---|
//! | `scene_json` | a folder with `scene.json` (the format of docs/SCENES.md) |
//! | `obj` | geometry: Wavefront OBJ |
//! | `mtl` | materials of a bare OBJ |
//! | `media` | participating media of a `scene.json`, density grids |
//! | `presets` | nothing: media by name |
//! | `images` | PNG and JPEG textures, EXR environment maps |
//! | `loader` | the files that all of them ask for, each once |
//! | `json` | values of a JSON document with their paths |

mod error;
mod images;
mod json;
mod loader;
mod media;
mod mtl;
mod obj;
mod presets;
mod scene_json;

pub use error::LoadError;
pub use loader::LoadReport;

use crate::description::{Environment, SceneDescription};
use crate::look::{Look, dress};
use loader::Loader;
use std::path::Path;

/// As [`load_with`], without requests.
pub fn load(path: &Path) -> Result<(SceneDescription, LoadReport), LoadError> {
    load_with(path, &Look::default())
}

/// Loads a folder with a `scene.json`, that `scene.json` itself, or a bare `.obj` file; what it leaves open is completed,
/// and the requests of `look` are followed ([`dress`]).
pub fn load_with(path: &Path, look: &Look) -> Result<(SceneDescription, LoadReport), LoadError> {
    let mut loader = Loader::default();
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let mut scene = if path.is_dir() {
        scene_json::load(&mut loader, &path.join("scene.json"))?
    } else {
        match extension.as_ref().and_then(|e| e.to_str()) {
            Some("json") => scene_json::load(&mut loader, path)?,
            Some("obj") => obj::load_bare(&mut loader, path)?,
            // Whether it is there is the better message.
            _ if !path.exists() => scene_json::load(&mut loader, path)?,
            _ => return Err(LoadError::Unknown { path: path.into() }),
        }
    };
    let notes = dress(&mut scene, &loader.given, look);
    loader.report.notes.extend(notes.map_err(|source| LoadError::Look { path: path.into(), source })?);
    loader.report.framed = !loader.given.camera;
    Ok((scene, loader.report))
}

/// Reads an environment map, unscaled and unrotated: an EXR file with R, G and B. Notes say what was changed.
pub fn environment(path: &Path) -> Result<(Environment, Vec<String>), LoadError> {
    let mut loader = Loader::default();
    let map = loader.environment(path, "--env")?;
    Ok((map, loader.report.notes))
}
