//! What the strategies that learn are told.

use croupier::Strategy;
use croupier::learn::cache::CacheError;
use croupier::learn::{ControlVariate, Learning, Objective, PixelEstimator};
use croupier::rrs::{MAX_FACTOR, MIN_FACTOR, Norm, Space};
use croupier_host::drive::DriveError;
use croupier_host::render::RenderOptions;
use std::error::Error;
use std::path::PathBuf;

/// Flags about learning.
#[derive(clap::Args)]
#[command(next_help_heading = "Learning")]
pub struct LearningFlags {
    /// More samples for pixels with much error, fewer for others
    #[arg(long)]
    adaptive: bool,
    /// Roulette for light samples and their shadow rays too [default: true with ear and ears]
    #[arg(long, value_name = "true|false", num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    shadow_roulette: Option<bool>,
    /// What stands in for samples that roulette skips: off, cached (the learned mean) or a radiance
    #[arg(long, value_name = "off|cached|NUMBER", default_value = "off", value_parser = control_variate, allow_negative_numbers = true)]
    control_variate: ControlVariate,
    /// Which error is to be small: relative to the pixel, or absolute
    #[arg(long, value_name = "relative|absolute", default_value = "relative", value_parser = objective)]
    objective: Objective,
    /// How the errors of the channels become one: mean, luminance or max
    #[arg(long, value_name = "mean|luminance|max", default_value = "mean", value_parser = norm)]
    norm: Norm,
    /// Memory for statistics of the scene, of all shards together
    #[arg(long, value_name = "N", default_value = "24MiB", value_parser = bytes)]
    cache_bytes: usize,
    /// Samples in flight per shard that can be learned from, 1 to 2^24 of 68 bytes each
    #[arg(long, value_name = "N", default_value_t = Learning::default().ledger, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    ledger: u32,
    /// Camera samples per pixel that are learned from in each iteration, the first ones
    #[arg(long, value_name = "N", default_value_t = Learning::default().samples, value_parser = clap::value_parser!(u32).range(1..))]
    learn_samples: u32,
    /// Samples in a leaf of the octree at which it is divided, above 0
    #[arg(long, value_name = "N", default_value_t = Learning::default().subdivide_count, value_parser = above_0, allow_negative_numbers = true)]
    subdivide_count: f32,
    /// Part of the statistics that an iteration hands on to the next, 0 to 1
    #[arg(long, value_name = "X", default_value_t = Learning::default().decay, value_parser = part, allow_negative_numbers = true)]
    decay: f32,
    /// Smallest and largest learned factor, at most and at least 1, within 0.05 and 20
    #[arg(long, value_name = "LO:HI", default_value = "0.05:20", value_parser = factors)]
    factors: [f32; 2],
    /// What errors are judged by: the denoised picture (140 bytes a pixel) or means over 8x8 pixels (12 bytes for each)
    #[arg(long, value_name = "denoised|blocks", default_value = "denoised", value_parser = estimate)]
    estimate: PixelEstimator,
}

/// Flags about saved statistics.
#[derive(clap::Args)]
#[command(next_help_heading = "Learning")]
pub struct CacheFlags {
    /// Begin with statistics that a render of this scene with the same objective has saved
    #[arg(long, value_name = "FILE")]
    cache_in: Option<PathBuf>,
    /// Save the statistics of the scene in the end
    #[arg(long, value_name = "FILE")]
    pub cache_out: Option<PathBuf>,
}

impl LearningFlags {
    /// Puts them into `options`.
    pub fn apply(&self, options: &mut RenderOptions) {
        options.adaptive = self.adaptive;
        options.shadow_roulette = self.shadow_roulette;
        options.control_variate = self.control_variate;
        options.learning = Learning {
            cache_bytes: self.cache_bytes,
            ledger: self.ledger,
            samples: self.learn_samples,
            subdivide_count: self.subdivide_count,
            decay: self.decay,
            estimate: self.estimate,
            objective: self.objective,
            norm: self.norm,
            factors: self.factors,
        };
    }
}

impl CacheFlags {
    /// Puts them into `options`, whose strategy is known, and reads the saved statistics.
    pub fn apply(&self, options: &mut RenderOptions) -> Result<(), Box<dyn Error>> {
        let strategy = Strategy::parse(&options.strategy)?;
        let caches = self.cache_in.is_some() || self.cache_out.is_some();
        // Said before the scene is loaded.
        if caches && strategy.space() != Some(Space::Scene) {
            return Err(DriveError::NoCache(strategy.name()).into());
        }
        let read = |p: &PathBuf| std::fs::read(p).map_err(|e| format!("cannot read {}: {e}", p.display()));
        options.cache = self.cache_in.as_ref().map(read).transpose()?;
        options.save_cache = self.cache_out.is_some();
        Ok(())
    }

    /// Is this error about the saved statistics? Then with the name of their file, and what to do.
    pub fn about(&self, e: &DriveError) -> Option<String> {
        match (e, &self.cache_in) {
            (DriveError::Cache(CacheError::Full { .. }), Some(path)) => {
                Some(format!("{}: {e}; give more --cache-bytes", path.display()))
            }
            (DriveError::Cache(_), Some(path)) => Some(format!("{}: {e}", path.display())),
            _ => None,
        }
    }
}

fn control_variate(text: &str) -> Result<ControlVariate, String> {
    match text {
        "off" => Ok(ControlVariate::Off),
        "cached" => Ok(ControlVariate::Cached),
        _ => match text.parse::<f32>() {
            Ok(x) if x.is_finite() => Ok(ControlVariate::Number(x)),
            _ => Err("write off, cached or a finite number".into()),
        },
    }
}

fn objective(text: &str) -> Result<Objective, String> {
    match text {
        "relative" => Ok(Objective::Relative),
        "absolute" => Ok(Objective::Absolute),
        _ => Err("write relative or absolute".into()),
    }
}

fn norm(text: &str) -> Result<Norm, String> {
    match text {
        "mean" => Ok(Norm::Mean),
        "luminance" => Ok(Norm::Luminance),
        "max" => Ok(Norm::Max),
        _ => Err("write mean, luminance or max".into()),
    }
}

fn estimate(text: &str) -> Result<PixelEstimator, String> {
    match text {
        "denoised" => Ok(PixelEstimator::Denoised),
        "blocks" => Ok(PixelEstimator::Blocks),
        _ => Err("write denoised or blocks".into()),
    }
}

fn above_0(text: &str) -> Result<f32, String> {
    let x = text.parse().ok().filter(|x: &f32| *x > 0.0 && x.is_finite());
    x.ok_or_else(|| "must be a finite number above 0".into())
}

fn part(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|x| (0.0..=1.0).contains(x)).ok_or_else(|| "must be a number from 0 to 1".into())
}

/// `0.5:2`.
fn factors(text: &str) -> Result<[f32; 2], String> {
    let both = text.split_once(':').and_then(|(lo, hi)| Some([lo.parse().ok()?, hi.parse().ok()?]));
    both.filter(|[lo, hi]| (MIN_FACTOR..=1.0).contains(lo) && (1.0..=MAX_FACTOR).contains(hi))
        .ok_or_else(|| format!("write it as 0.5:2, from {MIN_FACTOR} to 1 and from 1 to {MAX_FACTOR}"))
}

/// `65536`, `32KiB`, `24MiB`, `1GiB`.
fn bytes(text: &str) -> Result<usize, String> {
    let digits = text.trim_end_matches(|c: char| !c.is_ascii_digit());
    let shift = match &text[digits.len()..] {
        "" => 0,
        "KiB" => 10,
        "MiB" => 20,
        "GiB" => 30,
        _ => return Err("write it as 65536, 32KiB, 24MiB or 1GiB".into()),
    };
    let number: usize = digits.parse().map_err(|_| "write it as 65536, 32KiB, 24MiB or 1GiB")?;
    number.checked_mul(1 << shift).ok_or_else(|| "more bytes than can be addressed".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a suffix that counts in thousands, a product that wraps, the flags' defaults unlike the library's.
    #[test]
    fn texts() {
        for (text, value) in [("65536", 65536), ("32KiB", 32768), ("24MiB", 25_165_824), ("1GiB", 1 << 30), ("0", 0)] {
            assert_eq!(bytes(text), Ok(value), "{text}");
        }
        for text in ["", "KiB", "24MB", "24 MiB", "-1", "1.5MiB", "99999999999999999999", "18446744073709551615KiB"] {
            assert!(bytes(text).is_err(), "{text}");
        }
        let l = Learning::default();
        assert_eq!(bytes("24MiB"), Ok(l.cache_bytes));
        assert_eq!((objective("relative"), norm("mean")), (Ok(l.objective), Ok(l.norm)));
        assert_eq!((factors("0.05:20"), estimate("denoised")), (Ok(l.factors), Ok(l.estimate)));
        assert_eq!((factors("1:1"), factors("0.5:2")), (Ok([1.0, 1.0]), Ok([0.5, 2.0])));
        for text in ["", "1", ":", "0.04:2", "0.5:20.1", "1.1:2", "0.5:0.9", "2:0.5", "nan:2", "0.5:nan", "0.5:1:2"] {
            assert!(factors(text).is_err(), "{text}");
        }
        assert_eq!([part("0"), part("0.75"), part("1")], [Ok(0.0), Ok(0.75), Ok(1.0)]);
        assert!(["-0.1", "1.1", "nan", ""].iter().all(|text| part(text).is_err()));
        assert!(["-1", "0", "inf", "1e-60", "nan", ""].iter().all(|text| above_0(text).is_err()));
        assert_eq!(control_variate("-0.5"), Ok(ControlVariate::Number(-0.5)));
        assert!(control_variate("inf").is_err() && control_variate("on").is_err());
    }
}
