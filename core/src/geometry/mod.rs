//! Rays, hits and points on surfaces.
//!
//! | file | holds |
//! |---|---|
//! | `ray` | [`Ray8`] and [`Hit8`] |
//! | `surface_hit` | [`SurfaceHit8`]: the triangles of eight hits, read once |
//! | `own_surface` | [`OwnSurface8`]: surfaces that a host's intersector brings |
//! | `placement` | triangles in instances: their corners in the world, and the rounding that this adds |
//! | `spawn` | points on surfaces with error bounds, origins of secondary rays |

mod own_surface;
mod placement;
mod ray;
mod spawn;
mod surface_hit;

pub(crate) use own_surface::OwnHits8;
pub use own_surface::{FIRST_OWN_SURFACE, OwnSurface8};
pub use placement::{Map8, Placed8, instances_of_light, place, place_normals};
pub use ray::{Hit8, NO_INSTANCE, Ray8};
pub use spawn::{OFFSET_BOUND, SurfacePoint8, offset, shadow_ray, surface_point, triangle_normal};
pub use surface_hit::SurfaceHit8;
pub(crate) use surface_hit::corners;
