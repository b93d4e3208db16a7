//! Records of cameras.

use super::error::FieldError;
use super::math::{Math, Portable, cross, dot, narrow, normalized, scaled, sub};
use crate::scene::Field;
use crate::scene::blob::{Camera, CameraKind, MAX_COORDINATE, MAX_SIDE};

/// A camera by where it is and what it looks at. World space, in f64, so that the difference is precise far from the
/// origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Projection.
    pub kind: CameraKind,
    /// Position.
    pub origin: [f64; 3],
    /// A point on the viewing axis.
    pub target: [f64; 3],
    /// Upwards, not parallel to the axis.
    pub up: [f64; 3],
    /// Perspective: full vertical field of view, degrees, above 0.001 and below 179.9. Orthographic: height of the
    /// image,
    /// world units, 1e-12 to 1e9. Panoramic: not read.
    pub extent: f64,
    /// Columns and rows, 1 to 65536. Pixels are square.
    pub size: [u32; 2],
    /// Radius of the lens, 0 (a pinhole) to 1e9; 0 for other projections than perspective.
    pub lens_radius: f32,
    /// Distance of the plane in focus along the axis, above 0, up to 1e9; not read without a lens.
    pub focus_distance: f32,
}

impl Default for View {
    /// At (0, 0, 5), looking at the origin, 45 degrees, 512 x 512 pixels.
    fn default() -> Self {
        Self {
            kind: CameraKind::Perspective,
            origin: [0.0, 0.0, 5.0],
            target: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            extent: 45.0,
            size: [512, 512],
            lens_radius: 0.0,
            focus_distance: 0.0,
        }
    }
}

impl View {
    /// The record of the camera, for [`SceneParts::camera`](super::SceneParts::camera) and
    /// [`SceneEdit::camera`](crate::SceneEdit::camera).
    ///
    /// # Errors
    /// The first number out of its range; [`Field::Direction`] for an axis without a length, [`Field::ImagePlane`] for
    /// an
    /// upward direction along it or an extent out of its range.
    pub fn record(&self) -> Result<Camera, FieldError> {
        self.record_with::<Portable>()
    }

    /// [`Self::record`] with the functions of the host.
    ///
    /// # Errors
    /// As of [`Self::record`].
    pub fn record_with<M: Math>(&self) -> Result<Camera, FieldError> {
        let bad = |field, found: f64| FieldError { field, found: found as f32 };
        let limit = f64::from(MAX_COORDINATE);
        for x in [self.origin, self.target, self.up].as_flattened() {
            if x.is_nan() || x.abs() > limit {
                return Err(bad(Field::Position, *x));
            }
        }
        for (field, n) in [Field::Width, Field::Height].into_iter().zip(self.size) {
            if n == 0 || n > MAX_SIDE {
                return Err(bad(field, n.into()));
            }
        }
        let extent = self.extent;
        let half_height = match self.kind {
            CameraKind::Perspective if extent > 1e-3 && extent < 179.9 => M::tan(extent.to_radians() / 2.0),
            CameraKind::Orthographic if (1e-12..=limit).contains(&extent) => extent / 2.0,
            CameraKind::Panoramic => 1.0,
            CameraKind::Perspective | CameraKind::Orthographic => return Err(bad(Field::ImagePlane, extent)),
        };
        let aspect = match self.kind {
            CameraKind::Panoramic => 1.0,
            _ => f64::from(self.size[0]) / f64::from(self.size[1]),
        };
        let axis = sub(self.target, self.origin);
        let forward = normalized::<M>(axis).ok_or(bad(Field::Direction, M::sqrt(dot(axis, axis))))?;
        let side = cross(forward, normalized::<M>(self.up).unwrap_or_default());
        let sine = M::sqrt(dot(side, side));
        let right = normalized::<M>(side).filter(|_| sine > 1e-6).ok_or(bad(Field::ImagePlane, sine))?;
        let lens = self.lens_radius > 0.0;
        let widest = if self.kind == CameraKind::Perspective { MAX_COORDINATE } else { 0.0 };
        if !(0.0..=widest).contains(&self.lens_radius) {
            return Err(bad(Field::LensRadius, self.lens_radius.into()));
        }
        if lens && !(f32::MIN_POSITIVE..=MAX_COORDINATE).contains(&self.focus_distance) {
            return Err(bad(Field::FocusDistance, self.focus_distance.into()));
        }
        Ok(Camera {
            kind: self.kind as u32,
            origin: narrow(self.origin),
            forward: narrow(forward),
            right: narrow(scaled(right, half_height * aspect)),
            down: narrow(scaled(cross(forward, right), half_height)),
            lens_radius: self.lens_radius,
            focus_distance: if lens { self.focus_distance } else { 0.0 },
            size: self.size,
        })
    }
}
