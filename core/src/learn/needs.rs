//! What a render learns, as the settings ask for it.

use super::cache::CacheSize;
use super::settings::{Learning, PixelEstimator};
use crate::rrs::Space;

/// What a render learns, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// The film holds albedos and normals, which the denoiser looks at.
    pub features: bool,
    /// Over what local statistics are kept, if at all.
    pub space: Option<Space>,
    /// Room for local statistics, if there are any.
    pub cache: Option<CacheSize>,
    /// How the pixels are estimated, if anything needs that.
    pub pixels: Option<PixelEstimator>,
    /// Pixels get samples by their error.
    pub adaptive: bool,
    /// The caller's choices.
    pub learning: Learning,
}
