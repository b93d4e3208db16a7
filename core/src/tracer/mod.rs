//! The packet machine. One turn takes eight samples from waiting vertices of one class, all with a light sample or all
//! without (or eight camera samples), through the stages, each its own file:
//!
//! `refill` -> `scatter` -> `occlude` -> `trace` -> `surface` -> `roulette` -> `settle`
//!
//! What goes on becomes a waiting vertex again. Every queue is fixed; see [`vertex::Pool`] for why none can overflow.

mod flight;
mod free_list;
mod job;
mod ledger;
mod occlude;
mod place;
mod refill;
mod root;
mod roulette;
mod scatter;
mod settle;
mod shard;
mod surface;
mod trace;
mod vertex;

pub(crate) use job::Job;
pub use shard::{Budget, Shard, ShardError, StepResult};

use crate::settings::Settings;
use crate::tiles::{TILE_PIXELS, Tiles};

/// Bytes of a waiting vertex, its slots in the rings and its root: the state per path.
pub const BYTES_PER_PATH: usize = size_of::<vertex::Vertex>() + 4 * (vertex::RINGS + 1) + size_of::<root::Root>() + 4;

/// Camera samples in flight: every waiting vertex may have its own, and so may the lanes of a packet.
fn roots_capacity(settings: &Settings) -> usize {
    settings.ring as usize + 16
}

/// Records of samples in flight, if anything is learned from them.
fn ledger_capacity(settings: &Settings) -> usize {
    if settings.strategy.space().is_some() { settings.learning.ledger as usize } else { 0 }
}

/// Pixel slots of one shard.
fn pixel_slots(tiles: &Tiles) -> usize {
    tiles.most_tiles().saturating_mul(TILE_PIXELS as usize)
}
