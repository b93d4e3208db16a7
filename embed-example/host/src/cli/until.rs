//! When a render ends.

use super::values::positive;
use croupier_host::render::{RenderOptions, Target};

/// Stop condition; 64 samples per pixel if none is given.
#[derive(clap::Args)]
#[group(multiple = false)]
pub(crate) struct Until {
    /// Stop after this many samples per pixel, at least 1 [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Stop after this many seconds of rendering, above 0, without loading and writing: no iteration begins that would
    /// pass them at the speed so far, one that has begun is finished, and the first, a sample per pixel, is rendered in
    /// any case
    #[arg(long, value_name = "S", value_parser = positive, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Stop after this many rays of all kinds, at least 1: no iteration but the first begins that would pass them at
    /// the cost so far
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// Stop after the iteration that brings the estimated relMSE down to this, above 0, with 4 samples per pixel at
    /// least
    #[arg(long, value_name = "E", value_parser = positive, allow_negative_numbers = true)]
    until_error: Option<f64>,
}

impl Until {
    pub(crate) fn target(&self) -> Target {
        let given = self.spp.map(Target::Spp).or(self.seconds.map(Target::Seconds));
        let given = given.or(self.rays.map(Target::Rays)).or(self.until_error.map(Target::Error));
        given.unwrap_or(RenderOptions::default().target)
    }
}
