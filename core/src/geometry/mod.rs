//! Rays, hits and points on surfaces.
//!
//! | file | holds |
//! |---|---|
//! | `ray` | [`Ray8`] and [`Hit8`] |
//! | `surface_hit` | [`SurfaceHit8`]: the triangles of eight hits, read once |
//! | `spawn` | points on surfaces with error bounds, origins of secondary rays |

mod ray;
mod spawn;
mod surface_hit;

pub use ray::{Hit8, Ray8};
pub use spawn::{OFFSET_BOUND, SurfacePoint8, offset, shadow_ray, surface_point, triangle_normal};
pub use surface_hit::SurfaceHit8;
