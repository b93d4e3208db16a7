//! Every call is bounded: the end of an iteration in pieces, sessions that start without touching memory, unfinished
//! pixels.

use croupier::unstable::film::{Aov, AovSet};
use croupier::unstable::learn::Learning;
use croupier::unstable::{STACK_BYTES, World};
use croupier::{Budget, Plan, Scene, Session, SessionError, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_tests::runner::{finish, kinds_of_statistics, memory, settings, shown};
use croupier_tests::scenes::*;
use croupier_tests::stats::SplitMix;
use std::cell::Cell;

/// Samples per pixel of each iteration; none is stopped.
const WHOLE: [(u32, Option<u64>); 4] = [(4, None), (8, None), (3, None), (8, None)];

/// Renders iterations, some of which are stopped after so many camera samples of each shard. Their ends are divided by `budget`, of
/// the stage that comes next; `resume` suspends and resumes the session before every piece. What the session shows, and
/// the most pieces of an end.
fn render(
    scene: Scene<'_>,
    s: &Settings,
    iterations: &[(u32, Option<u64>)],
    resume: bool,
    budget: &mut dyn FnMut(&str) -> u64,
) -> (Vec<u8>, u32) {
    let plan = Plan::new(s).unwrap();
    let mut block = memory(plan.session().size, 0xff);
    let mut own: Vec<_> = (0..s.shards).map(|i| memory(plan.shard_of(i).size, 0xff)).collect();
    let mut shards: Vec<_> =
        own.iter_mut().enumerate().map(|(i, b)| Shard::new(&plan, i as u32, b.as_mut()).unwrap()).collect();
    let mut most = 0;
    Session::new(scene, &plan, block.as_mut()).unwrap().suspend();
    for &(samples, stopped) in iterations {
        let mut session = Session::resume(scene, &plan, block.as_mut()).unwrap();
        session.begin_iteration(samples);
        for shard in &mut shards {
            let _ = shard.step(&session, Budget { rays: 0 });
            if let Some(least) = stopped {
                while shard.counters().camera_samples < least {
                    let _ = shard.step(&session, Budget { rays: 1 });
                }
                shard.stop();
            }
            finish(&session, shard, 1000);
        }
        let mut pieces = 0;
        loop {
            let budget = Budget { rays: budget(session.finishing_stage()) };
            pieces += 1;
            if session.finish_iteration(&shards, budget).unwrap() == StepResult::Done {
                break;
            }
            if resume {
                session.suspend();
                session = Session::resume(scene, &plan, block.as_mut()).unwrap();
            }
        }
        most = most.max(pieces);
        assert_eq!(session.finish_iteration(&shards, Budget { rays: 1 }), Err(SessionError::NoIteration));
        session.suspend();
    }
    let session = Session::resume(scene, &plan, block.as_mut()).unwrap();

    (shown(&session), most)
}

/// Killed by: state that lives in a local variable of a piece, a cursor that skips or repeats, a stage without an end, a
/// scalar that is not suspended.
#[test]
fn pieces_of_any_size_give_the_same_bits() {
    let bytes = blob(&cornell([37, 21]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    for s in kinds_of_statistics(&bytes, 3) {
        let (whole, one) = render(scene, &s, &WHOLE, false, &mut |_| u64::MAX);
        assert_eq!(one, 1);
        for (resume, seed) in [(false, 1), (true, 2)] {
            let mut rng = SplitMix(seed);
            let (pieces, most) = render(scene, &s, &WHOLE, resume, &mut |_| rng.bits() % 200);
            assert!(most > 10, "{}: {most} pieces", s.strategy);
            assert!(pieces == whole, "{}, resume {resume}", s.strategy);
        }
        let (pieces, most) = render(scene, &s, &WHOLE, false, &mut |_| 1);
        assert!(most > 30, "{}: {most} pieces", s.strategy);
        assert!(pieces == whole, "{}, the smallest pieces", s.strategy);
    }
}

/// The pixels with most error wait in the session's block between two pieces: in this picture 22 while it is measured, of
/// which all but one are taken out again after an iteration that was stopped when it had sampled fewer. Killed by: a heap
/// that a piece begins anew, sums without what is taken out of it.
#[test]
fn pixels_with_most_error_are_suspended() {
    let bytes = blob(&cornell([151, 140]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    for s in &kinds_of_statistics(&bytes, 1)[1..3] {
        let s = Settings { ring: 16, ..*s };
        let iterations = [(2, None), (2, Some(30))];
        let (whole, _) = render(scene, &s, &iterations, false, &mut |_| u64::MAX);
        let mut rng = SplitMix(3);
        let (pieces, _) = render(scene, &s, &iterations, true, &mut |stage| match stage {
            "measure" | "measure first" => rng.bits() % 16,
            "error" => rng.bits() % 1500,
            _ => 10_000,
        });
        assert!(pieces == whole, "adaptive {}", s.adaptive);
    }
}

/// Killed by: pieces that do not look whether the shards are those of the iteration, a budget of 0 that works.
#[test]
fn shards_are_checked_at_every_piece() {
    let bytes = blob(&cornell([37, 21]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = Settings { shards: 2, ..kinds_of_statistics(&bytes, 3)[1] };
    let plan = Plan::new(&s).unwrap();
    let mut block = memory(plan.session().size, 0);
    let mut own: Vec<_> = (0..s.shards).map(|i| memory(plan.shard_of(i).size, 0)).collect();
    let mut shards: Vec<_> =
        own.iter_mut().enumerate().map(|(i, b)| Shard::new(&plan, i as u32, b.as_mut()).unwrap()).collect();
    let mut session = Session::new(scene, &plan, block.as_mut()).unwrap();
    session.begin_iteration(2);
    shards.iter_mut().for_each(|s| finish(&session, s, 1000));
    let some = Budget { rays: 10 };
    for _ in 0..1000 {
        assert_eq!(session.finish_iteration(&shards, Budget { rays: 0 }), Ok(StepResult::More));
    }
    assert_eq!(session.finish_iteration(&shards, some), Ok(StepResult::More));
    assert_eq!(session.finish_iteration(&shards[..1], some), Err(SessionError::Shards { expected: 1 }));
    assert_eq!(session.finish_iteration(&shards, some), Ok(StepResult::More));
    let mut other = memory(plan.shard_of(1).size, 0);
    shards[1] = Shard::new(&plan, 1, other.as_mut()).unwrap();
    assert_eq!(session.finish_iteration(&shards, some), Err(SessionError::Unfinished { shard: 1 }));
    // the shard can be rendered again: the same sums
    finish(&session, &mut shards[1], 1 << 20);
    while session.finish_iteration(&shards, some).unwrap() == StepResult::More {}
    assert!(session.film().pixels().all(|p| p.samples == 2));
}

/// The end of an iteration looks at each shard a few times, also through iterators that reach an item by those before it,
/// and begins in pieces too. Killed by: a search from the first shard for every piece, counters merged in one piece.
#[test]
fn the_end_is_linear_in_shards() {
    let bytes = blob(&cornell([128, 128]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = Settings { shards: 256, ..settings(&bytes, "classic") };
    let plan = Plan::new(&s).unwrap();
    let mut block = memory(plan.session().size, 0);
    let mut own: Vec<_> = (0..s.shards).map(|i| memory(plan.shard_of(i).size, 0)).collect();
    let mut shards: Vec<_> =
        own.iter_mut().enumerate().map(|(i, b)| Shard::new(&plan, i as u32, b.as_mut()).unwrap()).collect();
    let mut session = Session::new(scene, &plan, block.as_mut()).unwrap();
    session.begin_iteration(1);
    shards.iter_mut().for_each(|s| finish(&session, s, 1000));
    assert_eq!(session.finish_iteration(&shards, Budget { rays: 1 }), Ok(StepResult::More));
    assert_eq!(session.finishing_stage(), "start");
    let items = Cell::new(0);
    let all = shards.iter().inspect(|_| items.set(items.get() + 1));
    assert_eq!(session.finish_iteration(all, Budget { rays: u64::MAX }), Ok(StepResult::Done));
    assert!(items.get() <= 8 * 256, "{} items", items.get());
    assert_eq!(session.counters().camera_samples, 128 * 128);
}

/// Starting a session and shards, beginning an iteration and joining it write to no memory that grows with the picture.
/// Killed by: a slab that is cleared at the start (its bytes are no longer those that the block came with).
#[test]
fn the_start_touches_no_memory_of_pixels() {
    let bytes = blob(&cornell([8, 8]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    for s in kinds_of_statistics(&bytes, 3) {
        let changed = |size: [u32; 2]| {
            let s = Settings { size, shards: 1, ..s };
            let plan = Plan::new(&s).unwrap();
            let (mut block, mut own) = (memory(plan.session().size, 0xa5), memory(plan.shard().size, 0xa5));
            let mut session = Session::new(scene, &plan, block.as_mut()).unwrap();
            let mut shard = Shard::new(&plan, 0, own.as_mut()).unwrap();
            session.begin_iteration(3);
            let _ = shard.step(&session, Budget { rays: 1 });
            session.restart(false);
            session.begin_iteration(3);
            let _ = shard.step(&session, Budget { rays: 1 });
            let count = |b: &AlignedBytes| b.as_ref().iter().filter(|b| **b != 0xa5).count();
            count(&block) + count(&own)
        };
        let (small, large) = (changed([64, 64]), changed([512, 512]));
        assert!(large < small + 20_000, "{}: {small} and {large} bytes written", s.strategy);
    }
}

/// Pixels of an iteration that runs: their samples are those of the finished ones, and at the end the film's. Killed by:
/// sums of an iteration before, pixels that have not begun, means over the samples that were begun.
#[test]
fn pixels_of_an_unfinished_iteration_can_be_read() {
    let bytes = blob(&cornell([37, 21]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = Settings { shards: 2, ..settings(&bytes, "classic") };
    let plan = Plan::new(&s).unwrap();
    let mut block = memory(plan.session().size, 0xff);
    let mut own: Vec<_> = (0..s.shards).map(|i| memory(plan.shard_of(i).size, 0xff)).collect();
    let mut shards: Vec<_> =
        own.iter_mut().enumerate().map(|(i, b)| Shard::new(&plan, i as u32, b.as_mut()).unwrap()).collect();
    let mut session = Session::new(scene, &plan, block.as_mut()).unwrap();
    for round in 0..2 {
        session.begin_iteration(4);
        let mut before = 0;
        for steps in 0..4 {
            let mut samples = 0;
            for shard in &mut shards {
                let _ = shard.step(&session, Budget { rays: 500 });
                shard.for_each_pixel(|film, mean, n| {
                    assert!(film < 37 * 21 && n <= 4 && mean.iter().all(|x| x.is_finite()));
                    samples += u64::from(n);
                });
                samples -= shard.counters().camera_samples;
            }
            assert_eq!(samples, 0, "round {round}, step {steps}");
            let begun: u64 = shards.iter().map(|s| s.counters().camera_samples).sum();
            assert!(begun > before && begun < 4 * 37 * 21);
            before = begun;
        }
        shards.iter_mut().for_each(|s| finish(&session, s, 1 << 20));
        let mut seen = vec![[0.0; 3]; 37 * 21];
        shards.iter().for_each(|s| s.for_each_pixel(|film, mean, _| seen[film] = mean));
        session.end_iteration(&shards).unwrap();
        if round == 0 {
            let film: Vec<_> = session.film().pixels().map(|p| p.mean()).collect();
            assert_eq!(film, seen);
        }
    }
    assert_eq!(session.identity().epoch, 0);
}

/// Threads with the stated stack, which the system rounds up to pages and shares with the thread's own start. Killed by:
/// a packet more on the stack than it holds (the thread is killed, and the test with it).
#[test]
fn steps_need_no_more_stack_than_stated() {
    let bytes = blob(&everything([24, 16]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 300.0, ..Learning::default() };
    let s = settings(&bytes, "ears");
    let s = Settings { aovs: AovSet::STANDARD, adaptive: true, shadow_roulette: true, max_depth: 9, learning, ..s };
    let plan = Plan::new(&s).unwrap();
    let (mut block, mut own) = (memory(plan.session().size, 0), memory(plan.shard_of(0).size, 0));
    let mut session = Session::new(scene, &plan, block.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, own.as_mut()).unwrap();
    for samples in [4, 8, 16] {
        session.begin_iteration(samples);
        std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().stack_size(STACK_BYTES);
            let work = || {
                finish(&session, &mut shard, 1000);
                while session.finish_iteration([&shard], Budget { rays: 500 }).unwrap() == StepResult::More {}
            };
            thread.spawn_scoped(scope, work).unwrap().join().unwrap();
        });
    }
    assert!(session.cache().unwrap().leaves() > 6 && session.film().pixels().all(|p| p.samples > 0));
}

/// Bytes per pixel at 1920x1080, blocks of the session and of all shards, as the documentation of
/// [`Plan::bytes_per_pixel`] and README state them. Killed by: another plane, a slot for pixels that a shard does not
/// have.
#[test]
fn memory_per_pixel_is_as_stated() {
    let bytes = blob(&cornell([8, 8]));
    let per_pixel = |s: Settings| {
        let plan = Plan::new(&s).unwrap();
        let shards: usize = (0..s.shards).map(|i| plan.shard_of(i).size).sum();
        let pixels = f64::from(s.size[0]) * f64::from(s.size[1]);
        let all = (plan.session().size + shards) as f64;
        // what is stated, and what does not grow with the pixels
        let denoised = if s.strategy.needs_image() { 2112.0 * (f64::from(s.size[0]) + 32.0) } else { 0.0 };
        let learned = if s.strategy.needs_image() { s.learning.cache_bytes as f64 } else { 0.0 };
        let fixed = denoised + learned + f64::from(s.shards) * (512.0 * 200.0 + 2048.0 * 68.0);
        let stated = plan.bytes_per_pixel().iter().sum::<f64>() * pixels;
        assert!(all >= stated && all <= stated + fixed + 40_000.0 + 4000.0 * f64::from(s.shards), "{all}, {stated}");
        all / pixels
    };
    let hits = AovSet::of(&[Aov::Albedo, Aov::Normal, Aov::Depth]);
    for shards in [1, 16] {
        let of = |strategy: &str, aovs: AovSet| {
            per_pixel(Settings { size: [1920, 1080], shards, aovs, ..settings(&bytes, strategy) })
        };
        let [classic, ears, all] = [of("classic", AovSet::NONE), of("ears", hits), of("ears", AovSet::STANDARD)];
        // without what a picture of one pixel takes: 24 MiB of statistics, rings and ledgers
        let bytes_of = |size| {
            let plan = Plan::new(&Settings { size, shards, aovs: hits, ..settings(&bytes, "ears") }).unwrap();
            (plan.session().size + (0..shards).map(|i| plan.shard_of(i).size).sum::<usize>()) as f64
        };
        let grows = (bytes_of([1920, 1080]) - bytes_of([1, 1])) / (1920.0 * 1080.0);
        println!(
            "{shards} shards: classic {classic:.1}, ears {ears:.1}, {grows:.1} of them grow with the picture, \
             with standard AOVs {all:.1} bytes"
        );
        assert!(classic < 98.0 && ears < 188.0 && grows < 176.0, "{classic}, {ears} and {grows}");
        // and the set that the program asks for
        assert!(all < 260.0 + 2.2 + 12.2 + 2.0, "{all}");
    }
    for (strategy, aovs, stated) in
        [("classic", AovSet::NONE, 96.0), ("ears", hits, 172.0), ("ears", AovSet::STANDARD, 260.0)]
    {
        let s = Settings { size: [1920, 1080], aovs, ..settings(&bytes, strategy) };
        assert_eq!(Plan::new(&s).unwrap().bytes_per_pixel().iter().sum::<f64>(), stated, "{strategy}");
    }
    // pictures of one row or column cost what their pixels do, besides the fixed part of each shard
    let fixed =
        Plan::new(&Settings { size: [1, 1], shards: 2, ..settings(&bytes, "classic") }).unwrap().shard_of(1).size;
    for size in [[1, 65_536], [65_536, 1]] {
        let plan = Plan::new(&Settings { size, shards: 256, ..settings(&bytes, "classic") }).unwrap();
        let pixels: usize = (0..256).map(|i| plan.shard_of(i).size - fixed).sum();
        assert!(pixels <= 65_536 * 48 + 256 * 64, "{size:?}: {pixels} bytes");
        assert!(plan.shard().size - fixed <= 3 * 48 * 256, "{size:?}: {} bytes", plan.shard().size - fixed);
    }
}
