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

use crate::geometry::{Hit8, OwnSurface8, Ray8};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Intersection of rays with the scene. The built-in one traverses the scene's tree; hosts may bring their own.
///
/// Contract: lanes outside `active` and lanes with a non-finite or zero direction or a non-finite origin report no hit
/// and cost nothing; results of a lane never depend on other lanes.
///
/// # Surfaces that are not triangles
///
/// Height fields, analytic shapes, meshes of a physics engine: with [`Self::SURFACES`] an intersector may report hits of
/// surfaces of its own, by a number from [`FIRST_OWN_SURFACE`](crate::unstable::geometry::FIRST_OWN_SURFACE) on in place of a
/// triangle, and says in [`Self::surface`] what is there. Such surfaces scatter, cast shadows, bound media and appear in
/// auxiliary values as triangles do. They have materials of the scene. What is different:
///
/// * They do not move: in auxiliary values their motion is 0.
/// * They do not emit, whatever their material: light samples are drawn from the scene's lights alone.
/// * The effects that their materials call for are taken to be those of all materials of the scene, as the session starts.
/// * Statistics are kept within [`SceneInfo`](crate::unstable::scene::blob::SceneInfo)'s bounds; what lies outside shares
///   those of the nearest cells. Let the scene's bounds hold the surfaces for good statistics.
///
/// A ball beside the scene's triangles:
///
/// ```
/// use croupier::Session;
/// use croupier::unstable::accel::{Intersector, WideBvh};
/// use croupier::unstable::geometry::{FIRST_OWN_SURFACE, Hit8, OwnSurface8, Ray8};
/// use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
///
/// struct WithBall<'s> {
///     triangles: WideBvh<'s>,
///     center: [f32; 3],
///     radius: f32,
///     material: u32,
/// }
///
/// impl WithBall<'_> {
///     /// Parameters of the nearest points of the ball, infinite where there is none.
///     fn ball(&self, rays: &Ray8, active: Mask8) -> F32x8 {
///         let [x, y, z] = self.center;
///         let o = rays.o - Vec3x8::splat(x, y, z);
///         let length = rays.d.length();
///         let d = rays.d / length;
///         let middle = -o.dot(d);
///         // from the distance of the line, which loses no digits far away
///         let aside = o + d * middle;
///         let half = (F32x8::splat(self.radius * self.radius) - aside.length_sqr()).safe_sqrt();
///         let meets = aside.length().lt(F32x8::splat(self.radius)) & active;
///         let within = |t: F32x8| {
///             let t = t / length;
///             (meets & t.gt(rays.tmin) & t.lt(rays.tmax)).select(t, F32x8::INFINITY)
///         };
///         within(middle - half).min(within(middle + half))
///     }
/// }
///
/// impl Intersector for WithBall<'_> {
///     const SURFACES: bool = true;
///
///     fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
///         let hit = self.triangles.closest(rays, active);
///         let t = self.ball(rays, active);
///         let nearer = t.lt(hit.t);
///         let name = U32x8::splat(FIRST_OWN_SURFACE);
///         let triangle = U32x8::select(nearer, name, hit.triangle);
///         Hit8 { hit: hit.hit | nearer, t: nearer.select(t, hit.t), triangle, ..hit }
///     }
///
///     fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
///         self.triangles.occluded(rays, active) | self.ball(rays, active).lt(F32x8::INFINITY)
///     }
///
///     fn surface(&self, rays: &Ray8, hit: &Hit8, own: Mask8) -> OwnSurface8 {
///         let [x, y, z] = self.center;
///         let center = Vec3x8::splat(x, y, z);
///         let ng = (rays.o + rays.d * own.zero_unless(hit.t) - center).normalize();
///         // the point of the ball in the direction of the rounded one
///         let p = center + ng * self.radius;
///         let error = F32x8::splat(self.radius * 4e-6) + center.abs().max_component() * 1e-6;
///         OwnSurface8::new(p, ng, error, U32x8::splat(self.material))
///     }
/// }
///
/// // let ball = WithBall { triangles: WideBvh::new(&scene), center, radius, material };
/// // Session::builder(scene).intersector(ball).build(&plan, block)
/// ```
pub trait Intersector {
    /// Are there surfaces that are not triangles of the scene? Without them nothing of [`Self::surface`] is compiled in.
    const SURFACES: bool = false;

    /// What is where hits of `own` are: lanes of `hit`, which [`Self::closest`] has found along `rays`, with a number from
    /// [`FIRST_OWN_SURFACE`](crate::unstable::geometry::FIRST_OWN_SURFACE) on. A function of these alone, lane by lane.
    fn surface(&self, _rays: &Ray8, _hit: &Hit8, _own: Mask8) -> OwnSurface8 {
        OwnSurface8::new(Vec3x8::ZERO, Vec3x8::ZERO, F32x8::ZERO, U32x8::splat(u32::MAX))
    }

    /// Closest hit of every active lane.
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8;

    /// Active lanes with any hit.
    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8;

    /// What active lanes meet where some triangles let light pass: `blocks` says by its index whether a triangle ends a
    /// ray; of surfaces of its own an intersector must know that itself. Provided: an intersector that cannot ask leaves
    /// every ray that meets anything to be followed.
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
    const SURFACES: bool = I::SURFACES;

    fn surface(&self, rays: &Ray8, hit: &Hit8, own: Mask8) -> OwnSurface8 {
        (*self).surface(rays, hit, own)
    }

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
