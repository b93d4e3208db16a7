//! Files that a render goes on from after a break, with the bits that it would have had without it.
//!
//! ```text
//! Head       sizes, hashes, the work so far
//! text       version and settings, one `name=value` a line
//! records    figures of every finished iteration
//! block      the session's memory (croupier::Session::suspend)
//! ```
//!
//! A session at the end of an iteration, or at the beginning of one, is all in its block; shards need nothing then. A
//! file is written whole under a temporary name before it replaces an older one. Reading compares the content hash of
//! the scene, the version of this crate and every setting, and names what differs. The hashes of the file guard against
//! accidents. Somebody who forges them gets another picture, never a panic: the core checks what it reads from a block.

use crate::drive::{CacheRecord, IterationRecord};
use crate::image::{ImageError, write_whole};
use crate::text;
use bytemuck::{Pod, Zeroable};
use croupier::unstable::learn::PictureStatistics;
use croupier::unstable::scene::blob::content_hash;
use croupier::unstable::schedule::Work;
use croupier::{Counters, ErrorEstimate, Settings};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::{error, fmt};

/// First bytes of a file.
pub const MAGIC: [u8; 8] = *b"CRPCHKPT";

/// Version of the layout of this module, and of what sessions keep.
const LAYOUT: u32 = 5;

/// Most bytes of the text and most records that are read.
const MAX_TEXT: u64 = 1 << 16;
const MAX_RECORDS: u64 = 1 << 20;

/// Head of a file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Head {
    magic: [u8; 8],
    layout: u32,
    /// Samples per pixel of the iteration that has begun, of which nothing is traced; 0 between iterations.
    begun: u32,
    /// [`content_hash`] of the rest of the head, the text and the records.
    hash: u64,
    /// [`content_hash`] of the block.
    block_hash: u64,
    scene: u64,
    text_bytes: u64,
    records: u64,
    block_bytes: u64,
    /// Finished iterations.
    samples: u32,
    reserved: u32,
    rays: u64,
    seconds: f64,
}

/// An [`IterationRecord`] in a file. What is optional is there unless it is NaN or `u64::MAX`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct SavedIteration {
    samples: u64,
    rays: u64,
    /// Seconds of all, tracing, merging, estimating, learning.
    seconds: [f64; 5],
    counters: Counters,
    picture: PictureStatistics,
    error: [f64; 8],
    leaves: u64,
    subdivisions_refused: u64,
}

impl From<&IterationRecord> for SavedIteration {
    fn from(i: &IterationRecord) -> Self {
        let nothing = PictureStatistics { variance: f64::NAN, ..PictureStatistics::default() };
        let ErrorEstimate { rel_mse, low, high, at_least, rel_mse_all, independence, highlight, effective_pixels } =
            i.error;
        Self {
            samples: i.work.samples.into(),
            rays: i.work.rays,
            seconds: [i.work.seconds, i.tracing, i.merging, i.estimating, i.learning],
            counters: i.counters,
            picture: i.picture.unwrap_or(nothing),
            error: [rel_mse, low, high, at_least, rel_mse_all, independence, highlight, effective_pixels],
            leaves: i.cache.map_or(u64::MAX, |c| c.leaves.into()),
            subdivisions_refused: i.cache.map_or(0, |c| c.subdivisions_refused),
        }
    }
}

impl From<SavedIteration> for IterationRecord {
    fn from(s: SavedIteration) -> Self {
        let [seconds, tracing, merging, estimating, learning] = s.seconds;
        let [rel_mse, low, high, at_least, rel_mse_all, independence, highlight, effective_pixels] = s.error;
        let cache = u32::try_from(s.leaves).ok();
        Self {
            work: Work { samples: u32::try_from(s.samples).unwrap_or(u32::MAX), rays: s.rays, seconds },
            counters: s.counters,
            tracing,
            merging,
            estimating,
            learning,
            picture: Some(s.picture).filter(|p| !p.variance.is_nan()),
            cache: cache.map(|leaves| CacheRecord { leaves, subdivisions_refused: s.subdivisions_refused }),
            error: ErrorEstimate {
                rel_mse,
                low,
                high,
                at_least,
                rel_mse_all,
                independence,
                highlight,
                effective_pixels,
            },
        }
    }
}

/// State of a render besides the session's block.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// Finished iterations in all.
    pub work: Work,
    /// Samples per pixel of an iteration that has begun, of which nothing is traced.
    pub begun: Option<u32>,
    /// Records of the finished iterations.
    pub iterations: Vec<IterationRecord>,
}

/// Where checkpoints go, and how often.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// File; the last checkpoint is in it.
    pub path: PathBuf,
    /// Least seconds between two of them, at ends of iterations. One more is written when the render ends or is stopped.
    pub every: f64,
}

/// Reason why a render cannot be resumed; every text says what differs, the caller knows the file.
#[derive(Debug)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file cannot be read.
    Read(io::Error),
    /// The file is something else.
    Kind,
    /// The file ends early, or has bytes behind its end: bytes that it states, bytes that it has.
    Length(u64, u64),
    /// The bytes are not those that were written.
    Damaged,
    /// Written by another version: that of the file, and this one.
    Version(String, String),
    /// Another scene: content hashes of the file's and of this one.
    Scene(u64, u64),
    /// A setting differs: its name, its value in the file, and the one that was asked for.
    Setting(String, String, String),
    /// The block does not fit the session of these settings: bytes that it has, bytes needed.
    Block(u64, u64),
    /// There is no memory for the figures.
    Memory,
}

impl fmt::Display for CheckpointError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(e) => write!(f, "cannot read the checkpoint: {e}"),
            Self::Kind => write!(f, "not a checkpoint"),
            Self::Length(stated, found) if found < stated => {
                write!(f, "the checkpoint is cut off: it has {found} of {stated} bytes")
            }
            Self::Length(stated, found) => write!(f, "the checkpoint has {found} bytes, it states {stated}"),
            Self::Damaged => write!(f, "the checkpoint is damaged"),
            Self::Version(there, here) => {
                write!(f, "the checkpoint was written by version {}, this is {here}", text::excerpt(there))
            }
            Self::Scene(there, here) => {
                write!(f, "the checkpoint is of another scene (hash {there:016x}, this one has {here:016x})")
            }
            Self::Setting(name, there, here) => {
                let [name, there, here] = [name, there, here].map(|t| text::excerpt(t));
                write!(f, "the checkpoint was rendered with --{name} {there}, not {here}")
            }
            Self::Block(there, here) => {
                write!(f, "the checkpoint holds a session of {there} bytes, this one has {here}")
            }
            Self::Memory => write!(f, "no memory for the figures of the checkpoint"),
        }
    }
}

impl error::Error for CheckpointError {}

impl From<io::Error> for CheckpointError {
    fn from(e: io::Error) -> Self {
        Self::Read(e)
    }
}

/// Version of this crate and of the machine's words.
pub(crate) fn version() -> String {
    let order = if cfg!(target_endian = "little") { "little" } else { "big" };
    format!("{} ({}-bit, {order}-endian)", env!("CARGO_PKG_VERSION"), usize::BITS)
}

/// Version and settings, one a line.
pub(crate) fn describe(settings: &Settings) -> String {
    let mut out = format!("version={}\n", version());
    for row in Settings::TABLE {
        if let Some(value) = settings.get(row.name) {
            out.push_str(&format!("{}={value}\n", row.name));
        }
    }
    out
}

/// Compares what a file says with what is asked for.
fn compare(there: &str, here: &str) -> Result<(), CheckpointError> {
    let value = |text: &str, name: &str| {
        text.lines().find_map(|l| l.split_once('=').filter(|(n, _)| *n == name).map(|(_, v)| v.to_string()))
    };
    for (name, wanted) in here.lines().filter_map(|l| l.split_once('=')) {
        let found = value(there, name).unwrap_or_else(|| "none".into());
        match (found == wanted, name) {
            (true, _) => {}
            (false, "version") => return Err(CheckpointError::Version(found, wanted.into())),
            (false, name) => return Err(CheckpointError::Setting(name.into(), found, wanted.into())),
        }
    }
    if there == here { Ok(()) } else { Err(CheckpointError::Damaged) }
}

/// Hash of all but the block and the field itself.
fn hash(head: &Head, text: &str, records: &[SavedIteration]) -> u64 {
    hash_parts(head, text.as_bytes(), bytemuck::cast_slice(records))
}

fn hash_parts(head: &Head, text: &[u8], records: &[u8]) -> u64 {
    let head = Head { hash: 0, ..*head };
    let parts = [bytemuck::bytes_of(&head), text, records];
    content_hash(&parts.map(|p| content_hash(p).to_le_bytes()).concat())
}

/// Writes a checkpoint of the session that was suspended in `block`. The file appears under its name when it is
/// complete.
///
/// # Errors
/// Those of writing the file.
pub fn write(
    path: &Path,
    scene: u64,
    settings: &Settings,
    progress: &Progress,
    block: &[u8],
) -> Result<(), ImageError> {
    let text = describe(settings);
    let records: Vec<SavedIteration> = progress.iterations.iter().map(Into::into).collect();
    let mut head = Head {
        magic: MAGIC,
        layout: LAYOUT,
        begun: progress.begun.unwrap_or(0),
        hash: 0,
        block_hash: content_hash(block),
        scene,
        text_bytes: text.len() as u64,
        records: records.len() as u64,
        block_bytes: block.len() as u64,
        samples: progress.work.samples,
        reserved: 0,
        rays: progress.work.rays,
        seconds: progress.work.seconds,
    };
    head.hash = hash(&head, &text, &records);
    let failed = |e| ImageError::Write(path.into(), e);
    write_whole(path, |out| {
        out.write_all(bytemuck::bytes_of(&head)).map_err(failed)?;
        out.write_all(text.as_bytes()).map_err(failed)?;
        out.write_all(bytemuck::cast_slice(&records)).map_err(failed)?;
        out.write_all(block).map_err(failed)
    })
}

/// Reads the checkpoint of a render of this scene with these settings: the block of the suspended session into `block`.
///
/// # Errors
/// A file that is no such checkpoint, or damaged. The bytes of `block` mean nothing then.
pub fn read(path: &Path, scene: u64, settings: &Settings, block: &mut [u8]) -> Result<Progress, CheckpointError> {
    // Opening a pipe waits for its other end: look first.
    let found = fs::metadata(path)?;
    if !found.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file").into());
    }
    read_from(File::open(path)?, found.len(), scene, settings, block)
}

/// [`read`] from a reader of `length` bytes.
pub fn read_from(
    mut file: impl Read,
    length: u64,
    scene: u64,
    settings: &Settings,
    block: &mut [u8],
) -> Result<Progress, CheckpointError> {
    let mut head = Head::zeroed();
    let whole = size_of::<Head>() as u64;
    if length < whole {
        let mut magic = [0; 8];
        let short = file.read_exact(&mut magic).is_err() || magic != MAGIC;
        return Err(if short { CheckpointError::Kind } else { CheckpointError::Length(whole, length) });
    }
    file.read_exact(bytemuck::bytes_of_mut(&mut head))?;
    if head.magic != MAGIC {
        return Err(CheckpointError::Kind);
    }
    if head.layout != LAYOUT {
        let name = |n: u32| format!("{n} of the file's layout");
        return Err(CheckpointError::Version(name(head.layout), name(LAYOUT)));
    }
    if head.text_bytes > MAX_TEXT || head.records > MAX_RECORDS {
        return Err(CheckpointError::Damaged);
    }
    let record_bytes = head.records * size_of::<SavedIteration>() as u64;
    let stated = head.block_bytes.checked_add(whole + head.text_bytes + record_bytes);
    match stated {
        Some(stated) if stated == length => {}
        Some(stated) => return Err(CheckpointError::Length(stated, length)),
        None => return Err(CheckpointError::Damaged),
    }
    let mut text = vec![0; head.text_bytes as usize];
    file.read_exact(&mut text)?;
    let text = String::from_utf8(text).map_err(|_| CheckpointError::Damaged)?;
    let mut records = Vec::new();
    // Bounded by the length of the file.
    records.try_reserve_exact(head.records as usize).map_err(|_| CheckpointError::Memory)?;
    records.resize(head.records as usize, SavedIteration::zeroed());
    file.read_exact(bytemuck::cast_slice_mut(&mut records))?;
    if head.hash != hash(&head, &text, &records) {
        return Err(CheckpointError::Damaged);
    }
    let here = describe(settings);
    if let Some(other) = text.lines().next().filter(|l| Some(*l) != here.lines().next()) {
        let there = other.strip_prefix("version=").unwrap_or("unknown").into();
        return Err(CheckpointError::Version(there, version()));
    }
    if head.scene != scene {
        return Err(CheckpointError::Scene(head.scene, scene));
    }
    compare(&text, &here)?;
    if head.block_bytes != block.len() as u64 {
        return Err(CheckpointError::Block(head.block_bytes, block.len() as u64));
    }
    file.read_exact(block)?;
    if content_hash(block) != head.block_hash {
        return Err(CheckpointError::Damaged);
    }
    Ok(Progress {
        work: Work { samples: head.samples, rays: head.rays, seconds: head.seconds },
        begun: Some(head.begun).filter(|n| *n != 0),
        iterations: records.into_iter().map(Into::into).collect(),
    })
}

/// Makes the hashes of a file's bytes right, whatever they are: for tests of what forged files do.
pub fn seal(bytes: &mut [u8]) {
    let whole = size_of::<Head>();
    let Some((head_bytes, rest)) = bytes.split_at_mut_checked(whole) else { return };
    let mut head: Head = bytemuck::pod_read_unaligned(head_bytes);
    let parts = || {
        let text = rest.get(..usize::try_from(head.text_bytes).ok()?)?;
        let records = usize::try_from(head.records).ok()?.checked_mul(size_of::<SavedIteration>())?;
        let block = text.len().checked_add(records)?;
        Some((text, rest.get(text.len()..block)?, rest.get(block..)?))
    };
    let Some((text, records, block)) = parts() else { return };
    head.block_hash = content_hash(block);
    head.hash = hash_parts(&head, text, records);
    head_bytes.copy_from_slice(bytemuck::bytes_of(&head));
}
