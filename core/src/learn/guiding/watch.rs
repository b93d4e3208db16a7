//! Is path guiding worth its cost? Predicted from camera samples of guided pixels. With p the density of the BSDF at a bounce,
//! m that of the mixture that was sampled, X what the bounce gave and Z what its light sample gave, the second moment of a
//! sample of a vertex with the guide, and what it would be without it, on average, are
//!
//! ```text
//! T^2 = (Z + X)^2
//! N   = Z'^2 + 2 Z' X' + m / p (X'^2 + sum of N_i - T_i^2)
//! ```
//!
//! because E_p[(f / p)^2] = E_m[(f / m)^2 m / p] for what the BSDF f brings, and E_p[f / p] = E_m[f / m]. The sum is over the
//! samples of the vertex that the bounce led to, times what they count, squared: all vertices of a path are without the guide
//! together, so that a gain at each of many bounces is a large one of the path. Z' and X' are weighted against each other as
//! without the guide (`tracer/guide_notes.rs`). A camera sample T of a pixel that is expected to be I has the squared error
//! (T - I)^2 with the guide and (T - I)^2 + N - T^2 without it, each times the error weight of its pixel. The gain is the sum
//! of the latter over that of the former. Both are of the same samples, so what is rare and large is in both, and their ratio
//! is known much better than either: errors of guided samples and of others would need far more. Samples that are not guided
//! are not asked for the gain: they would not find what a guide would.
//!
//! It is that of independent samples, at equal numbers of samples as roulette and splitting are now. Some of what Sobol'
//! points gain is lost ([`crate::sampler`]), so the gain must be larger the more that is.
//!
//! The guide is disabled while no gain is proven: then the pixels of some blocks are guided, others in each iteration. In
//! small pictures all others teach it too, so that it finds the sooner what it can gain, unless a gain is out of the
//! question. Once a few iterations have shown none, one shard in [`TURNS`] goes on so, another one in each iteration; the
//! rest run kernels without guiding and cost what they cost without a guide. It is enabled while the gain lasts.
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing)]

use crate::film::SqrtNewton;
use crate::rng::mix;
use bytemuck::{Pod, Zeroable};

/// Gain times the variance of the picture over that of independent samples, less some of its standard error ([`DOUBT`]),
/// from which on the guide is enabled. The factor is more than what Sobol' points lose by it, as some of them go on: in
/// `veach_mis`, whose factor is a half, 1.03 times, in `cbox`, where it is 0.6, 1.16 times. And pictures gain less than is
/// predicted, because roulette and splitting would be others without the guide, and guided samples take more time
/// (benches/EFFICIENCY.md; the benchmark `guiding` shows errors and seconds).
const ENABLED_ABOVE: f64 = 1.08;
/// Standard errors that the gain must lie above a bound, at first, and once it was in doubt or all pixels are guided. A ratio
/// of which few samples, those that found rare light, make the most has a standard error of the same size, and is most likely
/// too small; one that turns out to be too large soon disables the guide again. Later iterations are longer, and few samples
/// tell of the gain in each, so that one that is too large costs more. When all pixels are guided many samples tell of it: a
/// gain that has still such an error is that of a few long paths whose ratios of densities are huge.
const DOUBT: [f64; 2] = [0.25, 1.0];
/// The same product below which it is disabled again.
const DISABLED_BELOW: f64 = 1.04;
/// Product that is out of the question if it lies two standard errors above what is known.
const UNPROMISING_BELOW: f64 = 1.0;
/// Variance of the picture over that of independent samples that is assumed before it is known: most scenes have 0.87 to 1
/// after two or three samples per pixel, `smoke` has 0.65.
const ASSUMED: f64 = 0.85;
/// Pixels that are guided at first (in small pictures half as many), and after a gain is out of the question, within the
/// bounds [`MOST`] and [`LEAST`], were all shards to take part. A guided pixel costs some of what Sobol' points gain, because
/// its bounces have sequences of their own in each iteration; what they tell of the gain depends on their number, not on
/// the size of the picture.
const WANTED: [u64; 2] = [4096, 1024];
/// Most pixels of a small picture: all of them teach the guide, and half as many as [`WANTED`] are guided. In larger ones
/// they would crowd out of the logs what guided pixels find, of which each contribution tells more: with a larger limit
/// `render --size 960x540 --spp 12` of `pool` has more error.
const SMALL: u64 = 65_536;
/// Largest shares of the pixels that those may be, in 65536ths.
const MOST: [u32; 2] = [65_536 / 2, 65_536 / 32];
/// Least share: light that is rare in the picture must be met somewhere.
const LEAST: u32 = 65_536 / 256;
/// Binary logarithm of the edge of a block.
const BLOCK_BITS: u32 = 3;
/// Contributions, older ones discounted, that a guide has learned from before its gain is in doubt: some sixteen leaves have
/// been subdivided. Where light is found often that takes an iteration or two, where it is rare many, and there guides gain
/// most.
pub(crate) const ENOUGH: f32 = 65_536.0;
/// Samples before which nothing is decided.
const FEWEST: f64 = 256.0;
/// Most samples that a shard may tell of: more are not counted exactly.
const MOST_SAMPLES: f64 = 9_007_199_254_740_992.0;
/// Samples of a guided pixel that are learned from in each iteration, at least: a choice. 8 and 16 learn too little where
/// light is hard to find; more than 32 cost more and gain nothing.
pub(crate) const LEARNED: u32 = 32;

/// Whether path guiding pays, as [`Guiding::Auto`](crate::unstable::learn::Guiding::Auto) predicts it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideUse {
    /// Are all pixels of the next iteration guided?
    pub enabled: bool,
    /// What is predicted; `None` before enough samples.
    pub gain: Option<GuideGain>,
}

/// Predicted gain of path guiding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideGain {
    /// Squared error of the picture without guiding, over that with it, at equal numbers of samples that are independent.
    pub gain: f64,
    /// Its relative standard error.
    pub error: f64,
}

/// Squared errors of guided camera samples, and as they would be without the guide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Promise {
    /// Number of samples.
    samples: f64,
    /// Sum of those without the guide; single ones may be negative.
    without: f64,
    /// Sum of those with it.
    with: f64,
    /// Sums of the squares of both, and of their product.
    squares: [f64; 3],
}

impl Promise {
    /// Adds a sample; none whose errors are not finite.
    #[inline]
    pub(crate) fn add(&mut self, without: f32, with: f32) {
        if !(without.is_finite() && with.is_finite()) {
            return;
        }
        let (a, b) = (f64::from(without), f64::from(with));
        self.samples += 1.0;
        self.without += a;
        self.with += b;
        for (sum, x) in self.squares.iter_mut().zip([a * a, b * b, a * b]) {
            *sum += x;
        }
    }

    /// Sums without the guide and with it.
    #[cfg(test)]
    pub(crate) fn sums(&self) -> [f64; 2] {
        [self.without, self.with]
    }

    /// Sums of both.
    fn plus(self, o: &Self) -> Self {
        let [a, b, ab] = self.squares;
        let [x, y, xy] = o.squares;
        Self {
            samples: self.samples + o.samples,
            without: self.without + o.without,
            with: self.with + o.with,
            squares: [a + x, b + y, ab + xy],
        }
    }

    fn times(self, by: f64) -> Self {
        let Self { samples, without, with, squares } = self;
        Self { samples: samples * by, without: without * by, with: with * by, squares: squares.map(|x| x * by) }
    }

    /// Ratio of the sums and its relative standard error; `None` before enough samples.
    fn gain(&self) -> Option<GuideGain> {
        if !(self.samples >= FEWEST && self.with > 0.0) {
            return None;
        }
        let gain = self.without / self.with;
        let [a, b, ab] = self.squares;
        let variance = a - 2.0 * gain * ab + gain * gain * b;
        if !variance.is_finite() {
            return None;
        }
        let error = variance.max(0.0).sqrt_newton() / self.without.max(self.with * 1e-3);
        // a guide that does much harm may leave less than nothing; forged sums may have any ratio
        (gain.is_finite() && error.is_finite()).then_some(GuideGain { gain: gain.max(0.0), error })
    }

    /// Are these sums that samples may have? Sums of such ones are finite.
    pub(crate) fn is_sound(&self) -> bool {
        // twice what finite samples may have, for rounding
        let most = 2.0 * f64::from(f32::MAX);
        let [a, b, ab] = self.squares;
        let within = |x: f64, most: f64| x.abs() <= most * self.samples;
        (0.0..=MOST_SAMPLES).contains(&self.samples)
            && [self.with, a, b].into_iter().all(|x| x >= 0.0)
            && [self.without, self.with].into_iter().all(|x| within(x, most))
            && [a, b, ab].into_iter().all(|x| within(x, most * most))
    }
}

/// What is known of the gain, and whether the guide is enabled.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Watch {
    promise: Promise,
    /// Not 0: all pixels are guided.
    enabled: u32,
    /// Iterations one after the other that have shown no gain; [`IN_DOUBT`], or [`UNPROMISING`].
    doubts: u32,
    /// Number of decisions, by which shards take turns.
    turn: u64,
}

/// As a number of iterations: a gain is in doubt.
const IN_DOUBT: u32 = u32::MAX - 1;
/// The same: one is out of the question.
const UNPROMISING: u32 = u32::MAX;
/// Iterations without a gain after which one is in doubt: of a guide that has learned enough, the same while a standard
/// error more would be a gain, and of any.
const PATIENCE: [u32; 3] = [3, 6, 12];

/// A shard goes on in one of so many iterations, or of as many as there are shards, once a gain is in doubt. It may take a
/// quarter more time then: with 8, `veach_mis` took 3 to 6 % more than without guiding (`benches/EFFICIENCY.md`).
const TURNS: u32 = 16;

/// Shares of the blocks of pixels that are guided while the guide is disabled, in 65536ths: see [`WANTED`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrialShares {
    shares: [u32; 2],
    /// Is the picture small: do pixels that are not guided teach too while it is open whether the guide pays?
    small: bool,
}

impl TrialShares {
    /// Those of a picture of this size.
    pub(crate) fn of(size: [u32; 2]) -> Self {
        let pixels = (u64::from(size[0]) * u64::from(size[1])).max(1);
        let share = |wanted: u64, most| (wanted * 65_536 / pixels).min(u64::from(most)) as u32;
        let ([undecided, unpromising], small) = (WANTED, pixels <= SMALL);
        let undecided = if small { undecided / 2 } else { undecided };
        let shares = [share(undecided, MOST[0]), share(unpromising, MOST[1])].map(|x| x.max(LEAST));
        Self { shares, small }
    }
}

impl Watch {
    /// Are all pixels guided?
    #[inline(always)]
    pub(crate) fn enabled(&self) -> bool {
        self.enabled != 0
    }

    /// Does shard `index` of `shards` guide paths, or learn to, in the next iteration? They take turns once a gain is in
    /// doubt.
    #[inline(always)]
    pub(crate) fn trains(&self, [index, shards]: [u32; 2]) -> bool {
        let turn = self.turn.wrapping_add(index.into()).is_multiple_of(shards.clamp(1, TURNS).into());
        turn || self.enabled() || self.doubts < IN_DOUBT
    }

    /// Do shards that train the guide learn from all samples, guided or not? In small pictures only, and while it is open
    /// whether the guide pays.
    #[inline(always)]
    pub(crate) fn all_teach(&self, shares: TrialShares) -> bool {
        shares.small && !self.enabled() && self.doubts != UNPROMISING
    }

    /// Part of the samples learned from that are guided, if so many of a guided pixel, and of another, are learned from.
    #[inline]
    pub(crate) fn guided_part(&self, shares: TrialShares, [guided, other]: [u32; 2]) -> f32 {
        let pixels = self.share(shares) as f32 / 65_536.0;
        let other = if self.all_teach(shares) { other } else { 0 };
        let (guided, other) = (pixels * guided as f32, (1.0 - pixels) * other as f32);
        guided / (guided + other).max(f32::MIN_POSITIVE)
    }

    /// Share of the blocks that are guided while the guide is disabled, in 65536ths.
    #[inline(always)]
    fn share(&self, shares: TrialShares) -> u32 {
        let [undecided, unpromising] = shares.shares;
        if self.doubts == UNPROMISING { unpromising } else { undecided }
    }

    /// Is the pixel in this column and row guided in iteration `iteration`? Blocks, because samples of a
    /// packet are neighbours.
    #[inline]
    pub(crate) fn is_guided(&self, iteration: u64, [x, y]: [u32; 2], shares: TrialShares) -> bool {
        let block = u64::from(y >> BLOCK_BITS) << 32 | u64::from(x >> BLOCK_BITS);
        self.enabled() || (mix(mix(block) ^ mix(iteration)) >> 48) < u64::from(self.share(shares))
    }

    /// Adds what a shard has found.
    pub(crate) fn add(&mut self, promise: &Promise) {
        self.promise = self.promise.plus(promise);
    }

    /// What is predicted; `None` before enough samples.
    pub(crate) fn gain(&self) -> Option<GuideGain> {
        self.promise.gain()
    }

    /// Decides about the next iteration. A gain is not out of the question before the guide has learned `enough`.
    /// `independence`: variance of the picture over that of independent samples, `None` while unknown.
    pub(crate) fn decide(&mut self, decay: f64, enough: bool, independence: Option<f64>) {
        let (doubted, was_enabled) = (self.doubts >= IN_DOUBT, self.enabled());
        let left = independence.unwrap_or(ASSUMED).min(1.0);
        let gain = self.gain().map(|g| GuideGain { gain: g.gain * left, ..g });
        if let Some(GuideGain { gain, error }) = gain {
            let least = if was_enabled { DISABLED_BELOW } else { ENABLED_ABOVE };
            let [at_first, in_doubt] = DOUBT;
            let doubt = if doubted || was_enabled { in_doubt } else { at_first };
            self.enabled = (gain * (1.0 - doubt * error) > least).into();
        }
        let [informed, unclear, longest] = PATIENCE;
        let hopeful = gain.is_some_and(|g| g.gain * (1.0 + g.error) > ENABLED_ABOVE);
        let patience = match (enough, hopeful) {
            (false, _) => longest,
            (true, true) => unclear,
            (true, false) => informed,
        };
        self.doubts = match gain {
            _ if self.enabled() => 0,
            Some(g) if enough && g.gain * (1.0 + 2.0 * g.error) < UNPROMISING_BELOW => UNPROMISING,
            None if doubted => self.doubts,
            _ if doubted || was_enabled && enough || self.doubts + 1 >= patience => IN_DOUBT,
            _ => self.doubts + 1,
        };
        self.promise = self.promise.times(decay);
        self.turn = self.turn.wrapping_add(1);
    }
}

#[cfg(test)]
mod tests {
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
            (2.0, Some(0.6), true),
            (1.2, None, false),
            (1.5, None, true),
            (0.9, Some(1.5), false),
        ] {
            for start in [Watch::default(), decided(Watch::default(), &promise(100, 0.1))] {
                let watch = decided_of(independence, start, &promise(4000, 1.0 / gain));
                assert_eq!(watch.enabled(), enabled, "{gain} {independence:?}");
            }
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
        // 1.1 with a standard error of a third or so at first
        let unclear = |n: u32| {
            let mut p = promise(n, 1.0);
            p.add(p.with as f32 * 0.3, p.with as f32 * 0.2);
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
        assert!(decided(enabled, &promise(40_000, 0.9)).enabled());
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
            (after(3, 0.95, true), true),
            (after(1000, 0.95, false), true),
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
        let part = after(3, 0.95, true).guided_part(small, [32, 8]);
        assert!((part - 4.0 / (4.0 + 31.0)).abs() < 1e-6, "{part}");
        assert_eq!(after(1, 2.0, true).guided_part(small, [32, 8]), 1.0);
        assert_eq!(Watch::default().guided_part(large, [32, 8]), 1.0);
    }

    /// In doubt, and when a gain is out of the question, each shard trains in one of sixteen iterations, or of as many as
    /// there are shards, and as many do in each iteration. Killed by: turns while it is open whether a guide pays, when it
    /// does, or before it knows anything; shards that never have a turn, or all at once; a guide that is never tried again.
    #[test]
    fn shards_take_turns_once_a_gain_is_in_doubt() {
        let open = [Watch::default(), after(2, 0.95, true), after(9, 0.5, true), after(11, 0.95, false)];
        let all = |watch: &Watch| (0..16).all(|shard| watch.trains([shard, 16]));
        assert_eq!(open.each_ref().map(all), [true; 4], "{open:?}");
        let mut unknown = Watch::default();
        (0..11).for_each(|_| unknown.decide(0.75, false, Some(1.0)));
        assert!(all(&unknown), "no sample that tells of a gain");
        unknown.decide(0.75, false, Some(1.0));
        // with turns contributions are discounted faster than new ones come
        let mut less = after(3, 0.95, true);
        less.add(&promise(100_000, 0.95));
        less.decide(0.75, false, Some(1.0));
        for start in [after(3, 0.95, true), after(12, 0.95, false), after(1, 2.0, true), less, unknown] {
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
        // a gain of 1.27 with an error of 0.09, which one sample makes, nine tenths of which are left
        let mut unclear = promise(400, 1.0 / 1.15);
        unclear.add(unclear.with as f32 * 0.1, 0.0);
        let gain = unclear.gain();
        assert!(gain.is_some_and(|g| (1.24..1.29).contains(&g.gain) && (0.07..0.1).contains(&g.error)), "{gain:?}");
        assert!(decided_of(Some(0.9), Watch::default(), &unclear).enabled());
        let doubted = Watch { promise: Promise::default(), ..after(3, 0.95, true) };
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
}
