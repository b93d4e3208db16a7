//! Accessors and primitives.

use super::{corners, loaded, positions, rounded, try_load};
use croupier_host::description::*;
use croupier_host::load::{LoadOptions, load_with};
use croupier_tests::gltf::{Document, FLOAT, I8, I16, U8, U16, U32, base64};
use croupier_tests::loading::plain_look;
use serde_json::{Value, json};

const POINTS: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.5], [2.0, 1.0, 0.0], [0.0, 2.0, 0.0], [2.0, 2.0, 1.0]];

fn triangles(indices: &[[usize; 3]]) -> Vec<[[f32; 3]; 3]> {
    indices.iter().map(|t| t.map(|i| POINTS[i].map(|x| x as f32))).collect()
}

fn primitive_of(mut document: Document, attributes: Value, more: Value) -> Document {
    let mut primitive = json!({ "attributes": attributes });
    primitive.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    let mesh = document.mesh(primitive);
    document.node(json!({"mesh": mesh, "name": "thing"}));
    document
}

/// Killed by: a mode, an index type, or a strip whose every second triangle faces back; vertices that no triangle uses;
/// a list without indices.
#[test]
fn modes_and_indices() {
    type Case = (u32, &'static [usize], &'static [[usize; 3]]);
    const STRIP: [[usize; 3]; 4] = [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]];
    let cases: [Case; 5] = [
        (4, &[0, 1, 2, 2, 1, 3], &[[0, 1, 2], [2, 1, 3]]),
        (4, &[5, 4, 3, 0], &[[5, 4, 3]]),
        (5, &[0, 1, 2, 3, 4, 5], &STRIP),
        (6, &[0, 1, 3, 2], &[[1, 3, 0], [3, 2, 0]]),
        (5, &[4, 5, 3], &[[4, 5, 3]]),
    ];
    for (mode, indices, wanted) in cases {
        for component in [U8, U16, U32] {
            let mut document = Document::default();
            let position = document.floats(&POINTS);
            let values: Vec<f64> = indices.iter().map(|i| *i as f64).collect();
            let indices = document.accessor(component, 1, false, &values);
            let document =
                primitive_of(document, json!({"POSITION": position}), json!({"indices": indices, "mode": mode}));
            let (scene, _) = loaded(&document);
            assert_eq!(positions(&scene), triangles(wanted), "mode {mode}, type {component}");
            assert!(scene.triangles.iter().all(|t| !t.smooth));
            let used: std::collections::BTreeSet<usize> = wanted.iter().flatten().copied().collect();
            assert_eq!((scene.vertices.len(), scene.object_of(0)), (used.len(), "thing"));
        }
    }
    for (mode, wanted) in [(4, [[0, 1, 2], [3, 4, 5]].as_slice()), (5, STRIP.as_slice())] {
        let mut document = Document::default();
        let position = document.floats(&POINTS);
        let (scene, _) = loaded(&primitive_of(document, json!({"POSITION": position}), json!({ "mode": mode })));
        assert_eq!(positions(&scene), triangles(wanted), "mode {mode}");
    }
}

/// Points and lines are left out and counted. Killed by: lines that become triangles.
#[test]
fn points_and_lines_are_left_out() {
    for mode in 0..4 {
        let mut document = Document::default();
        let position = document.floats(&POINTS);
        let lines = document.mesh(json!({"attributes": {"POSITION": position}, "mode": mode}));
        let mesh = document.triangle(None);
        document.node(json!({"mesh": lines}));
        let alone = try_load("a.glb", &document.glb()).unwrap_err();
        assert!(alone.contains("no triangles in its scene"), "{alone}");
        document.node(json!({"mesh": mesh}));
        let (scene, report) = try_load("a.glb", &document.glb()).unwrap();
        assert_eq!((scene.triangles.len(), report.skipped_elements), (1, 1));
    }
}

/// Killed by: a stride or an offset that does not count; texture coordinates with v as in the file.
#[test]
fn interleaved_vertices() {
    let mut document = Document::default();
    let row = |i: usize| [POINTS[i].as_slice(), &[0.0, 0.6, 0.8], &[0.25 * i as f64, 0.125]].concat();
    let bytes: Vec<u8> = (0..3).flat_map(row).flat_map(|x| (x as f32).to_le_bytes()).collect();
    let view = document.view(&[&[0; 8], bytes.as_slice()].concat());
    document.json["bufferViews"][view]["byteStride"] = json!(32);
    let mut accessor = |offset: u32, kind: &str| {
        let value =
            json!({"bufferView": view, "byteOffset": 8 + offset, "componentType": FLOAT, "count": 3, "type": kind});
        document.push("accessors", value)
    };
    let [position, normal, uv] = [accessor(0, "VEC3"), accessor(12, "VEC3"), accessor(24, "VEC2")];
    let attributes = json!({"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv});
    let (scene, _) = loaded(&primitive_of(document, attributes, json!({})));
    for (i, v) in corners(&scene)[0].iter().enumerate() {
        let wanted =
            Vertex { position: POINTS[i].map(|x| x as f32), normal: [0.0, 0.6, 0.8], uv: [0.25 * i as f32, 0.875] };
        assert_eq!(*v, wanted);
    }
    assert!(scene.triangles[0].smooth);
}

/// Sparse accessors on a base and on zeros. Killed by: values at the wrong index, in the order of the file, or dropped.
#[test]
fn sparse_accessors() {
    for index_type in [U8, U16, U32] {
        for based in [true, false] {
            let mut document = Document::default();
            let position = document.floats(&POINTS[..3]);
            // unordered, which is not allowed but harmless
            let indices = document.view(&croupier_tests::gltf::encode(index_type, &[2.0, 1.0]));
            let values = document.view(&croupier_tests::gltf::encode(FLOAT, &[0.0, 7.0, 0.0, 5.0, 0.0, 0.0]));
            let accessor = &mut document.json["accessors"][position];
            accessor["sparse"] = json!({"count": 2, "indices": {"bufferView": indices, "componentType": index_type,
                "byteOffset": 0}, "values": {"bufferView": values, "byteOffset": 0}});
            if !based {
                accessor.as_object_mut().unwrap().remove("bufferView");
            }
            let (scene, _) = loaded(&primitive_of(document, json!({"POSITION": position}), json!({})));
            assert_eq!(positions(&scene), [[[0.0; 3], [5.0, 0.0, 0.0], [0.0, 7.0, 0.0]]]);
        }
    }
}

/// `KHR_mesh_quantization`. Killed by: a normalisation that is missing, by 2^n, or applied where none is asked for.
#[test]
fn quantised_meshes() {
    let cases = [(I8, 127.0), (U8, 255.0), (I16, 32767.0), (U16, 65535.0)];
    for (component, most) in cases {
        for normalized in [false, true] {
            let mut document = Document::default();
            document.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
            document.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
            let values = [0.0, 0.0, 0.0, most, 0.0, 0.0, 0.0, 51.0, 0.0];
            let position = document.accessor(component, 3, normalized, &values);
            let normal = document.accessor(I8, 3, true, &[0.0, 0.0, 127.0, 0.0, -128.0, 0.0, 127.0, 0.0, 0.0]);
            let uv = document.accessor(U16, 2, true, &[0.0, 0.0, 65535.0, 0.0, 13107.0, 65535.0]);
            let attributes = json!({"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv});
            let (scene, _) = loaded(&primitive_of(document, attributes, json!({})));
            let unit = if normalized { most } else { 1.0 };
            let [a, b, c] = corners(&scene)[0];
            assert_eq!((a.position, b.position), ([0.0; 3], [(most / unit) as f32, 0.0, 0.0]));
            assert_eq!(c.position, [0.0, (51.0 / unit) as f32, 0.0]);
            // -128 is -1 as well
            assert_eq!([a, b, c].map(|v| v.normal), [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]);
            assert_eq!([a, b, c].map(|v| v.uv), [[0.0, 1.0], [1.0, 1.0], [0.2, 0.0]]);
        }
    }
}

/// One document in every container gives one scene. Killed by: a chunk that is not found, base64 without padding, a name
/// with escapes, a byte order mark, a file whose extension says another kind.
#[test]
fn containers() {
    let mut document = Document::default();
    let mesh = document.triangle(None);
    document.node(json!({"mesh": mesh}));
    document.bytes.push(1);
    let glb = document.glb();
    let wanted = positions(&try_load("a.glb", &glb).unwrap().0);
    assert_eq!(wanted.len(), 1);
    let embedded = document.embedded();
    let padless = document.gltf(&format!("data:;base64,{}", base64(&document.bytes).trim_end_matches('=')));
    let bom = [b"\xef\xbb\xbf", embedded.as_slice()].concat();
    // chunks of unknown types before and after
    let unknown = [&4u32.to_le_bytes(), b"WHAT", b"1234".as_slice()].concat();
    let mut more = [&glb, unknown.as_slice()].concat();
    let length = more.len() as u32;
    more[8..12].copy_from_slice(&length.to_le_bytes());
    let files: [(&str, &[u8]); 6] = [
        ("a.gltf", &embedded),
        ("a.gltf", &padless),
        ("a.gltf", &bom),
        ("a.gltf", &glb),
        ("a.obj", &glb),
        ("a.glb", &more),
    ];
    for (i, (name, bytes)) in files.iter().enumerate() {
        let (scene, _) = try_load(name, bytes).unwrap_or_else(|e| panic!("file {i}: {e}"));
        assert_eq!(positions(&scene), wanted, "file {i}");
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    for (uri, file) in [("my%20file.bin", "my file.bin"), ("sub/a%23.bin", "sub/a#.bin"), ("./b.bin", "b.bin")] {
        std::fs::write(folder.path().join(file), &document.bytes).unwrap();
        std::fs::write(folder.path().join("a.gltf"), document.gltf(uri)).unwrap();
        let loaded = load_with(&folder.path().join("a.gltf"), &LoadOptions::default(), &plain_look());
        let (scene, report) = loaded.unwrap();
        assert_eq!((positions(&scene), report.files.len()), (wanted.clone(), 2));
    }
}

/// Constant colours go to the material, others to a texture, unless the material has one. Killed by: colours that are
/// lost or count twice; a copy of the material that others get as well.
#[test]
fn colors_of_vertices() {
    let with = |colors: &[f64], component: u32, width: usize, texture: bool| {
        let mut document = Document::default();
        let position = document.floats(&POINTS[..3]);
        let color = document.accessor(component, width, component != FLOAT, colors);
        let mut pbr = json!({"baseColorFactor": [0.5, 1, 1, 1]});
        if texture {
            pbr["baseColorTexture"] = json!({"index": document.texture(1, 1, &[[9; 4]])});
        }
        let material = document.push("materials", json!({ "pbrMetallicRoughness": pbr }));
        loaded(&primitive_of(document, json!({"POSITION": position, "COLOR_0": color}), json!({"material": material})))
    };
    let principled = |scene: &SceneDescription| match scene.materials[scene.triangles[0].material as usize].model {
        Model::Principled(p) => p,
        other => panic!("{other:?}"),
    };
    let (scene, _) = with(&[0.5, 0.25, 1.0].repeat(3), FLOAT, 3, false);
    assert_eq!(principled(&scene).base_color, [0.25, 0.25, 1.0]);
    let (scene, _) = with(&[255.0, 51.0, 0.0, 255.0].repeat(3), U8, 4, true);
    assert_eq!(principled(&scene).base_color, [0.5, 0.2, 0.0]);
    let gradient = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    let (scene, notes) = with(&gradient, FLOAT, 3, true);
    assert_eq!((principled(&scene).base_color, scene.textures.len()), ([0.5, 1.0, 1.0], 1));
    assert!(notes.iter().any(|n| n.contains("meshes[0].primitives[0]: colours of vertices were ignored")), "{notes:?}");
    let (scene, _) = with(&gradient, FLOAT, 3, false);
    let p = principled(&scene);
    let texture = &scene.textures[p.base_texture.unwrap().texture as usize];
    assert_eq!(p.base_color, [0.5, 1.0, 1.0]);
    for v in corners(&scene)[0] {
        let x = (v.uv[0] * texture.width as f32 - 0.5).round() as usize;
        let y = ((1.0 - v.uv[1]) * texture.height as f32 - 0.5).round() as usize;
        let wanted = POINTS[..3].iter().position(|p| p.map(|x| x as f32) == v.position).unwrap();
        let wanted = [0, 1, 2].map(|c| (255.0 * gradient[3 * wanted + c]) as u8);
        assert_eq!(texture.texels[y * texture.width as usize + x][..3], wanted);
    }
}

/// Alpha of vertices by alpha mode, on a material of alpha 0.5. Killed by: alpha that is lost, is encoded as colours are,
/// or meets a cutoff without the material's.
#[test]
fn alpha_of_vertices() {
    let alphas = [0.0, 0.7, 1.0];
    for (mode, wanted, opacity) in
        [("OPAQUE", [255; 3], 1.0), ("BLEND", [0, 179, 255], 0.5), ("MASK", [0, 0, 255], 1.0)]
    {
        let mut document = Document::default();
        let position = document.floats(&POINTS[..3]);
        let color = document.floats(&alphas.map(|a| [0.25, 0.5, 1.0, a]));
        let pbr = json!({"baseColorFactor": [1, 1, 1, 0.5]});
        let material =
            document.push("materials", json!({"alphaMode": mode, "alphaCutoff": 0.4, "pbrMetallicRoughness": pbr}));
        let attributes = json!({"POSITION": position, "COLOR_0": color});
        let (scene, _) = loaded(&primitive_of(document, attributes, json!({"material": material})));
        let material = &scene.materials[scene.triangles[0].material as usize];
        let Model::Principled(p) = material.model else { panic!("{material:?}") };
        assert_eq!((material.cutout, p.opacity), (mode != "OPAQUE", opacity), "{mode}");
        let texture = &scene.textures[p.base_texture.unwrap().texture as usize];
        for v in corners(&scene)[0] {
            let x = (v.uv[0] * texture.width as f32 - 0.5).round() as usize;
            let y = ((1.0 - v.uv[1]) * texture.height as f32 - 0.5).round() as usize;
            let i = POINTS[..3].iter().position(|p| p.map(|x| x as f32) == v.position).unwrap();
            assert_eq!(texture.texels[y * texture.width as usize + x][3], wanted[i], "{mode}, vertex {i}");
        }
    }
}

/// Vertices follow their joints; the place of the mesh's own node does not count. Killed by: matrices in the wrong order,
/// weights that are not divided by their sum, skins that are ignored, a joint that is not there and pulls to the origin.
#[test]
fn skins_are_posed() {
    let mut document = Document::default();
    let position = document.floats(&POINTS[..3]);
    let joints = document.accessor(U8, 4, false, &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let weights = document.floats(&[[1.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]]);
    // columns; the first joint was bound at (0, 0, 1)
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut bound = identity;
    bound[14] = -1.0;
    let matrices = document.accessor(FLOAT, 16, false, &[bound, identity].concat());
    let attributes = json!({"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights});
    let mesh = document.mesh(json!({ "attributes": attributes }));
    document.node(json!({"mesh": mesh, "skin": 0, "translation": [100, 100, 100]}));
    let child = document.push("nodes", json!({"translation": [0, 4, 0], "scale": [3, 1, 1]}));
    let root = document.node(json!({"translation": [0, 0, 10], "children": [child]}));
    document.push("skins", json!({"joints": [root, child], "inverseBindMatrices": matrices}));
    let (scene, _) = loaded(&document);
    // first joint: + (0, 0, 9); second: x times 3, + (0, 4, 10); last vertex: the mean of both
    assert_eq!(rounded(&positions(&scene)), [[[0.0, 0.0, 9.0], [6.0, 4.0, 10.0], [0.0, 3.0, 10.0]]]);
    // a joint that the skin does not have, first without weight
    let at = document.json["accessors"][joints]["bufferView"].as_u64().unwrap() as usize;
    let at = document.json["bufferViews"][at]["byteOffset"].as_u64().unwrap() as usize;
    document.bytes[at + 3] = 2;
    assert_eq!(positions(&loaded(&document).0), positions(&scene));
    document.bytes[at] = 2;
    let error = try_load("a.glb", &document.glb()).unwrap_err();
    assert!(error.contains("skins[0]: a vertex follows its joint 2, there are 2"), "{error}");
}
