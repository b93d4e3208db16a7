//! `croupier lightmap` and `croupier probes`, as a user calls them.
#![cfg(feature = "program")]

mod common;

use common::text;
use croupier_host::image::Picture;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn croupier(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_croupier")).args(arguments).current_dir(folder).output().unwrap()
}

/// Two sheets with texture coordinates, one without, under a white environment.
const OBJ: &str = "v -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.5\nvt 3 3\n\
    o floor\nusemtl m\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n\
    o same\nusemtl m\nf 1/1 2/2 3/3\n\
    o flat\nusemtl m\nf 1/5 2/5 3/5\n\
    o tiled\nusemtl m\nf 1/1 2/2 3/6\n";
const SCENE: &str = r#"{ "geometry": { "file": "t.obj" }, "materials": { "m": { "type": "diffuse", "reflectance": [0, 0, 0] } },
  "camera": { "origin": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 40, "width": 8, "height": 6 },
  "emitters": [{ "type": "constant", "radiance": [1, 1, 1] }] }"#;

fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("t.obj"), OBJ).unwrap();
    fs::write(dir.path().join("scene.json"), SCENE).unwrap();
    dir
}

/// Killed by: layers that are missing, a size that is not the map's, an EXR without its PNG, figures on stderr.
#[test]
fn a_lightmap_is_an_exr_and_a_png() {
    let dir = tempfile::tempdir().unwrap();
    let arguments =
        ["lightmap", "cornell", "--object", "floor", "--size", "12x10", "--spp", "4", "--denoise", "-o", "f.exr"];
    let out = croupier(dir.path(), &arguments);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("12x10 texels, 1 charts: 120 texels sampled"), "{}", text(&out.stdout));
    let picture = Picture::read_exr(&dir.path().join("f.exr")).unwrap();
    assert_eq!((picture.width, picture.height), (12, 10));
    let mut layers: Vec<&str> = picture.layers.iter().map(|l| &*l.name).collect();
    layers.sort_unstable();
    let wanted = ["", "backs", "coverage", "direct", "indirect", "normal", "origin", "raw", "samples", "stderr"];
    assert_eq!(layers, wanted);
    assert!(picture.rgb("").unwrap().pixels.iter().all(|p| p[0] > 0.0 && p[0] < 100.0));
    assert!(picture.layer("samples").unwrap().channels[0].values.iter().all(|n| *n == 4.0));
    assert!(dir.path().join("f.png").is_file());
    let out = croupier(dir.path(), &[&arguments[..], &["--json"]].concat());
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((json["sampled_texels"].as_u64(), json["spp"].as_u64()), (Some(120), Some(4)));
}

/// Killed by: a file of probes that no program reads, a grid with other places, probes without a place.
#[test]
fn probes_are_json() {
    let dir = tempfile::tempdir().unwrap();
    let out = croupier(dir.path(), &["probes", "cornell", "--grid", "2x1x3", "--spp", "64", "-o", "p.json"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("6 probes"), "{}", text(&out.stdout));
    let read =
        || -> serde_json::Value { serde_json::from_slice(&fs::read(dir.path().join("p.json")).unwrap()).unwrap() };
    let probes = read();
    assert_eq!(probes["probes"].as_array().map(Vec::len), Some(6));
    assert_eq!(probes["probes"][1]["position"][0].as_f64(), Some(0.5));
    assert!(probes["probes"][0]["coefficients"][0][0].as_f64().is_some_and(|c| c > 0.0));
    let arguments = ["probes", "cornell", "--at", "-0.5,1,0", "--at", "0.5,1.5,0.25", "--spp", "64", "-o", "p.json"];
    let out = croupier(dir.path(), &arguments);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert_eq!(read()["probes"][1]["position"].as_array().map(Vec::len), Some(3));
}

/// Killed by: an error without file or object, a map that is written over what was read, a status other than 1 or 2.
#[test]
fn errors_name_object_and_file() {
    let dir = folder();
    let map = |object: &str, more: &[&str]| {
        let arguments = [&["lightmap", "scene.json", "--object", object, "--size", "8x8", "--spp", "1"], more].concat();
        let out = croupier(dir.path(), &arguments);
        (out.status.code(), text(&out.stderr), text(&out.stdout))
    };
    for (object, said) in [
        ("flor", "scene.json: there is no object `flor`; there are `floor`, `same`, `flat`, `tiled`"),
        ("flat", "scene.json: object `flat` has no texture coordinates: none of its 1 triangles has an area in them"),
        ("tiled", "scene.json: object `tiled`: 1 of 1 triangles have texture coordinates outside of 0 to 1"),
    ] {
        let (status, stderr, _) = map(object, &[]);
        assert!(status == Some(1) && stderr.contains(said), "{object}: {stderr}");
    }
    let (status, stderr, stdout) = map("floor", &["--object", "same"]);
    let overlap = "charts of the objects `floor` and `same` overlap in 36 texels: 2 triangles";
    assert!(status == Some(0) && stderr.contains(overlap) && stdout.contains("wrote lightmap.exr"), "{stderr}{stdout}");
    let (status, stderr, _) = map("floor", &["--object", "same", "--strict"]);
    assert!(status == Some(1) && stderr.contains(overlap), "{stderr}");
    // an output that was read
    fs::copy(dir.path().join("lightmap.exr"), dir.path().join("sky.exr")).unwrap();
    let before = fs::read(dir.path().join("sky.exr")).unwrap();
    let (status, stderr, _) = map("floor", &["--env", "sky.exr", "-o", "sky.exr"]);
    assert!(status == Some(1) && stderr.contains("cannot write sky.exr: it is sky.exr, which was read"), "{stderr}");
    assert_eq!(fs::read(dir.path().join("sky.exr")).unwrap(), before);
    assert_eq!(map("floor", &["-o", "map.png"]).0, Some(2));
    let out = croupier(dir.path(), &["probes", "scene.json", "-o", "p.json"]);
    assert!(out.status.code() == Some(2) && text(&out.stderr).contains("--grid"), "{}", text(&out.stderr));
    let out = croupier(dir.path(), &["probes", "scene.json", "--grid", "2x0x2"]);
    assert!(out.status.code() == Some(2) && text(&out.stderr).contains("NxNxN"), "{}", text(&out.stderr));
    assert_eq!(croupier(dir.path(), &["bake", "scene.json", "-o", "b.crp"]).status.code(), Some(0));
    let out = croupier(dir.path(), &["lightmap", "b.crp", "--object", "floor"]);
    assert!(text(&out.stderr).contains("b.crp: baked files have no names of objects"), "{}", text(&out.stderr));
}
