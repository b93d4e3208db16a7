//! Programs in C plan iterations as hosts in Rust do, with a clock and without.

mod common;

use common::{Block, OwnScene, Render, fails, ok, plan, set, settings, sizes};
use croupier::unstable::schedule::{Target, Work};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
use croupier_capi::croupier_target::*;
use croupier_capi::*;
use croupier_host::blob::AlignedBytes;
use std::ptr;

/// Clock of the tests: so many seconds a ray.
const SECONDS_PER_RAY: f64 = 1e-6;

fn work() -> croupier_work {
    croupier_work { struct_size: 48, ..bytemuck::Zeroable::zeroed() }
}

/// Rays so far.
fn rays(render: &Render) -> u64 {
    let mut c =
        croupier_counters { struct_size: size_of::<croupier_counters>() as u32, ..bytemuck::Zeroable::zeroed() };
    ok!(croupier_session_counters(render.session, &raw mut c));
    c.camera_rays + c.scatter_rays + c.straight_rays + c.light_path_rays + c.shadow_rays
}

/// Samples of the next iteration by the clock of the tests.
fn next(render: &Render, (target, amount): (croupier_target, f64), work: &mut croupier_work) -> u32 {
    let (mut samples, seconds) = (u32::MAX, rays(render) as f64 * SECONDS_PER_RAY);
    ok!(croupier_session_next_samples(render.session, target as u32, amount, seconds, work, &raw mut samples));
    samples
}

fn iterate(render: &Render, samples: u32) {
    render.begin(samples);
    render.step_all(10_000);
    render.finish(u64::MAX);
}

/// Samples of all iterations until the target is reached.
fn planned(render: &Render, target: (croupier_target, f64)) -> Vec<u32> {
    let (mut work, mut all) = (work(), Vec::new());
    loop {
        let samples = next(render, target, &mut work);
        assert_eq!((work.samples, work.rays), (all.iter().sum(), rays(render)));
        if samples == 0 {
            return all;
        }
        iterate(render, samples);
        all.push(samples);
    }
}

/// The same of a host in Rust, with the settings of `common::settings`.
fn planned_in_rust(target: Target) -> Vec<u32> {
    let bytes = common::baked();
    let scene = Scene::from_bytes(&bytes).expect("a scene");
    let mut s = Settings { shards: 2, ..Settings::for_scene(&scene) };
    for (name, value) in common::SETTINGS {
        s.set(name, value).expect("a setting");
    }
    let plan = Plan::new(&s).expect("a plan");
    let mut memory = AlignedBytes::zeroed(plan.session().size);
    let mut own = [(); 2].map(|()| AlignedBytes::zeroed(plan.shard().size));
    let mut session = Session::new(scene, &plan, memory.as_mut()).expect("a session");
    let mut shards: Vec<_> = (0..).zip(&mut own).flat_map(|(i, b)| Shard::new(&plan, i, b.as_mut())).collect();
    let (mut all, mut last, mut planned) = (Work::default(), Work::default(), Vec::new());
    loop {
        let samples = session.samples_of_next(target, &all, &last);
        if samples == 0 {
            return planned;
        }
        planned.push(samples);
        session.begin_iteration(samples);
        for shard in &mut shards {
            while shard.step(&session, Budget { rays: 10_000 }) == StepResult::More {}
        }
        session.end_iteration(&shards).expect("an end");
        let rays = session.counters().rays();
        let now = Work { samples: all.samples + samples, rays, seconds: rays as f64 * SECONDS_PER_RAY };
        last = Work { samples, rays: rays - all.rays, seconds: now.seconds - all.seconds };
        all = now;
    }
}

/// Killed by: targets exchanged, work of all iterations taken for that of the last, an error that is not the session's.
#[test]
fn programs_plan_as_hosts_in_rust_do() {
    let scene = OwnScene::new(&common::baked());
    for (target, in_rust) in [
        ((CROUPIER_TARGET_SAMPLES, 37.0), Target::Spp(37)),
        ((CROUPIER_TARGET_SECONDS, 0.6), Target::Seconds(0.6)),
        ((CROUPIER_TARGET_RAYS, 5e5), Target::Rays(500_000)),
        ((CROUPIER_TARGET_ERROR, 0.03), Target::Error(0.03)),
    ] {
        let render = Render::new(scene.handle, &plan(&settings(scene.handle, 2)), None);
        let samples = planned(&render, target);
        assert_eq!(samples, planned_in_rust(in_rust), "{target:?}");
        assert!(samples.len() > 3 && samples[0] == 1, "{target:?}: {samples:?}");
        if target.0 == CROUPIER_TARGET_SECONDS {
            let (spent, last) = (rays(&render) as f64 * SECONDS_PER_RAY, f64::from(samples[samples.len() - 1]));
            assert!(spent < 0.62 && spent > 0.58 - 0.3 / last, "{spent} of 0.6 seconds");
        }
    }
}

/// A program that asks twice, and one that wants more when it is done. Killed by: a second call that knows nothing of the
/// last iteration.
#[test]
fn asking_twice_changes_nothing() {
    let scene = OwnScene::new(&common::baked());
    for target in [(CROUPIER_TARGET_SECONDS, 0.2), (CROUPIER_TARGET_RAYS, 2e5)] {
        let render = Render::new(scene.handle, &plan(&settings(scene.handle, 1)), None);
        let mut work = work();
        loop {
            let samples = next(&render, target, &mut work);
            let kept = work;
            assert_eq!(next(&render, target, &mut work), samples);
            assert_eq!(work, kept);
            if samples == 0 {
                break;
            }
            iterate(&render, samples);
        }
        assert!(rays(&render) < 202_000, "{}", rays(&render));
        let more = next(&render, (target.0, 1.1 * target.1), &mut work);
        iterate(&render, more);
        assert!(more > 0 && rays(&render) < 223_000, "{more} more samples: {} rays", rays(&render));
    }
}

/// Work begins anew with the picture, whatever the struct holds. Killed by: work of the picture before that counts.
#[test]
fn restarted_pictures_are_planned_anew() {
    let scene = OwnScene::new(&common::baked());
    let render = Render::new(scene.handle, &plan(&settings(scene.handle, 1)), None);
    let target = (CROUPIER_TARGET_SAMPLES, 12.0);
    let first = planned(&render, target);
    ok!(croupier_session_restart(render.session, 0));
    let mut stale = croupier_work { samples: 12, rays: u64::MAX, seconds: 1e9, ..work() };
    assert_eq!(next(&render, target, &mut stale), 1);
    assert_eq!((stale.samples, stale.rays), (0, 0));
    assert_eq!(planned(&render, target), first);
}

/// Parts of a picture that are rendered apart plan their own samples, and suspended sessions go on without the work of
/// before. Killed by: skipped samples that count as the part's, a resumed session that begins with one sample.
#[test]
fn parts_and_resumed_sessions_plan_their_own_samples() {
    let scene = OwnScene::new(&common::baked());
    let plan = plan(&settings(scene.handle, 1));
    let mut render = Render::new(scene.handle, &plan, None);
    let whole = planned(&render, (CROUPIER_TARGET_RAYS, 1e5));
    ok!(croupier_session_restart(render.session, 0));
    ok!(croupier_session_skip(render.session, 100, 5000));
    let part = planned(&render, (CROUPIER_TARGET_RAYS, 1e5));
    assert!(part[0] == 1 && part[1] <= 2 && part[2] <= 4, "{part:?} {whole:?}");
    assert!(part.iter().sum::<u32>().abs_diff(whole.iter().sum()) <= 2, "{part:?} {whole:?}");

    ok!(croupier_session_suspend(render.session));
    let (pointer, bytes) = (render.memory[0].pointer(), render.memory[0].len());
    ok!(croupier_session_resume(pointer, bytes, &plan, scene.handle, &raw mut render.session));
    assert_eq!(next(&render, (CROUPIER_TARGET_RAYS, 1e5), &mut work()), 0, "it is done");
    let more = next(&render, (CROUPIER_TARGET_RAYS, 1e6), &mut work());
    assert!(more > 1, "{more}");
}

/// Killed by: an amount that is not compared, a message that names another parameter.
#[test]
fn what_cannot_be_planned_is_refused() {
    let scene = OwnScene::new(&common::baked());
    let render = Render::new(scene.handle, &plan(&settings(scene.handle, 1)), None);
    let (session, mut samples, mut kept) = (render.session, 7, work());
    for amount in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let text = fails!(
            CROUPIER_RANGE,
            croupier_session_next_samples(session, 0, amount, 0.0, &raw mut kept, &raw mut samples)
        );
        assert!(text.contains("amount"), "{text}");
    }
    for seconds in [-1.0, f64::NAN, f64::INFINITY] {
        let text = fails!(
            CROUPIER_RANGE,
            croupier_session_next_samples(session, 1, 1.0, seconds, &raw mut kept, &raw mut samples)
        );
        assert!(text.contains("seconds"), "{text}");
    }
    let text =
        fails!(CROUPIER_RANGE, croupier_session_next_samples(session, 4, 1.0, 0.0, &raw mut kept, &raw mut samples));
    assert!(text.contains("target") && text.contains('4'), "{text}");
    fails!(CROUPIER_NULL, croupier_session_next_samples(session, 0, 1.0, 0.0, ptr::null_mut(), &raw mut samples));
    fails!(CROUPIER_NULL, croupier_session_next_samples(session, 0, 1.0, 0.0, &raw mut kept, ptr::null_mut()));
    kept.struct_size = 47;
    fails!(CROUPIER_STRUCT_SIZE, croupier_session_next_samples(session, 0, 1.0, 0.0, &raw mut kept, &raw mut samples));
    assert_eq!(samples, 7, "nothing is written");
    // the largest and the smallest amounts are as good as any
    kept.struct_size = 48;
    for (target, amount) in [(0, 1e300), (0, 1e-300), (1, 1e300), (2, 1e300), (3, 1e-300)] {
        ok!(croupier_session_next_samples(session, target, amount, 0.0, &raw mut kept, &raw mut samples));
        assert_eq!(samples, 1);
    }
}

/// A session that guides paths, where the library has it; else the settings are refused. Killed by: kernels without path
/// guiding in a library with it, a picture that is not that of the settings.
#[test]
fn path_guiding_is_a_setting() {
    let scene = OwnScene::new(&common::baked());
    let mut guided = settings(scene.handle, 1);
    for (name, value) in [("guiding", "on"), ("cache-bytes", "1MiB"), ("pixel-estimator", "denoised")] {
        set(&mut guided, name, value);
    }
    let plan = plan(&guided);
    if cfg!(feature = "guiding") {
        let render = Render::new(scene.handle, &plan, None);
        planned(&render, (CROUPIER_TARGET_SAMPLES, 16.0));
        let mut counters = croupier_counters { struct_size: 320, ..bytemuck::Zeroable::zeroed() };
        ok!(croupier_session_counters(render.session, &raw mut counters));
        assert!(counters.light_path_rays > 0, "light paths teach the guide");
    } else {
        let mut memory = Block::new(sizes(&plan).session as usize);
        let mut session = ptr::null_mut();
        let (pointer, bytes) = (memory.pointer(), memory.len());
        let text =
            fails!(CROUPIER_EFFECTS, croupier_session_init(pointer, bytes, &plan, scene.handle, &raw mut session));
        assert!(text.contains("guiding"), "{text}");
    }
}
