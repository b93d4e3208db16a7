//! Flags of camera and light, for whatever loads.

use croupier::unstable::texture::SRGB_TO_LINEAR;
use croupier_host::description::Environment;
use croupier_host::load::{self, LoadOptions, LoadReport};
use croupier_host::look::{Look, Sun, Up};
use std::error::Error;
use std::path::PathBuf;

/// Camera and light in place of what the scene has.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Camera and light (not for baked files)")]
pub(crate) struct LookFlags {
    /// Camera of the scene file with this name
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Place of the camera, world space
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    from: Option<[f64; 3]>,
    /// Point that the camera looks at, world space
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    look_at: Option<[f64; 3]>,
    /// Vertical field of view in degrees, above 0.001, below 179.9
    #[arg(long, value_name = "DEG", value_parser = fov, allow_negative_numbers = true)]
    fov: Option<f64>,
    /// Axis that points up; auto guesses it for meshes and leaves it to the camera of a scene file
    #[arg(long, value_name = "AXIS", value_parser = up, default_value = "auto", hide_possible_values = true)]
    up: UpFlag,
    /// Environment map (EXR or .hdr) in place of the scene's environment
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Degrees by which the environment map is turned about the up axis, counter-clockwise from above, -360 to 360
    #[arg(long, value_name = "DEG", requires = "env", value_parser = turn, allow_negative_numbers = true)]
    env_rotation: Option<f64>,
    /// Factor on the environment map, above 0, up to 1e6
    #[arg(long, value_name = "X", requires = "env", value_parser = factor, allow_negative_numbers = true)]
    env_scale: Option<f32>,
    /// Sun and clear sky in place of the scene's environment: degrees from the front towards the right (-360 to 360), and
    /// above the horizon (0 to 90). With --env or --background the sun alone
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = sun, allow_hyphen_values = true)]
    sun: Option<Sun>,
    /// Constant environment in place of the scene's, which lights it: #rrggbb, or linear R,G,B from 0 to 1e6
    #[arg(long, value_name = "COLOR", value_parser = color, conflicts_with = "env", allow_hyphen_values = true)]
    background: Option<Color>,
    /// Add no ground below a mesh
    #[arg(long)]
    no_ground: bool,
}

/// [`Up`] with a default for the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct UpFlag(Up);

/// Linear radiance.
#[derive(Clone, Copy, Debug)]
struct Color([f32; 3]);

impl LookFlags {
    /// The first of the flags that is given.
    pub(crate) fn any(&self) -> Option<&'static str> {
        let given = [
            ("--camera", self.camera.is_some()),
            ("--from", self.from.is_some()),
            ("--look-at", self.look_at.is_some()),
            ("--fov", self.fov.is_some()),
            ("--up", self.up != UpFlag::default()),
            ("--env", self.env.is_some()),
            ("--sun", self.sun.is_some()),
            ("--background", self.background.is_some()),
            ("--no-ground", self.no_ground),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }

    /// The requests for the library, and the report of reading the environment map, whose bytes no longer count as free
    /// in `options`.
    pub(crate) fn look(&self, options: &mut LoadOptions) -> Result<(Look, LoadReport), Box<dyn Error>> {
        let (mut environment, mut report) = (None, LoadReport::default());
        if let Some(path) = &self.env {
            let (map, loaded) = load::environment(path, "--env", options)?;
            if let Environment::Map { texels, .. } = &map {
                options.texture_memory = options.texture_memory.saturating_sub(12 * texels.len() as u64);
            }
            environment = Some(self.placed(map));
            report = loaded;
        }
        if let Some(Color(radiance)) = self.background {
            environment = Some(Environment::Constant { radiance });
        }
        let look = Look {
            camera: self.camera.clone(),
            from: self.from,
            look_at: self.look_at,
            fov_deg: self.fov,
            up: self.up.0,
            sun: self.sun,
            environment,
            without_ground: self.no_ground,
        };
        Ok((look, report))
    }

    /// The map, turned and scaled; y is up.
    fn placed(&self, map: Environment) -> Environment {
        let Environment::Map { width, height, texels, .. } = map else { return map };
        let (sin, cos) = self.env_rotation.unwrap_or(0.0).to_radians().sin_cos();
        let (sin, cos) = (sin as f32, cos as f32);
        let to_world = [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]];
        Environment::Map { width, height, texels, scale: [self.env_scale.unwrap_or(1.0); 3], to_world }
    }
}

/// `N` numbers between commas, all within a range.
fn numbers<const N: usize>(text: &str, lo: f64, hi: f64) -> Result<[f64; N], String> {
    let found: Result<Vec<f64>, _> = text.split(',').map(|x| x.trim().parse::<f64>()).collect();
    let found: Option<[f64; N]> = found.ok().and_then(|v| v.try_into().ok());
    let found = found.filter(|v| v.iter().all(|x| (lo..=hi).contains(x)));
    let what = if N == 1 { "a number".into() } else { format!("{N} numbers between commas") };
    found.ok_or_else(|| format!("need {what}, {lo} to {hi}"))
}

/// A point in the world, such as `1,2.5,-3`.
pub(crate) fn point(text: &str) -> Result<[f64; 3], String> {
    numbers(text, -1e9, 1e9)
}

fn fov(text: &str) -> Result<f64, String> {
    let found = numbers::<1>(text, 0.001, 179.9).map(|[x]| x).ok();
    found.filter(|x| *x > 0.001 && *x < 179.9).ok_or_else(|| "need a number above 0.001, below 179.9".into())
}

fn turn(text: &str) -> Result<f64, String> {
    numbers(text, -360.0, 360.0).map(|[x]| x)
}

fn factor(text: &str) -> Result<f32, String> {
    let found = numbers::<1>(text, 0.0, 1e6).map(|[x]| x as f32).ok();
    found.filter(|x| *x > 0.0).ok_or_else(|| "need a number above 0, up to 1e6".into())
}

fn up(text: &str) -> Result<UpFlag, String> {
    match text {
        "auto" => Ok(UpFlag(Up::Auto)),
        "y" => Ok(UpFlag(Up::Y)),
        "z" => Ok(UpFlag(Up::Z)),
        _ => Err("need y, z or auto".into()),
    }
}

fn sun(text: &str) -> Result<Sun, String> {
    let need = "need AZIMUTH,ELEVATION in degrees: -360 to 360, and 0 to 90";
    let found = numbers::<2>(text, -360.0, 360.0).ok().filter(|[_, e]| (0.0..=90.0).contains(e));
    let [azimuth_deg, elevation_deg] = found.ok_or(need)?;
    Ok(Sun { azimuth_deg, elevation_deg })
}

fn color(text: &str) -> Result<Color, String> {
    let need = "need #rrggbb, or 3 linear numbers R,G,B between commas, 0 to 1e6";
    let Some(hex) = text.strip_prefix('#') else {
        return numbers(text, 0.0, 1e6).map(|rgb| Color(rgb.map(|x| x as f32))).map_err(|_| need.into());
    };
    if hex.len() != 6 || !hex.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(need.into());
    }
    let value = u32::from_str_radix(hex, 16).map_err(|_| need)?;
    Ok(Color([16, 8, 0].map(|shift| SRGB_TO_LINEAR[(value >> shift & 255) as usize])))
}
