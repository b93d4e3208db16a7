//! Rays against triangles.
//!
//! | file | holds |
//! |---|---|
//! | `wide` | [`WideBvh`]: the built-in [`Intersector`], grouping of rays |
//! | `setup` | per-ray constants, eight rays at once |
//! | `triangle` | the watertight triangle test, the same lanes for 8 triangles or 8 rays |
//! | `single` | one ray against 8-wide nodes and 8-triangle leaves |
//! | `packet` | up to eight rays of one octant together |
//! | `spawn` | points on surfaces with error bounds, origins of secondary rays |

mod packet;
mod setup;
mod single;
mod spawn;
mod triangle;
mod wide;

pub(crate) use spawn::normal;
pub use spawn::{SurfacePoint8, offset, shadow_ray, surface_point};
pub use wide::WideBvh;

use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Eight rays: points `o + t d`, `tmin < t < tmax`. Directions need not be unit.
#[derive(Clone, Copy, Debug)]
pub struct Ray8 {
    /// Origins, world space.
    pub o: Vec3x8,
    /// Directions.
    pub d: Vec3x8,
    /// Smallest parameter, exclusive.
    pub tmin: F32x8,
    /// Largest parameter, exclusive; infinity is allowed.
    pub tmax: F32x8,
}

/// Eight closest hits; lanes outside `hit` hold `tmax`, [`crate::scene::blob::NONE`] and zeros.
#[derive(Clone, Copy, Debug)]
pub struct Hit8 {
    /// Lanes that hit.
    pub hit: Mask8,
    /// Ray parameter.
    pub t: F32x8,
    /// Triangle index.
    pub triangle: U32x8,
    /// Barycentric weight of the triangle's vertex b.
    pub u: F32x8,
    /// Barycentric weight of the triangle's vertex c; vertex a has `1 - u - v`.
    pub v: F32x8,
}

/// What finds hits. The built-in one walks the scene's tree; hosts may bring their own.
///
/// Contract: lanes outside `active` and lanes with a non-finite or zero direction or a non-finite origin report no hit
/// and cost nothing; results of a lane never depend on other lanes.
pub trait Intersector {
    /// Closest hit of every active lane.
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8;

    /// Active lanes with any hit.
    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8;
}
