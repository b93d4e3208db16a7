//! glTF documents, one for each feature of the usual sample models.

use super::shapes::Shape;
use crate::gltf::{Document, FLOAT, I8, I16, U8};
use serde_json::{Value, json};

/// Name, triangles in the world, and how to build it.
type Row = (&'static str, usize, fn() -> Document);

/// Every document.
const TABLE: [Row; 24] = [
    ("textured-cube", 12, textured_cube),
    ("interleaved-cube", 12, interleaved_cube),
    ("coloured-corners", 12, coloured_corners),
    ("truck", 12 + 12 + 4 * 48, truck),
    ("orientation", 7 * 12, orientation),
    ("alpha-modes", 4 * 2 + 12, alpha_modes),
    ("metal-rough-spheres", 10 * SPHERE, metal_rough_spheres),
    ("normal-map", 2 * 2, normal_map),
    ("texture-transform", 4 * 2, texture_transform),
    ("clearcoat", 3 * SPHERE, clearcoat),
    ("sheen", 2 * 800, sheen),
    ("glass", 2 * SPHERE + 12, glass),
    ("emissive-strength", 4 * 12 + 12, emissive_strength),
    ("punctual-lights", SPHERE + 12, punctual_lights),
    ("sparse", 12, sparse),
    ("quantized", SPHERE, quantized),
    ("two-uv-sets", 2, two_uv_sets),
    ("cameras", 12, cameras),
    ("gpu-instancing", 25 * 12, gpu_instancing),
    ("unlit", 2 * SPHERE, unlit),
    ("strips-and-fans", 2 + 6, strips_and_fans),
    ("specular-ior", 3 * SPHERE, specular_ior),
    ("skinned-tube", 48, skinned_tube),
    ("specular-glossiness", SPHERE, specular_glossiness),
];

/// Triangles of the spheres.
const SPHERE: usize = 2 * 15 * 32;

/// Names, triangles in the world, and documents.
pub fn documents() -> Vec<(&'static str, usize, Document)> {
    TABLE.iter().map(|(name, triangles, build)| (*name, *triangles, build())).collect()
}

fn sphere() -> Shape {
    Shape::sphere(32, 16)
}

/// A dielectric of a colour.
fn plain(color: [f64; 3]) -> Value {
    let [r, g, b] = color;
    json!({"pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1], "metallicFactor": 0, "roughnessFactor": 0.6}})
}

/// As [`plain`], with an extension.
fn extended(color: [f64; 3], name: &str, extension: Value) -> Value {
    let mut material = plain(color);
    material["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.4);
    material["extensions"] = json!({ name: extension });
    material
}

/// A grid of shapes side by side in the plane z = 0, each with its material.
fn row(shape: &Shape, columns: usize, materials: Vec<Value>) -> Document {
    let mut document = Document::default();
    for (i, material) in materials.into_iter().enumerate() {
        let mesh = shape.mesh(&mut document, material);
        let place = [2.4 * (i % columns) as f64, -2.4 * (i / columns) as f64, 0.0];
        document.node(json!({"mesh": mesh, "translation": place}));
    }
    document
}

/// A slab under what stands on y = -1, 12 triangles.
fn slab(document: &mut Document, middle: f64, width: f64) {
    let mesh = Shape::cube().mesh(document, plain([0.5; 3]));
    document.node(json!({"mesh": mesh, "translation": [middle, -1.2, 0], "scale": [width, 0.1, 2]}));
}

/// Texels of a checkerboard of side `n` in two colours.
fn checkers(n: u32, a: [u8; 4], b: [u8; 4]) -> Vec<[u8; 4]> {
    (0..n * n).map(|i| if (i % n + i / n).is_multiple_of(2) { a } else { b }).collect()
}

/// A texture with a red corner at the top left and a green one at the top right.
fn oriented(document: &mut Document) -> usize {
    let mut texels = checkers(8, [230, 230, 230, 255], [60, 90, 160, 255]);
    (texels[0], texels[1], texels[8], texels[9]) =
        ([255, 0, 0, 255], [255, 0, 0, 255], [255, 0, 0, 255], [255, 0, 0, 255]);
    (texels[6], texels[7]) = ([0, 200, 0, 255], [0, 200, 0, 255]);
    document.texture(8, 8, &texels)
}

/// A material with that texture.
fn textured(texture: usize) -> Value {
    json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}, "metallicFactor": 0}})
}

fn textured_cube() -> Document {
    let mut document = Document::default();
    let texture = oriented(&mut document);
    let mesh = Shape::cube().mesh(&mut document, textured(texture));
    document.node(json!({"mesh": mesh}));
    document
}

fn interleaved_cube() -> Document {
    let mut document = Document::default();
    let mesh = Shape::cube().interleaved(&mut document);
    document.push("materials", plain([0.7, 0.1, 0.1]));
    document.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    document.node(json!({"mesh": mesh}));
    document
}

fn coloured_corners() -> Document {
    let mut document = Document::default();
    let cube = Shape::cube();
    let mesh = cube.mesh(&mut document, plain([1.0; 3]));
    let colors: Vec<[f64; 3]> = cube.positions.iter().map(|p| p.map(|x| 0.5 + 0.5 * x)).collect();
    let colors = document.floats(&colors);
    document.json["meshes"][mesh]["primitives"][0]["attributes"]["COLOR_0"] = json!(colors);
    document.node(json!({"mesh": mesh}));
    document
}

/// Wheels are grandchildren, two of each mesh; one axle is turned by half a turn.
fn truck() -> Document {
    let mut document = Document::default();
    let wheel = Shape::tube(24).mesh(&mut document, plain([0.05; 3]));
    let body = Shape::cube().mesh(&mut document, plain([0.7, 0.6, 0.1]));
    let cabin = Shape::cube().mesh(&mut document, plain([0.1, 0.2, 0.6]));
    let wheels = [-1.1, 1.1].map(|x| {
        let node = json!({"mesh": wheel, "translation": [x, 0, 0], "scale": [0.2, 0.5, 0.5]});
        document.push("nodes", node)
    });
    let mirrored = [-1.1, 1.1].map(|x| {
        let node = json!({"mesh": wheel, "translation": [x, 0, 0], "scale": [-0.2, 0.5, 0.5]});
        document.push("nodes", node)
    });
    let front = document.push("nodes", json!({"children": wheels, "translation": [0, 0, 1.6]}));
    let axle = json!({"children": mirrored, "translation": [0, 0, -1.6], "rotation": [0, 1, 0, 0]});
    let back = document.push("nodes", axle);
    let load = document.push("nodes", json!({"mesh": body, "translation": [0, 1, -0.6], "scale": [1, 0.8, 1.6]}));
    let cab = document.push("nodes", json!({"mesh": cabin, "translation": [0, 0.9, 1.8], "scale": [1, 0.7, 0.7]}));
    document.node(json!({"children": [front, back, load, cab], "rotation": [0, 0.38268343, 0, 0.92387953]}));
    document
}

/// Cubes along the axes in the axes' colours, by translation, rotation, scale and matrix, two of them mirrored.
fn orientation() -> Document {
    let mut document = Document::default();
    let cube = Shape::cube();
    let grey = cube.mesh(&mut document, plain([0.5; 3]));
    document.node(json!({"mesh": grey, "scale": [0.5, 0.5, 0.5]}));
    for (axis, color) in [[0.8, 0.1, 0.1], [0.1, 0.6, 0.1], [0.1, 0.2, 0.8]].into_iter().enumerate() {
        let mesh = cube.mesh(&mut document, plain(color));
        let mut near = [0.0; 3];
        let mut scale = [0.25; 3];
        (near[axis], scale[axis]) = (1.6, 0.9);
        document.node(json!({"mesh": mesh, "translation": near, "scale": scale}));
        // the far one is a mirrored matrix, column by column
        let mut matrix = [[0.0; 4]; 4];
        (0..3).for_each(|i| matrix[i][i] = 0.15);
        matrix[axis][axis] = -0.15;
        (matrix[3][axis], matrix[3][3]) = (3.0, 1.0);
        document.node(json!({"mesh": mesh, "matrix": matrix.as_flattened()}));
    }
    document
}

/// Opaque, cut out at two thresholds and blended, before a wall of a cube.
fn alpha_modes() -> Document {
    let texels: Vec<[u8; 4]> = (0..64).map(|i| [200, 60, 40, 36 * (i % 8) as u8]).collect();
    let mut document = Document::default();
    let texture = document.texture(8, 8, &texels);
    let modes = [
        json!({}),
        json!({"alphaMode": "MASK"}),
        json!({"alphaMode": "MASK", "alphaCutoff": 0.8}),
        json!({"alphaMode": "BLEND"}),
    ];
    for (i, mode) in modes.into_iter().enumerate() {
        let mut material = textured(texture);
        material.as_object_mut().unwrap().extend(mode.as_object().unwrap().clone());
        material["doubleSided"] = json!(true);
        let mesh = Shape::square().mesh(&mut document, material);
        document.node(json!({"mesh": mesh, "translation": [2.4 * i as f64, 0, 0]}));
    }
    slab(&mut document, 3.6, 5.0);
    document
}

/// Roughness from left to right, metal above and a dielectric below.
fn metal_rough_spheres() -> Document {
    let material = |i: usize| {
        json!({"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.6, 0.3, 1],
        "metallicFactor": 1 - i / 5, "roughnessFactor": (i % 5) as f64 / 4.0}})
    };
    row(&sphere(), 5, (0..10).map(material).collect())
}

/// A bump in the middle of each cell, beside a square without.
fn normal_map() -> Document {
    let texel = |i: u32| {
        let [x, y] = [i % 32, i / 32].map(|k| f64::from(k % 16) / 8.0 - 0.9375);
        let r2 = (x * x + y * y) / 0.7;
        let n = if r2 < 1.0 { [x / 0.84, -y / 0.84, (1.0 - r2).sqrt().max(0.1)] } else { [0.0, 0.0, 1.0] };
        let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [r, g, b] = n.map(|x| ((x / length * 0.5 + 0.5) * 255.0).round() as u8);
        [r, g, b, 255]
    };
    let texels: Vec<[u8; 4]> = (0..32 * 32).map(texel).collect();
    let mut document = Document::default();
    let texture = document.texture(32, 32, &texels);
    for x in [0.0, 2.4] {
        let mut material = plain([0.6; 3]);
        if x > 0.0 {
            material["normalTexture"] = json!({"index": texture});
        }
        let mesh = Shape::square().mesh(&mut document, material);
        document.node(json!({"mesh": mesh, "translation": [x, 0, 0]}));
    }
    document
}

fn texture_transform() -> Document {
    let mut document = Document::default();
    let texture = oriented(&mut document);
    let transforms = [
        json!({}),
        json!({"offset": [0.5, 0]}),
        json!({"rotation": std::f64::consts::FRAC_PI_4}),
        json!({"scale": [2, 2]}),
    ];
    for (i, transform) in transforms.into_iter().enumerate() {
        let mut material = textured(texture);
        material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
            json!({"KHR_texture_transform": transform});
        let mesh = Shape::square().mesh(&mut document, material);
        document.node(json!({"mesh": mesh, "translation": [2.4 * i as f64, 0, 0]}));
    }
    document
}

fn clearcoat() -> Document {
    let coat = |coat: f64, roughness: f64| {
        let extension = json!({"clearcoatFactor": coat, "clearcoatRoughnessFactor": roughness});
        extended([0.5, 0.05, 0.05], "KHR_materials_clearcoat", extension)
    };
    row(&sphere(), 3, vec![coat(0.0, 0.0), coat(1.0, 0.0), coat(1.0, 0.5)])
}

fn sheen() -> Document {
    let sheen = |color: [f64; 3]| {
        let extension = json!({"sheenColorFactor": color, "sheenRoughnessFactor": 0.4});
        extended([0.1, 0.1, 0.3], "KHR_materials_sheen", extension)
    };
    row(&Shape::cloth(20), 2, vec![sheen([0.0; 3]), sheen([0.9, 0.9, 0.9])])
}

/// A thin shell and a coloured solid.
fn glass() -> Document {
    let mut thin = extended([1.0; 3], "KHR_materials_transmission", json!({"transmissionFactor": 1}));
    thin["pbrMetallicRoughness"]["roughnessFactor"] = json!(0);
    let mut solid = thin.clone();
    solid["extensions"]["KHR_materials_volume"] =
        json!({"thicknessFactor": 1, "attenuationColor": [0.2, 0.7, 0.5], "attenuationDistance": 1});
    solid["extensions"]["KHR_materials_ior"] = json!({"ior": 1.45});
    let mut document = row(&sphere(), 2, vec![thin, solid]);
    slab(&mut document, 1.2, 3.0);
    document
}

fn emissive_strength() -> Document {
    let glowing = |i: i32| {
        let strength = json!({"emissiveStrength": 4f64.powi(i)});
        let mut material = extended([0.2; 3], "KHR_materials_emissive_strength", strength);
        material["emissiveFactor"] = json!([0.2, 0.1, 0.02]);
        material
    };
    let mut document = row(&Shape::cube(), 4, (0..4).map(glowing).collect());
    slab(&mut document, 3.6, 6.0);
    document
}

/// One of each kind above a sphere on a slab.
fn punctual_lights() -> Document {
    let mut document = row(&sphere(), 1, vec![plain([0.7; 3])]);
    slab(&mut document, 0.0, 3.0);
    let lights = json!([
        {"type": "point", "color": [1, 0.3, 0.2], "intensity": 12},
        {"type": "spot", "color": [0.3, 1, 0.3], "intensity": 30, "spot": {"outerConeAngle": 0.5}},
        {"type": "directional", "color": [0.3, 0.4, 1], "intensity": 1.5}]);
    document.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    // a spot light shines along -z: down
    let down = [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];
    let nodes = [
        json!({"translation": [-2, 1, 2]}),
        json!({"translation": [1.5, 3, 0.5], "rotation": down}),
        json!({"rotation": [-0.2705981, 0.2705981, 0.0, 0.9238795]}),
    ];
    for (i, mut node) in nodes.into_iter().enumerate() {
        node["extensions"] = json!({"KHR_lights_punctual": {"light": i}});
        document.node(node);
    }
    document
}

/// A cube whose upper front left corner is pulled out.
fn sparse() -> Document {
    let mut document = Document::default();
    let cube = Shape::cube();
    let mesh = cube.mesh(&mut document, plain([0.2, 0.5, 0.3]));
    let moved: Vec<f64> = (0..24).filter(|i| cube.positions[*i as usize] == [-1.0, 1.0, 1.0]).map(f64::from).collect();
    let indices = document.view(&crate::gltf::encode(U8, &moved));
    let values = document.view(&crate::gltf::encode(FLOAT, [[-1.8, 1.8, 1.8]; 3].as_flattened()));
    let positions = document.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap();
    document.json["accessors"][positions as usize]["sparse"] = json!({"count": moved.len(),
        "indices": {"bufferView": indices, "componentType": U8}, "values": {"bufferView": values}});
    // its normals are those of the cube no more: flat
    document.json["meshes"][mesh]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("NORMAL");
    document.node(json!({"mesh": mesh}));
    document
}

/// Shorts for positions, bytes for normals; the node brings them back to size.
fn quantized() -> Document {
    let mut document = Document::default();
    let shape = sphere();
    let scaled = |rows: &[[f64; 3]], by: f64| -> Vec<f64> {
        rows.iter().flat_map(|[x, y, z]| [x * by, y * by, z * by, 0.0]).map(f64::round).collect()
    };
    let mut padded = |component: u32, values: Vec<f64>, stride: u32| {
        let view = document.view(&crate::gltf::encode(component, &values));
        document.json["bufferViews"][view]["byteStride"] = json!(stride);
        let accessor = json!({"bufferView": view, "componentType": component, "count": values.len() / 4,
            "type": "VEC3", "normalized": component == I8});
        document.push("accessors", accessor)
    };
    let positions = padded(I16, scaled(&shape.positions, 30000.0), 8);
    let normals = padded(I8, scaled(&shape.normals, 127.0), 4);
    let material = document.push("materials", plain([0.7, 0.3, 0.1]));
    let indices = shape.indices(&mut document);
    let primitive =
        json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices, "material": material});
    let mesh = document.mesh(primitive);
    document.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    document.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    document.node(json!({"mesh": mesh, "scale": [1.0 / 30000.0, 1.0 / 30000.0, 1.0 / 30000.0]}));
    document
}

/// The base colour follows the second set, which shows the texture twice.
fn two_uv_sets() -> Document {
    let mut document = Document::default();
    let texture = oriented(&mut document);
    let mut material = textured(texture);
    material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(1);
    let square = Shape::square();
    let mesh = square.mesh(&mut document, material);
    let twice: Vec<[f64; 2]> = square.uvs.iter().map(|uv| uv.map(|x| 2.0 * x)).collect();
    let uvs = document.floats(&twice);
    document.json["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(uvs);
    document.node(json!({"mesh": mesh}));
    document
}

/// One perspective and one orthographic camera; the first renders.
fn cameras() -> Document {
    let mut document = Document::default();
    let mesh = Shape::cube().mesh(&mut document, plain([0.2, 0.4, 0.7]));
    document.node(json!({"mesh": mesh}));
    document.push(
        "cameras",
        json!({"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 2, "znear": 0.1, "zfar": 9}}),
    );
    document.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}));
    document.node(json!({"camera": 0, "translation": [0, 0, 5], "name": "front"}));
    let turned = [-0.1913417, 0.3535534, 0.0732233, 0.9125];
    document.node(json!({"camera": 1, "translation": [4, 2.6, 4.6], "rotation": turned, "name": "corner"}));
    document
}

fn gpu_instancing() -> Document {
    let mut document = Document::default();
    let mesh = Shape::cube().mesh(&mut document, plain([0.3, 0.6, 0.2]));
    let places: Vec<[f64; 3]> = (0..25).map(|i| [3.0 * f64::from(i % 5), 0.0, 3.0 * f64::from(i / 5)]).collect();
    let sizes: Vec<[f64; 3]> = (0..25).map(|i| [0.6, 0.3 + 0.1 * f64::from(i % 7), 0.6]).collect();
    let attributes = json!({"TRANSLATION": document.floats(&places), "SCALE": document.floats(&sizes)});
    document.node(json!({"mesh": mesh, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}));
    document.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    document
}

fn unlit() -> Document {
    let color = [0.8, 0.5, 0.1];
    row(&sphere(), 2, vec![plain(color), extended(color, "KHR_materials_unlit", json!({}))])
}

/// A square as a strip, a hexagon as a fan.
fn strips_and_fans() -> Document {
    let mut document = Document::default();
    let material = document.push("materials", plain([0.6, 0.2, 0.5]));
    let square = document.floats(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    let corner = |i: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 6.0).sin_cos();
        [2.4 + cos, sin, 0.0]
    };
    let corners: Vec<[f64; 3]> = [[2.4, 0.0, 0.0]].into_iter().chain((0..=6).map(corner)).collect();
    let hexagon = document.floats(&corners);
    for (mode, positions) in [(5, square), (6, hexagon)] {
        let mesh = document.mesh(json!({"attributes": {"POSITION": positions}, "mode": mode, "material": material}));
        document.node(json!({"mesh": mesh}));
    }
    document
}

fn specular_ior() -> Document {
    let shiny = |name: &str, extension: Value| {
        let mut material = extended([0.02; 3], name, extension);
        material["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.1);
        material
    };
    let materials = vec![
        shiny("KHR_materials_specular", json!({"specularFactor": 0})),
        shiny("KHR_materials_specular", json!({"specularColorFactor": [1, 0.3, 0.3]})),
        shiny("KHR_materials_ior", json!({"ior": 2.4})),
    ];
    row(&sphere(), 3, materials)
}

/// A tube whose right end follows a joint that is turned up.
fn skinned_tube() -> Document {
    let mut document = Document::default();
    let tube = Shape::tube(24);
    let mesh = tube.mesh(&mut document, plain([0.7, 0.4, 0.4]));
    let joints: Vec<f64> = tube.positions.iter().flat_map(|_| [0.0, 1.0, 0.0, 0.0]).collect();
    let weights: Vec<f64> = tube
        .positions
        .iter()
        .flat_map(|p| if p[0] > 0.0 { [0.0, 1.0, 0.0, 0.0] } else { [1.0, 0.0, 0.0, 0.0] })
        .collect();
    let joints = document.accessor(U8, 4, false, &joints);
    let weights = document.accessor(FLOAT, 4, false, &weights);
    let attributes = &mut document.json["meshes"][mesh]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    let fixed = document.node(json!({"name": "fixed"}));
    let turned = json!({"name": "turned", "translation": [2, 0.8, 0], "rotation": [0, 0, 0.38268343, 0.92387953]});
    let turned = document.node(turned);
    document.push("skins", json!({"joints": [fixed, turned]}));
    document.node(json!({"mesh": mesh, "skin": 0}));
    document
}

fn specular_glossiness() -> Document {
    let extension =
        json!({"diffuseFactor": [0.1, 0.3, 0.5, 1], "specularFactor": [0.3, 0.3, 0.3], "glossinessFactor": 0.8});
    row(&sphere(), 1, vec![json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": extension}})])
}
