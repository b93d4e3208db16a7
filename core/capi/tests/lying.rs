//! A host that lies: wrong sizes, misaligned memory, null, stale and foreign handles, calls at the wrong time. Every
//! lie that can be seen is answered with a status and a message, and honest calls go on afterwards.

mod common;

use common::{Block, OwnScene, Render, c, expected, fails, ok, plan, set, settings, static_text};
use croupier_capi::croupier_status::CROUPIER_OK;
use croupier_capi::*;
use std::ffi::c_void;
use std::ptr;

/// A pointer that is misaligned by a few bytes.
fn crooked<T>(pointer: *mut T) -> *mut T {
    pointer.wrapping_byte_add(2)
}

/// Killed by: a pointer that is used before it is looked at.
#[test]
fn null_and_misaligned_pointers() {
    let blob = common::baked();
    let mut memory = Block::new(1 << 20);
    let mut bytes = Block::of(&blob);
    let (at, room, scene_bytes, n) = (memory.pointer(), memory.len(), bytes.pointer(), blob.len());
    let mut scene = ptr::dangling_mut();
    fails!(CROUPIER_NULL, croupier_scene_init(ptr::null_mut(), room, scene_bytes, n, &raw mut scene));
    assert!(scene.is_null(), "no handle after a failure");
    fails!(CROUPIER_NULL, croupier_scene_init(at, room, ptr::null_mut(), n, &raw mut scene));
    fails!(CROUPIER_NULL, croupier_scene_init(at, room, scene_bytes, n, ptr::null_mut()));
    fails!(CROUPIER_MISALIGNED, croupier_scene_init(crooked(at), room, scene_bytes, n, &raw mut scene));
    fails!(CROUPIER_MISALIGNED, croupier_scene_init(at, room, scene_bytes, n, crooked(&raw mut scene)));
    fails!(CROUPIER_MISALIGNED, croupier_scene_init(at.wrapping_byte_add(32), room, scene_bytes, n, &raw mut scene));
    fails!(CROUPIER_SCENE, croupier_scene_init(at, room, crooked(scene_bytes), n - 2, &raw mut scene));
    fails!(CROUPIER_SIZE, croupier_scene_init(at, CROUPIER_SCENE_BYTES - 1, scene_bytes, n, &raw mut scene));
    fails!(CROUPIER_SCENE, croupier_scene_init(at, room, scene_bytes, 0, &raw mut scene));
    fails!(CROUPIER_SCENE, croupier_scene_init(at, room, scene_bytes, n - 1, &raw mut scene));
    fails!(CROUPIER_SIZE, croupier_scene_init(at, room, scene_bytes, usize::MAX, &raw mut scene));
    fails!(CROUPIER_OVERLAP, croupier_scene_init(scene_bytes, n, scene_bytes, n, &raw mut scene));

    let own = OwnScene::new(&blob);
    let good = settings(own.handle, 1);
    let planned = plan(&good);
    let mut more = 7;
    fails!(CROUPIER_NULL, croupier_settings_init(ptr::null_mut(), own.handle));
    fails!(CROUPIER_MISALIGNED, croupier_settings_init(crooked((&raw const good).cast_mut()), own.handle));
    fails!(CROUPIER_NULL, croupier_settings_set((&raw const good).cast_mut(), ptr::null(), c"1".as_ptr()));
    fails!(CROUPIER_NULL, croupier_settings_set((&raw const good).cast_mut(), c"seed".as_ptr(), ptr::null()));
    fails!(CROUPIER_NULL, croupier_plan_init((&raw const planned).cast_mut(), ptr::null()));
    fails!(CROUPIER_NULL, croupier_plan_sizes(&planned, ptr::null_mut()));
    fails!(CROUPIER_NULL, croupier_shard_step(ptr::null_mut(), ptr::null(), 1, &raw mut more));
    assert_eq!(more, 0, "a loop over `more` ends after a failure");
    fails!(CROUPIER_NULL, croupier_session_begin_iteration(ptr::null_mut(), 1));
    fails!(CROUPIER_MISALIGNED, croupier_session_begin_iteration(ptr::without_provenance_mut(4097), 1));
    let render = Render::new(own.handle, &planned, None);
    fails!(CROUPIER_NULL, croupier_session_rgb(render.session, ptr::null_mut(), 3 * render.pixels));
    fails!(CROUPIER_NULL, croupier_session_finish_iteration(render.session, ptr::null(), 1, 1, &raw mut more));
    fails!(
        CROUPIER_NULL,
        croupier_session_finish_iteration(render.session, [ptr::null_mut()].as_ptr(), 1, 1, &raw mut more)
    );
    fails!(CROUPIER_NULL, croupier_scene_set_camera(own.handle, ptr::null()));
    fails!(CROUPIER_NULL, croupier_scene_set_light(own.handle, 0, ptr::null()));
    fails!(CROUPIER_NULL, croupier_session_init_with(at, room, &planned, own.handle, ptr::null(), ptr::null_mut()));
    // without a message too
    assert_ne!(c!(croupier_scene_destroy(ptr::null_mut(), ptr::null_mut())), CROUPIER_OK);
    assert_eq!(render.render(1000, u64::MAX), expected("A"), "lies have changed nothing");
}

/// Killed by: a size that is believed, a block that is used to its end and beyond.
#[test]
fn wrong_sizes() {
    let own = OwnScene::new(&common::baked());
    let planned = plan(&settings(own.handle, 2));
    let sizes = common::sizes(&planned);
    let mut memory = Block::new(sizes.session as usize + 64);
    let (at, n) = (memory.pointer(), sizes.session as usize);
    let mut session = ptr::dangling_mut();
    for given in [0, 1, 64, n - 64, n - 1] {
        let text = fails!(CROUPIER_SIZE, croupier_session_init(at, given, &planned, own.handle, &raw mut session));
        assert_eq!(text, format!("memory: wrong size, needed {n}, given {given}"));
        assert!(session.is_null());
    }
    ok!(croupier_session_init(at, n, &planned, own.handle, &raw mut session));
    assert!(memory.bytes()[n..].iter().all(|b| *b == 0xa5), "bytes behind the block");
    let (mut bytes, mut shard) = (0, ptr::dangling_mut());
    ok!(croupier_plan_shard_size(&planned, 1, &raw mut bytes));
    fails!(CROUPIER_RANGE, croupier_plan_shard_size(&planned, 2, &raw mut bytes));
    let mut block = Block::new(bytes);
    fails!(CROUPIER_SIZE, croupier_shard_init(block.pointer(), bytes - 1, &planned, 1, &raw mut shard));
    fails!(CROUPIER_RANGE, croupier_shard_init(block.pointer(), bytes, &planned, 2, &raw mut shard));
    fails!(CROUPIER_RANGE, croupier_shard_init(block.pointer(), bytes, &planned, u32::MAX, &raw mut shard));
    fails!(CROUPIER_MISALIGNED, croupier_shard_init(crooked(block.pointer()), bytes, &planned, 1, &raw mut shard));
    // the end of the address space
    let end = ptr::without_provenance_mut::<c_void>(usize::MAX - 63);
    fails!(CROUPIER_SIZE, croupier_shard_init(end, usize::MAX, &planned, 1, &raw mut shard));
    let text = fails!(CROUPIER_SIZE, croupier_session_rgb(session, end.cast(), 5));
    assert_eq!(text, "rgb: wrong size, needed 12288, given 5");
    // blocks on blocks
    fails!(CROUPIER_OVERLAP, croupier_session_init(own.blob_at(), 1 << 30, &planned, own.handle, &raw mut session));
}

/// Killed by: a struct of a newer or older program whose members are read or written beyond its size.
#[test]
fn structs_of_other_versions() {
    let own = OwnScene::new(&common::baked());
    let planned = plan(&settings(own.handle, 1));
    let mut sizes =
        [croupier_sizes { struct_size: 0, width: 9, height: 9, shards: 9, session: 9, shard: 9, stack: 9 }; 2];
    for size in [0, 1, 36, 39, 41, (1 << 16) + 4, u32::MAX] {
        sizes[0].struct_size = size;
        fails!(CROUPIER_STRUCT_SIZE, croupier_plan_sizes(&planned, &raw mut sizes[0]));
        assert_eq!((sizes[0].struct_size, sizes[0].width, sizes[1].width), (size, 9, 9));
    }
    // a newer program: its struct is longer, and what this library does not know stays
    sizes[0].struct_size = 80;
    ok!(croupier_plan_sizes(&planned, sizes.as_mut_ptr()));
    assert_eq!((sizes[0].struct_size, sizes[0].width), (80, 64));
    assert_eq!((sizes[1].struct_size, sizes[1].width, sizes[1].stack), (0, 9, 9));
    let mut camera = croupier_camera { struct_size: 72, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_scene_camera(own.handle, &raw mut camera));
    camera.struct_size = 68;
    fails!(CROUPIER_STRUCT_SIZE, croupier_scene_set_camera(own.handle, &camera));
}

/// Killed by: a mark that is not looked at, an object that is taken for one of another type, a copy that is taken for
/// the object.
#[test]
fn stale_and_foreign_handles() {
    let mut own = OwnScene::new(&common::baked());
    let planned = plan(&settings(own.handle, 1));
    let mut render = Render::new(own.handle, &planned, None);
    let (session, shard) = (render.session, render.shards[0]);
    let mut more = 0;
    // objects of other types, and memory that is none
    fails!(CROUPIER_NO_OBJECT, croupier_shard_step(session.cast(), session, 1, &raw mut more));
    fails!(CROUPIER_NO_OBJECT, croupier_shard_step(shard, shard.cast(), 1, &raw mut more));
    fails!(CROUPIER_NO_OBJECT, croupier_session_begin_iteration(own.handle.cast(), 1));
    let mut rubbish = Block::new(4096);
    fails!(CROUPIER_NO_OBJECT, croupier_session_begin_iteration(rubbish.pointer().cast(), 1));
    let empty = croupier_settings { opaque: [0; 64] };
    let mut to = croupier_plan { opaque: [0; 128] };
    fails!(CROUPIER_NO_OBJECT, croupier_plan_init(&raw mut to, &empty));
    let (at, n) = (rubbish.pointer(), rubbish.len());
    let mut handle = ptr::null_mut();
    fails!(CROUPIER_NO_OBJECT, croupier_session_init(at, n, &to, own.handle, &raw mut handle));
    // a copy of a live object
    let mut copy = Block::of(render.memory[0].bytes());
    fails!(CROUPIER_NO_OBJECT, croupier_session_begin_iteration(copy.pointer().cast(), 1));
    // a scene that is destroyed under a session
    render.begin(2);
    ok!(croupier_shard_step(shard, session, 100, &raw mut more));
    ok!(croupier_scene_destroy(own.handle));
    fails!(CROUPIER_DESTROYED, croupier_scene_destroy(own.handle));
    let text = fails!(CROUPIER_DESTROYED, croupier_shard_step(shard, session, 100, &raw mut more));
    assert_eq!(text, "scene: the object was destroyed or suspended");
    // another scene at its place
    let mut other = common::baked();
    let light = croupier::Scene::from_bytes(&other).expect("a scene").lights.len();
    assert!(light > 0);
    ok!(croupier_scene_init(
        own.object.pointer(),
        own.object.len(),
        own.blob.pointer(),
        own.blob.len(),
        &raw mut own.handle
    ));
    ok!(croupier_shard_step(shard, session, 100, &raw mut more));
    let mut camera = croupier_camera { struct_size: 72, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_scene_camera(own.handle, &raw mut camera));
    camera.origin[0] += 0.1;
    ok!(croupier_scene_set_camera(own.handle, &camera));
    fails!(CROUPIER_SCENE_CHANGED, croupier_shard_step(shard, session, 100, &raw mut more));
    ok!(croupier_session_change_scene(session, own.handle, 1));
    fails!(CROUPIER_ITERATION, croupier_shard_step(shard, session, 100, &raw mut more));
    // handles of ended objects
    ok!(croupier_shard_destroy(shard));
    fails!(CROUPIER_DESTROYED, croupier_shard_destroy(shard));
    fails!(CROUPIER_DESTROYED, croupier_shard_step(shard, session, 1, &raw mut more));
    ok!(croupier_session_destroy(session));
    fails!(CROUPIER_DESTROYED, croupier_session_begin_iteration(session, 1));
    fails!(CROUPIER_DESTROYED, croupier_session_suspend(session));
    other.as_mut()[0] ^= 1;
    render.memory.clear();
}

/// Killed by: shards of another plan that step, iterations that end too early or with other shards.
#[test]
fn calls_at_the_wrong_time() {
    let own = OwnScene::new(&common::baked());
    let two = Render::new(own.handle, &plan(&settings(own.handle, 2)), None);
    let mut seeded = settings(own.handle, 2);
    ok!(croupier_settings_set_seed(&raw mut seeded, 1));
    let other = Render::new(own.handle, &plan(&seeded), None);
    let mut more = 1;
    let finish = |shards: &[*mut croupier_shard], more: &mut u32| {
        // SAFETY: of live objects.
        unsafe {
            croupier_session_finish_iteration(
                two.session,
                shards.as_ptr(),
                shards.len(),
                1 << 40,
                more,
                ptr::null_mut(),
            )
        }
    };
    fails!(CROUPIER_ITERATION, croupier_shard_step(two.shards[0], two.session, 10, &raw mut more));
    assert_eq!(finish(&two.shards, &mut more), croupier_status::CROUPIER_ITERATION);
    two.begin(1);
    other.begin(1);
    fails!(CROUPIER_PLAN, croupier_shard_step(other.shards[0], two.session, 10, &raw mut more));
    assert_eq!(finish(&two.shards, &mut more), croupier_status::CROUPIER_UNFINISHED);
    two.step_all(1000);
    other.step_all(1000);
    let [a, b] = two.shards[..] else { panic!("two shards") };
    for (shards, status) in [
        (&[b, a][..], croupier_status::CROUPIER_SHARDS),
        (&[a], croupier_status::CROUPIER_SHARDS),
        (&[a, a], croupier_status::CROUPIER_SHARDS),
        (&[], croupier_status::CROUPIER_SHARDS),
        (&[a, other.shards[1]], croupier_status::CROUPIER_PLAN),
        (&[a, two.session.cast()], croupier_status::CROUPIER_NO_OBJECT),
    ] {
        assert_eq!(finish(shards, &mut more), status);
    }
    // the locks of the refused calls are gone
    ok!(croupier_shard_step(a, two.session, 1, &raw mut more));
    assert_eq!(finish(&two.shards, &mut more), CROUPIER_OK);
    assert_eq!(more, 0);
    // blocks that hold nothing suspended
    let mut handle = ptr::dangling_mut();
    let mut block = Block::new(1 << 20);
    let planned = plan(&seeded);
    fails!(
        CROUPIER_NOT_SUSPENDED,
        croupier_session_resume(block.pointer(), 1 << 20, &planned, own.handle, &raw mut handle)
    );
    assert!(handle.is_null());
    let mut handle = ptr::dangling_mut();
    fails!(CROUPIER_NOT_SUSPENDED, croupier_shard_resume(block.pointer(), 1 << 20, &planned, 0, &raw mut handle));
}

/// A callback that calls back. Killed by: a lock that waits, or none.
#[test]
fn callbacks_cannot_change_what_is_in_use() {
    struct Host {
        scene: *mut croupier_scene,
        session: *mut croupier_session,
        shard: *mut croupier_shard,
        calls: u32,
    }
    unsafe extern "C" fn occluded(host: *mut c_void, _: *const croupier_rays8, _: u32) -> u32 {
        // SAFETY: the test's own, on one thread.
        let host: &mut Host = unsafe { &mut *host.cast() };
        let mut more = 0;
        fails!(CROUPIER_BUSY, croupier_session_begin_iteration(host.session, 1));
        fails!(CROUPIER_BUSY, croupier_session_destroy(host.session));
        fails!(CROUPIER_BUSY, croupier_shard_step(host.shard, host.session, 1, &raw mut more));
        fails!(CROUPIER_BUSY, croupier_scene_destroy(host.scene));
        fails!(CROUPIER_BUSY, croupier_scene_set_visible(host.scene, 0, 0));
        host.calls += 1;
        0
    }
    unsafe extern "C" fn closest(
        host: *mut c_void,
        rays: *const croupier_rays8,
        active: u32,
        hits: *mut croupier_hits8,
    ) -> u32 {
        // SAFETY: the test's own, on one thread.
        let host: &mut Host = unsafe { &mut *host.cast() };
        let mut hit = 0;
        // reading goes
        ok!(croupier_scene_closest(host.scene, rays, active, hits, &raw mut hit));
        hit
    }
    let own = OwnScene::new(&common::baked());
    let mut host = Host { scene: own.handle, session: ptr::null_mut(), shard: ptr::null_mut(), calls: 0 };
    let parts = croupier_parts {
        struct_size: size_of::<croupier_parts>() as u32,
        reserved: 0,
        user: (&raw mut host).cast(),
        closest: Some(closest),
        occluded: Some(occluded),
        surface: None,
        rays: None,
        points: None,
    };
    let render = Render::new(own.handle, &plan(&settings(own.handle, 1)), Some(&parts));
    (host.session, host.shard) = (render.session, render.shards[0]);
    render.begin(1);
    render.step_all(1000);
    render.finish(1000);
    assert!(host.calls > 100);
}

/// Killed by: numbers and texts that are used without a look at their range.
#[test]
fn absurd_values() {
    let own = OwnScene::new(&common::baked());
    let mut s = settings(own.handle, 1);
    let to = &raw mut s;
    fails!(CROUPIER_RANGE, croupier_settings_set(to, c"no such setting".as_ptr(), c"1".as_ptr()));
    let text = fails!(CROUPIER_SETTINGS, croupier_settings_set(to, c"ring".as_ptr(), c"1".as_ptr()));
    assert!(text.starts_with("ring: need a whole number from 16"), "{text}");
    fails!(CROUPIER_TEXT, croupier_settings_set(to, c"\xff".as_ptr(), c"1".as_ptr()));
    let long = std::ffi::CString::new(vec![b'1'; 5000]).expect("a text");
    fails!(CROUPIER_TEXT, croupier_settings_set(to, c"seed".as_ptr(), long.as_ptr()));
    let text = |bytes: usize| std::ffi::CString::new(vec![b'x'; bytes]).expect("a text");
    fails!(CROUPIER_RANGE, croupier_settings_set(to, text(4096).as_ptr(), c"1".as_ptr()));
    fails!(CROUPIER_TEXT, croupier_settings_set(to, text(4097).as_ptr(), c"1".as_ptr()));
    let mut planned = plan(&s);
    for (width, height) in [(0, 0), (0, 5), (u32::MAX, u32::MAX)] {
        ok!(croupier_settings_set_size(to, width, height));
        fails!(CROUPIER_SETTINGS, croupier_plan_init(&raw mut planned, to));
    }
    ok!(croupier_settings_set_size(to, 64, 64));
    ok!(croupier_settings_set_shards(to, 0));
    fails!(CROUPIER_SETTINGS, croupier_plan_init(&raw mut planned, to));
    ok!(croupier_settings_set_shards(to, 1));
    ok!(croupier_plan_init(&raw mut planned, to));
    // texts are cut off, and say how long they are
    set(&mut s, "rrs", "fixed:3.3");
    let (mut buffer, mut length) = ([1; 4], 0);
    ok!(croupier_settings_get(&s, c"rrs".as_ptr(), buffer.as_mut_ptr(), 4, &raw mut length));
    assert_eq!((buffer.map(|c| c as u8), length), (*b"fix\0", 9));
    ok!(croupier_settings_get(&s, c"rrs".as_ptr(), buffer.as_mut_ptr(), 0, ptr::null_mut()));
    ok!(croupier_settings_get(&s, c"rrs".as_ptr(), ptr::null_mut(), 99, &raw mut length));
    let n = croupier_settings_count();
    fails!(CROUPIER_RANGE, croupier_settings_name(n, buffer.as_mut_ptr(), 4, &raw mut length));
    let mut line = [0; 512];
    for i in 0..n {
        ok!(croupier_settings_name(i, line.as_mut_ptr(), 512, ptr::null_mut()));
        ok!(croupier_settings_help(i, line.as_mut_ptr(), 512, &raw mut length));
        assert!(length > 10 && length < 512);
    }
    // records that do not exist, or break rules
    let mut light = bytemuck::Zeroable::zeroed();
    fails!(CROUPIER_RANGE, croupier_scene_light(own.handle, u32::MAX, &raw mut light));
    ok!(croupier_scene_light(own.handle, 0, &raw mut light));
    light.emission = [f32::NAN; 3];
    fails!(CROUPIER_EDIT, croupier_scene_set_light(own.handle, 0, &light));
    light.emission = [1.0; 3];
    light.area = 5.0;
    fails!(CROUPIER_EDIT_FIXED, croupier_scene_set_light(own.handle, 0, &light));
    let mut material = bytemuck::Zeroable::zeroed();
    ok!(croupier_scene_material(own.handle, 0, &raw mut material));
    material.kind = 77;
    fails!(CROUPIER_EDIT, croupier_scene_set_material(own.handle, 0, &material, ptr::null(), 0));
    fails!(CROUPIER_RANGE, croupier_scene_set_material(own.handle, 99, &material, ptr::null(), 0));
    let mut environment = croupier_environment { struct_size: 68, ..bytemuck::Zeroable::zeroed() };
    fails!(CROUPIER_RANGE, croupier_scene_environment(own.handle, &raw mut environment));
    fails!(CROUPIER_RANGE, croupier_scene_set_environment(own.handle, &environment));
    fails!(CROUPIER_RANGE, croupier_scene_set_visible(own.handle, 0, 1));
    fails!(CROUPIER_RANGE, croupier_scene_rebuild(own.handle, ptr::null_mut(), 0));
    // numbers of no status
    for status in [-1, 26, i32::MIN, i32::MAX] {
        assert_eq!(static_text(croupier_status_text(status)), "unknown status");
    }
    let mut texts = std::collections::HashSet::new();
    for (i, status) in croupier_status::ALL.into_iter().enumerate() {
        assert_eq!(status as usize, i);
        assert!(texts.insert(static_text(croupier_status_text(status as i32))), "{i} says what another one says");
    }
}

/// A thousand sessions, one after the other, in the same two blocks. Killed by: state that stays behind outside the
/// blocks or in them.
#[test]
fn a_thousand_sessions_in_one_block() {
    let own = OwnScene::new(&common::baked());
    let mut s = settings(own.handle, 1);
    ok!(croupier_settings_set_size(&raw mut s, 8, 8));
    let planned = plan(&s);
    let sizes = common::sizes(&planned);
    let (n, m) = (sizes.session as usize, sizes.shard as usize);
    let (mut memory, mut block) = (Block::new(n + 64), Block::new(m + 64));
    let mut first = Vec::new();
    for round in 0..1000 {
        let (mut session, mut shard, mut more) = (ptr::null_mut(), ptr::null_mut(), 1);
        ok!(croupier_session_init(memory.pointer(), n, &planned, own.handle, &raw mut session));
        ok!(croupier_shard_init(block.pointer(), m, &planned, 0, &raw mut shard));
        ok!(croupier_session_begin_iteration(session, 1));
        while more != 0 {
            ok!(croupier_shard_step(shard, session, 1000, &raw mut more));
        }
        ok!(croupier_session_finish_iteration(session, &raw const shard, 1, u64::MAX, &raw mut more));
        let mut rgb = vec![0.0f32; 3 * 64];
        ok!(croupier_session_rgb(session, rgb.as_mut_ptr(), rgb.len()));
        ok!(croupier_shard_destroy(shard));
        ok!(croupier_session_destroy(session));
        if round == 0 {
            first.clone_from(&rgb);
        }
        assert_eq!(rgb, first, "round {round}");
    }
    assert!(memory.bytes()[n..].iter().chain(&block.bytes()[m..]).all(|b| *b == 0xa5));
}
