//! Files into a [`SceneDescription`].
//!
//! | file | reads |
//! |---|---|
//! | `scene_json` | a folder with `scene.json` (the format of docs/SCENES.md) |
//! | `obj` | geometry: Wavefront OBJ |
//! | `mtl` | materials of a bare OBJ |
//! | `media` | participating media of a `scene.json`, density grids |
//! | `principled` | principled materials of a `scene.json` |
//! | `presets` | nothing: media by name |
//! | `images` | PNG and JPEG textures, EXR environment maps |
//! | `loader` | the files that all of them ask for, each once |
//! | `files` | nothing but bytes: regular files of a limited size, text, names in another case |
//! | `json` | values of a JSON document with their paths |

mod error;
mod files;
mod images;
mod json;
mod loader;
mod media;
mod mtl;
mod obj;
mod polygon;
mod presets;
mod principled;
mod scene_json;

pub use error::LoadError;
pub use files::{MAX_FILE_BYTES, read as read_file};
pub use loader::{LoadOptions, LoadReport};

use crate::description::SceneDescription;
use loader::Loader;
use std::path::Path;

/// Loads a folder with a `scene.json`, that `scene.json` itself, or a bare `.obj` file, with the default options.
pub fn load(path: &Path) -> Result<(SceneDescription, LoadReport), LoadError> {
    load_with(path, &LoadOptions::default())
}

/// As [`load`], with these options.
///
/// # Errors
/// Files that cannot be read or are no scene, also those without a triangle.
pub fn load_with(path: &Path, options: &LoadOptions) -> Result<(SceneDescription, LoadReport), LoadError> {
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
    let mut loader = Loader::new(*options, folder);
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let scene = if path.is_dir() {
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
    Ok((scene, loader.report))
}
