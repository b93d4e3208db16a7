//! How much is measured.

/// Sizes of all measurements. Seconds are core-seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) name: &'static str,
    /// Pixels of a picture, about.
    pub(super) pixels: u32,
    /// Built-in scenes, of those in the list.
    pub(super) scenes: usize,
    /// Every strategy, or those of most interest.
    pub(super) all_strategies: bool,
    /// Seconds of each half of a reference.
    pub(super) reference: f64,
    /// Seconds of a render of the curves.
    pub(super) curve: f64,
    /// Seeds of the curves and of the knobs.
    pub(super) seeds: u64,
    /// Seconds of a render of the knobs.
    pub(super) knob: f64,
    /// Samples per pixel of the renders whose stated errors are checked, and their seeds.
    pub(super) stated: &'static [u32],
    pub(super) stated_seeds: u64,
    /// Renders to an error for each strategy.
    pub(super) forecasts: u64,
    /// Seconds of a render to an error, about.
    pub(super) forecast: f64,
    /// Arguments of a function are every so many of the 2^32; 1 is all of them.
    pub(super) stride: u64,
    /// Measurements of a time, of which the median counts.
    pub(super) repeats: usize,
}

impl Effort {
    /// At most three minutes on two cores.
    pub(super) const QUICK: Self = Self {
        name: "quick",
        pixels: 56 * 56,
        scenes: 3,
        all_strategies: false,
        reference: 3.0,
        curve: 0.6,
        seeds: 4,
        knob: 0.25,
        stated: &[8, 32],
        stated_seeds: 12,
        forecasts: 6,
        forecast: 0.6,
        stride: 1024,
        repeats: 21,
    };

    /// Everything, with all arguments of the functions.
    pub(super) const FULL: Self = Self {
        name: "full",
        pixels: 96 * 96,
        scenes: 3,
        all_strategies: true,
        reference: 30.0,
        curve: 3.0,
        seeds: 10,
        knob: 0.8,
        stated: &[8, 32, 128],
        stated_seeds: 40,
        forecasts: 16,
        forecast: 3.0,
        stride: 1,
        repeats: 41,
    };

    /// Shows that a page can be made, and nothing else.
    pub(super) const TINY: Self = Self {
        name: "tiny",
        pixels: 48 * 48,
        scenes: 1,
        all_strategies: false,
        reference: 0.1,
        curve: 0.05,
        seeds: 2,
        knob: 0.02,
        stated: &[8],
        stated_seeds: 3,
        forecasts: 2,
        forecast: 0.05,
        stride: 1 << 18,
        repeats: 3,
    };

    /// Core-seconds of the functions: an argument takes about 50 ns of a core with f64 beside it, a ray at a triangle
    /// or a box about a microsecond.
    pub(super) fn functions(&self) -> f64 {
        let part = 1.0 / self.stride as f64;
        7.0 * 50e-9 * (1u64 << 32) as f64 * part + 1e-6 * 6.0 * (1u64 << 26) as f64 * part.min(0.125)
    }

    /// Core-seconds of everything but the functions for so many scenes, curves and knobs each. `sample` are the
    /// measured seconds of a sample per pixel with the default strategy.
    pub(super) fn core_seconds(&self, curves: usize, knobs: usize, stated: usize, sample: &[f64]) -> f64 {
        let lengths: u32 = self.stated.iter().sum();
        let of = |sample: &f64| {
            let drawn = self.stated_seeds as f64 * f64::from(lengths) * stated as f64 * sample;
            let seeds = self.seeds as f64;
            let curves = curves as f64 * seeds * self.curve;
            let forecasts = 2.0 * self.forecasts as f64 * self.forecast;
            2.0 * self.reference
                + curves
                + (knobs + 1) as f64 * seeds * self.knob
                + forecasts
                + drawn
                + 14.0 * self.knob
        };
        sample.iter().map(of).sum()
    }
}
