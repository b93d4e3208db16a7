//! What is left of a session in its block while it is suspended: all its scalars as one record at the head of the block.

use crate::counters::Counters;
use crate::film::{FilmScalars, TrimmedSums};
use crate::learn::{LearnedScalars, Needs};
use crate::scene::Scene;
use crate::scene::blob::content_hash;
use crate::settings::Settings;
use crate::tracer::{BYTES_PER_PATH, SHARD_RECORD_BYTES, ShardCursor};
use crate::world::Iteration;
use bytemuck::{Pod, Zeroable};
use core::fmt;
use croupier_simd::REPRODUCIBLE;

/// First bytes of a record.
const MAGIC: u64 = u64::from_le_bytes(*b"CRPSESSN");
/// State of a block whose session is in use, or was not suspended.
const OPEN: u64 = 1;
/// State of a block whose session is suspended.
const SUSPENDED: u64 = 2;

/// How far the end of an iteration has come.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Finishing {
    /// Sums over pixels without the largest.
    pub sums: TrimmedSums,
    /// Counts of all shards.
    pub counters: Counters,
    /// Next pixel of the film, or next bin.
    pub at: u64,
    /// Next tile of the shard.
    pub cursor: ShardCursor,
    /// Stage of the work; 0 before it begins.
    pub stage: u32,
    /// Next shard.
    pub shard: u32,
}

impl Finishing {
    /// `n` more are done of the shard, or all of it.
    pub(crate) fn advance(&mut self, n: usize, done: bool) {
        self.at += n as u64;
        if done {
            (self.shard, self.at) = (self.shard + 1, 0);
        }
    }
}

/// Scalars of a session.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SessionScalars {
    /// Content hash of the scene.
    pub scene: u64,
    /// Number of restarts.
    pub epoch: u64,
    /// Iteration that runs, or the last one.
    pub iteration: Iteration,
    /// Counts of the finished iterations.
    pub counters: Counters,
    pub film: FilmScalars,
    pub learned: LearnedScalars,
    pub finishing: Finishing,
    /// Bits of the media that the camera is inside of, in that scene.
    pub camera_media: u32,
    /// Not 0 while an iteration runs.
    pub running: u32,
}

impl SessionScalars {
    /// Those of a session that has rendered nothing.
    pub(crate) fn new(scene: &Scene<'_>, camera_media: u32) -> Self {
        Self {
            scene: scene.hash,
            epoch: 0,
            iteration: Iteration::default(),
            counters: Counters::default(),
            film: FilmScalars::new(),
            learned: LearnedScalars::new([scene.info.bounds_min, scene.info.bounds_max]),
            finishing: Finishing::default(),
            camera_media,
            running: 0,
        }
    }
}

/// Head of a session's block. Scalars are those of the last suspension.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SessionRecord {
    magic: u64,
    state: u64,
    /// [`fingerprint`] of the plan.
    fingerprint: u64,
    /// [`content_hash`] of the scalars.
    hash: u64,
    scalars: SessionScalars,
}

/// Reason why a block cannot be resumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ResumeError {
    /// The block holds no suspended session: none at all, or one that was dropped without
    /// [`Session::suspend`](crate::Session::suspend).
    NotSuspended,
    /// The session was suspended under another plan, or by another version of this crate.
    Plan,
    /// The record is not as it was written.
    Damaged,
}

impl fmt::Display for ResumeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotSuspended => "the block holds no suspended session",
            Self::Plan => "the session in the block was suspended under another plan",
            Self::Damaged => "the record of the suspended session is damaged",
        })
    }
}

impl core::error::Error for ResumeError {}

impl SessionRecord {
    /// Marks the block as one in use.
    pub(crate) fn open(&mut self) {
        (self.magic, self.state) = (MAGIC, OPEN);
    }

    /// Stores a session.
    pub(crate) fn suspend(&mut self, fingerprint: u64, scalars: &SessionScalars) {
        let hash = content_hash(bytemuck::bytes_of(scalars));
        *self = Self { magic: MAGIC, state: SUSPENDED, fingerprint, hash, scalars: *scalars };
    }

    /// The scalars of the suspended session of a plan with this fingerprint and these needs.
    pub(crate) fn scalars(&self, fingerprint: u64, needs: &Needs) -> Result<SessionScalars, ResumeError> {
        if self.magic != MAGIC || self.state != SUSPENDED {
            return Err(ResumeError::NotSuspended);
        }
        if self.fingerprint != fingerprint {
            return Err(ResumeError::Plan);
        }
        let s = self.scalars;
        let counters = s.counters.have_room() && s.finishing.counters.have_room();
        if self.hash != content_hash(bytemuck::bytes_of(&s)) || !counters || !s.learned.fit(needs) {
            return Err(ResumeError::Damaged);
        }
        Ok(s)
    }
}

/// Hash of what the layout and the meaning of a block depend on: the settings, the version of this crate, the sizes of an
/// address and of the records at the head of blocks and in their slabs, how numbers are rounded.
pub(crate) fn fingerprint(settings: &Settings) -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    hash.add(env!("CARGO_PKG_VERSION").as_bytes());
    for size in [size_of::<usize>(), size_of::<SessionRecord>(), SHARD_RECORD_BYTES, BYTES_PER_PATH] {
        hash.add(&(size as u64).to_le_bytes());
    }
    hash.add(&[REPRODUCIBLE.into()]);
    for setting in Settings::TABLE {
        hash.add(setting.name.as_bytes());
        // not as text: programs without an operating system would carry all that formats numbers
        if let Some(value) = settings.value(setting.name) {
            value.bytes(|bytes| hash.add(bytes));
        }
    }
    hash.0
}

/// 64-bit FNV-1a.
struct Fnv(u64);

impl Fnv {
    fn add(&mut self, bytes: &[u8]) {
        for b in bytes {
            self.0 = (self.0 ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::Strategy;
    use std::collections::HashMap;
    use std::string::String;

    /// Killed by: an option of a strategy, or a value of a setting, that is left out of the hash.
    #[test]
    fn other_settings_have_other_fingerprints() {
        let mut seen: HashMap<u64, String> = HashMap::new();
        let mut other = |name: &str, text: &str| {
            let mut settings = Settings::default();
            settings.set(name, text).expect(text);
            if let Some(same) = seen.insert(fingerprint(&settings), std::format!("{name} {text}")) {
                assert!(settings == Settings::default(), "{name} {text} has the fingerprint of {same}");
            }
        };
        for (name, _) in Strategy::TABLE {
            other("rrs", if *name == "fixed" { "fixed:2" } else { name });
        }
        for options in [
            "albedo:product",
            "bolin-meyer:plain",
            "classic:6",
            "classic:6:relative",
            "ear:plain",
            "ears:plain",
            "fixed:3",
            "threshold:0.5",
            "throughput:mean",
            "throughput:max:0.1",
            "throughput:max:0.05:0.9",
            "throughput:max:0.05:0.95:3",
            "winners:2",
            "winners:1:2",
        ] {
            other("rrs", options);
        }
        for (name, text) in [
            ("size", "3x2"),
            ("size", "2x3"),
            ("seed", "4294967296"),
            ("shards", "2"),
            ("max-depth", "9"),
            ("sampler", "sobol"),
            ("ring", "64"),
            ("split-budget", "64"),
            ("aovs", "albedo"),
            ("aovs", "true"),
            ("adaptive", "true"),
            ("shadow-roulette", "true"),
            ("control-variate", "cached"),
            ("control-variate", "0.5"),
            ("cache-bytes", "65536"),
            ("ledger", "256"),
            ("learn-samples", "9"),
            ("subdivide-count", "1000"),
            ("decay", "0.5"),
            ("pixel-estimator", "blocks"),
            ("objective", "absolute"),
            ("norm", "max"),
            ("guiding", "auto"),
            ("guiding", "on"),
            ("guide-bytes", "300000"),
            ("factors", "0.5:2"),
            ("factors", "0.05:2"),
        ] {
            other(name, text);
        }
        for setting in Settings::TABLE {
            let tried = seen.values().any(|text| text.split(' ').next() == Some(setting.name));
            assert!(tried, "no other value of {} was tried", setting.name);
        }
    }
}
