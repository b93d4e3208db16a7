//! Decisions from sums of samples that have the gain they are made with.

use super::*;

/// Of samples whose moments are 0 or twice the mean, by turns, 1 without the guide and `with` with it.
fn promise(samples: u32, with: f32) -> Promise {
    let mut p = Promise::default();
    (0..samples).for_each(|i| p.add((i % 2) as f32 * 2.0, (i % 2) as f32 * 2.0 * with));
    p
}

fn decided(start: Watch, p: &Promise) -> Watch {
    decided_of(Some(1.0), start, p)
}

/// In a picture whose variance is so much of that of independent samples.
fn decided_of(independence: Option<f64>, start: Watch, p: &Promise) -> Watch {
    let mut watch = start;
    watch.add(p);
    watch.decide(0.75, true, independence);
    watch
}

/// Killed by: a gain that pays no heed to what Sobol' points gain, pictures of which nothing is known that count as of
/// independent samples, factors above 1.
#[test]
fn what_sobol_points_gain_counts_against_the_guide() {
    for (gain, independence, enabled) in [
        (1.5, Some(1.0), true),
        (1.5, Some(0.6), false),
        (2.5, Some(0.6), true),
        (1.3, None, false),
        (1.5, None, true),
        (0.9, Some(1.5), false),
    ] {
        for start in [Watch::default(), decided(Watch::default(), &promise(100, 0.1))] {
            let watch = decided_of(independence, start, &promise(4000, 1.0 / gain));
            assert_eq!(watch.enabled(), enabled, "{gain} {independence:?}");
        }
    }
}

/// Killed by: a factor of guided samples that counts like one of others, one of samples before that counts like theirs, one
/// that nobody knows.
#[test]
fn what_sobol_points_gain_with_a_guide_counts_twice() {
    let again = |start: Watch, independence| {
        decided_of(independence, Watch { promise: Promise::default(), ..start }, &promise(4000, 1.0 / 1.6))
    };
    let enabled = decided(Watch::default(), &promise(4000, 0.5));
    for (independence, stays) in [(Some(0.95), true), (Some(0.8), false), (None, true)] {
        let first = again(enabled, independence);
        assert_eq!((first.enabled(), again(first, independence).enabled()), (true, stays), "{independence:?}");
    }
}

/// Samples that would have less error than nothing without the guide, as few may. Killed by: no gain in place of a bad one.
#[test]
fn a_guide_that_does_great_harm_is_disabled() {
    let enabled = decided(Watch::default(), &promise(4000, 0.5));
    let mut harm = promise(40_000, 1.0);
    (0..40_000).for_each(|_| harm.add(-2.0, 1.0));
    assert!(harm.is_sound() && harm.gain().is_some_and(|g| g.gain == 0.0 && g.error > 0.0));
    let watch = decided(enabled, &harm);
    assert!(!watch.enabled() && watch.promise.is_sound(), "{watch:?}");
}

/// Sums that a forged shard may have: those of many shards stay finite, and a ratio that is none decides nothing.
/// Killed by: finite sums of any size, squares that are not bounded, sums that are not numbers, infinite gains.
#[test]
fn forged_sums_are_refused_or_finite() {
    let samples = 1000.0;
    let largest = Promise { samples, without: 3e41, with: 3e41, squares: [1e80, 1e80, -1e80] };
    assert!(largest.is_sound() && promise(1000, 2.0).is_sound() && Promise::default().is_sound());
    let mut brightest = Promise::default();
    (0..10).for_each(|_| brightest.add(-f32::MAX, f32::MAX));
    assert!(brightest.is_sound(), "{brightest:?}");
    for forged in [
        Promise { samples: 1e300, ..largest },
        Promise { samples: -1.0, ..Promise::default() },
        Promise { samples: f64::NAN, ..Promise::default() },
        Promise { without: -1e42, ..largest },
        Promise { with: 1e42, ..largest },
        Promise { with: -1.0, ..largest },
        Promise { without: f64::NAN, ..largest },
        Promise { squares: [1e81, 0.0, 0.0], ..largest },
        Promise { squares: [0.0, 1e81, 0.0], ..largest },
        Promise { squares: [0.0, 0.0, -1e81], ..largest },
        Promise { squares: [0.0, f64::NAN, 0.0], ..largest },
    ] {
        assert!(!forged.is_sound(), "{forged:?}");
    }
    let mut watch = Watch::default();
    let most = Promise { samples: MOST_SAMPLES, without: 3e54, with: 3e54, squares: [1e92; 3] };
    assert!(most.is_sound());
    (0..4096).for_each(|_| watch.add(&most));
    watch.decide(1.0, true, Some(1.0));
    assert!(watch.gain().is_some_and(|g| g.gain == 1.0 && g.error >= 0.0), "{watch:?}");
    // an infinite gain, and a finite one whose variance is not a number
    for with in [1e-320, 1e-250] {
        let tiny = Promise { with, squares: [1e80; 3], ..largest };
        assert!(tiny.is_sound() && tiny.gain().is_none(), "{with}: {:?}", tiny.gain());
        let known = decided(Watch::default(), &tiny);
        assert!(!known.enabled(), "{known:?}");
    }
}

/// A gain of single samples enables the guide for an iteration, and is in doubt then. Killed by: as few standard errors when
/// all pixels are guided, a guide that has all iterations of before to show a gain again.
#[test]
fn gains_of_few_samples_do_not_last() {
    // 2 with a standard error of a half
    let mut lucky = promise(4000, 1.0);
    lucky.add(lucky.with as f32, 0.0);
    let enabled = decided(Watch::default(), &lucky);
    assert!(enabled.enabled(), "{:?}", lucky.gain());
    let again = decided(Watch { promise: Promise::default(), ..enabled }, &lucky);
    assert!(!again.enabled() && again.doubts == IN_DOUBT, "{again:?}");
    // a guide that knows little goes on
    let mut early = Watch { promise: Promise::default(), ..enabled };
    early.add(&lucky);
    early.decide(0.75, false, Some(1.0));
    assert!(!early.enabled() && early.doubts == 1, "{early:?}");
}

/// Killed by: a gain in doubt as soon as a clear one would be, though more samples would tell, one that never is.
#[test]
fn gains_that_are_unclear_are_in_doubt_later() {
    // 1.2 with a standard error of an eighth
    let unclear = |n: u32| {
        let mut p = promise(n, 1.0);
        p.add(p.with as f32 * 0.4, p.with as f32 * 0.2);
        p
    };
    let (mut watch, mut iterations) = (Watch::default(), 0);
    while watch.doubts < IN_DOUBT && iterations < 20 {
        watch = Watch { promise: Promise::default(), ..watch };
        watch = decided_of(Some(1.0), watch, &unclear(400));
        assert!(!watch.enabled(), "{:?}", unclear(400).gain());
        iterations += 1;
    }
    assert_eq!(iterations, 6);
}

/// A guide that knows little, of which many samples show no gain, is in doubt, but may still learn from all. Killed by: one
/// that is tried as long as one of which little is known, or rejected.
#[test]
fn no_gain_that_is_clear_is_in_doubt_early() {
    let watch = |iterations, with| after(iterations, with, false);
    assert_eq!([2, 3].map(|n| watch(n, 1.0).doubts), [2, IN_DOUBT]);
    assert_eq!([4, 11, 12].map(|n| watch(n, 0.87).doubts), [4, 11, IN_DOUBT], "a gain that does not suffice");
    assert!(watch(3, 1.0).all_teach(TrialShares::of([64, 64])));
    // 1, with a standard error of a half
    let mut unclear = promise(400, 2.0);
    unclear.add(unclear.with as f32 * 0.5, 0.0);
    let mut watch = Watch::default();
    for _ in 0..11 {
        watch = Watch { promise: unclear, ..watch };
        watch.decide(0.75, false, Some(1.0));
        assert!(watch.doubts < IN_DOUBT, "{watch:?}");
    }
}

/// Killed by: a gain that is ruled out before anything is known.
#[test]
fn a_guide_that_knows_little_is_not_rejected() {
    let mut watch = Watch::default();
    for (enough, open) in [(false, true), (true, false), (true, false), (false, true)] {
        watch.add(&promise(100_000, 2.0));
        watch.decide(0.75, enough, Some(1.0));
        assert_eq!((watch.enabled(), watch.all_teach(TrialShares::of([64, 64]))), (false, open));
    }
}

/// Killed by: a gain upside down, a decision from too few samples, one that pays no heed to the standard error.
#[test]
fn the_guide_is_enabled_where_it_pays() {
    let fresh = Watch::default();
    assert!(!fresh.enabled() && fresh.gain().is_none());
    assert!(decided(fresh, &promise(4000, 0.5)).enabled());
    assert!(!decided(fresh, &promise(4000, 0.95)).enabled(), "less than it costs");
    assert!(!decided(fresh, &promise(4000, 2.0)).enabled());
    assert!(!decided(fresh, &promise(100, 0.1)).enabled(), "too few samples");
    // one sample that would have been large, and one of three times all others together
    for (without, enabled) in [(400.0, false), (12_000.0, true)] {
        let mut rare = promise(4000, 1.0);
        rare.add(without, 1.0);
        assert_eq!(decided(fresh, &rare).enabled(), enabled, "{:?}", rare.gain());
    }
}

/// The standard error is that of the ratio: what is in both sums is not noise of it. Killed by: an error of the one
/// sum or of the other.
#[test]
fn what_both_have_is_no_noise() {
    let gain = promise(4000, 0.5).gain();
    assert!(gain.is_some_and(|g| (g.gain - 2.0).abs() < 1e-9 && g.error < 1e-6), "{gain:?}");
    let mut apart = promise(4000, 0.5);
    (0..4000).for_each(|i| apart.add((i % 2) as f32, 0.5 - (i % 2) as f32 * 0.5));
    let error = apart.gain().map_or(0.0, |g| g.error);
    assert!((0.01..0.05).contains(&error), "{error}");
}

/// Killed by: a guide that stays enabled, one that flickers, shares of pixels that are not those asked for.
#[test]
fn it_stays_enabled_while_it_pays() {
    let enabled = decided(Watch::default(), &promise(4000, 0.5));
    assert!(decided(enabled, &promise(40_000, 1.0 / 1.22)).enabled());
    assert!(!decided(enabled, &promise(400_000, 2.0)).enabled());
    let rejected = decided(Watch::default(), &promise(100_000, 2.0));
    let open = decided(Watch::default(), &Promise::default());
    for size in [[128, 128], [320, 200], [1024, 1024]] {
        let shares = TrialShares::of(size);
        let [undecided, unpromising] = shares.shares.map(|x| f64::from(x) / 65_536.0);
        for (watch, share) in [(enabled, 1.0), (rejected, unpromising), (open, undecided)] {
            let tried = (0..1u32 << 20).filter(|i| watch.is_guided(7, [i % 1024, i / 1024], shares)).count();
            let tried = tried as f64 / f64::from(1 << 20);
            // four standard deviations of a share of 16,384 blocks
            let variance = share * (1.0 - share) / 16_384.0;
            assert!((tried - share).powi(2) <= 16.0 * variance, "{tried}, not {share}");
        }
    }
}

/// What is known after so many iterations, in each of which the guide has this promise.
fn after(iterations: u32, with: f32, enough: bool) -> Watch {
    let mut watch = Watch::default();
    for _ in 0..iterations {
        watch.add(&promise(100_000, with));
        watch.decide(0.75, enough, Some(1.0));
    }
    watch
}

/// All samples of a small picture teach the guide unless a gain is found or out of the question. Killed by: samples of
/// larger pictures that teach, some that do when all are guided, shares of guided samples that do not know of them.
#[test]
fn all_samples_of_small_pictures_teach_while_a_gain_is_open() {
    let (small, large) = (TrialShares::of([256, 256]), TrialShares::of([512, 256]));
    for (watch, teach) in [
        (Watch::default(), true),
        (after(3, 0.87, true), true),
        (after(1000, 0.87, false), true),
        (after(3, 2.0, false), true),
        (after(1, 2.0, true), false),
        (after(1, 0.5, true), false),
    ] {
        assert_eq!((watch.all_teach(small), watch.all_teach(large)), (teach, false), "{watch:?}");
    }
    let mut again = after(3, 2.0, true);
    again.add(&promise(100_000, 2.0));
    again.decide(0.75, false, Some(1.0));
    assert!(again.all_teach(small), "a gain that was out of the question is in doubt");
    // one pixel in 32 is guided; 32 of its samples are learned from, and 8 of each other pixel
    let part = after(3, 0.87, true).guided_part(small, [32, 8]);
    assert!((part - 4.0 / (4.0 + 31.0)).abs() < 1e-6, "{part}");
    assert_eq!(after(1, 2.0, true).guided_part(small, [32, 8]), 1.0);
    assert_eq!(Watch::default().guided_part(large, [32, 8]), 1.0);
}

/// In doubt, and when a gain is out of the question, each shard trains in one of sixteen iterations, or of as many as
/// there are shards, and as many do in each iteration. Killed by: turns while it is open whether a guide pays, when it
/// does, or before it knows anything; shards that never have a turn, or all at once; a guide that is never tried again.
#[test]
fn shards_take_turns_once_a_gain_is_in_doubt() {
    let open = [Watch::default(), after(2, 0.87, true), after(9, 0.5, true), after(11, 0.87, false)];
    let all = |watch: &Watch| (0..16).all(|shard| watch.trains([shard, 16]));
    assert_eq!(open.each_ref().map(all), [true; 4], "{open:?}");
    let mut unknown = Watch::default();
    (0..11).for_each(|_| unknown.decide(0.75, false, Some(1.0)));
    assert!(all(&unknown), "no sample that tells of a gain");
    unknown.decide(0.75, false, Some(1.0));
    // with turns contributions are discounted faster than new ones come
    let mut less = after(3, 0.87, true);
    less.add(&promise(100_000, 0.87));
    less.decide(0.75, false, Some(1.0));
    for start in [after(3, 0.87, true), after(12, 0.87, false), after(1, 2.0, true), less, unknown] {
        for (shards, turns) in [(1, 1), (2, 2), (5, 5), (16, 16), (32, 16), (64, 16)] {
            let trains = |turn, shard| Watch { turn, ..start }.trains([shard, shards]);
            for shard in 0..shards {
                let times = (5..5 + u64::from(turns)).filter(|&turn| trains(turn, shard)).count();
                assert_eq!(times, 1, "shard {shard} of {shards}");
            }
            for turn in 5..25 {
                let trained = (0..shards).filter(|&shard| trains(turn, shard)).count();
                assert_eq!(trained as u32, shards / turns, "turn {turn} of {shards} shards");
            }
            assert!((0..shards).any(|shard| trains(u64::MAX, shard)), "no overflow");
        }
        let mut next = start;
        next.decide(0.75, true, Some(1.0));
        assert!(next.turn == start.turn + 1 && !all(&next), "{next:?}");
    }
}

/// In doubt a gain must be clearer to enable the guide. Killed by: the bound of before.
#[test]
fn gains_in_doubt_must_be_clear() {
    // a gain of 1.4 with an error of 0.09, which one sample makes, nine tenths of which are left
    let mut unclear = promise(400, 1.0 / 1.26);
    unclear.add(unclear.with as f32 * 0.13, 0.0);
    let gain = unclear.gain();
    assert!(gain.is_some_and(|g| (1.38..1.42).contains(&g.gain) && (0.07..0.1).contains(&g.error)), "{gain:?}");
    assert!(decided_of(Some(0.9), Watch::default(), &unclear).enabled());
    let doubted = Watch { promise: Promise::default(), ..after(3, 0.87, true) };
    assert!(!decided_of(Some(0.9), doubted, &unclear).enabled());
    assert!(decided(doubted, &promise(4000, 0.5)).enabled(), "one that is clear");
}

/// Killed by: a bound that does not hold, pixels of the two exchanged, a product that overflows.
#[test]
fn as_many_pixels_are_tried_in_pictures_of_most_sizes() {
    let pixels =
        |size: [u32; 2]| TrialShares::of(size).shares.map(|x| u64::from(x) * u64::from(size[0] * size[1]) / 65_536);
    assert_eq!(pixels([512, 256]), [4096, 1024]);
    assert_eq!(pixels([256, 256]), [2048, 1024], "all pixels teach the guide");
    assert_eq!(pixels([64, 64]), [2048, 128], "no more than a half, a thirty-second");
    assert_eq!(pixels([2048, 1024]), [8192, 8192], "no less than one in 256");
    // one pixel in 32, of which four times as many samples are learned from
    let part = |learned| Watch::default().guided_part(TrialShares::of([256, 256]), learned);
    assert_eq!([part([32, 8]), part([1, 1]), part([0, 0])], [1.0 / 8.75, 1.0 / 32.0, 0.0]);
    for size in [[0, 0], [1, 1], [u32::MAX; 2]] {
        assert!(TrialShares::of(size).shares.iter().all(|x| (256..=32_768).contains(x)), "{size:?}");
    }
}
