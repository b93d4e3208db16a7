//! Blocks, arrays and scratch memory that one call is about and that overlap are refused, and the objects in them go on.

mod common;

use common::{Block, OwnScene, Render, fails, ok, plan, set, settings};
use croupier_capi::*;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;
use croupier_host::description::{Instance, Prototype};
use std::ffi::c_void;
use std::ptr;

/// Killed by: an array of croupier_arrays that is not compared.
#[test]
fn composing_over_its_own_arrays() {
    let mut memory = Block::new(1 << 20);
    let (blob, n) = (memory.pointer(), memory.len());
    let mut other = Block::new(1 << 20);
    let mut camera = croupier_camera { struct_size: 72, ..bytemuck::Zeroable::zeroed() };
    let own = OwnScene::new(&common::baked());
    ok!(croupier_scene_camera(own.handle, &raw mut camera));
    let none = croupier_arrays { camera: &raw const camera, ..croupier_arrays::none() };
    let inside = blob.wrapping_byte_add(4096);
    // a record each, at the same place inside the blob
    let cases = [
        ("positions", croupier_arrays { positions: inside.cast(), vertices: 1, ..none }),
        ("triangles", croupier_arrays { triangles: inside.cast(), triangle_count: 1, ..none }),
        ("materials", croupier_arrays { materials: inside.cast(), material_count: 1, ..none }),
        ("tables", croupier_arrays { tables: inside.cast(), table_count: 1, ..none }),
        ("names", croupier_arrays { names: inside.cast(), names_size: 1, ..none }),
        ("textures", croupier_arrays { textures: inside.cast(), texture_count: 1, ..none }),
        ("texels", croupier_arrays { texels: inside.cast(), texel_count: 1, ..none }),
        ("media", croupier_arrays { media: inside.cast(), medium_count: 1, ..none }),
        ("lights", croupier_arrays { lights: inside.cast(), light_count: 1, ..none }),
        ("map", croupier_arrays { map: inside.cast(), surround: 2, map_width: 1, map_height: 2, ..none }),
    ];
    // those that go with vertices, triangles and materials, whose own arrays are elsewhere
    let (three, mut vertices) = ([0u32, 0, 0], [[0.0f32; 3]; 1]);
    let base = croupier_arrays {
        positions: vertices.as_mut_ptr(),
        vertices: 1,
        triangles: &raw const three,
        triangle_count: 1,
        ..none
    };
    let mut grey: croupier_material = bytemuck::Zeroable::zeroed();
    ok!(croupier_material_init(&raw mut grey, 0));
    let along = [
        ("normals", croupier_arrays { normals: inside.cast(), ..base }),
        ("uvs", croupier_arrays { uvs: inside.cast(), ..base }),
        ("triangle_materials", croupier_arrays { triangle_materials: inside.cast(), ..base }),
        (
            "emission",
            croupier_arrays { emission: inside.cast(), materials: &raw const grey, material_count: 1, ..base },
        ),
    ];
    let (scratch, m) = (other.pointer(), other.len());
    let mut length = 0;
    for (name, arrays) in cases.iter().chain(&along) {
        for (to, from) in [(blob, scratch), (scratch, blob)] {
            let text = fails!(CROUPIER_OVERLAP, croupier_scene_compose(arrays, to, n, from, m, &raw mut length));
            assert_eq!(text, format!("{name}: blocks of memory overlap"));
        }
    }
}

/// Killed by: a plan, a block or an array that is not compared with the objects of the call.
#[test]
fn arrays_inside_objects() {
    let own = OwnScene::new(&common::baked());
    let s = settings(own.handle, 2);
    let planned = plan(&s);
    let sizes = common::sizes(&planned);
    let (n, m) = (sizes.session as usize, sizes.shard as usize);
    // a plan in the block that it is for
    let mut memory = Block::new(n.max(m));
    let at = memory.pointer();
    let hidden: *mut croupier_plan = at.wrapping_byte_add(1024).cast();
    let (mut session, mut shard) = (ptr::null_mut(), ptr::null_mut());
    ok!(croupier_plan_init(hidden, &s));
    fails!(CROUPIER_OVERLAP, croupier_session_init(at, n, hidden, own.handle, &raw mut session));
    fails!(CROUPIER_OVERLAP, croupier_shard_init(at, m, hidden, 0, &raw mut shard));
    assert!(session.is_null() && shard.is_null());

    let mut estimated = settings(own.handle, 2);
    set(&mut estimated, "pixel-estimator", "denoised");
    set(&mut estimated, "aovs", "depth");
    let planned = plan(&estimated);
    let mut render = Render::new(own.handle, &planned, None);
    let before = render.render(1000, u64::MAX);
    let inside = |block: &mut Block| block.pointer().wrapping_byte_add(8192);
    let (place, share) = (inside(&mut render.memory[0]), inside(&mut render.memory[1]));
    let (session, shard, pixels) = (render.session, render.shards[0], render.pixels);
    let mut more = 0;
    fails!(CROUPIER_OVERLAP, croupier_session_rgb(session, place.cast(), 3 * pixels));
    fails!(CROUPIER_OVERLAP, croupier_session_pixels(session, 0, 9, place.cast()));
    fails!(CROUPIER_OVERLAP, croupier_session_plane(session, 2, 0, place.cast(), pixels));
    fails!(CROUPIER_OVERLAP, croupier_session_estimate(session, place.cast(), 3 * pixels));
    fails!(CROUPIER_OVERLAP, croupier_session_give_estimate(session, place.cast(), 3 * pixels));
    fails!(CROUPIER_OVERLAP, croupier_session_save_statistics(session, place, 5000));
    fails!(CROUPIER_OVERLAP, croupier_session_load_statistics(session, place, 5000, 0));
    fails!(CROUPIER_OVERLAP, croupier_session_finish_iteration(session, place.cast(), 2, 1, &raw mut more));
    for at in [place, share] {
        let to = at.cast();
        fails!(CROUPIER_OVERLAP, croupier_shard_unfinished(shard, session, to, 3 * pixels, ptr::null_mut()));
    }
    let mut written = 0;
    fails!(CROUPIER_OVERLAP, croupier_shard_save(shard, share, 5000, &raw mut written));
    fails!(CROUPIER_OVERLAP, croupier_shard_load(shard, session, share, 5000));
    // rays and hits
    let mut rays = [0.0f32; 144];
    let mut hit = 0;
    let both = rays.as_mut_ptr();
    fails!(
        CROUPIER_OVERLAP,
        croupier_scene_closest(own.handle, both.cast(), 255, both.wrapping_add(32).cast(), &raw mut hit)
    );
    // nothing has changed
    assert_eq!(render.hash(), before);
    ok!(croupier_session_restart(session, 0));
    assert_eq!(render.render(1000, u64::MAX), before);
}

/// Killed by: scratch or tables inside the blob, which are written over what was checked.
#[test]
fn edits_with_arrays_inside_the_scene() {
    let mut description = builtin::cornell_blocks();
    description.prototypes.push(Prototype { name: "block".into(), triangles: 22..32, instances: Vec::new() });
    let still = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    description.instances = vec![Instance::new("one", 0, still)];
    let baked = bake(&description, &BakeOptions::default(), |_, _| {}).expect("a scene").bytes;
    let mut own = OwnScene::new(&baked);
    let (scene, inside): (_, *mut c_void) = (own.handle, own.blob_at().wrapping_byte_add(1024));
    let mut material: croupier_material = bytemuck::Zeroable::zeroed();
    ok!(croupier_scene_material(scene, 0, &raw mut material));
    let mut bytes = 0;
    ok!(croupier_scene_rebuild_size(scene, &raw mut bytes));
    for inside in [inside, own.object.pointer().wrapping_byte_add(128)] {
        fails!(CROUPIER_OVERLAP, croupier_scene_rebuild(scene, inside, bytes));
        fails!(CROUPIER_OVERLAP, croupier_scene_set_material(scene, 0, &material, inside.cast(), 4));
        let transform = croupier_transform { to_world: [still; 2] };
        let (one, done) = ([0u32], ptr::null_mut());
        fails!(CROUPIER_OVERLAP, croupier_scene_set_transforms(scene, inside.cast(), &transform, 1, done));
        fails!(CROUPIER_OVERLAP, croupier_scene_set_transforms(scene, one.as_ptr(), inside.cast(), 1, done));
        fails!(CROUPIER_OVERLAP, croupier_scene_triangles(scene, 0, 1, inside.cast(), ptr::null_mut()));
        fails!(CROUPIER_OVERLAP, croupier_scene_triangles(scene, 0, 1, ptr::null_mut(), inside.cast()));
    }
    assert_eq!(own.blob.bytes(), &baked[..], "the blob is as it was");
    ok!(croupier_scene_rebuild(scene, Block::new(bytes).pointer(), bytes));
}
