//! The renderer that owns what it needs: stored in a struct, edited between frames, stepped by threads that stay.

use croupier::unstable::bsdf::NoBsdf;
use croupier::unstable::extension::{Extension, TextureSamples8};
use croupier::unstable::profile::Full;
use croupier::unstable::scene::blob::{Camera, Material};
use croupier::unstable::simd::Vec3x8;
use croupier::{Budget, Plan, Scene, Session, SessionError, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_host::renderer::{Keep, Renderer, RendererError};
use croupier_tests::runner::{render, settings};
use croupier_tests::scenes::{blob, everything};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Barrier};
use std::thread;

/// What a host's own state may look like: no lifetimes.
struct Viewport {
    renderer: Arc<Renderer>,
    camera: Camera,
}

fn viewport(shards: u32, strategy: &str) -> Viewport {
    let bytes = blob(&everything([24, 16]));
    let s = Settings { shards, ..settings(&bytes, strategy) };
    let renderer = Arc::new(Renderer::new(bytes, &s).expect("a renderer"));
    let camera = renderer.with_scene(|scene| *scene.camera);
    Viewport { renderer, camera }
}

impl Viewport {
    fn frame(&mut self, i: u32) {
        self.camera.origin[0] += 0.01 * i as f32;
        self.renderer.edit(Keep::Statistics, |scene| scene.camera(self.camera)).expect("a camera");
    }

    /// One iteration of a sample per pixel, in steps of so many rays.
    fn iterate(&self, rays: u64) {
        let r = &self.renderer;
        r.begin_iteration(1);
        for shard in 0..r.plan().settings().shards {
            while r.step(shard, Budget { rays }).unwrap() == StepResult::More {}
        }
        r.end_iteration().unwrap();
    }

    fn film(&self) -> Vec<u8> {
        self.renderer.with_film(|film| film.pixels().flat_map(|p| bytemuck::bytes_of(&p).to_vec()).collect())
    }
}

/// A grey world, by textures of the host's own.
#[derive(Clone, Copy)]
struct Grey(f32);

impl Extension for Grey {
    type Bsdf = NoBsdf;
    const TEXTURES: bool = true;

    fn reflectance(&self, _at: &TextureSamples8, _reflectance: Vec3x8) -> Vec3x8 {
        Vec3x8::splat(self.0, self.0, self.0)
    }
}

/// A renderer with an extension, also after an edit, draws what a session with it draws. Killed by: steps, a build or an edit
/// without the extension; a number of it that is lost.
#[test]
fn extensions_are_in_every_step() {
    let bytes = blob(&everything([24, 16]));
    let s = settings(&bytes, "ears");
    let film = |r: &Renderer<Full, Grey>| -> Vec<u8> {
        for _ in 0..2 {
            r.begin_iteration(2);
            while r.step(0, Budget { rays: 100 }).unwrap() == StepResult::More {}
            r.end_iteration().unwrap();
        }
        r.with_film(|film| film.pixels().flat_map(|p| bytemuck::bytes_of(&p).to_vec()).collect())
    };
    let with = |grey| Renderer::<Full, Grey>::with_extension(bytes.clone(), &s, Grey(grey)).unwrap();
    let r = with(0.5);
    let first = film(&r);
    let camera = r.with_scene(|scene| *scene.camera);
    r.edit(Keep::Nothing, |scene| scene.camera(camera)).unwrap();
    assert!(film(&r) == first, "after an edit");
    assert!(film(&with(0.25)) != first, "another number");

    let scene = Scene::from_bytes(&bytes).unwrap();
    let plan = Plan::new(&s.with_scene(&scene)).unwrap();
    let [mut shared, mut block] = [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
    let mut session = Session::builder(scene).extension(Grey(0.5)).build(&plan, shared.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
    for _ in 0..2 {
        session.begin_iteration(2);
        while shard.step(&session, Budget { rays: 1000 }) == StepResult::More {}
        session.end_iteration([&shard]).unwrap();
    }
    let wanted: Vec<u8> = session.film().pixels().flat_map(|p| bytemuck::bytes_of(&p).to_vec()).collect();
    assert!(first == wanted, "a session with it");
}

/// After any edits, without statistics kept, the picture is the one that a new session makes of the same scene. Killed
/// by: anything of an earlier picture that is kept, an edit that the shards do not see, a seed that counts restarts.
#[test]
fn an_edited_scene_gives_the_picture_of_a_new_one() {
    for strategy in ["classic", "ears"] {
        let mut v = viewport(3, strategy);
        for i in 0..3 {
            v.frame(i);
            v.iterate(50);
        }
        // an iteration that is abandoned half way
        v.renderer.begin_iteration(2);
        v.renderer.step(1, Budget { rays: 20 }).unwrap();
        let painted = v.renderer.with_scene(|s| Material { reflectance: [0.1, 0.6, 0.2], ..s.materials[0] });
        v.renderer
            .edit(Keep::Nothing, |scene| {
                scene.material(0, painted, &[])?;
                scene.camera(v.camera)
            })
            .unwrap();
        (0..3).for_each(|_| v.iterate(1000));
        let (film, plan) = (v.film(), *v.renderer.plan());
        let Viewport { renderer, .. } = v;
        let bytes = Arc::into_inner(renderer).expect("no other owner").into_blob();
        let scene = Scene::from_bytes(&bytes).expect("a valid blob");
        assert_eq!(scene.materials[0].reflectance, [0.1, 0.6, 0.2]);
        let fresh = Viewport { renderer: Arc::new(Renderer::new(bytes, plan.settings()).unwrap()), camera: v.camera };
        (0..3).for_each(|_| fresh.iterate(u64::MAX));
        assert!(film == fresh.film(), "{strategy}: the pictures differ");
    }
}

/// Kept statistics change the noise, not the expectation. Killed by: a picture that keeps samples of the old camera.
#[test]
fn kept_statistics_do_not_change_the_mean() {
    let mut v = viewport(2, "ears");
    v.iterate(1000);
    v.camera.origin[1] += 0.2;
    v.renderer.edit(Keep::Statistics, |scene| scene.camera(v.camera)).unwrap();
    (0..256).for_each(|_| v.iterate(u64::MAX));
    let film: Vec<_> = v.renderer.with_film(|film| film.pixels().collect());
    let mean = film.iter().flat_map(|p| p.mean()).sum::<f64>() / (3 * film.len()) as f64;
    let error = film.iter().map(|p| p.variance_of_mean().iter().sum::<f64>()).sum::<f64>().sqrt() / film.len() as f64;
    let Viewport { renderer, .. } = v;
    let bytes = Arc::into_inner(renderer).unwrap().into_blob();
    let reference = render(&bytes, &Settings { seed: 7, ..settings(&bytes, "classic") }, 512);
    let noise = error.hypot(reference.error_of_mean());
    assert!((mean - reference.mean()).abs() < 4.0 * noise, "{mean} {} +- {noise}", reference.mean());
    assert!(noise < 0.03 * mean, "{noise} of {mean}: the test could not tell");
}

/// Threads that live as long as the program step shards frame after frame while the main thread edits the scene. Killed
/// by: a picture that depends on who steps what.
#[test]
fn threads_that_stay_step_it() {
    let whole = {
        let mut v = viewport(5, "ears");
        for i in 0..4 {
            v.frame(i);
            (0..2).for_each(|_| v.iterate(u64::MAX));
        }
        v.film()
    };
    let mut v = viewport(5, "ears");
    let (workers, stop, next) = (3, Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
    let gate = Arc::new(Barrier::new(workers + 1));
    let threads: Vec<_> = (0..workers)
        .map(|_| {
            let (renderer, stop, next, gate) =
                (Arc::clone(&v.renderer), Arc::clone(&stop), Arc::clone(&next), Arc::clone(&gate));
            thread::spawn(move || {
                loop {
                    gate.wait();
                    if stop.load(Ordering::Acquire) {
                        return;
                    }
                    let shards = renderer.plan().settings().shards;
                    loop {
                        let shard = next.fetch_add(1, Ordering::Relaxed);
                        if shard >= shards {
                            break;
                        }
                        while renderer.step(shard, Budget { rays: 100 }).unwrap() == StepResult::More {}
                    }
                    gate.wait();
                }
            })
        })
        .collect();
    for i in 0..4 {
        v.frame(i);
        for _ in 0..2 {
            v.renderer.begin_iteration(1);
            next.store(0, Ordering::Relaxed);
            gate.wait();
            gate.wait();
            v.renderer.end_iteration().unwrap();
        }
    }
    stop.store(true, Ordering::Release);
    gate.wait();
    threads.into_iter().for_each(|t| t.join().unwrap());
    assert!(v.film() == whole, "the pictures differ");
}

/// Killed by: an error that loses what was rendered, a wrong index that is taken, a stale iteration that ends.
#[test]
fn errors_leave_the_picture() {
    let v = viewport(2, "classic");
    v.iterate(u64::MAX);
    let film = v.film();
    let shards = v.renderer.step(2, Budget { rays: 1 }).unwrap_err().to_string();
    assert!(shards.contains("shard 2 of a plan with 2 shards"), "{shards}");
    assert_eq!(v.renderer.end_iteration(), Err(RendererError::Session(SessionError::NoIteration)));
    v.renderer.begin_iteration(1);
    v.renderer.step(0, Budget { rays: u64::MAX }).unwrap();
    let unfinished = Err(RendererError::Session(SessionError::Unfinished { shard: 1 }));
    assert_eq!(v.renderer.end_iteration(), unfinished);
    v.renderer.step(1, Budget { rays: 10 }).unwrap();
    assert_eq!(v.renderer.end_iteration(), unfinished, "a shard that is on its way");
    assert!(v.film() == film);
    v.renderer.stop();
    while v.renderer.step(1, Budget { rays: 1000 }).unwrap() == StepResult::More {}
    v.renderer.end_iteration().unwrap();
    assert!(v.film() != film);
    assert!(Renderer::<Full>::new(AlignedBytes::zeroed(64), &Settings::default()).is_err());
}
