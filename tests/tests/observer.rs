//! What an observer of a render is shown, and that its time does not count as rendering.

use croupier::{Film, Scene, Settings};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_host::drive::{Observer, Options, Progress, Target, Unobserved, drive};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Records what each iteration shows, and pauses.
#[derive(Default)]
struct Slow {
    seen: Mutex<Vec<(u64, f64, f64)>>,
    pause: Duration,
}

impl Observer for Slow {
    fn progress(&self, _: &Progress) {}

    fn stop(&self) -> bool {
        false
    }

    fn iteration(&self, film: &Film<'_>, seconds: f64) {
        let sum = film.pixels().map(|p| p.mean()[0]).sum();
        self.seen.lock().unwrap().push((film.pixel(0).samples, sum, seconds));
        std::thread::sleep(self.pause);
    }
}

/// The built-in scene in 8 x 8 pixels and three shards.
fn small() -> (AlignedBytes, Settings) {
    let scene = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| ()).unwrap().bytes;
    let settings = Settings { size: [8, 8], shards: 3, ..Settings::for_scene(&Scene::from_bytes(&scene).unwrap()) };
    (scene, settings)
}

/// Clock of its own that counts ten seconds per iteration.
#[derive(Default)]
struct OwnClock(Mutex<f64>);

impl Observer for OwnClock {
    fn progress(&self, _: &Progress) {}

    fn stop(&self) -> bool {
        false
    }

    fn iteration(&self, _: &Film<'_>, _: f64) {
        *self.0.lock().unwrap() += 10.0;
    }

    fn seconds(&self) -> Option<f64> {
        Some(*self.0.lock().unwrap())
    }
}

/// Targets in seconds are those of the observer's clock. Killed by: a clock that is not asked.
#[test]
fn observers_may_have_their_own_clock() {
    let (scene, settings) = small();
    let options = Options { threads: 1, ..Options::new(settings, Target::Seconds(35.0)) };
    let rendered = drive(&scene, &options, &OwnClock::default()).unwrap();
    assert_eq!((rendered.iterations.len(), rendered.spp), (3, 3), "a fourth sample at 10 seconds each would pass it");
}

/// However short a render is, its first sample is shown. Killed by: no iteration where there is no time for one, a first
/// iteration of more than a sample.
#[test]
fn the_first_sample_is_shown() {
    let (scene, settings) = small();
    for (strategy, target) in
        [("ears", Target::Seconds(1e-9)), ("classic", Target::Seconds(1e-9)), ("ears", Target::Rays(1))]
    {
        let mut settings = settings;
        settings.set("rrs", strategy).unwrap();
        let observer = Slow::default();
        let rendered = drive(&scene, &Options { threads: 1, ..Options::new(settings, target) }, &observer).unwrap();
        let seen = observer.seen.into_inner().unwrap();
        assert_eq!(seen.iter().map(|s| s.0).collect::<Vec<_>>(), [1], "{strategy}, {target:?}");
        assert!(rendered.spp == 1 && seen[0].1 > 0.0);
    }
}

/// Killed by: showing the film before its shards are merged, counting the observer's time, leaving out the last
/// iteration.
#[test]
fn iterations_are_shown_outside_the_clock() {
    let (scene, settings) = small();
    let options = Options { threads: 1, ..Options::new(settings, Target::Spp(9)) };
    let observer = Slow { pause: Duration::from_millis(300), ..Slow::default() };
    let start = Instant::now();
    let rendered = drive(&scene, &options, &observer).unwrap();
    let elapsed = start.elapsed();

    let seen = observer.seen.into_inner().unwrap();
    assert_eq!(seen.iter().map(|s| s.0).collect::<Vec<_>>(), [1, 2, 4, 8, 9]);
    assert_eq!(seen[4].1, rendered.pixels.iter().map(|p| p.mean()[0]).sum::<f64>());
    assert!(seen.windows(2).all(|w| w[0].2 <= w[1].2) && seen[4].2 <= rendered.seconds, "{seen:?}");
    assert!(rendered.seconds + 5.0 * observer.pause.as_secs_f64() <= elapsed.as_secs_f64(), "{}", rendered.seconds);
    assert_eq!(rendered.hash(), drive(&scene, &options, &Unobserved).unwrap().hash());
}
