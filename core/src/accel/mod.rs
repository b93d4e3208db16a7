//! Rays against triangles.
//!
//! | file | holds |
//! |---|---|
//! | `wide` | [`WideBvh`]: the built-in [`Intersector`], grouping of rays |
//! | `setup` | per-ray constants, eight rays at once |
//! | `triangle` | the watertight triangle test, the same lanes for 8 triangles or 8 rays |
//! | `single` | one ray against 8-wide nodes and 8-triangle leaves |
//! | `packet` | up to eight rays of one octant together |

mod packet;
mod setup;
mod single;
mod triangle;
mod wide;

pub use wide::WideBvh;

use crate::geometry::{Hit8, Ray8};
use croupier_simd::Mask8;

/// Intersection of rays with the scene. The built-in one traverses the scene's tree; hosts may bring their own.
///
/// Contract: lanes outside `active` and lanes with a non-finite or zero direction or a non-finite origin report no hit
/// and cost nothing; results of a lane never depend on other lanes.
pub trait Intersector {
    /// Closest hit of every active lane.
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8;

    /// Active lanes with any hit.
    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8;
}
