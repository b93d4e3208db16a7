//! Flags of saved statistics.

use croupier_host::load::read_file;
use croupier_host::render::{RenderError, RenderOptions};
use croupier_host::text;
use std::error::Error;
use std::path::PathBuf;

/// Flags of saved statistics.
#[derive(clap::Args)]
#[command(next_help_heading = "Learning")]
pub(crate) struct CacheFlags {
    /// Begin with statistics that a render of this scene with the same objective has saved
    #[arg(long, value_name = "FILE")]
    pub(crate) cache_in: Option<PathBuf>,
    /// Save the statistics of the scene when the render has ended
    #[arg(long, value_name = "FILE")]
    pub(crate) cache_out: Option<PathBuf>,
}

impl CacheFlags {
    /// Puts the flags into `options`, and reads the saved statistics.
    pub(crate) fn apply(&self, options: &mut RenderOptions) -> Result<(), Box<dyn Error>> {
        let read = |p: &PathBuf| read_file(p).map_err(|e| format!("cannot read {}: {e}", text::path(p)));
        options.cache = self.cache_in.as_ref().map(read).transpose()?;
        options.save_cache = self.cache_out.is_some();
        Ok(())
    }

    /// Text of an error that is about the saved statistics: with the name of their file, and what to do.
    pub(crate) fn about(&self, e: &RenderError) -> Option<String> {
        let path = self.cache_in.as_ref().filter(|_| e.is_about_cache())?;
        let path = text::path(path);
        let hint = if e.calls_for_cache_bytes() { "; give more --cache-bytes" } else { "" };
        Some(format!("{path}: {e}{hint}"))
    }
}
