//! Flags of checkpoints.

use super::values::positive;
use croupier_host::checkpoint::Schedule;
use croupier_host::render::{RenderError, RenderOptions};
use croupier_host::text;
use std::path::{Path, PathBuf};

/// Flags of checkpoints.
#[derive(clap::Args)]
#[command(next_help_heading = "Long renders")]
pub(crate) struct CheckpointFlags {
    /// Save the state of the render in this file, at an end of an iteration, and when the render ends or is interrupted
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Seconds between two checkpoints, above 0
    #[arg(
        long,
        value_name = "S",
        default_value_t = 60.0,
        value_parser = positive,
        allow_negative_numbers = true,
        requires = "checkpoint"
    )]
    checkpoint_every: f64,
    /// Go on from a checkpoint of the same scene and settings; the picture has the same bits as without the break. May
    /// be the file of --checkpoint
    #[arg(long, value_name = "FILE", conflicts_with = "cache_in")]
    resume: Option<PathBuf>,
}

impl CheckpointFlags {
    /// Puts the flags into `options`.
    pub(crate) fn apply(&self, options: &mut RenderOptions) {
        options.checkpoint = self.output().map(|path| Schedule { path: path.into(), every: self.checkpoint_every });
        options.resume.clone_from(&self.resume);
    }

    /// File that is written.
    pub(crate) fn output(&self) -> Option<&Path> {
        self.checkpoint.as_deref()
    }

    /// File that is read.
    pub(crate) fn input(&self) -> Option<&Path> {
        self.resume.as_deref()
    }

    /// Text of an error that is about the checkpoint to go on from: with its name.
    pub(crate) fn about(&self, e: &RenderError) -> Option<String> {
        let path = self.resume.as_ref().filter(|_| e.is_about_checkpoint())?;
        Some(format!("{}: {e}", text::path(path)))
    }
}
