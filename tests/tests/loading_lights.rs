//! Sphere, rectangle and disk lights of scene files: what they become, what is refused and by which name.

use croupier::Scene;
use croupier::unstable::Effects;
use croupier::unstable::scene::blob::*;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::SceneDescription;
use croupier_host::effects::reasons;
use croupier_host::load::load;
use std::fs;

/// What loading a scene with these emitters gives.
fn loaded(emitters: &str) -> Result<SceneDescription, String> {
    let folder = tempfile::tempdir().unwrap();
    let json = format!(
        r#"{{ "geometry": {{ "file": "a.obj" }}, "camera": {{ "origin": [0, 0, 5], "target": [0, 0, 0],
        "up": [0, 1, 0], "vfov_deg": 40, "width": 4, "height": 4 }}, "materials": {{ "m":
        {{ "type": "diffuse", "reflectance": [0.5, 0.5, 0.5] }} }}, "emitters": [{emitters}] }}"#
    );
    fs::write(folder.path().join("scene.json"), json).unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
    load(folder.path()).map(|(scene, _)| scene).map_err(|e| e.to_string())
}

/// Killed by: a key that goes to another number, whole edges for halves, a default that is turned round, a shape before
/// other lights, a fact that counts another kind.
#[test]
fn lights_of_files_are_in_the_blob() {
    let scene = loaded(
        r#"{ "type": "sphere", "position": [1, 2, 3], "radius": 0.5, "radiance": [1, 2, 4] },
        { "type": "rectangle", "position": [4, 5, 6], "edge_u": [2, 0, 0], "edge_v": [0, 0, 3], "radiance": [1, 1, 1],
          "twosided": true },
        { "type": "disk", "position": [7, 8, 9], "direction": [0, -3, 4], "radius": 2, "radiance": [1, 1, 1],
          "visible": false },
        { "type": "disk", "position": [7, 8, 9], "direction": [0, -3, 4], "radius": 2, "radiance": [0, 0, 0] },
        { "type": "point", "position": [0, 1, 0], "intensity": [1, 1, 1] },
        { "type": "constant", "radiance": [1, 1, 1] }"#,
    )
    .unwrap();
    let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap();
    let view = Scene::from_bytes(&baked.bytes).unwrap();
    let found: Vec<_> = view.lights.iter().skip(2).map(|l| (l.kind, l.triangle, l.vector, l.params)).collect();
    let wanted = [
        (LightKind::Sphere as u32, 0, [1.0, 2.0, 3.0], [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (LightKind::Rectangle as u32, SHAPE_TWO_SIDED, [4.0, 5.0, 6.0], [1.0, 0.0, 0.0, 0.0, 0.0, 1.5]),
        (LightKind::Disk as u32, SHAPE_HIDDEN, [7.0, 8.0, 9.0], [0.0, -0.6, 0.8, 2.0, 0.0, 0.0]),
    ];
    assert_eq!(found, wanted, "behind the point light and the environment; black ones are left out");
    assert_eq!(view.lights[2].emission, [1.0, 2.0, 4.0]);
    assert!(view.effects.contains(Effects::SHAPE_LIGHTS));
    let reasons = reasons(&view);
    let reason = reasons.iter().find(|r| r.effect == Effects::SHAPE_LIGHTS).unwrap();
    assert_eq!(
        reason.to_string(),
        "sphere, rectangle and disk lights: 1 sphere light, 1 rectangle light, 1 disk light"
    );
    let one = loaded(r#"{ "type": "sphere", "position": [1, 2, 3], "radius": 0.5, "radiance": [1, 2, 4] }"#).unwrap();
    let mut many = one.clone();
    many.emitters = vec![one.emitters[0]; MAX_SHAPE_LIGHTS];
    let baked = bake(&many, &BakeOptions::default(), |_, _| {}).unwrap();
    assert_eq!(Scene::from_bytes(&baked.bytes).unwrap().lights.len(), MAX_SHAPE_LIGHTS);
    many.emitters.push(one.emitters[0]);
    let error = bake(&many, &BakeOptions::default(), |_, _| {}).err().unwrap().to_string();
    assert_eq!(error, "1025 sphere, rectangle and disk lights are too many");
}

/// Killed by: a number that is taken over unchecked, a message without the emitter or the key.
#[test]
fn bad_lights_are_refused_by_name() {
    let sphere = r#""type": "sphere", "position": [1, 2, 3], "radius": 0.5, "radiance": [1, 2, 4]"#;
    let disk = r#""type": "disk", "position": [1, 2, 3], "direction": [0, 0, 1], "radius": 0.5, "radiance": [1, 2, 4]"#;
    let rectangle = r#""type": "rectangle", "position": [1, 2, 3], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0],
        "radiance": [1, 2, 4]"#;
    for (of, from, to, message) in [
        (sphere, r#""radius": 0.5"#, r#""radius": 0"#, "emitter 0 (sphere): radius is 0"),
        (sphere, r#""radius": 0.5"#, r#""radius": -1"#, "emitter 0 (sphere): radius is -1"),
        (sphere, r#""radius": 0.5"#, r#""radius": 1e300"#, "emitter 0 (sphere): radius is inf"),
        (sphere, r#""radius": 0.5, "#, "", "`radius` is missing"),
        (sphere, "[1, 2, 3]", "[1, 2e10, 3]", "emitter 0 (sphere): position is 2e10"),
        (sphere, "[1, 2, 4]", "[1, -2, 4]", "emitter 0 (sphere): radiance is -2"),
        (sphere, "[1, 2, 4]", r#"[1, 2, 4], "twosided": 1"#, "expected true or false"),
        (disk, "[0, 0, 1]", "[0, 0, 0]", "emitter 0 (disk): length of the direction is 0"),
        (disk, r#""radius": 0.5"#, r#""radius": 1e-10"#, "emitter 0 (disk): radius is 1e-10"),
        (disk, r#""direction": [0, 0, 1], "#, "", "`direction` is missing"),
        (rectangle, "[0, 1, 0]", "[0, 0, 0]", "emitter 0 (rectangle): length of an edge is 0"),
        (rectangle, "[0, 1, 0]", "[0, 1e300, 0]", "emitter 0 (rectangle): length of an edge is inf"),
        (rectangle, "[0, 1, 0]", "[1, 1, 0]", "emitter 0 (rectangle): cosine of the angle between the edges is 0.7"),
        (rectangle, r#""edge_v": [0, 1, 0],"#, "", "`edge_v` is missing"),
    ] {
        let json = format!("{{ {} }}", of.replacen(from, to, 1));
        let error = match loaded(&json) {
            Err(e) => e,
            Ok(scene) => {
                bake(&scene, &BakeOptions::default(), |_, _| {}).err().map(|e| e.to_string()).unwrap_or_default()
            }
        };
        assert!(error.contains(message), "`{error}` for {json}");
    }
}

/// Lights with shapes come last in a blob. Killed by: a search of rays that stops before the first of them.
#[test]
fn shapes_between_other_lights_are_refused() {
    let mut parts = croupier_tests::blob::Parts::tiny();
    let shape = Light {
        kind: LightKind::Sphere as u32,
        triangle: 0,
        params: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        ..parts.lights[3]
    };
    parts.lights[3] = shape;
    let error = Scene::from_bytes(parts.blob().bytes()).err().unwrap().to_string();
    assert_eq!(error, "lights[3]: lights with shapes come last, at most 1024 of them");
    parts.lights.swap(3, 4);
    assert!(Scene::from_bytes(parts.blob().bytes()).is_ok());
}
