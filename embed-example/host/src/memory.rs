//! Memory of a render as a whole, against that of the machine.

use crate::render::PlanSummary;
use crate::text;
use croupier::unstable::film::{Aov, AovSet, PixelStats};
use std::fs;

/// Bytes of a render from which on they are stated before it begins: 4 GiB, or half of the machine's memory if that is
/// less.
pub const STATED: u64 = 4 << 30;

/// Bytes of a render, by what they are for. Files and the scene's own making come before and are not in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Demand {
    /// Scene, if it is in memory.
    pub scene: u64,
    /// Session and shards, by the core's plan.
    pub plan: u64,
    /// Result, and the picture with its layers while it is written; approximate.
    pub picture: u64,
}

impl Demand {
    /// Demand of a render of so many pixels.
    pub fn new(scene_bytes: u64, plan: &PlanSummary, [width, height]: [u32; 2], aovs: AovSet) -> Self {
        let pixels = u64::from(width) * u64::from(height);
        // picture, standard error, cost, samples and auxiliary values: once in the picture and once in the file's encoder
        let channels: usize = Aov::ALL.into_iter().filter(|aov| aovs.has(*aov)).map(|aov| aov.channels().len()).sum();
        let floats = 8 + channels as u64;
        let sums = size_of::<PixelStats>() + 4 * channels;
        Self {
            scene: scene_bytes,
            plan: plan.shared_bytes.saturating_add(plan.shard_bytes.saturating_mul(plan.shards.into())),
            picture: pixels.saturating_mul(sums as u64 + 2 * 4 * floats),
        }
    }

    /// All bytes.
    pub fn total(&self) -> u64 {
        self.scene.saturating_add(self.plan).saturating_add(self.picture)
    }

    /// What to tell the user on a machine of so many bytes, if its memory is known.
    ///
    /// # Errors
    /// A demand that the machine cannot meet, in words.
    pub fn judge(&self, machine: Option<u64>) -> Result<Option<String>, String> {
        let total = self.total();
        let parts = format!(
            "the render takes about {}: scene {}, session and shards {}, picture {}",
            text::bytes(total),
            text::bytes(self.scene),
            text::bytes(self.plan),
            text::bytes(self.picture)
        );
        match machine {
            Some(all) if total > all => {
                let less = "less of --size, --shards, --ring, --ledger or --cache-bytes takes less";
                Err(format!("{parts}; this machine has {}; {less}", text::bytes(all)))
            }
            _ => Ok((total > machine.map_or(STATED, |all| STATED.min(all / 2))).then_some(parts)),
        }
    }
}

/// Bytes of memory of this machine, or that the control group of this process may take; known on Linux only.
pub fn machine() -> Option<u64> {
    let file = |path: &str| fs::read_to_string(path).ok();
    let total = file("/proc/meminfo").and_then(|text| {
        let line =
            text.lines().find_map(|l| l.strip_prefix("MemTotal:"))?.trim().strip_suffix("kB")?.trim().to_string();
        line.parse::<u64>().ok()?.checked_mul(1024)
    });
    let limits = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
    let limits = limits.iter().filter_map(|path| file(path)?.trim().parse::<u64>().ok());
    limits.chain(total).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a limit of the wrong order, sums that overflow, a refusal where the memory is unknown.
    #[test]
    fn demands_are_judged() {
        let demand = |plan| Demand { scene: 1 << 20, plan, picture: 1 << 20 };
        let gib = |n: u64| n << 30;
        assert_eq!(demand(gib(1)).judge(Some(gib(64))), Ok(None));
        assert!(demand(gib(5)).judge(Some(gib(64))).unwrap().unwrap().contains("session and shards 5.00 GiB"));
        assert!(demand(gib(1)).judge(Some(gib(2))).unwrap().is_some());
        assert!(demand(gib(5)).judge(None).unwrap().is_some());
        assert!(demand(u64::MAX).judge(None).unwrap().is_some());
        let error = demand(gib(5)).judge(Some(gib(4))).unwrap_err();
        assert!(error.contains("5.00 GiB") && error.contains("has 4.00 GiB") && error.contains("--ring"), "{error}");
    }
}
