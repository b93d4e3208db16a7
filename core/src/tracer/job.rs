//! What all shards of a render have in common.

use crate::learn::cache::CacheSize;
use crate::learn::guiding::GuideSize;
use crate::settings::Settings;
use crate::tiles::Tiles;

/// Checked settings and what follows from them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job {
    pub settings: Settings,
    pub tiles: Tiles,
    /// Room for statistics of the scene, if they are wanted.
    pub cache: Option<CacheSize>,
    /// Room for path guiding, if it is on.
    pub guide: Option<GuideSize>,
    /// Hash of the settings, which tells blocks of other plans.
    pub fingerprint: u64,
}
