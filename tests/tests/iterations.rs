//! How the driver divides a render into iterations.

use croupier::unstable::schedule::{LARGEST_ITERATION, Work, next_iteration};
use croupier::{Budget, ErrorEstimate, Film, Plan, Scene, Session, Settings, Shard, StepResult, Strategy};
use croupier_host::blob::AlignedBytes;
use croupier_host::drive::{Observer, Options, Progress, Rendered, Target, Unobserved, drive};
use croupier_tests::scenes::{blob, everything};
use std::time::Duration;

fn work(samples: u32, rays: u64, seconds: f64) -> Work {
    Work { samples, rays, seconds }
}

const TARGETS: [Target; 4] = [Target::Spp(1000), Target::Seconds(1e6), Target::Rays(1 << 50), Target::Error(1e-9)];

fn bad_error() -> Option<ErrorEstimate> {
    Some(ErrorEstimate {
        rel_mse: 1.0,
        low: 0.9,
        high: 1.1,
        rel_mse_all: 1.0,
        independence: 1.0,
        effective_pixels: 1000.0,
        ..ErrorEstimate::default()
    })
}

/// Killed by: planning by the mean cost of all samples, by samples alone, growth beyond doubling, no iteration at all
/// when a sample costs more than everything before.
#[test]
fn growth_is_in_work_for_strategies_that_learn() {
    let all = work(16, 1600, 1.6);
    for (last, samples) in [
        (work(8, 800, 0.8), 16),     // as before
        (work(8, 8 * 2000, 0.8), 1), // twenty times as expensive
        (work(8, 8 * 25, 0.8), 64),  // a quarter
        (work(8, 8 * 390, 0.8), 4),  // to the nearest
        (work(8, 8 * 100_000, 0.8), 1),
        (work(8, 8, 0.8), LARGEST_ITERATION),
    ] {
        for target in TARGETS {
            assert_eq!(next_iteration(target, true, &all, &last, bad_error()), samples, "{target:?} {last:?}");
            assert_eq!(next_iteration(target, false, &all, &last, bad_error()), 16, "{target:?} {last:?}");
        }
    }
    for target in TARGETS {
        assert_eq!(next_iteration(target, true, &Work::default(), &Work::default(), None), 1);
        // figures that make no sense are harmless
        for odd in [work(1, 0, 0.0), work(u32::MAX, u64::MAX, f64::INFINITY), work(3, 1, f64::NAN)] {
            assert!(next_iteration(target, true, &odd, &odd, bad_error()) <= LARGEST_ITERATION);
        }
    }
}

/// Killed by: iterations that pass what is left, by seconds or rays of the mean where the last counts, a target in
/// samples that is passed or looks at the clock.
#[test]
fn no_iteration_is_longer_than_what_is_left() {
    let (all, last) = (work(40, 4000, 10.0), work(10, 2000, 4.0));
    for learns in [false, true] {
        let [rays, seconds] = if learns { [200.0, 0.4] } else { [100.0, 0.25] };
        for left in [0.0f64, 0.5, 1.0, 3.5, 7.0] {
            let n = next_iteration(Target::Rays(4000 + (left * rays) as u64), learns, &all, &last, None);
            assert_eq!(f64::from(n), left.floor(), "{learns} {left}");
            let n = next_iteration(Target::Seconds(10.0 + left * seconds + 1e-9), learns, &all, &last, None);
            assert_eq!(f64::from(n), left.floor(), "{learns} {left}");
        }
        for left in [0, 1, 7] {
            assert_eq!(next_iteration(Target::Spp(40 + left), learns, &all, &last, None), left);
        }
        let slow = [all, last].map(|w| Work { seconds: 1e9 * w.seconds, ..w });
        let spp = |w: &[Work; 2]| next_iteration(Target::Spp(500), learns, &w[0], &w[1], None);
        assert_eq!(spp(&slow), spp(&[all, last]));
        assert_eq!(next_iteration(Target::Seconds(1.0), learns, &all, &last, None), 0);
    }
    // 4000 rays at an error of 0.03 and a target of 0.02: 2000 more, at 200 each
    let error = Some(ErrorEstimate { rel_mse: 0.03, ..ErrorEstimate::default() });
    assert_eq!(next_iteration(Target::Error(0.02), true, &all, &last, error), 10);
    assert_eq!(next_iteration(Target::Error(0.03), true, &all, &last, error), 0);
    assert_eq!(next_iteration(Target::Error(0.5), true, &work(3, 10, 1.0), &work(1, 5, 1.0), error), 1);
}

fn render(strategy: &str, target: Target, threads: usize, observer: &dyn Observer) -> Rendered {
    let scene = blob(&everything([24, 16]));
    let base = Settings::for_scene(&Scene::from_bytes(&scene).unwrap());
    let strategy = Strategy::parse(strategy).unwrap();
    let settings = Settings { strategy, shards: 3, max_depth: 8, ..base };
    drive(&scene, &Options { threads, ..Options::new(settings, target) }, observer).unwrap()
}

struct Slow;

impl Observer for Slow {
    fn progress(&self, _: &Progress) {
        std::thread::sleep(Duration::from_millis(3));
    }

    fn stop(&self) -> bool {
        false
    }

    fn iteration(&self, _: &Film<'_>, _: f64) {}
}

/// Killed by: a plan that looks at the clock or at threads, records that miss an iteration or count twice.
#[test]
fn with_a_target_in_samples_the_picture_is_a_pure_function() {
    for strategy in ["ears", "bolin-meyer", "classic"] {
        let quick = render(strategy, Target::Spp(90), 1, &Unobserved);
        let slow = render(strategy, Target::Spp(90), 2, &Slow);
        let plan = |r: &Rendered| r.iterations.iter().map(|i| (i.work.samples, i.work.rays)).collect::<Vec<_>>();
        assert_eq!(plan(&quick), plan(&slow), "{strategy}");
        assert_eq!(quick.hash(), slow.hash(), "{strategy}");
        let plan = plan(&quick);
        assert!(plan.len() >= 6 && plan.iter().map(|i| i.0).sum::<u32>() == 90, "{plan:?}");
        assert_eq!(plan.iter().map(|i| i.1).sum::<u64>(), quick.counters.rays());
        if strategy == "classic" {
            assert_eq!(plan.iter().map(|i| i.0).collect::<Vec<_>>(), [1, 1, 2, 4, 8, 16, 32, 26]);
        }
    }
}

/// Killed by: a driver that hands the plan other figures than those of the last iteration.
#[test]
fn iterations_of_a_render_follow_the_plan() {
    let r = render("ears", Target::Rays(2_000_000), 2, &Unobserved);
    let (mut all, mut last) = (Work::default(), Work::default());
    for i in &r.iterations {
        let planned = next_iteration(Target::Rays(2_000_000), true, &all, &last, Some(i.error));
        assert_eq!(i.work.samples, planned, "after {all:?} {last:?}");
        last = i.work;
        all = work(all.samples + last.samples, all.rays + last.rays, 0.0);
    }
    assert_eq!(next_iteration(Target::Rays(2_000_000), true, &all, &last, None), 0);
    assert!(r.iterations.len() > 6 && all.rays > 1_500_000, "{all:?}");
    let parts = |f: fn(&croupier_host::drive::IterationRecord) -> f64| r.iterations.iter().map(f).sum::<f64>();
    let sum = parts(|i| i.tracing + i.merging + i.estimating + i.learning);
    assert!(sum <= parts(|i| i.work.seconds) && parts(|i| i.work.seconds) <= r.seconds);
    assert!(parts(|i| i.tracing) > 0.5 * r.seconds && parts(|i| i.estimating) > 0.0 && parts(|i| i.learning) > 0.0);
}

/// A host's own loop around a session, with a clock that counts so many seconds per ray: the work of each iteration.
fn own_loop(strategy: &str, target: Target, seconds_per_ray: f64) -> Vec<Work> {
    let bytes = blob(&everything([24, 16]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let strategy = Strategy::parse(strategy).unwrap();
    let plan = Plan::new(&Settings { strategy, shards: 3, max_depth: 8, ..Settings::for_scene(&scene) }).unwrap();
    let mut block = AlignedBytes::zeroed(plan.session().size);
    let mut own = [(); 3].map(|()| AlignedBytes::zeroed(plan.shard().size));
    let mut session = Session::new(scene, &plan, block.as_mut()).unwrap();
    let mut shards: Vec<_> = (0..).zip(&mut own).map(|(i, b)| Shard::new(&plan, i, b.as_mut()).unwrap()).collect();
    let (mut all, mut done) = (Work::default(), Vec::new());
    loop {
        let last = done.last().copied().unwrap_or_default();
        let samples = session.samples_of_next(target, &all, &last);
        let error = (all.samples > 0).then(|| session.film().error_estimate());
        assert_eq!(samples, next_iteration(target, plan.settings().learns(), &all, &last, error));
        if samples == 0 {
            return done;
        }
        session.begin_iteration(samples);
        for shard in &mut shards {
            while shard.step(&session, Budget { rays: 10_000 }) == StepResult::More {}
        }
        session.end_iteration(&shards).unwrap();
        let rays = session.counters().rays() - all.rays;
        done.push(work(samples, rays, rays as f64 * seconds_per_ray));
        all = work(all.samples + samples, all.rays + rays, all.seconds + rays as f64 * seconds_per_ray);
    }
}

/// Hosts without a clock inside plan as the driver does: samples and rays are the same, and what they measured is spent
/// to the last few per cent. Killed by: a plan of the session that forgets the error or that statistics are learned, work
/// of all iterations taken for that of the last.
#[test]
fn hosts_with_a_clock_of_their_own_meet_their_targets() {
    for strategy in ["ears", "classic"] {
        for target in [Target::Spp(90), Target::Rays(300_000), Target::Error(0.01)] {
            let plan: Vec<_> = own_loop(strategy, target, 0.0).iter().map(|w| (w.samples, w.rays)).collect();
            let driven = render(strategy, target, 1, &Unobserved).iterations;
            assert_eq!(plan, driven.iter().map(|i| (i.work.samples, i.work.rays)).collect::<Vec<_>>(), "{target:?}");
            assert!(plan.len() > 4, "{plan:?}");
        }
        for seconds in [0.02, 0.4, 3.0] {
            let done = own_loop(strategy, Target::Seconds(seconds), 1e-6);
            let spent: f64 = done.iter().map(|w| w.seconds).sum();
            let a_sample = done.last().map(|w| w.seconds / f64::from(w.samples)).unwrap();
            assert!(spent <= 1.02 * seconds, "{strategy}: {spent} of {seconds} seconds");
            assert!(spent > 0.98 * seconds - 1.5 * a_sample, "{strategy}: {spent} of {seconds} seconds");
            assert_eq!(done[0].samples, 1, "the first picture is there as soon as it can be");
        }
        // no second is too few for the first sample, and none is long enough for another
        let done = own_loop(strategy, Target::Seconds(1e-9), 1e-6);
        assert_eq!(done.iter().map(|w| w.samples).collect::<Vec<_>>(), [1]);
    }
}
