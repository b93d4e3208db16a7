//! What stages hand to each other: packets of eight lanes.

use super::class::PacketClass;
use super::media_set::MediaSet8;
use super::path::Path8;
use super::vertex::PathVertex8;
use crate::geometry::Ray8;
use crate::rng::Key8;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Samples of waiting vertices, all of one class.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Samples8 {
    /// The vertices that they are drawn at.
    pub vertex: PathVertex8,
    /// Lanes with a sample.
    pub active: Mask8,
    /// Lanes whose path may have another segment.
    pub continues: Mask8,
    /// Kernel that they need.
    pub class: PacketClass,
    /// Do they draw light samples?
    pub with_nee: bool,
    /// Whose samples these are: the vertices' roots and depths, ledger records of their own.
    pub path: Path8,
    /// Random keys.
    pub key: Key8,
    /// Times of the paths.
    pub time: F32x8,
    /// Lanes that are guided, where the guide asks for it. If they have a record, they are learned from; others may be in
    /// small pictures while nothing is decided.
    pub guided: Mask8,
}

/// One ray per lane, from the camera or from a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayState8 {
    /// Lanes with a ray.
    pub active: Mask8,
    /// The rays; unit directions.
    pub ray: Ray8,
    /// Vertices that the rays left (before the offset), from where light sampling could have found what they hit.
    pub from: Vec3x8,
    /// Geometric normals there.
    pub normal: Vec3x8,
    /// Distance of the origins from there: 0 until a ray has passed something straight on.
    pub travelled: F32x8,
    /// Media around the origins.
    pub media: MediaSet8,
    /// Prefix weight including the bounce.
    pub beta: Vec3x8,
    /// Weight of the bounce alone, `f cos / pdf`.
    pub weight: Vec3x8,
    /// Solid-angle density by which MIS weighs what the direction meets.
    pub pdf: F32x8,
    /// Lanes that light sampling cannot reach (camera rays, specular bounces): emission counts in full.
    pub skip_mis: Mask8,
    /// Whose rays these are; the segment counts in their depth.
    pub path: Path8,
    /// Random keys of the vertices to come.
    pub key: Key8,
    /// Product of the albedos of the vertices so far.
    pub albedo_product: F32x8,
    /// See [`PixelTarget::error_weight`](super::root::PixelTarget::error_weight).
    pub error_weight: Vec3x8,
}

/// What the rays of a packet are: all of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RayKind {
    /// From the camera.
    Camera,
    /// From a vertex.
    Scattered,
    /// On from where a ray of another packet passed something or stopped.
    Straight,
}

/// Eight shadow rays and what they bring if nothing is in the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowRays8 {
    /// Lanes with a ray.
    pub active: Mask8,
    /// From the vertex to the light sample.
    pub ray: Ray8,
    /// Whose rays these are.
    pub path: Path8,
    /// What counts where the light sample is visible.
    pub found: Contribution8,
    /// Bins of the statistics of visibility, [`NO_BIN`](crate::learn::cache::NO_BIN) where nothing is learned.
    pub towards: U32x8,
}

/// Emission that eight rays met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emission8 {
    /// Radiance found.
    pub found: Contribution8,
    /// MIS weight that it was counted with; of several lights, what was counted over what was met.
    pub weight: F32x8,
}

/// Radiance found by eight lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contribution8 {
    /// What it counts in the pixel: prefix weight included.
    pub pixel: Vec3x8,
    /// What it counts in the sample's own estimate: no prefix weight.
    pub local: Vec3x8,
}
