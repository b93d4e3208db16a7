//! Files that are wrong, and what they are told.

use super::try_load;
use croupier_tests::gltf::{Document, FLOAT, U8, U16};
use croupier_tests::stats::SplitMix;
use serde_json::{Value, json};

/// A document with something of every kind.
fn everything() -> Document {
    let mut document = Document::of_material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "normalTexture": {"index": 0}, "alphaMode": "MASK", "extensions": {"KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1]}}}));
    document.texture(2, 1, &[[1, 2, 3, 4], [5, 6, 7, 255]]);
    document.push("samplers", json!({"wrapS": 10497}));
    document.json["textures"][0]["sampler"] = json!(0);
    let position = document.accessor(U16, 3, true, &[0.0, 0.0, 0.0, 9e3, 0.0, 0.0, 0.0, 9e3, 1.0, 9e3, 9e3, 9e3]);
    let indices = document.accessor(U8, 1, false, &[0.0, 1.0, 2.0, 2.0, 1.0, 3.0]);
    let sparse_indices = document.view(&[3]);
    let sparse_values = document.view(&croupier_tests::gltf::encode(U16, &[1.0, 2.0, 3.0]));
    document.json["accessors"][position]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": sparse_indices, "componentType": U8}, "values": {"bufferView": sparse_values}});
    let joints = document.accessor(U8, 4, false, &[0.0; 16]);
    let weights = document.accessor(FLOAT, 4, false, &[1.0; 16]);
    let color = document.accessor(FLOAT, 3, false, &[0.1, 0.5, 1.0, 0.3, 0.2, 0.1, 0.9, 0.8, 0.7, 0.2, 0.2, 0.2]);
    let matrices = document.accessor(FLOAT, 16, false, &[1.0; 16]);
    let attributes = json!({"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights, "COLOR_0": color});
    document.push("materials", json!({"emissiveFactor": [1, 0, 0]}));
    let mesh = document.mesh(json!({"attributes": attributes, "indices": indices, "mode": 5, "material": 1}));
    document.push("skins", json!({"joints": [1], "inverseBindMatrices": matrices}));
    document.node(json!({"mesh": mesh, "skin": 0}));
    document.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}));
    document.node(json!({"camera": 0}));
    let places = document.floats(&[[0.0, 0.0, 0.0], [0.0, 5.0, 0.0]]);
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}});
    document.node(json!({"mesh": 0, "extensions": extension}));
    document.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}});
    document.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    document
}

/// A value of the document by its path.
fn place<'v>(json: &'v mut Value, path: &str) -> &'v mut Value {
    path.split('.').fold(json, |value, key| match key.parse::<usize>() {
        Ok(i) => &mut value[i],
        Err(_) => &mut value[key],
    })
}

/// Each change of a sound document and the place that the message names. Killed by: a panic, a file that is taken, an
/// error that does not say where.
#[test]
fn wrong_values_are_named() {
    assert!(try_load("a.glb", &everything().glb()).is_ok());
    let cases: Vec<(&str, Value, &str)> = vec![
        ("asset.version", json!("1.0"), "@/a.glb: asset.version: `1.0`, only 2.x"),
        ("scene", json!(4), "scene: there is no scenes[4], there are 1"),
        ("scenes.0.nodes.0", json!(9), "scenes[0].nodes[0]: there is no nodes[9]"),
        ("nodes.0.children", json!([0]), "nodes[0]: it is in the scene twice"),
        ("nodes.0.mesh", json!(7), "there is no meshes[7]"),
        ("nodes.1.skin", json!(1), "there is no skins[1]"),
        ("nodes.2.camera", json!(3), "nodes[2]: there is no cameras[3]"),
        ("nodes.2.scale", json!([0, 0, 0]), "nodes[2]: its transformation leaves no direction"),
        (
            "nodes.4.extensions.KHR_lights_punctual.light",
            json!(1),
            "nodes[4]: there is no extensions.KHR_lights_punctual.lights[1]",
        ),
        ("extensions.KHR_lights_punctual.lights.0.type", json!("sun"), "nodes[4]: its light is none"),
        (
            "nodes.3.extensions.EXT_mesh_gpu_instancing.attributes.TRANSLATION",
            json!(99),
            "attributes.TRANSLATION: there is no accessors[99]",
        ),
        (
            "meshes.1.primitives.0.attributes.POSITION",
            json!(99),
            "meshes[1].primitives[0].attributes.POSITION: there is no accessors[99]",
        ),
        (
            "meshes.1.primitives.0.attributes.POSITION",
            json!(4),
            "accessors[4]: Scalar, but meshes[1].primitives[0].attributes.POSITION needs",
        ),
        ("meshes.1.primitives.0.mode", json!(9), "meshes[1].primitives[0].mode: a kind"),
        ("meshes.1.primitives.0.material", json!(5), "meshes[1].primitives[0].material: there is no materials[5]"),
        ("accessors.4.count", json!(7), "accessors[4]: 7 elements of 1 bytes"),
        ("accessors.4.count", json!(u64::MAX), "accessors[4]: "),
        (
            "nodes.3.extensions.EXT_mesh_gpu_instancing.attributes",
            json!({}),
            "nodes[3].extensions.EXT_mesh_gpu_instancing.attributes: accessors of []",
        ),
        ("accessors.4.componentType", json!(5121.0), "not a glTF document"),
        ("accessors.4.componentType", json!(1), "accessors[4]: a type"),
        ("accessors.3.byteOffset", json!(u64::MAX), "accessors[3]: "),
        ("accessors.3.sparse.count", json!(99), "accessors[3]: 99 elements"),
        ("accessors.3.sparse.indices.bufferView", json!(99), "accessors[3]: there is no bufferViews[99]"),
        ("accessors.3.count", json!(3), "accessors[3]: a sparse value for element 3 of 3"),
        ("accessors.5.count", json!(2), "meshes[1].primitives[0]: 2 elements of JOINTS for 4 vertices"),
        ("bufferViews.0.byteLength", json!(99999), "bufferViews[0]: bytes 0 to 0 + 99999 of a buffer of"),
        ("bufferViews.0.byteOffset", json!(u64::MAX), "bufferViews[0]: bytes"),
        ("bufferViews.0.byteStride", json!(usize::MAX), "accessors[0]: "),
        ("bufferViews.0.buffer", json!(1), "bufferViews[0]: there is no buffers[1]"),
        ("textures.0.source", json!(2), "textures[0]: there is no images[2]"),
        ("textures.0.sampler", json!(2), "textures[0]: there is no samplers[2]"),
        ("samplers.0.wrapS", json!(2), "textures[0]: its sampler wraps"),
        ("images.0", json!({}), "images[0]: neither a URI nor a buffer view"),
        ("images.0.bufferView", json!(0), "images[0]: not a readable PNG or JPEG"),
        ("images.0.uri", json!("../../a.png"), "images[0].uri: the URI `../../a.png` leads out of the folder"),
        ("images.0.uri", json!("a/%2e%2e/../b.png"), "leads out of the folder"),
        ("images.0.uri", json!("/etc/a.png"), "leads out of the folder"),
        ("images.0.uri", json!("http://a.b/c.png"), "is no relative path"),
        ("images.0.uri", json!("C:\\a.png"), "is no relative path"),
        ("images.0.uri", json!("data:image/png;base64,*"), "not base64"),
        ("images.0.uri", json!("data:image/png"), "without a comma"),
        ("materials.0.alphaMode", json!("GLASS"), "materials[0].alphaMode: neither"),
        ("materials.0.normalTexture.index", json!(3), "materials[0].normalTexture: there is no textures[3]"),
        ("materials.0.extensions.KHR_materials_sheen", json!({"sheenColorFactor": "red"}), "materials[0].extensions: "),
        ("skins.0.joints", json!([1, 1]), "skins[0]: fewer matrices than its 2 joints"),
        ("skins.0.joints", json!([77]), "skins[0]: the joint nodes[77] is not in the scene"),
        (
            "extensionsRequired",
            json!(["EXT_meshopt_compression"]),
            "extensionsRequired[0]: the extension `EXT_meshopt_compression` is required",
        ),
        ("extensionsRequired", json!(["KHR_draco_mesh_compression"]), "`KHR_draco_mesh_compression` is required"),
    ];
    for (path, value, wanted) in cases {
        let mut document = everything();
        *place(&mut document.json, path) = value.clone();
        let error = try_load("a.glb", &document.glb()).err().unwrap_or_else(|| panic!("{path} {value} was taken"));
        assert!(
            error.contains(wanted) && error.len() < 300 && error.lines().count() == 1,
            "{path}: {error:?}: {wanted}"
        );
    }
    let mut document = everything();
    document.json["extensionsRequired"] = json!(["KHR_materials_iridescence"]);
    document.json["extensionsUsed"] = json!(["KHR_materials_iridescence", "KHR_materials_sheen"]);
    document.push("animations", json!({"channels": [], "samplers": []}));
    let (_, report) = try_load("a.glb", &document.glb()).unwrap();
    let noted = |what: &str| report.notes.iter().any(|n| n.contains(what));
    assert!(noted("ignored: `KHR_materials_iridescence`") && noted("1 animations were ignored"), "{report:?}");
}

/// Compressed data without a plain copy. Killed by: zeros in place of an error, an extension that is not named.
#[test]
fn compressed_data_is_refused_by_name() {
    let mut document = everything();
    let accessor = document.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
    document.json["accessors"][accessor].as_object_mut().unwrap().remove("bufferView");
    document.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}});
    let error = try_load("a.glb", &document.glb()).unwrap_err();
    assert!(error.contains("meshes[0].primitives[0]: compressed with KHR_draco_mesh_compression"), "{error}");
    let mut document = everything();
    let extension = json!({"EXT_meshopt_compression": {"buffer": 0, "byteLength": 9, "byteStride": 4, "count": 3, "mode": "ATTRIBUTES"}});
    document.json["bufferViews"][0]["extensions"] = extension;
    assert!(try_load("a.glb", &document.glb()).is_ok(), "a plain copy is there");
    document.json["bufferViews"][0]["byteOffset"] = json!(1 << 30);
    let error = try_load("a.glb", &document.glb()).unwrap_err();
    assert!(error.contains("bufferViews[0]: compressed with EXT_meshopt_compression"), "{error}");
}

/// Containers that are cut or lie. Killed by: an index past the end, a subtraction below 0.
#[test]
fn broken_containers() {
    let glb = everything().glb();
    let changed = |at: usize, word: u32| {
        let mut glb = glb.clone();
        glb[at..at + 4].copy_from_slice(&word.to_le_bytes());
        glb
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("a.glb", glb[..6].to_vec(), "@/a.glb: byte 0: the file ends within its header"),
        ("a.glb", glb[..glb.len() - 9].to_vec(), "byte 8: the header states"),
        ("a.glb", changed(4, 1), "byte 4: version 1 of binary glTF"),
        ("a.glb", changed(12, u32::MAX), "byte 12: a chunk of 4294967295 bytes"),
        ("a.glb", changed(16, 7), "no chunk of JSON"),
        ("a.glb", changed(8, 0), ""),
        ("a.gltf", b"".to_vec(), "line 1 column 0: not a glTF document"),
        (
            "a.gltf",
            b"{\n  \"asset\": {\"version\": \"2.0\"},\n  nodes".to_vec(),
            "line 3 column 3: not a glTF document",
        ),
        (
            "a.gltf",
            b"{\"asset\": {\"version\": \"1.0\"}, \"nodes\": {\"a\": {}}}".to_vec(),
            "asset.version: `1.0`, only 2.x",
        ),
        ("a.gltf", b"{\"asset\": {\"version\": \"2.0\"}}".to_vec(), "no triangles in its scene"),
        ("a.gltf", [b"{\"asset\":".repeat(9000), vec![]].concat(), "not a glTF document"),
    ];
    for (name, bytes, wanted) in cases {
        match try_load(name, &bytes) {
            Ok(_) => assert_eq!(wanted, "", "{name} was taken"),
            Err(error) => assert!(error.contains(wanted) && error.len() < 300, "{error:?}: {wanted}"),
        }
    }
    let document = everything();
    let error = try_load("a.gltf", &document.gltf("no.bin")).unwrap_err();
    assert!(error.contains("cannot read @/no.bin, which @/a.gltf (buffers[0].uri) names"), "{error}");
    let error = try_load("a.gltf", &document.gltf("data:;base64,AAAA")).unwrap_err();
    assert!(error.contains("buffers[0]: 3 bytes, but"), "{error}");
}

/// Bytes and values changed at random. Killed by: a panic, or memory that a number in the file decides.
#[test]
fn corrupted_files_are_survived() {
    let document = everything();
    let glb = document.glb();
    let text = document.embedded();
    let mut random = SplitMix(11);
    let mut below = |n: usize| (random.bits() % n.max(1) as u64) as usize;
    let mut taken = 0;
    for round in 0..2000 {
        let (name, mut bytes) = if round % 2 == 0 { ("a.glb", glb.clone()) } else { ("a.gltf", text.clone()) };
        // mostly in the JSON
        let most = if below(4) == 0 { bytes.len() } else { bytes.len().min(6000) };
        for _ in 0..=below(3) {
            let at = below(most).min(bytes.len() - 1);
            match below(5) {
                0 => bytes.truncate(at.max(1)),
                1 => bytes[at] = below(256) as u8,
                2 => bytes[at] ^= 1 << below(8),
                _ => {
                    // a digit becomes another, so that the JSON stays one
                    if let Some(digit) = bytes.iter().skip(at).position(u8::is_ascii_digit) {
                        bytes[at + digit] = b'0' + below(10) as u8;
                    }
                }
            }
        }
        taken += u32::from(try_load(name, &bytes).is_ok());
    }
    assert!(taken > 50, "{taken}: the changes leave nothing to read");
}

/// Small files that ask for much. Killed by: a count, a stride of 0, shared indices or many places of one mesh that decide
/// an allocation.
#[test]
fn bombs_are_refused() {
    let error = |document: &Document| try_load("a.glb", &document.glb()).unwrap_err();
    // a stride of 0, with which any count fits
    let mut document = Document::of_material(json!({}));
    document.json["bufferViews"][0]["byteStride"] = json!(0);
    document.json["accessors"][0]["count"] = json!(1u64 << 40);
    assert!(error(&document).contains("accessors[0]: 1099511627776 elements of 12 bytes, every 12"));
    // zeros without a buffer view
    document.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(error(&document).contains("accessors[0]: 1099511627776 elements without a buffer view"));
    // many primitives of the same indices
    let mut document = Document::default();
    let position = document.floats(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let indices = document.accessor(U8, 1, false, &[0.0, 1.0, 2.0].repeat(20_000));
    let primitive = json!({"attributes": {"POSITION": position}, "indices": indices});
    document.push("meshes", json!({"primitives": vec![primitive; 300]}));
    document.node(json!({"mesh": 0}));
    assert!(error(&document).contains("triangles in a document of its size"));
    // a mesh in many places
    let mut document = Document::default();
    let mesh = document.triangle(None);
    let places = document.accessor(U8, 3, false, &[0.0; 3 * 60_000]);
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}});
    for _ in 0..80 {
        document.node(json!({"mesh": mesh, "extensions": extension}));
    }
    assert!(error(&document).contains("nodes[2]: more than 131072 meshes in the scene"));
    // skinned copies
    let mut document = Document::default();
    let position = document.floats(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let indices = document.accessor(U8, 1, false, &[0.0, 1.0, 2.0].repeat(20_000));
    document.mesh(json!({"attributes": {"POSITION": position}, "indices": indices}));
    document.node(json!({}));
    document.push("skins", json!({"joints": [0]}));
    for _ in 0..300 {
        document.node(json!({"mesh": 0, "skin": 0}));
    }
    assert!(error(&document).contains("meshes[0]: 6000000 triangles in a document of its size"));
}
