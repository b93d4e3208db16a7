//! The path tracer: packets of eight lanes, and what waits between them. [`pipeline`] shows the whole turn of a packet.
//!
//! | file | holds |
//! |---|---|
//! | `pipeline` | all stages in order |
//! | `refill`, `camera_rays` | what fills a packet: samples of waiting vertices, or camera samples |
//! | `points` | camera samples that begin at surfaces |
//! | `light_paths` | paths from lights, which path guiding learns from at first |
//! | `nee`, `occlude` | next event estimation: light samples, their shadow rays |
//! | `scatter` | BSDF samples and values |
//! | `trace` | closest hits |
//! | `surfaces` | what is known of hits: triangles, surfaces of the host's own |
//! | `emission` | emission that rays meet, weighted against light samples |
//! | `shading` | the vertices that hits become |
//! | `relief` | textures and shading normals of principled surfaces |
//! | `aov`, `first_surfaces` | auxiliary values of pixels |
//! | `roulette`, `cache_key` | how many samples a vertex gets, and what is known where it lies |
//! | `settle` | vertices go to the ring, finished paths to the books |
//! | `vertex`, `ring`, `class` | path vertices, and the fixed ring in which they wait by class |
//! | `book`, `root`, `ledger` | radiance and cost of camera samples and of learned samples in flight |
//! | `free_list` | free slots of slabs |
//! | `packets`, `path` | what stages hand to each other |
//! | `shard`, `state`, `job` | one unit of parallel work, what it keeps, and what all of them share |
//! | `save` | a finished shard as bytes, for other machines |

mod aov;
mod book;
mod cache_key;
mod camera_rays;
mod class;
mod crossing;
mod emission;
mod first_surfaces;
mod free_list;
mod guide_notes;
mod guided;
mod job;
mod ledger;
mod light_paths;
mod media_set;
mod medium;
mod nee;
mod occlude;
mod packets;
mod passing;
mod path;
mod pipeline;
mod points;
mod refill;
mod relief;
mod ring;
mod root;
mod roulette;
mod save;
mod scatter;
mod settle;
mod shading;
mod shard;
#[cfg(test)]
mod stage_tests;
mod state;
mod surfaces;
mod trace;
mod vertex;

pub(crate) use job::Job;
pub use ledger::{Finished, Ledger, NO_RECORD};
pub(crate) use media_set::media_at;
pub use occlude::MAX_PASSED;
pub use save::SavedShardError;
pub(crate) use save::longest;
pub use shard::{Budget, Shard, ShardError, StepResult};
pub(crate) use shard::{SHARD_RECORD_BYTES, ShardCursor};

/// Bytes of the state of a path in flight: a waiting vertex with its link in the ring, and a camera sample.
pub const BYTES_PER_PATH: usize = ring::BYTES_PER_VERTEX + root::BYTES_PER_ROOT;

const _: () = assert!(BYTES_PER_PATH <= 208);
