//! Files into descriptions: OBJ and MTL dialects, images, `scene.json`, and what each wrong input is told.

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::image::Picture;
use croupier_host::load::{LoadError, LoadOptions, LoadReport, load, load_with};
use croupier_host::look::Look;
use croupier_tests::loading::{jpeg, plain_look};
use croupier_tests::stats::SplitMix;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A folder with these text files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn load_obj(obj: &str, mtl: &str) -> (SceneDescription, LoadReport) {
    let folder = folder(&[("a.obj", obj), ("a.mtl", mtl)]);
    plain(&folder.path().join("a.obj")).unwrap_or_else(|e| panic!("{e}"))
}

/// Loads without adding ground, sun and sky.
fn plain(path: &Path) -> Result<(SceneDescription, LoadReport), LoadError> {
    load_with(path, &LoadOptions::default(), &plain_look())
}

fn positions(scene: &SceneDescription, triangle: usize) -> [[f32; 3]; 3] {
    scene.triangles[triangle].vertices.map(|v| scene.vertices[v as usize].position)
}

/// Every dialect at once: CRLF, joined lines, negative indices, weights and colours behind positions, quads and
/// pentagons, points and lines, faces with and without normals and texture coordinates in one object, names with
/// spaces, bytes that are not UTF-8.
///
/// Killed by: `tobj` on the text as it is (refuses colours, gives normals to the third face, drops the name's tail).
#[test]
fn obj_dialects() {
    let obj = b"# caf\xe9\r\nmtllib a.mtl\r\no first one\r\nv 0 0 0 1 0 0\r\nv 1 0 0 2\r\nv 1 1 0\r\nv 0 1 0 .5 .5\r\n\
        v -1 .5 0\r\nvt 0\r\nvt 1 0\r\nvt 1 1\r\nvn 0 0 1\r\nusemtl my paint\r\nf 1//1 2//1 \\\r\n3//1\r\n\
        f -5/1 -4/2 -3/3\r\nf 1 2 3 4\r\np 1\r\nl 1 2\r\ng second\r\nf 1/1/1 2/2/1 3/3/1 4/3/-1 5/1/1\r\n";
    let folder = folder(&[("a.mtl", "newmtl my paint\nKd 1 0 0\n")]);
    fs::write(folder.path().join("a.obj"), obj).unwrap();
    let (scene, report) = plain(&folder.path().join("a.obj")).unwrap();
    assert_eq!(scene.triangles.len(), 1 + 1 + 2 + 3);
    assert_eq!((report.polygons, report.skipped_elements), (2, 2));
    assert!(scene.triangles.iter().all(|t| t.material == 0) && scene.materials[0].name == "my paint");
    let smooth: Vec<bool> = scene.triangles.iter().map(|t| t.smooth).collect();
    assert_eq!(smooth, [true, false, false, false, true, true, true]);
    let [a, b, c, d, e] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.5, 0.0]];
    let wanted = [[a, b, c], [a, b, c], [a, b, c], [a, c, d], [a, b, c], [a, c, d], [a, d, e]];
    for (i, wanted) in wanted.iter().enumerate() {
        assert_eq!(positions(&scene, i), *wanted, "triangle {i}");
    }
    let uv = |t: usize| scene.triangles[t].vertices.map(|v| scene.vertices[v as usize].uv);
    assert_eq!(uv(1), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
    assert_eq!(uv(2), [[0.0; 2]; 3]);
    assert_eq!(scene.object_of(0), "first one");
    assert_eq!(scene.object_of(6), "second");
    assert!(bake(&scene, &BakeOptions::default(), |_, _| {}).is_ok());
}

/// A last line that ends in a backslash counts all the same, as a face and as an error. Killed by: joined lines that
/// are read when the next one comes.
#[test]
fn the_last_line_may_promise_another() {
    let (scene, _) = load_obj(&format!("{}\\", TRIANGLE.trim_end()), "newmtl m\nKd 1 0 0 \\");
    assert_eq!((scene.triangles.len(), scene.materials.len()), (1, 1));
    let folder = folder(&[("a.obj", "v 0 0 0\nv 1 \\\n2 \\")]);
    let error = load(&folder.path().join("a.obj")).unwrap_err().to_string();
    assert!(error.contains("a.obj:3: `v` needs 3 numbers"), "{error}");
}

const TRIANGLE: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";

/// The table of `load/mtl.rs`, row by row. Killed by: swapping any two rows; alpha without the square.
#[test]
fn mtl_materials_become_models() {
    let constant = |y| Reflectance::Constant([y; 3]);
    let (ior, air) = (1.25, 1.0);
    let cases: &[(&str, Model)] = &[
        ("", Model::Diffuse { reflectance: constant(0.5) }),
        ("Kd .25 .25 .25", Model::Diffuse { reflectance: constant(0.25) }),
        ("Kd .25", Model::Diffuse { reflectance: constant(0.25) }),
        ("Kd .25\nKs 0 0 0\nNi 1.25", Model::Diffuse { reflectance: constant(0.25) }),
        ("Kd .25\nKs 1 1 1\nillum 1\nNs 10", Model::Diffuse { reflectance: constant(0.25) }),
        ("Kd .25\nPr 1\nKs .5 .5 .5", Model::Diffuse { reflectance: constant(0.25) }),
        ("Kd .25\nd .75", Model::Diffuse { reflectance: constant(0.25) }),
        ("Kd .25\nNi 1.25", Model::Plastic { reflectance: constant(0.25), int_ior: ior, ext_ior: air }),
        ("Kd .25\nPr 0", Model::Plastic { reflectance: constant(0.25), int_ior: 1.5, ext_ior: air }),
        (
            "Kd .25\nNi 1.25\nPr .5\nNs 7",
            Model::RoughPlastic { reflectance: constant(0.25), int_ior: ior, ext_ior: air, alpha: 0.25 },
        ),
        (
            "Kd .25\nKs .5 .5 .5\nNs 126\nillum 2",
            Model::RoughPlastic { reflectance: constant(0.25), int_ior: 1.5, ext_ior: air, alpha: 0.125 },
        ),
        ("Ks .5 .5 .5", Model::Mirror { reflectance: constant(0.5) }),
        ("Kd 0 0 0\nKs .5 .5 .5", Model::Mirror { reflectance: constant(0.5) }),
        (
            "Ks .5 .5 .5\nPr .5",
            Model::RoughConductor { eta: [0.0; 3], k: [1.0; 3], reflectance: constant(0.5), alpha: 0.25 },
        ),
        (
            "Kd .25\nPm 1\nPr .5",
            Model::RoughConductor { eta: [0.0; 3], k: [1.0; 3], reflectance: constant(0.25), alpha: 0.25 },
        ),
        ("Kd 0\nNi 1.25\nd .1", Model::Dielectric { int_ior: ior, ext_ior: air }),
        ("Kd 0\nNi 1.25\nTr .9", Model::Dielectric { int_ior: ior, ext_ior: air }),
        ("d -halo .1", Model::Dielectric { int_ior: 1.5, ext_ior: air }),
        ("Ni 1.25\nd .1\nPr .5", Model::RoughDielectric { int_ior: ior, ext_ior: air, alpha: 0.25 }),
        ("Ni 1\nillum 7", Model::ThinDielectric { int_ior: 1.5, ext_ior: air }),
    ];
    for (text, wanted) in cases {
        let (scene, _) = load_obj(TRIANGLE, &format!("newmtl other\nKd 1 1 1\nnewmtl m\n{text}\n"));
        assert_eq!(scene.materials.len(), 1);
        assert_eq!(scene.materials[0].model, *wanted, "{text}");
        assert_eq!(scene.materials[0].two_sided, !wanted.is_transmissive());
        assert!(scene.materials[0].compensated, "{text}");
        assert!(bake(&scene, &BakeOptions::default(), |_, _| {}).is_ok(), "{text}");
    }
    let (scene, report) = load_obj(TRIANGLE, "newmtl m\nKe 3 2 1\nTf\nKd 2 0 0\n");
    assert_eq!(scene.emitters[0], Emitter::Area { material: 0, radiance: [3.0, 2.0, 1.0] });
    assert_eq!(scene.materials[0].model, Model::Diffuse { reflectance: Reflectance::Constant([1.0, 0.0, 0.0]) });
    assert!(report.notes.iter().any(|n| n.contains("limited")), "{report:?}");
}

/// Faces without a material, no light, no camera: grey, sun and sky, a ground, and all corners inside the picture.
#[test]
fn a_bare_obj_can_be_seen() {
    let folder = folder(&[("a.obj", "v 10 0 0\nv 14 0 0\nv 10 3 0\nf 1 2 3\n")]);
    let (scene, report) = load(&folder.path().join("a.obj")).unwrap();
    assert_eq!(scene.materials[0].model, Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) });
    assert!(matches!(scene.environment, Some(Environment::Map { .. })));
    assert!(matches!(scene.emitters[..], [Emitter::Sun { .. }]) && scene.triangles.len() > 1);
    assert_eq!(report.notes.len(), 4, "{report:?}");
    assert!(report.framed);
    let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap();
    let view = croupier::Scene::from_bytes(&baked.bytes).unwrap();
    let c = view.camera;
    let dot = |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| f64::from(a[i]) * f64::from(b[i])).sum::<f64>();
    for p in positions(&scene, 0) {
        let d = std::array::from_fn(|i| p[i] - c.origin[i]);
        let depth = dot(d, c.forward);
        for edge in [c.right, c.down] {
            let x = dot(d, edge) / dot(edge, edge) / depth;
            assert!(depth > 0.0 && x.abs() < 1.0, "{p:?} is at {x}");
        }
    }
}

fn write_png(path: &Path, size: [u32; 2], color: png::ColorType, depth: png::BitDepth, data: &[u8], palette: &[u8]) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if !palette.is_empty() {
        encoder.set_palette(palette.to_vec());
    }
    encoder.write_header().unwrap().write_image_data(data).unwrap();
}

/// Two texels of every kind of PNG. Killed by: 16 bits cut instead of rounded; grey not spread.
#[test]
fn png_kinds_become_rgba() {
    use png::{BitDepth, ColorType};
    type Case = (ColorType, BitDepth, &'static [u8], &'static [u8], [[u8; 4]; 2]);
    let cases: &[Case] = &[
        (ColorType::Rgb, BitDepth::Eight, &[1, 2, 3, 4, 5, 6], &[], [[1, 2, 3, 255], [4, 5, 6, 255]]),
        (ColorType::Rgba, BitDepth::Eight, &[1, 2, 3, 4, 5, 6, 7, 8], &[], [[1, 2, 3, 4], [5, 6, 7, 8]]),
        (ColorType::Grayscale, BitDepth::Eight, &[9, 7], &[], [[9, 9, 9, 255], [7, 7, 7, 255]]),
        (ColorType::Grayscale, BitDepth::One, &[0x40], &[], [[0, 0, 0, 255], [255, 255, 255, 255]]),
        (ColorType::GrayscaleAlpha, BitDepth::Eight, &[9, 1, 7, 2], &[], [[9, 9, 9, 1], [7, 7, 7, 2]]),
        (ColorType::Indexed, BitDepth::Eight, &[1, 0], &[1, 2, 3, 4, 5, 6], [[4, 5, 6, 255], [1, 2, 3, 255]]),
        // 0x00ff is 0.9922 of a step of 257: rounds to 1; 0x0080 rounds to 0, 0xff7f to 255 - 0.5 down.
        (
            ColorType::Rgb,
            BitDepth::Sixteen,
            &[0, 0xff, 0, 0x80, 0xff, 0xff, 0x12, 0x12, 0xff, 0x7e, 0x80, 0x80],
            &[],
            [[1, 0, 255, 255], [0x12, 254, 0x80, 255]],
        ),
    ];
    for (color, depth, data, palette, wanted) in cases {
        let folder = folder(&[("a.obj", TRIANGLE), ("a.mtl", "newmtl m\nmap_Kd -clamp on -s 2 2 1 my tex.png\n")]);
        write_png(&folder.path().join("my tex.png"), [2, 1], *color, *depth, data, palette);
        let (scene, _) = load(&folder.path().join("a.obj")).unwrap_or_else(|e| panic!("{e}"));
        let t = &scene.textures[0];
        assert_eq!((t.width, t.height, t.texels.as_slice()), (2, 1, wanted.as_slice()), "{color:?} {depth:?}");
        assert_eq!(scene.materials[0].model.parameters().reflectance, Some(Reflectance::Texture(0)));
    }
}

/// JPEG textures, whatever their file is called; damaged ones are refused with their name and place, never a panic.
/// Killed by: a decoder chosen by name, channels out of order, grey where a file is cut off.
#[test]
fn jpeg_textures_are_read() {
    let read = |bytes: &[u8], name: &str| {
        let folder = folder(&[("a.obj", TRIANGLE), ("a.mtl", &format!("newmtl m\nmap_Kd {name}\n"))]);
        fs::write(folder.path().join(name), bytes).unwrap();
        load(&folder.path().join("a.obj")).map(|(scene, _)| scene.textures[0].clone())
    };
    let colours = jpeg(&[&[76, 85, 255], &[29, 255, 107], &[255, 128, 128]]);
    let t = read(&colours, "wood.JPG").unwrap();
    assert_eq!((t.width, t.height, t.texels.len()), (24, 8, 192));
    let near = |i: usize, wanted: [u8; 4]| {
        let far = t.texels[i].iter().zip(wanted).any(|(a, b)| a.abs_diff(b) > 2);
        assert!(!far, "texel {i}: {:?} for {wanted:?}", t.texels[i]);
    };
    near(0, [255, 0, 0, 255]);
    near(15, [0, 0, 255, 255]);
    near(191, [255, 255, 255, 255]);
    let grey = read(&jpeg(&[&[200], &[7]]), "grey.png").unwrap();
    assert_eq!((grey.texels[0], grey.texels[15]), ([200, 200, 200, 255], [7, 7, 7, 255]));
    // padding, a preview
    for behind in [&[0; 100][..], &colours] {
        let folder = folder(&[("a.obj", TRIANGLE), ("a.mtl", "newmtl m\nmap_Kd wood.jpg\n")]);
        fs::write(folder.path().join("wood.jpg"), [&colours, behind].concat()).unwrap();
        let (scene, report) = load(&folder.path().join("a.obj")).unwrap();
        assert_eq!(scene.textures[0].texels, t.texels);
        assert!(report.notes.iter().any(|n| n.contains("a.mtl:2") && n.contains("behind the end")), "{report:?}");
        let strict = LoadOptions { strict: true, ..LoadOptions::default() };
        let error = load_with(&folder.path().join("a.obj"), &strict, &Look::default()).unwrap_err().to_string();
        assert!(error.contains("wood.jpg") && error.contains("behind the end"), "{error}");
    }
    let mut rng = SplitMix(1);
    let noise: Vec<[u8; 3]> = (0..30).map(|_| [(); 3].map(|()| rng.word() as u8)).collect();
    let noise = jpeg(&noise.iter().map(|b| b.as_slice()).collect::<Vec<_>>());
    for length in [2, 40, noise.len() - 150, noise.len() - 60] {
        let error = read(&noise[..length], "wood.jpg").unwrap_err().to_string();
        let parts = ["wood.jpg", "a.mtl:2 (material `m`) names: not a readable JPEG"];
        assert!(parts.iter().all(|p| error.contains(p)), "{length} bytes: {error}");
    }
    for _ in 0..300 {
        let mut damaged = colours.clone();
        for _ in 0..1 + rng.word() % 3 {
            let at = rng.word() as usize % damaged.len();
            damaged[at] = rng.word() as u8;
        }
        if let Ok(t) = read(&damaged, "wood.jpg") {
            assert_eq!(t.texels.len(), (t.width * t.height) as usize);
        }
    }
}

const CAMERA: &str = r#""camera": {"type": "perspective", "origin": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0],
  "vfov_deg": 30, "width": 8, "height": 4, "thin_lens": {"radius": 0.25, "focus_distance": 3}}"#;

fn scene_json(materials: &str, rest: &str) -> String {
    format!(
        "{{\"anything\": [1], {CAMERA}, \"materials\": {{{materials}}}, \"geometry\": {{\"file\": \"a.obj\"}}{rest}}}"
    )
}

const M: &str = r#""m": {"type": "diffuse", "reflectance": [0.5, 0.5, 0.5], "twosided": true, "extra": {}}"#;

/// Everything that a description has. Killed by: scale ignored; rows and columns of `to_world` swapped.
#[test]
fn scene_json_is_read_whole() {
    let rest = r#", "transport": {"max_depth": 7}, "media": [], "emitters": [
        {"type": "area", "material": "m", "radiance": [1, 2, 3]},
        {"type": "point", "position": [1, 2, 3], "intensity": [4, 5, 6]},
        {"type": "directional", "direction": [0, -1, 0], "irradiance": [7, 8, 9]},
        {"type": "envmap", "file": "e.exr", "scale": 2.5,
         "to_world": [[0, 0, 1, 9], [0, 1, 0, 9], [-1, 0, 0, 9], [0, 0, 0, 1]]}]"#;
    let folder = folder(&[("scene.json", &scene_json(M, rest)), ("a.obj", TRIANGLE)]);
    let texel = |x: usize, y: usize| (x as f32, y as f32, [f32::NAN, -1.0, f32::INFINITY][x]);
    exr::prelude::write_rgb_file(folder.path().join("e.exr"), 3, 2, texel).unwrap();
    let (scene, report) = load(folder.path()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.max_depth, 7);
    assert_eq!(scene.camera.lens, Some(ThinLens { radius: 0.25, focus_distance: 3.0 }));
    assert_eq!((scene.camera.origin, scene.camera.vfov_deg, scene.camera.size), ([0.0, 0.0, 5.0], 30.0, [8, 4]));
    assert_eq!(
        scene.emitters,
        [
            Emitter::Area { material: 0, radiance: [1.0, 2.0, 3.0] },
            Emitter::Point { position: [1.0, 2.0, 3.0], intensity: [4.0, 5.0, 6.0] },
            Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [7.0, 8.0, 9.0] },
        ]
    );
    let texels = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];
    let to_world = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    let map = Environment::Map { width: 3, height: 2, texels, scale: [2.5; 3], to_world };
    assert_eq!(scene.environment, Some(map));
    assert!(
        report.notes.iter().any(|n| n.contains("e.exr") && n.contains("6 negative, NaN or infinite")),
        "{report:?}"
    );
    assert_eq!(report.files.len(), 3);
}

/// An environment map is what every reader of pictures here takes for the picture: the unnamed layer, or the first with
/// channels R, G, B. Killed by: a decoder of its own that takes the first layer, one that wants no others.
#[test]
fn environment_maps_are_pictures() {
    let read = |layers: &[(&str, f32)]| {
        let folder = folder(&[
            ("scene.json", &scene_json(M, r#", "emitters": [{"type": "envmap", "file": "e.exr"}]"#)),
            ("a.obj", TRIANGLE),
        ]);
        let mut picture = Picture::new(2, 2);
        picture.add1("depth", "Z", &[7.0; 4]);
        layers.iter().for_each(|(name, x)| picture.add3(name, ["R", "G", "B"], &[[*x; 3]; 4]));
        picture.write_exr(&folder.path().join("e.exr")).unwrap();
        load(folder.path()).map(|(scene, _)| match scene.environment {
            Some(Environment::Map { texels, .. }) => texels[3],
            other => panic!("{other:?}"),
        })
    };
    assert_eq!(read(&[("albedo", 1.0), ("", 2.0)]).unwrap(), [2.0; 3]);
    assert_eq!(read(&[("sky", 3.0)]).unwrap(), [3.0; 3]);
    let error = read(&[]).unwrap_err().to_string();
    assert!(error.contains("e.exr") && error.contains("no layer with channels R, G and B"), "{error}");
}

/// One thing wrong at a time: files, where to load from, and what the message must hold.
/// Killed by: any check left to `tobj` (it states no line), or left out.
#[test]
fn every_wrong_input_is_told_where() {
    let json = |materials: &str, rest: &str| scene_json(materials, rest);
    let obj = |text: &str| vec![("a.obj", text.to_string()), ("a.mtl", "newmtl m\nKd 1 1 1\n".to_string())];
    let mtl = |text: &str| vec![("a.obj", TRIANGLE.to_string()), ("a.mtl", text.to_string())];
    let scene = |text: String| vec![("scene.json", text), ("a.obj", TRIANGLE.to_string())];
    let v = "mtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl m\n";
    let obj_after = |text: &str| obj(&format!("{v}{text}\n"));
    type Case<'a> = (Vec<(&'a str, String)>, &'a str, &'a [&'a str]);
    let cases: Vec<Case<'_>> = vec![
        (vec![], "nowhere", &["cannot read", "nowhere"]),
        (vec![], "nowhere.obj", &["cannot read", "nowhere.obj"]),
        (vec![], "", &["cannot read", "scene.json"]),
        (vec![("a.fbx", "x".into())], "a.fbx", &["a.fbx", "neither a folder"]),
        (obj("v 0 0 0\nv 1 nan 0\n"), "a.obj", &["a.obj:2", "object `unnamed object`", "`v` number 2 is nan"]),
        (obj("v 0 0 0\no lamp\nv 1 1e99 0\n"), "a.obj", &["a.obj:3", "object `lamp`", "1e99"]),
        (obj("v 0 zero 0\n"), "a.obj", &["a.obj:1", "`zero` is not a number"]),
        (obj("v 0 0\n"), "a.obj", &["a.obj:1", "`v` needs 3 numbers"]),
        (obj("vn inf 0 0\n"), "a.obj", &["a.obj:1", "`vn` number 1 is inf"]),
        (obj_after("f 1 2 4"), "a.obj", &["a.obj:9", "object `thing`", "no vertex 4", "only 3"]),
        (obj_after("f 1 2 -4"), "a.obj", &["a.obj:9", "no vertex -4"]),
        (obj_after("f 0 1 2"), "a.obj", &["a.obj:9", "no vertex 0"]),
        (obj_after("f 1/2 2/1 3/1"), "a.obj", &["a.obj:9", "no texture coordinate 2", "only 1"]),
        (obj_after("f 1//1 2//1 3//7"), "a.obj", &["a.obj:9", "no normal 7"]),
        (obj_after("f 1//1 2 3"), "a.obj", &["a.obj:9", "with and without"]),
        (obj_after("f 1 b 3"), "a.obj", &["a.obj:9", "`b` is not a corner"]),
        (obj_after("f 1/1/1/1 2 3"), "a.obj", &["a.obj:9", "`1/1/1/1` is not a corner"]),
        (obj_after("f 99999999999999999999 2 3"), "a.obj", &["a.obj:9", "is not a corner"]),
        (obj_after("f /1 2 3"), "a.obj", &["a.obj:9", "`/1` has no vertex"]),
        (obj_after("usemtl paint\nf 1 2 3"), "a.obj", &["a.obj:10", "material `paint`", "no material library"]),
        (obj("mtllib b.mtl\nv 0 0 0\nf 1 1 1\n"), "a.obj", &["cannot read", "b.mtl", "a.obj:1 names"]),
        (mtl("newmtl m\nKd 1 1\n"), "a.obj", &["a.mtl:2", "`Kd` needs 1 or 3 numbers"]),
        (mtl("newmtl m\nKd spectral a.rfl\n"), "a.obj", &["a.mtl:2", "`spectral` is not a finite number"]),
        (mtl("newmtl m\nKe nan 0 0\n"), "a.obj", &["a.mtl:2", "`nan` is not a finite number"]),
        (mtl("newmtl m\nNs\n"), "a.obj", &["a.mtl:2", "not a finite number"]),
        (mtl("newmtl\n"), "a.obj", &["a.mtl:1", "`newmtl` needs a name"]),
        (mtl("newmtl m\nillum high\n"), "a.obj", &["a.mtl:2", "`high` is not an illumination model"]),
        (mtl("newmtl m\nmap_Kd no.png\n"), "a.obj", &["cannot read", "no.png", "a.mtl:2 (material `m`) names"]),
        (
            mtl("newmtl x\nmap_Kd a.mtl\nnewmtl m\n\nmap_Kd a.obj\n"),
            "a.obj",
            &["cannot use the image", "a.obj", "a.mtl:5 (material `m`)", "not a readable PNG or JPEG"],
        ),
        (scene("{\"camera\": \n!}".into()), "", &["scene.json", "line 2 column 1", "not JSON"]),
        (scene("[]".into()), "", &["scene.json", "document", "expected an object"]),
        (scene("{}".into()), "", &["scene.json", "document", "`camera` is missing"]),
        (scene(json(M, "").replace("\"up\"", "\"down\"")), "", &["scene.json: camera", "`up` is missing"]),
        (scene(json(M, "").replace("30", "\"wide\"")), "", &["camera.vfov_deg", "expected a number"]),
        (scene(json(M, "").replace("\"width\": 8", "\"width\": 0")), "", &["camera.width", "whole number from 1"]),
        (scene(json(M, "").replace("[0, 0, 5]", "[0, 5]")), "", &["camera.origin", "expected 3 numbers"]),
        (scene(json(M, "").replace("\"perspective\"", "\"fisheye\"")), "", &["camera.type", "`fisheye`"]),
        (scene(json("\"m\": {\"type\": \"velvet\"}", "")), "", &["materials.m.type", "unknown material type `velvet`"]),
        (scene(json("\"m\": {\"type\": \"diffuse\"}", "")), "", &["materials.m", "`reflectance` is missing"]),
        (
            scene(json("\"m\": {\"type\": \"dielectric\", \"int_ior\": [1], \"ext_ior\": 1}", "")),
            "",
            &["materials.m.int_ior", "expected a number"],
        ),
        (
            scene(json("\"m\": {\"type\": \"mirror\", \"reflectance\": {\"file\": \"no.png\"}}", "")),
            "",
            &["cannot read", "no.png", "scene.json (materials.m.reflectance.file) names"],
        ),
        (
            scene(json(
                "\"m\": {\"type\": \"mirror\", \"reflectance\": {\"file\": \"no.png\", \"wrap\": \"clamp\"}}",
                "",
            )),
            "",
            &["materials.m.reflectance.wrap", "`clamp` is not supported"],
        ),
        (
            scene(json("\"x\": {\"type\": \"null\"}", "")),
            "",
            &["a.obj:6", "material `m`", "scene.json does not define"],
        ),
        (
            vec![("scene.json", json(M, "")), ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3".into())],
            "",
            &["a.obj:4", "before any `usemtl`"],
        ),
        (vec![("scene.json", json(M, ""))], "", &["cannot read", "a.obj", "scene.json (geometry.file) names"]),
        (
            scene(json(M, ", \"emitters\": [{\"type\": \"area\", \"material\": \"sun\", \"radiance\": [1, 1, 1]}]")),
            "",
            &["emitters[0].material", "there is no material `sun`"],
        ),
        (scene(json(M, ", \"emitters\": [{\"type\": \"laser\"}]")), "", &["emitters[0].type", "`laser`"]),
        (
            scene(json(M, ", \"emitters\": [{\"type\": \"envmap\", \"file\": \"a.obj\"}]")),
            "",
            &["cannot use the image", "a.obj", "emitters[0].file", "not a readable EXR"],
        ),
        (
            scene(json(
                M,
                ", \"emitters\": [{\"type\": \"constant\", \"radiance\": [1, 1, 1]}, {\"type\": \"constant\", \"radiance\": [1, 1, 1]}]",
            )),
            "",
            &["emitters[1]", "already an environment"],
        ),
        (scene(json(M, ", \"transport\": {\"max_depth\": -1}")), "", &["transport.max_depth", "whole number"]),
    ];
    for (files, path, parts) in cases {
        let files: Vec<(&str, &str)> = files.iter().map(|(n, t)| (*n, t.as_str())).collect();
        let folder = folder(&files);
        let strict = LoadOptions { strict: true, ..LoadOptions::default() };
        let error = load_with(&folder.path().join(path), &strict, &Look::default()).err();
        let text = error.unwrap_or_else(|| panic!("{parts:?} was loaded")).to_string();
        for part in parts {
            assert!(text.contains(part), "`{text}` lacks `{part}`");
        }
    }
}

/// Any bytes are an error or a scene, never a panic. Killed by: handing MTL colours of two numbers to `tobj`.
#[test]
fn random_damage_never_panics() {
    let base = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl m\nf 1 2 3\nf 1/1/1 2/1/1 3/1/1 1/1/1\nf -1//-1 1//1 2//1\n";
    let mtl = "newmtl m\nKd 1 1 1\nNs 3\nd 0.2\nillum 2\nmap_Kd -s 1 1 t.png\nKe 1 1 1\n";
    let folder = folder(&[("a.obj", base), ("a.mtl", mtl)]);
    write_png(&folder.path().join("t.png"), [1, 1], png::ColorType::Grayscale, png::BitDepth::Eight, &[7], &[]);
    assert!(load(&folder.path().join("a.obj")).is_ok());
    let (mut loaded, mut refused) = (0, 0);
    let mut state = 12345u64;
    let mut random = |n: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % n
    };
    for _ in 0..400 {
        let (mut a, mut b) = (base.as_bytes().to_vec(), mtl.as_bytes().to_vec());
        for bytes in [&mut a, &mut b] {
            for _ in 0..random(4) {
                let (i, palette) = (random(bytes.len()), b"0123456789-/. \nfvntgo\\e\xff");
                match random(3) {
                    0 => bytes[i] = palette[random(palette.len())],
                    1 => drop(bytes.remove(i)),
                    _ => bytes.insert(i, palette[random(palette.len())]),
                }
            }
        }
        fs::write(folder.path().join("a.obj"), a).unwrap();
        fs::write(folder.path().join("a.mtl"), b).unwrap();
        match load(&folder.path().join("a.obj")) {
            Ok((scene, _)) => {
                loaded += 1;
                if let Ok(baked) = bake(&scene, &BakeOptions::default(), |_, _| {}) {
                    assert!(croupier::Scene::from_bytes(&baked.bytes).is_ok());
                }
            }
            Err(_) => refused += 1,
        }
    }
    assert!(loaded > 50 && refused > 50, "{loaded} loaded, {refused} refused");
}
