//! The program from outside: exit status, one clear line of error, JSON.
#![cfg(feature = "program")]

mod common;

use bytemuck::{Zeroable, bytes_of};
use common::{croupier, text};
use croupier::unstable::scene::blob::{self, ALIGN, Camera, Header, SceneInfo, Section, SectionKind};
use croupier_host::image::Picture;
use std::path::Path;

/// Runs a command that must fail with status 1, says nothing on stdout and one line on stderr that holds `parts`.
fn fails(folder: &Path, arguments: &[&str], parts: &[&str]) {
    let out = croupier(folder, arguments);
    let error = text(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{arguments:?}: {error}");
    assert_eq!(error.lines().count(), 1, "{arguments:?}: {error}");
    assert!(error.starts_with("croupier: ") && out.stdout.is_empty(), "{arguments:?}: {error}");
    for part in parts {
        assert!(error.contains(part), "{arguments:?}: {error:?} does not say {part:?}");
    }
}

/// The smallest scene: a camera that looks into the void.
fn empty_scene(max_depth: u32) -> Vec<u8> {
    let info = SceneInfo { max_depth, ..SceneInfo::zeroed() };
    let camera = Camera {
        kind: 0,
        origin: [0.0; 3],
        forward: [0.0, 0.0, -1.0],
        right: [0.5, 0.0, 0.0],
        down: [0.0, -0.5, 0.0],
        lens_radius: 0.0,
        focus_distance: 1.0,
        size: [20, 10],
    };
    let parts = [(SectionKind::Info, bytes_of(&info)), (SectionKind::Cameras, bytes_of(&camera))];
    let mut body = Vec::new();
    let first = (size_of::<Header>() + parts.len() * size_of::<Section>()).next_multiple_of(ALIGN);
    let mut table = Vec::new();
    for (kind, bytes) in parts {
        let offset = (first + body.len()) as u64;
        table.push(Section { kind: kind as u32, stride: bytes.len() as u32, offset, count: 1 });
        body.extend_from_slice(bytes);
        body.resize(body.len().next_multiple_of(ALIGN), 0);
    }
    let mut rest: Vec<u8> = table.iter().flat_map(|s| bytes_of(s).to_vec()).collect();
    rest.resize(first - size_of::<Header>(), 0);
    rest.extend_from_slice(&body);
    let header = Header {
        magic: blob::MAGIC,
        version: blob::VERSION,
        sections: parts.len() as u32,
        length: (size_of::<Header>() + rest.len()) as u64,
        hash: blob::content_hash(&rest),
        reserved: [0; 8],
    };
    [bytes_of(&header), &rest].concat()
}

/// Killed by: an argument that goes unchecked. All of these are usage errors, status 2, before anything is read or written.
#[test]
fn usage_errors_are_status_2() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, said) in [
        (vec!["render", "--size", "0x0"], "at least 1x1"),
        (vec!["render", "--size", "640"], "640x480"),
        (vec!["render", "--size", "99999x99999"], "2^30"),
        (vec!["render", "--spp", "0"], "--spp"),
        (vec!["render", "--spp", "4", "--seconds", "2"], "cannot be used with"),
        (vec!["render", "--rays", "4", "--until-error", "2"], "cannot be used with"),
        (vec!["render", "--seconds", "-1"], "above 0"),
        (vec!["render", "--until-error", "nan"], "above 0"),
        (vec!["render", "--rrs", "magic"], "known are none, threshold"),
        (vec!["render", "--rrs", "fixed:0.01"], "0.05 to 20"),
        (vec!["render", "--max-depth", "0"], "--max-depth"),
        (vec!["render", "--max-depth", "201"], "from 1 to 200"),
        (vec!["render", "--shards", "0"], "--shards"),
        (vec!["render", "-o", "picture.jpg"], "must end in .exr"),
        (vec!["render", "--exposure", "inf"], "-100 and 100"),
        (vec!["bake", "a.obj", "-o", "a.obj"], "must end in .crp"),
        (vec!["bake", "a.obj"], "--output"),
        (vec!["compare", "a.exr"], "REFERENCE"),
        (vec!["compare", "a.exr", "b.exr", "--exposure", "nan"], "-100 and 100"),
        (vec!["compare", "a.exr", "b.exr", "--stderr-image", "c.exr", "--seed-image", "d.exr"], "cannot be used with"),
        (vec!["dance"], "dance"),
        (vec!["--spp", "0"], "--spp"),
    ] {
        let out = croupier(dir.path(), &arguments);
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(said) && out.stdout.is_empty(), "{arguments:?}: {error}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    for arguments in [vec!["--help"], vec!["render", "--help"], vec!["--version"]] {
        let out = croupier(dir.path(), &arguments);
        assert_eq!(out.status.code(), Some(0));
        assert!(text(&out.stdout).contains("croupier"));
    }
}

/// Killed by: an error without its file, or of more than a line.
#[test]
fn runtime_errors_are_one_line_and_status_1() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.join(name), bytes).unwrap();
    let good = empty_scene(7);
    write("good.crp", &good);
    write("empty.crp", b"");
    write("garbage.crp", &[7; 500]);
    write("cut.crp", &good[..good.len() - 1]);
    write("far.obj", b"v 0 0 0\nv 1e30 0 0\nv 0 1 0\nf 1 2 3\n");
    std::fs::create_dir(dir.join("folder.crp")).unwrap();

    fails(dir, &["info", "missing.crp"], &["cannot read missing.crp", "No such file"]);
    fails(dir, &["info", "folder.crp"], &["folder.crp", "not a file"]);
    fails(dir, &["info", "empty.crp"], &["empty.crp", "the file is empty"]);
    fails(dir, &["info", "garbage.crp"], &["garbage.crp", "CROUPIER"]);
    fails(dir, &["render", "garbage.crp"], &["garbage.crp", "CROUPIER"]);
    fails(dir, &["render", "cut.crp"], &["cut.crp", &good.len().to_string()]);
    fails(dir, &["bake", "cut.crp", "-o", "new.crp"], &["cut.crp"]);
    fails(dir, &["bake", "good.crp", "-o", "no/where.crp"], &["no/where.crp"]);
    fails(dir, &["info", "far.obj"], &["croupier: far.obj: camera: origin is ", "e30, it must be from -1e9 to 1e9"]);
    fails(
        dir,
        &["info", "good.crp", "--single-scattering"],
        &["good.crp", "--single-scattering", "not for baked files"],
    );
    fails(dir, &["render", "good.crp", "-o", "no/where.exr"], &["no/where.exr", "not a folder"]);
    fails(dir, &["compare", "missing.exr", "good.crp"], &["missing.exr"]);
    fails(dir, &["compare", "good.crp", "good.crp"], &["good.crp", "not a readable EXR"]);
    assert!(!dir.join("new.crp").exists() && !dir.join("croupier.exr").exists());
}

/// Killed by: a wrong fact, a blob that changes on its way through the program.
#[test]
fn info_and_bake_of_a_baked_scene() {
    let dir = tempfile::tempdir().unwrap();
    let good = empty_scene(7);
    std::fs::write(dir.path().join("good.crp"), &good).unwrap();
    let out = croupier(dir.path(), &["info", "good.crp", "--json"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(json["bytes"], good.len());
    assert_eq!(json["triangles"], 0);
    assert_eq!(json["size"], serde_json::json!([20, 10]));
    assert_eq!(json["max_depth"], 7);
    assert_eq!(json["longest_path"], 7);
    assert_eq!(json["effects"], serde_json::json!([]));
    let words = text(&croupier(dir.path(), &["info", "good.crp"]).stdout);
    assert!(words.contains("20x10 pixels, paths of up to 7 segments"), "{words}");

    let out = croupier(dir.path(), &["bake", "good.crp", "-o", "again.crp", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(json["bytes"], good.len());
    assert_eq!(std::fs::read(dir.path().join("again.crp")).unwrap(), good);
}

/// Killed by: a limit of path segments without a note, or a note to somebody who asked for fewer.
#[test]
fn paths_shorter_than_asked_for_are_noted() {
    let dir = tempfile::tempdir().unwrap();
    for (max_depth, limited) in [(200, false), (1000, true)] {
        std::fs::write(dir.path().join("deep.crp"), empty_scene(max_depth)).unwrap();
        let words = text(&croupier(dir.path(), &["info", "deep.crp"]).stdout);
        assert!(words.contains("paths of up to 200 segments"), "{words}");
        assert_eq!(words.contains("(the scene asks for 1000)"), limited, "{words}");
        let render = ["render", "deep.crp", "--spp", "1", "-o", "d.exr", "--json"];
        let out = croupier(dir.path(), &render);
        let (said, json) = (text(&out.stderr), text(&out.stdout));
        let note = "paths end after 200 segments, the scene asks for 1000";
        assert_eq!((said.contains(note), json.contains(note)), (limited, limited), "{said} {json}");
        let out = croupier(dir.path(), &[&render[..], &["--max-depth", "200"]].concat());
        assert!(out.status.success() && out.stderr.is_empty());
    }
}

/// A quad, a line, a triangle without area on an emitter and a smooth one with a normal of length 0, without a camera.
const DOUBTFUL: &str = "mtllib doubtful.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vn 0 0 0
usemtl foggy
f 1 2 3 4
f 1//1 2//1 4//1
l 1 2
usemtl emitter
f 1 2 2
";

/// Rough materials of a bare OBJ file are compensated unless the user says otherwise. Killed by: another default, a flag
/// that a command ignores.
#[test]
fn single_scattering_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    std::fs::write(dir.join("t.obj"), "mtllib t.mtl\nv 0 0 0\nv 7 0 0\nv 0 7 0\nusemtl m\nf 1 2 3\n").unwrap();
    std::fs::write(dir.join("t.mtl"), "newmtl m\nKd 0.5 0.5 0.5\nPm 1\nPr 0.5\n").unwrap();
    let compensated = |scene: &str, flags: &[&str]| {
        let out = croupier(dir, &[&["info", scene, "--json"], flags].concat());
        assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
        text(&out.stdout).contains("multiple scattering")
    };
    assert!(compensated("t.obj", &[]) && !compensated("t.obj", &["--single-scattering"]));
    for flag in [&["--single-scattering"][..], &[]] {
        let bake = [&["bake", "t.obj", "-o", "t.crp"], flag].concat();
        assert_eq!(croupier(dir, &bake).status.code(), Some(0));
        assert_eq!(compensated("t.crp", &[]), flag.is_empty());
    }
}

/// What loading and baking assumed or left out is said by every command that opens a scene. Killed by: a report that is
/// dropped, a count that is left out, notes on stdout.
#[test]
fn notes_about_a_scene_are_printed() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let materials = "newmtl foggy\nKd 2 0 0\nd 0.75\nnewmtl emitter\nKe 1 1 1\n";
    std::fs::write(dir.join("doubtful.obj"), DOUBTFUL).unwrap();
    std::fs::write(dir.join("doubtful.mtl"), materials).unwrap();
    let said = [
        "has no camera",
        "has no light: sun and sky were added",
        "a ground was added",
        "`foggy`: opacity 0.75 was taken as 1",
        "`foggy`: reflectance [2, 0, 0] was limited",
        "more than three corners, split into triangles: 1",
        "points and lines, left out: 1",
        "triangles without area, left out: 1",
        "would have been lights: 1",
        "normal of length 0, shaded flat: 1",
    ];
    let counts = ["dropped_lights", "dropped_triangles", "flattened", "skipped_elements", "split_polygons"];
    let counts = serde_json::Value::Object(counts.iter().map(|n| (n.to_string(), 1.into())).collect());
    let render = ["render", "doubtful.obj", "--size", "8x8", "--spp", "1", "-o", "d.exr", "--json"];
    let bake = ["bake", "doubtful.obj", "-o", "d.crp", "--json"];
    for arguments in [&render[..], &bake, &["info", "doubtful.obj", "--json"]] {
        let out = croupier(dir, arguments);
        let notes = text(&out.stderr);
        assert_eq!(out.status.code(), Some(0), "{notes}");
        assert_eq!(notes.lines().count(), said.len(), "{notes}");
        assert!(notes.lines().all(|l| l.starts_with("croupier: note: doubtful.obj: ")), "{notes}");
        let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        for part in said {
            assert!(notes.contains(part), "{notes}: {part}");
            assert!(json["notes"].as_array().unwrap().iter().any(|n| n.as_str().unwrap().contains(part)), "{json}");
        }
        assert_eq!(json["scene_counts"], counts);
    }
    // said when it was baked
    let out = croupier(dir, &["info", "d.crp", "--json"]);
    assert!(out.status.success() && out.stderr.is_empty(), "{}", text(&out.stderr));
    assert_eq!(serde_json::from_slice::<serde_json::Value>(&out.stdout).unwrap()["notes"], serde_json::json!([]));
}

fn picture(level: f32, stderr: Option<f32>) -> Picture {
    let mut picture = Picture::new(32, 24);
    // A pattern of mean 0 within each block: noise without noise.
    let pixel = |i: usize| [level + if i & 1 == 0 { 0.01 } else { -0.01 }; 3];
    picture.add3("", ["R", "G", "B"], &(0..32 * 24).map(pixel).collect::<Vec<_>>());
    if let Some(stderr) = stderr {
        picture.add3("stderr", ["R", "G", "B"], &[[stderr; 3]; 32 * 24]);
    }
    picture
}

/// Standard errors come from a layer of the image, a file beside the reference, an argument, or the spread of seeds.
/// Killed by: one of these sources ignored.
#[test]
fn compare_finds_the_standard_errors() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, p: &Picture| p.write_exr(&dir.path().join(name)).unwrap();
    write("image.exr", &picture(1.02, Some(0.03)));
    write("bare.exr", &picture(1.02, None));
    write("ref.exr", &picture(1.0, None));
    write("se.exr", &picture(0.04, None));
    let json = |arguments: &[&str]| -> serde_json::Value {
        let out = croupier(dir.path(), &[&["compare", "--json"], arguments].concat());
        assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
        assert_eq!(text(&out.stdout).lines().count(), 1);
        serde_json::from_slice(&out.stdout).unwrap()
    };
    let mean_z = |v: &serde_json::Value| v["bias"]["mean"].as_f64().unwrap();
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-3 * b.abs(), "{a} {b}");

    let found = json(&["image.exr", "ref.exr"]);
    near(found["mse"].as_f64().unwrap(), 4e-4);
    near(found["ratio"]["value"].as_f64().unwrap(), 1.02);
    near(mean_z(&found), 0.02 / (0.03 / 8.0));
    assert!(found["relmse_of_reference"].is_null());

    assert!(json(&["bare.exr", "ref.exr"])["bias"].is_null());
    // se.exr alternates 0.05 and 0.03: mean square 0.0017.
    let both = 0.02 / ((0.0017 + 0.0009f64).sqrt() / 8.0);
    near(mean_z(&json(&["image.exr", "ref.exr", "--stderr-reference", "se.exr"])), both);
    near(mean_z(&json(&["bare.exr", "ref.exr", "--stderr-image", "se.exr"])), 0.02 / (0.0017f64.sqrt() / 8.0));
    write("ref_stderr.exr", &picture(0.04, None));
    near(mean_z(&json(&["image.exr", "ref.exr"])), both);
    assert!(json(&["image.exr", "ref.exr"])["relmse_of_reference"].as_f64().unwrap() > 0.0);

    // Two seeds 1.02 and 1.04: mean 1.03, standard error of each pixel 0.01.
    write("seed2.exr", &picture(1.04, None));
    let seeds = json(&["bare.exr", "ref.exr", "--seed-image", "seed2.exr"]);
    assert_eq!(seeds["images"], 2);
    near(mean_z(&seeds), 0.03 / ((0.0017 + 0.0001f64).sqrt() / 8.0));

    let words = text(&croupier(dir.path(), &["compare", "image.exr", "ref.exr"]).stdout);
    assert!(words.contains("relMSE") && words.contains("FLIP") && words.contains("beyond 3"), "{words}");
    let mut small = Picture::new(16, 24);
    small.add3("", ["R", "G", "B"], &[[1.0; 3]; 16 * 24]);
    write("small.exr", &small);
    fails(dir.path(), &["compare", "small.exr", "ref.exr"], &["small.exr", "16x24 and 32x24"]);
}
