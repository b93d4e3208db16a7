//! What the files of one scene share while it is loaded.

use super::error::LoadError;
use super::files;
use super::images::{self, Decoded};
use crate::description::{Encoding, Environment, SceneDescription, Texture, Wrap};
use crate::look::Given;
use crate::text;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

/// Options of loading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Refuse what is otherwise replaced with a note: files that are missing or of another case, materials and colours
    /// that are unknown, faces with some texture coordinates or normals only, bytes behind the end of an image.
    pub strict: bool,
    /// Most bytes that decoded textures and environment maps may take in all while they are decoded: 4 a texel of a
    /// texture, also of one that is made of two others, 12 of an environment map, and what the decoder takes for the one
    /// under way. Known from their headers.
    pub texture_memory: u64,
}

impl LoadOptions {
    /// Default of [`Self::texture_memory`]: 2 GiB.
    pub const TEXTURE_MEMORY: u64 = 2 << 30;
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { strict: false, texture_memory: Self::TEXTURE_MEMORY }
    }
}

/// Report of loading, besides the scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoadReport {
    /// Files read.
    pub files: Vec<PathBuf>,
    /// Faces of more than three corners, split into triangles.
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
    pub(super) options: LoadOptions,
    pub(super) report: LoadReport,
    /// What the file says of itself; readers of files without camera or light change it.
    pub(super) given: Given,
    /// Folder of the scene: other machines' folders are not here, but their files may lie beside the scene.
    folder: PathBuf,
    /// Textures by path and decoding: a file that several materials use is decoded once. `None`: it is missing.
    textures: HashMap<(PathBuf, Decoding), Option<u32>>,
    /// Textures that were made of two others, by their indices: roughness and metalness of MTL materials.
    pub(super) combined: HashMap<[Option<u32>; 2], u32>,
    /// Textures with holes, by those of the colour, that colour without one, and those of the holes.
    pub(super) cut_outs: HashMap<(Option<u32>, [u8; 3], u32), u32>,
    /// Bytes of decoded images so far, and of textures that were made of them.
    decoded: u64,
}

/// What the texels of a file are taken for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Decoding {
    pub encoding: Encoding,
    pub wrap: [Wrap; 2],
}

impl Loader {
    pub(super) fn new(options: LoadOptions, folder: &Path) -> Self {
        Self {
            options,
            report: LoadReport::default(),
            given: Given::SCENE,
            folder: folder.into(),
            textures: HashMap::new(),
            combined: HashMap::new(),
            cut_outs: HashMap::new(),
            decoded: 0,
        }
    }

    /// Reads a whole file; `referrer` is the place that names it. If it is not there, one is taken that differs in case
    /// only, with a note. Second: the path that was read.
    pub(super) fn read_near(&mut self, path: &Path, referrer: &str) -> Result<(Vec<u8>, PathBuf), LoadError> {
        let error = match files::read(path) {
            Ok(bytes) => return Ok((self.record(path, bytes), path.into())),
            Err(source) => LoadError::Read { path: path.into(), referrer: Some(referrer.into()), source },
        };
        if !error.is_missing() {
            return Err(error);
        }
        let Some(found) = files::nearest(path, &self.folder) else { return Err(error) };
        self.replace(error, &format!("{} was taken", text::path(&found)))?;
        let bytes = files::read(&found).map_err(|source| LoadError::Read {
            path: found.clone(),
            referrer: Some(referrer.into()),
            source,
        })?;
        Ok((self.record(&found, bytes), found))
    }

    /// Reads a whole file; `referrer` is the place that names it.
    pub(super) fn read(&mut self, path: &Path, referrer: Option<&str>) -> Result<Vec<u8>, LoadError> {
        if let Some(referrer) = referrer {
            return self.read_near(path, referrer).map(|(bytes, _)| bytes);
        }
        let failed = |source| LoadError::Read { path: path.into(), referrer: None, source };
        files::read(path).map_err(failed).map(|bytes| self.record(path, bytes))
    }

    fn record(&mut self, path: &Path, bytes: Vec<u8>) -> Vec<u8> {
        self.report.files.push(path.into());
        bytes
    }

    /// As [`Loader::read`], for text: without byte order mark; bytes that are not UTF-8 (old exporters' comments) become
    /// replacement characters; what is no text is refused.
    pub(super) fn read_text(&mut self, path: &Path, referrer: Option<&str>) -> Result<String, LoadError> {
        let bytes = self.read(path, referrer)?;
        files::text(bytes).map_err(|what| LoadError::Format { path: path.into(), what })
    }

    /// Index of the texture in `path`: a colour, repeated; see [`Self::texture_as`].
    pub(super) fn texture(
        &mut self,
        scene: &mut SceneDescription,
        path: &Path,
        referrer: &str,
    ) -> Result<Option<u32>, LoadError> {
        self.texture_as(scene, path, referrer, Decoding::default())
    }

    /// Index of the texture in `path`, decoded at its first use. If there is none, not even in another case: `None`, and
    /// a note that the material is without it.
    pub(super) fn texture_as(
        &mut self,
        scene: &mut SceneDescription,
        path: &Path,
        referrer: &str,
        decoding: Decoding,
    ) -> Result<Option<u32>, LoadError> {
        if let Some(index) = self.textures.get(&(path.into(), decoding)) {
            return Ok(*index);
        }
        let (bytes, found) = match self.read_near(path, referrer) {
            Err(e) if e.is_missing() => {
                self.replace(e, "the material is without it")?;
                self.textures.insert((path.into(), decoding), None);
                return Ok(None);
            }
            read => read?,
        };
        let wrong = |what| LoadError::image(&found, referrer, what);
        let image = self.decode(&bytes).map_err(wrong)?;
        if let Some(what) = image.ignored {
            self.replace(wrong(what.into()), "the picture was taken without that")?;
        }
        let image = image.texture;
        self.charge(&image);
        let index = scene.textures.len() as u32;
        let Decoding { encoding, wrap } = decoding;
        scene.textures.push(Texture { name: found.display().to_string(), encoding, wrap, ..image });
        self.textures.insert((path.into(), decoding), Some(index));
        Ok(Some(index))
    }

    /// A PNG or JPEG that is in memory; the error is a text. Whoever keeps it has to [`Self::charge`] it.
    pub(super) fn decode(&self, bytes: &[u8]) -> Result<Decoded, String> {
        images::texture(bytes, self.free())
    }

    /// The environment map in `path`, unscaled and unrotated.
    pub(super) fn environment(&mut self, path: &Path, referrer: &str) -> Result<Environment, LoadError> {
        let (bytes, path) = self.read_near(path, referrer)?;
        let decoded = images::environment(&bytes, self.free());
        let (map, clamped) = decoded.map_err(|what| LoadError::image(&path, referrer, what))?;
        if let Environment::Map { texels, .. } = &map {
            self.decoded += 12 * texels.len() as u64;
        }
        if clamped > 0 {
            let path = text::path(&path);
            self.note(format!("{path}: {clamped} negative, NaN or infinite numbers were taken as 0"));
        }
        Ok(map)
    }

    /// Bytes that further images may take.
    pub(super) fn free(&self) -> u64 {
        self.options.texture_memory.saturating_sub(self.decoded)
    }

    /// Counts a texture that stays.
    pub(super) fn charge(&mut self, texture: &Texture) {
        self.decoded += 4 * texture.texels.len() as u64;
    }

    pub(super) fn note(&mut self, text: String) {
        self.report.notes.push(text);
    }

    /// Goes on in spite of `error`, with a note that says what was done `instead`, unless the options are strict.
    pub(super) fn replace(&mut self, error: LoadError, instead: &str) -> Result<(), LoadError> {
        if self.options.strict {
            return Err(error);
        }
        self.note(format!("{error}; {instead}"));
        Ok(())
    }
}

impl LoadError {
    /// Whether a file is not there.
    pub(super) fn is_missing(&self) -> bool {
        let kinds = [io::ErrorKind::NotFound, io::ErrorKind::NotADirectory];
        matches!(self, Self::Read { source, .. } if kinds.contains(&source.kind()))
    }
}
