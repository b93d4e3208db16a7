//! What a row of a table renders with: a roulette strategy, and perhaps other choices.

use croupier::unstable::Sampler;
use croupier::unstable::learn::{ControlVariate, Guiding, Learning, PixelEstimator};
use croupier::{Settings, Strategy};

/// Other choices by name, and what they are.
pub const MODIFIERS: &[(&str, &str)] = &[
    ("adaptive", "adaptive sampling"),
    ("shadow", "roulette of light samples and their rays"),
    ("guided", "path guiding"),
    ("auto", "path guiding where it pays"),
    ("constant", "the cached mean as control variate of roulette"),
    ("small", "one shard, and less than 256 KiB for all that is learned"),
    ("hashed", "hashed numbers in place of Sobol' points"),
    ("truth", "strategies that learn are told the true pixels instead of denoised ones"),
    ("1MiB", "as much for all that is learned of the scene, a quarter of it for path guiding"),
    ("4MiB", "the same"),
    ("16MiB", "the same"),
    ("64MiB", "the same"),
    ("256MiB", "the same"),
    ("idle", "learned factors are all 1: what learning costs where paths are as with `classic:200`"),
];

/// A strategy and choices, written `ears`, `ears+adaptive`, `ears+small+truth`.
#[derive(Clone, Debug)]
pub struct Variant {
    /// As it was written.
    pub name: String,
    /// Roulette strategy.
    pub strategy: Strategy,
    modifiers: Vec<&'static str>,
}

impl Variant {
    /// Reads a name; an error says what is wrong with it.
    pub fn parse(name: &str) -> Result<Self, String> {
        let mut parts = name.split('+');
        let strategy = Strategy::parse(parts.next().unwrap_or("")).map_err(|e| format!("{name}: {e}"))?;
        let known = |text: &str| {
            let found = MODIFIERS.iter().find(|m| m.0 == text);
            found.map(|m| m.0).ok_or_else(|| {
                let all: Vec<_> = MODIFIERS.iter().map(|m| m.0).collect();
                format!("{name}: no '{text}'; there are: {}", all.join(", "))
            })
        };
        Ok(Self { name: name.into(), strategy, modifiers: parts.map(known).collect::<Result<_, _>>()? })
    }

    fn has(&self, modifier: &str) -> bool {
        self.modifiers.contains(&modifier)
    }

    /// Is the true picture told?
    pub fn truth(&self) -> bool {
        self.has("truth")
    }

    /// The settings with these choices.
    pub fn apply(&self, mut s: Settings) -> Settings {
        s.strategy = self.strategy;
        s.adaptive |= self.has("adaptive");
        s.shadow_roulette |= self.has("shadow");
        if self.has("hashed") {
            s.sampler = Sampler::Hashed;
        }
        if self.has("guided") {
            (s.learning.guiding, s.learning.samples) = (Guiding::On, 64);
        }
        if self.has("auto") {
            s.learning.guiding = Guiding::Auto;
        }
        if self.has("constant") {
            s.control_variate = ControlVariate::Cached;
        }
        if self.has("idle") {
            s.learning.factors = [1.0, 1.0];
        }
        if self.has("small") {
            (s.shards, s.ring) = (1, 128);
            s.learning = Learning { ledger: 256, pixel_estimator: PixelEstimator::Blocks, ..s.learning };
            // records are larger with path guiding
            let [cache, guide] = if s.guides() { [103, 40] } else { [152, 0] };
            (s.learning.cache_bytes, s.learning.guide_bytes) = (cache << 10, guide << 10);
        }
        let sizes = self.modifiers.iter().filter_map(|m| m.strip_suffix("MiB")?.parse::<usize>().ok());
        for bytes in sizes.map(|mib| mib << 20) {
            (s.learning.cache_bytes, s.learning.guide_bytes) = (bytes / 4 * 3, bytes / 4);
        }
        s
    }
}
