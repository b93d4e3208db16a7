//! Flags of camera and light, as a user gives them.
#![cfg(feature = "program")]

mod common;

use common::{croupier, hdr, text};
use croupier::Scene;
use croupier::unstable::scene::blob::{CameraKind, LightKind};
use std::path::Path;

const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
const SCENE: &str = r#"{ "geometry": { "file": "t.obj" }, "materials": { "m": { "type": "diffuse", "reflectance": [0.5, 0.5, 0.5] } },
  "camera": { "origin": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 40, "width": 8, "height": 6 },
  "cameras": {
    "plan": { "type": "orthographic", "view_height": 3, "origin": [0, 4, 0], "target": [0, 0, 0], "up": [0, 0, -1],
              "width": 8, "height": 8 },
    "round": { "type": "panoramic", "origin": [0, 0, 1], "target": [0, 0, 0], "up": [0, 1, 0], "width": 16, "height": 8 } },
  "emitters": [{ "type": "constant", "radiance": [1, 1, 1] }] }"#;

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("mesh.obj"), MESH).unwrap();
    std::fs::write(dir.path().join("t.obj"), MESH.replace("f ", "usemtl m\nf ")).unwrap();
    std::fs::write(dir.path().join("scene.json"), SCENE).unwrap();
    dir
}

/// Bakes a scene with flags, and looks at the blob.
#[track_caller]
fn baked(dir: &Path, scene: &str, flags: &[&str], see: impl FnOnce(&Scene<'_>)) {
    let out = croupier(dir, &[&["bake", scene, "-o", "b.crp"], flags].concat());
    assert_eq!(out.status.code(), Some(0), "{flags:?}: {}", text(&out.stderr));
    let bytes = std::fs::read(dir.join("b.crp")).unwrap();
    let mut aligned = croupier_host::blob::AlignedBytes::zeroed(bytes.len());
    aligned.as_mut().copy_from_slice(&bytes);
    see(&Scene::from_bytes(&aligned).unwrap());
}

/// Killed by: a flag that is taken for another, a range that is not checked, a message without the flag.
#[test]
fn flags_out_of_range_are_status_2_and_named() {
    let dir = folder();
    for (arguments, said) in [
        (vec!["--from", "1,2"], "3 numbers"),
        (vec!["--look-at", "1,2,inf"], "-1000000000 to 1000000000"),
        (vec!["--fov", "180"], "below 179.9"),
        (vec!["--fov", "-3"], "above 0.001"),
        (vec!["--up", "x"], "y, z or auto"),
        (vec!["--sun", "20"], "AZIMUTH,ELEVATION"),
        (vec!["--sun", "20,91"], "0 to 90"),
        (vec!["--sun", "20,-1"], "0 to 90"),
        (vec!["--background", "red"], "#rrggbb"),
        (vec!["--background", "-1,0,0"], "0 to 1e6"),
        (vec!["--env-rotation", "10"], "--env"),
        (vec!["--env", "a.exr", "--env-scale", "0"], "above 0"),
        (vec!["--env", "a.exr", "--background", "1,1,1"], "cannot be used with"),
        (vec!["--exposure", "bright"], "auto"),
    ] {
        let out = croupier(dir.path(), &[&["render", "mesh.obj"], &arguments[..]].concat());
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {error}");
        let flag = if arguments.len() == 2 { arguments[0] } else { "--env" };
        assert!(error.contains(said) && error.contains(flag), "{arguments:?}: {error}");
    }
}

/// Killed by: requests that a baked file cannot follow and are ignored, an error without its names.
#[test]
fn requests_that_cannot_be_followed_are_one_line() {
    let dir = folder();
    let dir = dir.path();
    baked(dir, "mesh.obj", &[], |_| {});
    for (arguments, said) in [
        (vec!["info", "b.crp", "--sun", "10,40"], vec!["b.crp", "`--sun`"]),
        (vec!["render", "b.crp", "--from", "1,2,3"], vec!["b.crp", "`--from`"]),
        (vec!["info", "scene.json", "--camera", "side"], vec!["scene.json", "`side`", "plan, round"]),
        (vec!["info", "mesh.obj", "--camera", "side"], vec!["mesh.obj", "`side`", "no named cameras"]),
        (vec!["info", "scene.json", "--camera", "plan", "--fov", "30"], vec!["scene.json", "perspective"]),
        (vec!["info", "mesh.obj", "--from", "1,2,3", "--look-at", "1,2,3"], vec!["mesh.obj", "1, 2, 3"]),
        (vec!["info", "mesh.obj", "--env", "no.exr"], vec!["cannot read no.exr", "--env"]),
    ] {
        let out = croupier(dir, &arguments);
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{arguments:?}: {error}");
        let last = error.lines().last().unwrap_or("");
        assert!(said.iter().all(|s| last.contains(s)), "{arguments:?}: {error}");
    }
}

/// Killed by: a flag without effect, or with the effect of another.
#[test]
fn flags_choose_camera_and_light() {
    let dir = folder();
    let dir = dir.path();
    let kinds = |s: &Scene<'_>| s.lights.iter().map(|l| l.kind).collect::<Vec<_>>();
    baked(dir, "scene.json", &["--camera", "plan"], |s| {
        assert_eq!((s.camera.kind, s.camera.size), (CameraKind::Orthographic as u32, [8, 8]));
        assert_eq!(s.camera.down.map(f32::abs), [0.0, 0.0, 1.5]);
    });
    baked(dir, "scene.json", &["--camera", "round"], |s| {
        assert_eq!((s.camera.kind, s.camera.size), (CameraKind::Panoramic as u32, [16, 8]));
    });
    baked(dir, "scene.json", &["--from", "-1,2,3", "--look-at", "-1,2,0", "--fov", "90"], |s| {
        assert_eq!((s.camera.origin, s.camera.forward), ([-1.0, 2.0, 3.0], [0.0, 0.0, -1.0]));
        assert!((s.camera.down[1] + 1.0).abs() < 1e-6);
        assert_eq!(kinds(s), [LightKind::Environment as u32]);
    });
    baked(dir, "scene.json", &["--sun", "-30,50"], |s| {
        assert_eq!(kinds(s), [LightKind::Sun as u32, LightKind::Environment as u32]);
        assert_eq!(s.triangles.len(), 1);
        assert!((s.lights[0].vector[1] - 50f32.to_radians().sin()).abs() < 1e-5 && s.lights[0].vector[0] < 0.0);
    });
    baked(dir, "mesh.obj", &["--background", "#ff0080", "--no-ground"], |s| {
        assert_eq!((s.triangles.len(), kinds(s)), (1, vec![LightKind::Environment as u32]));
        let [r, g, b] = s.environment.unwrap().radiance;
        assert!(r == 1.0 && g == 0.0 && (b - 0.2159).abs() < 1e-3, "{r} {g} {b}");
    });
    baked(dir, "mesh.obj", &["--up", "z"], |s| {
        assert!(s.triangles.len() > 1 && s.vertices.iter().skip(3).all(|v| v.p[2] < 0.0));
        assert_eq!(kinds(s).len(), 2);
    });
    let render = ["render", "mesh.obj", "--size", "16x12", "--spp", "1", "-o", "m.exr"];
    for exposure in ["auto", "0", "-3.5"] {
        let out = croupier(dir, &[&render[..], &["--exposure", exposure]].concat());
        assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
        std::fs::rename(dir.join("m.png"), dir.join(format!("{exposure}.png"))).unwrap();
        std::fs::rename(dir.join("m.exr"), dir.join(format!("{exposure}.exr"))).unwrap();
    }
    let read = |name: &str| std::fs::read(dir.join(name)).unwrap();
    assert!(read("auto.exr") == read("0.exr") && read("0.exr") == read("-3.5.exr"), "the EXR is not exposed");
    assert!(read("auto.png") != read("-3.5.png") && read("0.png") != read("-3.5.png"));
}

/// `--env` with rotation and scale: where the map's right, top and front (+x, +y, +z) are in the world. Killed by: a
/// rotation that is clockwise, in radians or about y where z is up, one before the map is set upright; a scale or texels
/// that are lost.
#[test]
fn environment_maps_are_turned_and_scaled() {
    let dir = folder();
    let dir = dir.path();
    std::fs::write(dir.join("sky.hdr"), hdr(4, 3, |x, y| if (x, y) == (1, 2) { [128, 64, 0, 131] } else { [0; 4] }))
        .unwrap();
    type Case = (&'static str, &'static str, &'static str, [[f32; 3]; 3]);
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let minus = |v: [f32; 3]| v.map(|x| 0.0 - x);
    let cases: [Case; 4] = [
        ("y", "0", "1", [x, y, z]),
        ("y", "90", "0.25", [minus(z), y, x]),
        ("z", "0", "2", [x, z, minus(y)]),
        ("z", "90", "1", [y, z, x]),
    ];
    for (up, turn, scale, wanted) in cases {
        let flags = ["--env", "sky.hdr", "--env-rotation", turn, "--env-scale", scale, "--up", up, "--no-ground"];
        baked(dir, "mesh.obj", &flags, |s| {
            let e = s.environment.unwrap();
            assert_eq!((e.width, e.height, e.radiance), (4, 3, [scale.parse().unwrap(); 3]), "{flags:?}");
            // rows of the map from the world are where its axes are in the world
            for (found, wanted) in e.to_local.iter().zip(wanted) {
                assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{flags:?}: {:?}", e.to_local);
            }
            for (i, t) in s.env_texels.iter().enumerate() {
                assert_eq!(*t, if i == 9 { [4.0, 2.0, 0.0] } else { [0.0; 3] }, "{flags:?}: texel {i}");
            }
        });
    }
}
