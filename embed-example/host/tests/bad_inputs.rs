//! Files that are wrong, or nearly right: for each the exit status and the message. One row an input.
#![cfg(feature = "program")]

mod common;

use common::inputs::{File, GREY, RENDER, V, gltf, json, obj, quotes_little, run, t};
use common::{croupier, hdr, png, small_png, text};
use std::fs;
use std::path::Path;
use std::process::Command;

fn utf16(text: &str) -> Vec<u8> {
    text.encode_utf16().flat_map(u16::to_le_bytes).collect()
}

/// An environment map of 16 x 16 pixels: 3 KiB.
fn sky() -> Vec<u8> {
    hdr(16, 16, |_, _| [64, 64, 64, 128])
}

/// Name of the case, files, arguments, and what the last line must contain.
type Refused = (&'static str, Vec<File>, Vec<&'static str>, Vec<&'static str>);

/// What is no scene, or asks for what the machine has not, is an error before anything is rendered: status 1, one last
/// line that says what is wrong, no file written. Killed by: any of these inputs rendered, refused without its reason,
/// or refused by a panic.
#[test]
fn refused() {
    let zeros = |n: usize| vec![0u8; n];
    let rows: Vec<Refused> = vec![
        (
            "nothing",
            vec![t("a.obj", "")],
            vec!["a.obj"],
            vec!["a.obj is no scene, it has no triangles", "nothing in it"],
        ),
        ("comments", vec![t("a.obj", "# empty\n\n")], vec!["a.obj"], vec!["nothing in it"]),
        (
            "prose",
            vec![t("a.obj", "Dear reader,\nall is well.\n")],
            vec!["a.obj"],
            vec!["no line of OBJ", "line 1 begins with `Dear`"],
        ),
        (
            "points",
            vec![t("a.obj", format!("{V}p 1 2 3\nl 1 2\n"))],
            vec!["a.obj"],
            vec!["3 vertices, 2 points and lines, no faces"],
        ),
        (
            "surfaces",
            vec![t("a.obj", format!("{V}cstype bezier\nsurf 0 1 0 1 1 2 3\n"))],
            vec!["a.obj"],
            vec!["free-form", "`cstype` in line 4"],
        ),
        (
            "faces of two corners",
            vec![t("a.obj", format!("{V}f 1 2\n"))],
            vec!["a.obj"],
            vec!["no triangles", "no faces"],
        ),
        (
            "no area",
            vec![t("a.obj", format!("{V}f 1 1 2\nf 3 3 3\n"))],
            vec!["a.obj"],
            vec!["a.obj: none of the 2 triangles has an area"],
        ),
        ("a PNG", vec![("a.obj", small_png())], vec!["a.obj"], vec!["cannot use a.obj: it is a PNG image"]),
        ("a JPEG", vec![("a.obj", vec![0xff, 0xd8, 0xff, 0xe0])], vec!["a.obj"], vec!["it is a JPEG image"]),
        ("a blob", vec![("a.obj", b"CROUPIER\x03\0\0\0".to_vec())], vec!["a.obj"], vec!["it is a baked scene"]),
        ("an archive", vec![("a.obj", b"PK\x03\x04......".to_vec())], vec!["a.obj"], vec!["ZIP archive"]),
        (
            "random bytes",
            vec![("a.obj", (0..999u32).map(|i| (i.wrapping_mul(2654435761) >> 13) as u8).collect())],
            vec!["a.obj"],
            vec!["it is no text: byte"],
        ),
        (
            "UTF-16",
            vec![("a.obj", utf16(&format!("\u{feff}{V}f 1 2 3\n")))],
            vec!["a.obj"],
            vec!["UTF-16 text (save it as UTF-8)"],
        ),
        (
            "UTF-16 without mark",
            vec![("a.obj", utf16(&format!("{V}f 1 2 3\n")))],
            vec!["a.obj"],
            vec!["UTF-16 text (save it as UTF-8)"],
        ),
        ("UTF-16 JSON", vec![("scene.json", utf16("\u{feff}{}"))], vec!["."], vec!["scene.json", "UTF-16"]),
        (
            "UTF-16 MTL",
            {
                let mut f = obj("");
                f[1].1 = utf16("\u{feff}newmtl m\n");
                f
            },
            vec!["a.obj"],
            vec!["a.mtl", "UTF-16"],
        ),
        ("other extension", vec![t("a.fbx", "x")], vec!["a.fbx"], vec!["a.fbx is neither a folder"]),
        ("a folder as OBJ", vec![t("a.obj/b", "x")], vec!["a.obj"], vec!["scene.json", "No such file"]),
        ("NaN", vec![t("a.obj", "v 0 0 0\nv nan 0 0\n")], vec!["a.obj"], vec!["a.obj:2", "`v` number 2 is nan"]),
        ("index", vec![t("a.obj", format!("{V}f 1 2 9\n"))], vec!["a.obj"], vec!["a.obj:4", "no vertex 9, only 3"]),
        (
            "far away",
            vec![t("a.obj", "v 0 0 0\nv 3e30 0 0\nv 0 1 0\nf 1 2 3\n")],
            vec!["a.obj"],
            vec!["a.obj: camera: origin is", "e30, it must be from -1e9 to 1e9"],
        ),
        (
            "a word of a megabyte",
            vec![t("a.obj", format!("v 0 0 {}\n", "x".repeat(1 << 20)))],
            vec!["a.obj"],
            vec!["a.obj:1", "xxx...` is not a number"],
        ),
        (
            "an escape sequence",
            vec![t("a.obj", "v 0 0 \x1b[31mred\n")],
            vec!["a.obj"],
            vec!["`\\u{1b}[31mred` is not a number"],
        ),
        (
            "a name of a megabyte",
            vec![t("a.obj", format!("o {}\n{V}f 7 8 9\n", "x".repeat(1 << 20)))],
            vec!["a.obj"],
            vec!["x...`: there is no vertex 7"],
        ),
        ("no geometry", json("{}", "", GREY), vec!["."], vec!["geometry", "`file` is missing"]),
        (
            "geometry of an unknown kind",
            json(r#"{"type": "sphere", "radius": 1}"#, "", GREY),
            vec!["."],
            vec!["geometry.type", "unknown kind of geometry `sphere`"],
        ),
        (
            "an empty geometry",
            {
                let mut f = json(r#"{"file": "a.obj"}"#, "", GREY);
                f[1].1 = V.into();
                f
            },
            vec!["."],
            vec!["a.obj is no scene", "3 vertices"],
        ),
        (
            "field of view",
            json(
                r#"{"file": "a.obj"}"#,
                r#""origin": [0,0,5], "target": [0,0,0], "up": [0,1,0], "vfov_deg": 3000, "width": 8, "height": 8"#,
                GREY,
            ),
            vec!["."],
            vec![
                "scene.json: camera: vertical field of view in degrees is 3000, it must be above 0.001 and below 179.9",
            ],
        ),
        (
            "up along the axis",
            json(
                r#"{"file": "a.obj"}"#,
                r#""origin": [0,0,5], "target": [0,0,0], "up": [0,0,1], "vfov_deg": 30, "width": 8, "height": 8"#,
                GREY,
            ),
            vec!["."],
            vec!["scene.json: camera: sine of angle between axis and up is 0, it must be above 1e-6"],
        ),
        (
            "reflectance",
            json(r#"{"file": "a.obj"}"#, "", r#""m": {"type": "diffuse", "reflectance": [1e30,0,0]}"#),
            vec!["."],
            vec!["material `m`: reflectance is 1e30, it must be from 0 to 1"],
        ),
        (
            "a key of a kilobyte",
            json(r#"{"file": "a.obj"}"#, "", &format!(r#""{}": {{"type": "wool"}}"#, "k".repeat(1000))),
            vec!["."],
            vec!["scene.json", "kkk...", "unknown material type `wool`"],
        ),
        (
            "deep JSON",
            vec![t("scene.json", "[".repeat(100_000))],
            vec!["."],
            vec!["scene.json", "not JSON: recursion limit"],
        ),
        (
            "a cut PNG",
            {
                let mut f = obj("newmtl m\nmap_Kd t.png\n");
                f.push(("t.png", small_png()[..60].to_vec()));
                f
            },
            vec!["a.obj"],
            vec!["t.png", "a.mtl:2 (material `m`)", "not a readable PNG"],
        ),
        (
            "a bomb",
            {
                let mut f = obj("newmtl m\nmap_Kd t.png\n");
                f.push(("t.png", png(60_000, 60_000, &zeros(70_000))));
                f
            },
            vec!["a.obj"],
            vec!["t.png", "60000 x 60000 pixels take 16.8 GiB to decode, 2.00 GiB of the texture memory are free"],
        ),
        (
            "texture memory",
            {
                let mut f = obj("newmtl m\nmap_Kd t.png\n");
                f.push(("t.png", small_png()));
                f
            },
            vec!["a.obj", "--texture-memory", "16KiB"],
            vec!["64 x 64 pixels take 20.0 KiB to decode, 16.0 KiB of the texture memory are free"],
        ),
        (
            "texture memory in all",
            {
                let mut f = vec![
                    t("a.obj", format!("mtllib a.mtl\n{V}usemtl m\nf 1 2 3\nusemtl n\nf 3 2 1\n")),
                    t("a.mtl", "newmtl m\nmap_Kd t.png\nnewmtl n\nmap_Kd u.png\n"),
                ];
                f.extend([("t.png", small_png()), ("u.png", small_png())]);
                f
            },
            vec!["a.obj", "--texture-memory", "24KiB"],
            vec!["u.png", "take 20.0 KiB to decode, 8.00 KiB of"],
        ),
        (
            "texture memory of a texture that is made of others",
            {
                let mut f = obj("newmtl m\nmap_Pr t.png\n");
                f.push(("t.png", small_png()));
                f
            },
            vec!["a.obj", "--texture-memory", "24KiB"],
            vec!["a.mtl: material `m`: roughness and metalness", "take 16.0 KiB to decode, 8.00 KiB of"],
        ),
        (
            "texture memory of an environment map",
            [obj("newmtl m\n"), vec![("sky.hdr", sky())]].concat(),
            vec!["a.obj", "--env", "sky.hdr", "--texture-memory", "2KiB"],
            vec!["sky.hdr, which --env names: 16 x 16 pixels take 3.00 KiB to decode, 2.00 KiB of"],
        ),
        (
            "texture memory of an environment map and a texture",
            [obj("newmtl m\nmap_Kd t.png\n"), vec![("sky.hdr", sky()), ("t.png", small_png())]].concat(),
            vec!["a.obj", "--env", "sky.hdr", "--texture-memory", "21KiB"],
            vec!["t.png", "take 20.0 KiB to decode, 18.0 KiB of"],
        ),
        (
            "an environment map of another case, strictly",
            [obj("newmtl m\n"), vec![("sky.hdr", sky())]].concat(),
            vec!["a.obj", "--env", "Sky.hdr", "--strict"],
            vec!["cannot read Sky.hdr, which --env names"],
        ),
        (
            "a picture larger than memory",
            obj("newmtl m\n"),
            vec!["a.obj", "--size", "32768x32768", "--shards", "65536", "--ring", "1000000", "--rrs", "classic"],
            vec!["the render takes about", "this machine has", "--ring"],
        ),
    ];
    for (name, files, arguments, parts) in rows {
        let all = [&["render"], &RENDER[..4], &arguments[..]].concat();
        // A later --size counts, an earlier one would be given twice.
        let all = if arguments.contains(&"--size") { [&["render"], &arguments[..]].concat() } else { all };
        let (status, error, dir) = run(&files, &[&all[..], &["-o", "x.exr"]].concat());
        assert_eq!(status, Some(1), "{name}: {error}");
        let last = error.lines().last().unwrap_or_default();
        assert!(last.starts_with("croupier: ") && !last.contains("note:"), "{name}: {error}");
        assert!(last.len() < 700 && last.chars().all(|c| !c.is_control()), "{name}: {} bytes: {error}", last.len());
        quotes_little(&error);
        for part in parts {
            assert!(last.contains(part), "{name}: {last:?} does not say {part:?}");
        }
        assert!(!dir.path().join("x.exr").exists() && !dir.path().join("x.png").exists(), "{name}");
    }
}

/// Name of the case, files, what notes say, and what the error of `--strict` says.
type Replaced = (&'static str, Vec<File>, Vec<&'static str>, &'static str);

/// What is nearly right is rendered with a note that says what was done, where; with `--strict` it is an error that
/// says the same. Killed by: a file that is refused, replaced without a note, or let pass by `--strict`.
#[test]
fn replaced_with_a_note() {
    let with = |mtl: &str, more: Vec<File>| [obj(mtl), more].concat();
    let rows: Vec<Replaced> = vec![
        (
            "no library",
            vec![t("a.obj", format!("mtllib no.mtl\n{V}usemtl m\nf 1 2 3\n"))],
            vec!["cannot read no.mtl, which a.obj:1 names", "grey"],
            "cannot read no.mtl, which a.obj:1 names",
        ),
        (
            "no texture",
            obj("newmtl m\nmap_Kd no.png\n"),
            vec!["cannot read no.png, which a.mtl:2 (material `m`) names", "without it"],
            "cannot read no.png, which a.mtl:2 (material `m`) names",
        ),
        (
            "library of another case",
            vec![t("a.obj", format!("mtllib A.MTL\n{V}usemtl m\nf 1 2 3\n")), t("a.mtl", "newmtl m\n")],
            vec!["A.MTL", "a.obj:1", "a.mtl was taken"],
            "cannot read A.MTL, which a.obj:1 names",
        ),
        (
            "texture of another case",
            with("newmtl m\nmap_Kd Tex\\WOOD.png\n", vec![("tex/wood.PNG", small_png())]),
            vec!["a.mtl:2", "tex/wood.PNG was taken"],
            "cannot read Tex/WOOD.png, which a.mtl:2 (material `m`) names",
        ),
        (
            "texture beside the library",
            with("newmtl m\nmap_Kd C:\\art\\wood.png\n", vec![("Wood.png", small_png())]),
            vec!["a.mtl:2", "Wood.png was taken"],
            "cannot read C:/art/wood.png, which a.mtl:2 (material `m`) names",
        ),
        (
            "unknown material",
            vec![t("a.obj", format!("{V}usemtl m\nf 1 2 3\n"))],
            vec!["a.obj:5: a face of material `m`", "it is grey"],
            "a.obj:5: a face of material `m`, which no material library defines",
        ),
        (
            "spectral colour",
            obj("newmtl m\nKd spectral a.rfl\n"),
            vec!["a.mtl:2: `spectral` is not a finite number; grey was taken"],
            "a.mtl:2: `spectral` is not a finite number",
        ),
        (
            "colour of two numbers",
            obj("newmtl m\nKs 1 1\n"),
            vec!["a.mtl:2: `Ks` needs 1 or 3 numbers; the line was ignored"],
            "a.mtl:2: `Ks` needs 1 or 3 numbers",
        ),
        (
            "illumination model in words",
            obj("newmtl m\nillum high\n"),
            vec!["a.mtl:2: `high` is not an illumination model"],
            "a.mtl:2: `high` is not an illumination model",
        ),
        (
            "some texture coordinates",
            vec![t("a.obj", format!("{V}vt 0 0\nf 1/1 2 3/1\nf 1 2/1 3\n"))],
            vec!["a.obj:5: ", "some corners only"],
            "a.obj:5: corners with and without texture coordinates or normals in one face",
        ),
        (
            "no texture in JSON",
            json(r#"{"file": "a.obj"}"#, "", r#""m": {"type": "diffuse", "reflectance": {"file": "no.png"}}"#),
            vec!["no.png", "scene.json (materials.m.reflectance.file)"],
            "no.png, which ./scene.json (materials.m.reflectance.file) names",
        ),
        (
            "no image of a glTF",
            gltf("no.png"),
            vec!["cannot read no.png, which a.gltf (images[0].uri) names", "materials are without it"],
            "cannot read no.png, which a.gltf (images[0].uri) names",
        ),
        (
            "image of a glTF in another case",
            [gltf("Tex/Wood.png"), vec![("tex/wood.PNG", small_png())]].concat(),
            vec!["Tex/Wood.png, which a.gltf (images[0].uri) names", "tex/wood.PNG was taken"],
            "cannot read Tex/Wood.png, which a.gltf (images[0].uri) names",
        ),
        (
            "a file in place of a folder of a glTF",
            gltf("a.bin/wood.png"),
            vec!["cannot read a.bin/wood.png, which a.gltf (images[0].uri) names", "materials are without it"],
            "cannot read a.bin/wood.png, which a.gltf (images[0].uri) names",
        ),
    ];
    for (name, files, parts, refused) in rows {
        let scene = if files[0].0 == "scene.json" { "." } else { files[0].0 };
        let arguments = [&["render", scene], &RENDER[..]].concat();
        let (status, notes, dir) = run(&files, &arguments);
        assert_eq!(status, Some(0), "{name}: {notes}");
        quotes_little(&notes);
        assert!(parts.iter().all(|p| notes.lines().any(|l| l.contains("note: ") && l.contains(p))), "{name}: {notes}");
        assert!(dir.path().join("x.exr").exists(), "{name}");
        let (status, error, _dir) = run(&files, &[&arguments[..], &["--strict"]].concat());
        assert_eq!(status, Some(1), "{name}: {error}");
        let last = error.lines().last().unwrap();
        assert!(last.starts_with("croupier: ") && last.contains(refused), "{name}: {error}");
    }
    // These take what is there without a word.
    let bom = |text: &str| [b"\xef\xbb\xbf", text.as_bytes()].concat();
    let mut files = obj("");
    files[0].1 = bom(&format!("mtllib a.mtl\n{V}usemtl m\nf 1 2 3\n"));
    files[1].1 = bom("newmtl m\nKe 1 1 1\n");
    let (status, notes, _dir) = run(&files, &[&["render", "a.obj", "--strict"], &RENDER[..]].concat());
    // camera, ground and daylight are added, and said; nothing else
    assert_eq!((status, notes.lines().count()), (Some(0), 3), "{notes}");
    let mut files = json(r#"{"file": "a.obj", "type": "obj"}"#, "", GREY);
    files[0].1 = bom(&text(&files[0].1));
    let (status, notes, _dir) = run(&files, &[&["render", "scene.json", "--strict"], &RENDER[..]].concat());
    assert_eq!((status, notes.as_str()), (Some(0), ""));
}

/// No output is a file that was read, under any name. Killed by: a comparison of texts, of the scene's file alone, of
/// names where a file has two, or of a name as it was typed where a file of another case was read.
#[test]
fn inputs_are_never_written() {
    let files = || {
        let mut files = obj("newmtl m\nmap_Kd wood.png\n");
        files.push(("wood.png", small_png()));
        // told by its first bytes
        files.push(("sky.exr", sky()));
        files
    };
    let check = |make_links: &dyn Fn(&Path), arguments: &[&str], parts: &[&str]| {
        let dir = tempfile::tempdir().unwrap();
        files().iter().for_each(|(name, bytes)| fs::write(dir.path().join(name), bytes).unwrap());
        make_links(dir.path());
        let out = croupier(dir.path(), arguments);
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{arguments:?}: {error}");
        let last = error.lines().last().unwrap();
        assert!(parts.iter().all(|p| last.contains(p)), "{arguments:?}: {last}");
        files().iter().for_each(|(name, bytes)| assert_eq!(fs::read(dir.path().join(name)).unwrap(), *bytes, "{name}"));
        assert!(fs::read_dir(dir.path()).unwrap().all(|f| !text_of(&f.unwrap().file_name()).contains(".part")));
    };
    fn text_of(name: &std::ffi::OsStr) -> String {
        name.to_string_lossy().into_owned()
    }
    let render = |more: &[&'static str]| [&["render", "a.obj", "--size", "8x8", "--spp", "1"], more].concat();
    check(&|_| (), &render(&["-o", "wood.exr"]), &["cannot write wood.png: it is wood.png, which was read"]);
    check(&|_| (), &render(&["-o", "x.exr", "--cache-out", "a.obj"]), &["cannot write a.obj", "which was read"]);
    check(&|_| (), &render(&["-o", "x.exr", "--cache-out", "./a.mtl"]), &["cannot write ./a.mtl: it is a.mtl"]);
    check(&|_| (), &render(&["-o", "x.exr", "--checkpoint", "a.obj"]), &["cannot write a.obj", "which was read"]);
    check(
        &|_| (),
        &render(&["-o", "sky.exr", "--env", "Sky.EXR"]),
        &["cannot write sky.exr: it is sky.exr, which was"],
    );
    check(&|_| (), &render(&["-o", "x.exr", "--cache-out", "./x.png"]), &["cannot write ./x.png: two outputs"]);
    check(
        &|d| fs::hard_link(d.join("wood.png"), d.join("x.png")).unwrap(),
        &render(&["-o", "x.exr"]),
        &["cannot write x.png: it is wood.png"],
    );
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        check(
            &|d| symlink("wood.png", d.join("x.png")).unwrap(),
            &render(&["-o", "x.exr"]),
            &["cannot write x.png: it is wood.png"],
        );
        check(
            &|d| symlink(".", d.join("also")).unwrap(),
            &render(&["-o", "also/wood.exr"]),
            &["also/wood.png: it is wood.png"],
        );
        check(
            &|d| symlink("a.obj", d.join("a.crp")).unwrap(),
            &["bake", "a.obj", "-o", "a.crp"],
            &["cannot write a.crp: it is a.obj"],
        );
    }
    // a baked scene and statistics, which are mapped or read
    let dir = tempfile::tempdir().unwrap();
    files().iter().for_each(|(name, bytes)| fs::write(dir.path().join(name), bytes).unwrap());
    let done = |arguments: &[&str]| {
        let out = croupier(dir.path(), arguments);
        (out.status.code(), text(&out.stderr).lines().last().unwrap_or_default().to_string())
    };
    assert_eq!(done(&["bake", "a.obj", "-o", "a.crp"]).0, Some(0));
    let over = done(&["bake", "a.crp", "-o", "a.crp"]);
    assert!(over.0 == Some(1) && over.1.contains("cannot write a.crp: it is a.crp, which was read"), "{over:?}");
    let small = ["render", "a.crp", "--size", "8x8", "--spp", "2", "-o", "x.exr"];
    assert_eq!(done(&[&small[..], &["--cache-out", "s.cache"]].concat()).0, Some(0));
    let over = done(&[&small[..], &["--cache-in", "s.cache", "--cache-out", "s.cache"]].concat());
    assert!(over.0 == Some(1) && over.1.contains("cannot write s.cache: it is s.cache"), "{over:?}");
}

/// Pipes and devices are refused before they are opened; nobody waits for them. Killed by: a read that waits, or ends
/// with the memory.
#[cfg(unix)]
#[test]
fn endless_files_are_refused() {
    use std::os::unix::fs::symlink;
    let dir = tempfile::tempdir().unwrap();
    assert!(Command::new("mkfifo").arg(dir.path().join("pipe.obj")).status().unwrap().success());
    symlink("pipe.obj", dir.path().join("pipe.crp")).unwrap();
    symlink("/dev/zero", dir.path().join("zero.obj")).unwrap();
    symlink("/dev/zero", dir.path().join("zero.png")).unwrap();
    fs::write(dir.path().join("a.obj"), format!("mtllib a.mtl\n{V}usemtl m\nf 1 2 3\n")).unwrap();
    fs::write(dir.path().join("a.mtl"), "newmtl m\nmap_Kd zero.png\n").unwrap();
    fs::File::create(dir.path().join("huge.obj")).unwrap().set_len(1 << 40).unwrap();
    for (scene, said) in [
        (&["pipe.obj"][..], "cannot read pipe.obj: it is not a regular file"),
        (&["zero.obj"], "cannot read zero.obj: it is not a regular file"),
        (&["pipe.crp"], "cannot read pipe.crp: it is not a file"),
        (&["a.obj"], "cannot read zero.png, which a.mtl:2 (material `m`) names: it is not a regular file"),
        (&["huge.obj"], "cannot read huge.obj: 1.00 TiB or more, the limit is 4.00 GiB"),
        (&["--cache-in", "pipe.obj"], "cannot read pipe.obj: it is not a regular file"),
        (&["--resume", "pipe.obj"], "pipe.obj: cannot read the checkpoint: it is not a regular file"),
        (&["-o", "x.exr", "--cache-out", "zero.obj"], "cannot write zero.obj: it is not a regular file"),
    ] {
        let out = croupier(dir.path(), &[&["render"], scene, &["--size", "8x8", "--spp", "1"]].concat());
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{scene:?}: {error}");
        assert!(error.lines().last().unwrap().contains(said), "{scene:?}: {error}");
    }
}

/// Four lines: scene (with its ground), memory, result, files. Killed by: counters among them, a line that is left out.
#[test]
fn a_render_says_four_lines() {
    let (status, _, dir) = run(&obj("newmtl m\n"), &["info", "a.obj"]);
    assert_eq!(status, Some(0));
    let out = croupier(dir.path(), &["render", "a.obj", "--size", "16x8", "--spp", "4", "-o", "x.exr"]);
    let said = text(&out.stdout);
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 4, "{said}");
    assert!(lines[0].starts_with("a.obj: 65 triangles, ") && lines[0].ends_with("16x8 pixels"), "{said}");
    assert!(
        lines[1].starts_with("ears") && lines[1].contains("16 shards") && lines[1].contains("MiB of memory"),
        "{said}"
    );
    assert!(lines[2].starts_with("4.0 samples per pixel, ") && lines[2].contains("estimated relMSE "), "{said}");
    assert_eq!(lines[3], "wrote x.exr, x.png");
    let more = croupier(dir.path(), &["render", "a.obj", "--size", "16x8", "--spp", "4", "-o", "x.exr", "--stats"]);
    assert!(text(&more.stdout).contains("camera_rays: 512"), "{}", text(&more.stdout));
    let json = croupier(dir.path(), &["render", "a.obj", "--size", "16x8", "--spp", "4", "-o", "x.exr", "--json"]);
    assert_eq!(text(&json.stdout).lines().count(), 1);
}
