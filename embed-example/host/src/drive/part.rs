//! Parts of one picture that are rendered apart, by processes that know nothing of each other.
//!
//! A part is a range of the camera samples of every pixel: those that a render without parts would have taken with
//! these numbers, other points of the same sequences, so that together they are spread as evenly. The combs that round
//! roulette factors are told apart by the numbers of iterations. Each part learns from its own samples alone.

use super::Target;
use std::fmt;
use std::str::FromStr;

/// Most parts of a picture.
const MOST: u32 = 1 << 16;

/// Iterations by which parts are apart, more than any part has.
const ITERATIONS: u64 = 1 << 32;

/// One of several parts of a picture. As text it is both numbers, such as `3/16`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Number of the part, from 1.
    number: u32,
    /// Number of parts.
    of: u32,
}

/// Reason why there is no such part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartError {
    /// The text is no part.
    Text,
    /// More parts than samples per pixel.
    Samples {
        /// Samples per pixel of the whole picture.
        samples: u32,
        /// Number of parts.
        of: u32,
    },
    /// A picture that is to end by its error, which no part knows.
    Error,
    /// Samples with weights, which cannot be added without bias.
    Adaptive,
}

impl fmt::Display for PartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text => write!(
                f,
                "need K/N, a part and the number of parts, such as 3/16, with K from 1 to N and N up to {MOST}"
            ),
            Self::Samples { samples, of } => {
                write!(
                    f,
                    "{samples} samples per pixel cannot be divided into {of} parts: give fewer parts or more --spp"
                )
            }
            Self::Error => f.write_str(
                "no part knows the error of the picture: give --spp, --seconds or --rays, not --until-error",
            ),
            Self::Adaptive => f.write_str("parts of a picture with --adaptive cannot be merged without bias"),
        }
    }
}

impl std::error::Error for PartError {}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Part {
    type Err = PartError;

    fn from_str(text: &str) -> Result<Self, PartError> {
        let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        numbers.and_then(|(number, of)| Self::new(number, of)).ok_or(PartError::Text)
    }
}

/// What a part renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Iterations to be skipped.
    pub iterations: u64,
    /// Camera samples per pixel to be skipped: the number of the part's first sample.
    pub first: u32,
    /// Stop condition of the part.
    pub target: Target,
}

impl Share {
    /// All of a picture.
    pub fn whole(target: Target) -> Self {
        Self { iterations: 0, first: 0, target }
    }
}

impl Part {
    /// Part `number`, from 1, of `of`; `None` if there is no such part.
    pub fn new(number: u32, of: u32) -> Option<Self> {
        ((1..=of).contains(&number) && of <= MOST).then_some(Self { number, of })
    }

    /// Number of the part, from 1.
    pub fn number(self) -> u32 {
        self.number
    }

    /// Number of parts.
    pub fn of(self) -> u32 {
        self.of
    }

    /// What the part renders. Samples per pixel are those of the whole picture and divided among the parts, so that all
    /// parts together take the samples that one render would; seconds and rays are those of each part.
    ///
    /// # Errors
    /// Fewer samples than parts, or an error of the picture as the target.
    pub fn share(self, target: Target) -> Result<Share, PartError> {
        let Self { number, of } = self;
        let iterations = u64::from(number - 1) * ITERATIONS;
        let (first, target) = match target {
            Target::Spp(samples) => {
                let up_to = |k: u32| (u64::from(samples) * u64::from(k) / u64::from(of)) as u32;
                let first = up_to(number - 1);
                if samples < of {
                    return Err(PartError::Samples { samples, of });
                }
                (first, Target::Spp(up_to(number) - first))
            }
            Target::Error(_) => return Err(PartError::Error),
            Target::Seconds(_) | Target::Rays(_) => ((number - 1) * (u32::MAX / of), target),
        };
        Ok(Share { iterations, first, target })
    }
}
