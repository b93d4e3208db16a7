//! Callbacks: what a host computes in place of the library.

use crate::fault::Fault;
use crate::memory::{Versioned, read_struct};
use crate::status::croupier_status::*;
use core::ffi::c_void;
use core::ptr;

/// Eight rays: points origin + t direction with tmin < t < tmax. The first index is the axis (x, y, z), the second the
/// lane. Directions need not be unit vectors. Rays that the library hands over start at a multiple of 32 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_rays8 {
    /// Origins, world space.
    pub origin: [[f32; 8]; 3],
    /// Directions.
    pub direction: [[f32; 8]; 3],
    /// Smallest parameters, exclusive.
    pub tmin: [f32; 8],
    /// Largest parameters, exclusive; may be infinite.
    pub tmax: [f32; 8],
    /// Times, from 0 where the shutter opens to 1 where it closes.
    pub time: [f32; 8],
}

/// What eight rays hit. Lanes without a hit hold tmax, CROUPIER_NONE and 0.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_hits8 {
    /// Ray parameters.
    pub t: [f32; 8],
    /// Indices of the scene's triangles; from CROUPIER_OWN_SURFACE on numbers of the host's own surfaces.
    pub triangle: [u32; 8],
    /// Barycentric weights of the triangles' second vertices. Of own surfaces u, v and instance are the host's to use.
    pub u: [f32; 8],
    /// Barycentric weights of the third vertices; the first ones have 1 - u - v.
    pub v: [f32; 8],
    /// Instances around the triangles: the world's, and the one within it; CROUPIER_NONE where there is none.
    pub instance: [[u32; 8]; 2],
}

/// First number of surfaces that are not triangles of the scene.
pub const CROUPIER_OWN_SURFACE: u32 = 0x8000_0000;

/// Eight points on the host's own surfaces. The first index is the axis, the second the lane.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_surfaces8 {
    /// Points, world space.
    pub point: [[f32; 8]; 3],
    /// Geometric unit normals, on the side that is the front.
    pub normal: [[f32; 8]; 3],
    /// How far points may be from their surfaces, world units: rays that leave begin that far away.
    pub error: [f32; 8],
    /// Shading normals; 0 where normal serves.
    pub shading_normal: [[f32; 8]; 3],
    /// Texture coordinates, v upwards.
    pub uv: [[f32; 8]; 2],
    /// Directions in which the first texture coordinate grows, for normal maps; 0: any.
    pub tangent: [[f32; 8]; 3],
    /// Materials of the scene; what does not exist is black.
    pub material: [u32; 8],
    /// Objects for CROUPIER_AOV_OBJECT, or CROUPIER_NONE.
    pub object: [u32; 8],
}

/// Eight camera samples of a picture.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_samples8 {
    /// Columns of the picture.
    pub width: u32,
    /// Rows of the picture.
    pub height: u32,
    /// Columns of the pixels.
    pub column: [u32; 8],
    /// Rows of the pixels.
    pub row: [u32; 8],
    /// Points of the picture in pixels, x to the right and y down, uniform in each pixel's square.
    pub position: [[f32; 8]; 2],
    /// Two further independent numbers in [0, 1).
    pub u: [[f32; 8]; 2],
}

/// Rays of eight camera samples.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_source_rays8 {
    /// Origins, world space.
    pub origin: [[f32; 8]; 3],
    /// Unit directions.
    pub direction: [[f32; 8]; 3],
    /// What the radiance along the ray counts in the pixel, by channel: 1 for radiance.
    pub weight: [[f32; 8]; 3],
}

/// Points of surfaces at which eight camera samples begin.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_source_points8 {
    /// Indices of triangles.
    pub triangle: [u32; 8],
    /// Instances around them, as of croupier_hits8.
    pub instance: [[u32; 8]; 2],
    /// Barycentric weights of the second vertices.
    pub u: [f32; 8],
    /// Barycentric weights of the third vertices.
    pub v: [f32; 8],
    /// What the radiance counts in the pixel, by channel: 1 for irradiance over pi, pi for irradiance.
    pub scale: [[f32; 8]; 3],
}

/// Closest hits of the lanes in active (bit i is lane i). hits holds no hits when it is called; returns the lanes that
/// hit. Lanes with numbers that cannot be (t outside the ray, no such triangle) count as no hit. May be called on
/// several threads at a time, with the same user.
pub type croupier_closest = Option<
    unsafe extern "C" fn(user: *mut c_void, rays: *const croupier_rays8, active: u32, hits: *mut croupier_hits8) -> u32,
>;

/// Lanes of active that hit anything. Threads as of croupier_closest.
pub type croupier_occluded =
    Option<unsafe extern "C" fn(user: *mut c_void, rays: *const croupier_rays8, active: u32) -> u32>;

/// What is where the hits of the lanes in own are, each of one of the host's own surfaces. Threads as of
/// croupier_closest.
pub type croupier_surface = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        rays: *const croupier_rays8,
        hits: *const croupier_hits8,
        own: u32,
        surfaces: *mut croupier_surfaces8,
    ),
>;

/// Rays of camera samples, in place of the camera's; returns the lanes of active that have one, the others are black.
/// A function of the samples alone, or the picture depends on threads. Threads as of croupier_closest.
pub type croupier_rays = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        samples: *const croupier_samples8,
        active: u32,
        rays: *mut croupier_source_rays8,
    ) -> u32,
>;

/// Points of surfaces at which camera samples begin, in place of the camera's rays: each brings what a white diffuse
/// surface would reflect there. Otherwise as croupier_rays.
pub type croupier_points = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        samples: *const croupier_samples8,
        active: u32,
        points: *mut croupier_source_points8,
    ) -> u32,
>;

/// What a host computes in place of the library. Members that are null are the library's own part. Callbacks must
/// return: no longjmp and no C++ exception may leave them. They may read the scene (croupier_scene_closest); calls
/// that change an object that is in use answer CROUPIER_BUSY.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct croupier_parts {
    /// sizeof(croupier_parts), set by the program.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Handed to every callback.
    pub user: *mut c_void,
    /// Closest hits; together with occluded, or neither.
    pub closest: croupier_closest,
    /// Any hits.
    pub occluded: croupier_occluded,
    /// Own surfaces; needs closest.
    pub surface: croupier_surface,
    /// Camera rays; not together with points.
    pub rays: croupier_rays,
    /// Points at which camera samples begin.
    pub points: croupier_points,
}

// SAFETY: `repr(C)`, begins with its size; pointers may have any value until they are used, which is the caller's promise.
unsafe impl Versioned for croupier_parts {
    const FIRST: u32 = size_of::<Self>() as u32;
    const NAME: &'static str = "parts";

    fn empty() -> Self {
        Self {
            struct_size: size_of::<Self>() as u32,
            reserved: 0,
            user: ptr::null_mut(),
            closest: None,
            occluded: None,
            surface: None,
            rays: None,
            points: None,
        }
    }
}

impl croupier_parts {
    /// Reads parts and checks which are there together.
    ///
    /// # Safety
    /// The caller's promise.
    pub(crate) unsafe fn read(parts: *const Self) -> Result<Self, Fault> {
        // SAFETY: the caller's promise.
        let parts = unsafe { read_struct(parts) }?;
        let pair = parts.closest.is_some() == parts.occluded.is_some();
        let surface = parts.surface.is_none() || parts.closest.is_some();
        let one_source = parts.rays.is_none() || parts.points.is_none();
        if pair && surface && one_source { Ok(parts) } else { Err(Fault::new(CROUPIER_RANGE, "parts")) }
    }
}
