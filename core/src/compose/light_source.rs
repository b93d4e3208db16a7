//! Records of lights that are not triangles.

use super::error::FieldError;
use super::math::{Math, Portable, dot, narrow, normalized, scaled, wide};
use crate::scene::Field;
use crate::scene::blob::{
    Light, LightKind, MAX_COORDINATE, MAX_EMISSION, SHAPE_HIDDEN, SHAPE_SIZE_RANGE, SHAPE_TWO_SIDED,
};
use bytemuck::Zeroable;

/// Smallest half angle of a spot and smallest diameter of a sun, degrees: the rounding of a direction moves the edge by
/// 1e-3 of it.
pub const MIN_CONE_DEG: f32 = 1e-2;

/// A light that is not a triangle, in the units of scene files. World space; directions have any length but 0; emission
/// is
/// linear Rec. 709, 0 to [`MAX_EMISSION`] a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightSource {
    /// Shines alike in all directions.
    Point {
        /// Position.
        position: [f32; 3],
        /// Intensity, W/sr.
        intensity: [f32; 3],
    },
    /// Shines into a cone, brightest within its inner one.
    Spot {
        /// Position.
        position: [f32; 3],
        /// Direction in which the light travels.
        direction: [f32; 3],
        /// Intensity on the axis, W/sr.
        intensity: [f32; 3],
        /// Half angle within which the intensity is full, degrees, 0 to `outer_deg`.
        inner_deg: f32,
        /// Half angle at which the intensity reaches 0, degrees, [`MIN_CONE_DEG`] to 180.
        outer_deg: f32,
    },
    /// Parallel light.
    Directional {
        /// Direction in which the light travels.
        direction: [f32; 3],
        /// Irradiance of a surface that faces it, W/m^2.
        irradiance: [f32; 3],
    },
    /// Parallel light with the spread of a distant disk.
    Sun {
        /// Direction in which the light travels.
        direction: [f32; 3],
        /// Irradiance of a surface that faces it, W/m^2.
        irradiance: [f32; 3],
        /// Angular diameter, degrees, [`MIN_CONE_DEG`] to 90.
        angle_deg: f32,
    },
    /// Sphere.
    Sphere {
        /// Middle.
        position: [f32; 3],
        /// Radius, [`SHAPE_SIZE_RANGE`].
        radius: f32,
        /// Radiance.
        radiance: [f32; 3],
        /// What it shows.
        sides: Sides,
    },
    /// Rectangle.
    Rectangle {
        /// Middle.
        position: [f32; 3],
        /// Edges, at right angles to 1e-3, halves of lengths in [`SHAPE_SIZE_RANGE`]; the front is where their cross
        /// product points.
        edges: [[f32; 3]; 2],
        /// Radiance.
        radiance: [f32; 3],
        /// What it shows.
        sides: Sides,
    },
    /// Disk.
    Disk {
        /// Middle.
        position: [f32; 3],
        /// Normal of its front.
        direction: [f32; 3],
        /// Radius, [`SHAPE_SIZE_RANGE`].
        radius: f32,
        /// Radiance.
        radiance: [f32; 3],
        /// What it shows.
        sides: Sides,
    },
}

/// Sides of a light with a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sides {
    /// Emits from its back as well, a sphere to its inside.
    pub two_sided: bool,
    /// Camera rays see it.
    pub visible: bool,
}

impl Default for Sides {
    /// Emits from its front, and camera rays see it.
    fn default() -> Self {
        Self { two_sided: false, visible: true }
    }
}

impl Sides {
    fn flags(self) -> u32 {
        let flag = |on, bit| if on { bit } else { 0 };
        flag(self.two_sided, SHAPE_TWO_SIDED) | flag(!self.visible, SHAPE_HIDDEN)
    }
}

/// The number, if it is in the range.
fn within(field: Field, found: f32, [lo, hi]: [f32; 2]) -> Result<f32, FieldError> {
    if found >= lo && found <= hi { Ok(found) } else { Err(FieldError { field, found }) }
}

fn all_within(field: Field, v: [f32; 3], range: [f32; 2]) -> Result<[f32; 3], FieldError> {
    v.iter().try_for_each(|x| within(field, *x, range).map(|_| ())).map(|()| v)
}

/// Unit vector of a direction of any length but 0.
fn unit<M: Math>(direction: [f32; 3]) -> Result<[f32; 3], FieldError> {
    let v = wide(direction);
    let length = || FieldError { field: Field::Direction, found: M::sqrt(dot(v, v)) as f32 };
    normalized::<M>(v).map(narrow).ok_or_else(length)
}

/// 1 - cos of an angle in degrees, as 2 sin^2 of half of it: without cancellation.
fn versine<M: Math>(degrees: f32) -> f32 {
    let (sin, _) = M::sin_cos(f64::from(degrees).to_radians() / 2.0);
    (2.0 * (sin * sin)) as f32
}

impl LightSource {
    /// Kind of the light.
    pub const fn kind(&self) -> LightKind {
        match self {
            Self::Point { .. } => LightKind::Point,
            Self::Spot { .. } => LightKind::Spot,
            Self::Directional { .. } => LightKind::Directional,
            Self::Sun { .. } => LightKind::Sun,
            Self::Sphere { .. } => LightKind::Sphere,
            Self::Rectangle { .. } => LightKind::Rectangle,
            Self::Disk { .. } => LightKind::Disk,
        }
    }

    /// The record of the light, for [`SceneParts::lights`](super::SceneParts::lights) and
    /// [`SceneEdit::light`](crate::SceneEdit::light). A black one is kept: it may light up later.
    ///
    /// # Errors
    /// The first number out of its range.
    pub fn record(&self) -> Result<Light, FieldError> {
        self.record_with::<Portable>()
    }

    /// [`Self::record`] with the functions of the host.
    ///
    /// # Errors
    /// As of [`Self::record`].
    pub fn record_with<M: Math>(&self) -> Result<Light, FieldError> {
        let emission = |rgb| all_within(Field::Emission, rgb, [0.0, MAX_EMISSION]);
        let position = |p| all_within(Field::Position, p, [-MAX_COORDINATE, MAX_COORDINATE]);
        let size = |x| within(Field::ShapeSize, x, SHAPE_SIZE_RANGE);
        let light = |vector, emission, params| Light {
            kind: self.kind() as u32,
            vector,
            emission,
            params,
            ..Zeroable::zeroed()
        };
        Ok(match *self {
            Self::Point { position: p, intensity } => light(position(p)?, emission(intensity)?, [0.0; 6]),
            Self::Spot { position: p, direction, intensity, inner_deg, outer_deg } => {
                let [x, y, z] = unit::<M>(direction)?;
                within(Field::Cone, outer_deg, [MIN_CONE_DEG, 180.0])?;
                within(Field::Cone, inner_deg, [0.0, outer_deg])?;
                let params = [x, y, z, versine::<M>(outer_deg), versine::<M>(inner_deg), 0.0];
                light(position(p)?, emission(intensity)?, params)
            }
            Self::Directional { direction, irradiance } => {
                let towards = unit::<M>(direction)?.map(|x| -x);
                light(towards, emission(irradiance)?, [0.0; 6])
            }
            Self::Sun { direction, irradiance, angle_deg } => {
                let towards = unit::<M>(direction)?.map(|x| -x);
                within(Field::Cone, angle_deg, [MIN_CONE_DEG, 90.0])?;
                let params = [versine::<M>(angle_deg / 2.0), 0.0, 0.0, 0.0, 0.0, 0.0];
                light(towards, emission(irradiance)?, params)
            }
            Self::Sphere { position: p, radius, radiance, sides } => {
                let params = [size(radius)?, 0.0, 0.0, 0.0, 0.0, 0.0];
                let sphere = light(position(p)?, emission(radiance)?, params);
                Light { triangle: sides.flags(), ..sphere }
            }
            Self::Disk { position: p, direction, radius, radiance, sides } => {
                let [x, y, z] = unit::<M>(direction)?;
                let params = [x, y, z, size(radius)?, 0.0, 0.0];
                let disk = light(position(p)?, emission(radiance)?, params);
                Light { triangle: sides.flags(), ..disk }
            }
            Self::Rectangle { position: p, edges, radiance, sides } => {
                let params = half_edges::<M>(edges)?;
                let rectangle = light(position(p)?, emission(radiance)?, params);
                Light { triangle: sides.flags(), ..rectangle }
            }
        })
    }
}

/// Halves of the edges of a rectangle.
fn half_edges<M: Math>(edges: [[f32; 3]; 2]) -> Result<[f32; 6], FieldError> {
    let [least, most] = SHAPE_SIZE_RANGE.map(f64::from);
    let [u, v] = edges.map(|e| scaled(wide(e), 0.5));
    for half in [u, v] {
        let length = M::sqrt(dot(half, half));
        if !(least..=most).contains(&length) {
            return Err(FieldError { field: Field::ShapeSize, found: length as f32 });
        }
    }
    let cos = normalized::<M>(u).zip(normalized::<M>(v)).map_or(f64::NAN, |(u, v)| dot(u, v));
    if !(-1e-3..=1e-3).contains(&cos) {
        return Err(FieldError { field: Field::Edges, found: (cos * cos) as f32 });
    }
    let ([a, b, c], [x, y, z]) = (narrow(u), narrow(v));
    Ok([a, b, c, x, y, z])
}
