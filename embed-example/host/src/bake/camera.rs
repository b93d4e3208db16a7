//! Viewing axis and image plane.

use super::BakeError;
use crate::description::{Camera, Projection};
use croupier::unstable::scene::blob;
use croupier::unstable::scene::blob::{CameraKind, MAX_COORDINATE, MAX_SIDE};
use glam::DVec3;

/// Right and down reach from the image centre to the edges: `tan(vfov / 2)` downwards at distance 1, or half the height
/// of an orthographic image, times width / height to the right (pixels are square); unit vectors for a panorama.
pub(super) fn bake(c: &Camera) -> Result<blob::Camera, BakeError> {
    let bad = |what, found| BakeError::Camera { what, found };
    for (what, v) in [("origin", c.origin), ("target", c.target), ("up", c.up)] {
        let limit = f64::from(MAX_COORDINATE);
        if let Some(x) = v.iter().find(|x| x.is_nan() || x.abs() > limit) {
            return Err(bad(what, *x));
        }
    }
    for (what, n) in [("width", c.size[0]), ("height", c.size[1])] {
        if n == 0 || n > MAX_SIDE {
            return Err(bad(what, f64::from(n)));
        }
    }
    let half_height = match c.projection {
        Projection::Perspective if c.vfov_deg > 1e-3 && c.vfov_deg < 179.9 => (c.vfov_deg.to_radians() / 2.0).tan(),
        Projection::Perspective => return Err(bad("vertical field of view in degrees", c.vfov_deg)),
        Projection::Orthographic { height } if (1e-12..=MAX_COORDINATE).contains(&height) => f64::from(height) / 2.0,
        Projection::Orthographic { height } => return Err(bad("orthographic height", height.into())),
        Projection::Panoramic => 1.0,
    };
    let [origin, target, up] = [c.origin, c.target, c.up].map(DVec3::from_array);
    let axis = target - origin;
    let forward = axis.try_normalize().ok_or(bad("distance from origin to target", axis.length()))?;
    let side = forward.cross(up.normalize_or_zero());
    let right = if side.length() > 1e-6 {
        side.normalize()
    } else {
        return Err(bad("sine of angle between axis and up", side.length()));
    };
    let (kind, aspect) = match c.projection {
        Projection::Perspective => (CameraKind::Perspective, f64::from(c.size[0]) / f64::from(c.size[1])),
        Projection::Orthographic { .. } => (CameraKind::Orthographic, f64::from(c.size[0]) / f64::from(c.size[1])),
        Projection::Panoramic => (CameraKind::Panoramic, 1.0),
    };
    let half_width = half_height * aspect;
    let (lens_radius, focus_distance) = c.lens.map_or((0.0, 0.0), |l| (l.radius, l.focus_distance));
    if !(0.0..=MAX_COORDINATE).contains(&lens_radius) {
        return Err(bad("lens radius", lens_radius.into()));
    }
    if lens_radius > 0.0 && c.projection != Projection::Perspective {
        return Err(bad("lens radius of a camera that is not perspective", lens_radius.into()));
    }
    if lens_radius > 0.0 && !(f32::MIN_POSITIVE..=MAX_COORDINATE).contains(&focus_distance) {
        return Err(bad("focus distance", focus_distance.into()));
    }
    Ok(blob::Camera {
        kind: kind as u32,
        origin: origin.as_vec3().to_array(),
        forward: forward.as_vec3().to_array(),
        right: (right * half_width).as_vec3().to_array(),
        down: (forward.cross(right) * half_height).as_vec3().to_array(),
        lens_radius,
        focus_distance: if lens_radius > 0.0 { focus_distance } else { 0.0 },
        size: c.size,
    })
}
