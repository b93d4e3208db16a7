//! A finished shard as bytes: what the end of an iteration reads of it, for a session of another process or machine
//! that runs the same iteration.
//!
//! | bytes | what |
//! |---|---|
//! | 392 | [`Header`]: which shard of which iteration, sizes, counters |
//! | 48 per pixel | sums of the pixels that have begun, in the order of the shard |
//! | 4 per pixel | their rays, if the settings count them |
//! | 4 per pixel and plane | their auxiliary sums |
//! | 48 per bin | learned sums of the bins in use |
//! | 4 per bin | their shadow rays |
//! | 56, and 12 per direction | with path guiding: directions offered to its log, the promise, and those that it holds |
//!
//! Numbers have the byte order of the machine; the first bytes tell machines of the other order. The identity of scene,
//! plan and iteration says where the sums belong, so all of it must agree. All bytes are checked before anything is
//! changed. The hash guards against accidents, not against somebody who forges it: then numbers are still in range, so
//! that nothing fails.
#![deny(clippy::indexing_slicing, clippy::arithmetic_side_effects)]

use super::job::Job;
use super::shard::Shard;
use crate::counters::Counters;
use crate::film::{AovLayout, PixelSums};
use crate::learn::cache::Training;
use crate::learn::guiding::{GuideLog, Promise};
use crate::scene::blob::content_hash;
use crate::world::{Identity, Iteration, World};
use bytemuck::{Pod, Zeroable};
use core::fmt;

/// First bytes of a saved shard.
const MAGIC: u64 = u64::from_ne_bytes(*b"CRPSHARD");
/// Version of the format, which covers the layout of sums and counters, and what densities, leaves and promises of path
/// guiding mean.
const VERSION: u32 = 7;
/// Bytes of magic and hash, which the hash does not cover.
const UNHASHED: usize = 16;

const HEADER: usize = size_of::<Header>();
/// Bytes of what comes before the directions of path guiding.
const GUIDED: usize = size_of::<GuideHeader>();

// Any of these is part of the layout: other counters or sums need another version.
const _: () = assert!(VERSION == 7 && HEADER == 400 && size_of::<PixelSums>() == 48 && Training::BIN_BYTES == 52);
const _: () = assert!(VERSION == 7 && GUIDED == 56);

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: u64,
    /// [`content_hash`] of everything after it.
    hash: u64,
    version: u32,
    /// Number of the shard in the plan.
    index: u32,
    /// Bytes in all.
    length: u64,
    /// Hash of settings, version of this crate and layout of records.
    plan: u64,
    joined: Identity,
    pixels: u64,
    bins: u64,
    counters: Counters,
}

/// Reason why bytes cannot be loaded into a shard, or a shard cannot be saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SavedShardError {
    /// Too few bytes, or too many.
    Length {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// Not a saved shard of a machine with this byte order; the first eight bytes.
    Magic(u64),
    /// A version of the format that is not known.
    Version(u32),
    /// The hash of the contents is not the one stored.
    Hash {
        /// Hash in the header.
        stored: u64,
        /// Hash of the bytes.
        found: u64,
    },
    /// A shard of another plan: other settings, another version of this crate, another arithmetic, or addresses of
    /// another size.
    Plan {
        /// Hash of this shard's plan.
        expected: u64,
        /// Hash in the header.
        found: u64,
    },
    /// Another shard of the plan.
    Shard {
        /// Index of this shard.
        expected: u32,
        /// Index in the header.
        found: u32,
    },
    /// A shard of another scene.
    Scene {
        /// Content hash of this scene.
        expected: u64,
        /// Content hash in the header.
        found: u64,
    },
    /// A shard of another iteration, or of a session that was restarted more or less often.
    Iteration {
        /// Restarts and iteration of this session.
        expected: (u64, Iteration),
        /// Restarts and iteration in the header.
        found: (u64, Iteration),
    },
    /// A shard of a session that began the iteration with other statistics.
    Statistics {
        /// Bins of this session.
        expected: u64,
        /// Bins in the header.
        found: u64,
    },
    /// Numbers that no shard has, under a hash that is right.
    Numbers {
        /// What they are of.
        what: &'static str,
        /// Number of the pixel or of the bin, or how many of them there are.
        at: u64,
    },
    /// The shard to be saved has not finished an iteration.
    Unfinished {
        /// Index of the shard.
        shard: u32,
    },
}

impl fmt::Display for SavedShardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { needed, given } => write!(f, "saved shard has {needed} bytes, {given} given"),
            Self::Magic(m) => write!(f, "not a saved shard: starts with {m:#018x}"),
            Self::Version(v) => write!(f, "saved shard of version {v}, only {VERSION} is known"),
            Self::Hash { stored, found } => write!(f, "saved shard has hash {found:#018x}, header says {stored:#018x}"),
            Self::Plan { expected, found } => {
                write!(
                    f,
                    "saved shard is of another plan: settings or version (hash {found:#018x}, need {expected:#018x})"
                )
            }
            Self::Shard { expected, found } => write!(f, "saved shard is shard {found}, need {expected}"),
            Self::Scene { expected, found } => {
                write!(f, "saved shard is of another scene (hash {found:#018x}, need {expected:#018x})")
            }
            Self::Iteration { expected: (epoch, i), found: (other_epoch, o) } => write!(
                f,
                "saved shard is of iteration {} with {} samples after {} ({other_epoch} restarts), \
                 need iteration {} with {} after {} ({epoch} restarts)",
                o.number, o.samples, o.first_sample, i.number, i.samples, i.first_sample
            ),
            Self::Statistics { expected, found } => {
                write!(f, "saved shard has {found} bins of statistics, this session began with {expected}")
            }
            Self::Numbers { what, at } => write!(f, "saved shard has wrong numbers: {what} {at}"),
            Self::Unfinished { shard } => write!(f, "shard {shard} has not finished an iteration"),
        }
    }
}

impl core::error::Error for SavedShardError {}

/// Bytes of a pixel.
fn pixel_bytes(job: &Job) -> usize {
    let rays = if job.settings.counts_rays() { size_of::<u32>() } else { 0 };
    let planes = AovLayout::new(job.settings.aovs).planes;
    planes.saturating_mul(size_of::<f32>()).saturating_add(rays).saturating_add(size_of::<PixelSums>())
}

/// What path guiding has gathered besides directions.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct GuideHeader {
    /// Directions offered to the log.
    offered: u64,
    /// What guiding promises.
    promise: Promise,
}

/// Length of a saved shard, bytes.
fn length(job: &Job, pixels: usize, bins: usize, hits: usize) -> usize {
    let of_log = if job.guide.is_some() { hits.saturating_mul(GuideLog::HIT_BYTES).saturating_add(GUIDED) } else { 0 };
    let of_bins = bins.saturating_mul(Training::BIN_BYTES).saturating_add(of_log);
    pixels.saturating_mul(pixel_bytes(job)).saturating_add(of_bins).saturating_add(HEADER)
}

/// Length of the longest that a shard with so many pixels saves, bytes.
pub(crate) fn longest(job: &Job, pixels: usize) -> usize {
    length(job, pixels, job.cache.map_or(0, |size| size.bins()), job.guide.map_or(0, |size| size.hits() as usize))
}

/// Takes bytes off the front of a saved shard; none if there are not so many.
fn take<'b>(rest: &mut &'b [u8], bytes: usize) -> &'b [u8] {
    let (head, tail) = rest.split_at_checked(bytes).unwrap_or((&[], &[]));
    *rest = tail;
    head
}

/// A saved shard that fits: header, and sums of pixels, rays, auxiliary sums, bins, shadow rays, log as bytes.
struct SavedShard<'b> {
    header: Header,
    guide: GuideHeader,
    parts: [&'b [u8]; 6],
}

impl<'b> SavedShard<'b> {
    /// Checks all that can be said without numbers of pixels and bins.
    fn check<W: World>(bytes: &'b [u8], shard: &Shard<'_>, world: &W) -> Result<Self, SavedShardError> {
        use SavedShardError as E;
        let given = bytes.len();
        let (header, mut rest) = bytes.split_at_checked(HEADER).ok_or(E::Length { needed: HEADER, given })?;
        let header: Header = bytemuck::pod_read_unaligned(header);
        if header.magic != MAGIC {
            return Err(E::Magic(header.magic));
        }
        if header.version != VERSION {
            return Err(E::Version(header.version));
        }
        if header.length != given as u64 {
            return Err(E::Length { needed: usize::try_from(header.length).unwrap_or(usize::MAX), given });
        }
        let found = content_hash(bytes.get(UNHASHED..).unwrap_or(&[]));
        if header.hash != found {
            return Err(E::Hash { stored: header.hash, found });
        }
        let (there, here) = (header.joined, world.identity());
        if header.plan != shard.fingerprint() {
            return Err(E::Plan { expected: shard.fingerprint(), found: header.plan });
        }
        if header.index != shard.index() {
            return Err(E::Shard { expected: shard.index(), found: header.index });
        }
        if there.scene != here.scene {
            return Err(E::Scene { expected: here.scene, found: there.scene });
        }
        if there != here {
            let (expected, found) = ((here.epoch, here.iteration), (there.epoch, there.iteration));
            return Err(E::Iteration { expected, found });
        }
        let bins = world.learned().used_bins();
        if header.bins != u64::from(bins) {
            return Err(E::Statistics { expected: bins.into(), found: header.bins });
        }
        let job = &shard.job;
        let pixels = usize::try_from(header.pixels).unwrap_or(usize::MAX);
        let log = shard.guide_log();
        // what the log adds follows from its first bytes
        let (mut guide, mut hits) = (GuideHeader::default(), 0);
        if let Some(log) = log.filter(|_| pixels <= job.tiles.pixels_of(shard.index())) {
            let at = length(job, pixels, bins as usize, 0).saturating_sub(GUIDED);
            let bytes = bytes.get(at..).and_then(|b| b.first_chunk::<GUIDED>());
            guide = bytes.map_or(guide, |b| bytemuck::pod_read_unaligned(b));
            let Ok(offered) = u32::try_from(guide.offered) else {
                return Err(E::Numbers { what: "directions of the guide", at: guide.offered });
            };
            hits = log.len_of(offered);
        }
        if pixels > job.tiles.pixels_of(shard.index()) || length(job, pixels, bins as usize, hits) != given {
            return Err(E::Numbers { what: "pixels", at: header.pixels });
        }
        if !header.counters.have_room() {
            return Err(E::Numbers { what: "counters of shard", at: header.index.into() });
        }
        let lengths = shard.state.book.lengths(pixels);
        let [records, shadows] = Training::lengths(bins as usize);
        let [a, b, c] = lengths.map(|n| take(&mut rest, n));
        let [d, e] = [records, shadows].map(|n| take(&mut rest, n));
        let _ = take(&mut rest, if log.is_some() { GUIDED } else { 0 });
        Ok(Self { header, guide, parts: [a, b, c, d, e, rest] })
    }

    /// Checks the numbers.
    fn check_numbers(&self) -> Result<(), SavedShardError> {
        let [pixels, _, _, records, shadows, log] = self.parts;
        let unsound = |bytes: &[u8]| !bytemuck::pod_read_unaligned::<PixelSums>(bytes).is_sound();
        if let Some(at) = pixels.chunks_exact(size_of::<PixelSums>()).position(unsound) {
            return Err(SavedShardError::Numbers { what: "pixel", at: at as u64 });
        }
        if let Some(at) = Training::unsound(records, shadows) {
            return Err(SavedShardError::Numbers { what: "bin", at: at as u64 });
        }
        if !self.guide.promise.is_sound() {
            return Err(SavedShardError::Numbers { what: "promise of path guiding", at: 0 });
        }
        match GuideLog::unsound(log) {
            Some(at) => Err(SavedShardError::Numbers { what: "direction", at: at as u64 }),
            None => Ok(()),
        }
    }
}

impl Shard<'_> {
    /// Length of what [`Self::save`] writes, bytes; [`Plan::saved_shard`](crate::Plan::saved_shard) is the longest.
    pub fn saved_len(&self) -> usize {
        let book = &self.state.book;
        let hits = self.guide_log().map_or(0, GuideLog::len);
        length(&self.job, book.begun(), book.training.as_ref().map_or(0, Training::used), hits)
    }

    /// Writes what the end of an iteration reads of a shard that has finished it ([`StepResult::Done`], or stopped and
    /// drained), for [`Self::load`] of another process; returns the bytes written. Equal sums give equal bytes.
    ///
    /// # Errors
    /// A shard that has not finished an iteration, or too few bytes: nothing is written then.
    ///
    /// [`StepResult::Done`]: crate::StepResult::Done
    pub fn save(&self, out: &mut [u8]) -> Result<usize, SavedShardError> {
        let (needed, given) = (self.saved_len(), out.len());
        if self.joined.iteration.number == 0 || !self.is_done(self.joined) {
            return Err(SavedShardError::Unfinished { shard: self.index() });
        }
        let out = out.get_mut(..needed).ok_or(SavedShardError::Length { needed, given })?;
        let book = &self.state.book;
        let mut header = Header {
            magic: MAGIC,
            hash: 0,
            version: VERSION,
            index: self.index(),
            length: needed as u64,
            plan: self.fingerprint(),
            joined: self.joined,
            pixels: book.begun() as u64,
            bins: book.training.as_ref().map_or(0, |t| t.used() as u64),
            counters: book.counters,
        };
        let [pixels, rays, aovs] = book.sums();
        let none: [&[u8]; 2] = [&[]; 2];
        let [records, shadows] = book.training.as_ref().map_or(none, Training::sums);
        let log = self.guide_log().map_or(none[0], GuideLog::bytes);
        let promise = self.guide_promise().copied().unwrap_or_default();
        let guide = self.guide_log().map(|log| GuideHeader { offered: log.offered().into(), promise });
        let guide = guide.as_ref().map_or(none[0], bytemuck::bytes_of);
        let parts = [bytemuck::bytes_of(&header), pixels, rays, aovs, records, shadows, guide, log];
        let mut rest = &mut *out;
        for part in parts {
            let (head, tail) =
                rest.split_at_mut_checked(part.len()).ok_or(SavedShardError::Length { needed, given })?;
            head.copy_from_slice(part);
            rest = tail;
        }
        header.hash = content_hash(out.get(UNHASHED..).unwrap_or(&[]));
        if let Some(head) = out.get_mut(..HEADER) {
            head.copy_from_slice(bytemuck::bytes_of(&header));
        }
        Ok(needed)
    }

    /// Takes the place of the shard that [`Self::save`] has written: joins the iteration of `world`, the session, with
    /// its sums, finished. What this shard had gathered in the iteration is forgotten. Sessions of several processes
    /// that begin the same iterations, and end each with all shards, have the same film and the same statistics to the
    /// bit.
    ///
    /// Of the statistics that the other session began the iteration with, only their size is compared: sessions that
    /// load statistics must load the same ones.
    ///
    /// # Errors
    /// Bytes of another scene, plan, shard, iteration or version, or not whole; the shard is as before then.
    pub fn load<W: World>(&mut self, world: &W, bytes: &[u8]) -> Result<(), SavedShardError> {
        let saved = SavedShard::check(bytes, self, world)?;
        saved.check_numbers()?;
        self.begin(world);
        self.stop();
        let book = &mut self.state.book;
        let [pixels, rays, aovs, records, shadows, log] = saved.parts;
        book.load(saved.header.pixels as usize, [pixels, rays, aovs]);
        book.counters = saved.header.counters;
        if let Some(training) = &mut book.training {
            training.load([records, shadows]);
        }
        if let Some(guide) = book.guide.log_mut() {
            guide.load(saved.guide.offered as u32, log);
        }
        book.guide.promise.fill(saved.guide.promise);
        Ok(())
    }
}
