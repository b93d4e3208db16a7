//! How the driver divides a render into iterations.

use croupier::unstable::schedule::{LARGEST_ITERATION, Work, next_iteration};
use croupier::{ErrorEstimate, Film, Scene, Settings, Strategy};
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
