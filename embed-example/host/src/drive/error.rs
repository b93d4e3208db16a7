//! Errors of a render.

use super::part::PartError;
use crate::checkpoint::CheckpointError;
use crate::text;
use croupier::unstable::learn::cache::CacheError;
use croupier::{SceneError, SessionError, SettingsError, ShardError};
use std::fmt;

/// Reason why nothing is rendered.
#[derive(Debug)]
#[non_exhaustive]
pub enum DriveError {
    /// The bytes are not a scene.
    Scene(SceneError),
    /// A setting cannot be used.
    Settings(SettingsError),
    /// The session cannot start.
    Session(SessionError),
    /// A shard cannot be made.
    Shard(ShardError),
    /// The saved cache cannot be loaded, or the cache not be saved.
    Cache(CacheError),
    /// Statistics are to be loaded or saved, but this strategy learns nothing from the scene, and no path is guided.
    NoCache(&'static str),
    /// A checkpoint is to be resumed together with something that it holds itself: this.
    Resumed(&'static str),
    /// The checkpoint cannot be resumed.
    Checkpoint(CheckpointError),
    /// There is no such part of the picture.
    Part(PartError),
    /// The checkpoint is of another part of the picture: numbers of the first sample per pixel of both.
    OtherPart(u32, u32),
    /// No memory for a block of so many bytes.
    Memory(usize),
    /// The thread pool cannot start.
    Threads(rayon::ThreadPoolBuildError),
}

impl DriveError {
    /// Whether the error is about a saved cache.
    pub fn is_about_cache(&self) -> bool {
        matches!(self, Self::Cache(_))
    }

    /// Whether the error is about the checkpoint that was to be resumed.
    pub fn is_about_checkpoint(&self) -> bool {
        matches!(self, Self::Checkpoint(_) | Self::OtherPart(..) | Self::Session(SessionError::Resume(_)))
    }

    /// Whether more memory for the cache would avoid the error.
    pub fn calls_for_cache_bytes(&self) -> bool {
        matches!(self, Self::Cache(CacheError::Full { .. }))
    }
}

impl fmt::Display for DriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(e) => e.fmt(f),
            Self::Settings(e) => e.fmt(f),
            Self::Session(e) => e.fmt(f),
            Self::Shard(e) => e.fmt(f),
            Self::Cache(e @ CacheError::Bounds { .. }) => write!(f, "statistics of another scene: {e}"),
            Self::Cache(e) => e.fmt(f),
            Self::NoCache(strategy) => {
                write!(
                    f,
                    "roulette strategy `{strategy}` learns nothing from the scene, and no path is guided: there are no \
                     statistics to load or save"
                )
            }
            Self::Resumed(what) => write!(f, "a checkpoint has its own {what}: give one or the other"),
            Self::Checkpoint(e) => e.fmt(f),
            Self::Part(e) => e.fmt(f),
            Self::OtherPart(there, here) => {
                write!(f, "the checkpoint is of another part: it begins with sample {there} of each pixel, not {here}")
            }
            Self::Memory(bytes) => write!(f, "no memory for a block of {}", text::bytes(*bytes as u64)),
            Self::Threads(e) => write!(f, "cannot start threads: {e}"),
        }
    }
}

impl std::error::Error for DriveError {}

macro_rules! from {
    ($($t:ty => $v:ident),*) => {$(
        impl From<$t> for DriveError {
            fn from(e: $t) -> Self {
                Self::$v(e)
            }
        }
    )*};
}
from!(SceneError => Scene, SettingsError => Settings, SessionError => Session, ShardError => Shard, CacheError => Cache,
      CheckpointError => Checkpoint, PartError => Part,
      rayon::ThreadPoolBuildError => Threads);
