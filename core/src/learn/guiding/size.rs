//! Room for leaves, nodes and logs, from which the bytes follow.

/// Capacity of a guide and of the logs of its shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuideSize {
    /// Subdivisions of the octrees.
    pub(super) subdivisions: u32,
    /// Nodes of all trees over the sphere.
    pub(super) nodes: u32,
    /// Entries of the log of each shard.
    pub(super) hits: u32,
}

impl GuideSize {
    /// Entries of the log of each shard.
    pub fn hits(self) -> u32 {
        self.hits
    }
}
