//! Why a session cannot start or an iteration cannot end.

use crate::instructions::INSTRUCTION_SET;
use crate::memory::MemoryError;
use crate::record::ResumeError;
use crate::sampler::Sampler;
use crate::scene::Effects;
use core::fmt;

/// Why a session cannot start or an iteration cannot end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SessionError {
    /// The processor lacks instructions that this build uses ([`crate::INSTRUCTION_SET`]).
    Instructions {
        /// The first set that is missing.
        missing: &'static str,
    },
    /// The shared block does not fit.
    Memory(MemoryError),
    /// The scene calls for effects that the profile was compiled without.
    Profile {
        /// The missing effects.
        missing: Effects,
    },
    /// The settings call for a sampler that the profile was compiled without
    /// ([`WithoutSobol`](crate::unstable::profile::WithoutSobol)).
    Sampler {
        /// The sampler.
        missing: Sampler,
    },
    /// Path guiding is on, and the profile was compiled without it ([`Guided`](crate::unstable::profile::Guided) has it,
    /// in builds with the crate's feature `guiding`).
    Guiding,
    /// The shards are not all of the plan's, in order.
    Shards {
        /// Index expected next.
        expected: u32,
    },
    /// This shard has not finished the iteration.
    Unfinished {
        /// Index of the shard.
        shard: u32,
    },
    /// This shard was made for other settings.
    Plan {
        /// Index of the shard.
        shard: u32,
    },
    /// No iteration has begun.
    NoIteration,
    /// The block cannot be resumed.
    Resume(ResumeError),
    /// An estimate of the pixels that does not fit.
    Estimate {
        /// Number of values given.
        given: usize,
    },
}

impl fmt::Display for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Instructions { missing } => {
                write!(f, "this build needs a processor with {INSTRUCTION_SET}; this one lacks {missing}")
            }
            Self::Memory(e) => write!(f, "session: {e}"),
            Self::Profile { missing } => {
                f.write_str("the scene calls for effects outside the kernel profile:")?;
                let mut names = missing.names().enumerate();
                names.try_for_each(|(i, name)| write!(f, "{}{name}", if i == 0 { " " } else { ", " }))
            }
            Self::Sampler { missing } => {
                write!(f, "the settings call for the sampler {}, which the kernel profile lacks", missing.name())
            }
            Self::Guiding => f.write_str(
                "path guiding is on, but the kernels were compiled without it: profile Guided, feature guiding",
            ),
            Self::Shards { expected } => {
                write!(f, "the end of an iteration needs every shard in order; shard {expected} is missing")
            }
            Self::Unfinished { shard } => write!(f, "shard {shard} has not finished the iteration"),
            Self::Plan { shard } => write!(f, "shard {shard} was made for another plan"),
            Self::Estimate { given } => {
                write!(f, "an estimate of {given} values does not fit the settings, or comes while an iteration runs")
            }
            Self::Resume(e) => write!(f, "session: {e}"),
            Self::NoIteration => f.write_str("no iteration has begun"),
        }
    }
}

impl core::error::Error for SessionError {}
