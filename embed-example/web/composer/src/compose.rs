//! Scenes from triangles that the page has.

use core::fmt;
use croupier::unstable::compose::{ComposeError, FieldError, LightSource, SceneParts, Surround, View};
use croupier::unstable::scene::blob::{Light, Material};

/// Directions of an environment map are the world's.
const UPRIGHT: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// What the page composes: arrays in its memory, and one view, one sun and one sky by their numbers.
#[derive(Clone, Copy)]
pub(crate) struct Arrays<'a> {
    pub(crate) positions: &'a [[f32; 3]],
    /// One for each position; flat where it is 0.
    pub(crate) normals: &'a [[f32; 3]],
    pub(crate) triangles: &'a [[u32; 3]],
    /// One for each triangle.
    pub(crate) triangle_materials: &'a [u32],
    pub(crate) materials: &'a [Material],
    /// One for each material.
    pub(crate) emission: &'a [[f32; 3]],
    /// Rows from +Y to -Y; no sky if there are none.
    pub(crate) sky: &'a [[f32; 3]],
    pub(crate) sky_size: [u32; 2],
    pub(crate) view: Numbers,
}

/// Numbers of the view and of the sun.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Numbers {
    origin: [f32; 3],
    target: [f32; 3],
    /// Vertical, degrees.
    field_of_view: f32,
    /// In which its light travels; no sun if it is black.
    sun_direction: [f32; 3],
    sun_irradiance: [f32; 3],
    /// Diameter, degrees.
    sun_angle: f32,
}

/// Why a scene cannot be composed.
pub(crate) enum Refused {
    Compose(ComposeError),
    Field(FieldError),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Compose(e) => e.fmt(f),
            Self::Field(e) => e.fmt(f),
        }
    }
}

/// Bytes of the blob, at most, and of the block for intermediate results.
pub(crate) fn sizes(arrays: &Arrays<'_>) -> Result<[usize; 2], Refused> {
    with_parts(arrays, |parts| parts.layout().map(|layout| [layout.blob.size, layout.scratch.size]))
}

/// Composes the blob at the start of `blob`; its length.
pub(crate) fn compose(arrays: &Arrays<'_>, blob: &mut [u8], scratch: &mut [u8]) -> Result<usize, Refused> {
    with_parts(arrays, |parts| parts.compose(blob, scratch).map(|blob| blob.len()))
}

fn with_parts<T>(a: &Arrays<'_>, then: impl FnOnce(&SceneParts<'_>) -> Result<T, ComposeError>) -> Result<T, Refused> {
    let n = a.view;
    let view = View {
        origin: n.origin.map(f64::from),
        target: n.target.map(f64::from),
        extent: n.field_of_view.into(),
        ..View::default()
    };
    let sun = LightSource::Sun { direction: n.sun_direction, irradiance: n.sun_irradiance, angle_deg: n.sun_angle };
    let sun = if n.sun_irradiance == [0.0; 3] { None } else { Some(sun.record().map_err(Refused::Field)?) };
    let sky = Surround::Map { size: a.sky_size, texels: a.sky, scale: [1.0; 3], to_world: UPRIGHT };
    let lights: &[Light] = sun.as_slice();
    let parts = SceneParts {
        positions: a.positions,
        normals: a.normals,
        triangles: a.triangles,
        triangle_materials: a.triangle_materials,
        materials: a.materials,
        emission: a.emission,
        lights,
        environment: if a.sky.is_empty() { None } else { Some(sky) },
        max_depth: 12,
        ..SceneParts::new(view.record().map_err(Refused::Field)?)
    };
    then(&parts).map_err(Refused::Compose)
}
