//! Files with parts of a picture, and the picture that they make together: for job arrays, which need no engine.
//!
//! ```text
//! Head       which part, sizes, hashes, counters
//! text       version and settings, one `name=value` a line
//! names      of materials and objects, if coverage by index is among the layers
//! pixels     56 bytes each, row by row
//! planes     of auxiliary values, 4 bytes a pixel each
//! cache      what was learned of the scene, as `--cache-out` writes it
//! ```
//!
//! Every camera sample counts alike ([`FilmSum`]). Parts are added in the order of their numbers, so that the order in
//! which they are named does not matter; another number of parts makes another picture of the same expectation. The
//! hashes guard against accidents.

use crate::blob::AlignedBytes;
use crate::checkpoint::{describe, version};
use crate::drive::{Part, Rendered, Target, planes, save};
use crate::image::{ImageError, write_whole};
use crate::text;
use bytemuck::{Pod, Zeroable};
use croupier::unstable::film::{Aov, AovSet, FilmSum, PixelStats};
use croupier::unstable::learn::cache::{Cache, CacheSize};
use croupier::unstable::learn::guiding::Guide;
use croupier::unstable::learn::saved;
use croupier::unstable::rrs::Space;
use croupier::unstable::scene::blob::content_hash;
use croupier::{Counters, Plan, Scene, Settings};
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::{error, fmt};

/// First bytes of a file.
pub const MAGIC: [u8; 8] = *b"CRPRPART";

/// Version of the layout of this module.
const LAYOUT: u32 = 5;

/// Most bytes of texts that are read.
const MAX_TEXT: u64 = 1 << 26;

/// Head of a file.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Head {
    magic: [u8; 8],
    layout: u32,
    /// Number of the part, and of parts.
    part: [u32; 2],
    /// First camera sample of each pixel, and samples per pixel of the finished iterations.
    samples: [u32; 2],
    /// Not 0 if the render was stopped.
    stopped: u32,
    /// [`content_hash`] of the rest of the head, the text and the names.
    hash: u64,
    /// [`content_hash`] of what follows.
    body_hash: u64,
    scene: u64,
    text_bytes: u64,
    names_bytes: u64,
    pixels: u64,
    planes: u64,
    cache_bytes: u64,
    seconds: f64,
    counters: Counters,
    bounds: [[f32; 3]; 2],
    /// Exposure of the PNG in stops; NaN for what suits the picture.
    exposure: f32,
    /// Samples per pixel of the whole picture; 0 if the target was another.
    total: u32,
    /// [`Records::highlight`](croupier::unstable::scene::Records::highlight) of the scene.
    highlight: f32,
    reserved: u32,
}

/// Statistics of a pixel in a file.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct SavedPixel {
    sum: [f64; 3],
    /// Upper halves of the spread, shifted by a bit: films keep no more of it.
    spread: [u32; 3],
    samples: u32,
    rays: u32,
    difference: f32,
    ahead: i32,
    reserved: u32,
}

impl SavedPixel {
    fn new(p: &PixelStats) -> Self {
        let short = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        let spread = p.spread.map(|x| short(x.to_bits() >> 31));
        let (samples, rays) = (short(p.samples), short(p.rays));
        Self { sum: p.sum, spread, samples, rays, difference: p.difference as f32, ahead: p.ahead as i32, reserved: 0 }
    }

    fn stats(&self) -> PixelStats {
        let n = f64::from(self.samples);
        PixelStats {
            sum: self.sum,
            spread: self.spread.map(|x| f64::from_bits(u64::from(x) << 31)),
            weight: n,
            weight_sqr: n,
            samples: self.samples.into(),
            rays: self.rays.into(),
            difference: self.difference.into(),
            ahead: self.ahead.into(),
        }
    }
}

/// Reason why a file is no part of a picture.
#[derive(Debug)]
#[non_exhaustive]
pub enum FileError {
    /// The file cannot be read.
    Read(io::Error),
    /// The file is something else.
    Kind,
    /// The file ends early, or has bytes behind its end: bytes that it states, bytes that it has.
    Length(u64, u64),
    /// The bytes are not those that were written.
    Damaged,
    /// Another file than when its head was read.
    Replaced,
    /// Written by another version: that of the file, and this one.
    Version(String, String),
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(e) => write!(f, "cannot read the part: {e}"),
            Self::Kind => f.write_str("not a part of a picture"),
            Self::Length(stated, found) if found < stated => {
                write!(f, "the part is cut off: it has {found} of {stated} bytes")
            }
            Self::Length(stated, found) => write!(f, "the part has {found} bytes, it states {stated}"),
            Self::Damaged => f.write_str("the part is damaged"),
            Self::Replaced => f.write_str("the part was replaced while it was merged"),
            Self::Version(there, here) => {
                write!(f, "the part was written by version {}, this is {here}", text::excerpt(there))
            }
        }
    }
}

/// Reason why files do not make a picture.
#[derive(Debug)]
#[non_exhaustive]
pub enum MergeError {
    /// One of the files is no part of a picture.
    File(PathBuf, FileError),
    /// Two files are of different scenes: their content hashes.
    Scene(PathBuf, u64, PathBuf, u64),
    /// Two files differ in a setting, in the number of parts or in the samples of the whole picture: its name, and values
    /// of both.
    Setting(String, PathBuf, String, PathBuf, String),
    /// Two files hold the same part: its number.
    Twice(u32, PathBuf, PathBuf),
    /// Two files hold the same samples: the first that both have.
    Overlap(u32, PathBuf, PathBuf),
    /// Parts that no file holds: the first, how many, and the number of parts.
    Missing(u32, usize, u32),
    /// No file.
    Nothing,
    /// No memory for the picture.
    Memory,
}

impl fmt::Display for MergeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = text::path;
        match self {
            Self::File(path, e) => write!(f, "{}: {e}", name(path)),
            Self::Scene(a, x, b, y) => {
                write!(f, "{} and {} are of different scenes (hashes {x:016x} and {y:016x})", name(a), name(b))
            }
            Self::Setting(setting, a, x, b, y) => {
                let [setting, x, y] = [setting, x, y].map(|t| text::excerpt(t));
                write!(f, "{} was rendered with --{setting} {x}, {} with {y}", name(a), name(b))
            }
            Self::Twice(part, a, b) => write!(f, "{} and {} both hold part {part}", name(a), name(b)),
            Self::Overlap(sample, a, b) => {
                write!(f, "{} and {} both hold sample {sample} of each pixel", name(a), name(b))
            }
            Self::Missing(first, 1, of) => write!(f, "part {first} of {of} is missing"),
            Self::Missing(first, n, of) => {
                write!(f, "{n} of {of} parts are missing, the first of them is part {first}")
            }
            Self::Nothing => f.write_str("no parts to merge"),
            Self::Memory => f.write_str("no memory for the picture"),
        }
    }
}

impl error::Error for MergeError {}

impl From<io::Error> for FileError {
    fn from(e: io::Error) -> Self {
        Self::Read(e)
    }
}

/// Names of materials and objects by their indices.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Of materials.
    pub materials: Vec<String>,
    /// Of objects.
    pub objects: Vec<String>,
}

impl Names {
    /// The names that pictures with these auxiliary values show.
    pub fn of(scene: &Scene<'_>, aovs: AovSet) -> Self {
        // a line each, materials first
        let mut lines = std::str::from_utf8(scene.names).unwrap_or("").lines().map(String::from);
        let mut names =
            Self { materials: lines.by_ref().take(scene.materials.len()).collect(), objects: lines.collect() };
        if !aovs.has(Aov::MaterialCoverage) {
            names.materials.clear();
        }
        if !aovs.has(Aov::ObjectCoverage) {
            names.objects.clear();
        }
        names
    }

    fn save(&self) -> String {
        serde_json::to_string(&[&self.materials, &self.objects]).unwrap_or_default()
    }

    fn load(text: &str) -> Option<Self> {
        let [materials, objects] = serde_json::from_str(text).ok()?;
        Some(Self { materials, objects })
    }
}

/// Bytes of the numbers of a render.
fn bytes_of<T: Pod>(values: &[T]) -> &[u8] {
    bytemuck::cast_slice(values)
}

/// Hash of several pieces of a file.
fn hash_of<'a>(pieces: impl Iterator<Item = &'a [u8]>) -> u64 {
    let hashes: Vec<u64> = pieces.map(content_hash).collect();
    content_hash(bytes_of(&hashes))
}

fn head_hash(head: &Head, text: &str, names: &str) -> u64 {
    let head = Head { hash: 0, ..*head };
    hash_of([bytemuck::bytes_of(&head), text.as_bytes(), names.as_bytes()].into_iter())
}

/// Writes a part of a picture whose target is `target`. The file appears under its name when it is complete. `exposure`
/// is for the PNG, in stops, `None` for what suits the picture.
///
/// # Errors
/// Those of writing the file.
pub fn write(
    path: &Path,
    scene: &Scene<'_>,
    settings: &Settings,
    part: Part,
    target: Target,
    rendered: &Rendered,
    exposure: Option<f32>,
) -> Result<(), ImageError> {
    let (text, names) = (describe(settings), Names::of(scene, settings.aovs).save());
    let pixels: Vec<SavedPixel> = rendered.pixels.iter().map(SavedPixel::new).collect();
    let planes = || rendered.planes.iter().flat_map(|(_, channels)| channels).map(|plane| bytes_of(plane));
    let cache = rendered.cache.as_deref().unwrap_or(&[]);
    let body = || [bytes_of(&pixels)].into_iter().chain(planes()).chain([cache]);
    let mut head = Head {
        magic: MAGIC,
        layout: LAYOUT,
        part: [part.number(), part.of()],
        samples: [rendered.first_sample, rendered.spp],
        stopped: rendered.stopped_early.into(),
        hash: 0,
        body_hash: hash_of(body()),
        scene: scene.hash,
        text_bytes: text.len() as u64,
        names_bytes: names.len() as u64,
        pixels: pixels.len() as u64,
        planes: planes().count() as u64,
        cache_bytes: cache.len() as u64,
        seconds: rendered.seconds,
        counters: rendered.counters,
        bounds: [scene.info.bounds_min, scene.info.bounds_max],
        exposure: exposure.unwrap_or(f32::NAN),
        total: if let Target::Spp(samples) = target { samples } else { 0 },
        highlight: scene.highlight,
        reserved: 0,
    };
    head.hash = head_hash(&head, &text, &names);
    let failed = |e| ImageError::Write(path.into(), e);
    write_whole(path, |out| {
        let pieces = [bytemuck::bytes_of(&head), text.as_bytes(), names.as_bytes()].into_iter().chain(body());
        pieces.into_iter().try_for_each(|piece| out.write_all(piece).map_err(failed))
    })
}

/// Pixels, planes and what was learned of the scene.
type Body = (Vec<SavedPixel>, Vec<f32>, Vec<u8>);

/// A file whose head and texts were read and checked. It is closed: there may be more parts than files may be open.
#[derive(Debug)]
struct Checked {
    path: PathBuf,
    head: Head,
    part: Part,
}

/// What all parts of a picture have in common.
#[derive(Debug)]
struct Common {
    text: String,
    settings: Settings,
    names: Names,
}

/// Text of exactly so many bytes.
fn read_text(from: &mut impl Read, bytes: u64) -> Result<String, FileError> {
    let mut text = vec![0; bytes as usize];
    from.read_exact(&mut text)?;
    String::from_utf8(text).map_err(|_| FileError::Damaged)
}

impl Checked {
    fn new(path: &Path) -> Result<(Self, Common), FileError> {
        // Opening a pipe waits for its other end: look first.
        let found = fs::metadata(path)?;
        if !found.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file").into());
        }
        let (mut rest, length) = (BufReader::new(File::open(path)?), found.len());
        let (mut head, whole) = (Head::zeroed(), size_of::<Head>() as u64);
        if length < whole {
            let mut magic = [0; 8];
            let other = rest.read_exact(&mut magic).is_err() || magic != MAGIC;
            return Err(if other { FileError::Kind } else { FileError::Length(whole, length) });
        }
        rest.read_exact(bytemuck::bytes_of_mut(&mut head))?;
        if head.magic != MAGIC {
            return Err(FileError::Kind);
        }
        if head.layout != LAYOUT {
            let name = |n: u32| format!("{n} of the file's layout");
            return Err(FileError::Version(name(head.layout), name(LAYOUT)));
        }
        if head.text_bytes > MAX_TEXT || head.names_bytes > MAX_TEXT {
            return Err(FileError::Damaged);
        }
        let per_pixel = head.planes.checked_mul(4).and_then(|n| n.checked_add(size_of::<SavedPixel>() as u64));
        let body = per_pixel.and_then(|n| n.checked_mul(head.pixels)).and_then(|n| n.checked_add(head.cache_bytes));
        match body.and_then(|n| n.checked_add(whole + head.text_bytes + head.names_bytes)) {
            Some(stated) if stated == length => {}
            Some(stated) => return Err(FileError::Length(stated, length)),
            None => return Err(FileError::Damaged),
        }
        let text = read_text(&mut rest, head.text_bytes)?;
        let names = read_text(&mut rest, head.names_bytes)?;
        if head.hash != head_hash(&head, &text, &names) {
            return Err(FileError::Damaged);
        }
        let there = text.lines().next().and_then(|l| l.strip_prefix("version="));
        if there != Some(&version()) {
            return Err(FileError::Version(there.unwrap_or("unknown").into(), version()));
        }
        let mut settings = Settings::default();
        for (name, value) in text.lines().skip(1).filter_map(|l| l.split_once('=')) {
            settings.set(name, value).map_err(|_| FileError::Damaged)?;
        }
        let [number, of] = head.part;
        let part = Part::new(number, of).ok_or(FileError::Damaged)?;
        let names = Names::load(&names).ok_or(FileError::Damaged)?;
        // so that sums over all parts have room
        if bytemuck::cast_slice::<_, u64>(&[head.counters]).iter().any(|n| *n >= 1 << 47) {
            return Err(FileError::Damaged);
        }
        let [width, height] = settings.size.map(u64::from);
        let planes = Aov::ALL.iter().filter(|a| settings.aovs.has(**a)).map(|a| a.channels().len() as u64);
        if head.pixels != width * height || head.planes != planes.sum::<u64>() {
            return Err(FileError::Damaged);
        }
        Ok((Self { path: path.into(), head, part }, Common { text, settings, names }))
    }

    /// Reads what follows the texts, and checks it.
    fn body(&self) -> Result<Body, FileError> {
        let h = &self.head;
        let (mut rest, mut head) = (BufReader::new(File::open(&self.path)?), Head::zeroed());
        let read = rest.read_exact(bytemuck::bytes_of_mut(&mut head));
        // its hash is that of the texts, too
        if read.is_err() || bytemuck::bytes_of(&head) != bytemuck::bytes_of(h) {
            return Err(FileError::Replaced);
        }
        rest.seek_relative((h.text_bytes + h.names_bytes) as i64)?;
        // all bounded by the length of the file
        let mut pixels = vec![SavedPixel::zeroed(); h.pixels as usize];
        let mut planes = vec![0.0f32; (h.pixels * h.planes) as usize];
        let mut cache = vec![0; h.cache_bytes as usize];
        rest.read_exact(bytemuck::cast_slice_mut(&mut pixels))?;
        rest.read_exact(bytemuck::cast_slice_mut(&mut planes))?;
        rest.read_exact(&mut cache)?;
        let rows = planes.chunks_exact((h.pixels as usize).max(1)).map(bytes_of);
        let found = hash_of([bytes_of(&pixels)].into_iter().chain(rows).chain([&cache[..]]));
        if found == h.body_hash { Ok((pixels, planes, cache)) } else { Err(FileError::Damaged) }
    }

    /// Samples of each pixel: from and up to.
    fn range(&self) -> [u64; 2] {
        let [first, n] = self.head.samples.map(u64::from);
        [first, first + n]
    }
}

/// Checks that two files are of one picture.
fn fit((a, common): (&Checked, &Common), (b, others): (&Checked, &Common)) -> Result<(), MergeError> {
    let (x, y) = (a.path.clone(), b.path.clone());
    if a.head.scene != b.head.scene {
        return Err(MergeError::Scene(x, a.head.scene, y, b.head.scene));
    }
    if let Some((line, other)) = common.text.lines().zip(others.text.lines()).find(|(line, other)| line != other) {
        let [(name, value), (_, other)] = [line, other].map(|l| l.split_once('=').unwrap_or((l, "none")));
        return Err(MergeError::Setting(name.into(), x, value.into(), y, other.into()));
    }
    if a.part.of() != b.part.of() {
        return Err(MergeError::Setting("part".into(), x, a.part.to_string(), y, b.part.to_string()));
    }
    match [a.head.total, b.head.total] {
        [m, n] if m == n => Ok(()),
        [0, n] => Err(MergeError::Setting("spp".into(), y, n.to_string(), x, "another target".into())),
        [m, 0] => Err(MergeError::Setting("spp".into(), x, m.to_string(), y, "another target".into())),
        [m, n] => Err(MergeError::Setting("spp".into(), x, m.to_string(), y, n.to_string())),
    }
}

/// A picture from all of its parts.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The picture, its counters and error. Its seconds are those of all parts; it has no records of iterations.
    pub rendered: Rendered,
    /// Settings of the parts.
    pub settings: Settings,
    /// Names of materials and objects, if coverage is among the auxiliary values.
    pub names: Names,
    /// Exposure of the PNG in stops, `None` for what suits the picture.
    pub exposure: Option<f32>,
    /// Files of parts that were stopped before their target.
    pub stopped: Vec<PathBuf>,
}

/// Adds all parts of a picture. Their order does not matter. One part at a time is in memory.
///
/// # Errors
/// Files that are not all parts of one picture, each once; the text names them and what differs.
pub fn merge(paths: &[PathBuf]) -> Result<Merged, MergeError> {
    let check = |p: &PathBuf| Checked::new(p).map_err(|e| MergeError::File(p.clone(), e));
    let (first, others) = paths.split_first().ok_or(MergeError::Nothing)?;
    let (first, common) = check(first)?;
    let mut parts = vec![first];
    for path in others {
        let (part, others) = check(path)?;
        fit((&parts[0], &common), (&part, &others))?;
        parts.push(part);
    }
    parts.sort_by_key(|p| p.part.number());
    for pair in parts.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let names = || (a.path.clone(), b.path.clone());
        if a.part.number() == b.part.number() {
            let (x, y) = names();
            return Err(MergeError::Twice(a.part.number(), x, y));
        }
        if a.range()[1] > b.range()[0] {
            let (x, y) = names();
            return Err(MergeError::Overlap(b.head.samples[0], x, y));
        }
    }
    let of = parts[0].part.of();
    let missing: Vec<u32> = (1..=of).filter(|n| parts.binary_search_by_key(n, |p| p.part.number()).is_err()).collect();
    if let Some(n) = missing.first() {
        return Err(MergeError::Missing(*n, missing.len(), of));
    }
    add(&parts, common)
}

/// Adds parts that fit.
fn add(parts: &[Checked], common: Common) -> Result<Merged, MergeError> {
    let Common { settings, names, .. } = common;
    let damaged = |path: &Path| MergeError::File(path.into(), FileError::Damaged);
    let path = parts[0].path.clone();
    let plan = Plan::new(&settings).map_err(|_| damaged(&path))?;
    let bytes = plan.film_sum().size;
    let mut block = AlignedBytes::try_zeroed(bytes).ok_or(MergeError::Memory)?;
    let mut film = FilmSum::new(&plan, block.as_mut()).map_err(|_| damaged(&path))?;
    let with_statistics = parts.iter().all(|p| p.head.cache_bytes > 0);
    let (bounds, memory) = (parts[0].head.bounds, |bytes| AlignedBytes::try_zeroed(bytes).ok_or(MergeError::Memory));
    let learns = with_statistics && settings.strategy.space() == Some(Space::Scene);
    let size = CacheSize::within(settings.learning.cache_bytes, settings.shards).filter(|_| learns);
    let mut of_cache = size.and_then(Cache::layout).map(|layout| memory(layout.size)).transpose()?;
    let objective = settings.learning.objective;
    let made = of_cache.as_mut().zip(size).map(|(memory, size)| Cache::new(size, bounds, objective, memory.as_mut()));
    let mut cache = made.transpose().map_err(|_| damaged(&path))?;
    let size = settings.guide_size().filter(|_| with_statistics);
    let mut of_guide = size.and_then(Guide::layout).map(|layout| memory(layout.size)).transpose()?;
    let made = of_guide.as_mut().zip(size).map(|(memory, size)| Guide::new(size, bounds, memory.as_mut()));
    let mut guide = made.transpose().map_err(|_| damaged(&path))?;
    let (mut counters, mut seconds, mut spp) = (Counters::default(), 0.0, 0u32);
    for part in parts {
        let (pixels, planes, learned) = part.body().map_err(|e| MergeError::File(part.path.clone(), e))?;
        let plane = |n: usize, pixel: usize| planes.get(n * pixels.len() + pixel).copied().unwrap_or(0.0);
        film.add(|i| pixels[i].stats(), plane);
        if cache.is_some() || guide.is_some() {
            saved::merge(cache.as_mut(), guide.as_mut(), &learned).map_err(|_| damaged(&part.path))?;
        }
        let h = &part.head;
        counters.merge(&h.counters);
        (seconds, spp) = (seconds + h.seconds, spp.saturating_add(h.samples[1]));
    }
    let stopped: Vec<PathBuf> = parts.iter().filter(|p| p.head.stopped != 0).map(|p| p.path.clone()).collect();
    let learned = cache.is_some() || guide.is_some();
    let saved = learned.then(|| save(cache.as_ref(), guide.as_ref())).transpose().map_err(|_| damaged(&path))?;
    let film = film.finish(parts[0].head.highlight);
    let rendered = Rendered {
        size: film.size(),
        pixels: film.pixels().collect(),
        aovs: film.aovs().collect(),
        planes: planes(film),
        counters,
        error: film.error_estimate(),
        variance_factors: film.variance_factors(),
        first_sample: 0,
        spp,
        seconds,
        profile: "",
        memory: [bytes, 0],
        stopped_early: !stopped.is_empty(),
        checkpoint_error: None,
        threads: 0,
        iterations: Vec::new(),
        guide: None,
        guide_view: None,
        cache: saved,
        calibration: None,
    };
    let head = &parts[0].head;
    let exposure = Some(head.exposure).filter(|x| x.is_finite());
    Ok(Merged { rendered, settings, names, exposure, stopped })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{BakeOptions, bake};
    use crate::builtin;
    use crate::drive::{Options, Unobserved, drive_scene};

    /// Killed by: a body that is read without a look at the head before it.
    #[test]
    fn a_part_that_is_replaced_is_refused() {
        let bytes = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {}).unwrap().bytes;
        let folder = tempfile::tempdir().unwrap();
        let (scene, path) = (Scene::from_bytes(&bytes).unwrap(), folder.path().join("part"));
        let settings = Settings { size: [4, 4], ..Settings::for_scene(&scene) };
        let save = |number| {
            let (part, target) = (Part::new(number, 2).unwrap(), Target::Spp(2));
            let options = Options { threads: 1, part: Some(part), ..Options::new(settings, target) };
            let rendered = drive_scene(scene, &options, &Unobserved).unwrap();
            write(&path, &scene, &settings, part, target, &rendered, None).unwrap();
        };
        save(1);
        let (checked, _) = Checked::new(&path).unwrap();
        assert!(checked.body().is_ok());
        save(2);
        assert!(matches!(checked.body(), Err(FileError::Replaced)));
        fs::write(&path, []).unwrap();
        assert!(matches!(checked.body(), Err(FileError::Replaced)));
    }
}
