//! Instances from description to blob: what is refused, by whom and with which words.

use croupier::Scene;
use croupier::unstable::Effects;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::geometry::SurfaceHit8;
use croupier::unstable::scene::blob::{INSTANCE_MIRRORED, LEAF_BIT, Node, SectionKind};
use croupier::unstable::scene::{ChildFault, Field, InstanceFault, ObjectFault, SceneError, derive};
use croupier::unstable::simd::{F32x8, Mask8};
use croupier_host::bake::{BakeError, BakeOptions, bake};
use croupier_host::description::{Emitter, Instance, Medium, Model, Prototype, SceneDescription};
use croupier_tests::blob::{Blob, Parts};
use croupier_tests::geometry::{Ray, Rng, packet};
use croupier_tests::placed::{IDENTITY, Kind, Map, add_prototype, apply, translation};
use croupier_tests::scenes::*;
use std::collections::HashMap;

/// A floor, a prototype `lamp` that emits, `pair` with a box and two lamps; three instances.
fn small() -> SceneDescription {
    let mut s = SceneDescription::default();
    let wall = s.add_material("wall", grey(0.5));
    let glow = s.add_material("glow", grey(0.0));
    add_quad(&mut s, "floor", wall, facing_y(4.0, 0.0, 1.0));
    let first = s.triangles.len() as u32;
    add_quad(&mut s, "lamp", glow, facing_y(0.5, 0.0, -1.0));
    let lamp = add_prototype(&mut s, "lamp", first, vec![]);
    let first = s.triangles.len() as u32;
    add_box(&mut s, wall, [-0.5; 3], [0.5; 3], false);
    let lamps = [1.0, -1.0].map(|x| Instance::new("in pair", lamp, translation([x, 1.0, 0.0])));
    let pair = add_prototype(&mut s, "pair", first, lamps.to_vec());
    s.instances = vec![
        Instance::new("alone", lamp, translation([0.0, 3.0, 0.0])),
        Instance::new("pair", pair, translation([1.0, 1.0, 0.0])),
        Instance::new("other", lamp, translation([0.0, 2.0, 2.0])),
    ];
    s.emitters.push(Emitter::Area { material: glow, radiance: [1.0; 3] });
    s
}

/// The blob in parts that can be changed.
fn parts(s: &SceneDescription) -> Parts {
    let bytes = blob(s);
    let scene = Scene::from_bytes(&bytes).unwrap();
    Parts {
        info: vec![*scene.info],
        nodes: scene.nodes.to_vec(),
        leaves: scene.leaves.to_vec(),
        triangles: scene.triangles.to_vec(),
        vertices: scene.vertices.to_vec(),
        materials: scene.materials.to_vec(),
        textures: vec![],
        texels: vec![],
        tables: scene.tables.to_vec(),
        lights: scene.lights.to_vec(),
        light_alias: scene.light_alias.to_vec(),
        environment: vec![],
        env_texels: vec![],
        env_alias: vec![],
        cameras: vec![*scene.camera],
        media: vec![],
        densities: vec![],
        majorants: vec![],
        objects: scene.objects.to_vec(),
        instances: scene.instances.to_vec(),
        names: scene.names.to_vec(),
    }
}

fn error(blob: &Blob) -> Option<SceneError> {
    Scene::from_bytes(blob.bytes()).err()
}

fn object(object: u32, fault: ObjectFault) -> SceneError {
    SceneError::Object { object, fault }
}

fn instance(instance: u32, fault: InstanceFault) -> SceneError {
    SceneError::Instance { instance, fault }
}

/// Where the world's top-level tree refers to instance `index`.
fn reference(p: &Parts, index: u32) -> (usize, usize) {
    let is = |c: &u32| *c == LEAF_BIT | index;
    let node = p.nodes.iter().position(|n| n.child.iter().any(is)).unwrap();
    (node, p.nodes[node].child.iter().position(is).unwrap())
}

type Corruption = (&'static str, fn(&mut Parts), SceneError);

/// Each row kills the deletion of one check.
#[test]
fn every_fault_of_instances_has_its_error() {
    let good = parts(&small());
    assert_eq!(error(&good.blob()), None);
    let scene = good.blob();
    let scene = Scene::from_bytes(scene.bytes()).unwrap();
    assert!(scene.effects.contains(Effects::INSTANCES) && !scene.effects.contains(Effects::MOTION));
    assert_eq!((good.objects.len(), good.instances.len(), good.lights.len()), (3, 5, 2 + 4 + 2));
    let derived = InstanceFault::Derived;
    let rows: &[Corruption] = &[
        ("a cycle", |p| p.instances[3].object = 2, instance(3, InstanceFault::Object(2))),
        ("the world in the world", |p| p.instances[0].object = 0, instance(0, InstanceFault::Object(0))),
        ("no such object", |p| p.instances[1].object = 9, instance(1, InstanceFault::Object(9))),
        ("an inverse", |p| p.instances[0].inverse[1][1] = 1.5, instance(0, derived)),
        ("a condition", |p| p.instances[0].condition = 0.5, instance(0, derived)),
        ("mirrored", |p| p.instances[0].flags = INSTANCE_MIRRORED, instance(0, derived)),
        ("a moved key", |p| p.instances[0].to_world[1][0][3] = 0.5, instance(0, derived)),
        (
            "an infinite entry",
            |p| p.instances[0].to_world[0][0][0] = f32::INFINITY,
            instance(0, InstanceFault::Entry(f32::INFINITY)),
        ),
        (
            "a singular map",
            |p| p.instances[0].to_world[0][0] = [0.0; 4],
            instance(0, InstanceFault::Singular(f32::INFINITY)),
        ),
        ("reserved", |p| p.instances[2].reserved[1] = 1, SceneError::Reserved { of: SectionKind::Instances, index: 2 }),
        ("lights out of range", |p| p.instances[2].first_light = 7, instance(2, InstanceFault::Lights(7))),
        ("lights of another", |p| p.instances[2].first_light = 0, instance(2, InstanceFault::Lights(0))),
        ("inner lights", |p| p.instances[4].first_light = 0, instance(4, InstanceFault::Lights(0))),
        ("emitters", |p| p.objects[1].emitters = 1, object(1, ObjectFault::Lights(1))),
        ("lights in all", |p| p.objects[2].lights = 3, object(2, ObjectFault::Lights(3))),
        ("a gap", |p| p.objects[1].first_triangle += 1, object(1, ObjectFault::Order)),
        ("beyond the end", |p| p.objects[2].triangles += 1, object(2, ObjectFault::Order)),
        ("too many instances", |p| p.objects[2].instances += 1, object(2, ObjectFault::Order)),
        ("left over", |p| p.leaves.push(p.leaves[0]), object(3, ObjectFault::Order)),
        ("no objects", |p| p.objects.clear(), object(0, ObjectFault::Order)),
        (
            "a top-level tree too large",
            |p| p.objects[0].top_nodes = p.objects[0].top_capacity + 1,
            object(0, ObjectFault::Empty),
        ),
        (
            "bounds",
            |p| p.objects[1].bounds_min[0] = f32::NAN,
            SceneError::Number { of: SectionKind::Objects, index: 1, field: Field::Bounds, found: f32::NAN },
        ),
        (
            "an object's condition",
            |p| p.objects[0].condition = 9.0,
            SceneError::Number { of: SectionKind::Objects, index: 0, field: Field::Condition, found: 9.0 },
        ),
        (
            "an ordinal",
            |p| p.triangles[2].light = 2,
            SceneError::Reference { of: SectionKind::Triangles, index: 2, to: SectionKind::Lights, found: 2, count: 2 },
        ),
        ("a light's instance", |p| p.lights[0].instance = 2, instance(0, InstanceFault::Lights(0))),
        (
            "a light's triangle",
            |p| p.lights[0].triangle = 3,
            SceneError::Reference {
                of: SectionKind::Lights,
                index: 0,
                to: SectionKind::Triangles,
                found: 3,
                count: 16,
            },
        ),
        (
            "a light's area",
            |p| p.lights[3].area *= 1.1,
            SceneError::Number { of: SectionKind::Lights, index: 3, field: Field::Area, found: 0.5 * 1.1 },
        ),
    ];
    for (name, change, expected) in rows {
        let mut p = good.clone();
        change(&mut p);
        let found = error(&p.blob()).unwrap_or_else(|| panic!("{name}: accepted"));
        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{name}");
        assert!(found.to_string().len() > 20);
    }
    // boxes and references of the top-level tree
    let (node, slot) = reference(&good, 0);
    let change = |f: &dyn Fn(&mut Node)| {
        let mut p = good.clone();
        f(&mut p.nodes[node]);
        error(&p.blob())
    };
    let at = |fault| Some(SceneError::Child { node: node as u32, slot: slot as u32, fault });
    let low = good.nodes[node].bounds[0][slot];
    assert_eq!(change(&|n| n.bounds[0][slot] = low + 0.01), at(ChildFault::Outside(low)));
    assert_eq!(change(&|n| n.child[slot] = LEAF_BIT | 3), at(ChildFault::Order { expected: 0, found: 3 }));
    let twice = object(0, ObjectFault::Coverage { instances: 3, met: 3 });
    let same_box = |p: &mut Parts| {
        let (b, t) = reference(p, 2);
        for row in &mut p.nodes[b].bounds[..3] {
            row[t] = -9.0;
        }
        p.nodes[b].child[t] = LEAF_BIT;
    };
    let mut p = good.clone();
    same_box(&mut p);
    // the box may be outside its parent's first
    assert!(matches!(error(&p.blob()), Some(SceneError::Child { .. })) || error(&p.blob()) == Some(twice));
}

/// Random bytes in objects, instances and nodes never panic, and never pass but where they are not read. Killed by: an
/// index that is trusted, arithmetic that overflows, a recursion without an end.
#[test]
fn damaged_instances_are_refused_quietly() {
    let good = parts(&small());
    let mut r = Rng(11);
    let mut accepted = 0;
    for _ in 0..20_000 {
        let mut p = good.clone();
        for _ in 0..=r.below(2) {
            let words: &mut [u32] = match r.below(4) {
                0 => bytemuck::cast_slice_mut(&mut p.objects),
                1 => bytemuck::cast_slice_mut(&mut p.instances),
                2 => bytemuck::cast_slice_mut(&mut p.lights),
                _ => bytemuck::cast_slice_mut(&mut p.nodes),
            };
            let at = r.below(words.len());
            words[at] = match r.below(4) {
                0 => r.bits(),
                1 => words[at].wrapping_add(1),
                2 => words[at] ^ 1 << r.below(32),
                _ => [0, 1, u32::MAX, LEAF_BIT, 1.0f32.to_bits(), f32::NAN.to_bits()][r.below(6)],
            };
        }
        let b = p.blob();
        if let Ok(scene) = Scene::from_bytes(b.bytes()) {
            accepted += 1;
            let bvh = WideBvh::new(&scene);
            for _ in 0..4 {
                let rays: [Ray; 8] = std::array::from_fn(|_| Ray::new(r.cube().map(|x| 4.0 * x), r.cube()));
                let rays = packet(&rays).at(F32x8::splat(r.unit()));
                let hit = bvh.closest(&rays, Mask8::all_lanes());
                assert_eq!(bvh.occluded(&rays, Mask8::all_lanes()), hit.hit);
                SurfaceHit8::gather(&scene, &hit).place(&scene, rays.time);
            }
        }
    }
    assert!(accepted < 10_000, "{accepted} of 20000 passed");
}

/// Boxes hold every point at every time, and grow by little. Killed by: one key forgotten, a corner of the box forgotten, a
/// pad in the wrong units.
#[test]
fn derived_boxes_hold_all_points() {
    let mut r = Rng(12);
    for case in 0..4000 {
        let kind = Kind::ALL[case % 4];
        let scale = f64::from(r.log(-3.0, 3.0));
        let at = |r: &mut Rng| r.cube().map(|x| 100.0 * scale * f64::from(x));
        let t = at(&mut r);
        let open = kind.map(&mut r, scale, t);
        let mut close = open;
        for row in &mut close {
            row[3] += scale as f32 * r.signed();
            row[0] *= 1.0 + 0.1 * r.signed();
        }
        let Ok(d) = derive(&[open, close], [[-1.0, -2.0, 0.0], [1.0, 0.5, 3.0]]) else { continue };
        for _ in 0..32 {
            let p = [r.signed(), -2.0 + 2.5 * r.unit(), 3.0 * r.unit()].map(f64::from);
            let (s, a, b) = (f64::from(r.unit()), apply(&open, p), apply(&close, p));
            for k in 0..3 {
                let x = (1.0 - s) * a[k] + s * b[k];
                assert!(f64::from(d.bounds[0][k]) < x && x < f64::from(d.bounds[1][k]), "{kind:?}");
            }
        }
        let size = f64::from(d.bounds[1][0] - d.bounds[0][0]);
        let pad = 2e-6 * f64::from(d.condition) * (200.0 * scale + size);
        assert!(size < 30.0 * scale * 12.0 + pad, "{kind:?}: {size} for {scale}");
    }
    // half a turn goes through a singular map
    let half: Map = [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]];
    let unit = [[-1.0; 3], [1.0; 3]];
    assert!(matches!(derive(&[IDENTITY, half], unit), Err(InstanceFault::Singular(_))));
    let quarter: Map = [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0]];
    assert!(derive(&[IDENTITY, quarter], unit).is_ok());
    assert_eq!(derive(&[IDENTITY; 2], unit).unwrap().inverse, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
}

#[track_caller]
fn refused(change: impl FnOnce(&mut SceneDescription), words: &[&str]) {
    let mut s = small();
    change(&mut s);
    let e: BakeError = bake(&s, &BakeOptions::default(), |_, _| {}).expect_err("it was baked");
    let text = e.to_string();
    assert!(words.iter().all(|w| text.contains(w)), "{text}");
}

/// Killed by: a check that is left to the blob, whose messages name no object.
#[test]
fn baking_names_the_instance_and_what_it_places() {
    refused(|s| s.instances[1].prototype = 7, &["`pair`", "7"]);
    refused(|s| s.instances[2].to_world[1][2] = f32::NAN, &["`other` of `lamp`", "NaN"]);
    refused(|s| s.instances[0].to_world[0] = [0.0; 4], &["`alone` of `lamp`", "singular"]);
    refused(|s| s.instances[0].to_world[0][3] = 1e9, &["`alone`", "reaches"]);
    refused(|s| s.prototypes[0].instances.push(Instance::new("back", 1, IDENTITY)), &["`back`", "`lamp`"]);
    refused(|s| s.prototypes[1].instances[0].prototype = 1, &["in pair", "nest"]);
    refused(|s| s.prototypes[1].triangles.end += 1, &["prototype `pair`", "are not there"]);
    refused(|s| s.prototypes[1].triangles.start -= 1, &["prototype `pair`", "`lamp`"]);
    refused(
        |s| {
            s.media.push(Medium { name: "fog".into(), ..Medium::default() });
            let m = s.add_material("open", Model::Null);
            s.materials[m as usize].medium = Some(0);
            s.triangles[2].material = m;
        },
        &["fog", "not closed", "lamp"],
    );
    let mut s = small();
    s.instances.remove(1);
    let baked = bake(&s, &BakeOptions::default(), |_, _| {}).unwrap();
    assert_eq!((baked.report.unused_prototypes, baked.report.instances, baked.report.triangles), (1, 2, 4));
    s.instances.clear();
    let baked = bake(&s, &BakeOptions::default(), |_, _| {}).unwrap();
    assert_eq!((baked.report.unused_prototypes, baked.report.instances, baked.report.triangles), (2, 0, 2));
}

/// Killed by: a key that is not read, an object that stays in the world, a message without its place.
#[test]
fn scene_files_place_objects() {
    let folder = std::env::temp_dir().join(format!("croupier-instances-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no ground\nusemtl m\nf 1 2 4\no leaf\nusemtl m\nf 1 2 3\nusemtl n\nf 1 3 4\n";
    std::fs::write(folder.join("s.obj"), obj).unwrap();
    let write = |rest: &str| {
        let head = r#"{ "geometry": { "file": "s.obj" }, "camera": { "origin": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0],
            "vfov_deg": 40, "width": 8, "height": 8 }, "materials": { "m": { "type": "null" }, "n": { "type": "null" } }"#;
        std::fs::write(folder.join("scene.json"), format!("{head}{rest} }}")).unwrap();
        croupier_host::load::load(&folder)
    };
    let unit = "[[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0]]";
    let (scene, _) = write(&format!(
        r#", "prototypes": {{ "twig": {{ "instances": [ {{ "object": "leaf", "transform": {unit} }} ] }} }},
        "instances": [ {{ "object": "twig", "name": "t", "transform": {unit}, "transform_end": {unit} }},
        {{ "object": "leaf", "transform": {unit}, "visible": false }} ]"#
    ))
    .unwrap();
    let by_name: HashMap<&str, &Prototype> = scene.prototypes.iter().map(|p| (p.name.as_str(), p)).collect();
    assert_eq!((by_name["leaf"].triangles.clone(), by_name["twig"].instances.len()), (1..3, 1));
    assert_eq!((scene.instances[0].name.as_str(), scene.instances[1].name.as_str()), ("t", "instances[1]"));
    assert_eq!(scene.instances[0].to_world_end.unwrap()[0], [1.0, 0.0, 0.0, 2.0]);
    assert!(!scene.instances[1].visible && scene.instances[0].visible);
    assert_eq!(bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap().report.triangles, 3);
    for (rest, words) in [
        (r#", "instances": [ { "object": "tree", "transform": [] } ]"#, ["instances[0].object", "`tree`"]),
        (r#", "instances": [ { "object": "leaf", "transform": [[1, 2]] } ]"#, ["instances[0].transform", "3 rows"]),
        (r#", "instances": [ { "object": "leaf" } ]"#, ["instances[0]", "`transform` is missing"]),
    ] {
        let text = write(rest).unwrap_err().to_string();
        assert!(words.iter().all(|w| text.contains(w)), "{text}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
