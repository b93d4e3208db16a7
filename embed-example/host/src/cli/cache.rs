//! Flags of saved statistics.

use croupier::learn::cache::CacheError;
use croupier::rrs::Space;
use croupier_host::drive::DriveError;
use croupier_host::render::RenderOptions;
use std::error::Error;
use std::path::PathBuf;

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

impl CacheFlags {
    /// Puts them into `options`, whose strategy is known, and reads the saved statistics.
    pub fn apply(&self, options: &mut RenderOptions) -> Result<(), Box<dyn Error>> {
        let strategy = options.settings.strategy;
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
