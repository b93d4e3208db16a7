//! Rays against triangles.
//!
//! | file | holds |
//! |---|---|
//! | `wide` | [`WideBvh`]: the built-in [`Intersector`] |
//! | `grouping` | which rays walk a tree together |
//! | `instances` | rays through top-level trees, into objects |
//! | `blocking` | which triangles end a search for any hit |
//! | `setup` | per-ray constants, eight rays at once |
//! | `triangle` | the watertight triangle test, the same lanes for 8 triangles or 8 rays |
//! | `single` | one ray against 8-wide nodes and 8-triangle leaves |
//! | `packet` | up to eight rays of one octant together |
//! | `build` | trees in the caller's memory |
//! | `refit` | boxes after vertices moved |
//! | `top` | instances moved, top-level trees rebuilt |

mod blocking;
mod build;
mod grouping;
mod instances;
mod packet;
mod refit;
mod setup;
mod single;
mod top;
mod triangle;
mod wide;

pub use build::{BuildError, Built, Corners, Primitive, build_references, build_triangles};
pub use refit::TriangleTree;
pub use top::{TopLevel, set_hidden, set_transform};
pub use wide::WideBvh;

use crate::geometry::{Hit8, Ray8};
use croupier_simd::{Mask8, U32x8};

/// Intersection of rays with the scene. The built-in one traverses the scene's tree; hosts may bring their own.
///
/// Contract: lanes outside `active` and lanes with a non-finite or zero direction or a non-finite origin report no hit
/// and cost nothing; results of a lane never depend on other lanes.
pub trait Intersector {
    /// Closest hit of every active lane.
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8;

    /// Active lanes with any hit.
    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8;

    /// What active lanes meet where some triangles let light pass: `blocks` says by its index whether a triangle ends a
    /// ray. Provided: an intersector that cannot ask leaves every ray that meets anything to be followed.
    fn occluded_by(&self, rays: &Ray8, active: Mask8, _blocks: &dyn Fn(u32) -> bool) -> Occlusion8 {
        let met = self.occluded(rays, active);
        Occlusion8 { blocked: Mask8::NONE, passed: U32x8::select(met, U32x8::splat(u32::MAX), U32x8::splat(0)) }
    }

    /// The same for scenes without instances: what kernels ask whose profile does not have
    /// [`Effects::INSTANCES`](crate::unstable::Effects::INSTANCES), so that they do without the code for them. Provided:
    /// the intersector itself.
    fn flat(&self) -> impl Intersector
    where
        Self: Sized,
    {
        self
    }
}

impl<I: Intersector> Intersector for &I {
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        (*self).closest(rays, active)
    }

    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        (*self).occluded(rays, active)
    }

    fn occluded_by(&self, rays: &Ray8, active: Mask8, blocks: &dyn Fn(u32) -> bool) -> Occlusion8 {
        (*self).occluded_by(rays, active, blocks)
    }
}

/// What eight rays meet that some triangles do not block; see [`Intersector::occluded_by`].
#[derive(Clone, Copy, Debug)]
pub struct Occlusion8 {
    /// Lanes that meet a triangle that blocks.
    pub blocked: Mask8,
    /// Triangles that do not block on the way, at least as many as there are; meaningless in blocked lanes.
    pub passed: U32x8,
}
