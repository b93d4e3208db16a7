//! Media of `scene.json`: what becomes of each key, the order of media, and what each wrong input is told.

use croupier::Scene;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::load::{LoadError, load};
use croupier_tests::stats::SplitMix;
use std::fs;
use tempfile::TempDir;

/// Closed tetrahedra side by side, each of the material that its letter names.
fn obj(materials: &str) -> String {
    let mut text = String::new();
    for (i, name) in materials.chars().enumerate() {
        let x = 10 * i;
        text += &format!("o part {name}\nusemtl {name}\nv {x} 0 0\nv {} 0 0\nv {x} 1 0\nv {x} 0 1\n", x + 1);
        text += "f -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n";
    }
    text
}

const GREY: &str = r#""type": "diffuse", "reflectance": [0.5, 0.5, 0.5]"#;

/// A folder of materials a to h, the last two opaque and thin; `extra` are more keys of material a. No face has h.
fn folder(extra: &str, rest: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let glass = r#""type": "dielectric", "int_ior": 1.5, "ext_ior": 1"#;
    let thin = r#""type": "thindielectric", "int_ior": 1.5, "ext_ior": 1"#;
    let json = format!(
        r#"{{ "camera": {{ "origin": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 30, "width": 8,
        "height": 4 }}, "geometry": {{ "file": "a.obj" }}, "materials": {{ "a": {{ {glass} {extra} }},
        "b": {{ "type": "null" }}, "c": {{ {glass} }}, "d": {{ {glass} }}, "e": {{ "type": "null" }},
        "f": {{ {GREY} }}, "g": {{ {thin} }}, "h": {{ "type": "null" }} }} {rest} }}"#
    );
    fs::write(folder.path().join("scene.json"), json).unwrap();
    fs::write(folder.path().join("a.obj"), obj("abcdefg")).unwrap();
    let bytes: Vec<u8> = (0..24).flat_map(|i| (i as f32 * 0.5).to_le_bytes()).collect();
    fs::write(folder.path().join("density.raw"), &bytes).unwrap();
    fs::write(folder.path().join("short.raw"), &bytes[..95]).unwrap();
    fs::write(folder.path().join("empty.raw"), b"").unwrap();
    for (name, wrong) in [("nan.raw", f32::NAN), ("negative.raw", -0.25), ("huge.raw", f32::INFINITY)] {
        let mut bytes = bytes.clone();
        // cell (1, 2, 3) of 2 x 3 x 4
        bytes[92..96].copy_from_slice(&wrong.to_le_bytes());
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

fn try_load(extra: &str, rest: &str) -> Result<SceneDescription, LoadError> {
    load(folder(extra, rest).path()).map(|(scene, _)| scene)
}

fn loaded(extra: &str, rest: &str) -> SceneDescription {
    let scene = try_load(extra, rest).unwrap_or_else(|e| panic!("{e}"));
    let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(Scene::from_bytes(&baked.bytes).unwrap().media.len(), scene.media.len());
    scene
}

/// Names of the media in their order, with the materials in front of each.
fn order(scene: &SceneDescription) -> Vec<String> {
    let of = |(i, m): (u32, &Medium)| {
        let materials = scene.materials.iter().filter(|m| m.medium == Some(i));
        format!("{} in {}", m.name, materials.map(|m| &*m.name).collect::<String>())
    };
    (0..).zip(&scene.media).map(of).collect()
}

fn fog(name: &str, boundary: &str, rest: &str) -> String {
    format!(
        r#"{{ "name": "{name}", "type": "homogeneous", "boundary_material": "{boundary}", "sigma_a": [1, 2, 3],
        "sigma_s": [4, 5, 6] {rest} }}"#
    )
}

fn smoke(rest: &str) -> String {
    format!(
        r#", "media": [{{ "name": "smoke", "type": "grid", "boundary_material": "b", "resolution": [2, 3, 4],
        "bbox_min": [9, -1, -1], "bbox_max": [12, 2, 2], "albedo": [0.75, 0.5, 0], "sigma_t_scale": 8,
        "file": "density.raw" {rest} }}]"#
    )
}

/// Killed by: absorption for albedo; a key that is ignored; density cells in another order.
#[test]
fn every_key_of_media_is_read() {
    let phase = r#", "phase": { "type": "hg", "g": -0.25 }, "emission": [7, 8, 9]"#;
    let scene = loaded("", &format!(", \"media\": [{}]", fog("fog", "b", phase)));
    let homogeneous = Medium {
        name: "fog".into(),
        sigma_a: [1.0, 2.0, 3.0],
        sigma_s: [4.0, 5.0, 6.0],
        emission: [7.0, 8.0, 9.0],
        g: -0.25,
        density: Density::Homogeneous,
    };
    assert_eq!(scene.media, [homogeneous]);
    assert_eq!(scene.materials.iter().filter_map(|m| m.medium).collect::<Vec<_>>(), [0]);
    assert_eq!(scene.materials[1].medium, Some(0));

    let said = r#", "dtype": "f32le", "order": "index = (z*ny + y)*nx + x",
        "interpolation": "trilinear, cell-centred, clamp""#;
    let values: Vec<f32> = (0..24).map(|i| i as f32 * 0.5).collect();
    let density = Density::Grid { cells: [2, 3, 4], bounds: [[9.0, -1.0, -1.0], [12.0, 2.0, 2.0]], values };
    let grid = Medium {
        name: "smoke".into(),
        sigma_a: [2.0, 4.0, 8.0],
        sigma_s: [6.0, 4.0, 0.0],
        density,
        ..Medium::default()
    };
    assert_eq!(loaded("", &smoke("")).media[0], grid);
    assert_eq!(loaded("", &smoke(said)).media[0], grid);
    let chromatic = smoke("").replace("\"sigma_t_scale\": 8", "\"sigma_t_scale\": [8, 16, 4], \"albedo\": 0.5");
    let chromatic = chromatic.replace("\"albedo\": [0.75, 0.5, 0], ", "");
    let half = [4.0, 8.0, 2.0];
    assert_eq!(loaded("", &chromatic).media, [Medium { sigma_a: half, sigma_s: half, ..grid }]);
    assert!(loaded("", ", \"media\": []").media.is_empty());
    assert!(loaded("", ", \"media\": null").media.is_empty());
}

/// Killed by: coefficients of another row of the paper's table; a scale that divides; a phase function that leaves the
/// reduced coefficients.
#[test]
fn presets_are_those_of_the_paper() {
    let rows = [
        ("marble", [0.0021, 0.0041, 0.0071], [2.19, 2.62, 3.00]),
        ("milk", [0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]),
        ("skim milk", [0.0014, 0.0025, 0.0142], [0.70, 1.22, 1.90]),
    ];
    let close = |found: [f32; 3], wanted: [f64; 3], factor: f64| {
        found.iter().zip(wanted).all(|(a, b)| (f64::from(*a) / (b * factor) - 1.0).abs() < 1e-6)
    };
    for (name, sigma_a, reduced) in rows {
        let medium = |rest: &str| {
            format!(r#", "media": [{{ "type": "homogeneous", "boundary_material": "b", "preset": "{name}" {rest} }}]"#)
        };
        for (rest, scale, g) in [
            ("", 1.0, 0.0),
            (", \"scale\": 250", 250.0, 0.0),
            (", \"scale\": 0.5, \"phase\": { \"type\": \"hg\", \"g\": 0.75 }", 0.5, 0.75),
        ] {
            let scene = loaded("", &medium(rest));
            let m = &scene.media[0];
            assert!(close(m.sigma_a, sigma_a, scale) && f64::from(m.g) == g, "{name}{rest}: {m:?}");
            assert!(close(m.sigma_s, reduced, scale / (1.0 - g)), "{name}{rest}: {m:?}");
        }
        let scene = loaded(&format!(", \"interior\": \"{name}\", \"interior_scale\": 10"), "");
        assert_eq!(order(&scene), [format!("{name} of a in a")]);
        let m = &scene.media[0];
        assert!(close(m.sigma_a, sigma_a, 10.0) && close(m.sigma_s, reduced, 10.0) && m.g == 0.0, "{m:?}");
    }
}

/// Killed by: file order alone; a clear inside for opaque materials, for sheets, or for boundaries of media; clear
/// insides before media that have nothing to do with them.
#[test]
fn media_come_after_what_they_surround() {
    let around = |list: &str| format!(", \"also_exterior_of\": [{list}]");
    let media = |list: &[String]| format!(", \"media\": [{}]", list.join(", "));
    let cases: &[(Vec<String>, &[&str])] = &[
        (vec![fog("x", "b", ""), fog("y", "c", "")], &["x in b", "y in c"]),
        // x is around y: the file's order is turned round
        (vec![fog("x", "b", &around("\"c\"")), fog("y", "c", "")], &["y in c", "x in b"]),
        (vec![fog("y", "c", ""), fog("x", "b", &around("\"c\""))], &["y in c", "x in b"]),
        // glass without a medium of its own, twice
        (
            vec![fog("x", "b", &around("\"a\", \"c\", \"a\"")), fog("y", "e", &around("\"a\""))],
            &["inside of a in a", "inside of c in c", "x in b", "y in e"],
        ),
        (vec![fog("y", "e", ""), fog("x", "b", &around("\"a\""))], &["y in e", "inside of a in a", "x in b"]),
        // nothing enters an opaque body; a sheet has no inside
        (vec![fog("x", "b", &around("\"f\", \"g\""))], &["x in b"]),
        // three shells, named from the outside in
        (
            vec![fog("x", "b", &around("\"c\"")), fog("y", "c", &around("\"d\"")), fog("z", "d", &around("\"e\""))],
            &["inside of e in e", "z in d", "y in c", "x in b"],
        ),
    ];
    for (list, wanted) in cases {
        let scene = loaded("", &media(list));
        assert_eq!(order(&scene), *wanted);
        for m in scene.media.iter().filter(|m| m.name.starts_with("inside")) {
            assert_eq!(*m, Medium { name: m.name.clone(), ..Medium::default() });
        }
    }
    // the inside of an object comes before what is around all objects
    let milk = ", \"interior\": \"milk\"";
    assert_eq!(order(&loaded(milk, &media(&[fog("x", "b", "")]))), ["milk of a in a", "x in b"]);
    assert_eq!(order(&loaded(milk, &media(&[fog("x", "b", &around("\"a\""))]))), ["milk of a in a", "x in b"]);
}

/// Killed by: the flag without the texture's key; GGX widths taken for the key.
#[test]
fn flags_of_materials_are_read() {
    let material = |text: &str| {
        let folder = folder("", "");
        let path = folder.path().join("scene.json");
        let json = fs::read_to_string(&path).unwrap().replace(GREY, text);
        fs::write(&path, json).unwrap();
        let file = fs::File::create(folder.path().join("t.png")).unwrap();
        let mut encoder = png::Encoder::new(file, 1, 1);
        encoder.set_color(png::ColorType::Rgba);
        encoder.write_header().unwrap().write_image_data(&[1, 2, 3, 4]).unwrap();
        load(folder.path()).map(|(scene, _)| {
            assert_eq!(scene.textures.first().map_or([1, 2, 3, 4], |t| t.texels[0]), [1, 2, 3, 4]);
            (scene.materials[5].cutout, scene.materials[5].compensated)
        })
    };
    let mirror = |keys: &str| format!(r#""type": "mirror", "reflectance": {{ "file": "t.png" {keys} }}"#);
    let metal = |keys: &str| {
        format!(
            r#""type": "roughconductor", "eta": [1, 1, 1], "k": [1, 1, 1], "reflectance": [1, 1, 1], "alpha": 0.5 {keys}"#
        )
    };
    assert_eq!(material(&mirror("")).unwrap(), (false, false));
    assert_eq!(material(&mirror(r#", "alpha": "ignore""#)).unwrap(), (false, false));
    assert_eq!(material(&mirror(r#", "alpha": "cutout""#)).unwrap(), (true, false));
    assert_eq!(material(&metal("")).unwrap(), (false, false));
    assert_eq!(material(&metal(r#", "compensate": true"#)).unwrap(), (false, true));
    assert_eq!(material(&metal(r#", "compensate": false"#)).unwrap(), (false, false));
    assert_eq!(material(&(mirror("") + r#", "compensate": false"#)).unwrap(), (false, false));
    for (text, parts) in [
        (mirror(r#", "alpha": "blend""#), ["materials.f.reflectance.alpha", "`blend` is not supported"]),
        (mirror(r#", "alpha": 0.5"#), ["materials.f.reflectance.alpha", "expected a text"]),
        (mirror("") + r#", "compensate": true"#, ["materials.f.compensate", "a `mirror` is not rough"]),
        (metal(r#", "compensate": 1"#), ["materials.f.compensate", "expected true or false"]),
    ] {
        let error = material(&text).unwrap_err().to_string();
        assert!(parts.iter().all(|p| error.contains(p)), "{error}");
    }
}

/// One thing wrong at a time; every message names the file, the value and the medium.
/// Killed by: any check left out.
#[test]
fn every_wrong_medium_is_told_where() {
    let list = |m: &str| format!(", \"media\": [{m}]");
    let one = |from: &str, to: &str| {
        let text = list(&fog("fog", "b", ", \"phase\": { \"type\": \"hg\", \"g\": 0 }"));
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    let grid = |from: &str, to: &str| {
        let text = smoke("");
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    let preset =
        |rest: &str| list(&format!(r#"{{ "name": "fog", "type": "homogeneous", "boundary_material": "b", {rest} }}"#));
    let around = |a: &str, b: &str| fog(a, a, &format!(", \"also_exterior_of\": [\"{b}\"]"));
    let many = |n: usize| list(&vec![fog("fog", "b", ""); n].join(", "));
    let cases: Vec<(String, &[&str])> = vec![
        (list("7"), &["media[0]", "expected an object"]),
        (one("\"sigma_a\": [1, 2, 3],", ""), &["media[0]", "medium `fog`", "`sigma_a` is missing"]),
        (one("[1, 2, 3]", "[1, -2, 3]"), &["media[0].sigma_a", "medium `fog`", "-2, it must be from 0 to 1e18"]),
        (one("[1, 2, 3]", "[1, 2]"), &["media[0].sigma_a", "medium `fog`", "expected 3 numbers"]),
        (one("[4, 5, 6]", "[4, 5, -6]"), &["media[0].sigma_s", "medium `fog`", "-6, it must be"]),
        (one("[4, 5, 6]", "1e39"), &["media[0].sigma_s", "medium `fog`", "inf, it must be"]),
        (one("[4, 5, 6]", "1e19"), &["media[0].sigma_s", "medium `fog`", "it must be from 0 to 1e18"]),
        (one("[4, 5, 6]", "NaN"), &["scene.json", "line", "not JSON"]),
        (one("[4, 5, 6]", "[1, 1, 1], \"emission\": [0, -1, 0]"), &["media[0].emission", "medium `fog`", "-1"]),
        (one("homogeneous", "fractal"), &["media[0].type", "medium `fog`", "unknown medium type `fractal`"]),
        (one("\"hg\"", "\"rayleigh\""), &["media[0].phase.type", "medium `fog`", "unknown phase function `rayleigh`"]),
        (one("\"g\": 0", "\"g\": 1"), &["media[0].phase.g", "medium `fog`", "1, it must be from -0.99 to 0.99"]),
        (one("\"g\": 0", "\"h\": 0"), &["media[0].phase", "medium `fog`", "`g` is missing"]),
        (
            one("\"boundary_material\": \"b\",", ""),
            &["scene.json", "media[0]", "medium `fog`", "`boundary_material` is missing"],
        ),
        (one("\"b\"", "\"mist\""), &["media[0].boundary_material", "medium `fog`", "there is no material `mist`"]),
        (one("\"b\"", "\"h\""), &["media[0].boundary_material", "medium `fog`", "no face has the material `h`"]),
        (
            one("\"b\"", "\"b\", \"also_exterior_of\": [\"a\", \"mist\"]"),
            &["media[0].also_exterior_of[1]", "medium `fog`", "there is no material `mist`"],
        ),
        (
            one("\"b\"", "\"b\", \"also_exterior_of\": [\"h\"]"),
            &["media[0].also_exterior_of[0]", "medium `fog`", "no face has the material `h`"],
        ),
        (
            list(&[fog("fog", "b", ""), fog("mist", "b", "")].join(", ")),
            &["media[1]", "medium `mist`", "boundary `b` is that of `fog` already"],
        ),
        (list(&around("b", "b")), &["media", "surround each other", "`b` is around `b`"]),
        (
            list(&[around("b", "c"), around("c", "d"), around("d", "c")].join(", ")),
            &["media", "surround each other", "`c` is around `d` is around `c`"],
        ),
        (many(25), &["media", "25 media are too many, there may be 24"]),
        (preset("\"preset\": \"butter\""), &["media[0].preset", "medium `fog`", "`butter`", "`skim milk`"]),
        (preset("\"preset\": \"milk\", \"scale\": 0"), &["media[0].scale", "medium `fog`", "0 millimetres"]),
        (preset("\"preset\": \"milk\", \"scale\": -1"), &["media[0].scale", "-1 millimetres"]),
        (preset("\"preset\": \"milk\", \"scale\": 1e13"), &["media[0].scale", "up to 1e12"]),
        (preset("\"preset\": \"milk\", \"sigma_s\": 1"), &["media[0].sigma_s", "medium `fog`", "of its own"]),
        (preset("\"sigma_a\": 1, \"sigma_s\": 1, \"scale\": 2"), &["media[0].scale", "without `preset`"]),
        (grid("density.raw", "no.raw"), &["cannot read", "no.raw", "scene.json (media[0].file) names"]),
        (
            grid("density.raw", "short.raw"),
            &["short.raw", "scene.json (media[0].file)", "medium `smoke`", "95 bytes", "2 x 3 x 4 cells", "96"],
        ),
        (grid("density.raw", "empty.raw"), &["empty.raw", "medium `smoke`", "0 bytes", "are 96"]),
        (grid("[2, 3, 4]", "[2, 3, 5]"), &["density.raw", "medium `smoke`", "96 bytes", "are 120"]),
        (grid("density.raw", "nan.raw"), &["nan.raw", "medium `smoke`", "cell (1, 2, 3) is NaN"]),
        (grid("density.raw", "negative.raw"), &["medium `smoke`", "cell (1, 2, 3) is -0.25"]),
        (grid("density.raw", "huge.raw"), &["medium `smoke`", "cell (1, 2, 3) is inf"]),
        (grid("[2, 3, 4]", "[2, 3]"), &["media[0].resolution", "medium `smoke`", "expected 3 numbers"]),
        (grid("[2, 3, 4]", "[2, 0, 4]"), &["media[0].resolution[1]", "medium `smoke`", "whole number from 1"]),
        (grid("[2, 3, 4]", "[2, 3, 65537]"), &["media[0].resolution", "medium `smoke`", "65536 cells"]),
        (grid("[0.75, 0.5, 0]", "[0.75, 1.5, 0]"), &["media[0].albedo", "medium `smoke`", "1.5, it must be", "to 1"]),
        (grid("[0.75, 0.5, 0]", "[0.75, -0.5, 0]"), &["media[0].albedo", "medium `smoke`", "-0.5"]),
        (grid("\"sigma_t_scale\": 8", "\"sigma_t_scale\": -8"), &["media[0].sigma_t_scale", "medium `smoke`", "-8"]),
        (grid("[12, 2, 2]", "[12, -1, 2]"), &["media[0]", "medium `smoke`", "bbox_min", "below bbox_max"]),
        (smoke(", \"dtype\": \"f64\""), &["media[0].dtype", "medium `smoke`", "`f64` is not supported"]),
        (smoke(", \"order\": \"x first\""), &["media[0].order", "medium `smoke`", "`x first` is not supported"]),
        (smoke(", \"interpolation\": \"nearest\""), &["media[0].interpolation", "medium `smoke`", "`nearest`"]),
    ];
    let refused = |extra: &str, rest: &str, parts: &[&str]| {
        let text = try_load(extra, rest).err().unwrap_or_else(|| panic!("{parts:?} was loaded")).to_string();
        for part in parts.iter().chain(&["scene.json"]) {
            assert!(text.contains(part), "`{text}` lacks `{part}`");
        }
    };
    for (rest, parts) in &cases {
        refused("", rest, parts);
    }
    let around_all = fog("fog", "b", r#", "also_exterior_of": ["a", "c", "d", "e"]"#);
    assert_eq!(loaded("", &list(&around_all)).media.len(), 5);
    let interior = ", \"interior\": \"milk\"";
    refused(", \"interior\": \"butter\"", "", &["materials.a.interior", "unknown preset `butter`"]);
    refused(", \"interior_scale\": 2", "", &["materials.a.interior_scale", "without `interior`"]);
    refused(&format!("{interior}, \"interior_scale\": 0"), "", &["materials.a.interior_scale", "0 millimetres"]);
    // of a key that is there twice the last one counts
    let opaque = format!("{interior}, {GREY}");
    refused(&opaque, "", &["materials.a.interior", "light does not pass this material"]);
    refused(interior, &list(&fog("fog", "a", "")), &["media[0]", "medium `fog`", "that of `milk of a` already"]);
}

/// Boundaries are checked by baking. Killed by: a boundary whose triangles are not all those of its material.
#[test]
fn open_boundaries_are_refused_by_name() {
    let folder = folder("", &format!(", \"media\": [{}]", fog("fog", "b", "")));
    let path = folder.path().join("a.obj");
    let text = fs::read_to_string(&path).unwrap();
    let (before, after) = text.split_once("o part b").unwrap();
    fs::write(&path, format!("{before}o part b{}", after.replacen("f -3 -2 -1\n", "", 1))).unwrap();
    let (scene, _) = load(folder.path()).unwrap();
    let error = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap_err().to_string();
    for part in ["medium `fog`", "object `part b`", "not closed", "[11.0, 0.0, 0.0]"] {
        assert!(error.contains(part), "{error}");
    }
}

/// Any text is an error or a scene, and what is baked is valid. Killed by: a product of sides that overflows, a list of
/// media that is indexed before it is checked.
#[test]
fn random_damage_never_panics() {
    let folder = folder(
        ", \"interior\": \"milk\", \"interior_scale\": 10",
        &smoke(", \"also_exterior_of\": [\"a\", \"c\"], \"phase\": { \"type\": \"hg\", \"g\": 0.5 }"),
    );
    let path = folder.path().join("scene.json");
    let text = fs::read(&path).unwrap();
    let start = text.windows(9).position(|w| w == b"materials").unwrap();
    let mut random = SplitMix(11);
    let (mut loaded, mut refused) = (0, 0);
    for _ in 0..2000 {
        let mut text = text.clone();
        for _ in 0..1 + random.word() % 2 {
            let (i, palette) = (start + random.word() as usize % (text.len() - start), b"0123456789-.e,[]{}\"abcdefg ");
            text[i] = palette[random.word() as usize % palette.len()];
        }
        fs::write(&path, text).unwrap();
        let Ok((scene, _)) = load(folder.path()) else {
            refused += 1;
            continue;
        };
        loaded += 1;
        if let Ok(baked) = bake(&scene, &BakeOptions::default(), |_, _| {}) {
            assert!(Scene::from_bytes(&baked.bytes).is_ok());
        }
    }
    assert!(loaded > 50 && refused > 50, "{loaded} loaded, {refused} refused");
}
