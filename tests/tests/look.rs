//! What is added to scenes that leave camera, light and ground open, and what the flags of camera and light ask for.

use croupier_host::description::*;
use croupier_host::image::Rgb;
use croupier_host::look::{Axes, Given, Look, LookError, Sun, Up, daylight, dress, exposure};
use croupier_tests::light_oracle::{cross, dot, length, luminance, sub, unit, wide};
use std::f64::consts::PI;

type V = [f64; 3];
/// Moves a point.
type Shape = fn(V) -> V;

/// A mesh of boxes (smallest and largest corner), outwards.
fn boxes(all: &[[V; 2]]) -> SceneDescription {
    let mut s = SceneDescription::default();
    let grey = s.add_material("grey", Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) });
    for [lo, hi] in all {
        let corner = |k: usize| std::array::from_fn(|i| if k >> i & 1 == 0 { lo[i] } else { hi[i] } as f32);
        let vertices: Vec<Vertex> = (0..8).map(|k| Vertex { position: corner(k), ..Vertex::default() }).collect();
        let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        s.add_mesh("box", grey, &vertices, &triangles, false);
    }
    s
}

/// A table: four legs and a top, y up.
fn table() -> SceneDescription {
    let mut all = vec![[[-1.0, 1.0, -0.6], [1.0, 1.1, 0.6]]];
    for (x, z) in [(-0.9, -0.5), (0.8, -0.5), (-0.9, 0.4), (0.8, 0.4)] {
        all.push([[x, 0.0, z], [x + 0.1, 1.0, z + 0.1]]);
    }
    boxes(&all)
}

/// Moves every vertex.
fn moved(mut s: SceneDescription, f: impl Fn(V) -> V) -> SceneDescription {
    s.vertices.iter_mut().for_each(|v| v.position = f(wide(v.position)).map(|x| x as f32));
    s
}

/// y up becomes z up.
fn lying([x, y, z]: V) -> V {
    [x, -z, y]
}

fn dressed(mut s: SceneDescription, look: &Look) -> SceneDescription {
    dress(&mut s, &Given::MESH, look).unwrap();
    s
}

/// Places of a point in the picture, -1 to 1 across and down.
fn in_picture(c: &Camera, p: V) -> [f64; 2] {
    let forward = unit(sub(c.target, c.origin));
    let right = unit(cross(forward, c.up));
    let down = cross(forward, right);
    let half = (c.vfov_deg.to_radians() / 2.0).tan();
    let d = sub(p, c.origin);
    let depth = dot(d, forward);
    assert!(depth > 0.0, "behind the camera");
    let aspect = f64::from(c.size[0]) / f64::from(c.size[1]);
    [dot(d, right) / depth / half / aspect, dot(d, down) / depth / half]
}

/// Whatever its size, place and shape, a mesh fills the picture and is inside of it: 86 % of one half side is reached.
/// Killed by: framing by a sphere, by the box of the world's axes, or with the unused vertex.
#[test]
fn meshes_fill_the_picture() {
    let shapes: [(&str, Shape); 6] = [
        ("as it is", |p| p),
        ("tiny", |p| p.map(|x| x * 1e-4)),
        ("huge", |p| p.map(|x| x * 1e6)),
        ("far away", |[x, y, z]| [x + 4096.0, y - 8192.0, z]),
        ("a rod", |[x, y, z]| [40.0 * x, 0.1 * y, 0.1 * z]),
        ("a tower", |[x, y, z]| [x, 30.0 * y, z]),
    ];
    for (name, shape) in shapes {
        for up in [Up::Y, Up::Z] {
            let mut s = moved(table(), shape);
            s.vertices.push(Vertex { position: [1e8; 3], ..Vertex::default() });
            let before = s.triangles.len();
            let s = dressed(s, &Look { up, ..Look::default() });
            let (mut reach, mut least) = (0.0f64, [f64::MAX; 2]);
            let mut most = [f64::MIN; 2];
            for t in &s.triangles[..before] {
                for v in t.vertices {
                    let p = in_picture(&s.camera, wide(s.vertices[v as usize].position));
                    for i in 0..2 {
                        reach = reach.max(p[i].abs());
                        (least[i], most[i]) = (least[i].min(p[i]), most[i].max(p[i]));
                    }
                }
            }
            assert!((0.84..0.875).contains(&reach), "{name}, {up:?}: reaches {reach}");
            // centred: what one side has, the other has
            assert!((0..2).all(|i| (least[i] + most[i]).abs() < 0.03), "{name}, {up:?}: {least:?} {most:?}");
        }
    }
}

/// Killed by: a guess that always says y, or takes the longest axis for the height.
#[test]
fn the_up_axis_is_guessed() {
    let hill = |n: u32| {
        let mut s = SceneDescription::default();
        let grey = s.add_material("grey", Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) });
        let at = |k: u32| {
            let (x, z) = (f64::from(k % n), f64::from(k / n));
            [x, 2.0 * (x * 0.7).sin() * (z * 0.4).cos(), -z].map(|c| c as f32)
        };
        let vertices: Vec<Vertex> = (0..n * n).map(|k| Vertex { position: at(k), ..Vertex::default() }).collect();
        let cells = (0..(n - 1) * (n - 1)).map(|k| k / (n - 1) * n + k % (n - 1));
        let faces: Vec<[u32; 3]> = cells.flat_map(|a| [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]).collect();
        s.add_mesh("hill", grey, &vertices, &faces, false);
        s
    };
    let cone = || boxes(&[[[-1.0, 0.0, -1.0], [1.0, 0.2, 1.0]], [[-0.2, 0.2, -0.2], [0.2, 3.0, 0.2]]]);
    let upright: [(&str, SceneDescription); 2] = [("hill", hill(20)), ("lamp", cone())];
    for (name, s) in upright {
        assert_eq!(dressed(s.clone(), &Look::default()).camera.up, Axes::Y.up, "{name}");
        assert_eq!(dressed(moved(s, lying), &Look::default()).camera.up, Axes::Z.up, "{name}, lying");
    }
    // No sign: y, or what the format says.
    let mut cube = boxes(&[[[-1.0; 3], [1.0; 3]]]);
    assert_eq!(dressed(cube.clone(), &Look::default()).camera.up, Axes::Y.up);
    dress(&mut cube, &Given { up: Up::Z, ..Given::MESH }, &Look::default()).unwrap();
    assert_eq!(cube.camera.up, Axes::Z.up);
    // A card shows its face, not its edge.
    let card = dressed(boxes(&[[[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]]), &Look::default());
    assert_eq!(card.camera.up, Axes::Y.up);
}

/// The ground is level, below everything, faces up, and reaches beyond the shadow; a mesh with its own gets none.
/// Killed by: a ground at the origin, one that faces down, one of the wrong axis.
#[test]
fn meshes_stand_on_a_ground() {
    for (up, axes) in [(Up::Y, Axes::Y), (Up::Z, Axes::Z)] {
        let own = moved(table(), |[x, y, z]| [x + 7.0, y - 3.0, z + 5.0]);
        let (triangles, vertices) = (own.triangles.len(), own.vertices.len());
        let lowest = own.vertices.iter().map(|v| dot(wide(v.position), axes.up)).fold(f64::MAX, f64::min);
        let s = dressed(own, &Look { up, ..Look::default() });
        assert!(s.triangles.len() > triangles);
        for v in &s.vertices[vertices..] {
            let height = dot(wide(v.position), axes.up);
            assert!(height < lowest && height > lowest - 0.01, "{height} under {lowest}");
        }
        for t in &s.triangles[triangles..] {
            let [a, b, c] = t.vertices.map(|v| wide(s.vertices[v as usize].position));
            assert!(dot(unit(cross(sub(b, a), sub(c, a))), axes.up) > 0.999);
        }
    }
    let floor = [[-20.0, -0.1, -20.0], [20.0, 0.0, 20.0]];
    let s = boxes(&[floor, [[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]]]);
    let count = s.triangles.len();
    let s = dressed(s, &Look { up: Up::Y, ..Look::default() });
    assert_eq!(s.triangles.len(), count, "a floor of its own");
    // what stands on it is framed, not the floor
    assert!(length(sub(s.camera.origin, [0.0, 1.0, 0.0])) < 10.0, "{:?}", s.camera);
}

/// Rooms are looked into: through the side that is open, whichever it is, else from within; closed ones without a lamp
/// get one. Killed by: an opening that is always the front, a camera behind a wall, a black picture.
#[test]
fn rooms_are_looked_into() {
    let walls: [[V; 2]; 6] = [
        [[-2.1, 0.0, -3.0], [-2.0, 2.5, 3.0]],
        [[2.0, 0.0, -3.0], [2.1, 2.5, 3.0]],
        [[-2.0, 0.0, -3.1], [2.0, 2.5, -3.0]],
        [[-2.0, 0.0, 3.0], [2.0, 2.5, 3.1]],
        [[-2.1, -0.1, -3.1], [2.1, 0.0, 3.1]],
        [[-2.1, 2.5, -3.1], [2.1, 2.6, 3.1]],
    ];
    let inside = |s: &SceneDescription| {
        let [x, y, z] = s.camera.origin;
        x.abs() < 2.0 && (0.0..2.5).contains(&y) && z.abs() < 3.0
    };
    let closed = dressed(boxes(&walls), &Look::default());
    assert!(inside(&closed) && closed.environment.is_none(), "{:?}", closed.camera);
    assert!(matches!(closed.emitters[..], [Emitter::Point { .. }]));
    for (missing, axis, sign) in [(0, 0, -1.0), (1, 0, 1.0), (2, 2, -1.0), (3, 2, 1.0)] {
        let others: Vec<[V; 2]> = (0..6).filter(|i| *i != missing).map(|i| walls[i]).collect();
        let s = dressed(boxes(&others), &Look { up: Up::Y, ..Look::default() });
        assert!(s.camera.origin[axis] * sign > 3.0 && s.environment.is_some(), "{missing}: {:?}", s.camera);
        assert!(s.camera.target[axis] * sign < 0.0);
    }
}

/// Irradiance of a level surface from sun and map.
fn irradiance(sun: &Emitter, sky: &Environment, up: V) -> (V, V) {
    let Emitter::Sun { direction, irradiance, .. } = sun else { panic!("{sun:?}") };
    let direct = irradiance.map(|e| f64::from(e) * -dot(unit(wide(*direction)), up));
    let Environment::Map { width, height, texels, scale, .. } = sky else { panic!("{sky:?}") };
    let (w, h) = (*width as usize, *height as usize);
    let mut diffuse = [0.0; 3];
    for (k, t) in texels.iter().enumerate() {
        let polar = PI * (k / w) as f64 / (h - 1) as f64;
        // half the width of a row at the poles, which the sine makes irrelevant
        let weight = polar.cos().max(0.0) * polar.sin() * PI / (h - 1) as f64 * 2.0 * PI / w as f64;
        (0..3).for_each(|c| diffuse[c] += weight * f64::from(t[c] * scale[c]));
    }
    (direct, diffuse)
}

/// White at 45 degrees, with the irradiance that the documents state; warmer and dimmer near the horizon; the lower half
/// is the ground that this irradiance lights; the sky turns with the sun. Killed by: a balance of sun or sky alone, an
/// azimuth the wrong way round, a map that is not turned to the scene's axes.
#[test]
fn daylight_is_white_and_placed() {
    for axes in [Axes::Y, Axes::Z] {
        let (sun, sky) = daylight(Sun { azimuth_deg: 30.0, elevation_deg: 45.0 }, &axes, 0.5);
        let (direct, diffuse) = irradiance(&sun, &sky, axes.up);
        for c in 0..3 {
            assert!((direct[c] + diffuse[c] - PI).abs() < 0.01 * PI, "{c}: {direct:?} {diffuse:?}");
        }
        assert!(diffuse[2] / direct[2] > 1.5 * diffuse[0] / direct[0], "a blue sky: {direct:?} {diffuse:?}");
        let Environment::Map { width, height, texels, to_world, .. } = &sky else { panic!() };
        let nadir = texels[(*height as usize - 1) * *width as usize];
        for c in 0..3 {
            let want = 0.5 * (direct[c] + diffuse[c]) / PI;
            assert!((f64::from(nadir[c]) / want - 1.0).abs() < 0.01, "{nadir:?} for {want}");
        }
        // right of the front
        let Emitter::Sun { direction, .. } = sun else { panic!() };
        let to_sun = axes.coordinates(wide(direction).map(|x| -x));
        let want = [0.5, 1.0, 0.75f64.sqrt()].map(|x| x * 0.5f64.sqrt());
        assert!(length(sub(to_sun, [want[0], 0.5f64.sqrt(), want[2]])) < 1e-6, "{to_sun:?}");
        // the sky is brightest below it
        // above the haze at the horizon
        let brightest = (0..texels.len() * 2 / 5).max_by(|a, b| {
            let l = |k: usize| luminance(wide(texels[k]));
            l(*a).total_cmp(&l(*b))
        });
        let k = brightest.unwrap();
        let (u, v) = ((k as u32 % width) as f64 + 0.5, (k as u32 / width) as f64);
        let (phi, polar) = (2.0 * PI * u / f64::from(*width), PI * v / f64::from(height - 1));
        let d = [polar.sin() * phi.sin(), polar.cos(), -polar.sin() * phi.cos()];
        let d: V = std::array::from_fn(|i| dot(wide(to_world[i]), d));
        let [right, _, front] = axes.coordinates(d);
        assert!((right.atan2(front).to_degrees() - 30.0).abs() < 3.0, "{d:?}");
    }
    let (sun, sky) = daylight(Sun { azimuth_deg: 0.0, elevation_deg: 4.0 }, &Axes::Y, 0.5);
    let (direct, diffuse) = irradiance(&sun, &sky, Axes::Y.up);
    assert!(direct[0] > 2.0 * direct[2] && direct[0] + diffuse[0] < 0.4, "{direct:?} {diffuse:?}");
}

fn given_camera() -> SceneDescription {
    let mut s = table();
    s.camera = Camera { origin: [0.0, 2.0, 9.0], ..Camera::default() };
    for (name, height) in [("side", 2.0), ("top", 5.0)] {
        let camera = Camera { projection: Projection::Orthographic { height }, ..Camera::default() };
        s.cameras.push(NamedCamera { name: name.into(), camera });
    }
    s
}

/// Scenes that leave nothing open stay as they are; requests change what they name, and nothing else. Killed by: a light or
/// ground added to a scene file, a camera by another's name, a target that moves along with the place.
#[test]
fn requests_change_what_they_name() {
    let scene = |look: &Look| {
        let mut s = given_camera();
        dress(&mut s, &Given::SCENE, look).map(|_| s)
    };
    let base = given_camera();
    let same = scene(&Look::default()).unwrap();
    assert!(same.camera == base.camera && same.triangles == base.triangles && same.emitters == base.emitters);
    assert!(same.environment.is_none());
    let top = scene(&Look { camera: Some("top".into()), ..Look::default() }).unwrap();
    assert_eq!(top.camera, base.cameras[1].camera);
    let error = scene(&Look { camera: Some("up".into()), ..Look::default() }).unwrap_err();
    assert!(error.to_string().contains("`up`") && error.to_string().contains("side, top"), "{error}");
    let wide_camera = scene(&Look { fov_deg: Some(70.0), from: Some([1.0, 2.0, 3.0]), ..Look::default() }).unwrap();
    assert_eq!(wide_camera.camera, Camera { vfov_deg: 70.0, origin: [1.0, 2.0, 3.0], ..base.camera });
    let look = Look { camera: Some("side".into()), fov_deg: Some(70.0), ..Look::default() };
    assert_eq!(scene(&look).unwrap_err(), LookError::FieldOfView);
    let look = Look { from: Some(base.camera.target), ..Look::default() };
    assert_eq!(scene(&look).unwrap_err(), LookError::Direction(base.camera.target));
    // straight down, the axis is parallel to up
    let look = Look { from: Some([0.0, 9.0, 0.0]), look_at: Some([0.0; 3]), ..Look::default() };
    assert!(length(cross(unit(scene(&look).unwrap().camera.up), [0.0, 1.0, 0.0])) > 0.9);
    let sun = Some(Sun::default());
    let lit = scene(&Look { sun, ..Look::default() }).unwrap();
    assert!(matches!(lit.emitters[..], [Emitter::Sun { .. }]) && lit.environment.is_some());
    assert_eq!(lit.triangles.len(), base.triangles.len());
    let grey = Environment::Constant { radiance: [0.5; 3] };
    let both = scene(&Look { sun, environment: Some(grey.clone()), ..Look::default() }).unwrap();
    assert!(both.emitters.len() == 1 && both.environment == Some(grey));
}

/// Killed by: a mean that black pixels pull down, or the one bright pixel up; highlights that clip.
#[test]
fn exposure_follows_the_picture() {
    let image =
        |pixels: Vec<f32>| Rgb { width: pixels.len(), height: 1, pixels: pixels.iter().map(|x| [*x; 3]).collect() };
    let plain = exposure::auto(&image(vec![0.32; 100]));
    assert!(plain.abs() < 1e-3, "{plain}");
    let dark = exposure::auto(&image(vec![0.32 / 1024.0; 100]));
    assert!((dark - 10.0).abs() < 1e-3, "{dark}");
    let mut outliers = vec![0.32; 100];
    outliers[..2].fill(1e6);
    outliers.extend([0.0; 400]);
    assert!(exposure::auto(&image(outliers)).abs() < 1e-3);
    let mut highlights = vec![0.05; 100];
    highlights[..20].fill(4.0);
    let stops = exposure::auto(&image(highlights));
    assert!((4.0 * stops.exp2() - 0.92).abs() < 1e-3, "{stops}");
    assert_eq!(exposure::auto(&image(vec![0.0; 10])), 0.0);
    assert_eq!(exposure::auto(&image(vec![])), 0.0);
}
