//! What the program makes of inputs that are nearly right, or extreme: pictures, quotes, bytes.
#![cfg(feature = "program")]

mod common;

use common::inputs::{File, GREY, QUOTED, RENDER, V, gltf, json, obj, quotes_little, run, t};
use common::{croupier, text};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

/// Words of 4000 bytes wherever a file or a flag has one that messages quote. Killed by: a message with an input as it is.
#[test]
fn long_inputs_are_quoted_in_part() {
    let long = "w".repeat(4000);
    let flag = format!("--{long}");
    let scene = |text: String| vec![t("scene.json", text), t("a.obj", format!("{V}usemtl m\nf 1 2 3\n"))];
    let of = |geometry: &str, materials: &str| json(geometry, "", materials);
    let rows: Vec<(Vec<File>, Vec<&str>)> = vec![
        (vec![t("a.obj", format!("{long}\n"))], vec!["a.obj"]),
        (vec![t("a.obj", format!("v 0 {long} 0\n"))], vec!["a.obj"]),
        (vec![t("a.obj", format!("{V}f 1 2 {long}\n"))], vec!["a.obj"]),
        (vec![t("a.obj", format!("o {long}\nv nan 0 0\n"))], vec!["a.obj"]),
        (vec![t("a.obj", format!("{V}usemtl {long}\nf 1 2 3\n"))], vec!["a.obj", "--strict"]),
        (vec![t("a.obj", format!("mtllib {long}\n{V}f 1 2 3\n"))], vec!["a.obj", "--strict"]),
        (obj(&format!("newmtl m\nKd {long} 1 1\n")), vec!["a.obj", "--strict"]),
        (obj(&format!("newmtl m\nillum {long}\n")), vec!["a.obj", "--strict"]),
        (obj(&format!("newmtl m\nmap_Kd {long}\n")), vec!["a.obj", "--strict"]),
        (obj(&format!("newmtl m\nmap_d {long}\n")), vec!["a.obj", "--strict"]),
        (scene(format!("{{\"{long}\": 1}}")), vec!["."]),
        (scene(format!("{{{long}")), vec!["."]),
        (of(r#"{"file": "a.obj"}"#, &format!(r#""m": {{"type": "{long}"}}"#)), vec!["."]),
        (of(r#"{"file": "a.obj"}"#, &format!(r#""{long}": {{"type": "diffuse"}}"#)), vec!["."]),
        (of(&format!(r#"{{"file": "{long}"}}"#), GREY), vec!["."]),
        (of(&format!(r#"{{"file": "a.obj", "type": "{long}"}}"#), GREY), vec!["."]),
        (gltf(&long), vec!["a.gltf", "--strict"]),
        (vec![t("a.gltf", format!(r#"{{"asset": {{"version": "{long}"}}}}"#))], vec!["a.gltf"]),
        (vec![t("a.ply", format!("ply\nformat {long} 1.0\nend_header\n"))], vec!["a.ply"]),
        (vec![t("a.ply", format!("ply\nformat ascii 1.0\nelement {long}\nend_header\n"))], vec!["a.ply"]),
        (vec![t("a.stl", format!("solid\nfacet normal 0 0 {long}\n"))], vec!["a.stl"]),
        (vec![t("a.obj", format!("{V}f 1 2 3\n"))], vec!["a.obj", "--camera", &long]),
        (vec![t("a.obj", format!("{V}f 1 2 3\n"))], vec!["a.obj", "--env", &long]),
        (vec![t("a.obj", format!("{V}f 1 2 3\n"))], vec!["a.obj", "--rrs", &long]),
        (vec![], vec![&long]),
        (vec![], vec!["a.obj", "--exposure", &long]),
        (vec![], vec!["a.obj", &flag]),
    ];
    for (i, (files, arguments)) in rows.into_iter().enumerate() {
        let (status, error, _dir) = run(&files, &[&["render"], &arguments[..], &RENDER[..]].concat());
        assert!(matches!(status, Some(1 | 2)), "row {i}: {status:?}: {error}");
        let whole = error.matches(&"w".repeat(QUOTED + 1)).count();
        assert_eq!(whole, 0, "row {i} quotes all of it: {error}");
        quotes_little(&error);
    }
}

/// Layers of a picture that was written, by name; its colours are those of the layer without one.
fn pixels(folder: &Path, layer: &str) -> Vec<[f32; 3]> {
    croupier_host::image::Picture::read_exr(&folder.join("x.exr")).unwrap().rgb(layer).unwrap().pixels
}

/// A C of eight corners keeps its notch, and its six triangles. Killed by: a fan around the first corner.
#[test]
fn polygons_keep_their_notches() {
    let corners = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [3, 2], [3, 3], [0, 3]];
    let vertices: String = corners.iter().map(|[x, y]| format!("v {x} {y} 0\n")).collect();
    let mut files = obj("newmtl m\nKd 1 0 0\n");
    files[0] = t("a.obj", format!("mtllib a.mtl\n{vertices}usemtl m\nf 1 2 3 4 5 6 7 8\n"));
    let view = ["--from", "1.5,1.5,10", "--look-at", "1.5,1.5,0", "--fov", "20", "--up", "y", "--size", "16x16"];
    let (status, error, dir) = run(&files, &[&["render", "a.obj", "--spp", "4", "-o", "x.exr"], &view[..]].concat());
    assert_eq!(status, Some(0), "{error}");
    let albedo = pixels(dir.path(), "albedo");
    let red = |column: usize, row: usize| albedo[16 * row + column][0] > 0.9 && albedo[16 * row + column][1] < 0.1;
    let found = [[3, 8], [10, 3], [10, 12], [10, 8]].map(|[column, row]| red(column, row));
    assert_eq!(found, [true, true, true, false], "the back, both arms, the notch");
    let said = croupier(dir.path(), &["info", "a.obj"]);
    // and the 64 of the ground
    assert!(
        text(&said.stdout).contains("70 triangles") || text(&said.stdout).contains("triangles: 70"),
        "{}",
        text(&said.stdout)
    );
}

/// Bytes behind the end of a JPEG, and infinite texels of a map: a note, and a picture as without them. Killed by: either
/// refused, let pass with `--strict` or without a note, or an infinity in the picture.
#[test]
fn images_that_are_nearly_right() {
    let with = |more: &[u8]| {
        let mut files = obj("newmtl m\nmap_Kd t.jpg\n");
        files.push(("t.jpg", [&grey_jpeg()[..], more].concat()));
        files
    };
    let render = [&["render", "a.obj"], &RENDER[..]].concat();
    let picture = |files: &[File], arguments: &[&str]| {
        let (status, notes, dir) = run(files, arguments);
        assert_eq!(status, Some(0), "{notes}");
        (notes, pixels(dir.path(), ""))
    };
    let (plain, wanted) = picture(&with(&[]), &render);
    let (notes, found) = picture(&with(b"more bytes"), &render);
    assert!(!plain.contains("t.jpg") && notes.contains("note: ") && notes.contains("t.jpg"), "{notes}");
    assert_eq!(found, wanted);
    let (status, error, _dir) = run(&with(b"more bytes"), &[&render[..], &["--strict"]].concat());
    assert!(status == Some(1) && error.contains("t.jpg"), "{error}");

    let dir = tempfile::tempdir().unwrap();
    let mut map = croupier_host::image::Picture::new(4, 2);
    let texel = |i: usize| if i == 5 { [f32::INFINITY, f32::NAN, 1.0] } else { [1.0; 3] };
    map.add3("", ["R", "G", "B"], &std::array::from_fn::<_, 8, _>(texel));
    map.write_exr(&dir.path().join("sky.exr")).unwrap();
    let files = [obj("newmtl m\n"), vec![("sky.exr", fs::read(dir.path().join("sky.exr")).unwrap())]].concat();
    let (notes, found) = picture(&files, &[&render[..], &["--env", "sky.exr"]].concat());
    assert!(notes.contains("sky.exr: 2 negative, NaN or infinite numbers were taken as 0"), "{notes}");
    assert!(found.iter().flatten().all(|x| x.is_finite()) && found.iter().flatten().any(|x| *x > 0.1), "{found:?}");
}

/// A baseline JPEG of 8 x 8 grey pixels.
fn grey_jpeg() -> Vec<u8> {
    let mut file = vec![0xff, 0xd8];
    let mut segment = |marker: u8, data: &[u8]| {
        file.extend([0xff, marker, 0, data.len() as u8 + 2]);
        file.extend(data);
    };
    segment(0xdb, &[&[0][..], &[1; 64]].concat());
    segment(0xc0, &[8, 0, 8, 0, 8, 1, 1, 0x11, 0]);
    // a code of one bit each: no difference, end of the block
    for table in [0x00, 0x10] {
        segment(0xc4, &[&[table, 1][..], &[0; 15], &[0]].concat());
    }
    segment(0xda, &[1, 1, 0, 0, 63, 0]);
    file.extend([0x3f, 0xff, 0xd9]);
    file
}

/// More threads than can be are refused with the most that can, a ring of gigabytes is confirmed with its bytes. Killed by:
/// threads that are started all the same, memory taken without a word.
#[test]
fn extreme_settings_are_refused_or_said() {
    let render = [&["render", "a.obj"], &RENDER[..]].concat();
    let (status, error, dir) = run(&obj("newmtl m\n"), &[&render[..], &["--threads", "5000"]].concat());
    assert!(status == Some(2) && error.contains("5000") && error.contains("4096"), "{status:?}: {error}");
    assert!(!dir.path().join("x.exr").exists());
    // it is not waited for: that memory is said before it is taken
    let large = ["render", "a.obj", "--ring", "16777216", "--shards", "2", "--rrs", "classic"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_croupier"));
    let mut child =
        child.args(large).current_dir(dir.path()).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let said = lines.into_iter().find(|l| l.contains("the render takes about")).unwrap_or_default();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(said.contains("the render takes about 6.") && said.contains("session and shards 6."), "{said}");
}
