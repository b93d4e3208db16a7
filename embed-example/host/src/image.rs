//! Pictures of named float layers, and their files: EXR in and out, PNG out.
//!
//! An EXR file here has one part. Layers are told apart the way OpenEXR defines them, by the part of a channel's name
//! before its last dot: `R`, `G`, `B` are the picture itself (the layer without a name), `stderr.R` is channel `R` of
//! the layer `stderr`. So every program that can show an RGB EXR shows the picture. (The other way, one part per layer,
//! does not allow a part without a name.) The reader takes both kinds.
//!
//! Values are linear Rec. 709, 32-bit float, compressed without loss: what is read is bit for bit what was written,
//! NaN and infinities included.

use crate::text;
use exr::prelude as openexr;
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::{error, fmt};

/// One named plane of a [`Layer`].
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name without the layer: `R`, `Z`, ...
    pub name: String,
    /// `width * height` values, row 0 at the top.
    pub values: Vec<f32>,
}

/// Channels that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Name; empty for the picture itself.
    pub name: String,
    /// Channels in their usual order (R, G, B; X, Y, Z).
    pub channels: Vec<Channel>,
}

/// An image of any number of layers, all of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Layers; the picture itself is the one with the empty name.
    pub layers: Vec<Layer>,
    /// Texts in the header of an EXR file by their names; files that are read give none.
    pub attributes: Vec<(String, String)>,
}

/// Linear RGB pixels, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Rgb {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` pixels.
    pub pixels: Vec<[f32; 3]>,
}

/// Error of an image file; every text names the file.
#[derive(Debug)]
#[non_exhaustive]
pub enum ImageError {
    /// The file could not be read.
    Read(PathBuf, io::Error),
    /// The file could not be written.
    Write(PathBuf, io::Error),
    /// The file is not an EXR image that can be read; the text is the decoder's.
    Decode(PathBuf, String),
    /// The encoder refused the picture; the text is the encoder's.
    Encode(PathBuf, String),
    /// There is neither an unnamed layer nor any other with channels R, G, B.
    NoRgb(PathBuf),
    /// A layer's channel has another number of values than the picture has pixels.
    Size {
        /// File.
        path: PathBuf,
        /// Layer and channel.
        channel: String,
        /// Pixels of the picture.
        pixels: usize,
        /// Values of the channel.
        values: usize,
    },
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(path, e) => write!(f, "cannot read {}: {e}", text::path(path)),
            Self::Write(path, e) => write!(f, "cannot write {}: {e}", text::path(path)),
            Self::Decode(path, e) => write!(f, "{} is not a readable EXR image: {e}", text::path(path)),
            Self::Encode(path, e) => write!(f, "cannot write {}: {e}", text::path(path)),
            Self::NoRgb(path) => write!(f, "{} has no layer with channels R, G and B", text::path(path)),
            Self::Size { path, channel, pixels, values } => {
                write!(f, "{}: channel {channel} has {values} values for {pixels} pixels", path.display())
            }
        }
    }
}

impl error::Error for ImageError {
    fn source(&self) -> Option<&(dyn error::Error + 'static)> {
        match self {
            Self::Read(_, e) | Self::Write(_, e) => Some(e),
            _ => None,
        }
    }
}

impl Rgb {
    /// From pixels; `None` unless there are `width * height` of them.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>) -> Option<Self> {
        (width.checked_mul(height) == Some(pixels.len())).then_some(Self { width, height, pixels })
    }

    /// The RGB picture of an EXR file: the unnamed layer, or the first other one with channels R, G, B.
    pub fn read_exr(path: &Path) -> Result<Self, ImageError> {
        Picture::read_exr(path)?.main().ok_or_else(|| ImageError::NoRgb(path.into()))
    }
}

impl Layer {
    /// The channel of this name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }

    /// Its channels R, G, B as pixels.
    pub fn rgb(&self) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = [self.channel("R")?, self.channel("G")?, self.channel("B")?];
        Some(r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect())
    }
}

impl Picture {
    /// A picture without layers.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, layers: Vec::new(), attributes: Vec::new() }
    }

    /// Adds a layer of three channels: `names` is `["R", "G", "B"]` for colours, `["X", "Y", "Z"]` for vectors.
    /// The picture itself has the empty name.
    pub fn add3(&mut self, layer: &str, names: [&str; 3], pixels: &[[f32; 3]]) {
        let plane = |i: usize| Channel { name: names[i].into(), values: pixels.iter().map(|p| p[i]).collect() };
        self.layers.push(Layer { name: layer.into(), channels: vec![plane(0), plane(1), plane(2)] });
    }

    /// Adds a layer of one channel: `Z` for a depth, `Y` for any other scalar.
    pub fn add1(&mut self, layer: &str, name: &str, values: &[f32]) {
        self.layers
            .push(Layer { name: layer.into(), channels: vec![Channel { name: name.into(), values: values.into() }] });
    }

    /// The layer of this name.
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|l| l.name == name)
    }

    /// The RGB pixels of the layer of this name, of full size.
    pub fn rgb(&self, layer: &str) -> Option<Rgb> {
        Rgb::new(self.width, self.height, self.layer(layer)?.rgb()?)
    }

    /// The picture itself: the unnamed layer, or the first other one with channels R, G, B.
    pub fn main(&self) -> Option<Rgb> {
        let first = || Rgb::new(self.width, self.height, self.layers.iter().find_map(Layer::rgb)?);
        self.rgb("").or_else(first)
    }

    /// Reads every layer of an EXR file (one part or many, scan lines or tiles, 16- or 32-bit; the largest
    /// resolution). Layers come in the order unnamed first, then by name.
    pub fn read_exr(path: &Path) -> Result<Self, ImageError> {
        let file = File::open(path).map_err(|e| ImageError::Read(path.into(), e))?;
        Self::decode_exr(BufReader::new(file)).map_err(|e| ImageError::Decode(path.into(), e))
    }

    /// [`Self::read_exr`] from any reader; errors are texts without the file, which the caller knows.
    pub(crate) fn decode_exr(from: impl Read + Seek + Send) -> Result<Self, String> {
        let image = openexr::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(from)
            .map_err(|e| e.to_string())?;
        let parts = &image.layer_data;
        let size = parts.first().map(|p| p.size).ok_or("it has no parts")?;
        let mut picture = Self::new(size.x(), size.y());
        for part in parts {
            if part.size != size {
                return Err("its parts differ in size".into());
            }
            // The name of a file's only part is a title; it names a layer only where there are several.
            let part_name = match &part.attributes.layer_name {
                Some(name) if parts.len() > 1 => name.to_string(),
                _ => String::new(),
            };
            for channel in &part.channel_data.list {
                let full = channel.name.to_string();
                let (prefix, name) = full.rsplit_once('.').unwrap_or(("", &full));
                let layer = match (part_name.as_str(), prefix) {
                    (part, "") => part.into(),
                    ("", prefix) => prefix.into(),
                    (part, prefix) => format!("{part}.{prefix}"),
                };
                if channel.sampling != openexr::Vec2(1, 1) {
                    return Err(format!("channel {full} is subsampled"));
                }
                let values = channel.sample_data.values_as_f32().collect();
                picture.layer_mut(layer).channels.push(Channel { name: name.into(), values });
            }
        }
        for layer in &mut picture.layers {
            layer.channels.sort_by_key(|c| ("RGBA".find(c.name.as_str()), c.name.clone()));
        }
        picture.layers.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(picture)
    }

    /// The layer of this name, added if there is none.
    pub(crate) fn layer_mut(&mut self, name: String) -> &mut Layer {
        let at = self.layers.iter().position(|l| l.name == name).unwrap_or_else(|| {
            self.layers.push(Layer { name, channels: Vec::new() });
            self.layers.len() - 1
        });
        &mut self.layers[at]
    }

    /// Writes all layers into one EXR file, losslessly (ZIP). The file appears under its name only when it is complete.
    pub fn write_exr(&self, path: &Path) -> Result<(), ImageError> {
        let mut channels = Vec::new();
        for layer in &self.layers {
            for channel in &layer.channels {
                let name = match layer.name.as_str() {
                    "" => channel.name.clone(),
                    layer => format!("{layer}.{}", channel.name),
                };
                let (pixels, values) = (self.width * self.height, channel.values.len());
                if pixels != values {
                    return Err(ImageError::Size { path: path.into(), channel: name, pixels, values });
                }
                let text = openexr::Text::new_or_none(&name)
                    .ok_or_else(|| ImageError::Encode(path.into(), format!("channel name {name:?} is not Latin-1")))?;
                channels.push(openexr::AnyChannel::new(text, openexr::FlatSamples::F32(channel.values.clone())));
            }
        }
        let mut attributes = openexr::LayerAttributes::default();
        for (name, text) in &self.attributes {
            let latin = |text: &str| {
                let refused = || ImageError::Encode(path.into(), format!("attribute {name:?} is not Latin-1"));
                openexr::Text::new_or_none(text).ok_or_else(refused)
            };
            attributes.other.insert(latin(name)?, openexr::AttributeValue::Text(latin(text)?));
        }
        let image = openexr::Image::from_layer(openexr::Layer::new(
            (self.width, self.height),
            attributes,
            openexr::Encoding::SMALL_LOSSLESS,
            openexr::AnyChannels::sort(channels.into()),
        ));
        write_whole(path, |out| {
            image.write().to_buffered(out).map_err(|e| match e {
                openexr::Error::Io(e) => ImageError::Write(path.into(), e),
                e => ImageError::Encode(path.into(), e.to_string()),
            })
        })
    }
}

/// Writes 8-bit sRGB pixels as PNG. The file appears under its name only when it is complete.
pub fn write_png(path: &Path, width: usize, height: usize, pixels: &[[u8; 3]]) -> Result<(), ImageError> {
    let encode = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => ImageError::Write(path.into(), e),
        e => ImageError::Encode(path.into(), e.to_string()),
    };
    let side = |n: usize| u32::try_from(n).map_err(|e| ImageError::Encode(path.into(), e.to_string()));
    let (w, h) = (side(width)?, side(height)?);
    write_whole(path, |out| {
        let mut encoder = png::Encoder::new(out, w, h);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header().map_err(encode)?;
        writer.write_image_data(pixels.as_flattened()).map_err(encode)?;
        writer.finish().map_err(encode)
    })
}

/// Name of the temporary file, beside `path`, that [`write_whole`] writes before it has that name.
pub fn part_name(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    part.into()
}

/// Temporary files of writes under way.
static PARTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn parts() -> MutexGuard<'static, Vec<PathBuf>> {
    PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of all writes under way, and lets no other begin, for good: what begins to write waits.
/// For a program that ends at once, because of a signal perhaps.
pub fn remove_parts() {
    let parts = parts();
    for part in parts.iter() {
        // Best effort: there is nobody left to tell.
        let _ = fs::remove_file(part);
    }
    std::mem::forget(parts);
}

/// A temporary file that disappears unless it is renamed.
struct Part(PathBuf);

impl Part {
    fn create(path: &Path) -> io::Result<(Self, File)> {
        let part = part_name(path);
        // Known before it exists.
        let mut parts = parts();
        let file = File::create(&part)?;
        parts.push(part.clone());
        Ok((Self(part), file))
    }

    fn rename(self, path: &Path) -> io::Result<()> {
        fs::rename(&self.0, path)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        let mut parts = parts();
        parts.retain(|p| *p != self.0);
        // Best effort: the error that matters is the first one. After a renaming there is no such file.
        let _ = fs::remove_file(&self.0);
    }
}

/// Whether a file of this name could be written: makes and removes its temporary file.
///
/// # Errors
/// That of making it.
pub fn try_write(path: &Path) -> io::Result<()> {
    Part::create(path).map(drop)
}

/// Writes a file under a temporary name beside it and renames it, so that nobody ever reads half a file and an older
/// file of that name, mapped into memory perhaps, stays as it was.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), ImageError>,
) -> Result<(), ImageError> {
    let failed = |e: io::Error| ImageError::Write(path.into(), e);
    let (part, file) = Part::create(path).map_err(failed)?;
    let mut out = BufWriter::new(file);
    write(&mut out)?;
    out.flush().map_err(failed)?;
    drop(out);
    part.rename(path).map_err(failed)
}
