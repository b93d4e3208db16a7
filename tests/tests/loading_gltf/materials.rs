//! Parameters of materials and their textures.

use super::{loaded, try_load};
use croupier_host::description::*;
use croupier_host::load::{LoadOptions, load_with};
use croupier_tests::gltf::{Document, FLOAT, png};
use croupier_tests::loading::{jpeg, plain_look, try_load_with};
use serde_json::{Value, json};

fn material_of(document: &Document) -> (Material, Vec<String>) {
    let (scene, report) = try_load("a.glb", &document.glb()).unwrap_or_else(|e| panic!("{e}"));
    (scene.materials[scene.triangles[0].material as usize].clone(), report.notes)
}

fn principled(material: &Material) -> Principled {
    match material.model {
        Model::Principled(p) => p,
        other => panic!("{other:?}"),
    }
}

/// Of each parameter: the JSON and what it changes. Killed by: a parameter that is not read, another one's default, a
/// number out of range that stays.
#[test]
fn parameters() {
    let plain = Principled { metalness: 1.0, ..Principled::default() };
    let extension = |name: &str, value: Value| json!({"extensions": {name: value}});
    let transmission = |more: Value| {
        let mut extensions = json!({"KHR_materials_transmission": {"transmissionFactor": 0.75}});
        extensions.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        json!({ "extensions": extensions })
    };
    let glass = Principled { transmission: 0.75, thin_walled: true, ..plain };
    let cases: Vec<(Value, Principled)> = vec![
        (json!({}), plain),
        (
            json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 2, 1], "metallicFactor": 0.125, "roughnessFactor": 0.375}}),
            Principled { base_color: [0.5, 0.25, 1.0], metalness: 0.125, roughness: 0.375, ..plain },
        ),
        (json!({"emissiveFactor": [0.5, 0, 1]}), Principled { emission: [0.5, 0.0, 1.0], ..plain }),
        (
            json!({"emissiveFactor": [0.5, 0, 1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 12}}}),
            Principled { emission: [6.0, 0.0, 12.0], ..plain },
        ),
        (extension("KHR_materials_ior", json!({"ior": 1.75})), Principled { ior: 1.75, ..plain }),
        (extension("KHR_materials_ior", json!({})), plain),
        (
            extension("KHR_materials_specular", json!({"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 2]})),
            Principled { specular: 0.5, specular_color: [1.0, 0.5, 2.0], ..plain },
        ),
        (transmission(json!({})), glass),
        (transmission(json!({"KHR_materials_volume": {"attenuationDistance": 2}})), glass),
        (
            extension("KHR_materials_clearcoat", json!({"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25})),
            Principled { coat: 0.5, coat_roughness: 0.25, ..plain },
        ),
        (
            extension("KHR_materials_sheen", json!({"sheenColorFactor": [0.5, 0.25, 0], "sheenRoughnessFactor": 0.75})),
            Principled { sheen_color: [0.5, 0.25, 0.0], sheen_roughness: 0.75, ..plain },
        ),
        (
            extension(
                "KHR_materials_pbrSpecularGlossiness",
                json!({"diffuseFactor": [0.5, 0.25, 0, 1],
                "specularFactor": [0.02, 0.04, 0.5], "glossinessFactor": 0.75}),
            ),
            Principled {
                base_color: [0.5, 0.25, 0.0],
                roughness: 0.25,
                specular_color: [0.5, 1.0, 12.5],
                ..Principled::default()
            },
        ),
        (
            json!({"extensions": {"KHR_materials_unlit": {}}, "pbrMetallicRoughness": {"roughnessFactor": 0}}),
            Principled { specular: 0.0, ..Principled::default() },
        ),
    ];
    for (json, wanted) in cases {
        let (material, _) = material_of(&Document::of_material(json.clone()));
        assert_eq!(principled(&material), wanted, "{json}");
        assert_eq!((material.cutout, material.compensated, material.name.as_str()), (false, true, "materials[0]"));
        let two_sided = wanted.transmission == 0.0 && wanted.emission == [0.0; 3];
        assert_eq!(material.two_sided, two_sided, "{json}");
    }
    let (material, _) =
        material_of(&Document::of_material(json!({"emissiveFactor": [1, 1, 1], "doubleSided": true, "name": "lamp"})));
    assert!(material.two_sided && material.name == "lamp");
    let (material, notes) = material_of(&{
        let mut document = Document::default();
        let mesh = document.triangle(None);
        document.node(json!({"mesh": mesh}));
        document
    });
    assert_eq!(material.model, Model::Diffuse { reflectance: Reflectance::Constant([0.5; 3]) });
    assert!(notes.iter().any(|n| n.contains("grey")));
}

/// Every slot refers to its texture with its encoding. Killed by: a slot that is not read, sRGB where numbers are linear,
/// an image decoded for each slot that wants the same of it.
#[test]
fn texture_slots() {
    type Slot = (&'static [&'static str], fn(&Principled) -> Option<TextureRef>, Encoding);
    let slots: [Slot; 6] = [
        (&["pbrMetallicRoughness", "baseColorTexture"], |p| p.base_texture, Encoding::Srgb),
        (&["pbrMetallicRoughness", "metallicRoughnessTexture"], |p| p.metal_rough_texture, Encoding::Linear),
        (&["normalTexture"], |p| p.normal_texture, Encoding::Linear),
        (&["emissiveTexture"], |p| p.emission_texture, Encoding::Srgb),
        (
            &["extensions", "KHR_materials_transmission", "transmissionTexture"],
            |p| p.transmission_texture,
            Encoding::Linear,
        ),
        (&["extensions", "KHR_materials_clearcoat", "clearcoatTexture"], |p| p.coat_texture, Encoding::Linear),
    ];
    let material = json!({"emissiveFactor": [1, 1, 1], "extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_clearcoat": {"clearcoatFactor": 1}}});
    for (i, (path, slot, encoding)) in slots.iter().enumerate() {
        let mut document = Document::of_material(material.clone());
        let _other = document.texture(1, 1, &[[1, 2, 3, 4]]);
        let texture = document.texture(2, 1, &[[5, 6, 7, 8], [9, 10, 11, 12]]);
        let mut place = &mut document.json["materials"][0];
        for key in *path {
            place = &mut place[*key];
        }
        *place = json!({"index": texture});
        let (scene, _) = loaded(&document);
        let p = principled(&scene.materials[0]);
        let reference = slot(&p).unwrap_or_else(|| panic!("slot {i}"));
        assert_eq!(reference, TextureRef::new(0));
        assert_eq!(p.textures().count(), 1, "slot {i}");
        assert_eq!(scene.textures.len(), 1);
        let t = &scene.textures[0];
        assert_eq!((t.encoding, t.wrap, t.width, t.height), (*encoding, [Wrap::Repeat; 2], 2, 1), "slot {i}");
        assert_eq!(t.texels, [[5, 6, 7, 8], [9, 10, 11, 12]]);
    }
    let mut document = Document::of_material(material);
    let texture = document.texture(1, 1, &[[1, 2, 3, 4]]);
    let again = document.push("textures", json!({"source": 0}));
    let m = &mut document.json["materials"][0];
    m["pbrMetallicRoughness"] =
        json!({"baseColorTexture": {"index": texture}, "metallicRoughnessTexture": {"index": again}});
    (m["emissiveTexture"], m["normalTexture"]) = (json!({"index": again}), json!({"index": texture, "scale": -0.5}));
    let (scene, _) = loaded(&document);
    assert_eq!(scene.textures.len(), 2);
    assert_eq!(principled(&scene.materials[0]).normal_scale, -0.5);
}

/// Textures that have no place: their mean. Killed by: a channel of another slot, a mean of encoded values.
#[test]
fn textures_without_a_place_give_their_mean() {
    let mut document = Document::of_material(json!({}));
    let texture = document.texture(2, 1, &[[0, 51, 0, 102], [255, 153, 255, 204]]);
    let info = json!({"index": texture});
    document.json["materials"][0]["extensions"] = json!({
        "KHR_materials_specular": {"specularTexture": info, "specularColorTexture": info},
        "KHR_materials_sheen": {"sheenColorFactor": [1, 0, 1], "sheenColorTexture": info, "sheenRoughnessFactor": 1, "sheenRoughnessTexture": info},
        "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 1, "clearcoatRoughnessTexture": info}});
    let (material, notes) = material_of(&document);
    let p = principled(&material);
    let close = |a: f32, b: f32| (a - b).abs() < 1e-6;
    assert!(close(p.specular, 0.6) && close(p.sheen_roughness, 0.6) && close(p.coat_roughness, 0.4), "{p:?}");
    assert!(close(p.specular_color[0], 0.5) && p.sheen_color == [0.5, 0.0, 0.5], "{p:?}");
    assert_eq!(notes.iter().filter(|n| n.contains("its mean was taken")).count(), 5, "{notes:?}");
}

/// `KHR_texture_transform` and samplers. The oracle maps coordinates as the file has them, v downwards. Killed by: a sign
/// of the rotation, v that is not turned, another order of scale and rotation, `texCoord` of the extension.
#[test]
fn texture_transforms() {
    let transform = json!({"offset": [0.25, 0.5], "rotation": 0.5, "scale": [2, 3], "texCoord": 1});
    for slot in ["base", "normal"] {
        let mut document = Document::of_material(json!({}));
        document.push("samplers", json!({"wrapS": 33071, "wrapT": 33648}));
        let texture = document.texture(1, 1, &[[128; 4]]);
        document.json["textures"][texture]["sampler"] = json!(0);
        let second = document.accessor(FLOAT, 2, false, &[0.5, 0.25, 1.0, 0.0, 0.0, 1.0]);
        document.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(second);
        let info = json!({"index": texture, "extensions": {"KHR_texture_transform": transform}});
        match slot {
            "base" => document.json["materials"][0]["pbrMetallicRoughness"] = json!({ "baseColorTexture": info }),
            _ => document.json["materials"][0]["normalTexture"] = info,
        }
        let (scene, _) = loaded(&document);
        assert_eq!(scene.textures[0].wrap, [Wrap::Clamp, Wrap::Mirror]);
        let p = principled(&scene.materials[0]);
        let reference = p.base_texture.or(p.normal_texture).unwrap();
        let (sin, cos) = 0.5f64.sin_cos();
        let vertices = scene.triangles[0].vertices.map(|v| scene.vertices[v as usize].uv);
        for ([u, v], [s, t]) in vertices.into_iter().zip([[0.5f64, 0.25], [1.0, 0.0], [0.0, 1.0]]) {
            let [x, y] = reference.transform.map(|[a, b, c]| a * u + b * v + c);
            let (s, t) = (2.0 * s, 3.0 * t);
            let wanted = [cos * s + sin * t + 0.25, 1.0 - (-sin * s + cos * t + 0.5)];
            assert!((f64::from(x) - wanted[0]).abs() < 1e-6 && (f64::from(y) - wanted[1]).abs() < 1e-6, "{slot}");
        }
    }
    // another set of coordinates than the first texture's
    let mut document = Document::of_material(json!({}));
    let texture = document.texture(1, 1, &[[128; 4]]);
    document.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": texture}});
    document.json["materials"][0]["normalTexture"] = json!({"index": texture, "texCoord": 1});
    let (material, notes) = material_of(&document);
    assert!(principled(&material).normal_texture.is_none());
    assert!(notes.iter().any(|n| n.contains("materials[0].normalTexture: ignored")), "{notes:?}");
}

/// Killed by: a cutoff that is compared with the texel alone, `<=` in place of `<`, alpha of an opaque material.
#[test]
fn alpha_modes() {
    let texels = [[1, 2, 3, 0], [1, 2, 3, 127], [1, 2, 3, 128], [1, 2, 3, 255]];
    let with = |mode: &str, factor: f64, cutoff: Option<f64>, texture: bool| {
        let mut document = Document::of_material(json!({"alphaMode": mode}));
        let m = &mut document.json["materials"][0];
        m["pbrMetallicRoughness"] = json!({"baseColorFactor": [1, 1, 1, factor]});
        if let Some(cutoff) = cutoff {
            m["alphaCutoff"] = json!(cutoff);
        }
        if texture {
            let texture = document.texture(4, 1, &texels);
            document.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
        }
        let (scene, _) = try_load("a.glb", &document.glb()).unwrap();
        let alpha: Vec<u8> = scene.textures.iter().flat_map(|t| t.texels.iter().map(|t| t[3])).collect();
        (scene.materials[0].cutout, principled(&scene.materials[0]).opacity, alpha)
    };
    let all = vec![0, 127, 128, 255];
    assert_eq!(with("OPAQUE", 0.5, None, true), (false, 1.0, all.clone()));
    assert_eq!(with("BLEND", 0.5, None, true), (true, 0.5, all));
    assert_eq!(with("BLEND", 0.25, None, false), (true, 0.25, vec![]));
    assert_eq!(with("MASK", 1.0, None, true), (true, 1.0, vec![0, 0, 255, 255]));
    assert_eq!(with("MASK", 1.0, Some(127.0 / 255.0), true), (true, 1.0, vec![0, 255, 255, 255]));
    assert_eq!(with("MASK", 0.5, Some(0.4), true), (true, 1.0, vec![0, 0, 0, 255]));
    assert_eq!(with("MASK", 0.5, Some(0.75), true), (true, 1.0, vec![0; 4]));
    assert_eq!(with("MASK", 0.5, Some(0.5), false), (true, 1.0, vec![]));
    assert_eq!(with("MASK", 0.4, Some(0.5), false), (true, 0.0, vec![]));
}

/// Closed solids absorb, open ones are sheets. Killed by: a logarithm or distance that is missing, a boundary that is not
/// checked, a medium without absorption.
#[test]
fn volumes() {
    let solid = |faces: &[[f64; 3]], volume: Value| {
        let mut document = Document::default();
        let position = document.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let indices = document.accessor(croupier_tests::gltf::U8, 1, false, faces.as_flattened());
        let extensions =
            json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": volume});
        let material = document.push("materials", json!({"name": "amber", "extensions": extensions}));
        let mesh =
            document.mesh(json!({"attributes": {"POSITION": position}, "indices": indices, "material": material}));
        document.node(json!({ "mesh": mesh }));
        loaded(&document)
    };
    let closed = [[0.0, 2.0, 1.0], [0.0, 1.0, 3.0], [0.0, 3.0, 2.0], [1.0, 2.0, 3.0]];
    let volume = json!({"thicknessFactor": 0.5, "attenuationColor": [0.5, 1, 0], "attenuationDistance": 2});
    let (scene, _) = solid(&closed, volume.clone());
    assert_eq!((scene.media.len(), scene.materials[0].medium), (1, Some(0)));
    let [r, g, b] = scene.media[0].sigma_a;
    assert!((r - std::f32::consts::LN_2 / 2.0).abs() < 1e-6 && g == 0.0 && (b - 6.9077554).abs() < 1e-5);
    assert_eq!(scene.media[0].sigma_s, [0.0; 3]);
    assert!(!principled(&scene.materials[0]).thin_walled && !scene.materials[0].two_sided);
    let (scene, _) = solid(&closed, json!({"thicknessFactor": 0.5}));
    assert!(scene.media.is_empty() && !principled(&scene.materials[0]).thin_walled);
    let inside_out = closed.map(|[a, b, c]| [a, c, b]);
    for open in [&closed[..3], &inside_out] {
        let (scene, notes) = solid(open, volume.clone());
        assert!(scene.media.is_empty() && principled(&scene.materials[0]).thin_walled);
        assert!(notes.iter().any(|n| n.contains("`amber`") && n.contains("thin sheet")), "{notes:?}");
    }
}

/// Solids whose vertices have colours absorb as others do, and copies of a material share a medium; what is closed only
/// together with something that is an instance is a sheet. Killed by: a copy of the material that is no solid, a boundary
/// that is not what baking checks.
#[test]
fn volumes_of_colors_and_instances() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let faces = [[0.0, 2.0, 1.0], [0.0, 1.0, 3.0], [0.0, 3.0, 2.0], [1.0, 2.0, 3.0]];
    let amber = json!({"name": "amber", "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 0.5, "attenuationColor": [0.5, 1, 0], "attenuationDistance": 2}}});
    let mut document = Document::default();
    document.push("materials", amber);
    let position = document.floats(&points);
    let color = document.floats(&points.map(|[r, g, b]| [r, g, b, 1.0]));
    let mut part = |faces: &[[f64; 3]], color: Option<usize>| {
        let indices = document.accessor(croupier_tests::gltf::U8, 1, false, faces.as_flattened());
        let mut attributes = json!({"POSITION": position});
        if let Some(color) = color {
            attributes["COLOR_0"] = json!(color);
        }
        document.mesh(json!({"attributes": attributes, "indices": indices, "material": 0}))
    };
    let [whole, plain, three, one] =
        [part(&faces, Some(color)), part(&faces, None), part(&faces[..3], None), part(&faces[3..], None)];
    let mut solid = document.clone();
    solid.node(json!({ "mesh": whole }));
    solid.node(json!({"mesh": whole, "translation": [9, 0, 0]}));
    solid.node(json!({"mesh": plain, "translation": [0, 9, 0]}));
    let (scene, _) = loaded(&solid);
    let of = |t: usize| &scene.materials[scene.triangles[t].material as usize];
    assert_eq!((scene.media.len(), of(0).medium, of(4).medium, of(8).medium), (1, Some(0), Some(0), Some(0)));
    assert!([0, 4].iter().all(|t| principled(of(*t)).base_texture.is_some() && !principled(of(*t)).thin_walled));
    // a prototype of three sides, placed often, and the fourth one in the world
    let mut halves = document.clone();
    let places = halves.accessor(FLOAT, 3, false, &[0.0; 3 * 1500]);
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}});
    halves.node(json!({"mesh": three, "extensions": extension}));
    halves.node(json!({ "mesh": one }));
    let (scene, notes) = loaded(&halves);
    assert_eq!((scene.instances.len(), scene.media.len(), scene.triangles.len()), (1500, 0, 4));
    assert!(principled(&scene.materials[0]).thin_walled && notes.iter().any(|n| n.contains("thin sheet")), "{notes:?}");
}

/// Images by URI, missing ones, and ones of extensions. Killed by: a missing file that is an error, or none where the
/// options are strict; a fallback that is not taken, an extension that is not named.
#[test]
fn images() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a b.png"), png(1, 1, &[[9, 8, 7, 255]])).unwrap();
    let load = |image: Value, texture: Value| {
        let mut document = Document::of_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
        document.push("images", image);
        document.push("textures", texture);
        std::fs::write(folder.path().join("a.gltf"), document.embedded()).unwrap();
        croupier_host::load::load(&folder.path().join("a.gltf")).map_err(|e| e.to_string())
    };
    let base64 = format!("data:image/png;base64,{}", croupier_tests::gltf::base64(&png(1, 1, &[[9, 8, 7, 255]])));
    for uri in ["a%20b.png", base64.as_str()] {
        let (scene, _) = load(json!({ "uri": uri }), json!({"source": 0})).unwrap();
        assert_eq!(scene.textures[0].texels, [[9, 8, 7, 255]]);
    }
    let (scene, report) = load(json!({"uri": "no.png"}), json!({"source": 0})).unwrap();
    assert!(scene.textures.is_empty() && principled(&scene.materials[0]).base_texture.is_none());
    let told =
        |n: &str| n.contains("no.png, which ") && n.contains("(images[0].uri) names") && n.contains("without it");
    assert!(report.notes.iter().any(|n| told(n)), "{report:?}");
    let basis = json!({"KHR_texture_basisu": {"source": 1}});
    let (scene, _) = load(json!({"uri": "a%20b.png"}), json!({"source": 0, "extensions": basis})).unwrap();
    assert_eq!(scene.textures.len(), 1);
    let error = load(json!({"uri": "a%20b.png"}), json!({ "extensions": basis })).unwrap_err();
    assert!(error.contains("textures[0]: its image is of the extension KHR_texture_basisu"), "{error}");
    // of another case, with bytes behind the end, and what `strict` says of both
    std::fs::write(folder.path().join("case.png"), png(1, 1, &[[9, 8, 7, 255]])).unwrap();
    std::fs::write(folder.path().join("long.jpg"), [jpeg(&[&[200]]), vec![0; 9]].concat()).unwrap();
    let strict = LoadOptions { strict: true, ..LoadOptions::default() };
    for (uri, said) in [
        ("no.png", "(images[0].uri) names"),
        ("Case.PNG", "(images[0].uri) names"),
        ("case.png/a.png", "(images[0].uri) names"),
        ("long.jpg", "images[0]: there are bytes behind the end of the JPEG"),
    ] {
        let (_, report) = load(json!({ "uri": uri }), json!({"source": 0})).unwrap();
        assert!(report.notes.iter().any(|n| n.contains(said)), "{uri}: {report:?}");
        let error = load_with(&folder.path().join("a.gltf"), &strict, &plain_look()).unwrap_err().to_string();
        assert!(error.contains(said), "{uri}: {error}");
    }
}

/// Texels of which the mean is taken are not kept. Killed by: their bytes counted as those of the next texture.
#[test]
fn texture_memory() {
    let mut document = Document::of_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}));
    let [sheen, base] = [document.texture(16, 16, &[[9; 4]; 256]), document.texture(16, 16, &[[9; 4]; 256])];
    assert_eq!((sheen, base), (0, 1));
    let material = &mut document.json["materials"][0];
    material["extensions"] = json!({"KHR_materials_specular": {"specularTexture": {"index": sheen}}});
    let second = document.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let mesh = document.triangle(Some(second));
    document.node(json!({"mesh": mesh}));
    // 8 bytes a texel while one is decoded, 4 of one that stays
    let load = |texture_memory: u64| {
        let options = LoadOptions { texture_memory, ..LoadOptions::default() };
        try_load_with("a.glb", &document.glb(), &options, &plain_look())
    };
    assert_eq!(load(256 * 12).unwrap().0.textures.len(), 2);
    let error = load(256 * 12 - 1).unwrap_err();
    assert!(error.contains("images[0]: 16 x 16 pixels take 2.00 KiB to decode, 2.00 KiB of"), "{error}");
}
