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
/// above which the guide is enabled, and stays so. From the second decision after that on the film has samples of guided
/// pixels, and the square of that variance counts: without the guide Sobol' points would leave less (in `cbox` 0.58 in place
/// of 0.78). The factor is more than what Sobol' points lose by it, as some of them go on: in
/// `veach_mis`, whose factor is a half, 1.03 times, in `cbox`, where it is 0.6, 1.16 times. Guided samples take 1.03 to 1.6
/// times as long as others, most where rays are cheap. And pictures gain less than is predicted, because roulette and
/// splitting would be others without the guide: in `cbox` 1.56 is predicted once all pixels are guided, of which pictures
/// gain 1.21 (benches/EFFICIENCY.md; the benchmark `guiding` shows errors and seconds).
const ENABLED_ABOVE: f64 = 1.2;
/// Standard errors that the gain must lie above a bound, at first, and once it was in doubt or all pixels are guided. A ratio
/// of which few samples, those that found rare light, make the most has a standard error of the same size, and is most likely
/// too small; one that turns out to be too large soon disables the guide again. Later iterations are longer, and few samples
/// tell of the gain in each, so that one that is too large costs more. When all pixels are guided many samples tell of it: a
/// gain that has still such an error is that of a few long paths whose ratios of densities are huge.
const DOUBT: [f64; 2] = [0.25, 1.0];
/// A gain is out of the question while the product lies below this by two standard errors.
const UNPROMISING_BELOW: f64 = 1.1;
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
    /// Decisions one after the other that have enabled the guide: all pixels are guided if it is not 0.
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
/// Iterations without a gain after which one is in doubt: of a guide that has learned enough, or while a gain is out of the
/// question; the same while a standard error more would be a gain; and of any. Iterations double, so each one more doubles
/// what a trial costs.
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
        let left = if self.enabled > 1 && independence.is_some() { left * left } else { left };
        let gain = self.gain().map(|g| GuideGain { gain: g.gain * left, ..g });
        if let Some(GuideGain { gain, error }) = gain {
            let [at_first, in_doubt] = DOUBT;
            let doubt = if doubted || was_enabled { in_doubt } else { at_first };
            let pays = gain * (1.0 - doubt * error) > ENABLED_ABOVE;
            self.enabled = if pays { self.enabled.saturating_add(1) } else { 0 };
        }
        let [informed, unclear, longest] = PATIENCE;
        let hopeful = gain.is_some_and(|g| g.gain * (1.0 + g.error) > ENABLED_ABOVE);
        let unpromising = gain.is_some_and(|g| g.gain * (1.0 + 2.0 * g.error) < UNPROMISING_BELOW);
        let patience = match (enough || unpromising, hopeful) {
            (false, _) => longest,
            (true, true) => unclear,
            (true, false) => informed,
        };
        self.doubts = match gain {
            _ if self.enabled() => 0,
            _ if enough && unpromising => UNPROMISING,
            None if doubted => self.doubts,
            _ if doubted || was_enabled && enough || self.doubts + 1 >= patience => IN_DOUBT,
            _ => self.doubts + 1,
        };
        self.promise = self.promise.times(decay);
        self.turn = self.turn.wrapping_add(1);
    }
}

#[cfg(test)]
mod tests;
