//! Statistics that a render has to learn, as the settings ask for it.

use super::cache::CacheSize;
use super::guiding::GuideSize;
use super::settings::{Learning, PixelEstimator};
use crate::rrs::Space;

/// Statistics that a render has to learn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// Domain of local statistics, if there are any.
    pub space: Option<Space>,
    /// Room for local statistics, if there are any.
    pub cache: Option<CacheSize>,
    /// Room for path guiding, if it is on.
    pub guide: Option<GuideSize>,
    /// Estimator of the pixels, if anything needs it.
    pub pixels: Option<PixelEstimator>,
    /// Adaptive sampling is on.
    pub adaptive: bool,
    /// Settings of learning.
    pub learning: Learning,
}
