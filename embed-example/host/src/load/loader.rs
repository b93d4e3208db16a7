//! What the files of one scene share while it is loaded.

use super::error::LoadError;
use super::images;
use crate::description::{Encoding, Environment, SceneDescription, Texture, Wrap};
use crate::look::Given;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Report of loading, besides the scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoadReport {
    /// Files read.
    pub files: Vec<PathBuf>,
    /// Faces of more than three corners, split into fans.
    pub polygons: u32,
    /// Points and lines, left out.
    pub skipped_elements: u32,
    /// Notes of what was assumed or ignored, one sentence each.
    pub notes: Vec<String>,
    /// The file has no camera: the picture was composed here, and wants an exposure to suit it.
    pub framed: bool,
}

/// State that the files of one scene share.
pub(super) struct Loader {
    pub(super) report: LoadReport,
    /// What the file says of itself; readers of files without camera or light change it.
    pub(super) given: Given,
    /// Textures by path and decoding: a file that several materials use is decoded once.
    textures: HashMap<(PathBuf, Decoding), u32>,
}

/// What the texels of a file are taken for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Decoding {
    pub encoding: Encoding,
    pub wrap: [Wrap; 2],
}

impl Default for Loader {
    fn default() -> Self {
        Self { report: LoadReport::default(), given: Given::SCENE, textures: HashMap::new() }
    }
}

impl Loader {
    /// Reads a whole file; `referrer` is the place that names it.
    pub(super) fn read(&mut self, path: &Path, referrer: Option<&str>) -> Result<Vec<u8>, LoadError> {
        let bytes = fs::read(path).map_err(|source| LoadError::Read {
            path: path.into(),
            referrer: referrer.map(Into::into),
            source,
        })?;
        self.report.files.push(path.into());
        Ok(bytes)
    }

    /// As [`Loader::read`]; bytes that are not UTF-8 (old exporters' comments) become replacement characters.
    pub(super) fn read_text(&mut self, path: &Path, referrer: Option<&str>) -> Result<String, LoadError> {
        let bytes = self.read(path, referrer)?;
        Ok(String::from_utf8(bytes).unwrap_or_else(|e| String::from_utf8_lossy(e.as_bytes()).into_owned()))
    }

    /// Index of the texture in `path`: a colour, repeated.
    pub(super) fn texture(
        &mut self,
        scene: &mut SceneDescription,
        path: &Path,
        referrer: &str,
    ) -> Result<u32, LoadError> {
        self.texture_as(scene, path, referrer, Decoding::default())
    }

    /// Index of the texture in `path`, decoded at its first use.
    pub(super) fn texture_as(
        &mut self,
        scene: &mut SceneDescription,
        path: &Path,
        referrer: &str,
        decoding: Decoding,
    ) -> Result<u32, LoadError> {
        if let Some(index) = self.textures.get(&(path.into(), decoding)) {
            return Ok(*index);
        }
        let bytes = self.read(path, Some(referrer))?;
        let image = self.decode(&bytes).map_err(|what| LoadError::image(path, referrer, what))?;
        let index = scene.textures.len() as u32;
        let Decoding { encoding, wrap } = decoding;
        scene.textures.push(Texture { name: path.display().to_string(), encoding, wrap, ..image });
        self.textures.insert((path.into(), decoding), index);
        Ok(index)
    }

    /// A PNG or JPEG that is in memory; the error is a text.
    pub(super) fn decode(&mut self, bytes: &[u8]) -> Result<Texture, String> {
        images::texture(bytes)
    }

    /// The environment map in `path`, unscaled and unrotated.
    pub(super) fn environment(&mut self, path: &Path, referrer: &str) -> Result<Environment, LoadError> {
        let bytes = self.read(path, Some(referrer))?;
        let (map, clamped) = images::environment(&bytes).map_err(|what| LoadError::image(path, referrer, what))?;
        if clamped > 0 {
            self.note(format!("{}: {clamped} negative or NaN numbers were taken as 0", path.display()));
        }
        Ok(map)
    }

    pub(super) fn note(&mut self, text: String) {
        self.report.notes.push(text);
    }
}
