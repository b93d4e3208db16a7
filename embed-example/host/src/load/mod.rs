//! Files into a [`SceneDescription`].
//!
//! | file | reads |
//! |---|---|
//! | `scene_json` | a folder with `scene.json` (the format of docs/SCENES.md) |
//! | `obj` | geometry: Wavefront OBJ |
//! | `gltf` | glTF 2.0, with materials and textures of its own |
//! | `ply`, `stl` | geometry: PLY, STL; `bare` makes a scene of it |
//! | `mtl`, `mtl_principled` | materials of a bare OBJ |
//! | `media` | participating media of a `scene.json`, density grids |
//! | `principled` | principled materials of a `scene.json` |
//! | `instances` | instances and prototypes of a `scene.json` |
//! | `presets` | nothing: media by name |
//! | `images` | PNG and JPEG textures, environment maps: EXR, and Radiance through `hdr` |
//! | `colors` | nothing: colours of vertices as textures |
//! | `loader` | the files that all of them ask for, each once |
//! | `budget` | nothing: memory that decoding may take |
//! | `files` | nothing but bytes: regular files of a limited size, text, names in another case |
//! | `polygon` | nothing: polygons as triangles |
//! | `json` | values of a JSON document with their paths |

mod bare;
mod budget;
mod colors;
mod error;
mod files;
mod gltf;
mod hdr;
mod images;
mod instances;
mod json;
mod loader;
mod media;
mod mtl;
mod mtl_principled;
mod obj;
mod ply;
mod polygon;
mod presets;
mod principled;
mod scene_json;
mod stl;

pub use error::LoadError;
pub use files::{MAX_FILE_BYTES, read as read_file};
pub use loader::{LoadOptions, LoadReport};

use crate::description::{Environment, SceneDescription, Triangle};
use crate::look::{Look, dress};
use loader::Loader;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// As [`load_with`], with the default options and without requests.
///
/// # Errors
/// As of [`load_with`].
pub fn load(path: &Path) -> Result<(SceneDescription, LoadReport), LoadError> {
    load_with(path, &LoadOptions::default(), &Look::default())
}

/// Loads a folder with a `scene.json`, that `scene.json` itself, or a file of another kind by its extension: `.gltf`,
/// `.glb`, `.obj`, `.ply`, `.stl`. A file that begins like `.glb` or PLY is one, whatever its name is. What it leaves open
/// is completed, and the requests of `look` are followed ([`dress`]).
///
/// # Errors
/// Files that cannot be read or are no scene, also those without a triangle.
pub fn load_with(path: &Path, options: &LoadOptions, look: &Look) -> Result<(SceneDescription, LoadReport), LoadError> {
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
    let mut loader = Loader::new(*options, folder);
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let mut scene = if path.is_dir() {
        scene_json::load(&mut loader, &path.join("scene.json"))?
    } else {
        match extension.as_ref().and_then(|e| e.to_str()) {
            Some("json") => scene_json::load(&mut loader, path)?,
            Some("gltf" | "glb") => gltf::load(&mut loader, path)?,
            _ if starts(path, gltf::is_glb) => gltf::load(&mut loader, path)?,
            _ if starts(path, ply::is_ply) => ply::load(&mut loader, path)?,
            Some("ply") => ply::load(&mut loader, path)?,
            Some("stl") => stl::load(&mut loader, path)?,
            Some("obj") => obj::load_bare(&mut loader, path)?,
            // Whether it is there is the better message.
            _ if !path.exists() => scene_json::load(&mut loader, path)?,
            _ => return Err(LoadError::Unknown { path: path.into() }),
        }
    };
    // before a ground is laid below it
    if !scene.triangles.is_empty() && !scene.triangles.iter().any(|t| has_area(&scene, t)) {
        let count = scene.triangles.len();
        let what = format!("none of the {count} triangles has an area: there is nothing to see");
        return Err(LoadError::File { path: loader.report.files.first().map_or(path, |p| p).into(), what });
    }
    let notes = dress(&mut scene, &loader.given, look);
    loader.report.notes.extend(notes.map_err(|source| LoadError::Look { path: path.into(), source })?);
    loader.report.framed = !loader.given.camera;
    Ok((scene, loader.report))
}

/// Whether a triangle spans a plane, as baking asks it.
fn has_area(scene: &SceneDescription, t: &Triangle) -> bool {
    let corner =
        |v: u32| scene.vertices.get(v as usize).map_or(glam::DVec3::ZERO, |v| glam::Vec3::from(v.position).as_dvec3());
    let [a, b, c] = t.vertices.map(corner);
    (b - a).cross(c - a).length_squared() > 0.0
}

/// Whether the first bytes of a file are what `is` knows. False if it cannot be read, which its loader says better.
fn starts(path: &Path, is: fn(&[u8]) -> bool) -> bool {
    // Opening a pipe waits for its other end.
    if !path.is_file() {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(64).read_to_end(&mut head));
    read.is_ok() && is(&head)
}

/// Reads an environment map, unscaled and unrotated: a Radiance file, or an EXR with R, G and B. `referrer` says in messages
/// who names the file. The report holds the file that was read, which may differ from `path` in case, and what was changed.
///
/// # Errors
/// Files that cannot be read, are no such map or larger than [`LoadOptions::texture_memory`]; if the options are strict,
/// also one that is there in another case only.
pub fn environment(path: &Path, referrer: &str, options: &LoadOptions) -> Result<(Environment, LoadReport), LoadError> {
    let mut loader = Loader::new(*options, path.parent().unwrap_or(Path::new("")));
    let map = loader.environment(path, referrer)?;
    Ok((map, loader.report))
}
