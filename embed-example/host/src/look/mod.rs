//! What scene files leave open and users ask for: which way is up, camera, light, ground, exposure.
//!
//! [`dress`] completes a scene that was loaded, and follows the requests of a [`Look`]. A bare mesh becomes a picture: its
//! up axis is guessed, it is framed from the front, the right and above, it stands on a diffuse ground in daylight.
//! Scenes that bring camera and light along stay as they are, but for what is asked for.
//!
//! | file | has |
//! |---|---|
//! | `axes` | up and front |
//! | `up` | the guess which axis points up |
//! | `framing` | the camera that shows everything |
//! | `room` | whether a mesh brings a ground or walls along |
//! | `atmosphere`, `sky` | daylight: sun and environment |
//! | `exposure` | exposure from a picture |

mod atmosphere;
mod axes;
pub mod exposure;
mod framing;
mod room;
mod sky;
mod up;

pub use atmosphere::Atmosphere;
pub use axes::{Axes, Up};
pub use sky::{Sun, daylight};

use crate::description::{Camera, Emitter, Environment, Model, Projection, Reflectance, SceneDescription, Vertex};
use crate::text::excerpt;
use axes::{corners, cross, dot, sub};
use room::Surroundings;
use std::fmt;

/// What a file says of itself, set by its reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Given {
    /// There is a camera in [`SceneDescription::camera`].
    pub camera: bool,
    /// The file decides about light, even if it has none.
    pub light: bool,
    /// Up, as far as the format tells: a default where the geometry gives no sign. `Auto` is +y.
    pub up: Up,
    /// The format prescribes `up`: it is no default.
    pub up_is_known: bool,
}

impl Given {
    /// A scene file: nothing is left open.
    pub const SCENE: Self = Self { camera: true, light: true, up: Up::Y, up_is_known: false };
    /// A mesh: everything is left open.
    pub const MESH: Self = Self { camera: false, light: false, up: Up::Y, up_is_known: false };
}

/// Requests; the default has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    /// Camera of the file to use, by name.
    pub camera: Option<String>,
    /// Place of the camera, world space.
    pub from: Option<[f64; 3]>,
    /// Point that the camera looks at, world space.
    pub look_at: Option<[f64; 3]>,
    /// Full vertical field of view, degrees.
    pub fov_deg: Option<f64>,
    /// Axis that points up.
    pub up: Up,
    /// Sun and sky in place of the environment, beside the scene's own lights.
    pub sun: Option<Sun>,
    /// Environment in place of the scene's, a map with y up; with `sun` the sky is left out.
    pub environment: Option<Environment>,
    /// No ground is added below meshes.
    pub without_ground: bool,
}

/// A request that cannot be followed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LookError {
    /// The scene has no camera of this name.
    Camera {
        /// Name asked for.
        name: String,
        /// Names that there are.
        known: Vec<String>,
    },
    /// A field of view for a camera that has none.
    FieldOfView,
    /// The camera looks at the place where it is.
    Direction([f64; 3]),
}

impl fmt::Display for LookError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Camera { name, known } if known.is_empty() => {
                write!(f, "there is no camera `{}`: the scene has no named cameras", excerpt(name))
            }
            Self::Camera { name, known } => {
                write!(f, "there is no camera `{}`, there are: {}", excerpt(name), excerpt(&known.join(", ")))
            }
            Self::FieldOfView => write!(f, "a field of view is for perspective cameras, the scene's is another"),
            Self::Direction([x, y, z]) => write!(f, "the camera at {x}, {y}, {z} looks at the place where it is"),
        }
    }
}

impl std::error::Error for LookError {}

/// Radius of the added ground, in radii of what stands on it; beyond it the environment continues the ground.
const GROUND_RADII: f64 = 10.0;
/// Albedo of the added ground.
const GROUND_ALBEDO: f32 = 0.4;
/// Corners of the added ground.
const GROUND_CORNERS: u32 = 64;

/// Completes a scene and follows the requests; returns notes on what was assumed, one sentence each.
pub fn dress(scene: &mut SceneDescription, given: &Given, look: &Look) -> Result<Vec<String>, LookError> {
    let mut notes = Vec::new();
    let has_camera = choose_camera(scene, look)? || given.camera;
    let wants_light = look.sun.is_some() || look.environment.is_some();
    if has_camera && given.light && !wants_light && *look == (Look { camera: look.camera.clone(), ..Look::default() }) {
        return Ok(notes);
    }
    let (axes, guessed) = match (look.up, has_camera) {
        (Up::Auto, true) => (axes_of(&scene.camera), false),
        (Up::Auto, false) if given.up_is_known => up::axes(scene, given.up, given.up),
        (choice, _) => up::axes(scene, choice, given.up),
    };
    let surroundings = Surroundings::of(scene, &axes).unwrap_or_default();
    if !has_camera {
        let base =
            Camera { size: [800, 600], vfov_deg: look.fov_deg.unwrap_or(framing::VFOV_DEG), ..Camera::default() };
        scene.camera = camera(scene, &surroundings, &axes, &base);
        let up = if axes == Axes::Z { "z" } else { "y" };
        let why = if guessed { " (--up chooses)" } else { "" };
        let what = if surroundings.room && surroundings.open_side.is_none() { "placed in the room" } else { "framed" };
        notes.push(format!("the file has no camera: {what}, {up} taken as up{why}"));
    }
    aim(&mut scene.camera, look, &axes)?;
    let lit = given.light || (surroundings.room && !scene.emitters.is_empty());
    light(scene, look, &axes, &surroundings, lit, &mut notes);
    let bare = !given.camera && !given.light && !surroundings.ground && !surroundings.room;
    if bare && !look.without_ground && !scene.triangles.is_empty() {
        add_ground(scene, &surroundings, &axes);
        notes.push("a ground was added below the mesh".into());
    }
    Ok(notes)
}

/// Takes the camera asked for; `false` if none is.
fn choose_camera(scene: &mut SceneDescription, look: &Look) -> Result<bool, LookError> {
    let Some(name) = &look.camera else { return Ok(false) };
    let found = scene.cameras.iter().find(|c| c.name == *name).map(|c| c.camera);
    let known = || scene.cameras.iter().map(|c| c.name.clone()).collect();
    scene.camera = found.ok_or_else(|| LookError::Camera { name: name.clone(), known: known() })?;
    Ok(true)
}

/// The axes that a camera's own up vector is nearest to.
fn axes_of(camera: &Camera) -> Axes {
    let [_, y, z] = camera.up;
    if z.abs() > y.abs() { Axes::Z } else { Axes::Y }
}

/// A camera for a scene without one.
fn camera(scene: &SceneDescription, around: &Surroundings, axes: &Axes, base: &Camera) -> Camera {
    if let Some(camera) = around.open_side.map(|side| framing::through(side, around.bounds, axes, base)) {
        return camera;
    }
    if around.room {
        return framing::inside(around.bounds, axes, base);
    }
    let all = || scene.triangles.iter().filter_map(|t| corners(scene, t.vertices));
    // What stands on a ground, if it is small on it.
    let standing = || all().filter(|t| t.iter().any(|p| axes.coordinates(*p)[1] > around.ground_top)).flatten();
    if around.ground && standing().next().is_some() {
        let spread = |points: &mut dyn Iterator<Item = [f64; 3]>| {
            let bounds = points.map(|p| axes.coordinates(p)).fold([[f64::MAX; 3], [f64::MIN; 3]], |[lo, hi], p| {
                [std::array::from_fn(|i| lo[i].min(p[i])), std::array::from_fn(|i| hi[i].max(p[i]))]
            });
            let d = sub(bounds[1], bounds[0]);
            d[0].max(d[2])
        };
        let (own, ground) = (spread(&mut standing()), spread(&mut all().flatten()));
        if own < 0.6 * ground {
            return framing::frame(standing(), axes, base);
        }
    }
    framing::frame(all().flatten(), axes, base)
}

/// Moves, turns and widens a camera as asked for.
fn aim(camera: &mut Camera, look: &Look, axes: &Axes) -> Result<(), LookError> {
    camera.origin = look.from.unwrap_or(camera.origin);
    camera.target = look.look_at.unwrap_or(camera.target);
    if let Some(fov) = look.fov_deg {
        if camera.projection != Projection::Perspective {
            return Err(LookError::FieldOfView);
        }
        camera.vfov_deg = fov;
    }
    if look.up != Up::Auto {
        camera.up = axes.up;
    }
    if look.from.is_some() || look.look_at.is_some() {
        let axis = sub(camera.target, camera.origin);
        let length = dot(axis, axis).sqrt();
        if length == 0.0 {
            return Err(LookError::Direction(camera.origin));
        }
        // Straight up or down: the front is below.
        let across = cross(axis.map(|x| x / length), camera.up);
        let up = dot(camera.up, camera.up).sqrt();
        if dot(across, across).sqrt() < 1e-4 * up {
            camera.up = axes.front.map(|x| -x);
        }
    }
    Ok(())
}

/// Gives light to a scene that has none, or the light that is asked for.
fn light(
    scene: &mut SceneDescription,
    look: &Look,
    axes: &Axes,
    around: &Surroundings,
    lit: bool,
    notes: &mut Vec<String>,
) {
    let closed = around.room && around.open_side.is_none();
    let needs = !lit && look.environment.is_none() && look.sun.is_none();
    if needs && closed && scene.emitters.is_empty() {
        // no sky reaches it: a point light below the ceiling, as bright as daylight on the floor
        let [lo, hi] = around.bounds;
        let height = 0.9 * (hi[1] - lo[1]);
        let position = axes.vector([around.middle()[0], lo[1] + height, around.middle()[2]]).map(|x| x as f32);
        let intensity = [(std::f64::consts::PI * height * height) as f32; 3];
        scene.emitters.push(Emitter::Point { position, intensity });
        notes.push("the file is a closed room without light: a point light was added below its ceiling".into());
        return;
    }
    if needs || look.sun.is_some() {
        let (sun, sky) = daylight(look.sun.unwrap_or_default(), axes, GROUND_ALBEDO.into());
        scene.emitters.push(sun);
        scene.environment = Some(sky);
        if needs {
            notes.push("the file has no light: sun and sky were added".into());
        }
    }
    if let Some(environment) = &look.environment {
        scene.environment = Some(upright(environment.clone(), axes));
    }
}

/// An environment whose map has y up, turned to the axes of a scene.
fn upright(environment: Environment, axes: &Axes) -> Environment {
    let Environment::Map { width, height, texels, scale, to_world } = environment else { return environment };
    let columns = [axes.right, axes.up, axes.front];
    let turned = |i: usize, j: usize| (0..3).map(|k| columns[k][i] * f64::from(to_world[k][j])).sum::<f64>() as f32;
    let to_world = std::array::from_fn(|i| std::array::from_fn(|j| turned(i, j)));
    Environment::Map { width, height, texels, scale, to_world }
}

/// Adds a disk below everything, facing up.
fn add_ground(scene: &mut SceneDescription, around: &Surroundings, axes: &Axes) {
    let [x, _, z] = around.middle();
    // not in one plane with the underside
    let y = around.bounds[0][1] - 1e-4 * around.radius();
    let radius = GROUND_RADII * around.radius().max(1e-6);
    let vertex = |p: [f64; 3]| Vertex { position: axes.vector(p).map(|x| x as f32), ..Vertex::default() };
    let mut vertices = vec![vertex([x, y, z])];
    for k in 0..GROUND_CORNERS {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(GROUND_CORNERS)).sin_cos();
        vertices.push(vertex([x + radius * cos, y, z - radius * sin]));
    }
    let fan: Vec<[u32; 3]> = (0..GROUND_CORNERS).map(|k| [0, 1 + k, 1 + (k + 1) % GROUND_CORNERS]).collect();
    let grey = Reflectance::Constant([GROUND_ALBEDO; 3]);
    let material = scene.add_material("added ground", Model::Diffuse { reflectance: grey });
    scene.add_mesh("added ground", material, &vertices, &fan, false);
}
