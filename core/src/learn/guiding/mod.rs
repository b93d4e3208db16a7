//! Path guiding: distributions of directions by position, learned from paths, that scattering samples besides the BSDF
//! (Müller et al., "Practical Path Guiding for Efficient Light-Transport Simulation", 2017).
//!
//! An octree divides the scene, apart for the six directions that a shading normal may mainly point in: the light that
//! counts at a floor is not that of the ceiling above it. Vertices in media, which have no normal, have an octree of
//! their own. A leaf has a tree over the sphere ([`sphere`] maps it to a square and keeps areas): nodes of 4x4 cells,
//! at most three levels, so that cells are 64 x 64 where there is much light and 4 x 4 elsewhere. The density of a cell
//! is in proportion to the mean of f cos L in it, what the bounce contributes for each steradian. The root of the mean
//! square (Rath et al., "Variance-Aware Path Guiding", 2020) would make the second moment of the samples least if the rest
//! of the paths stayed as noisy as it is, and if few samples told it; benches/EFFICIENCY.md has what it costs.
//!
//! Whatever the trees hold, densities are those with which directions are sampled, and the BSDF is sampled too, so
//! pictures stay unbiased.
//!
//! Nothing is learned while an iteration runs: each shard keeps the directions that contributed in a bounded
//! [`GuideLog`]. Logs are replayed in the order of the shards when the iteration ends ([`Guide::learn`]), so the trees
//! do not depend on threads, and there is one of them, whatever the number of shards.
//!
//! A guide that has learned nothing learns from light paths first (`tracer/light_paths.rs`), which find what camera paths
//! hardly ever find.
//!
//! | file | holds |
//! |---|---|
//! | `sphere` | map between directions and the unit square |
//! | `node` | nodes of 4x4 cells: sampled, and while they learn |
//! | `fraction` | share of samples that are guided, by the second moments that shares would have had |
//! | `log` | [`GuideLog`]: directions that contributed, of one shard and iteration |
//! | `size` | [`GuideSize`]: room for leaves, nodes and logs |
//! | `shared` | [`Guide`]: what all shards sample |
//! | `rebuild` | from logs to what is sampled |
//! | `light` | from the logs of light paths, at first |
//! | `save` | the guide as bytes |
//! | `merge` | guides that were learned apart |
//! | `watch` | is it worth its cost? |

/// The crate's feature `guiding`. Without it there is no guide, and compilers remove what would serve one.
pub(crate) const COMPILED: bool = cfg!(feature = "guiding");

mod fraction;
mod light;
mod log;
mod merge;
mod node;
mod rebuild;
mod save;
mod shared;
mod size;
pub mod sphere;
#[cfg(test)]
mod tests;
mod watch;

pub use log::{GuideLog, NO_LEAF, UNKNOWN_SHARE};
pub(in crate::learn) use save::saved_length;
pub(crate) use shared::GuideScalars;
pub use shared::{Guide, Guide8};
pub use size::GuideSize;
pub(crate) use watch::{ENOUGH, LEARNED, Promise, TrialShares, Watch};
pub use watch::{GuideGain, GuideUse};
