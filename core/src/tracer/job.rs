//! What all shards of a render have in common.

use crate::learn::cache::CacheSize;
use crate::settings::Settings;
use crate::tiles::Tiles;

/// Checked settings and what follows from them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job {
    pub settings: Settings,
    pub tiles: Tiles,
    /// Room for statistics of the scene, if they are wanted.
    pub cache: Option<CacheSize>,
}
