//! Files into a [`SceneDescription`].
//!
//! | file | reads |
//! |---|---|
//! | `scene_json` | a folder with `scene.json` (the format of docs/SCENES.md) |
//! | `obj` | geometry: Wavefront OBJ |
//! | `mtl` | materials of a bare OBJ |
//! | `media` | participating media of a `scene.json`, density grids |
//! | `instances` | instances and prototypes of a `scene.json` |
//! | `presets` | nothing: media by name |
//! | `images` | PNG and JPEG textures, EXR environment maps |
//! | `loader` | the files that all of them ask for, each once |
//! | `json` | values of a JSON document with their paths |

mod error;
mod images;
mod instances;
mod json;
mod loader;
mod media;
mod mtl;
mod obj;
mod presets;
mod scene_json;

pub use error::LoadError;
pub use loader::LoadReport;

use crate::description::SceneDescription;
use loader::Loader;
use std::path::Path;

/// Loads a folder with a `scene.json`, that `scene.json` itself, or a bare `.obj` file.
pub fn load(path: &Path) -> Result<(SceneDescription, LoadReport), LoadError> {
    let mut loader = Loader::default();
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
