//! Scenes through the C interface: composed from arrays, edited between frames.

mod common;

use common::{Block, OwnScene, Render, expected, fails, ok, plan, set, settings};
use croupier::unstable::scene::blob;
use croupier_capi::*;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::description::{Instance, Prototype};
use std::ptr;

/// The arrays of a baked scene, as a host has them.
struct Arrays {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    triangle_materials: Vec<u32>,
    materials: Vec<croupier_material>,
    emission: Vec<[f32; 3]>,
    camera: croupier_camera,
    max_depth: u32,
}

impl Arrays {
    fn of(bytes: &[u8]) -> Self {
        let scene = croupier::Scene::from_bytes(bytes).expect("a scene");
        let mut emission = vec![[0.0; 3]; scene.materials.len()];
        for l in scene.lights {
            emission[scene.triangles[l.triangle as usize].material as usize] = l.emission;
        }
        let mut own = OwnScene::new(bytes);
        let mut camera = croupier_camera { struct_size: 72, ..bytemuck::Zeroable::zeroed() };
        ok!(croupier_scene_camera(own.handle, &raw mut camera));
        own.blob.bytes().fill(0);
        Self {
            positions: scene.vertices.iter().map(|v| v.p).collect(),
            triangles: scene.triangles.iter().map(|t| t.vertex).collect(),
            triangle_materials: scene.triangles.iter().map(|t| t.material).collect(),
            materials: bytemuck::cast_slice(scene.materials).to_vec(),
            emission,
            camera,
            max_depth: scene.info.max_depth,
        }
    }

    fn arrays(&self) -> croupier_arrays {
        croupier_arrays {
            max_depth: self.max_depth,
            camera: &raw const self.camera,
            positions: self.positions.as_ptr(),
            vertices: self.positions.len(),
            triangles: self.triangles.as_ptr(),
            triangle_materials: self.triangle_materials.as_ptr(),
            triangle_count: self.triangles.len(),
            materials: self.materials.as_ptr(),
            emission: self.emission.as_ptr(),
            material_count: self.materials.len(),
            ..croupier_arrays::none()
        }
    }
}

/// A scene that C composes of the box's arrays gives the picture of the baked box. Killed by: an array that is left
/// out or read with another stride.
#[test]
fn composed_scenes_render() {
    let own = Arrays::of(&common::baked());
    let arrays = own.arrays();
    let (mut n, mut m, mut length) = (0, 0, 0);
    ok!(croupier_scene_compose_size(&arrays, &raw mut n, &raw mut m));
    let (mut blob, mut scratch) = (Block::new(n), Block::new(m));
    let (to, from) = (blob.pointer(), scratch.pointer());
    fails!(CROUPIER_SIZE, croupier_scene_compose(&arrays, to, 1000, from, m, &raw mut length));
    fails!(CROUPIER_SIZE, croupier_scene_compose(&arrays, to, n, from, m - 64, &raw mut length));
    fails!(CROUPIER_OVERLAP, croupier_scene_compose(&arrays, to, n, to, n, &raw mut length));
    fails!(CROUPIER_MISALIGNED, croupier_scene_compose(&arrays, to.wrapping_byte_add(4), n, from, m, &raw mut length));
    ok!(croupier_scene_compose(&arrays, to, n, from, m, &raw mut length));
    assert!(length <= n);
    let scene = OwnScene::new(&blob.bytes()[..length]);
    let hash = Render::new(scene.handle, &plan(&settings(scene.handle, 1)), None).render(1000, u64::MAX);
    assert_eq!(hash, expected("A"));
}

/// Arrays that make no scene. Killed by: an index or a number that is not looked at.
#[test]
fn arrays_that_make_no_scene_are_refused() {
    let mut own = Arrays::of(&common::baked());
    let (mut n, mut m) = (0, 0);
    let mut refused = |arrays: &croupier_arrays| {
        fails!(CROUPIER_COMPOSE, croupier_scene_compose_size(arrays, &raw mut n, &raw mut m))
    };
    own.triangles[3][1] = 1 << 30;
    let text = refused(&own.arrays());
    assert!(text.contains('3'), "{text}");
    own.triangles[3][1] = 0;
    own.positions[5][2] = f32::NAN;
    refused(&own.arrays());
    own.positions[5][2] = 0.0;
    own.triangle_materials[0] = 99;
    refused(&own.arrays());
    own.triangle_materials[0] = 0;
    own.camera.forward = [0.0; 3];
    refused(&own.arrays());
    let arrays = croupier_arrays { surround: 9, ..own.arrays() };
    fails!(CROUPIER_RANGE, croupier_scene_compose_size(&arrays, &raw mut n, &raw mut m));
    let arrays = croupier_arrays { positions: ptr::null(), ..own.arrays() };
    fails!(CROUPIER_NULL, croupier_scene_compose_size(&arrays, &raw mut n, &raw mut m));
    let arrays = croupier_arrays { triangle_count: usize::MAX, ..own.arrays() };
    fails!(CROUPIER_SIZE, croupier_scene_compose_size(&arrays, &raw mut n, &raw mut m));
    fails!(CROUPIER_NULL, croupier_scene_compose_size(ptr::null(), &raw mut n, &raw mut m));
}

/// Records from the numbers that people use. Killed by: a member that is passed on as another one.
#[test]
fn views_and_light_sources_become_records() {
    let baked = OwnScene::new(&common::baked());
    let mut view = croupier_view { struct_size: 104, ..bytemuck::Zeroable::zeroed() };
    (view.origin, view.target, view.up) = ([0.0, 1.0, 6.8], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]);
    (view.extent, view.width, view.height) = (20.2, 64, 64);
    let mut cameras = [croupier_camera { struct_size: 72, ..bytemuck::Zeroable::zeroed() }; 2];
    ok!(croupier_camera_from_view(&view, &raw mut cameras[0]));
    ok!(croupier_scene_camera(baked.handle, &raw mut cameras[1]));
    let close = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    let [a, b] = cameras;
    assert!(
        close(a.origin, b.origin) && close(a.right, b.right) && close(a.down, b.down) && close(a.forward, b.forward)
    );
    view.up = [0.0, 0.0, 1.0];
    fails!(CROUPIER_RANGE, croupier_camera_from_view(&view, &raw mut cameras[0]));
    let mut source = croupier_light_source { struct_size: 92, ..bytemuck::Zeroable::zeroed() };
    (source.position, source.direction, source.emission) = ([1.0, 2.0, 3.0], [0.0, -2.0, 0.0], [4.0, 5.0, 6.0]);
    (source.radius, source.outer_deg, source.angle_deg, source.hidden) = (0.5, 30.0, 1.0, 1);
    source.edges = [[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]];
    let mut light: croupier_light = bytemuck::Zeroable::zeroed();
    for kind in 2..9 {
        source.kind = kind;
        ok!(croupier_light_from_source(&source, &raw mut light));
        assert_eq!((light.kind, light.emission), (kind, source.emission));
        assert_eq!(light.triangle, if kind < 6 { 0 } else { blob::SHAPE_HIDDEN });
        let vector = if kind == 3 || kind == 5 { [0.0, 1.0, 0.0] } else { source.position };
        assert_eq!(light.vector, vector);
    }
    for kind in [0, 1, 9] {
        source.kind = kind;
        fails!(CROUPIER_RANGE, croupier_light_from_source(&source, &raw mut light));
    }
    let mut material: croupier_material = bytemuck::Zeroable::zeroed();
    ok!(croupier_material_init(&raw mut material, 0));
    assert_eq!((material.texture, material.table, material.medium), (CROUPIER_NONE, CROUPIER_NONE, CROUPIER_NONE));
    fails!(CROUPIER_RANGE, croupier_material_init(&raw mut material, 50));
}

/// Edits change the picture, and taken back give the old one to the bit. Killed by: an edit that reaches another
/// record, an identity that does not follow.
#[test]
fn edits_change_the_picture() {
    let own = OwnScene::new(&common::baked());
    let planned = plan(&settings(own.handle, 1));
    let render = Render::new(own.handle, &planned, None);
    let facts = || {
        let mut facts = croupier_scene_facts { struct_size: 72, ..bytemuck::Zeroable::zeroed() };
        ok!(croupier_scene_info(own.handle, &raw mut facts));
        facts
    };
    let before = facts();
    assert_eq!((before.triangles, before.width, before.instances), (32, 64, 0));
    let again = || {
        ok!(croupier_session_change_scene(render.session, own.handle, 0));
        render.render(1000, u64::MAX)
    };
    let first = again();
    let mut camera = croupier_camera { struct_size: 72, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_scene_camera(own.handle, &raw mut camera));
    let moved = croupier_camera { origin: [0.1, 1.0, 6.5], ..camera };
    ok!(croupier_scene_set_camera(own.handle, &moved));
    assert_ne!(facts().identity, before.identity);
    assert_ne!(again(), first);
    ok!(croupier_scene_set_camera(own.handle, &camera));
    assert_eq!(facts().identity, before.identity);
    assert_eq!(again(), first);
    let mut white: croupier_material = bytemuck::Zeroable::zeroed();
    ok!(croupier_scene_material(own.handle, 0, &raw mut white));
    let black = croupier_material { reflectance: [0.0; 3], ..white };
    ok!(croupier_scene_set_material(own.handle, 0, &black, ptr::null(), 0));
    assert_ne!(again(), first);
    ok!(croupier_scene_set_material(own.handle, 0, &white, ptr::null(), 0));
    assert_eq!(again(), first);
    let mut changed = 0;
    ok!(croupier_scene_set_emission(own.handle, 3, &[1.0, 2.0, 3.0], &raw mut changed));
    assert_eq!(changed, 2);
    assert_ne!(again(), first);
    // a sealed scene is a blob
    let mut own = own;
    ok!(croupier_scene_seal(own.handle));
    let stored = OwnScene::new(own.blob.bytes());
    let mut light: croupier_light = bytemuck::Zeroable::zeroed();
    ok!(croupier_scene_light(stored.handle, 0, &raw mut light));
    assert_eq!(light.emission, [1.0, 2.0, 3.0]);
    let (mut name, mut length) = ([1; 16], 0);
    ok!(croupier_scene_material_name(stored.handle, 0, name.as_mut_ptr(), 16, &raw mut length));
    assert_eq!((length, name[..6].iter().map(|c| *c as u8).collect::<Vec<_>>()), (5, b"white\0".to_vec()));
}

/// Instances move, hide and are built anew. Killed by: a transform that goes to another instance, a batch that stops
/// without saying where.
#[test]
fn instances_move_and_hide() {
    let mut description = builtin::cornell_blocks();
    // the second block, twice
    description.prototypes.push(Prototype { name: "block".into(), triangles: 22..32, instances: Vec::new() });
    let at = |x| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    description.instances = vec![Instance::new("left", 0, at(0.0)), Instance::new("right", 0, at(0.5))];
    let baked = bake(&description, &BakeOptions::default(), |_, _| {}).expect("a scene").bytes;
    let own = OwnScene::new(&baked);
    let mut s = settings(own.handle, 1);
    set(&mut s, "aovs", "object");
    let render = Render::new(own.handle, &plan(&s), None);
    let first = render.render(1000, u64::MAX);
    let mut instance = croupier_instance { struct_size: 112, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_scene_instance(own.handle, 0, &raw mut instance));
    assert_eq!(instance.visible, 1);
    fails!(CROUPIER_RANGE, croupier_scene_instance(own.handle, 2, &raw mut instance));
    let again = || {
        ok!(croupier_session_change_scene(render.session, own.handle, 0));
        render.render(1000, u64::MAX)
    };
    ok!(croupier_scene_set_visible(own.handle, 0, 0));
    assert_ne!(again(), first);
    ok!(croupier_scene_set_visible(own.handle, 0, 1));
    assert_eq!(again(), first);
    let mut map = instance.to_world;
    map.iter_mut().for_each(|key| key[1][3] += 0.3);
    let moves = [croupier_transform { to_world: map }, croupier_transform { to_world: [[[f32::NAN; 4]; 3]; 2] }];
    let mut done = 9;
    let text = fails!(
        CROUPIER_EDIT,
        croupier_scene_set_transforms(own.handle, [0, 0].as_ptr(), moves.as_ptr(), 2, &raw mut done)
    );
    assert!(done == 1 && text.contains("instance 0"), "{done}: {text}");
    assert_ne!(again(), first);
    let mut bytes = 0;
    ok!(croupier_scene_rebuild_size(own.handle, &raw mut bytes));
    let mut scratch = Block::new(bytes);
    let text = fails!(CROUPIER_SIZE, croupier_scene_rebuild(own.handle, scratch.pointer(), bytes - 1));
    assert_eq!(text, format!("scratch: wrong size, needed {bytes}, given {}", bytes - 1));
    ok!(croupier_scene_rebuild(own.handle, scratch.pointer(), bytes));
    ok!(croupier_scene_set_transforms(
        own.handle,
        [0].as_ptr(),
        &croupier_transform { to_world: instance.to_world },
        1,
        ptr::null_mut()
    ));
    assert_eq!(again(), first);
}

/// Composing leaves out a triangle without an area, and the numbers of hits are those of the triangles that the scene
/// tells. Killed by: numbers of the arrays in their place, corners or materials of another triangle.
#[test]
fn scenes_tell_their_triangles() {
    let mut own = Arrays::of(&common::baked());
    let all = own.triangles.len();
    own.triangles.insert(3, [5, 5, 6]);
    own.triangle_materials.insert(3, 1);
    let arrays = own.arrays();
    let (mut n, mut m, mut length) = (0, 0, 0);
    ok!(croupier_scene_compose_size(&arrays, &raw mut n, &raw mut m));
    let (mut blob, mut scratch) = (Block::new(n), Block::new(m));
    ok!(croupier_scene_compose(&arrays, blob.pointer(), n, scratch.pointer(), m, &raw mut length));
    let scene = OwnScene::new(&blob.bytes()[..length]);
    let mut facts = croupier_scene_facts { struct_size: 72, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_scene_info(scene.handle, &raw mut facts));
    assert_eq!((facts.triangles as usize, arrays.triangle_count), (all, all + 1));
    let (mut corners, mut materials) = (vec![[[0.0f32; 3]; 3]; all], vec![9; all]);
    let (to, kinds) = (corners.as_mut_ptr(), materials.as_mut_ptr());
    ok!(croupier_scene_triangles(scene.handle, 0, all, to, kinds));
    let given = own.triangles.iter().zip(&own.triangle_materials).enumerate().filter(|(i, _)| *i != 3);
    for ((_, (vertex, material)), (corners, found)) in given.zip(corners.iter().zip(&materials)) {
        assert_eq!((vertex.map(|v| own.positions[v as usize]), material), (*corners, found));
    }
    // some of them, without materials or corners
    let mut two = [[[0.0f32; 3]; 3]; 2];
    ok!(croupier_scene_triangles(scene.handle, 5, 2, two.as_mut_ptr(), ptr::null_mut()));
    assert_eq!(two[..], corners[5..7]);
    ok!(croupier_scene_triangles(scene.handle, all, 0, ptr::null_mut(), ptr::null_mut()));
    for (first, count) in [(all, 1), (0, all + 1), (usize::MAX, 2), (1, usize::MAX)] {
        fails!(CROUPIER_RANGE, croupier_scene_triangles(scene.handle, first, count, to, kinds));
    }
    // a ray to the middle of a triangle, from the side, hits that one or one in front of it
    for (i, c) in corners.iter().enumerate() {
        let middle: [f32; 3] = std::array::from_fn(|k| (c[0][k] + c[1][k] + c[2][k]) / 3.0);
        let (e, f): ([f32; 3], [f32; 3]) =
            (std::array::from_fn(|k| c[1][k] - c[0][k]), std::array::from_fn(|k| c[2][k] - c[0][k]));
        let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt();
        let mut rays: croupier_rays8 = croupier_rays8 {
            origin: [[0.0; 8]; 3],
            direction: [[0.0; 8]; 3],
            tmin: [0.0; 8],
            tmax: [f32::INFINITY; 8],
            time: [0.0; 8],
        };
        for k in 0..3 {
            rays.direction[k] = [-normal[k] / length; 8];
            rays.origin[k] = [middle[k] + 1e-3 * normal[k] / length; 8];
        }
        let none = [CROUPIER_NONE; 8];
        let mut hits = croupier_hits8 { t: [0.0; 8], triangle: none, u: [0.0; 8], v: [0.0; 8], instance: [none; 2] };
        let mut hit = 0;
        ok!(croupier_scene_closest(scene.handle, &rays, 1, &raw mut hits, &raw mut hit));
        assert_eq!((hit, hits.triangle[0]), (1, i as u32));
    }
}

/// A rough plastic gets another colour with the tables that it has. Killed by: tables of another material or length.
#[test]
fn rough_plastics_change_colour() {
    let mut own = Arrays::of(&common::baked());
    let mut plastic: croupier_material = bytemuck::Zeroable::zeroed();
    ok!(croupier_material_init(&raw mut plastic, croupier_material_kind::CROUPIER_ROUGH_PLASTIC as u32));
    (plastic.reflectance, plastic.alpha, plastic.eta[0]) = ([0.5; 3], 0.3, 1.5);
    own.materials[0] = plastic;
    let arrays = own.arrays();
    let (mut n, mut m, mut length) = (0, 0, 0);
    ok!(croupier_scene_compose_size(&arrays, &raw mut n, &raw mut m));
    let (mut blob, mut scratch) = (Block::new(n), Block::new(m));
    ok!(croupier_scene_compose(&arrays, blob.pointer(), n, scratch.pointer(), m, &raw mut length));
    let scene = OwnScene::new(&blob.bytes()[..length]);
    let render = Render::new(scene.handle, &plan(&settings(scene.handle, 1)), None);
    let again = || {
        ok!(croupier_session_change_scene(render.session, scene.handle, 0));
        render.render(1000, u64::MAX)
    };
    let first = again();
    let mut needed = 0;
    ok!(croupier_scene_material_tables(scene.handle, 1, ptr::null_mut(), 0, &raw mut needed));
    assert_eq!(needed, 0, "a diffuse one");
    ok!(croupier_scene_material_tables(scene.handle, 0, ptr::null_mut(), 0, &raw mut needed));
    assert!(needed > 0);
    let mut tables = vec![-1.0f32; needed + 1];
    let (to, n) = (tables.as_mut_ptr(), tables.len());
    fails!(CROUPIER_RANGE, croupier_scene_material_tables(scene.handle, 99, to, n, &raw mut needed));
    fails!(CROUPIER_SIZE, croupier_scene_material_tables(scene.handle, 0, to, needed - 1, &raw mut needed));
    ok!(croupier_scene_material_tables(scene.handle, 0, to, n, ptr::null_mut()));
    assert!(tables[..needed].iter().all(|x| (0.0..=1.0).contains(x)) && tables[needed] == -1.0);
    let mut old: croupier_material = bytemuck::Zeroable::zeroed();
    ok!(croupier_scene_material(scene.handle, 0, &raw mut old));
    let red = croupier_material { reflectance: [0.7, 0.1, 0.1], ..old };
    fails!(CROUPIER_EDIT_FIXED, croupier_scene_set_material(scene.handle, 0, &red, ptr::null(), 0));
    ok!(croupier_scene_set_material(scene.handle, 0, &red, to, needed));
    assert_ne!(again(), first);
    ok!(croupier_scene_set_material(scene.handle, 0, &old, to, needed));
    assert_eq!(again(), first);
}
