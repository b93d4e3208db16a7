//! Stepping allocates nothing: an allocator that reports every call while it is forbidden. Alone in its binary, because
//! the allocator is global.

#[expect(dead_code, unreachable_pub, reason = "a program, of which the test calls the parts")]
#[path = "../../embed-example/host/examples/frame_loop.rs"]
mod example;

use croupier::unstable::accel::WideBvh;
use croupier::unstable::learn::Guiding;
use croupier::unstable::profile::{Full, Guided, Profile};
use croupier::unstable::scene::blob::{Light, Material};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult, Strategy};
use croupier_host::blob::AlignedBytes;
use croupier_host::renderer::{Keep, Renderer};
use croupier_tests::arrays::Arrays;
use croupier_tests::scenes::{blob, cornell, everything};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Calls since they were forbidden; `None` while they are allowed.
    static CALLS: Cell<Option<u64>> = const { Cell::new(None) };
}

struct Watched;

fn note() {
    CALLS.with(|c| c.set(c.get().map(|n| n + 1)));
}

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note();
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        note();
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(p, layout) }
    }

    unsafe fn realloc(&self, p: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note();
        // SAFETY: the caller's promise.
        unsafe { System.realloc(p, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Watched = Watched;

/// Runs `f` and panics if it called the allocator.
#[track_caller]
fn without_allocating<T>(f: impl FnOnce() -> T) -> T {
    CALLS.set(Some(0));
    let result = f();
    let calls = CALLS.take();
    assert_eq!(calls, Some(0), "calls of the allocator");
    result
}

/// The watch sees what it must. Killed by: an allocator that is not installed.
#[test]
#[should_panic(expected = "calls of the allocator")]
fn the_watch_works() {
    without_allocating(|| std::hint::black_box(vec![1u8; 100]).len());
}

/// From bytes to picture, with every strategy and every effect, without and with path guiding. Killed by: a `Vec` or a
/// `format!` anywhere on the way.
#[test]
fn nothing_is_allocated_between_bytes_and_picture() {
    for scene in [blob(&cornell([20, 12])), blob(&everything([20, 12]))] {
        for (name, _) in Strategy::TABLE {
            let text = if *name == "fixed" { "fixed:3.3" } else { name };
            let strategy = Strategy::parse(text).unwrap();
            render::<Full>(&scene, strategy, Guiding::Off);
            if ["none", "ears"].contains(name) {
                render::<Guided<Full>>(&scene, strategy, Guiding::On);
            }
        }
    }
}

/// From arrays to bytes. Killed by: a `Vec` anywhere in composing, in its checks or the tables of plastics.
#[test]
fn composing_allocates_nothing() {
    let baked = blob(&everything([20, 12]));
    let arrays = Arrays::of(&Scene::from_bytes(&baked).unwrap());
    let parts = arrays.parts();
    let layout = without_allocating(|| parts.layout()).unwrap();
    let mut bytes = AlignedBytes::zeroed(layout.blob.size);
    let mut scratch = AlignedBytes::zeroed(layout.scratch.size);
    let effects = without_allocating(|| {
        let composed = parts.compose(bytes.as_mut(), scratch.as_mut()).unwrap();
        Scene::from_bytes(composed).unwrap().effects
    });
    assert_eq!(effects, Scene::from_bytes(&baked).unwrap().effects);
}

fn render<P: Profile>(bytes: &[u8], strategy: Strategy, guiding: Guiding) {
    let scene = without_allocating(|| Scene::from_bytes(bytes)).unwrap();
    let mut settings = Settings { strategy, shards: 2, aovs: true.into(), max_depth: 6, ..Settings::for_scene(&scene) };
    settings.learning.guiding = guiding;
    let plan = without_allocating(|| Plan::new(&settings)).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut blocks = [(); 2].map(|_| AlignedBytes::zeroed(plan.shard().size));
    let [first, second] = &mut blocks;
    without_allocating(|| {
        let intersector = WideBvh::new(&scene);
        let mut session =
            Session::builder(scene).profile::<P>().intersector(intersector).build(&plan, shared.as_mut()).unwrap();
        let mut shards =
            [Shard::new(&plan, 0, first.as_mut()).unwrap(), Shard::new(&plan, 1, second.as_mut()).unwrap()];
        for samples in [1, 3] {
            session.begin_iteration(samples);
            assert!(session.end_iteration(&shards).is_err());
            for s in &mut shards {
                while s.step(&session, Budget { rays: 1000 }) == StepResult::More {}
            }
            session.end_iteration(&shards).unwrap();
        }
        session.begin_iteration(8);
        for s in &mut shards {
            let _ = s.step(&session, Budget { rays: 50 });
            s.stop();
            while s.step(&session, Budget { rays: 1000 }) == StepResult::More {}
        }
        session.end_iteration(&shards).unwrap();
        let estimate = session.film().error_estimate();
        assert!(estimate.rel_mse.is_finite() && session.counters().rays() > 0);
        assert!(
            session.guide().is_some() == (guiding == Guiding::On) && session.guide().is_none_or(|g| g.leaves() > 0)
        );
    });
}

/// Frames of a renderer that owns its memory: edits, steps, iterations. Killed by: a lock, a view or an edit that
/// allocates.
#[test]
fn frames_of_an_owning_renderer_allocate_nothing() {
    let bytes = blob(&everything([20, 12]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let strategy = Strategy::parse("ears").unwrap();
    let settings = Settings { strategy, shards: 3, aovs: true.into(), ..Settings::for_scene(&scene) };
    let (mut camera, material) = (*scene.camera, scene.materials[0]);
    let light = scene.lights[0];
    let renderer: Renderer = Renderer::new(bytes, &settings).unwrap();
    without_allocating(|| {
        for keep in [Keep::Statistics, Keep::Nothing] {
            camera.origin[0] += 0.1;
            renderer
                .edit(keep, |scene| {
                    scene.camera(camera)?;
                    scene.material(0, Material { reflectance: [0.3; 3], ..material }, &[])?;
                    scene.light(0, Light { emission: [2.0; 3], ..light })
                })
                .unwrap();
            for _ in 0..2 {
                renderer.begin_iteration(1);
                for shard in 0..3 {
                    while renderer.step(shard, Budget { rays: 50 }).unwrap() == StepResult::More {}
                }
                renderer.end_iteration().unwrap();
            }
            assert!(renderer.with_film(|film| film.error_estimate().rel_mse > 0.0));
        }
    });
}

/// The frame loop that hosts copy: moving, resting, ending iterations, reading previews. Killed by: any call of it that
/// allocates.
#[test]
fn the_frame_loop_allocates_nothing() {
    for strategy in ["classic", "ears"] {
        let mut room = example::scene();
        room.camera.size = [48, 32];
        let bytes = blob(&room);
        let scene = Scene::from_bytes(&bytes).unwrap();
        assert!(!scene.instances.is_empty(), "an object moves");
        let strategy = Strategy::parse(strategy).unwrap();
        let settings = Settings { strategy, shards: 6, aovs: true.into(), ..Settings::for_scene(&scene) };
        let mut engine = example::FrameLoop::new(bytes, &settings).unwrap();
        without_allocating(|| {
            let mut frames = 0;
            while frames <= 9 || engine.finished() < 3 {
                engine.frame(example::input(frames, 9).as_ref()).unwrap();
                frames += 1;
            }
        });
    }
}
