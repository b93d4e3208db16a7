//! The cache of statistics by position and direction (EARS, SIGGRAPH 2022, section 5; Müller et al. 2017 for the tree).
//!
//! An octree over the scene has 4x4 direction bins in every leaf. A bin holds
//!
//! 1. count, sums and squared sums of the *values* of samples (reflected radiance over albedo, linear Rec. 709) that
//!    were drawn at vertices in it, and the sum of their counted cost;
//! 2. sums of half the squared difference of two samples of the same vertex: their mean is the variance at a point,
//!    whereas `moment - mean^2` also has the spread of the mean over the cell in it;
//! 3. shadow rays from the leaf towards the bin's directions, and how many of them were unoccluded;
//! 4. squared sums of what next event estimation contributed.
//!
//! Kinds of vertices that should not be mixed have an octree each, and the direction is the caller's choice: see
//! [`VertexKind`]. Shards look up what [`Cache::freeze`] computed and log into their own [`Training`]; between
//! iterations those are merged in shard order, so the cache does not depend on threads.
//!
//! | file | holds |
//! |---|---|
//! | `kind` | [`VertexKind`]: one octree for each |
//! | `bins` | statistics of one bin: of an iteration, of all of them, as look-ups read them |
//! | `tree` | octrees: leaf of a position, bin of a direction |
//! | `size` | [`CacheSize`]: room for leaves |
//! | `training` | [`Training`]: one shard's side, of the current iteration |
//! | `shared` | [`Cache`]: the side that all shards look up in |
//! | `freeze` | from sums to what look-ups read |
//! | `save` | the cache as bytes |

mod bins;
mod freeze;
mod kind;
mod save;
mod shared;
mod size;
mod training;
pub(super) mod tree;

pub(super) use bins::BINS;
pub use bins::{BIN_LIMIT, MAX_VALUE, NO_BIN};
pub use kind::{VertexKind, VertexKind8};
pub use save::CacheError;
pub(super) use save::check_shape;
pub(in crate::learn) use save::{not_saved, saved_length};
pub use shared::Cache;
pub(super) use shared::CacheScalars;
pub use size::CacheSize;
pub use training::Training;
