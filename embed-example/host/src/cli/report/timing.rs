//! CPU time of threads, times of short loops, and work for all processors.

use super::ledger::Spread;
use super::sums::spread;
use cpu_time::ThreadTime;
use std::hint::black_box;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// CPU seconds that the calling thread has used so far; `None` where the platform does not tell.
pub(super) fn cpu_seconds() -> Option<f64> {
    ThreadTime::try_now().ok().map(|t| t.as_duration().as_secs_f64())
}

/// Seconds of `f` on this thread, on the wall where the platform tells no other.
fn seconds(f: impl FnOnce()) -> f64 {
    let (wall, cpu) = (Instant::now(), cpu_seconds());
    f();
    let cpu = cpu.zip(cpu_seconds()).map(|(a, b)| b - a).filter(|s| *s > 0.0);
    cpu.unwrap_or_else(|| wall.elapsed().as_secs_f64())
}

/// Nanoseconds of one call of `f` with each of the arguments, which lie in the nearest cache.
pub(super) fn nanoseconds<T: Copy, R>(arguments: &[T], repeats: usize, mut f: impl FnMut(T) -> R) -> Spread {
    let mut pass = || {
        for x in arguments {
            black_box(f(black_box(*x)));
        }
    };
    // as many passes as take a fifth of a millisecond
    let once = seconds(&mut pass).max(1e-9);
    let passes = ((2e-4 / once).ceil() as usize).clamp(1, 10_000);
    let mut time = |_| seconds(|| (0..passes).for_each(|_| pass())) * 1e9 / (passes * arguments.len().max(1)) as f64;
    spread(&(0..repeats).map(&mut time).collect::<Vec<_>>())
}

/// Results of all jobs in their order; every processor takes the next one that is left. `done` gets the number of those
/// that are finished.
pub(super) fn in_parallel<J: Sync, R: Send>(
    jobs: &[J],
    f: impl Fn(&J) -> R + Sync,
    done: impl Fn(usize) + Sync,
) -> Vec<R> {
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results = Mutex::new(Vec::new());
    let work = || {
        while let Some((i, job)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, jobs.get(i)?))) {
            let result = f(job);
            results.lock().expect("no other thread panics while it pushes").push((i, result));
            done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    std::thread::scope(|scope| (0..threads()).for_each(|_| drop(scope.spawn(work))));
    let mut results = results.into_inner().expect("no thread panics while it pushes");
    results.sort_by_key(|r: &(usize, R)| r.0);
    results.into_iter().map(|r| r.1).collect()
}

/// Processors.
pub(super) fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
