//! Is path guiding worth its cost? Measured on the picture: in some blocks of pixels, others in each iteration, every
//! second camera sample is guided, and the errors and rays of both halves are compared. Blocks, because samples of a
//! packet are neighbours: packets without any guided lane cost what they cost without guiding.
//!
//! The guide is disabled while no gain is proven: then the other pixels are not guided, and no direction is learned
//! from there. It is enabled while the gain lasts: then they are.
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing)]

use crate::film::{REL_MSE_EPSILON, SqrtNewton};
use crate::rng::mix;
use crate::rrs::Norm;
use bytemuck::{Pod, Zeroable};
use croupier_simd::F32x8;

/// Cost of a ray of a guided path over that of others, in instructions: trees are looked up twice, BSDFs are evaluated
/// once more, and more samples are learned from.
const GUIDED_RAY: f64 = 1.35;
/// Gain, less its standard error, from which on the guide is enabled.
const ENABLED_ABOVE: f64 = 1.05;
/// Gain below which it is disabled again.
const DISABLED_BELOW: f64 = 1.0;
/// Gain that must be within two standard errors, lest hardly any samples are compared from then on.
const POSSIBLE: f64 = 1.1;
/// Share of the blocks in which halves are compared while nothing is decided, in 65536ths.
const TRIED: u32 = 65_536 / 24;
/// The same after a gain of [`POSSIBLE`] is out of the question.
const UNPROMISING: u32 = 65_536 / 128;
/// The same while the guide is enabled.
const CONTROL: u32 = 65_536 / 16;
/// Binary logarithm of the edge of a block.
const BLOCK_BITS: u32 = 3;
/// Guided samples before which nothing is decided.
const FEWEST: f64 = 256.0;
/// Samples per pixel and iteration that are learned from while the guide is enabled, at least: a choice. 8
/// learn too little where light is hard to find, 64 cost more.
pub(crate) const LEARNED_ENABLED: u32 = 16;
/// The same in blocks in which halves are compared.
const LEARNED_TRIED: u32 = 64;

/// Whether path guiding pays, as [`Guiding::Auto`](crate::unstable::learn::Guiding::Auto) has measured it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideUse {
    /// Are most samples of the next iteration guided?
    pub enabled: bool,
    /// What was measured; `None` before enough samples.
    pub gain: Option<GuideGain>,
}

/// Measured gain of path guiding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideGain {
    /// Error times cost of camera samples that are not guided, over that of those that are.
    pub gain: f64,
    /// Its relative standard error.
    pub error: f64,
}

/// Errors and rays of camera samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct TrialSums {
    /// Number of samples.
    samples: f64,
    /// Sum of their weighted squared errors.
    errors: f64,
    /// Sum of the squares of those.
    squares: f64,
    /// Rays.
    rays: f64,
}

impl TrialSums {
    /// Adds a sample.
    pub(crate) fn add(&mut self, error: f64, rays: u32) {
        self.samples += 1.0;
        self.errors += error;
        self.squares += error * error;
        self.rays += f64::from(rays);
    }

    /// Sums of both.
    fn plus(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            errors: self.errors + other.errors,
            squares: self.squares + other.squares,
            rays: self.rays + other.rays,
        }
    }

    fn times(self, by: f64) -> Self {
        let Self { samples, errors, squares, rays } = self;
        Self { samples: samples * by, errors: errors * by, squares: squares * by, rays: rays * by }
    }

    /// Mean error times mean rays, and the squared relative standard error of the mean error.
    fn cost(&self) -> (f64, f64) {
        let n = self.samples;
        (self.errors / n * (self.rays / n), (self.squares / (self.errors * self.errors) - 1.0 / n).max(0.0))
    }

    /// Are these sums that samples may have?
    pub(crate) fn is_sound(&self) -> bool {
        [self.samples, self.errors, self.squares, self.rays].into_iter().all(|x| (0.0..f64::INFINITY).contains(&x))
    }
}

/// Samples that were not guided, and samples that were.
pub(crate) type Trial = [TrialSums; 2];

/// What is known of the gain, and whether the guide is enabled.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Watch {
    trial: Trial,
    /// Not 0: most samples are guided.
    enabled: u32,
    /// Share of the blocks in which halves are compared, in 65536ths.
    tried: u32,
}

impl Default for Watch {
    /// Nothing is known.
    fn default() -> Self {
        Self { trial: Trial::default(), enabled: 0, tried: TRIED }
    }
}

/// How a camera sample takes part in the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Assignment {
    /// Is it guided?
    pub guided: bool,
    /// Is it compared with others?
    pub tried: bool,
}

impl Watch {
    /// Are most samples guided?
    #[inline(always)]
    pub(crate) fn enabled(&self) -> bool {
        self.enabled != 0
    }

    /// What becomes of sample `sample` of the pixel in this column and row in iteration `iteration`.
    #[inline]
    pub(crate) fn assignment(&self, iteration: u64, [x, y]: [u32; 2], sample: u32) -> Assignment {
        let salt = mix(iteration);
        let bits = |x: u32, y: u32, n: u32| mix(mix(u64::from(y) << 32 | u64::from(x)) ^ salt ^ u64::from(n));
        let tried = (bits(x >> BLOCK_BITS, y >> BLOCK_BITS, u32::MAX) >> 48) < u64::from(self.tried);
        Assignment { guided: if tried { bits(x, y, sample) >> 63 == 1 } else { self.enabled() }, tried }
    }

    /// How many samples of a pixel and iteration are learned from, where `asked` are without guiding.
    #[inline]
    pub(crate) fn learned(&self, asked: u32, a: Assignment) -> u32 {
        let least = if a.tried {
            LEARNED_TRIED
        } else if self.enabled() {
            LEARNED_ENABLED
        } else {
            0
        };
        asked.max(least)
    }

    /// Adds what a shard has measured.
    pub(crate) fn add(&mut self, trial: &Trial) {
        for (sum, t) in self.trial.iter_mut().zip(trial) {
            *sum = sum.plus(*t);
        }
    }

    /// What was measured; `None` before enough samples.
    pub(crate) fn gain(&self) -> Option<GuideGain> {
        let [off, on] = &self.trial;
        if !(off.samples >= FEWEST && on.samples >= FEWEST && off.errors > 0.0 && on.errors > 0.0) {
            return None;
        }
        let ((a, va), (b, vb)) = (off.cost(), on.cost());
        Some(GuideGain { gain: a / (b * GUIDED_RAY), error: (va + vb).sqrt_newton() })
    }

    /// Decides about the next iteration; `useful` if the guide would guide any sample.
    pub(crate) fn decide(&mut self, useful: bool, decay: f64) {
        if !useful {
            // halves that were alike say nothing of a guide that has learned more
            *self = Self::default();
            return;
        }
        let gain = self.gain();
        self.enabled = match gain {
            Some(GuideGain { gain, error }) if self.enabled == 0 => u32::from(gain * (1.0 - error) > ENABLED_ABOVE),
            Some(GuideGain { gain, .. }) => u32::from(gain >= DISABLED_BELOW),
            None => self.enabled,
        };
        self.tried = match gain {
            _ if self.enabled() => CONTROL,
            Some(GuideGain { gain, error }) if gain * (1.0 + 2.0 * error) < POSSIBLE => UNPROMISING,
            _ => TRIED,
        };
        self.trial = self.trial.map(|sums| sums.times(decay));
    }
}

/// Weighted squared error of a camera sample's radiance, by the error weights of its pixel: at most `limit`. The value
/// that it is measured against follows from the weights where those are relative; any constant would do, but the
/// pixel's mean makes differences clearest.
pub(crate) fn error_of(radiance: [f64; 3], error_weight: [f32; 3], norm: Norm, limit: f32) -> f64 {
    let [a, b, c] = error_weight;
    let weight = F32x8::new([a, b, c, 1.0, 1.0, 1.0, 1.0, 1.0]);
    let square = F32x8::ONE / weight - REL_MSE_EPSILON as f32;
    let [x, y, z, ..] = square.max(F32x8::ZERO).sqrt().to_array();
    let error = |radiance: f64, value: f32, weight: f32| {
        let d = radiance - f64::from(value);
        d * d * f64::from(weight)
    };
    let [r, g, blue] = radiance;
    norm.of_color([error(r, x, a), error(g, y, b), error(blue, z, c)]).min(f64::from(limit))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trial of samples whose errors are 0 or twice the mean, by turns; the guided ones' mean is `error`.
    fn trial(guided: u32, error: f64, rays: u32) -> Trial {
        let mut trial = Trial::default();
        let [off, on] = &mut trial;
        (0..10_000).for_each(|i| off.add(f64::from(i % 2) * 2.0, 10));
        (0..guided).for_each(|i| on.add(f64::from(i % 2) * 2.0 * error, rays));
        trial
    }

    fn decided(start: Watch, useful: bool, t: &Trial) -> Watch {
        let mut watch = start;
        watch.add(t);
        watch.decide(useful, 0.75);
        watch
    }

    /// Killed by: a gain upside down, rays left out, the cost of guided rays left out, a decision from too few samples.
    #[test]
    fn the_guide_is_enabled_where_it_pays() {
        let fresh = Watch::default();
        assert!(!fresh.enabled() && fresh.gain().is_none());
        assert!(decided(fresh, true, &trial(1000, 0.5, 10)).enabled());
        assert!(!decided(fresh, true, &trial(1000, 1.0, 10)).enabled(), "no better, and dearer");
        assert!(!decided(fresh, true, &trial(1000, 0.5, 20)).enabled(), "half the error for twice the rays");
        assert!(!decided(fresh, true, &trial(100, 0.1, 10)).enabled(), "too few samples");
        assert!(!decided(fresh, false, &trial(1000, 0.1, 10)).enabled(), "nothing to guide by");
        let gain = decided(fresh, true, &trial(1000, 0.5, 10)).gain().map(|g| g.gain);
        assert!(gain.is_some_and(|g| (g * GUIDED_RAY - 2.0).abs() < 1e-9), "{gain:?}");
    }

    /// Killed by: a guide that stays enabled, one that flickers, shares of guided samples that are not those asked for.
    #[test]
    fn it_stays_enabled_while_it_pays() {
        let enabled = decided(Watch::default(), true, &trial(1000, 0.5, 10));
        assert!(decided(enabled, true, &trial(10_000, 0.7, 10)).enabled());
        assert!(!decided(enabled, true, &trial(100_000, 2.0, 10)).enabled());
        let rejected = decided(Watch::default(), true, &trial(100_000, 2.0, 10));
        let open = decided(Watch::default(), true, &Trial::default());
        for (watch, tried) in [(enabled, CONTROL), (rejected, UNPROMISING), (open, TRIED)] {
            let all = (0..1 << 20).map(|i| watch.assignment(7, [i % 1024, i / 1024], 1));
            let share = |tried, guided| {
                let alike = all.clone().filter(|l| (l.tried, l.guided) == (tried, guided));
                alike.count() as f64 / f64::from(1 << 20)
            };
            let tried = f64::from(tried) / 65_536.0;
            let [off, on, without, with] =
                [(false, false), (false, true), (true, false), (true, true)].map(|(t, g)| share(t, g));
            // 16,384 blocks: four standard deviations are 0.008
            assert!(
                (without + with - tried).abs() < 0.008 && (without - with).abs() < 0.002,
                "{without}, {with}, {tried}"
            );
            assert_eq!((off, on) == (0.0, 1.0 - without - with), watch.enabled());
        }
    }

    /// The errors of a pixel of known value. Killed by: weights that are not undone, errors above the limit.
    #[test]
    fn errors_are_those_against_the_pixel() {
        let weights = [0.5f32, 2.0, 0.0].map(|x| 1.0 / (x * x + REL_MSE_EPSILON as f32));
        let error = error_of([0.6, 1.0, 0.1], weights, Norm::Mean, 1e9);
        let expected = (0.01 / 0.26 + 1.0 / 4.01 + 0.01 / 0.01) / 3.0;
        assert!((error - expected).abs() < 1e-5, "{error}, not {expected}");
        assert_eq!(error_of([100.0; 3], weights, Norm::Mean, 2.0), 2.0);
    }
}
