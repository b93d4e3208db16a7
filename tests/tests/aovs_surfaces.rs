//! Auxiliary values of surfaces: which objects cover a pixel, and how they move across it, against `f64` oracles.

use croupier::unstable::film::{Aov, AovSet};
use croupier::unstable::scene::blob::NONE;
use croupier::{Scene, Settings, Strategy};
use croupier_host::description::*;
use croupier_host::drive::{Options, Rendered, Target, Unobserved, drive_scene};
use croupier_host::render::{RenderOptions, render};
use croupier_tests::placed::{IDENTITY, Map, add_prototype, apply, translation};
use croupier_tests::runner::settings;
use croupier_tests::scenes::*;

/// |z| that a comparison may reach: with the 2000 pixels of this file a false alarm in 2500 runs.
const LIMIT: f64 = 5.2;

const ALL: AovSet =
    AovSet::of(&[Aov::Alpha, Aov::Material, Aov::Object, Aov::MaterialCoverage, Aov::ObjectCoverage, Aov::Motion]);

fn look(bytes: &[u8], spp: u32) -> Rendered {
    let scene = Scene::from_bytes(bytes).unwrap();
    let s = Settings { aovs: ALL, max_depth: 1, shards: 3, ..settings(bytes, "none") };
    drive_scene(scene, &Options::new(s, Target::Spp(spp)), &Unobserved).unwrap()
}

fn plane(seen: &Rendered, aov: Aov, channel: usize) -> Vec<f64> {
    seen.channels(aov).unwrap()[channel].iter().map(|x| f64::from(*x)).collect()
}

/// A camera at z = 10 that sees x and y from -1 to 1 at z = 0.
fn plane_camera(size: [u32; 2]) -> Camera {
    camera([0.0, 0.0, 10.0], [0.0; 3], 2.0 * (0.1f64).atan().to_degrees(), size)
}

fn rectangle(x: [f32; 2], y: [f32; 2], z: f32) -> [[f32; 3]; 4] {
    [[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]]
}

/// From left to right nothing, a quad of the world, one within an instance within an instance, a quad of the world.
/// Edges are within pixels.
fn stripes() -> SceneDescription {
    let mut s = SceneDescription { camera: plane_camera([16, 8]), ..SceneDescription::default() };
    s.camera.size = [16, 16];
    let [red, green] = ["red", "green"].map(|n| s.add_material(n, grey(0.5)));
    add_quad(&mut s, "left", red, rectangle([-0.72, -0.22], [-2.0, 2.0], 0.0));
    let first = s.triangles.len() as u32;
    add_quad(&mut s, "inner", green, rectangle([0.0, 0.5], [-2.0, 2.0], 0.0));
    let inner = add_prototype(&mut s, "inner", first, vec![]);
    let none = s.triangles.len() as u32;
    let shift = Instance::new("shift", inner, translation([-1.22, 0.0, 0.0]));
    let outer = add_prototype(&mut s, "outer", none, vec![shift]);
    s.instances = vec![
        Instance { visible: false, ..Instance::new("unseen", inner, IDENTITY) },
        Instance::new("middle", outer, translation([1.0, 0.0, 0.0])),
    ];
    add_quad(&mut s, "right", red, rectangle([0.28, 2.0], [-2.0, 2.0], 0.0));
    s
}

/// Killed by: an index of the inner instance, of the prototype's object or of another level's, a name that is another's, a
/// share that counts other samples, a background that covers, ranks that are not ordered.
#[test]
fn pixels_know_the_objects_that_cover_them() {
    let bytes = blob(&stripes());
    let scene = Scene::from_bytes(&bytes).unwrap();
    let spp = 256;
    let seen = look(&bytes, spp);
    let alpha = plane(&seen, Aov::Alpha, 0);
    let edges: [f64; 4] = [-0.72, -0.22, 0.28, 2.0];
    let [objects, materials] = [["left", "middle", "right"], ["red", "green", "red"]];
    for (aov, first, names) in
        [(Aov::ObjectCoverage, Aov::Object, objects), (Aov::MaterialCoverage, Aov::Material, materials)]
    {
        let name = |index: u32| match aov {
            Aov::ObjectCoverage => scene.object_name(index),
            _ => scene.material_name(index),
        };
        let [id1, share1, id2, share2] = [0, 1, 2, 3].map(|c| plane(&seen, aov, c));
        let index = plane(&seen, first, 0);
        let mut edges_seen = 0;
        for i in 0..alpha.len() {
            let pixel = [(i % 16) as f64 / 8.0 - 1.0, (i % 16 + 1) as f64 / 8.0 - 1.0];
            assert!(share1[i] >= share2[i]);
            assert!((share1[i] + share2[i] - alpha[i]).abs() < 1e-6);
            assert_eq!([share1[i] > 0.0, share2[i] > 0.0], [id1[i] >= 0.0, id2[i] >= 0.0]);
            let found = [[id1[i], share1[i]], [id2[i], share2[i]]];
            assert!(found.iter().any(|f| f[0] == index[i]) || alpha[i] < 1.0 && index[i] == -1.0);
            let mut expected = 0;
            for wanted in &names[..if aov == Aov::ObjectCoverage { 3 } else { 2 }] {
                let within = |k: usize| (edges[k + 1].min(pixel[1]) - edges[k].max(pixel[0])).max(0.0) * 8.0;
                let inside: f64 = (0..3).filter(|k| names[*k] == *wanted).map(within).sum();
                let share: f64 =
                    found.iter().filter(|f| f[1] > 0.0 && name(f[0] as u32) == *wanted).map(|f| f[1]).sum();
                let error = (inside * (1.0 - inside) / f64::from(spp)).sqrt().max(1e-6);
                assert!((share - inside).abs() <= LIMIT * error, "{wanted} in pixel {i}: {share}, not {inside}");
                expected += usize::from(inside > 1e-3);
                edges_seen += usize::from(inside > 1e-3 && inside < 1.0 - 1e-3);
            }
            assert_eq!(expected, found.iter().filter(|f| f[1] > 0.0).count());
        }
        assert_eq!(edges_seen, 5 * 16);
    }
    assert_eq!(scene.object_of(0, NONE), 2);
    assert_eq!([0, 1, 2, 3, 4, 5].map(|i| scene.object_name(i)), ["unseen", "middle", "left", "inner", "right", ""]);
    assert_eq!(scene.object_of(1 << 20, NONE), NONE);
    let still = [0, 1].map(|c| plane(&seen, Aov::Motion, c));
    assert!(still.iter().flatten().all(|x| *x == 0.0));
}

/// An orthographic camera of a pixel per unit. Killed by: a sign, an axis or a scale that is another, motion of what stands
/// still, a mean over what was not hit.
#[test]
fn motion_is_in_pixels_to_the_right_and_down() {
    let mut s = SceneDescription { camera: plane_camera([8, 8]), ..SceneDescription::default() };
    s.camera.projection = Projection::Orthographic { height: 8.0 };
    let paint = s.add_material("paint", grey(0.5));
    add_quad(&mut s, "still", paint, rectangle([-4.0, 0.0], [-4.0, 4.0], -1.0));
    let first = s.triangles.len() as u32;
    add_quad(&mut s, "moving", paint, rectangle([-20.0, 20.0], [0.0, 20.0], 0.0));
    let moving = add_prototype(&mut s, "moving", first, vec![]);
    let close = translation([3.0, 2.0, 0.5]);
    s.instances = vec![Instance { to_world_end: Some(close), ..Instance::new("moving", moving, IDENTITY) }];
    let bytes = blob(&s);
    let seen = look(&bytes, 64);
    let [alpha, x, y] = [(Aov::Alpha, 0), (Aov::Motion, 0), (Aov::Motion, 1)].map(|(a, c)| plane(&seen, a, c));
    for i in 0..64 {
        let (column, row) = (i % 8, i / 8);
        // the lower edge moves up, from the middle of the picture to two pixels above
        let [dx, dy] = match row {
            0 | 1 => [3.0, -2.0],
            2 | 3 => [x[i], -x[i] * 2.0 / 3.0],
            _ => [0.0; 2],
        };
        assert!((x[i] - dx).abs() < 1e-4 && (y[i] - dy).abs() < 1e-4, "pixel {i}: {} {}", x[i], y[i]);
        assert!(row != 2 && row != 3 || x[i] > 0.0 && x[i] < 3.0);
        // to the right nothing is behind it
        let share = if column < 4 { x[i] / 3.0 } else { alpha[i] };
        assert!((x[i] - 3.0 * share).abs() < 1e-4, "pixel {i}");
    }
}

type Matrix = [[f64; 3]; 3];

/// A map between two keys.
fn between(keys: &[Map; 2], t: f64) -> (Matrix, [f64; 3]) {
    let entry = |r: usize, c: usize| {
        let [a, b] = [0, 1].map(|k| f64::from(keys[k][r][c]));
        a + (b - a) * t
    };
    ([0, 1, 2].map(|r| [0, 1, 2].map(|c| entry(r, c))), [0, 1, 2].map(|r| entry(r, 3)))
}

/// Solution of `m x = b`.
fn solve(m: Matrix, b: [f64; 3]) -> [f64; 3] {
    let det = |m: Matrix| {
        (0..3).map(|c| m[0][c] * (m[1][(c + 1) % 3] * m[2][(c + 2) % 3] - m[1][(c + 2) % 3] * m[2][(c + 1) % 3])).sum()
    };
    let whole: f64 = det(m);
    [0, 1, 2].map(|c| {
        let replaced = [0, 1, 2].map(|r| [0, 1, 2].map(|k| if k == c { b[r] } else { m[r][k] }));
        let part: f64 = det(replaced);
        part / whole
    })
}

/// Where the camera of [`plane_camera`] sees a point, in an image of `n` x `n` pixels.
fn image_of(p: [f64; 3], n: f64) -> [f64; 2] {
    let half = 0.1 * (10.0 - p[2]);
    [(1.0 + p[0] / half) * n / 2.0, (1.0 - p[1] / half) * n / 2.0]
}

/// Motion of what a pixel sees of the plane z = 0 of an object: its mean and variance over the pixel and the time.
fn oracle(keys: &[Map; 2], outer: [f64; 3], pixel: [f64; 2], n: f64) -> [[f64; 2]; 2] {
    let (across, times) = (6, 48);
    let (mut sum, mut square) = ([0.0; 2], [0.0; 2]);
    for k in 0..across * across * times {
        let at = |i: i32, of: i32| (f64::from(i) + 0.5) / f64::from(of);
        let (u, v, t) = (at(k % across, across), at(k / across % across, across), at(k / across / across, times));
        // the ray through the image point: origin (0, 0, 10)
        let d = [0.1 * ((pixel[0] + u) / n * 2.0 - 1.0), -0.1 * ((pixel[1] + v) / n * 2.0 - 1.0), -1.0];
        let (m, shift) = between(keys, t);
        let o: [f64; 3] = std::array::from_fn(|c| [0.0, 0.0, 10.0][c] - shift[c] - outer[c]);
        // the plane z = 0 of the object: o + s d = m (x, y, 0)
        let system = [0, 1, 2].map(|r| [m[r][0], m[r][1], -d[r]]);
        let [x, y, _] = solve(system, o);
        let seen = keys.map(|key| {
            let p = apply(&key, [x, y, 0.0]);
            image_of(std::array::from_fn(|c| p[c] + outer[c]), n)
        });
        for c in 0..2 {
            let motion = seen[1][c] - seen[0][c];
            sum[c] += motion;
            square[c] += motion * motion;
        }
    }
    let count = f64::from(across * across * times);
    [0, 1].map(|c| [sum[c] / count, square[c] / count - (sum[c] / count).powi(2)])
}

fn turned(degrees: f64, axis: usize, scale: f64, t: [f32; 3]) -> Map {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let mut m = translation(t);
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    (m[a][a], m[a][b], m[b][a], m[b][b]) =
        ((scale * cos) as f32, (-scale * sin) as f32, (scale * sin) as f32, (scale * cos) as f32);
    m[axis][axis] = scale as f32;
    m
}

/// A large quad that approaches, rotates about the view, tilts, and is mirrored, alone and within another instance. Killed
/// by: a point that is not the one that was hit at its time, keys that are exchanged, one level of maps left out, a
/// perspective that divides by another distance, motion of one key's camera.
#[test]
fn motion_is_that_of_the_point_that_was_hit() {
    const N: usize = 10;
    let mirrored = |mut m: Map| {
        m.iter_mut().for_each(|row| row[0] = -row[0]);
        m
    };
    let cases = [
        ("approaching", [translation([0.0, 0.0, -1.0]), translation([0.2, -0.1, 1.5])]),
        ("rotating", [turned(0.0, 2, 1.0, [0.0; 3]), turned(25.0, 2, 1.0, [0.05, 0.0, 0.0])]),
        ("tilting", [turned(-20.0, 0, 1.0, [0.0; 3]), turned(20.0, 0, 1.3, [0.0, 0.1, 0.2])]),
        ("mirrored", [mirrored(turned(0.0, 1, 1.0, [0.0; 3])), mirrored(turned(15.0, 1, 1.0, [0.1, 0.0, 0.0]))]),
    ];
    for (what, keys) in cases {
        for outer in [None, Some([0.125f32, -0.25, 0.5])] {
            let mut s = SceneDescription { camera: plane_camera([N as u32; 2]), ..SceneDescription::default() };
            let paint = s.add_material("paint", grey(0.5));
            add_quad(&mut s, "quad", paint, rectangle([-9.0, 9.0], [-9.0, 9.0], 0.0));
            let quad = add_prototype(&mut s, "quad", 0, vec![]);
            s.instances = vec![Instance { to_world_end: Some(keys[1]), ..Instance::new(what, quad, keys[0]) }];
            if let Some(t) = outer {
                let none = s.triangles.len() as u32;
                let around = std::mem::take(&mut s.instances);
                let around = add_prototype(&mut s, "around", none, around);
                s.instances = vec![Instance::new("around", around, translation(t))];
            }
            let spp = 400;
            let seen = look(&blob(&s), spp);
            assert!(plane(&seen, Aov::Alpha, 0).iter().all(|a| *a == 1.0));
            let motion = [0, 1].map(|c| plane(&seen, Aov::Motion, c));
            let mut largest = 0.0f64;
            for (i, (&x, &y)) in motion[0].iter().zip(&motion[1]).enumerate() {
                let pixel = [(i % N) as f64, (i / N) as f64];
                let expected = oracle(&keys, outer.map_or([0.0; 3], |t| t.map(f64::from)), pixel, N as f64);
                for (found, [mean, variance]) in [x, y].into_iter().zip(expected) {
                    let error = (variance.max(0.0) / f64::from(spp)).sqrt() + 2e-5;
                    assert!((found - mean).abs() <= LIMIT * error, "{what} {i}: {found}, not {mean} +- {error}");
                    largest = largest.max(mean.abs());
                }
            }
            assert!(largest > 0.5, "{what}: {largest}");
        }
    }
}

/// The layers that the program writes. Killed by: a layer with another name, ids that are averaged or divided, motion that
/// is not divided by the coverage, a manifest that lacks what is seen.
#[test]
fn files_have_the_layers_of_other_renderers() {
    let bytes = blob(&stripes());
    let options = RenderOptions {
        settings: Settings { aovs: ALL, max_depth: 1, ..settings(&bytes, "none") },
        target: Target::Spp(64),
        ..RenderOptions::new(Strategy::default())
    };
    let result = render(&bytes, &options, &Unobserved).unwrap();
    let channels = |name: &str| -> Vec<String> {
        let layer = result.picture.layer(name).unwrap_or_else(|| panic!("no layer {name}"));
        layer.channels.iter().map(|c| c.name.clone()).collect()
    };
    assert_eq!([channels("object"), channels("material")], [["id"], ["id"]]);
    assert_eq!(channels("motion"), ["X", "Y"]);
    for name in ["CryptoObject00", "CryptoMaterial00"] {
        assert_eq!(channels(name), ["R", "G", "B", "A"]);
    }
    let file = std::env::temp_dir().join(format!("croupier-cryptomatte-{}.exr", std::process::id()));
    result.picture.write_exr(&file).unwrap();
    let back = croupier_host::image::Picture::read_exr(&file);
    let raw = std::fs::read(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    assert_eq!(back.unwrap().layer("CryptoObject00"), result.picture.layer("CryptoObject00"));
    let header = String::from_utf8_lossy(&raw[..raw.len().min(4000)]).into_owned();
    for text in ["cryptomatte/", "MurmurHash3_32", "uint32_to_float32", "\"middle\":", "\"left\":", "\"red\":"] {
        assert!(header.contains(text), "{text} is not in the header");
    }
}
