//! The tree of nodes, instances, cameras and lights.

use super::{loaded, positions, rounded, try_load, try_load_lit};
use croupier_host::description::*;
use croupier_tests::gltf::{Document, FLOAT};
use serde_json::json;

const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Translation, rotation and scale, matrices, parents, mirrored maps, normals. Killed by: T R S in another order, a child
/// without its parent, rows taken for columns, a mirrored triangle whose front is at its back, normals that follow the
/// map of points.
#[test]
fn transformations() {
    let mut document = Document::default();
    let mesh = document.triangle(None);
    // x to y by a quarter turn around z, after the scale
    let turn = json!([0.0, 0.0, HALF, HALF]);
    let child = document.push("nodes", json!({"mesh": mesh, "translation": [1, 0, 0]}));
    document.node(json!({"translation": [0, 0, 5], "rotation": turn, "scale": [2, 3, 1], "children": [child]}));
    document.node(json!({"mesh": mesh, "matrix": [0, 0, 1, 0, 0, 2, 0, 0, -4, 0, 0, 0, 7, 8, 9, 1]}));
    document.node(json!({"mesh": mesh, "scale": [-1, 1, 1]}));
    // a quaternion of another length
    document.node(json!({"mesh": mesh, "rotation": [0, 2, 0, 0]}));
    let (scene, _) = loaded(&document);
    let wanted = [
        [[0.0, 2.0, 5.0], [0.0, 4.0, 5.0], [-3.0, 2.0, 5.0]],
        [[7.0, 8.0, 9.0], [7.0, 8.0, 10.0], [7.0, 10.0, 9.0]],
        [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    ];
    assert_eq!(rounded(&positions(&scene)), wanted);
    // fronts and normals agree
    let normals: Vec<[f32; 3]> =
        scene.triangles.iter().map(|t| scene.vertices[t.vertices[0] as usize].normal).collect();
    for (n, w) in normals.iter().zip([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]) {
        assert!(n.iter().zip(w).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6), "{n:?} for {w:?}");
    }
    for (t, n) in positions(&scene).iter().zip(&normals) {
        let [a, b, c] = *t;
        let (u, v): ([f32; 3], [f32; 3]) = (std::array::from_fn(|i| b[i] - a[i]), std::array::from_fn(|i| c[i] - a[i]));
        let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        assert!(cross.iter().zip(n).map(|(a, b)| a * b).sum::<f32>() > 0.0, "{t:?}");
    }
    // only the default scene counts
    document.push("scenes", json!({"nodes": [2]}));
    document.json["scene"] = json!(1);
    assert_eq!(rounded(&positions(&loaded(&document).0)), wanted[1..2]);
    document.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(loaded(&document).0.triangles.len(), 4);
    document.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(loaded(&document).0.triangles.len(), 4);
}

/// Meshes with many triangles become prototypes, others copies; `EXT_mesh_gpu_instancing` gives a node many places.
/// Killed by: maps that are transposed, instances of a node without its own map, copies where instances would save; a
/// singular map that refuses the file, or drops triangles that are there or without a note.
#[test]
fn instances() {
    let mut document = Document::default();
    let n = 3000;
    let points: Vec<[f64; 3]> = (0..n).map(|i| [f64::from(i % 60), f64::from(i / 60), f64::from(i % 7)]).collect();
    let position = document.floats(&points);
    let large = document.mesh(json!({"attributes": {"POSITION": position}, "mode": 5}));
    document.json["meshes"][large]["name"] = json!("large");
    let small = document.triangle(None);
    for x in 0..3 {
        document
            .node(json!({"mesh": large, "translation": [x, 0, 0], "scale": [1, 2, 1], "name": format!("copy {x}")}));
        document.node(json!({"mesh": small, "translation": [x, 0, 0]}));
    }
    let (scene, _) = try_load("a.glb", &document.glb()).unwrap();
    assert_eq!(scene.prototypes.len(), 1);
    let prototype = &scene.prototypes[0];
    assert_eq!((prototype.name.as_str(), prototype.triangles.len()), ("large", n as usize - 2));
    assert_eq!(scene.triangles.len(), n as usize - 2 + 3);
    let vertex = scene.triangles[prototype.triangles.start as usize + 70].vertices.map(|v| scene.vertices[v as usize]);
    assert!(vertex.iter().all(|v| v.position.iter().all(|x| x.fract() == 0.0)));
    assert_eq!(scene.instances.len(), 3);
    for (x, instance) in scene.instances.iter().enumerate() {
        let x = x as f32;
        let rows = [[1.0, 0.0, 0.0, x], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        assert_eq!((instance.to_world, instance.prototype, instance.visible), (rows, 0, true));
        assert_eq!(instance.name, format!("copy {x}"));
    }
    // a flat copy is none, and nothing is left of a line
    for (scale, copies) in [([1, 1, 0], 1), ([0, 0, 0], 0), ([0, 2, 0], 0)] {
        for mesh in [large, small] {
            let mut document = document.clone();
            document.node(json!({"mesh": mesh, "scale": scale, "name": "flat"}));
            let (flat, notes) = loaded(&document);
            let more = if mesh == large { n as usize - 2 } else { 1 };
            assert_eq!(flat.triangles.len(), scene.triangles.len() + copies * more, "{scale:?}");
            assert_eq!((flat.prototypes.len(), &flat.instances), (1, &scene.instances), "{scale:?}");
            let told = |n: &&String| n.contains("leave them no area: 1, first `flat`");
            assert_eq!(notes.iter().filter(told).count(), 1 - copies, "{scale:?}: {notes:?}");
        }
    }
    // one use is no instance
    let mut single = Document::default();
    let position = single.floats(&points);
    let mesh = single.mesh(json!({"attributes": {"POSITION": position}, "mode": 5}));
    single.node(json!({"mesh": mesh}));
    let (scene, _) = loaded(&single);
    assert!(scene.prototypes.is_empty() && scene.instances.is_empty());

    let mut document = Document::default();
    let mesh = document.triangle(None);
    let places = document.floats(&[[0.0, 0.0, 0.0], [0.0, 5.0, 0.0]]);
    let turns = document.accessor(FLOAT, 4, false, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, HALF, HALF]);
    let attributes = json!({"TRANSLATION": places, "ROTATION": turns});
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    document.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    document.node(json!({"mesh": mesh, "translation": [0, 0, 1], "extensions": extension}));
    let (scene, _) = loaded(&document);
    let wanted =
        [[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]], [[0.0, 5.0, 1.0], [0.0, 6.0, 1.0], [-1.0, 5.0, 1.0]]];
    assert_eq!(rounded(&positions(&scene)), wanted);
}

/// Killed by: a camera that looks along +z or whose up is not its own, radians taken for degrees, an aspect that changes
/// the height; an orthographic camera before a perspective one.
#[test]
fn cameras() {
    let mut document = Document::default();
    let mesh = document.triangle(None);
    document.node(json!({"mesh": mesh}));
    let orthographic = json!({"xmag": 3, "ymag": 1.5, "znear": 0, "zfar": 10});
    document.push("cameras", json!({"type": "orthographic", "orthographic": orthographic}));
    let perspective = json!({"yfov": 0.5, "aspectRatio": 2, "znear": 0.1});
    document.push("cameras", json!({"type": "perspective", "perspective": perspective}));
    document.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}));
    document.node(json!({"camera": 0, "name": "plan", "translation": [0, 0, 9]}));
    // looks along -x, its right is -z
    document.node(json!({"camera": 1, "name": "side", "translation": [8, 1, 0], "rotation": [0, HALF, 0, HALF], "scale": [2, 2, 2]}));
    document.node(json!({"camera": 2}));
    let (scene, notes) = loaded(&document);
    assert!(notes.iter().all(|n| !n.contains("camera")), "{notes:?}");
    let names: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["plan", "side", "nodes[3]"]);
    assert_eq!(scene.cameras[0].camera.projection, Projection::Orthographic { height: 3.0 });
    assert_eq!(scene.cameras[0].camera.size, [960, 480]);
    assert_eq!(scene.camera, scene.cameras[1].camera);
    let c = scene.camera;
    let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(
        close(c.origin, [8.0, 1.0, 0.0]) && close(c.target, [7.0, 1.0, 0.0]) && close(c.up, [0.0, 1.0, 0.0]),
        "{c:?}"
    );
    assert!((c.vfov_deg - 28.647_889_756_5).abs() < 1e-5 && c.size == [960, 480]);
    assert_eq!(scene.cameras[2].camera.size, [640, 480]);
    let bad = |path: &str, camera: serde_json::Value| {
        let mut document = document.clone();
        document.json["cameras"][1] = camera;
        let error = try_load("a.glb", &document.glb()).unwrap_err();
        assert!(error.contains(path), "{error}");
    };
    bad("cameras[1].perspective.yfov: 4", json!({"type": "perspective", "perspective": {"yfov": 4, "znear": 1}}));
    bad(
        "cameras[1].orthographic.ymag: 0",
        json!({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 0, "znear": 1, "zfar": 2}}),
    );
    bad("cameras[1]: neither", json!({"type": "perspective"}));
    bad("cameras[1]: neither", json!({"type": "fisheye"}));
}

/// `KHR_lights_punctual`. Killed by: a direction along +z, a scale that changes it, angles in radians, colours without
/// intensity, Blender's lumens that stay, or are taken from where its old exporter wrote none; a sky beside lights.
#[test]
fn lights() {
    let watts = 0.25 / std::f32::consts::PI;
    for (generator, scale, sun) in [
        ("by hand", 1.0f32, 1.0f32),
        ("Khronos glTF Blender I/O v4.1.63", 1.0 / 683.0, 1.0 / 683.0),
        ("Khronos glTF Blender I/O v3.4.50", 1.0 / 683.0, 1.0 / 683.0),
        ("Khronos glTF Blender I/O v1.2.75", watts, 1.0),
        ("Khronos glTF Blender I/O v3.3.27", watts, 1.0),
        ("Blender exporter", 1.0 / 683.0, 1.0 / 683.0),
    ] {
        let mut document = Document::default();
        document.json["asset"]["generator"] = json!(generator);
        let mesh = document.triangle(None);
        document.node(json!({"mesh": mesh}));
        document.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
            {"type": "point", "color": [1, 0.5, 0], "intensity": 1366},
            {"type": "directional", "intensity": 683},
            {"type": "spot", "intensity": 683, "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}},
            {"type": "spot", "spot": {}},
            {"type": "point", "intensity": 0},
        ]}});
        let light = |i: usize| json!({"KHR_lights_punctual": {"light": i}});
        document.node(json!({"extensions": light(0), "translation": [1, 2, 3], "scale": [5, 5, 5]}));
        // -z becomes -y
        let down = json!([-HALF, 0, 0, HALF]);
        document.node(json!({"extensions": light(1), "rotation": down, "scale": [2, 3, 4]}));
        document.node(json!({"extensions": light(2), "translation": [0, 4, 0]}));
        document.node(json!({"extensions": light(3)}));
        document.node(json!({"extensions": light(4)}));
        let (scene, report) = try_load_lit("a.glb", &document.glb()).unwrap();
        let notes = report.notes;
        assert_eq!(notes.iter().any(|n| n.contains("683")), sun < 1.0, "{generator}");
        assert!(scene.environment.is_none());
        let [Emitter::Point { position, intensity }, Emitter::Directional { direction, irradiance }, spot, plain] =
            scene.emitters[..]
        else {
            panic!("{:?}", scene.emitters)
        };
        assert_eq!((position, intensity), ([1.0, 2.0, 3.0], [1366.0 * scale, 683.0 * scale, 0.0]));
        assert!(direction.iter().zip([0.0, -1.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{direction:?}");
        assert_eq!(irradiance, [683.0 * sun; 3]);
        let Emitter::Spot { position, direction, intensity, inner_deg, outer_deg } = spot else { panic!("{spot:?}") };
        assert_eq!((position, direction, intensity), ([0.0, 4.0, 0.0], [0.0, 0.0, -1.0], [683.0 * scale; 3]));
        assert!((inner_deg - 14.323_945).abs() < 1e-4 && (outer_deg - 28.647_89).abs() < 1e-4);
        let Emitter::Spot { inner_deg, outer_deg, .. } = plain else { panic!("{plain:?}") };
        assert_eq!((inner_deg, outer_deg), (0.0, 45.0));
    }
}

/// Without lights there is a sky, unless a material emits evenly. Killed by: a sky that hides a lamp, the dark around a
/// display.
#[test]
fn a_scene_without_lights_gets_a_sky() {
    let lit = |material: serde_json::Value, textured: bool| {
        let mut document = Document::of_material(material);
        if textured {
            let texture = document.texture(1, 1, &[[255; 4]]);
            document.json["materials"][0]["emissiveTexture"] = json!({"index": texture});
        }
        try_load_lit("a.glb", &document.glb()).unwrap().0.environment.is_none()
    };
    assert!(!lit(json!({}), false));
    assert!(lit(json!({"emissiveFactor": [1, 0, 0]}), false));
    assert!(!lit(json!({"emissiveFactor": [1, 1, 1]}), true));
}
