//! The sun and the sky: a directional disk and an environment map from [`Atmosphere`].
//!
//! **Scale.** Radiance 1 is that of a white diffuse surface that lies level under the sun at 45 degrees, in every
//! channel: sun and sky together give it the irradiance pi there. So white is daylight as a camera is balanced for it, a
//! low sun is warm and dim against it, and a scene with lights of its own mixes with the sun of a clear day if its
//! radiance is given in units of 32 000 cd/m^2 (100 000 lx over pi).

use super::atmosphere::Atmosphere;
use super::axes::Axes;
use crate::description::{Emitter, Environment};
use std::f64::consts::{PI, TAU};

/// Place of the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Degrees from the scene's front towards its right: 0 shines from the front, 90 from the right, 180 from behind.
    pub azimuth_deg: f64,
    /// Degrees above the horizon, 0 to 90.
    pub elevation_deg: f64,
}

impl Default for Sun {
    /// From the front and the left, at 42 degrees.
    fn default() -> Self {
        Self { azimuth_deg: -32.0, elevation_deg: 42.0 }
    }
}

/// Angular diameter of the sun, degrees.
const DIAMETER_DEG: f32 = 0.53;
/// Elevation at which sun and sky are white.
const WHITE_DEG: f64 = 45.0;
/// Columns and rows of the map: steps of 2.8 and 1.4 degrees. The middle row is the horizon.
const SIZE: [usize; 2] = [128, 129];
/// Below the horizon the haze of the sky fades into the ground over this many rows.
const FADE: usize = 2;
/// Steps in polar angle and azimuth of integrals over the sky.
const STEPS: usize = 24;

/// Light of a clear day, without white balance, in the atmosphere's own scale.
struct Clear {
    /// Unit direction to the sun, y up, towards -z.
    direction: [f64; 3],
    /// Irradiance of a surface that faces the sun.
    direct: [f64; 3],
    /// Irradiance of a level surface from the sky alone.
    diffuse: [f64; 3],
}

impl Clear {
    fn at(atmosphere: &Atmosphere, elevation_deg: f64) -> Self {
        let (sin, cos) = elevation_deg.clamp(0.0, 90.0).to_radians().sin_cos();
        let direction = [0.0, sin, -cos];
        let mut diffuse = [0.0; 3];
        for k in 0..STEPS * STEPS {
            // uniform in y^2: the cosine is part of the density
            let y = (((k / STEPS) as f64 + 0.5) / STEPS as f64).sqrt();
            // the half that the other one mirrors
            let phi = PI * ((k % STEPS) as f64 + 0.5) / STEPS as f64;
            let s = (1.0 - y * y).sqrt();
            let radiance = atmosphere.sky([s * phi.sin(), y, -s * phi.cos()], direction);
            (0..3).for_each(|c| diffuse[c] += PI * radiance[c] / (STEPS * STEPS) as f64);
        }
        Self { direction, direct: atmosphere.sun(sin), diffuse }
    }

    /// Irradiance of a level surface.
    fn level(&self) -> [f64; 3] {
        std::array::from_fn(|c| self.direct[c] * self.direction[1] + self.diffuse[c])
    }
}

/// The sun as an emitter, and the sky as an environment, whose lower half is an endless ground of the albedo `ground`.
///
/// The map does not hold the sun's own disk.
pub fn daylight(sun: Sun, axes: &Axes, ground: f64) -> (Emitter, Environment) {
    let atmosphere = Atmosphere::new();
    let white = Clear::at(&atmosphere, WHITE_DEG).level().map(|e| PI / e);
    let clear = Clear::at(&atmosphere, sun.elevation_deg);
    let balanced = |rgb: [f64; 3]| -> [f64; 3] { std::array::from_fn(|c| rgb[c] * white[c]) };
    let floor = balanced(clear.level()).map(|e| e * ground / PI);

    let [width, height] = SIZE;
    let horizon = (height - 1) / 2;
    let mut texels = vec![[0.0f32; 3]; width * height];
    for row in 0..height {
        let polar = PI * row.min(horizon) as f64 / (height - 1) as f64;
        let (s, y) = polar.sin_cos();
        let fade = (row.saturating_sub(horizon) as f64 / FADE as f64).min(1.0);
        // column i and its mirror image
        for i in 0..width / 2 {
            let phi = TAU * (i as f64 + 0.5) / width as f64;
            let sky = if fade < 1.0 {
                balanced(atmosphere.sky([s * phi.sin(), y, -s * phi.cos()], clear.direction))
            } else {
                [0.0; 3]
            };
            let texel = std::array::from_fn(|c| (sky[c] * (1.0 - fade) + floor[c] * fade) as f32);
            texels[row * width + i] = texel;
            texels[row * width + width - 1 - i] = texel;
        }
    }

    let (sin, cos) = sun.azimuth_deg.to_radians().sin_cos();
    let heading: [f64; 3] = std::array::from_fn(|i| axes.front[i] * cos + axes.right[i] * sin);
    let (elevation_sin, elevation_cos) = sun.elevation_deg.clamp(0.0, 90.0).to_radians().sin_cos();
    let direction = std::array::from_fn(|i| -(heading[i] * elevation_cos + axes.up[i] * elevation_sin) as f32);
    // map -z is where the sun is, map y is up
    let [x, y] = [super::axes::cross(axes.up, heading.map(|c| -c)), axes.up];
    let to_world = std::array::from_fn(|i| [x[i] as f32, y[i] as f32, -heading[i] as f32]);
    let irradiance = balanced(clear.direct).map(|e| e as f32);
    (
        Emitter::Sun { direction, irradiance, angle_deg: DIAMETER_DEG },
        Environment::Map { width: width as u32, height: height as u32, texels, scale: [1.0; 3], to_world },
    )
}
