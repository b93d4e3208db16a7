//! Viewing axis and image plane.

use super::BakeError;
use crate::description::{Camera, Projection};
use crate::math::Std;
use croupier::unstable::compose::{FieldError, View};
use croupier::unstable::scene::Field;
use croupier::unstable::scene::blob::{self, CameraKind, MAX_COORDINATE};

/// The record of a camera, by the rules of [`View`].
pub(super) fn bake(c: &Camera) -> Result<blob::Camera, BakeError> {
    let (kind, extent) = match c.projection {
        Projection::Perspective => (CameraKind::Perspective, c.vfov_deg),
        Projection::Orthographic { height } => (CameraKind::Orthographic, f64::from(height)),
        Projection::Panoramic => (CameraKind::Panoramic, 0.0),
    };
    let (lens_radius, focus_distance) = c.lens.map_or((0.0, 0.0), |l| (l.radius, l.focus_distance));
    let Camera { origin, target, up, size, .. } = *c;
    let view = View { kind, origin, target, up, extent, size, lens_radius, focus_distance };
    view.record_with::<Std>().map_err(|e| error(&view, e))
}

/// What is wrong with a camera, in words.
fn error(view: &View, FieldError { field, found }: FieldError) -> BakeError {
    let coordinates = "from -1e9 to 1e9";
    let outside = |v: &[f64; 3]| v.iter().copied().find(|x| x.is_nan() || x.abs() > f64::from(MAX_COORDINATE));
    let vectors = [("origin", &view.origin), ("target", &view.target), ("up", &view.up)];
    let (what, found, range) = match field {
        Field::Position => {
            let wrong = vectors.into_iter().find_map(|(what, v)| Some((what, outside(v)?, coordinates)));
            wrong.unwrap_or(("position", found.into(), coordinates))
        }
        Field::Width => ("width", found.into(), "from 1 to 65536"),
        Field::Height => ("height", found.into(), "from 1 to 65536"),
        Field::Direction => ("distance from origin to target", found.into(), "above 0"),
        Field::LensRadius if view.kind != CameraKind::Perspective && found > 0.0 => {
            ("lens radius of a camera that is not perspective", found.into(), "0")
        }
        Field::LensRadius => ("lens radius", found.into(), "from 0 to 1e9"),
        Field::FocusDistance => ("focus distance", found.into(), "above 0, up to 1e9"),
        _ if found.to_bits() != (view.extent as f32).to_bits() => {
            ("sine of angle between axis and up", found.into(), "above 1e-6")
        }
        _ if view.kind == CameraKind::Perspective => {
            ("vertical field of view in degrees", view.extent, "above 0.001 and below 179.9")
        }
        _ => ("orthographic height", view.extent, "from 1e-12 to 1e9"),
    };
    BakeError::Camera { what, found, range }
}
