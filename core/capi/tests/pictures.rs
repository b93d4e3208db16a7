//! Pictures through the C interface have the bits that Rust gets.

mod common;

use common::{OwnScene, Render, c, expected, fails, ok, plan, set, settings, static_text};
use croupier_capi::croupier_status::CROUPIER_OK;
use croupier_capi::*;
use std::ffi::c_void;
use std::ptr;
use std::thread;

/// Killed by: a kernel, a setting or an order of shards that differs from the core's, steps that change bits.
#[test]
fn pictures_are_those_of_rust() {
    let scene = OwnScene::new(&common::baked());
    for (name, shards) in [("A", 1), ("B", 8)] {
        let plan = plan(&settings(scene.handle, shards));
        assert_eq!(Render::new(scene.handle, &plan, None).render(1000, u64::MAX), expected(name), "{name}");
    }
    let plan = plan(&settings(scene.handle, 1));
    assert_eq!(Render::new(scene.handle, &plan, None).render(16, 50), expected("A"));
}

/// Shards on threads of their own. Killed by: a lock that refuses steps which may run together, a shared state.
#[test]
fn shards_step_on_threads() {
    struct Pointers(*mut croupier_shard, *mut croupier_session);
    // SAFETY: the documentation of `croupier_shard_step` lets different shards step on different threads.
    unsafe impl Send for Pointers {}
    let scene = OwnScene::new(&common::baked());
    let render = Render::new(scene.handle, &plan(&settings(scene.handle, 8)), None);
    for samples in [2, 2, 4] {
        render.begin(samples);
        thread::scope(|scope| {
            for shard in &render.shards {
                let pointers = Pointers(*shard, render.session);
                scope.spawn(move || {
                    let Pointers(shard, session) = { pointers };
                    let mut more = 1;
                    while more != 0 {
                        ok!(croupier_shard_step(shard, session, 500, &raw mut more));
                    }
                });
            }
        });
        render.finish(u64::MAX);
    }
    assert_eq!(render.hash(), expected("B"));
}

unsafe extern "C" fn closest(
    scene: *mut c_void,
    rays: *const croupier_rays8,
    active: u32,
    hits: *mut croupier_hits8,
) -> u32 {
    assert_eq!((rays.addr() % 32, hits.addr() % 32), (0, 0));
    let mut hit = 0;
    let status = c!(croupier_scene_closest(scene.cast(), rays, active, hits, &raw mut hit, ptr::null_mut()));
    assert_eq!(status, CROUPIER_OK);
    hit
}

unsafe extern "C" fn occluded(scene: *mut c_void, rays: *const croupier_rays8, active: u32) -> u32 {
    let mut hit = 0;
    let status = c!(croupier_scene_occluded(scene.cast(), rays, active, &raw mut hit, ptr::null_mut()));
    assert_eq!(status, CROUPIER_OK);
    hit
}

/// A camera at (0, 1, 6.8) as the scene's, of the core's own arithmetic.
unsafe extern "C" fn rays(
    camera: *mut c_void,
    samples: *const croupier_samples8,
    active: u32,
    rays: *mut croupier_source_rays8,
) -> u32 {
    use croupier::unstable::camera::generate;
    use croupier::unstable::simd::F32x8;
    // SAFETY: the test's own camera.
    let camera: &croupier::unstable::scene::blob::Camera = unsafe { &*camera.cast() };
    // SAFETY: the library's promise.
    let s = unsafe { &*samples };
    // SAFETY: the library's promise.
    let to = unsafe { &mut *rays };
    let [x, y] = s.position.map(F32x8::new);
    let (o, d) = generate(camera, [s.width, s.height], x, y, s.u.map(F32x8::new));
    to.origin = [o.x, o.y, o.z].map(F32x8::to_array);
    to.direction = [d.x, d.y, d.z].map(F32x8::to_array);
    active
}

fn parts(user: *mut c_void) -> croupier_parts {
    croupier_parts {
        struct_size: size_of::<croupier_parts>() as u32,
        reserved: 0,
        user,
        closest: None,
        occluded: None,
        surface: None,
        rays: None,
        points: None,
    }
}

/// A host that hands every ray back to the library's own tree, and one that makes the camera's rays. Killed by: lanes,
/// axes or fields that are mixed up on the way to a callback or back.
#[test]
fn own_parts_that_do_the_same_give_the_same_picture() {
    let blob = common::baked();
    let scene = OwnScene::new(&blob);
    let plan = plan(&settings(scene.handle, 1));
    let own = croupier_parts { closest: Some(closest), occluded: Some(occluded), ..parts(scene.handle.cast()) };
    assert_eq!(Render::new(scene.handle, &plan, Some(&own)).render(1000, u64::MAX), expected("A"));
    let mut camera = *croupier::Scene::from_bytes(&blob).expect("a scene").camera;
    let own = croupier_parts { rays: Some(rays), ..parts((&raw mut camera).cast()) };
    assert_eq!(Render::new(scene.handle, &plan, Some(&own)).render(1000, u64::MAX), expected("A"));
    // without callbacks it is the built-in kernel
    let none = Render::new(scene.handle, &plan, Some(&parts(ptr::null_mut())));
    assert_eq!(none.render(1000, u64::MAX), expected("A"));
}

unsafe extern "C" fn nonsense(_: *mut c_void, _: *const croupier_rays8, _: u32, hits: *mut croupier_hits8) -> u32 {
    // SAFETY: the library's promise.
    let hits = unsafe { &mut *hits };
    hits.t = [f32::NAN, -1.0, 1e9, 1.0, 1.0, f32::INFINITY, 0.5, 0.5];
    hits.triangle = [0, 1, 2, u32::MAX, 1 << 31, 3, u32::MAX - 1, 1 << 20];
    hits.u = [f32::NAN; 8];
    hits.instance = [[5; 8]; 2];
    u32::MAX
}

unsafe extern "C" fn everything(_: *mut c_void, _: *const croupier_rays8, _: u32) -> u32 {
    u32::MAX
}

/// An intersector that finds what cannot be: the picture is black, not undefined. Killed by: hits that are not looked
/// at.
#[test]
fn nonsense_of_an_intersector_is_no_hit() {
    let scene = OwnScene::new(&common::baked());
    let plan = plan(&settings(scene.handle, 1));
    let own = croupier_parts { closest: Some(nonsense), occluded: Some(everything), ..parts(ptr::null_mut()) };
    let render = Render::new(scene.handle, &plan, Some(&own));
    render.render(1000, u64::MAX);
    assert!(render.rgb().iter().all(|x| *x == 0.0));
}

/// Points of eight triangles in place of a camera: irradiance over pi. Killed by: a kernel without them.
#[test]
fn camera_samples_begin_at_points() {
    unsafe extern "C" fn points(
        _: *mut c_void,
        _: *const croupier_samples8,
        active: u32,
        points: *mut croupier_source_points8,
    ) -> u32 {
        // SAFETY: the library's promise.
        let points = unsafe { &mut *points };
        (points.triangle, points.u, points.v) = ([0, 4, 8, 12, 16, 20, 24, 28], [0.3; 8], [0.3; 8]);
        active
    }
    let scene = OwnScene::new(&common::baked());
    let own = croupier_parts { points: Some(points), ..parts(ptr::null_mut()) };
    let render = Render::new(scene.handle, &plan(&settings(scene.handle, 1)), Some(&own));
    render.render(1000, u64::MAX);
    let lit = render.rgb().iter().filter(|x| **x > 0.0).count();
    assert!(lit > render.pixels / 2, "{lit} of {}", 3 * render.pixels);
}

/// Parts that do not go together are refused. Killed by: a pair that is used half.
#[test]
fn half_a_part_is_refused() {
    let mut scene = OwnScene::new(&common::baked());
    let plan = plan(&settings(scene.handle, 1));
    for own in [
        croupier_parts { closest: Some(closest), ..parts(ptr::null_mut()) },
        croupier_parts { occluded: Some(occluded), ..parts(ptr::null_mut()) },
    ] {
        let mut session = ptr::dangling_mut();
        let memory = scene.object.pointer();
        fails!(CROUPIER_RANGE, croupier_session_init_with(memory, 0, &plan, scene.handle, &own, &raw mut session));
    }
}

/// Blocks that are copied elsewhere in the middle of an iteration go on with the same bits. Killed by: an address that
/// is kept, a state that is left out.
#[test]
fn suspended_blocks_go_on_elsewhere() {
    let scene = OwnScene::new(&common::baked());
    let plan = plan(&settings(scene.handle, 1));
    let mut render = Render::new(scene.handle, &plan, None);
    let mut more = 0;
    for samples in [2, 2, 4] {
        render.begin(samples);
        ok!(croupier_shard_step(render.shards[0], render.session, 3000, &raw mut more));
        assert_eq!(more, 1);
        let old = (render.shards[0], render.session);
        ok!(croupier_shard_suspend(old.0));
        ok!(croupier_session_suspend(old.1));
        fails!(CROUPIER_DESTROYED, croupier_shard_step(old.0, old.1, 1, &raw mut more));
        let mut moved: Vec<_> = render.memory.iter_mut().map(|b| common::Block::of(b.bytes())).collect();
        let [a, b] = &mut moved[..] else { panic!("two blocks") };
        let (session, shard) = (&raw mut render.session, &raw mut render.shards[0]);
        ok!(croupier_session_resume(a.pointer(), a.len(), &plan, scene.handle, session));
        ok!(croupier_shard_resume(b.pointer(), b.len(), &plan, 0, shard));
        render.memory = moved;
        render.step_all(700);
        render.finish(100);
    }
    assert_eq!(render.hash(), expected("A"));
}

/// Two processes that render half of the shards each have the picture of one. Killed by: a shard that is taken for
/// another one, sums that are left out.
#[test]
fn processes_exchange_shards() {
    let scene = OwnScene::new(&common::baked());
    let plan = plan(&settings(scene.handle, 8));
    let both = [(); 2].map(|()| Render::new(scene.handle, &plan, None));
    let mut longest = 0;
    ok!(croupier_plan_saved_shard_size(&plan, 0, &raw mut longest));
    fails!(CROUPIER_RANGE, croupier_plan_saved_shard_size(&plan, 8, &raw mut longest));
    let (mut bytes, mut written, mut has_more) = (vec![0u8; longest], 0, 0);
    for samples in [2, 2, 4] {
        both.iter().for_each(|r| r.begin(samples));
        for i in 0..8 {
            let [from, to] = if i % 2 == 0 { [0, 1] } else { [1, 0] };
            let (shard, other) = (both[from].shards[i], both[to].shards[i]);
            let (p, n) = (bytes.as_mut_ptr().cast(), bytes.len());
            if samples == 2 && from == 0 && i == 0 {
                // one that has just begun
                ok!(croupier_shard_step(shard, both[from].session, 1, &raw mut has_more));
                fails!(CROUPIER_UNFINISHED, croupier_shard_save(shard, p, n, &raw mut written));
            }
            let mut more = 1;
            while more != 0 {
                ok!(croupier_shard_step(shard, both[from].session, 1000, &raw mut more));
            }
            fails!(CROUPIER_SIZE, croupier_shard_save(shard, p, 10, &raw mut written));
            ok!(croupier_shard_save(shard, p, n, &raw mut written));
            assert!(written > 0 && written <= n);
            fails!(CROUPIER_SIZE, croupier_shard_load(other, both[to].session, p, written - 1));
            bytes[written / 2] ^= 1;
            fails!(CROUPIER_SAVED, croupier_shard_load(other, both[to].session, p, written));
            bytes[written / 2] ^= 1;
            let next = both[to].shards[(i + 1) % 8];
            fails!(CROUPIER_SAVED, croupier_shard_load(next, both[to].session, p, written));
            ok!(croupier_shard_load(other, both[to].session, p, written));
        }
        both.iter().for_each(|r| r.finish(u64::MAX));
    }
    assert_eq!(both.each_ref().map(Render::hash), [expected("B"); 2]);
    fails!(CROUPIER_ITERATION, croupier_session_skip(both[0].session, 3, 8));
    let apart = Render::new(scene.handle, &plan, None);
    ok!(croupier_session_skip(apart.session, 3, 8));
    assert_ne!(apart.render(1000, u64::MAX), expected("B"));
}

/// Statistics and estimate go out and come in. Killed by: bytes of another session that are not checked, a load that
/// does nothing.
#[test]
fn statistics_are_saved_and_loaded() {
    let scene = OwnScene::new(&common::baked());
    let plan = plan(&settings(scene.handle, 1));
    let first = Render::new(scene.handle, &plan, None);
    first.render(1000, u64::MAX);
    let mut size = 0;
    ok!(croupier_session_statistics_size(first.session, &raw mut size));
    let mut saved = vec![0u8; size];
    fails!(CROUPIER_SIZE, croupier_session_save_statistics(first.session, saved.as_mut_ptr().cast(), size - 1));
    ok!(croupier_session_save_statistics(first.session, saved.as_mut_ptr().cast(), size));
    let second = Render::new(scene.handle, &plan, None);
    let bytes = saved.as_ptr().cast();
    ok!(croupier_session_load_statistics(second.session, bytes, size, 0));
    let mut again = vec![0u8; size];
    ok!(croupier_session_save_statistics(second.session, again.as_mut_ptr().cast(), size));
    assert!(saved == again);
    assert_ne!(second.render(1000, u64::MAX), expected("A"), "statistics change the paths");
    saved[size / 2] ^= 1;
    fails!(CROUPIER_SAVED, croupier_session_load_statistics(second.session, bytes, size, 1));
    // blocks of pixels have no estimate per pixel
    let mut rgb = vec![0.0f32; 3 * second.pixels];
    fails!(CROUPIER_SIZE, croupier_session_give_estimate(second.session, rgb.as_ptr(), rgb.len()));
    let mut denoised = settings(scene.handle, 1);
    set(&mut denoised, "pixel-estimator", "denoised");
    let third = Render::new(scene.handle, &common::plan(&denoised), None);
    let (p, n) = (rgb.as_mut_ptr(), rgb.len());
    fails!(CROUPIER_ABSENT, croupier_session_estimate(third.session, p, n));
    third.render(1000, u64::MAX);
    ok!(croupier_session_estimate(third.session, p, n));
    assert!(rgb.iter().sum::<f32>() > 0.0);
    fails!(CROUPIER_SIZE, croupier_session_give_estimate(third.session, p, n - 1));
    ok!(croupier_session_give_estimate(third.session, p, n));
}

/// What a session shows beside its picture. Killed by: a plane, a count or a pixel of another place.
#[test]
fn what_sessions_show() {
    let scene = OwnScene::new(&common::baked());
    let mut with = settings(scene.handle, 1);
    set(&mut with, "aovs", "albedo,depth,cost,object");
    let render = Render::new(scene.handle, &plan(&with), None);
    let n = render.pixels;
    let mut plane = vec![-5.0f32; n];
    let p = plane.as_mut_ptr();
    fails!(CROUPIER_ABSENT, croupier_session_plane(render.session, 2, 0, p, n));
    render.begin(2);
    let mut rgb = vec![-1.0f32; 3 * n];
    let mut written = 5;
    ok!(croupier_shard_unfinished(render.shards[0], render.session, rgb.as_mut_ptr(), 3 * n, &raw mut written));
    assert_eq!(written, 0);
    render.step_all(1000);
    ok!(croupier_shard_unfinished(render.shards[0], render.session, rgb.as_mut_ptr(), 3 * n, &raw mut written));
    assert_eq!(written, n);
    render.finish(u64::MAX);
    assert_eq!(rgb, render.rgb(), "of one iteration");
    ok!(croupier_session_plane(render.session, 2, 0, p, n));
    assert!(plane.iter().all(|z| (0.0..9.0).contains(z)), "distances in the box");
    assert!(plane.iter().filter(|z| **z > 5.0).count() > n / 2);
    fails!(CROUPIER_ABSENT, croupier_session_plane(render.session, 1, 0, p, n));
    fails!(CROUPIER_RANGE, croupier_session_plane(render.session, 2, 1, p, n));
    fails!(CROUPIER_RANGE, croupier_session_plane(render.session, 15, 0, p, n));
    fails!(CROUPIER_SIZE, croupier_session_plane(render.session, 2, 0, p, n + 1));
    assert_eq!((0..16).map(|aov| croupier_aov_channels(aov)).sum::<u32>(), 38);

    let empty = croupier_pixel { mean: [0.0; 3], standard_error: [0.0; 3], samples: 0, rays: 0 };
    let mut pixels = vec![empty; n];
    ok!(croupier_session_pixels(render.session, 1, n - 1, pixels.as_mut_ptr()));
    fails!(CROUPIER_RANGE, croupier_session_pixels(render.session, 1, n, pixels.as_mut_ptr()));
    fails!(CROUPIER_RANGE, croupier_session_pixels(render.session, usize::MAX, 2, pixels.as_mut_ptr()));
    assert!(pixels.iter().zip(render.rgb()[3..].chunks(3)).all(|(p, rgb)| p.mean == rgb));
    assert!(pixels[..n - 1].iter().all(|p| p.samples == 2 && p.rays >= 2) && pixels.iter().any(|p| p.rays > 2));
    assert!(pixels.iter().any(|p| p.standard_error.iter().all(|e| *e > 0.0)));

    let mut counters = croupier_counters { struct_size: 312, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_session_counters(render.session, &raw mut counters));
    assert_eq!(counters.camera_samples, 2 * n as u64);
    assert!(counters.shadow_rays > 0 && counters.ring_peak > 0 && counters.scatter.packets > 0);
    let mut estimate = croupier_error_estimate { struct_size: 48, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_session_error_estimate(render.session, &raw mut estimate));
    assert!(estimate.low < estimate.rel_mse && estimate.rel_mse < estimate.high);
    let mut iteration = croupier_iteration { struct_size: 32, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_session_iteration(render.session, &raw mut iteration));
    assert_eq!((iteration.number, iteration.samples, iteration.restarts), (1, 2, 0));
    assert_eq!(static_text(croupier_instruction_set()), croupier::INSTRUCTION_SET);
    assert_eq!(static_text(croupier_version()), env!("CARGO_PKG_VERSION"));
}

/// The samples of a handful of pixels do not tell the error, those of a picture do. Killed by: a flag that is always set,
/// or never, or upside down.
#[test]
fn small_pictures_are_unresolved() {
    let scene = OwnScene::new(&common::baked());
    for (size, resolved) in [("7x7", 0), ("64x64", 1)] {
        let mut with = settings(scene.handle, 1);
        set(&mut with, "size", size);
        let render = Render::new(scene.handle, &plan(&with), None);
        render.begin(16);
        render.step_all(1000);
        render.finish(u64::MAX);
        let mut estimate = croupier_error_estimate { struct_size: 48, ..bytemuck::Zeroable::zeroed() };
        ok!(croupier_session_error_estimate(render.session, &raw mut estimate));
        assert!(estimate.rel_mse > 0.0);
        assert_eq!(estimate.resolved, resolved, "{size}");
    }
}
