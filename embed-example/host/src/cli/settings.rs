//! What every strategy is told, and what a render's memory depends on.

use croupier::learn::cache::CacheSize;
use croupier::rrs::ParseError;
use croupier::{MAX_PATH_LENGTH, MIN_RING, Strategy};
use croupier_host::render::RenderOptions;

/// Flags of the core's settings.
#[derive(clap::Args)]
pub struct SettingsFlags {
    /// Roulette strategy; --help lists them
    #[arg(long, value_name = "NAME", long_help = strategies(), default_value_t = RenderOptions::default().strategy, value_parser = strategy)]
    rrs: String,
    /// Path segments from the camera: 1 shows emitters only; the scene's own number if absent
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_PATH_LENGTH)))]
    max_depth: Option<u32>,
    /// Size in pixels; the scene's own if absent
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Units of parallel work; the image depends on their number. 16 if absent, as many as --cache-bytes has room for
    /// if that is fewer
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    shards: Option<u32>,
    /// Path vertices that may wait in a shard, 16 to 2^24; 512 if absent. With fewer, factors above 1 become 1 more
    /// often
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(i64::from(MIN_RING)..=1 << 24))]
    ring: Option<u32>,
    /// Samples that splitting may add to one camera sample; 4096 if absent
    #[arg(long, value_name = "N")]
    split_budget: Option<u32>,
}

impl SettingsFlags {
    /// Puts them into `options`, which say already how much memory learning has.
    pub fn apply(&self, options: &mut RenderOptions) {
        options.strategy = self.rrs.clone();
        options.max_depth = self.max_depth;
        options.size = self.size;
        options.shards = self.shards.unwrap_or_else(|| shards(options));
        options.ring = self.ring;
        options.split_budget = self.split_budget;
    }
}

/// The usual number of shards, less where their statistics do not fit. If not even those of one do, the core says what
/// one needs.
fn shards(options: &RenderOptions) -> u32 {
    let learns = Strategy::parse(&options.strategy).is_ok_and(|s| s.space().is_some());
    let fits = |shards: &u32| !learns || CacheSize::within(options.learning.cache_bytes, *shards).is_some();
    let usual = RenderOptions::default().shards;
    (1..=usual).rev().find(fits).unwrap_or(1)
}

/// Help of `--rrs`.
fn strategies() -> String {
    let lines = Strategy::TABLE.iter().map(|(name, help)| format!("\n  {name}: {help}"));
    format!("Roulette strategy:{}", lines.collect::<String>())
}

fn strategy(name: &str) -> Result<String, ParseError> {
    Strategy::parse(name).map(|_| name.into())
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parts = text.split_once(['x', 'X']).ok_or("write it as 640x480")?;
    let side = |s: &str| s.parse::<u32>().map_err(|e| format!("{s:?}: {e}"));
    match [side(parts.0)?, side(parts.1)?] {
        [0, _] | [_, 0] => Err("a picture needs at least 1x1 pixels".into()),
        [w, h] if u64::from(w) * u64::from(h) > 1 << 30 => Err("more than 2^30 pixels".into()),
        size => Ok(size),
    }
}
